"""The rotor of two stiffnesses in elastic supports against its published sheet (Klochkov).

Scheme 1: rigid supports; 2: isotropic supports that stand still; 3: supports of two stiffnesses that
turn with the shaft. Tables are in the groups of the paper; what shares no code is written here from its
equations: a descriptor pencil for QZ, characteristic polynomials, and the fixed frame in time.
"""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import eigvals
from scipy.optimize import brentq, linear_sum_assignment, minimize_scalar

import jaxrotor as jr


MASS, RATE = 10.0, 100.0  # the scenes' mass and omega_0
MU, KAPPA = 0.2, 0.16
NU0 = -0.362049935181  # at alpha = 1
NAMES = {1: "dual-stiffness-rigid", 2: "dual-stiffness-elastic", 3: "dual-stiffness-rotating"}


@functools.cache
def shipped(scheme):
    return jr.load(NAMES[scheme])


def put(scene, mu=MU, kappa=KAPPA, delta=0.1, alpha=1.0, nu=None, p=None):
    """Parameters of a scene from the groups of the paper, traced or not."""
    unit = MASS * RATE
    values = {"shaft.anisotropy": mu}
    if delta is not None:
        values["disc_damping.translational"] = delta * unit
    if kappa is not None:
        values["shaft.damping"] = kappa * unit
    if any(effect.kind == "support" for effect in scene.effects):
        values["supports.stiffness"] = scene.shaft.k11 / alpha
        if kappa is not None:
            values["supports.damping"] = kappa * unit
    if nu is not None:
        values["supports.anisotropy"] = nu
    if p is not None:
        values["spin.speed"] = p * RATE
    return scene.put({path: jnp.asarray(value, float) for path, value in values.items()})


@functools.cache
def bare(scheme, friction=True, damper=True):
    """Scene of a scheme; without internal friction or external damper they are absent, not zero."""
    scene = shipped(scheme).without("unbalance").without("gravity")
    absent = {} if friction else {"shaft.damping": None, "supports.damping": None}
    if scheme == 1:
        absent.pop("supports.damping", None)
    scene = scene.put(absent)
    return scene if damper else scene.without("disc_damping")


def rotor(scheme, kappa=KAPPA, nu=None, **groups):
    nu = -0.3 if scheme == 3 and nu is None else nu
    scene = bare(scheme, kappa is not None, groups.get("delta", 0.1) is not None)
    return put(scene, kappa=kappa, nu=nu, **groups)


def roots(scene):
    return np.asarray(jr.roots(scene)) / RATE


def abscissa(scheme, friction=True):
    """`max Re lambda / omega_0` as a compiled function of the groups."""
    scene = bare(scheme, friction)
    nothing = {} if friction else {"kappa": None}
    function = jax.jit(lambda groups: jnp.max(_finite(jr.roots(put(scene, **groups, **nothing)))))
    return lambda **groups: float(function(groups)) / RATE


abscissa = functools.cache(abscissa)


def _finite(values):
    return jnp.where(jnp.isfinite(values), values.real, -jnp.inf)


def boundaries(scene, low=0.3, high=3.0, samples=100):
    """Static boundaries (lost, regained), then oscillatory ones: speeds and frequency over omega_0."""
    found = jr.stability_crossings(scene, within=(low * RATE, high * RATE), samples=samples)
    rows = [(float(o.speed) / RATE, float(o.whirl_frequency) / RATE, lost) for o, lost in found]
    static = [(speed, lost) for speed, whirl, lost in rows if whirl < 1e-6]
    flutter = [(speed, whirl, lost) for speed, whirl, lost in rows if whirl >= 1e-6]
    assert [lost for _, lost in static] == [True, False][: len(static)]
    return [speed for speed, _ in static], flutter


def check_boundaries(scene, static, third, digits, *search, **options):
    """Numbers of a row of the sheet, to half a unit of their last digit; None for a dash."""
    expected = [x for x in static if x is not None]
    found, flutter = boundaries(scene, *search, **options)
    tolerance = 0.51 * 10.0**-digits
    np.testing.assert_allclose(found, expected, rtol=0, atol=tolerance)
    if third is None:
        assert not flutter
    else:
        assert flutter[0][2]  # stability is lost
        assert abs(flutter[0][0] - third) <= 0.51e-7
    return flutter


# === references that share no code with the library


def matrices(scheme, mu, kappa, delta, alpha, nu, p):
    """`E x' = A x` of sheet 1.7, x = (q, q', q0) in the rotating frame, q = (xi, eta)."""
    one, turn = np.eye(2), np.array([[0.0, -1.0], [1.0, 0.0]])
    zero, shaft = np.zeros((2, 2)), np.diag([1 + mu, 1 - mu])
    if scheme == 1:
        alpha = 0.0
    support = 2 * one + 2 * alpha * kappa * p * turn
    if scheme == 3:
        support = 2 * np.diag([1 + nu, 1 - nu])
    e = np.block(
        [[one, zero, zero], [zero, one, -kappa * one], [zero, zero, 3 * alpha * kappa * one]]
    )
    a = np.block(
        [
            [zero, one, zero],
            [p**2 * one - delta * p * turn - shaft, -(delta + kappa) * one - 2 * p * turn, shaft],
            [alpha * shaft, alpha * kappa * one, -(support + alpha * shaft)],
        ]
    )
    return e, a


def polynomial(scheme, root, mu, kappa, delta, alpha, nu, p):
    """Characteristic function of sheet 1.6."""
    if scheme == 1:
        s = delta + kappa
        linear = 2 * s * (1 - p**2) + 4 * p**2 * delta
        constant = (1 - p**2) ** 2 - mu**2 + delta**2 * p**2
        return np.polyval([1, 2 * s, s**2 + 2 * (1 + p**2), linear, constant], root)
    if scheme == 2:
        sigma = 1 + kappa * root
        ahead, behind = root + 1j * p, root - 1j * p
        (l1, b1), (l2, b2) = (
            (w**2 + delta * w, 2 + 2 * alpha * kappa * w) for w in (ahead, behind)
        )
        a1, a2, e1, e2 = alpha * l1 + b1, alpha * l2 + b2, l1 * b1, l2 * b2
        return (sigma**2 - mu**2) * a1 * a2 + sigma * (a1 * e2 + a2 * e1) + e1 * e2
    m = root**2 + delta * root - p**2
    s1, s2 = (1 + sign * mu + kappa * root for sign in (1, -1))
    b1, b2 = (2 * (1 + sign * nu) + 2 * alpha * kappa * root for sign in (1, -1))
    n1, n2 = alpha * s1 + b1, alpha * s2 + b2
    return (m * n1 + s1 * b1) * (m * n2 + s2 * b2) + p**2 * (2 * root + delta) ** 2 * n1 * n2


def correction(scheme, root, **case):
    """Relative change of a root by one Newton step on the polynomial."""
    h = 1e-5 * abs(root)
    slope = polynomial(scheme, root + h, **case) - polynomial(scheme, root - h, **case)
    return abs(polynomial(scheme, root, **case) * 2 * h / slope / root)


CASES = [
    {"mu": 0.2, "kappa": 0.16, "delta": 0.1, "alpha": 1.0, "nu": -0.3, "p": 0.5},
    {"mu": -0.45, "kappa": 0.3, "delta": 0.02, "alpha": 2.5, "nu": 0.6, "p": 1.7},
    {"mu": 0.05, "kappa": 0.02, "delta": 0.0, "alpha": 0.2, "nu": -0.8, "p": 0.95},
    {"mu": 0.7, "kappa": 0.0, "delta": 0.3, "alpha": 1.4, "nu": 0.1, "p": 3.0},
    {"mu": 0.0, "kappa": 0.5, "delta": 0.2, "alpha": 6.0, "nu": 0.0, "p": -1.2},
]


def same_set(found, expected, tolerance):
    gap = np.abs(np.asarray(found)[:, None] - np.asarray(expected)[None])
    assert gap.shape[0] == gap.shape[1]
    assert gap[linear_sum_assignment(gap)].max() < tolerance


@pytest.mark.parametrize("case", CASES, ids=str)
@pytest.mark.parametrize("scheme", [1, 2, 3])
def test_roots_against_the_descriptor_pencil_and_the_polynomial(scheme, case):
    values = {k: v for k, v in case.items() if scheme == 3 or k != "nu"}
    found = roots(put(bare(scheme), **values))
    e, a = matrices(scheme, **case)
    expected = eigvals(a, e)
    same_set(found, expected[np.isfinite(expected) & (np.abs(expected) < 1e9)], 1e-10)
    assert max(correction(scheme, root, **case) for root in found) < 1e-9


@pytest.mark.hard("2.8 turning and fixed axes")
@pytest.mark.hard("2.9 static stiffness that is not symmetric")
@pytest.mark.parametrize("scheme", [2, 3])
def test_roots_against_integration_in_fixed_axes(scheme):
    """After one revolution the shaft's axes coincide with fixed ones: multipliers are `exp(lambda T)`."""
    case = {"mu": 0.3, "kappa": 0.16, "delta": 0.05, "alpha": 1.5, "nu": -0.4, "p": 0.9}
    p = case["p"]

    def turned(values, angle):
        c, s = np.cos(angle), np.sin(angle)
        r = np.array([[c, -s], [s, c]])
        return r @ np.diag(values) @ r.T

    spin = p * np.array([[0.0, -1.0], [1.0, 0.0]])

    def rate(t, flat):
        """Disc w and ends w0 in fixed axes; an element that turns is damped by `w. - i p w`."""
        w, v, ends = flat.reshape(3, 2, -1)
        shaft = turned([1 + case["mu"], 1 - case["mu"]], p * t)
        own = np.eye(2)
        if scheme == 3:
            own = turned([1 + case["nu"], 1 - case["nu"]], p * t)
        stretch = w - ends
        # kappa (w. - w0. - spin stretch) + K stretch = 2 kappa (w0. - [spin w0]) + 2 own w0 / alpha
        pull = (
            case["kappa"] * (v - spin @ stretch) + shaft @ stretch - 2 * own @ ends / case["alpha"]
        )
        pull += 2 * case["kappa"] * spin @ ends if scheme == 3 else 0.0
        moving = pull / (3 * case["kappa"])
        force = case["kappa"] * (v - moving - spin @ stretch) + shaft @ stretch
        return np.concatenate([v, -case["delta"] * v - force, moving]).ravel()

    period = 2 * np.pi / p
    run = solve_ivp(rate, (0, period), np.eye(6).ravel(), "DOP853", rtol=1e-12, atol=1e-14)
    multipliers = eigvals(run.y[:, -1].reshape(6, 6))
    groups = {k: v for k, v in case.items() if scheme == 3 or k != "nu"}
    same_set(np.exp(roots(put(bare(scheme), **groups)) * period), multipliers, 1e-9)


# === 1.7: singular limits

TO_NO_FRICTION = {
    1e-2: -0.0512984020858,
    1e-6: -0.0500001298967,
    1e-10: -0.0500000000130,
    1e-12: -0.0500000000001,
    1e-14: -0.05,
    0.0: -0.05,
    None: -0.05,
}


@pytest.mark.hard("2.5 friction of the shaft vanishes")
@pytest.mark.parametrize("kappa", TO_NO_FRICTION)
def test_friction_may_vanish(kappa, record_property):
    """Scheme 3 by a small number and by construction; the explicit form is unstable below 1e-12."""
    found = roots(rotor(3, kappa=kappa, p=0.5))
    error = abs(found.real.max() - TO_NO_FRICTION[kappa])
    record_property("measured", f"kappa = {kappa or 0:g}: {error:.0e}")
    assert error < 0.51e-13
    assert found.size == (6 if kappa and kappa > 1e-8 else 4)


@pytest.mark.hard("2.5 compliance of the supports vanishes")
def test_compliance_may_vanish():
    rigid = roots(rotor(1, p=1.7)).real.max()
    shift = {1e-2: -2.137e-4, 1e-4: -2.107e-6, 1e-6: -2.107e-8}
    for alpha, expected in shift.items():
        found = roots(rotor(2, alpha=alpha, p=1.7)).real.max() - rigid
        assert found == pytest.approx(expected, rel=3e-4)
    same_set(roots(rotor(2, alpha=1e-13, p=1.7)), roots(rotor(1, p=1.7)), 1e-12)


def test_rigid_ends_are_no_support():
    """`ends="rigid"` has two coordinates fewer than the stiffest support, and the same motion."""
    assert jr.assemble(bare(1)).n == 1 and jr.assemble(bare(2)).n == 2
    assert roots(rotor(2, kappa=None, p=1.7)).size == 4  # massless ends carry no root of their own


@pytest.mark.parametrize("scheme", [1, 2, 3])
def test_equal_axes_as_an_isotropic_rotor(scheme):
    """mu = nu = 0 in rotating axes is the isotropic rotor in fixed ones, `lambda - i Omega`."""
    absent = {"shaft.anisotropy": None} | ({"supports.anisotropy": None} if scheme == 3 else {})
    even = rotor(scheme, mu=0.0, p=1.3, **({"nu": 0.0} if scheme == 3 else {}))
    circular = roots(even.put(absent)) - 1.3j
    same_set(roots(even), np.concatenate([circular, circular.conj()]), 1e-12)


# === 3.1: scheme 1


def table(text):
    """Rows of a table of the sheet, below its head; None for a dash."""
    _, *rows = text.strip().splitlines()
    return [[None if x == "-" else float(x) for x in row.split()] for row in rows]


RIGID = table(
    """
    delta, P_G1, P_G2, P_G3, p03, p31, p32
    0.005 0.89445515          -          -          -         -         -
     0.01 0.89453907          -          -          -         -         -
     0.02 0.89487564 1.09489615 1.12937376 0.08919669 1.0401771 1.2185704
     0.05 0.89727186 1.09197216 1.31625847 0.30410682 1.0121516 1.6203653
      0.1 0.90648925 1.08086874 1.62804316 0.62316971 1.0048734 2.2512129
     0.15 0.92519454 1.05901608 1.94005584 0.93732948 1.0027264 2.8773853
      0.2  0.9797959        1.0 2.25220272 1.25044068  1.001762 3.5026434
      0.3          -          - 2.87672549  1.8758053 1.0009202 4.7525308
      0.4          -          - 3.50141806 2.50085086 1.0005672 6.0022689
    """
)


@pytest.mark.hard("2.3 a formula for flutter where there is none")
@pytest.mark.parametrize(("delta", "one", "two", "third", "whirl", "slow", "fast"), RIGID)
def test_scheme_1_boundaries(delta, one, two, third, whirl, slow, fast):
    found = check_boundaries(rotor(1, delta=delta), (one, two), third, 8, high=4.0)
    if third is None:
        return
    speed, frequency, _ = found[0]
    assert speed == pytest.approx(third, abs=0.51e-8)
    assert frequency == pytest.approx(whirl, abs=0.51e-8)
    assert speed - frequency == pytest.approx(slow, abs=0.51e-7)
    assert speed + frequency == pytest.approx(fast, abs=0.51e-7)
    # Sheet 1.8, in closed form.
    s = delta + KAPPA
    square = np.max(np.roots([(2 * KAPPA / s) ** 2, -(4 - KAPPA**2), -(MU**2 + s**2)]).real)
    assert speed == pytest.approx(np.sqrt(square), rel=1e-11)
    assert frequency == pytest.approx(
        np.sqrt(1 + square * (delta - KAPPA) / (delta + KAPPA)), rel=1e-9
    )


@pytest.mark.hard("2.4 the unstable band closes")
@pytest.mark.parametrize("delta", [0.05, 0.1, 0.19, 0.2, 0.2009, 0.201, 0.201017])
@pytest.mark.parametrize("kappa", [0.05, 0.16])
def test_scheme_1_zone_in_closed_form(delta, kappa):
    """`P^4 - (2 - delta^2) P^2 + 1 - mu^2`, whatever the internal friction, to widths of 6e-4."""
    squares = np.sort(np.roots([1, 0, -(2 - delta**2), 0, 1 - MU**2]).real)[2:]
    found, _ = boundaries(rotor(1, delta=delta, kappa=kappa), high=2.5)
    np.testing.assert_allclose(found, squares, rtol=1e-10)
    assert np.prod(found) == pytest.approx(np.sqrt(1 - MU**2), rel=1e-10)


def top(scheme, low, high, **groups):
    """Largest growth rate between two speeds with a single peak between."""
    function = abscissa(scheme)
    best = minimize_scalar(
        lambda p: -function(p=p, **groups),
        bounds=(low, high),
        method="bounded",
        options={"xatol": 1e-9},
    )
    return -best.fun


@pytest.mark.hard("2.4 the unstable band closes")
def test_scheme_1_least_damping_without_a_zone(record_property):
    least = brentq(lambda delta: top(1, 0.9, 1.09, delta=delta), 0.19, 0.21, xtol=1e-13)
    assert least == pytest.approx(0.201017924010, abs=1e-9)
    one, two = (np.sqrt(1 + sign * MU) for sign in (-1, 1))
    record_property("measured", f"least damping to {abs(least - two + one):.0e}")
    assert least == pytest.approx(two - one, abs=1e-9)
    assert boundaries(rotor(1, delta=0.201018), high=2.2)[0] == []


def test_scheme_1_second_and_third_boundary_meet():
    """Double zero root at delta = 0.0145; below it no boundary but the first."""
    delta, p = 0.014503674928, 1.095156730674
    assert np.sort(np.abs(roots(rotor(1, delta=delta, p=p))))[1] < 1e-5  # square root of rounding
    static, flutter = boundaries(rotor(1, delta=delta + 1e-4))
    assert static[1] == pytest.approx(p, abs=1e-4) and flutter[0][0] == pytest.approx(p, abs=1e-3)
    assert static[1] < flutter[0][0]
    assert len(boundaries(rotor(1, delta=delta - 1e-5), high=3.0)[0]) == 1
    assert boundaries(rotor(1, delta=delta - 1e-5), high=3.0)[1] == []


def test_scheme_1_third_boundary_over_anisotropy():
    published = {0.05: 1.625191, 0.1: 1.625763, 0.2: 1.628043, 0.3: 1.631808, 0.4: 1.637007}
    published[0.6] = 1.651433
    found = {mu: boundaries(rotor(1, mu=mu), high=2.5)[1][0][0] for mu in published}
    assert found == pytest.approx(published, abs=0.51e-6)
    assert boundaries(rotor(1, mu=0.0), high=2.5)[1][0][0] == pytest.approx(1 + 0.1 / KAPPA)


# === 3.2: scheme 2

ELASTIC = table(
    """
    alpha, P1, P2, P_G1, P_G2, P_G3, p03, P_G3 / mean, p31, P_G4
     0.1 0.877058  1.06399  0.890474 1.0479721 1.6551785 0.6760834 1.7054 0.979095 1340.67899
    0.25 0.852803 1.021508 0.8692542 1.0023207 1.7163257 0.7716525 1.8314 0.944673  342.77799
     0.5 0.816497 0.960769 0.8417385 0.9327451 1.8683449 0.9716446 2.1025   0.8967  123.11413
       1 0.755929 0.866025         -         - 2.3522605 1.5251166 2.9005 0.827144   44.26566
     1.5 0.707107 0.794719         -         - 3.1356511 2.3516562 4.1758 0.783995   23.60615
       2 0.666667 0.738549         -         - 4.5499887 3.7828612 6.4759 0.767127   13.72474
     2.2 0.652328 0.719195         -         - 5.7366513 4.9604858 8.3654 0.776166   10.42317
    2.25 0.648886  0.71459         -         - 6.3009653 5.5167668 9.2425 0.784199    9.40093
       3 0.603023 0.654654         -         -         -         -      -        -          -
       4   0.5547 0.594089         -         -         -         -      -        -          -
       6 0.485071 0.510754         -         -         -         -      -        -          -
      10      0.4 0.414039         -         -         -         -      -        -          -
    """
)


@pytest.mark.hard("2.2 no third boundary, or stability regained far above it")
@pytest.mark.hard("2.9 static stiffness that is not symmetric")
@pytest.mark.parametrize("row", ELASTIC, ids=lambda row: str(row[0]))
def test_scheme_2_boundaries(row):
    alpha, slow, fast, one, two, third, whirl, ratio, p31, fourth = row
    scene = rotor(2, alpha=alpha)
    found = jr.critical_speeds(scene)
    forward, backward = found.forward, found.backward
    assert backward.size == 0
    np.testing.assert_allclose(forward / RATE, [slow, fast], rtol=0, atol=0.51e-6)
    found = check_boundaries(scene, (one, two), third, 7, high=9.0)
    if third is None:
        return
    speed, frequency, _ = found[0]
    assert frequency == pytest.approx(whirl, abs=0.51e-7)
    assert speed - frequency == pytest.approx(p31, abs=0.51e-6)
    assert speed / ((slow + fast) / 2) == pytest.approx(ratio, abs=0.6e-4)
    (speed, _, lost), *rest = boundaries(scene, 0.5 * (fourth + third), 1.2 * fourth, 100)[1]
    assert speed == pytest.approx(fourth, abs=0.51e-5) and not lost and not rest


TIPS = {  # delta, kappa: alpha, p
    (0.0, 0.16): (3.13075, 6.2407),
    (0.02, 0.16): (2.92291, 6.5355),
    (0.05, 0.16): (2.65387, 6.9677),
    (0.1, 0.16): (2.29210, 7.6675),
    (0.15, 0.16): (2.00851, 8.3492),
    (0.2, 0.16): (1.78046, 9.0186),
    (0.3, 0.16): (1.43713, 10.3367),
    (0.1, 0.04): (3.55969, None),
    (0.1, 0.08): (2.92262, None),
    (0.1, 0.32): (1.80091, None),
}


@pytest.mark.hard("2.2 no third boundary, or stability regained far above it")
@pytest.mark.parametrize("point", TIPS, ids=str)
def test_scheme_2_tip_of_the_unstable_tongue(point):
    """Beyond the tip a rotor with both dampings is stable at every speed."""
    (delta, kappa), (alpha, p) = point, TIPS[point]
    function = abscissa(2)

    def peak(alpha):
        # Between the speeds 2 and 60 the growth rate has one peak, narrowest on a logarithmic scale.
        at = lambda x: -function(p=np.exp(x), alpha=alpha, delta=delta, kappa=kappa)
        return minimize_scalar(
            at, bounds=np.log([2, 60]), method="bounded", options={"xatol": 1e-8}
        )

    tip = brentq(lambda alpha: -peak(alpha).fun, 0.9 * alpha, 1.1 * alpha, xtol=1e-7)
    assert tip == pytest.approx(alpha, abs=0.6e-5)
    if p is not None:
        assert np.exp(peak(tip).x) == pytest.approx(p, abs=1e-4)


OVER_DELTA = {  # alpha: delta: P_G1, P_G2, P_G3
    0.5: {
        0: (0.816960, 0.961031, 1.0028174),
        0.01: (0.817514, 0.960380, 1.0886940),
        0.02: (0.818400, 0.959341, 1.1747055),
        0.05: (0.823234, 0.953709, 1.4335838),
        0.1: (0.841739, 0.932745, 1.8683449),
        0.15: (None, None, 2.3084458),
        0.2: (None, None, 2.7555472),
        0.3: (None, None, 3.6783570),
        0.4: (None, None, 4.6542822),
    },
    1: {
        0: (0.759422, 0.865383, 1.1955152),
        0.01: (0.761192, 0.863374, 1.3078758),
        0.02: (0.763519, 0.860746, 1.4207976),
        0.05: (0.775165, 0.847825, 1.7635750),
        0.1: (None, None, 2.3522605),
        0.15: (None, None, 2.9705070),
        0.2: (None, None, 3.6290630),
        0.3: (None, None, 5.1330904),
        0.4: (None, None, 7.1301228),
    },
    2: {
        0: (None, None, 2.0691148),
        0.01: (None, None, 2.2686807),
        0.02: (None, None, 2.4752151),
        0.05: (None, None, 3.1462812),
        0.1: (None, None, 4.5499887),
        0.15: (None, None, 7.6165060),
        0.2: (None, None, None),
        0.3: (None, None, None),
        0.4: (None, None, None),
    },
}


@pytest.mark.parametrize("alpha", OVER_DELTA)
def test_scheme_2_boundaries_over_damping(alpha):
    for delta, (*static, third) in OVER_DELTA[alpha].items():
        check_boundaries(
            rotor(2, alpha=alpha, delta=delta), static, third, 6, high=8.5, samples=100
        )


LEAST = {  # alpha: scheme 2 with kappa = 0.16, |P2 - P1|
    0.1: (0.18623894, 0.18693233),
    0.25: (0.16495208, 0.16870497),
    0.5: (0.13220465, 0.14427234),
    0.75: (0.10293224, 0.12525311),
    1: (0.07687470, 0.11009646),
    1.25: (0.05365967, 0.09778193),
    1.5: (0.03291388, 0.08761263),
    2: (0.0, 0.07188228),
    3: (0.0, 0.05163098),
    6: (0.0, 0.02568267),
    10: (0.0, 0.01403934),
}


@pytest.mark.slow
@pytest.mark.parametrize("alpha", LEAST)
def test_least_damping_without_a_zone(alpha):
    one, two = np.asarray(jr.critical_speeds(rotor(2, alpha=alpha)).forward) / RATE
    friction, none = LEAST[alpha]
    assert two - one == pytest.approx(none, abs=0.51e-8)
    excess = lambda delta: top(2, one, two, alpha=alpha, delta=delta)
    if friction == 0:
        assert excess(0.0) < 0
    else:
        assert brentq(excess, 0.5 * friction, none) == pytest.approx(friction, abs=1e-8)
    # Without friction, and in scheme 3 of equal support axes whatever the friction, the gap itself.
    for scene in (
        rotor(2, kappa=0.0, alpha=alpha, delta=none - 1e-5),
        rotor(3, nu=0.0, alpha=alpha, delta=none - 1e-5),
    ):
        assert len(boundaries(scene, 0.3, two + 0.01)[0]) == 2
        wider = scene.put({"disc_damping.translational": jnp.asarray((none + 1e-5) * MASS * RATE)})
        assert boundaries(wider, 0.3, two + 0.01)[0] == []


def test_scheme_2_compliance_without_a_zone():
    published = {0.1: 0.7767198, 0.05: 1.2921338, 0.02: 1.6705958, 0.0: 1.9615270}
    for delta, alpha in published.items():
        found = brentq(
            lambda a, d=delta: top(2, *zone_of(a), alpha=a, delta=d), 0.5, 2.2, xtol=1e-9
        )
        assert found == pytest.approx(alpha, abs=2e-7)


def zone_of(alpha):
    """Critical speeds of scheme 2, sheet eq. (16)."""
    return [np.sqrt(2 * (1 + s * MU) / (2 + alpha * (1 + s * MU))) for s in (-1, 1)]


# === 3.3 to 3.7: scheme 3

OVER_NU = table(
    """
    nu, P_xi, P_eta, delta_min, P_G1, P_G2, P_G3, p03, p31
       -0.95 0.303822 0.814758 0.510936 0.3065231 0.8075773 1.0121814 0.3521934 0.659988
        -0.9 0.414039 0.812939   0.3989 0.4183673  0.804529 1.0656522 0.3920047 0.673647
        -0.8 0.547723  0.80904 0.261317 0.5558229 0.7972493 1.1695547 0.4667272 0.702827
        -0.7 0.632456 0.804748 0.172292 0.6467091  0.787011 1.2621886 0.5331713 0.729017
        -0.6  0.69282      0.8  0.10718 0.7254496 0.7640175 1.3403733 0.5896835  0.75069
        -0.5 0.738549 0.794719  0.05617         -         - 1.4043761 0.6361726 0.768204
        -0.4 0.774597 0.788811 0.014214         -         - 1.4558024 0.6735547 0.782248
    -0.36205  0.78638  0.78638      0.0         -         -  1.472419 0.6856173 0.786802
        -0.3 0.803837 0.782154 0.021683         -         - 1.4965238 0.7030862 0.793438
        -0.2 0.828079 0.774597 0.053482         -         - 1.5282137 0.7259709 0.802243
        -0.1 0.848528 0.765942 0.082586         -         - 1.5521731  0.743175 0.808998
       -0.07 0.854056 0.763094 0.090962         -         - 1.5579954 0.7473346 0.810661
         0.0 0.866025 0.755929 0.110096  0.786406 0.8324628 1.5692729 0.7553473 0.813926
        0.07 0.876848 0.747929 0.128918  0.770167 0.8515302 1.5774025  0.761043  0.81636
         0.1 0.881176 0.744208 0.136967  0.764355   0.85795 1.5799275 0.7627737 0.817154
         0.2 0.894427 0.730297  0.16413 0.7457472 0.8758964 1.5840534  0.765326 0.818727
         0.3  0.90612 0.713506 0.192613 0.7259575 0.8905781 1.5809877 0.7623772  0.81861
         0.5  0.92582 0.666667 0.259153 0.6751306 0.9142133 1.5468315 0.7341045 0.812727
         0.7 0.941784  0.58554 0.356244 0.5910631 0.9329834 1.4541905  0.656788 0.797402
         0.9 0.954987      0.4 0.554987 0.4026942 0.9485976 1.2684969 0.4970968   0.7714
    """
)


@pytest.mark.parametrize("row", OVER_NU, ids=lambda row: str(row[0]))
def test_scheme_3_over_support_anisotropy(row):
    nu, stiff, soft, least, one, two, third, whirl, p31 = row
    scene = rotor(3, nu=nu)
    speeds = np.asarray(jr.critical_speeds(scene).forward) / RATE
    np.testing.assert_allclose(speeds, np.sort([stiff, soft]), rtol=0, atol=0.6e-6)
    assert np.ptp(speeds) == pytest.approx(least, abs=0.6e-6)
    speed, frequency, _ = check_boundaries(scene, (one, two), third, 7, 0.2)[0]
    assert frequency == pytest.approx(whirl, abs=0.6e-7)
    assert speed - frequency == pytest.approx(p31, abs=0.6e-6)
    if one is not None:  # sheet 1.8: the product of both is that of the critical speeds
        (low, high), _ = boundaries(scene, 0.2)
        assert low * high == pytest.approx(np.prod(speeds), rel=1e-9)


def apart(scene):
    return np.ptp(np.asarray(jr.critical_speeds(scene).forward)) / RATE


SUPPRESSED = {  # alpha: delta: range of nu without a zone
    0.25: {
        0.02: (-0.772742, -0.709930),
        0.05: (-0.808116, -0.645092),
        0.1: (-0.852585, -0.477344),
        0.2: (-0.909540, 0.295004),
    },
    1: {
        0.02: (-0.414841, -0.304997),
        0.05: (-0.486369, -0.211452),
        0.1: (-0.587202, -0.037152),
        0.2: (-0.735032, 0.324729),
    },
    3: {
        0.02: (-0.187775, -0.083960),
        0.05: (-0.262831, -0.004350),
        0.1: (-0.380734, 0.128842),
        0.2: (-0.583932, 0.380959),
    },
}


@pytest.mark.parametrize("alpha", SUPPRESSED)
def test_scheme_3_range_without_a_zone(alpha):
    """The zone closes where the critical speeds come closer than delta."""
    for delta, ends in SUPPRESSED[alpha].items():
        for nu, out in zip(ends, (-1, 1), strict=True):
            excess = lambda nu, d=delta: apart(rotor(3, alpha=alpha, nu=nu)) - d
            found = brentq(excess, nu - 0.01, nu + 0.01, xtol=1e-9)
            assert found == pytest.approx(nu, abs=0.6e-6)
            for side, count in ((out, 2), (-out, 0)):
                scene = rotor(3, alpha=alpha, nu=found + side * 1e-4, delta=delta)
                assert len(boundaries(scene, high=1.0)[0]) == count


OVER_ALPHA = table(
    """
    nu = -0.07: alpha, P_G1, P_G2, P_G3, p03, P_G3 / mean, delta_min; nu = +0.07: G1, G2, G3
    0.05 0.8989579 1.0628715 1.6381938 0.6469994 1.6679 0.192009  0.89745 1.065371 1.638282
     0.1 0.8916885 1.0456269 1.6469794 0.6688304  1.698 0.183567  0.88871  1.05047 1.647443
    0.25 0.8713997 0.9978075 1.6640311 0.7217732 1.7779  0.16118 0.864151 1.008975 1.667018
     0.5 0.8426138 0.9280813 1.6595029 0.7685268 1.8714 0.131547 0.828048 0.948668 1.669098
    0.75 0.8219243 0.8648431 1.6197428 0.7719935 1.9172 0.108821 0.796989 0.896897 1.635441
       1         -         - 1.5579954 0.7473346 1.9268 0.090962 0.770167  0.85153 1.577403
       2         -         - 1.2789451 0.5772847 1.8265 0.047264        -        - 1.296759
       3         -         -  1.073782 0.4453521 1.7133 0.025289        -        - 1.085404
       4         -         - 0.9352587 0.3608151 1.6335 0.012694        -        - 0.942818
       6         -         - 0.7639377 0.2654268 1.5386 0.000331        -        - 0.767587
      10         -         - 0.5905746 0.1825021 1.4543   0.0096        -        - 0.591852
      20         -         - 0.4170822 0.1148415  1.388 0.013421        -        - 0.417336
    """
)


@pytest.mark.parametrize("row", OVER_ALPHA, ids=lambda row: str(row[0]))
def test_scheme_3_over_compliance(row):
    alpha, *static, third, whirl, ratio, least = row[:7]
    scene = rotor(3, nu=-0.07, alpha=alpha)
    speeds = np.asarray(jr.critical_speeds(scene).forward) / RATE
    assert np.ptp(speeds) == pytest.approx(least, abs=0.6e-6)
    speed, frequency, _ = check_boundaries(scene, static, third, 7, 0.2, 2.0)[0]
    assert frequency == pytest.approx(whirl, abs=0.6e-7)
    assert speed / speeds.mean() == pytest.approx(ratio, abs=0.6e-4)
    *static, third = row[7:]
    static, flutter = boundaries(rotor(3, nu=0.07, alpha=alpha), 0.2, 2.0)
    expected = [x for x in row[7:9] if x is not None]
    np.testing.assert_allclose(static, expected, rtol=0, atol=0.6e-6)
    assert flutter[0][0] == pytest.approx(third, abs=0.6e-6)


DAMPED = {  # nu: delta: P_G1, P_G2, P_G3
    -0.9: {
        0.005: (0.414050, None, None),
        0.01: (0.414082, None, None),
        0.02: (0.414209, None, None),
        0.05: (0.415103, 0.810856, 0.8907175),
        0.1: (0.418367, 0.804529, 1.0656522),
        0.2: (0.432715, 0.777854, 1.4436979),
        0.3: (0.463415, 0.726323, 1.8760301),
        0.4: (None, None, 2.3887427),
        0.5: (None, None, 3.0059335),
    },
    -0.3: {
        0.005: (0.782442, 0.803541, 0.8281073),
        0.01: (0.783360, 0.802599, 0.8632307),
        0.02: (0.788744, 0.797120, 0.9334862),
        0.05: (None, None, 1.1443685),
        0.1: (None, None, 1.4965238),
        0.2: (None, None, 2.2054160),
        0.3: (None, None, 2.9232901),
        0.4: (None, None, 3.6520302),
        0.5: (None, None, 4.3917702),
    },
    -0.09: {
        0.005: (0.765076, None, None),
        0.01: (0.765285, 0.850090, 0.8842991),
        0.02: (0.766132, 0.849150, 0.9586613),
        0.05: (0.772704, 0.841928, 1.1818488),
        0.1: (None, None, 1.5541813),
        0.2: (None, None, 2.3006094),
        0.3: (None, None, 3.0502035),
        0.4: (None, None, 3.8035001),
        0.5: (None, None, 4.5604727),
    },
    NU0: {
        0.005: (None, None, 0.8206082),
        0.01: (None, None, 0.8548395),
        0.02: (None, None, 0.9233140),
        0.05: (None, None, 1.1288925),
        0.1: (None, None, 1.4724190),
        0.2: (None, None, 2.1654159),
        0.3: (None, None, 2.8700533),
        0.4: (None, None, 3.5887717),
        0.5: (None, None, 4.3217202),
    },
}


@pytest.mark.parametrize("nu", DAMPED)
def test_scheme_3_over_damping(nu):
    for delta, (*static, third) in DAMPED[nu].items():
        check_boundaries(rotor(3, nu=nu, delta=delta), static, third, 6, 0.3, 5.0)


def test_scheme_3_second_and_third_boundary_meet():
    found = np.sort(np.abs(roots(rotor(3, nu=-0.9, delta=0.0268716, p=0.81234))))
    assert found[1] < 5e-3 and abs(abscissa(3)(nu=-0.9, delta=0.0268716, p=0.81234)) < 5e-3
    above = boundaries(rotor(3, nu=-0.9, delta=0.0269))
    assert above[0][1] == pytest.approx(0.81234, abs=2e-4)
    assert above[1][0][0] == pytest.approx(0.81234, abs=2e-4)
    assert len(boundaries(rotor(3, nu=-0.9, delta=0.0268))[0]) == 1


BEST = {  # alpha: nu0
    0.1: -0.887174264961,
    0.5: -0.566190378969,
    1: -0.362049935181,
    2: -0.200000000000,
    5: -0.082762530298,
    10: -0.041594578792,
}


@pytest.mark.hard("2.14 the best anisotropy of the supports")
@pytest.mark.parametrize("alpha", BEST)
def test_zone_closes_at_the_right_support_anisotropy(alpha):
    """Issue, point 2: at nu0, without internal damping, no unstable band at any compliance.

    The rotor is then isotropic, so its two critical speeds are one and even no damping leaves none.
    """
    nu = -4 * MU / (alpha * (1 - MU**2) + np.hypot(alpha * (1 - MU**2), 4 * MU))
    assert nu == pytest.approx(BEST[alpha], abs=0.6e-12)
    assert alpha == pytest.approx(-2 * MU * (1 - nu**2) / (nu * (1 - MU**2)), rel=1e-12)
    scene = rotor(3, kappa=None, nu=nu, alpha=alpha)
    one, two = np.asarray(jr.critical_speeds(scene).forward) / RATE
    assert one == pytest.approx(two, rel=1e-12)
    assert boundaries(scene, 0.0, 4.0) == ([], [])
    undamped = rotor(3, kappa=None, delta=0.0, nu=nu, alpha=alpha)
    assert boundaries(undamped, 0.0, 4.0) == ([], [])
    off = rotor(3, kappa=None, nu=nu + 0.02, alpha=alpha, delta=1e-6)
    assert len(boundaries(off, 0.9 * one, 1.1 * one)[0]) == 2


def test_scheme_3_mistuned_and_best_for_range():
    """P_G3 is greatest at nu = +0.2097, not at nu0, and barely above the critical speed at nu0."""
    third = lambda nu: -boundaries(rotor(3, nu=nu), 1.2, 1.8, 100)[1][0][0]
    best = minimize_scalar(third, bounds=(0.1, 0.3), method="bounded", options={"xatol": 1e-7})
    assert -best.fun == pytest.approx(1.584087, abs=0.6e-6)
    assert best.x == pytest.approx(0.2097, abs=1e-4)


# === 3.8, 3.10: roots

GROWTH = {  # scheme, nu: p: max Re lambda
    (1, None): {
        0.3: -0.107055,
        0.45: -0.094587,
        0.6: -0.082308,
        0.8: -0.066087,
        1: 0.049703,
        1.2: -0.033963,
        1.5: -0.010113,
        2: 0.029134,
    },
    (2, None): {
        0.3: -0.090394,
        0.45: -0.083476,
        0.6: -0.076603,
        0.8: -0.012227,
        1: -0.058439,
        1.2: -0.049465,
        1.5: -0.036184,
        2: -0.014645,
    },
    (3, -0.3): {
        0.3: -0.084946,
        0.45: -0.074180,
        0.6: -0.063427,
        0.8: -0.049132,
        1: -0.034903,
        1.2: -0.020763,
        1.5: 0.000242,
        2: 0.034570,
    },
    (3, NU0): {
        0.3: -0.085391,
        0.45: -0.074333,
        0.6: -0.063292,
        0.8: -0.048618,
        1: -0.034023,
        1.2: -0.019532,
        1.5: 0.001962,
        2: 0.036988,
    },
}


@pytest.mark.parametrize("case", GROWTH, ids=str)
def test_growth_rates(case):
    scheme, nu = case
    found = {p: abscissa(scheme)(p=p, **({} if nu is None else {"nu": nu})) for p in GROWTH[case]}
    assert found == pytest.approx(GROWTH[case], abs=0.51e-6)


UPPER = [  # scheme, p, nu, roots of the upper half
    (1, 0.5, None, [-0.090479508 + 0.471729494j, -0.169520492 + 1.498931294j]),
    (1, 1.0, None, [0.049703368, -0.149658546, -0.210022411 + 1.997233954j]),
    (1, 2.0, None, [0.029134432 + 0.993311058j, -0.289134432 + 3.005025903j]),
    (
        2,
        0.8,
        None,
        [
            -0.012226721,
            -0.122752434,
            -0.139573133 + 1.610007123j,
            -6.249603956 + 0.333873790j,
        ],  # printed 0.333877390,
    ),
    (
        2,
        2.5,
        None,
        [0.005998124 + 1.670368097j, -0.208932649 + 3.329224918j, -6.253732142 + 1.615944087j],
    ),
    (
        3,
        0.6,
        -0.9,
        [0.126636936, -0.207186370 + 1.272058928j, -0.264398425, -2.790110785, -9.571088318],
    ),
    (
        3,
        1.5,
        -0.07,
        [-0.003817873 + 0.689745399j, -0.204325928 + 2.310451812j, -6.123473216, -6.373572514],
    ),
]


@pytest.mark.parametrize(("scheme", "p", "nu", "upper"), UPPER)
def test_roots(scheme, p, nu, upper):
    found = roots(rotor(scheme, p=p, nu=nu))
    same_set(found[found.imag > -1e-9], upper, 0.8e-9)


@pytest.mark.hard("2.10 a compliance that counts two supports")
def test_shipped_scenes_are_the_rotor_of_the_sheet():
    """alpha = 1, delta = 0.1, kappa = 0.16, mu = 0.2, nu = -0.3, in SI with a disc of 10 kg."""
    for scheme, p in ((1, 0.45), (2, 0.8), (3, 0.6)):
        found = roots(shipped(scheme))
        same_set(found, roots(rotor(scheme, p=p)), 1e-12)
        expected = GROWTH[(scheme, -0.3 if scheme == 3 else None)][p]
        assert found.real.max() == pytest.approx(expected, abs=0.51e-6)


# === 3.11: the conclusions of the article, each with our number


def third(scheme, high=2.6, **groups):
    """P_G3 and its frequency in the axes of the shaft; None without."""
    flutter = boundaries(rotor(scheme, **groups), 0.1, high)[1]
    return flutter[0][:2] if flutter else None


def test_claim_1_scheme_1_has_no_zone_beyond_delta_0_2():
    """True: from 0.201018 on."""
    assert len(boundaries(rotor(1, delta=0.2010))[0]) == 2
    assert boundaries(rotor(1, delta=0.2011))[0] == []


def test_claim_2_third_boundary_of_scheme_1():
    """True: 2.25 at delta = 0.2; eq. (15) as printed gives 2.259896."""
    assert third(1, delta=0.2)[0] == pytest.approx(2.252203, abs=0.51e-6)
    k, ratio = KAPPA, 1 + KAPPA / 0.2
    printed, right = (
        np.roots(
            [
                (2 * k / 0.2) ** 2,
                0,
                last + k**4 / 0.04 + 2 * k**3 / 0.2 - 4 * ratio**2,
                0,
                -(MU**2 + (k + 0.2) ** 2) * ratio**2,
            ]
        ).real.max()
        for last in (-2 * k * 0.2, k**2)
    )
    assert (printed, right) == pytest.approx((2.259896, 2.252203), abs=0.51e-6)


def test_claim_3_scheme_1_is_unstable_above_the_first_boundary_at_delta_0_02():
    """False: stable between 1.094896 and 1.129374; true below delta = 0.0145."""
    static, flutter = boundaries(rotor(1, delta=0.02))
    assert (static[1], flutter[0][0]) == pytest.approx((1.094896, 1.129374), abs=0.51e-6)
    assert boundaries(rotor(1, delta=0.0145), 0.3, 40.0)[0][1:] == []
    assert third(1, delta=0.0145, high=40.0) is None


def test_claim_4_third_boundary_falls_as_the_anisotropy_grows():
    """False: it rises from 1.6252 to 1.6514; that the zone widens is true."""
    found = [boundaries(rotor(1, mu=mu)) for mu in (0.15, 0.3, 0.6)]
    assert np.all(np.diff([flutter[0][0] for _, flutter in found]) > 0)
    assert np.all(np.diff([static[1] - static[0] for static, _ in found]) > 0)


def test_claim_5_internal_friction_leaves_the_zone_alone():
    """True in schemes 1 and 3, false in scheme 2: 0.75942-0.86538 with it, 0.75593-0.86603 without."""
    for scheme, nu in ((1, None), (3, 0.3)):
        zones = [boundaries(rotor(scheme, nu=nu, kappa=kappa))[0] for kappa in (0.02, 0.16)]
        np.testing.assert_allclose(*zones, rtol=1e-10)
    with_, without = (boundaries(rotor(2, kappa=kappa, delta=0.0))[0] for kappa in (KAPPA, 0.0))
    np.testing.assert_allclose(with_, [0.75942, 0.86538], rtol=0, atol=0.51e-5)
    np.testing.assert_allclose(without, [0.75593, 0.86603], rtol=0, atol=0.51e-5)


def test_claims_6_and_7_the_slow_whirl_at_flutter_is_the_mean_critical_speed():
    """Roughly: 1.0402, 1.0049, 1.0018 in scheme 1; off by 2 % to 10 % in the others."""
    expected = {0.02: 1.0402, 0.1: 1.0049, 0.2: 1.0018}
    slow = {delta: -np.diff(third(1, delta=delta))[0] for delta in expected}
    assert slow == pytest.approx(expected, abs=0.51e-4)
    cases = [(2, {"alpha": 1}, 0.02), (2, {"alpha": 2, "high": 5}, 0.092)]
    cases += [(3, {"nu": -0.9}, 0.098), (3, {"nu": -0.07}, 0.003)]
    for scheme, groups, error in cases:
        whirl = -np.diff(third(scheme, **groups))[0]
        groups.pop("high", None)
        mean = np.mean(jr.critical_speeds(rotor(scheme, **groups)).forward) / RATE
        assert whirl / mean - 1 == pytest.approx(error, abs=0.51e-3)


SHARE = [  # scheme, groups, |p32| / |p31|
    (1, {}, 0.049, 0.51e-3),
    (2, {}, 0.0066, 0.51e-4),
    (3, {"nu": -0.9}, 0.141, 0.51e-3),
    (1, {"delta": 0.02}, 0.41, 0.51e-2),
]


@pytest.mark.parametrize(("scheme", "groups", "share", "tolerance"), SHARE)
def test_claim_8_flutter_is_forward_and_slower_than_the_shaft(scheme, groups, share, tolerance):
    """True: in fixed axes the part that whirls at p31 = P_G3 - p03 exceeds that at p32."""
    speed, whirl = third(scheme, **groups)
    shown = jr.modes(rotor(scheme, p=speed, **groups))
    assert shown.frame == "rotating" and 0 < whirl < speed
    values = np.nan_to_num(np.asarray(shown.values), posinf=1e9) / RATE
    one = int(np.argmin(np.abs(values - 1j * whirl)))
    fast, slow = abs(complex(shown.shapes[one, 0])), abs(complex(shown.counter[one, 0]))
    assert fast / slow == pytest.approx(share, abs=tolerance)


def test_claim_9_scheme_2_has_no_zone_at_equal_stiffness():
    """True with delta >= 0.0769: alpha from 0.7767 at 0.1, from 1.2921 at 0.05."""
    assert boundaries(rotor(2, delta=0.0769))[0] == []
    assert len(boundaries(rotor(2, delta=0.0768))[0]) == 2


def test_claims_10_and_11_scheme_2_third_boundary_has_a_maximum_at_alpha_3():
    """False: it grows without bound and vanishes from 2.2921 on; 3 to 4 mean speeds at 1.05 to 1.45."""
    speed = {a: third(2, alpha=a, high=8.0)[0] for a in (0.1, 0.5, 1.0, 1.05, 1.45, 1.5, 2.0, 2.25)}
    assert np.all(np.diff(list(speed.values())) > 0)
    ratio = {alpha: one / np.mean(zone_of(alpha)) for alpha, one in speed.items()}
    assert ratio[1.0] < 3 and ratio[1.05] == pytest.approx(3, abs=0.06)
    assert ratio[1.45] == pytest.approx(4, abs=0.06) and ratio[1.5] > 4
    for alpha in (2.2922, 3.0, 10.0):
        assert boundaries(rotor(2, alpha=alpha), 0.0, 500.0) == ([], [])


def test_claim_12_scheme_2_damping_widens_the_range_linearly():
    """True up to alpha = 0.5, false from 1 on: there the slope grows from 11 to 20."""
    deltas = np.array([0.0, 0.1, 0.2, 0.3, 0.4])
    slopes = {
        alpha: np.diff([third(2, alpha=alpha, delta=d, high=8.0)[0] for d in deltas]) / 0.1
        for alpha in (0.5, 1.0)
    }
    assert np.ptp(slopes[0.5]) < 0.15 * slopes[0.5].mean()
    assert slopes[1.0][0] == pytest.approx(11.6, abs=0.1)
    assert slopes[1.0][-1] == pytest.approx(20.0, abs=0.1)
    assert third(2, alpha=2.0, delta=0.15, high=8.0)[0] == pytest.approx(7.6165, abs=0.51e-4)
    assert third(2, alpha=2.0, delta=0.2, high=40.0) is None


def test_claims_13_and_14_scheme_3_near_the_right_anisotropy_needs_no_damping():
    """True for the zone; but flutter begins 4.4 % above the critical speed at delta = 0.005."""
    assert boundaries(rotor(3, nu=NU0, delta=1e-4), 0.3, 0.7)[0] == []
    speed, _ = third(3, nu=NU0, delta=0.005)
    (one, two) = np.asarray(jr.critical_speeds(rotor(3, nu=NU0)).forward) / RATE
    assert (speed, one, two) == pytest.approx((0.820608, 0.786380, 0.786380), abs=0.51e-6)
    assert speed / one == pytest.approx(1.0435, abs=0.51e-4)


def test_claims_15_to_17_scheme_3_compliance_narrows_the_range():
    """True: to 1.39 critical speeds at alpha = 20, whatever nu; widest at small alpha (roughly)."""
    ratio = {}
    for alpha in (1.0, 6.0, 10.0, 20.0):
        mean = np.mean(jr.critical_speeds(rotor(3, alpha=alpha, nu=-0.07)).forward) / RATE
        ratio[alpha] = third(3, alpha=alpha, nu=-0.07)[0] / mean
    assert ratio == pytest.approx({1: 1.93, 6: 1.54, 10: 1.45, 20: 1.39}, abs=0.51e-2)
    at_ten = [third(3, alpha=10.0, nu=nu)[0] for nu in (-0.9, -0.5, 0.0, 0.5, 0.9)]
    assert (min(at_ten), max(at_ten)) == pytest.approx((0.5828, 0.5989), abs=0.51e-4)
    assert third(3, alpha=0.4, nu=0.3)[0] == pytest.approx(1.6787, abs=0.51e-4)
    assert third(3, alpha=0.25, nu=0.0)[0] == pytest.approx(1.6656, abs=0.51e-4)
    assert third(1)[0] == pytest.approx(1.6280, abs=0.51e-4)
    others = [third(3, alpha=a, nu=nu)[0] for a in (0.3, 0.4, 0.6) for nu in (0.1, 0.3, 0.5)]
    assert max(others) == pytest.approx(1.6787, abs=0.51e-4)


def test_claim_18_scheme_3_damping_widens_the_range_linearly():
    """True near nu0: .693, .705, .719, .733 a tenth; a little more than that at -0.9."""
    at = lambda nu: np.diff([third(3, nu=nu, delta=d, high=5.0)[0] for d in np.arange(1, 6) / 10])
    np.testing.assert_allclose(at(NU0), [0.693, 0.705, 0.719, 0.733], rtol=0, atol=0.51e-3)
    steps = at(-0.9)
    assert np.all(np.diff(steps) > 0) and steps[-1] > 1.6 * steps[0]


def test_claim_19_scheme_2_is_the_best():
    """True, and more: beyond alpha* it is stable at every speed; schemes 1 and 3 never are."""
    assert boundaries(rotor(2, alpha=3.0), 0.0, 5000.0) == ([], [])
    assert third(1) is not None and third(3, alpha=3.0) is not None


# === 4, 5: derivatives and hard cases


def derivative(function, at, h=1e-4):
    """Sixth-order central difference."""
    weights = {1: 3 / 4, 2: -3 / 20, 3: 1 / 60}
    return sum(w * (function(at + k * h) - function(at - k * h)) for k, w in weights.items()) / h


@pytest.mark.slow
def test_derivative_of_the_third_boundary():
    """The derivative by nu follows from the implicit function theorem."""

    def boundary(nu):
        found = jr.onset_speed(put(bare(3), nu=nu), (1.2 * RATE, 1.8 * RATE), 100)
        return jnp.stack(found) / RATE

    for nu, *slopes in ((-0.3, 0.35954781, 0.26023460), (0.0, 0.13847712, 0.09784104)):
        value, slope = jax.jvp(boundary, (nu,), (1.0,))
        np.testing.assert_allclose(value, third(3, nu=nu), rtol=1e-10)
        np.testing.assert_allclose(slope, slopes, rtol=0, atol=0.51e-8)


@pytest.mark.hard("2.7 critical speeds cross")
def test_derivative_of_the_critical_speeds_through_their_crossing():
    """P_eta decreases and P_xi increases with nu; at nu0 they are equal and get the mean derivative."""
    speeds = lambda nu: jr.critical_speeds(put(bare(3), nu=nu)).forward / RATE
    apart = jax.jacfwd(lambda nu: speeds(nu)[:2])(NU0 + 1e-4)
    np.testing.assert_allclose(apart, [-0.065532, 0.298720], rtol=0, atol=1e-4)
    total = jax.jacfwd(lambda nu: speeds(nu)[0] + speeds(nu)[1])(NU0 + 1e-4)
    assert total == pytest.approx(0.298720 - 0.065532, abs=1e-4)
    at_crossing = jax.jacfwd(lambda nu: speeds(nu)[:2])(NU0)
    np.testing.assert_allclose(at_crossing, [(0.298720 - 0.065532) / 2] * 2, rtol=0, atol=1e-6)


@pytest.mark.hard("2.11 derivatives at double and defective roots")
def test_double_root_gets_the_mean_of_the_derivatives():
    """At kappa = 0 and nu0 two slow roots are equal, and the abscissa has a kink of slopes +-0.140196."""
    scene, p = bare(3, False), 0.784789
    values = lambda nu: jr.roots(put(scene, kappa=None, nu=nu, p=p))[:4] / RATE
    at_rest = np.asarray(values(NU0))
    assert np.abs(at_rest[:2] + 0.05).max() < 2e-6  # double, and p_d has six digits
    exact = np.asarray(jax.jacfwd(values)(NU0))
    mean = derivative(lambda nu: np.sum(np.asarray(values(nu))[:2]) / 2, NU0)
    assert exact[:2].sum() / 2 == pytest.approx(mean, abs=1e-7)
    kink = lambda nu: float(np.max(np.asarray(values(nu)).real))
    for side in (-1, 1):
        slope = (kink(NU0 + side * 1e-3) - kink(NU0)) / 1e-3
        assert slope == pytest.approx(0.140196, abs=2e-3)


@pytest.mark.slow
@pytest.mark.hard("2.11 derivatives at double and defective roots")
def test_derivative_grows_towards_an_exceptional_point():
    """At kappa = 0, p = 0.75 the abscissa is flat from -0.46614 to 0.03830, with square roots beyond."""
    growth = lambda nu: jnp.max(_finite(jr.roots(put(bare(3, False), kappa=None, nu=nu, p=0.75))))
    slope = jax.jit(jax.grad(lambda nu: growth(nu) / RATE))
    inside = lambda nu: np.ptp(roots(rotor(3, kappa=None, nu=nu, p=0.75)).real[:2]) - 1e-9
    assert brentq(inside, -0.48, -0.45, xtol=1e-14) == pytest.approx(-0.46614, abs=0.51e-5)
    edge = brentq(inside, 0.03, 0.05, xtol=1e-14)
    assert edge == pytest.approx(0.03830, abs=0.51e-5)
    assert abs(slope(-0.3)) < 1e-12
    for distance, size, digit in ((1e-2, 0.6, 0.05), (1e-4, 5.9, 0.05), (1e-6, 59, 0.5)):
        assert slope(edge + distance) == pytest.approx(size, abs=digit)


@pytest.mark.hard("2.11 derivatives at double and defective roots")
def test_friction_makes_the_abscissa_smooth_where_it_had_a_kink():
    """At kappa = 0.16 and nu0 the roots are -0.049731 +- 0.003649i, and the slope is -0.008465, not 0."""
    p = 0.784789
    slow = roots(rotor(3, nu=NU0, p=p))[:2]
    np.testing.assert_allclose(slow.real, -0.049731, rtol=0, atol=1e-6)
    np.testing.assert_allclose(np.abs(slow.imag), 0.003649, rtol=0, atol=2e-6)
    growth = jax.jit(lambda nu: jnp.max(_finite(jr.roots(put(bare(3), nu=nu, p=p)))) / RATE)
    assert jax.grad(growth)(NU0) == pytest.approx(-0.008465, abs=1e-6)


@pytest.mark.hard("2.6 no damping: marginal beside the band")
def test_no_damping_at_all_is_marginal_beside_the_band(record_property):
    for scheme in (1, 2, 3):
        absent, zero = (rotor(scheme, kappa=x, delta=x, p=0.4) for x in (None, 0.0))
        same_set(roots(absent), roots(zero), 1e-13)
        growth = np.abs(roots(absent).real).max()
        record_property("measured", f"scheme {scheme}: |Re lambda| {growth:.0e}")
        assert growth < 1e-13
        edges, flutter = boundaries(zero, 0.0, 4.0)
        np.testing.assert_allclose(
            edges, np.asarray(jr.critical_speeds(zero).forward) / RATE, rtol=1e-10
        )
        assert flutter == []
    onset = jr.onset_speed(zero, (0.0, 3 * RATE), 100)
    assert float(onset.speed) == pytest.approx(edges[0] * RATE, rel=1e-12)


@pytest.mark.hard("2.6 internal friction alone")
def test_internal_friction_alone():
    """Scheme 1 is unstable from the first boundary on; in scheme 2 the supports damp."""
    static, flutter = boundaries(rotor(1, delta=0.0), 0.3, 30.0)
    assert len(static) == 1 and flutter == []
    assert third(2, delta=0.0)[0] == pytest.approx(1.1955152, abs=0.51e-7)


@pytest.mark.hard("2.2 an onset where there is none", outcome="refused")
def test_no_third_boundary_without_internal_friction():
    for scheme in (1, 2, 3):
        static, flutter = boundaries(rotor(scheme, kappa=0.0), 0.0, 200.0)
        assert flutter == [] and len(static) == (0 if scheme == 3 else 2)
    with pytest.raises(ValueError, match="never loses its stability"):
        jr.onset_speed(rotor(3, kappa=0.0), (0.0, 500.0), 100)
    with pytest.raises(ValueError, match="unstable already"):
        jr.onset_speed(rotor(1), (95.0, 500.0), 100)


@pytest.mark.hard("2.7 either axis may be the stiff one")
def test_stiff_axis_may_be_either():
    """-mu rotates the axes by 90 degrees, so the roots are the same."""
    same_set(roots(rotor(1, mu=-0.2, p=1.3)), roots(rotor(1, p=1.3)), 1e-12)
    same_set(roots(rotor(3, mu=-0.2, nu=0.3, p=1.3)), roots(rotor(3, nu=-0.3, p=1.3)), 1e-12)


def test_backward_spin_mirrors():
    for scheme in (1, 2, 3):
        same_set(roots(rotor(scheme, p=-1.3)), roots(rotor(scheme, p=1.3)), 1e-12)
