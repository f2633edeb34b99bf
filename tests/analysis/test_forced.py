"""Steady responses: the dual-stiffness rotor by its sheet, and equations written by hand.

A response is put into the equations of motion, written here from the sheet's section 1 in the fixed
frame, and what remains must vanish at any time; one is reached from rest by scipy as well.
"""

from fractions import Fraction

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from oracles import Beam
from published import DELTA, KAPPA, MU, dual
from scipy.integrate import solve_ivp
from scipy.optimize import minimize_scalar
from systems import DENSITY, DIAMETER, DIAMETRAL, LENGTH, MASS, YOUNG, bare

import jaxrotor as jr
from jaxrotor.analysis.resonance import from_resonance


J = np.array([[0.0, -1.0], [1.0, 0.0]])


def special(alpha, mu=MU):
    """nu0: supports that compensate the two stiffnesses of the shaft, eq. (10)."""
    root = np.sqrt(alpha**2 * (1 - mu**2) ** 2 + 16 * mu**2)
    return -4 * mu / (alpha * (1 - mu**2) + root)


# === the sheet, section 3

SCHEMES = {
    "1": {"scheme": 1},
    "2, al=1": {"scheme": 2},
    "3, al=1, nu=-0.3": {"scheme": 3, "nu": -0.3},
    "3, al=1, nu0": {"scheme": 3, "nu": special(1.0)},
}
TABLE = {  # scheme: p, 0x, 2x, 1x of e = (1, 0), of e = (0, 1)
    "1": [
        (0.3, 1.06265931, 0.3274514, 0.0810609, 0.1266622),
        (0.45, 1.11663433, 0.8944244, 0.2028931, 0.3381081),
        (0.6, 0.92478073, 0.377339, 0.4283653, 0.8123538),
        (0.8, 0.96773934, 0.1220074, 1.1925696, 3.7712362),
        (1.0, 0.97470882, 0.06451772, 7.4535599, 7.4535599),
        (1.2, 0.97409553, 0.04076086, 5.5813099, 2.2999556),
        (1.5, 0.96775869, 0.02413904, 2.1229194, 1.5446507),
        (2.0, 0.95009576, 0.01265338, 1.4249973, 1.2476150),
    ],
    "2, al=1": [
        (0.3, 1.56728227, 0.4405579, 0.1360500, 0.1862499),
        (0.45, 1.44860911, 0.6065775, 0.3674490, 0.5416662),
        (0.6, 1.48457870, 0.1655463, 0.9115419, 1.6055910),
        (0.8, 1.49180165, 0.07007732, 20.6397891, 25.4701049),
        (1.0, 1.48913803, 0.04015336, 3.6523575, 2.2830680),
        (1.2, 1.48299909, 0.02636395, 2.0555764, 1.6388874),
        (1.5, 1.47012299, 0.01613013, 1.4980503, 1.3356346),
        (2.0, 1.44219103, 0.008731656, 1.2341133, 1.1665737),
    ],
    "3, al=1, nu=-0.3": [
        (0.3, 1.58987660, 0.09617397, 0.1615918, 0.1722082),
        (0.45, 1.58166425, 0.1193312, 0.4541231, 0.4918432),
        (0.6, 1.57898163, 0.03294901, 1.2317471, 1.3914696),
        (0.8, 1.57180432, 0.01412365, 8.7204031, 8.2475491),
        (1.0, 1.56229653, 0.00814638, 2.7203103, 2.4950213),
        (1.2, 1.55084009, 0.005376706, 1.7936113, 1.7207024),
        (1.5, 1.53044354, 0.003313441, 1.3967848, 1.3677105),
        (2.0, 1.48938958, 0.001815048, 1.1905458, 1.1785044),
    ],
    "3, al=1, nu0": [
        (0.3, 1.61424863, 0.004886803, 0.1700538, 0.1700538),
        (0.45, 1.61074720, 0.008433005, 0.4840783, 0.4840783),
        (0.6, 1.60585560, 0.003155114, 1.3571180, 1.3571180),
        (0.8, 1.59730689, 0.001789239, 7.7232709, 7.7232709),
        (1.0, 1.58656509, 0.001269501, 2.5349081, 2.5349081),
        (1.2, 1.57379754, 0.0009850607, 1.7342633, 1.7342633),
        (1.5, 1.55126454, 0.0007313527, 1.3732179, 1.3732179),
        (2.0, 1.50639684, 0.0004964692, 1.1808063, 1.1808063),
    ],
}


@pytest.mark.parametrize("name", TABLE)
def test_table_of_responses(name):
    """The response equals sheet 3.8 to the digits given."""
    p, sag, twice, along, across = np.transpose(TABLE[name])
    weight = jr.weight_response(dual(**SCHEMES[name]), p)
    np.testing.assert_allclose(np.abs(weight.deflection[:, 0]), sag, rtol=0, atol=5.1e-9)
    np.testing.assert_allclose(np.abs(weight.twice[:, 0]), twice, rtol=5.1e-7)
    for phase, expected in ((0.0, along), (np.pi / 2, across)):
        found = jr.unbalance_response(dual(**SCHEMES[name], phase=phase), p)
        np.testing.assert_allclose(np.abs(found.forward[:, 0]), expected, rtol=0, atol=5.1e-8)
        assert not np.any(found.backward) and found.sidebands is None


@pytest.mark.hard("2.8 weight in turning and fixed axes")
def test_weight_response_in_closed_form():
    """Scheme 1 with damping, amplitudes and phases; and without damping by K_xi, K_eta."""
    p = np.array([0.2, 0.7, 1.9])
    found = jr.weight_response(dual(1), p)
    still = 1 / ((1 - 1j * KAPPA * p) - MU**2 / (1 - 4 * p**2 - 1j * (2 * DELTA + KAPPA) * p))
    twice = -MU * still.conj() / (1 - 4 * p**2 + 1j * (2 * DELTA + KAPPA) * p)
    np.testing.assert_allclose(found.deflection[:, 0], still, rtol=1e-12)
    np.testing.assert_allclose(found.twice[:, 0], twice, rtol=1e-12)

    nu, alpha = 0.25, 1.3
    k, e = (
        2 * (1 + s * MU) * (1 + s * nu) / (alpha * (1 + s * MU) + 2 * (1 + s * nu)) for s in (1, -1)
    )
    found = jr.weight_response(dual(3, alpha=alpha, nu=nu, kappa=None, delta=0.0), p)
    below = k * e - 2 * p**2 * (k + e)
    np.testing.assert_allclose(found.deflection[:, 0], (k + e - 8 * p**2) / below / 2, rtol=1e-12)
    np.testing.assert_allclose(found.twice[:, 0], -(k - e) / below / 2, rtol=1e-12)


PEAKS = {  # sheet, 3.8: speed and height of the largest twice-per-revolution response
    "1": ({"scheme": 1}, 0.485634, 1.115728),
    "1, undamped shaft": ({"scheme": 1, "kappa": None}, 0.488621, 2.043905),
    "2": ({"scheme": 2}, 0.398273, 0.983223),
    "3, nu=0": ({"scheme": 3, "nu": 0.0}, 0.398964, 1.086441),
    "3, nu=-0.3": ({"scheme": 3, "nu": -0.3}, 0.392571, 0.221817),
    "3, nu0": ({"scheme": 3, "nu": special(1.0)}, 0.393208, 0.014200),
}


@pytest.mark.hard("2.8 weight in turning and fixed axes")
@pytest.mark.parametrize("name", PEAKS)
def test_peak_of_the_twice_per_revolution_response(name):
    values, speed, height = PEAKS[name]
    scene = dual(**values)
    twice = lambda p: -float(abs(jr.weight_response(scene, p).twice[0, 0]))
    peak = minimize_scalar(twice, (speed - 0.02, speed + 0.02), tol=1e-9)
    assert peak.x == pytest.approx(speed, abs=6e-7)
    assert -peak.fun == pytest.approx(height, abs=6e-7)


RESIDUAL = {  # sheet, 3.9: p, and 2x at nu0, nu0 + 0.01 without and with internal damping
    0.2: (1.942e-03, 9.943e-03, 1.013e-02),
    0.3: (4.887e-03, 1.720e-02, 1.747e-02),
    0.4: (1.400e-02, 5.573e-02, 3.941e-02),
    0.45: (8.433e-03, 2.186e-02, 2.166e-02),
    0.6: (3.155e-03, 5.543e-03, 6.527e-03),
    1.0: (1.270e-03, 1.357e-03, 1.973e-03),
    2.0: (4.965e-04, 2.985e-04, 6.356e-04),
}


def test_detuned_from_the_special_anisotropy():
    p, (damped, off, off_damped) = list(RESIDUAL), np.transpose(list(RESIDUAL.values()))
    twice = lambda **values: np.abs(jr.weight_response(dual(3, **values), p).twice[:, 0])
    nu = special(1.0)
    np.testing.assert_allclose(twice(nu=nu), damped, rtol=5e-4)
    np.testing.assert_allclose(twice(nu=nu + 0.01, kappa=None), off, rtol=5e-4)
    np.testing.assert_allclose(twice(nu=nu + 0.01), off_damped, rtol=5e-4)


@pytest.mark.parametrize("alpha", [0.1, 0.5, 1.0, 2.0, 5.0, 10.0])
def test_special_anisotropy_ends_the_twice_per_revolution_response(alpha):
    """At nu0 without internal damping the response vanishes at every speed, and the sag is 1 / K."""
    scene = dual(3, alpha=alpha, nu=special(alpha), kappa=None)
    found = jr.weight_response(scene, [0.05, 0.2, 0.4, 0.45, 0.7, 1.0, 2.0])
    nu = special(alpha)
    stiffness = 2 * (1 + MU) * (1 + nu) / (alpha * (1 + MU) + 2 * (1 + nu))
    np.testing.assert_allclose(found.deflection[:, 0], 1 / stiffness, rtol=1e-12)
    assert np.max(np.abs(found.twice)) < 1e-13 / stiffness
    if alpha == 1:
        assert 1 / stiffness == pytest.approx(1.6170937365, abs=5e-11)


# === substitution into the equations of motion


def along(mean, share, angle):
    c, s = np.cos(2 * angle), np.sin(2 * angle)
    return mean * (np.eye(2) + share * np.array([[c, s], [s, -c]]))


FIXED = {"nu": 0.3, "angle": 0.4}


def unequal(p, turning):
    """A two-stiffness shaft on equal supports, or an equal shaft on supports of fixed axes."""
    options = {} if turning else {"anisotropy": FIXED["nu"], "angle": FIXED["angle"]}
    supports = [jr.Support(at, 1.0, damping=KAPPA, **options) for at in (0.0, 1.0)]
    return jr.Scene(
        jr.MasslessShaft(
            1.0, 0.5, 1.0, anisotropy=MU if turning else None, damping=KAPPA, ends="elastic"
        ),
        jr.Disc(0.5, 1.0),
        jr.DiscDamping(0.5, DELTA),
        *supports,
        jr.Unbalance(0.5, 1.0, 0.3, 0.6),
        jr.Gravity(2.0, angle=-1.1),
        spin=jr.ConstantSpeed(p),
    )


def left_over(p, turning, t, disc, support, force):
    """Residual of the equations of disc and supports; a motion is `z, z., z..` as planar vectors."""
    shaft = along(1.0, MU if turning else 0.0, p * t)
    bearing = along(2.0, 0.0 if turning else FIXED["nu"], FIXED["angle"])
    (q, v, a), (q0, v0, _) = disc, support
    elastic = shaft @ (q - q0) + KAPPA * (v - v0 - p * J @ (q - q0))
    return np.concatenate(
        [a + DELTA * v + elastic - force, bearing @ q0 + 2 * KAPPA * v0 - elastic]
    )


def motion(parts, t):
    """`z, z., z..` of `sum A exp(i w t)` at a time, as planar vectors."""
    z = [sum(a * (1j * w) ** k * np.exp(1j * w * t) for w, a in parts) for k in range(3)]
    return [np.array([one.real, one.imag]) for one in z]


def check(p, turning, parts, force):
    """`parts(s)` of the motion at the disc (s = 0) and at the supports (s = 1)."""
    for t in (0.0, 0.7, 2.9, 11.0):
        f = force(t)
        f = np.array([f.real, f.imag])
        rest = left_over(p, turning, t, motion(parts(0), t), motion(parts(1), t), f)
        np.testing.assert_allclose(rest, 0, rtol=0, atol=1e-12)


AT = [0.5, 0.0]


@pytest.mark.parametrize("turning", [True, False])
@pytest.mark.parametrize("p", [0.6, -1.4])
def test_unbalance_and_weight_obey_the_equations(p, turning):
    scene = unequal(p, turning)
    found = jr.unbalance_response(scene, p, AT)
    parts = lambda s: [(p, found.forward[0, s]), (-p, found.backward[0, s])]
    check(p, turning, parts, lambda t: 0.3 * p**2 * np.exp(1j * (p * t + 0.6)))
    assert bool(abs(found.backward[0, 0]) > 1e-3) is not turning
    weight = jr.weight_response(scene, p, AT)
    parts = lambda s: [(0.0, weight.deflection[0, s]), (2 * p, weight.twice[0, s])]
    check(p, turning, parts, lambda t: 2.0 * np.exp(-1.1j))
    assert bool(abs(weight.twice[0, 0]) > 1e-3) is turning


FORCES = {
    "none": lambda phi: np.exp(0.5j) * np.cos(phi),
    "forward": lambda phi: np.exp(1j * (0.5 + phi)),
    "backward": lambda phi: np.exp(1j * (0.5 - phi)),
}


@pytest.mark.slow
@pytest.mark.parametrize("whirl", FORCES)
@pytest.mark.parametrize("turning", [True, False])
def test_forced_response_obeys_the_equations(turning, whirl):
    p, frequencies = 0.7, [0.0, 0.45, 0.7, 1.9]
    force = jr.HarmonicForce(0.5, 3.0, 0.5, phase=0.2, whirl=whirl)
    found = jr.forced_response(unequal(p, turning), frequencies, force, AT)
    for k, w in enumerate(frequencies):

        def parts(s, k=k, w=w):
            own = [(w, found.forward[k, s]), (-w, found.backward[k, s])]
            if not turning:
                return own
            sides = zip((2 * p - w, 2 * p + w), found.sidebands[:, k, s], strict=True)
            return own + list(sides)

        check(p, turning, parts, lambda t, w=w: 3.0 * FORCES[whirl](w * t + 0.2))
    assert (found.sidebands is None) is not turning


@pytest.mark.slow
def test_forced_response_is_reached_from_rest():
    """Integration by scipy of a two-stiffness shaft, the supports' first-order equation solved for v0."""
    p, w = 0.6, 0.85
    scene = unequal(p, True)
    force = jr.HarmonicForce(0.5, 1.0, 0.3)
    found = jr.forced_response(scene, w, force)

    def field(t, y):
        q, v, q0 = y.reshape(3, 2)
        elastic = along(1.0, MU, p * t) @ (q - q0) + KAPPA * (v - p * J @ (q - q0))
        v0 = (elastic - 2.0 * q0) / (3 * KAPPA)
        push = np.cos(w * t) * np.array([np.cos(0.3), np.sin(0.3)])
        return np.concatenate([v, push - DELTA * v - elastic + KAPPA * v0, v0])

    times = np.linspace(400.0, 430.0, 40)
    run = solve_ivp(field, (0, times[-1]), np.zeros(6), "DOP853", times, rtol=1e-11, atol=1e-12)
    parts = [(w, found.forward), (-w, found.backward)]
    parts += list(zip((2 * p - w, 2 * p + w), found.sidebands, strict=True))
    expected = sum(complex(a[0, 0]) * np.exp(1j * frequency * times) for frequency, a in parts)
    assert float(jr.growth_rate(scene)) * 400 < -23
    np.testing.assert_allclose(run.y[0] + 1j * run.y[1], expected, rtol=0, atol=1e-8)


def test_jeffcott_rotor_on_unequal_supports():
    """Each axis is an oscillator, z = X cos, Y sin; between the resonances whirl is backward."""
    m, k, c, e, ks, share = 2.0, 3e5, 40.0, 1e-4, 2e5, 0.4
    scene = jr.Scene(
        jr.MasslessShaft(1.0, 0.5, k),
        jr.Disc(0.5, m),
        jr.DiscDamping(0.5, c),
        jr.Support(0.5, ks, anisotropy=share),
        jr.Unbalance(0.5, m, e),
        spin=jr.ConstantSpeed(1.0),
    )
    speeds = np.array([200.0, 470.0, 500.0, 700.0])
    found = jr.unbalance_response(scene, speeds)
    x, y = (
        m * e * speeds**2 / (k + ks * (1 + s * share) - m * speeds**2 + 1j * c * speeds)
        for s in (1, -1)
    )
    np.testing.assert_allclose(found.forward[:, 0], (x + y) / 2, rtol=1e-11)
    np.testing.assert_allclose(found.backward[:, 0], (x - y).conj() / 2, rtol=1e-11)
    angle = np.linspace(0, 2 * np.pi, 20001)[:, None]
    radius = np.hypot((x * np.exp(1j * angle)).real, (y * np.exp(1j * angle)).imag)
    np.testing.assert_allclose(found.major[:, 0], radius.max(axis=0), rtol=1e-6)
    np.testing.assert_allclose(np.abs(found.minor[:, 0]), radius.min(axis=0), rtol=1e-4)
    assert (np.asarray(found.minor[:, 0]) < 0).tolist() == [False, True, True, False]


def test_hysteresis_by_whirl_and_spin():
    """The loss has the sign of whirl minus spin for each part, and is zero for synchronous whirl."""
    m, k, eta, p = 1.5, 2.0, 0.1, 0.8
    scene = jr.Scene(
        jr.MasslessShaft(1.0, 0.5, k),
        jr.Disc(0.5, m),
        jr.HystereticDamping(eta),
        jr.Unbalance(0.5, m, 0.01),
        jr.Gravity(1.0, angle=0.0),
        spin=jr.ConstantSpeed(p),
    )
    w = np.array([0.3, 0.8, 0.9, 3.0])
    found = jr.forced_response(scene, w, jr.HarmonicForce(0.5, 2.0))
    for part, sense in ((found.forward, 1), (found.backward, -1)):
        sign = np.sign(sense * w - p)
        expected = 1 / (k * (1 + 1j * eta * sign) - m * w**2)
        np.testing.assert_allclose(part[:, 0], expected, rtol=1e-12)
    synchronous = jr.unbalance_response(scene, p).forward[0, 0]
    assert complex(synchronous) == pytest.approx(m * 0.01 * p**2 / (k - m * p**2), rel=1e-12)
    hanging = jr.weight_response(scene, p)
    assert complex(hanging.deflection[0, 0]) == pytest.approx(m / (k * (1 - 1j * eta)), rel=1e-12)
    assert not np.any(hanging.twice)


@pytest.mark.slow
def test_forced_response_against_finite_elements():
    """A force at a station where the scene has no effect, forward and backward."""
    p, place, stations = 300.0, 0.21, [0.14, 0.21, 0.35, 0.7]
    elements = Beam(LENGTH, DIAMETER, YOUNG, DENSITY, elements=100)
    elements.disc(0.35, MASS, DIAMETRAL, 2 * DIAMETRAL, 0.6, 0.05).damp(8.0, 1e-4)
    scene = bare(
        jr.Disc(0.35, MASS, DIAMETRAL, 2 * DIAMETRAL),
        jr.DiscDamping(0.35, 0.6, 0.05),
        jr.ExternalDamping(8.0),
        jr.InternalDamping(1e-4),
        nodes=10,
    ).replace({"spin.speed": p})
    w = np.array([0.0, 60.0, 420.0, 1700.0])
    found = jr.forced_response(scene, w, jr.HarmonicForce(place, 2.0), at=stations)
    m, c, k = elements.blocks(p)
    push = np.eye(len(m))[elements.node(place) - 2]
    read = [elements.node(x) - 2 for x in stations]
    for part, sense in ((found.forward, 1), (found.backward, -1)):
        for one, frequency in zip(part, sense * w, strict=True):
            q = np.linalg.solve(k + 1j * frequency * c - frequency**2 * m, push)
            np.testing.assert_allclose(one, q[read], rtol=2e-6)


# === derivatives and refusals


@pytest.mark.slow
@pytest.mark.parametrize("turning", [True, False])
def test_gradients(turning):
    scene = unequal(0.8, turning)
    paths = ["disc.mass", "shaft.k11", "shaft.damping", "supports.damping", "spin.speed"]
    paths.append("shaft.anisotropy" if turning else "supports.anisotropy")
    responses = {
        "unbalance": lambda s: jr.unbalance_response(s, s.spin.speed).major,
        "weight": lambda s: jnp.abs(jr.weight_response(s, s.spin.speed).deflection),
        "force": lambda s: (
            jr.forced_response(s, 0.5, jr.HarmonicForce(0.5, whirl="backward")).major
        ),
    }
    for name, response in responses.items():
        at = jax.jit(lambda values, response=response: response(scene.put(values))[0, 0])
        middle = {path: jnp.ravel(scene.get(path))[0] for path in paths}
        slopes = jax.grad(at)(middle)
        for path, x in middle.items():
            h = 1e-4
            near = [float(at(middle | {path: x + d * h})) for d in (-2, -1, 1, 2)]
            found = (near[0] - 8 * near[1] + 8 * near[2] - near[3]) / (12 * h)
            assert float(slopes[path]) == pytest.approx(found, rel=1e-8, abs=1e-9), (name, path)


@pytest.mark.parametrize("smallest", [1e-6, 1e-9, 1e-12])
def test_distance_from_a_resonance_is_known_by_two_vectors(smallest):
    """A matrix with one or two small singular values, and rows of other units, by its inverse."""
    some = np.random.default_rng(1).standard_normal((2, 12, 12))
    u, sizes, v = np.linalg.svd(some[0] + 1j * some[1])
    for small in (1, 2):
        sizes[-small:] = smallest
        units = 10.0 ** np.linspace(-3, 9, 12)[:, None]
        dynamic = units * ((u * sizes) @ v)
        inertia, damping = units * some * np.array([1.0, 1j])[:, None, None]
        size = np.abs(dynamic) + np.abs(damping) + np.abs(inertia)
        errors = np.abs(np.linalg.inv(dynamic)) @ size
        exact = 1 / max(np.diag(errors))
        terms = (jnp.asarray(one) for one in (dynamic, damping, inertia))
        found = float(from_resonance(*terms))
        assert exact < 10 * smallest and exact / 1.42 < found < 1.001 * exact


def on_a_spring(stiffness, mass, anisotropy=None):
    """A disc on a massless shaft, whose equation of motion has one coordinate, and unbalance."""
    shaft = jr.MasslessShaft(0.6, 0.3, stiffness, anisotropy=anisotropy)
    disc, unbalance = jr.Disc(0.3, mass), jr.Unbalance(0.3, mass, 1e-4)
    return jr.Scene(shaft, disc, unbalance, spin=jr.ConstantSpeed(1.0))


def on_two_springs(stiffness, mass, anisotropy=None):
    """The same disc at the middle of a rigid shaft, which tilts without moving it."""
    support = lambda at: jr.Support(at, stiffness / 2, anisotropy=anisotropy)
    disc, unbalance = jr.Disc(0.3, mass, 0.1, 0.1), jr.Unbalance(0.3, mass, 1e-4)
    parts = support(0.0), support(0.6), disc, unbalance
    return jr.Scene(jr.RigidShaft(0.6), *parts, spin=jr.ConstantSpeed(1.0))


@pytest.mark.parametrize("anisotropy", [None, 1e-9])
@pytest.mark.parametrize("rotor", [on_a_spring, on_two_springs])
def test_a_critical_speed_of_one_coordinate_is_known_to_rounding(rotor, anisotropy):
    """`m e W^2 / (k - m W^2)` is unbounded at the float nearest to `sqrt(k / m)` and its neighbours.

    A millionth beside it, nine digits are right by the same formula in exact numbers. Where axes of
    stiffnesses `k (1 + mu)` and `k (1 - mu)` stand still, the orbit is an ellipse along them; where they
    turn with the shaft, only the first is bent.
    """
    share = anisotropy or 0.0
    for stiffness, mass in ((2e5, 3.0), (1.7e5, 7.3), (3e4, 0.9)):
        scene, (first, second) = (
            rotor(stiffness, mass, anisotropy),
            stiffness * np.array([1 + share, 1 - share]),
        )
        own = np.sqrt(first / mass)
        speeds = [own]
        for _ in range(3):
            speeds = [np.nextafter(speeds[0], 0.0), *speeds, np.nextafter(speeds[-1], np.inf)]
        for speed in speeds:
            with pytest.raises(ValueError, match="unbounded at a speed of .* critical speed"):
                jr.unbalance_response(scene, [speed])
        beside = own * np.array([1 - 1e-6, 1 + 1e-6])
        found = jr.unbalance_response(scene, beside).major[:, 0]
        for speed, major in zip(beside, found, strict=True):
            force = Fraction(mass) * Fraction(speed) ** 2
            along, across = (
                abs(float(Fraction(1e-4) * force / (Fraction(stiff) - force)))
                for stiff in (first, second)
            )
            expected = along if rotor is on_a_spring else max(along, across)
            assert float(major) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("diametral", [0.0, 1e-9, 0.1])  # [kg m^2]
def test_a_resonance_of_gyroscopic_moments_against_springs_is_known_to_rounding(diametral):
    """Backward whirl of a disc that tilts about a pivot: `1 / (k - I_p W w - I w^2)` is unbounded.

    The less the diametral moment is, the more of the sum is the difference of the first two terms.
    """
    polar, speed, stiffness, arm = 2.0, 3e3, 1.7e5, 0.6
    shaft = jr.RigidShaft(arm, (jr.Constraint(0.0),))
    disc, support = jr.Disc(0.0, 0.0, diametral, polar), jr.Support(arm, stiffness)
    scene = jr.Scene(shaft, disc, support, spin=jr.ConstantSpeed(speed))
    spring, spin, force = stiffness * arm**2, polar * speed, jr.HarmonicForce(arm, whirl="backward")
    own = 2 * spring / (spin + np.sqrt(spin**2 + 4 * diametral * spring))
    for frequency in (np.nextafter(own, 0.0), own, np.nextafter(own, np.inf)):
        with pytest.raises(ValueError, match="unbounded at a speed of 3000 rad/s and a frequency"):
            jr.forced_response(scene, frequency, force)
    beside = own * (1 - 1e-6)
    terms = [Fraction(diametral) * Fraction(beside) ** 2, Fraction(spin) * Fraction(beside)]
    expected = arm**2 / float(Fraction(stiffness) * Fraction(arm) ** 2 - sum(terms))
    found = jr.forced_response(scene, beside, force)
    assert float(found.major[0, 0]) == pytest.approx(expected, rel=1e-9)


def test_no_steady_state_at_the_critical_speed_of_one_coordinate():
    scene = on_a_spring(2e5, 3.0)
    with pytest.raises(ValueError, match="unbounded at 258.199 rad/s, an undamped critical speed"):
        jr.steady_state(scene.at_speed(np.sqrt(2e5 / 3.0)))


@pytest.mark.hard("2.1 response at an undamped critical speed", outcome="refused")
def test_refusals():
    undamped = dual(1, mu=None, kappa=None, delta=0.0)
    for call in (
        lambda: jr.unbalance_response(undamped, [0.5, 1.0]),
        lambda: jr.forced_response(undamped, 1.0, jr.HarmonicForce(0.5)),
        lambda: jr.unbalance_response(
            dual(1, kappa=None, delta=0.0), [0.5, np.sqrt(1.2), np.sqrt(0.8)]
        ),
        lambda: jr.weight_response(dual(1, kappa=None, delta=0.0), np.sqrt(1 - MU**2) / 2),
    ):
        with pytest.raises(ValueError, match="The response is unbounded at a speed of"):
            call()
    shaft = jr.MasslessShaft(1.0, 0.5, 1.0, anisotropy=0.1, ends="elastic")
    both = jr.Scene(shaft, *unequal(1.0, False).effects, spin=jr.ConstantSpeed(1.0))
    for response in (jr.unbalance_response, jr.weight_response):
        with pytest.raises(ValueError, match="an infinite series of frequencies"):
            response(both, 1.0)
    with pytest.raises(ValueError, match="an infinite series of frequencies"):
        jr.forced_response(both, 1.0, jr.HarmonicForce(0.5))
    with pytest.raises(ValueError, match=r"`at \[m\]` must be on the shaft"):
        jr.forced_response(bare(), 1.0, jr.HarmonicForce(0.9))
    with pytest.raises(ValueError, match=r"has contacts \(limiter\); remove"):
        stop = jr.Limiter(0.5, 0.0, 0.1, 1.0)
        jr.forced_response(dual(1, more=(stop,)), 1.0, jr.HarmonicForce(0.5))
    with pytest.raises(
        ValueError, match=r"\(hysteretic_damping\) is defined for circular whirl only"
    ):
        jr.weight_response(dual(1, more=(jr.HystereticDamping(0.1),)), 1.0)


# === steady state


def test_steady_state_of_a_disc_on_a_spring():
    """The steady state is a circle `m e W^2 / (k - m W^2 + i c W)` about the sag `-m g i / k`."""
    k, c, m, e, speed = 5e3, 30.0, 2.0, 1e-3, 60.0
    shaft = jr.MasslessShaft(0.4, 0.2, k)
    parts = (
        jr.Disc(0.2, m),
        jr.DiscDamping(0.2, c),
        jr.Unbalance(0.2, m, e, phase=0.3),
        jr.Gravity(),
    )
    scene = jr.Scene(shaft, *parts, spin=jr.ConstantSpeed(speed))
    turning = m * e * np.exp(0.3j) * speed**2 / (k - m * speed**2 + 1j * c * speed)
    q, velocity = jr.steady_state(scene)
    np.testing.assert_allclose(q, [turning - 9.80665j * m / k], rtol=1e-12)
    np.testing.assert_allclose(velocity, [1j * speed * turning], rtol=1e-12)


def test_steady_state_of_a_shaft_of_two_stiffnesses_repeats():
    """Weight causes a twice-per-revolution response: an integration repeats after half a revolution."""
    k, part, m, speed, c = 5e3, 0.2, 2.0, 60.0, 40.0
    shaft = jr.MasslessShaft(0.4, 0.2, k, anisotropy=part)
    parts = jr.Disc(0.2, m), jr.DiscDamping(0.2, c), jr.Gravity()
    scene = jr.Scene(shaft, *parts, spin=jr.ConstantSpeed(speed))
    q, velocity = (np.asarray(a)[0] for a in jr.steady_state(scene))

    def rate(t, y):
        z, v = y
        spring = k * z + part * k * np.exp(2j * speed * t) * np.conj(
            z
        )  # k (1 + mu) along x at first
        return [v, (-spring - c * v - 9.80665j * m) / m]

    half = np.pi / speed
    found = solve_ivp(rate, (0, half), [q, velocity], rtol=1e-11, atol=1e-14).y[:, -1]
    np.testing.assert_allclose(found, [q, velocity], rtol=1e-8)


def test_steady_state_is_refused_where_there_is_none():
    shaft, disc = jr.MasslessShaft(0.4, 0.2, 1e4), jr.Disc(0.2, 1.0)
    rotor = lambda *more: jr.Scene(shaft, disc, *more, spin=jr.ConstantSpeed(100.0))
    for part, said in (
        (jr.Limiter(0.2, 0.0, 1e-3, 1e5), "contacts"),
        (jr.BallBalancer(0.2, 0.01, 0.05, 1.0), "Balls"),
        (jr.Unbalance(0.2, 1.0, 1e-3), "unbounded"),
    ):
        with pytest.raises(ValueError, match=said):
            jr.steady_state(rotor(part))
