"""The gyroscopic rotor with hysteretic friction against its published sheet (Brysin, Nikiforov).

The whirl frequency `Omega` of `exp(i Omega t)` is `-i lambda`. What shares no code is written here from
the equations: the quartic of the sheet by numpy, its companion form, Krylov functions of the beam.
"""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from published import POLAR, SHIPPED, rotor
from scipy.linalg import eigvals, expm
from scipy.optimize import brentq, linear_sum_assignment

import jaxrotor as jr


CAN = {"m": 2.62, "I": 86e-4, "k11": 11.51e4, "k12": -9.28e3, "k22": 1.00e3, "eta": 0.029}
PIN = {"m": 0.53, "I": 26e-4, "k11": 11.62e4, "k12": -8.76e3, "k22": 1.25e3, "eta": 0.032}
AT_REST = {"CAN": (92.070550513, 389.529692329), "PIN": (283.227450656, 787.271697055)}
SETS = {"CAN": CAN, "PIN": PIN}
LENGTH, STATION = 0.645, 0.645 / 4


def frequencies(scene):
    """Complex whirl frequencies: forward slow and fast, backward slow and fast."""
    return sheet_order(-1j * np.asarray(jr.roots(scene)))


def sheet_order(values):
    values = np.asarray(values)
    forward, backward = values[values.real > 0], values[values.real < 0]
    return np.concatenate([forward[np.argsort(forward.real)], backward[np.argsort(-backward.real)]])


def quartic(m, I, k11, k12, k22, speed, polar, eta):  # noqa: E741
    """Coefficients of eq. (2), highest first."""
    c, turn, det = 1 + 1j * eta, polar * speed, k11 * k22 - k12**2
    return np.array([m * I, -m * turn, -c * (m * k22 + I * k11), c * k11 * turn, c**2 * det])


def exact(name, speed, polar=POLAR, eta=None):
    """Roots of the quartic; those slower than the shaft are conjugated, as their loss changes sign."""
    data = SETS[name] | ({} if eta is None else {"eta": eta})
    values = np.roots(
        quartic(**data, speed=speed, polar=polar)
        if eta != 0
        else quartic(**data, speed=speed, polar=polar).real
    )
    return sheet_order(np.where(values.real < speed, values.conj(), values))


def close(found, expected, digits=9):
    """Compare real and imaginary parts to a unit of the last digit printed."""
    np.testing.assert_allclose(
        np.asarray(found), np.asarray(expected), rtol=0, atol=1.01 * 10.0**-digits
    )


# === 3.1: stiffness and reduced masses

DISC = 0.270
EXACT = 2.0e11 * np.pi * 0.008**4 / 64, 7850 * np.pi * 0.008**2 / 4
COEFFICIENTS = {  # pinned, set of EI and mass per length: k11, k12, k22, K11, m
    (False, "derived"): (1.15091147e5, -9.27922373e3, 9.97516551e2, 2.87727868e4, 2.62327806),
    (False, "rounded"): (1.14483281e5, -9.23021453e3, 9.92248062e2, 2.86208202e4, 2.65557857),
    (True, "derived"): (1.16156806e5, -8.76371130e3, 1.24689569e3, 5.45617290e4, 0.532855601),
    (True, "rounded"): (1.15543311e5, -8.71742483e3, 1.24031008e3, 5.42735554e4, 0.536463492),
}
MATERIALS = {"derived": EXACT, "rounded": (40.0, 0.4)}


def beam(
    pinned, which="derived", diametral=0.0, polar=0.0, disc=DISC, at=STATION, speed=0.0, **shaft
):
    """Euler-Bernoulli shaft with a disc; `which` set of EI and mass per length."""
    rigidity, mass = MATERIALS[which]
    area, second = np.pi * 0.008**2 / 4, np.pi * 0.008**4 / 64
    held = (jr.Constraint(0.0, "clamp"), *([jr.Constraint(LENGTH, "pin")] if pinned else []))
    return jr.Scene(
        jr.FlexibleShaft(
            LENGTH,
            0.008,
            jr.Material(youngs_modulus=rigidity / second, density=mass / area),
            **({"nodes": 12, "rotary_inertia": False, "constraints": held} | shaft),
        ),
        jr.Disc(at, disc, diametral, polar),
        spin=jr.ConstantSpeed(speed),
    )


def closed_form_mass(pinned, at, disc, per_length):
    """Sheet section 1: `m` clamped and free, `m~` clamped and pinned."""
    l, a, b = LENGTH, at, LENGTH - at
    if not pinned:
        return 33 / 140 * per_length * a + (1 / 4 + 3 / 4 * (l / a) ** 2) * per_length * b + disc
    top = 24 * l**4 - 24 * l**3 * a - 4 * l**2 * a**2 + 8 * l * a**3 - a**4
    return per_length * l**3 * top / (35 * a**2 * (4 * l**2 - 5 * l * a + a**2) ** 2) + disc


@pytest.mark.slow
@pytest.mark.parametrize("case", COEFFICIENTS, ids=str)
def test_stiffness_and_mass(case):
    """The reduction of the shaft equals the closed forms of MasslessShaft and the printed values."""
    pinned, which = case
    k11, k12, k22, condensed, mass = COEFFICIENTS[case]
    rigidity, per_length = MATERIALS[which]
    found = jr.reduction(beam(pinned, which), STATION)
    build = jr.MasslessShaft.clamped_pinned if pinned else jr.MasslessShaft.clamped_free
    for shaft in (found.shaft, build(LENGTH, rigidity, STATION)):
        assert float(shaft.k11) == pytest.approx(k11, rel=1e-8)
        assert float(shaft.k12) == pytest.approx(k12, rel=1e-8)
        assert float(shaft.k22) == pytest.approx(k22, rel=1e-8)
        assert float(shaft.k11 - shaft.k12**2 / shaft.k22) == pytest.approx(condensed, rel=1e-8)
    assert float(found.mass) == pytest.approx(mass, rel=2e-9)
    closed = closed_form_mass(pinned, STATION, DISC, per_length)
    assert float(found.mass) == pytest.approx(closed, rel=1e-10)


@pytest.mark.slow
def test_reduction_to_a_station_without_a_part():
    """The same closed forms with the disc at the end of the shaft, which has no part at the station."""
    shaft = jr.reduction(beam(False, at=LENGTH), STATION).shaft
    for name, value in zip(("k11", "k12", "k22"), COEFFICIENTS[False, "derived"], strict=False):
        assert float(getattr(shaft, name)) == pytest.approx(value, rel=1e-8)


def test_printed_coefficients():
    """The coefficients follow from the derived set, not from the printed EI and mass per length (E5)."""
    for name, pinned in (("CAN", False), ("PIN", True)):
        found = jr.reduction(beam(pinned), STATION)
        for key in ("k11", "k12", "k22"):
            assert float(getattr(found.shaft, key)) == pytest.approx(SETS[name][key], rel=3e-3)
        assert float(found.mass) == pytest.approx(SETS[name]["m"], rel=6e-3)
    np.testing.assert_allclose(EXACT, (40.212385966, 0.394584037), rtol=1e-9)
    disc = DISC * 0.042**2 / 2
    assert disc == pytest.approx(2.381400e-4, rel=1e-12)


@pytest.mark.hard("3.11 a disc near the clamp, at the free end, at the pin")
@pytest.mark.parametrize("share", [0.1, 0.4, 0.75, 1.0])
@pytest.mark.parametrize("pinned", [False, True])
def test_reduced_mass_along_the_shaft(pinned, share):
    """The mass follows closed forms: 33/140 of the shaft at a free end, none at a pin (case 11)."""
    at = share * LENGTH
    if pinned and share == 1.0:
        with pytest.raises(ValueError, match="cannot be reduced to 0.645 m, where it is held"):
            jr.reduction(beam(True), at)
        return
    found = float(jr.reduction(beam(pinned, at=at, disc=0.3), at).mass)
    assert found == pytest.approx(closed_form_mass(pinned, at, 0.3, EXACT[1]), rel=1e-9)
    if share == 1.0:
        assert found == pytest.approx(33 / 140 * EXACT[1] * LENGTH + 0.3, rel=1e-10)


def test_several_discs_count_by_their_deflection():
    """`sum m_i (x_i / x)^2`, and `I_d` by the slope."""
    one = beam(False)
    more = jr.Scene(one.shaft, *one.effects, jr.Disc(LENGTH, 0.1, 2e-4, 0.0), spin=one.spin)
    a, l = STATION, LENGTH
    ratio = (3 * a**2 * l - a**3) / (2 * a**3)
    slope = 3 / (2 * a)
    added = float(jr.reduction(more, STATION).mass - jr.reduction(one, STATION).mass)
    assert added == pytest.approx(0.1 * ratio**2 + 2e-4 * slope**2, rel=1e-9)


# === 3.2: the continuous shaft

THIN = DISC * 0.042**2 / 4  # transverse inertia of the disc, half its polar one
CONTINUOUS = [  # set, pinned, transverse inertia over THIN, three frequencies, I from the second
    ("derived", False, 0, (83.6091561, 389.568049, 995.101278), 8.577457e-3),
    ("derived", False, 1, (83.5107621, 387.556955, 993.252394), 8.696479e-3),
    ("derived", False, 2, (83.4125189, 385.543291, 991.181285), 8.818417e-3),
    ("derived", True, 0, (301.634961, 770.858162, 2026.90118), 2.743070e-3),
    ("derived", True, 1, (299.833866, 770.848410, 1962.97421), 2.743165e-3),
    ("derived", True, 2, (298.042179, 770.838032, 1869.29821), 2.743267e-3),
    ("rounded", False, 1, (82.7482594, 385.217888, 985.674471), 8.740137e-3),
    ("rounded", True, 1, (297.812988, 765.539866, 1946.59199), 2.768480e-3),
]


@pytest.mark.parametrize(("which", "pinned", "thick", "expected", "inertia"), CONTINUOUS)
def test_continuous_shaft(which, pinned, thick, expected, inertia):
    scene = beam(pinned, which, diametral=thick * THIN)
    found = np.sort(np.asarray(jr.roots(scene, 6)).imag)[3:]
    np.testing.assert_allclose(found, expected, rtol=6e-9)
    np.testing.assert_allclose(found, krylov(pinned, which, thick * THIN, expected), rtol=1e-10)
    reduced = jr.reduction(scene, STATION)
    mass = closed_form_mass(pinned, STATION, DISC, MATERIALS[which][1])
    assert float(jr.inertia_from_frequency(reduced.shaft, mass, found[1])) == pytest.approx(
        inertia, rel=1e-6
    )


def krylov(pinned, which, diametral, near):
    """Frequencies by the transfer matrix of `z, z', M, Q` over both parts of the shaft."""
    rigidity, mass = MATERIALS[which]

    def determinant(w):
        field = np.zeros((4, 4))
        field[0, 1] = 1
        field[1, 2] = 1 / rigidity
        field[2, 3] = 1
        field[3, 0] = mass * w**2
        disc = np.eye(4)
        disc[2, 1], disc[3, 0] = -diametral * w**2, DISC * w**2
        whole = expm(field * (LENGTH - STATION)) @ disc @ expm(field * STATION)
        rows = (0, 2) if pinned else (2, 3)
        return np.linalg.det(whole[np.ix_(rows, (2, 3))])

    return [brentq(determinant, 0.999 * w, 1.001 * w, xtol=1e-12) for w in near]


@pytest.mark.slow
def test_continuous_shaft_that_turns():
    """Critical speeds and whirl of the thin disc, `I_d = I_0 / 2`."""
    published = {
        False: ((83.7076999, 391.575236), (83.3144272, 383.528385)),
        True: ((303.444785, 770.867345), (296.260544, 770.826968)),
    }
    whirl = {  # at the second frequency at rest: forward, backward
        False: (387.556955, (84.4197304, 391.534502), (82.5948408, 383.485598)),
        True: (770.848410, (308.902631, 770.867344), (290.445899, 770.826967)),
    }
    for pinned, (forward, backward) in published.items():
        scene = beam(pinned, diametral=THIN, polar=2 * THIN)
        found = jr.critical_speeds(scene, 2)
        np.testing.assert_allclose(found.forward, forward, rtol=2e-9)
        np.testing.assert_allclose(found.backward, backward, rtol=2e-9)
        speed, forward, backward = whirl[pinned]
        values = -1j * np.asarray(jr.roots(scene.put({"spin.speed": jnp.asarray(speed)}), 4))
        np.testing.assert_allclose(
            sheet_order(values).real, [*forward, *(-np.array(backward))], rtol=2e-9
        )


@pytest.mark.slow
def test_rigid_hub():
    """If the disc stiffens the shaft over 6.2 mm, the second frequency of the propped rotor is 783."""
    published = {
        False: ((84.1576, 389.582), 8.57663e-3),
        True: ((300.139, 783.058), 2.62829e-3),
    }
    stiff = jr.Material(youngs_modulus=2e11 * 1e5, density=7850.0)
    hub = (jr.Step(STATION - 0.0031, 0.008, None, stiff), jr.Step(STATION + 0.0031, 0.008))
    for pinned, (expected, inertia) in published.items():
        scene = beam(pinned, diametral=THIN, steps=hub, nodes=8)
        found = np.sort(np.asarray(jr.roots(scene, 4)).imag)[2:]
        np.testing.assert_allclose(found, expected, rtol=1.2e-5)
        shaft = jr.reduction(beam(pinned), STATION)
        from_second = jr.inertia_from_frequency(shaft.shaft, shaft.mass, found[1])
        assert float(from_second) == pytest.approx(inertia, rel=1e-4)


def test_what_the_reduction_is_worth():
    """The second frequency is exact, the first 10 % high or 6 % low; condensed, the second is doubled."""
    first = {"CAN": (92.0706 / 83.5108 - 1, 0.102), "PIN": (283.227 / 299.834 - 1, -0.055)}
    for name, (error, expected) in first.items():
        assert error == pytest.approx(expected, abs=6e-4)
        pinned = name == "PIN"
        found = frequencies(rotor(name, eta=0.0)).real[:2]
        assert found[0] / np.sort(np.asarray(jr.roots(beam(pinned, diametral=THIN), 4)).imag)[
            2
        ] - 1 == (pytest.approx(expected, abs=6e-4))
    for pinned, expected in ((False, (97.65, 760.99)), (True, (313.2, 1457.7))):
        found = jr.reduction(beam(pinned, diametral=THIN), STATION)
        k = np.array([[found.shaft.k11, found.shaft.k12], [found.shaft.k12, found.shaft.k22]])
        squares = eigvals(k, np.asarray(found.condensed)).real
        np.testing.assert_allclose(np.sqrt(np.sort(squares)), expected, rtol=1e-4)


# === 1, 4: inertia from a second frequency


@pytest.mark.hard("3.8 inertia from the second frequency")
def test_inertia_from_frequency_gives_it_back(record_property):
    for name, data in SETS.items():
        shaft, second = SHIPPED[name].shaft, AT_REST[name][1]
        found = float(jr.inertia_from_frequency(shaft, data["m"], second))
        record_property("measured", f"{name}: {abs(found / data['I'] - 1):.0e}")
        assert found == pytest.approx(data["I"], rel=1e-9)
        scene = rotor(name, eta=0.0).put({"disc.diametral": jnp.asarray(found)})
        assert frequencies(scene).real[1] == pytest.approx(second, rel=1e-10)
        at = lambda w, shaft=shaft, m=data["m"]: jnp.log(jr.inertia_from_frequency(shaft, m, w))
        slope = float(jax.grad(at)(second)) * second
        assert slope == pytest.approx({"CAN": -2.66, "PIN": -2.69}[name], abs=0.02)


@pytest.mark.hard("3.8 inertia from a frequency beyond the pole", outcome="refused")
def test_inertia_from_frequency_refuses():
    shaft = SHIPPED["CAN"].shaft
    for frequency in (50.0, 150.0, 209.597):  # the zero at 105.17, the pole at 209.598
        with pytest.raises(ValueError, match=r"must exceed sqrt\(k11 / m\) = 209.598, .* but is"):
            jr.inertia_from_frequency(shaft, 2.62, frequency)
    assert float(jr.inertia_from_frequency(shaft, 2.62, 209.599)) > 1
    with pytest.raises(ValueError, match="468.236"):
        jr.inertia_from_frequency(SHIPPED["PIN"].shaft, 0.53, 468.2)
    with pytest.raises(ValueError, match="`mass .* must be positive"):
        jr.inertia_from_frequency(shaft, 0.0, 300.0)
    with pytest.raises(ValueError, match="no slope"):
        jr.inertia_from_frequency(jr.MasslessShaft(1.0, 0.5, 1e5), 2.0, 300.0)
    with pytest.raises(Exception, match="must exceed"):
        jax.jit(lambda w: jr.inertia_from_frequency(shaft, 2.62, w))(150.0).block_until_ready()


def test_reduction_refuses():
    with pytest.raises(ValueError, match="every axis"):
        jr.reduction(beam(False, anisotropy=0.1), STATION)
    with pytest.raises(ValueError, match="free to move as a rigid body"):
        jr.reduction(beam(False, constraints=()), STATION)
    with pytest.raises(ValueError, match="has no slope"):
        jr.reduction(jr.load("dual-stiffness-rigid").put({"shaft.anisotropy": None}), 0.5)


# === 3.3, 3.4: roots and their first-order formulas

TABLE = [  # set, I0, speed, exact, perturbation
    (
        "CAN",
        2.38e-4,
        92.070550513,
        [
            92.395676063 + 1.334880564j,
            390.532155178 + 5.647546004j,
            -91.765080279 + 1.334880429j,
            -388.614752006 + 5.647546140j,
        ],
        [
            92.386415180 + 1.335002789j,
            390.497478564 + 5.647867510j,
            -91.755812706 + 1.335002935j,
            -388.579911011 + 5.647874168j,
        ],
    ),
    (
        "CAN",
        2.38e-4,
        240.800121421,
        [
            92.905851899 - 1.334868906j,
            392.097349772 + 5.647305898j,
            -91.256671292 + 1.334866481j,
            -387.082527019 + 5.647308323j,
        ],
        [
            92.899054722 - 1.334884059j,
            392.100185653 + 5.646002090j,
            -91.249754449 + 1.334886663j,
            -387.082420581 + 5.646121182j,
        ],
    ),
    (
        "CAN",
        2.38e-4,
        389.529692329,
        [
            93.416720969 - 1.334848603j,
            393.677368664 + 5.646849586j,
            -90.749146939 + 1.334838339j,
            -385.564934930 + 5.646859850j,
        ],
        [
            93.414676409 - 1.334657381j,
            393.753522452 + 5.642381496j,
            -90.746595873 + 1.334668400j,
            -385.628621229 + 5.642885418j,
        ],
    ),
    (
        "CAN",
        4e-4,
        389.529692329,
        [
            94.328985338 - 1.334796447j,
            396.531026693 + 5.645495191j,
            -89.846752535 + 1.334747763j,
            -382.895599388 + 5.645543875j,
        ],
        [
            94.341360300 - 1.333979979j,
            396.834248553 + 5.631297544j,
            -89.856723594 + 1.334032256j,
            -383.139457237 + 5.633687020j,
        ],
    ),
    (
        "PIN",
        2.38e-4,
        283.227450656,
        [
            286.589145945 + 4.531302077j,
            797.148572198 + 12.592278149j,
            -279.910164879 + 4.531265448j,
            -777.901348166 + 12.592314779j,
        ],
        [
            286.561459412 + 4.531472096j,
            797.401754656 + 12.577040907j,
            -279.881311293 + 4.531489809j,
            -778.107341433 + 12.579141702j,
        ],
    ),
    (
        "PIN",
        2.38e-4,
        787.271697055,
        [
            292.427462320 - 4.533169848j,
            815.310687926 + 12.575552122j,
            -273.883624416 + 4.532386487j,
            -761.788885868 + 12.576335483j,
        ],
        [
            292.465011776 - 4.530234151j,
            818.343093142 + 12.431862889j,
            -273.896161237 + 4.530613882j,
            -763.789933527 + 12.476679818j,
        ],
    ),
]
REST = {
    "CAN": (
        [92.080226887 + 1.334882690j, 389.570630880 + 5.647586992j],
        [92.070550513 + 1.335022982j, 389.529692329 + 5.648180539j],
    ),
    "PIN": (
        [283.263692174 + 4.531059420j, 787.372435603 + 12.594735542j],
        [283.227450656 + 4.531639210j, 787.271697055 + 12.596347153j],
    ),
}
TABLE += [
    (name, POLAR, 0.0, [*one, *(-np.conj(one))], [*two, *(-np.conj(two))])
    for name, (one, two) in REST.items()
]


@pytest.mark.parametrize(("name", "polar", "speed", "published", "first_order"), TABLE)
def test_roots_and_perturbation(name, polar, speed, published, first_order):
    scene = rotor(name, speed, polar)
    close(frequencies(scene), published)
    close(frequencies(scene), exact(name, speed, polar), 10)
    found = jr.perturbed_roots(scene)
    close(-1j * np.asarray(found.values), first_order)
    close(np.asarray(found.at_rest)[:2], AT_REST[name])
    assert np.asarray(found.valid).all()


@pytest.mark.hard("3.1 the sign of hysteresis switches")
@pytest.mark.hard("3.4 zero speed")
@pytest.mark.parametrize("name", SETS)
def test_roots_against_the_companion_form(name):
    """`[[0, 1], [M^-1 K (1 + i eta), M^-1 w G]]` of the sheet, at rest and far above everything."""
    data = SETS[name]
    mass = np.diag([data["m"], data["I"]])
    k = np.array([[data["k11"], data["k12"]], [data["k12"], data["k22"]]])
    for speed in (0.0, 50.0, 700.0, -300.0, 1e5):
        turn = np.diag([0.0, POLAR * speed])
        lower = np.linalg.solve(mass, np.concatenate([k * (1 + 1j * data["eta"]), turn], axis=1))
        values = np.linalg.eigvals(np.concatenate([np.eye(2, 4, 2), lower]))
        values = np.where(values.real < speed, values.conj(), values)
        found = -1j * np.asarray(jr.roots(rotor(name, speed)))
        gap = np.abs(found[:, None] - values[None])
        assert gap[linear_sum_assignment(gap)].max() < 1e-10 * np.abs(values).max()


@pytest.mark.parametrize(
    ("name", "polar", "real", "imaginary"),
    [
        ("CAN", 2.38e-4, 0.0193, 0.0791),
        ("CAN", 4e-4, 0.0765, 0.2515),
        ("PIN", 2.38e-4, 0.372, 1.143),
    ],
)
def test_error_of_the_first_order(name, polar, real, imaginary):
    """Largest mismatch in per cent up to the second frequency, with one sign of loss for all roots."""
    worst = np.max([mismatch(name, polar, speed) for speed in speeds_of(name)], axis=0)
    np.testing.assert_allclose(100 * worst, [real, imaginary], rtol=0.003)


def speeds_of(name):
    return np.linspace(0, AT_REST[name][1], 40)


def mismatch(name, polar, speed, eta=None):
    """Largest relative error of Re and |Im| over the four roots."""
    scene = rotor(name, speed, polar, eta)
    one, two = frequencies(scene), -1j * np.asarray(jr.perturbed_roots(scene).values)
    return np.max(np.abs([two.real / one.real - 1, np.abs(two.imag / one.imag) - 1]), axis=1)


@pytest.mark.parametrize(
    ("name", "real", "imaginary"), [("CAN", 0.277968, 0.291822), ("PIN", 0.268882, 0.283864)]
)
def test_limit_of_validity(name, real, imaginary):
    """Errors reach 5 % of Re and 15 % of |Im| at I0 / I of 0.27 to 0.29, not 0.05."""
    second = AT_REST[name][1]
    for part, (limit, error) in enumerate(((real, 0.05), (imaginary, 0.15))):
        excess = lambda ratio, part=part, error=error: (
            mismatch(name, ratio * SETS[name]["I"], second)[part] - error
        )
        assert brentq(excess, 0.2, 0.35, xtol=1e-9) == pytest.approx(limit, abs=0.6e-6)
    at_limit = mismatch(name, 0.05 * SETS[name]["I"], second)
    assert at_limit[0] < 0.0012 and at_limit[1] < 0.004


def test_better_first_order_damping():
    """Sheet 3.5: the loss from the energy of the undamped mode is within 0.0105 % to 0.0128 %."""
    for name, data in SETS.items():
        for speed in np.linspace(0, 2 * AT_REST[name][1], 9):
            undamped = frequencies(rotor(name, speed, eta=0.0)).real
            slope = (data["m"] * undamped**2 - data["k11"]) / data["k12"]
            k = data["k11"] + 2 * data["k12"] * slope + data["k22"] * slope**2
            mass = data["m"] + data["I"] * slope**2
            estimate = data["eta"] * k / (undamped**2 * mass + k) * np.abs(undamped)
            found = np.abs(frequencies(rotor(name, speed)).imag)
            assert np.all(np.abs(estimate / found - 1) < data["eta"] ** 2 / 8 * 1.02)


# === 3.6: critical speeds, thresholds, limits

CRITICAL = {  # set, I0: forward, backward, each from (5) too
    ("CAN", 2.38e-4): (
        (92.387084740, 393.680758289, 91.756478455, 385.564284342),
        (92.387504501, 393.801784731, 91.756883054, 385.66585257),
    ),
    ("CAN", 4e-4): (
        (92.603958028, 396.619495461, 91.544097673, 382.964863926),
        (92.605158735, 396.984244107, 91.545226387, 383.236336209),
    ),
    ("PIN", 2.38e-4): (
        (286.592222616, 816.285925830, 279.913308485, 762.459733099),
        (286.601099440, 819.846552235, 279.920451481, 764.391170282),
    ),
}


@pytest.mark.parametrize("case", CRITICAL, ids=str)
def test_critical_speeds(case):
    name, polar = case
    published, first_order = CRITICAL[case]
    found = jr.critical_speeds(rotor(name, polar=polar))
    close(np.concatenate([found.forward, found.backward]), published)
    data = SETS[name]
    for speed, sense in zip(published, (1, 1, -1, -1), strict=True):  # into (3), as the sheet does
        terms = quartic(**data | {"eta": 0.0}, speed=speed, polar=polar).real
        values = terms * (sense * speed) ** np.arange(4, -1, -1)
        assert abs(values.sum()) < 1e-9 * np.abs(values).sum()
    at = lambda speed, i: float(jr.perturbed_roots(rotor(name, speed, polar)).undamped[i])
    for i, speed in enumerate(first_order):
        crossing = brentq(lambda w, i=i: abs(at(w, i)) - w, 0.98 * speed, 1.02 * speed, xtol=1e-11)
        assert crossing == pytest.approx(speed, abs=2e-8)


def test_backward_critical_speed_of_the_first_order():
    """The error of the second critical speed reaches 5 % only at I0 / I = 0.657 and 0.667, not at 0.09."""

    def error(name, ratio):
        polar, guess = ratio * SETS[name]["I"], AT_REST[name][1]
        at = lambda w: -float(jr.perturbed_roots(rotor(name, w, polar)).undamped[3]) - w
        exact = float(jr.critical_speeds(rotor(name, polar=polar)).backward[1])
        return 100 * (brentq(at, 0.5 * guess, guess) / exact - 1)

    published = {0.0465: 0.0709, 0.09: 0.2389, 0.2: 0.9329, 0.3: 1.7468, 0.5: 3.5571}
    assert {ratio: error("CAN", ratio) for ratio in published} == pytest.approx(
        published, abs=0.6e-4
    )
    assert error("CAN", 0.65749) == pytest.approx(5, abs=1e-4)
    assert error("PIN", 0.66681) == pytest.approx(5, abs=1e-4)
    assert error("PIN", 0.09) == pytest.approx(0.246, abs=6e-4)


ONSET = {  # set, I0: first and second forward whirl, growth on either side
    ("CAN", 2.38e-4): ((92.396794350, 1.334880550), (393.722122031, 5.646833575)),
    ("CAN", 4e-4): ((92.613690377, None), (396.661146931, None)),
    ("PIN", 2.38e-4): ((286.628898862, 4.531308158), (816.390031729, 12.574096382)),
}


@pytest.mark.hard("3.2 exactly at a synchronous whirl")
@pytest.mark.parametrize("case", ONSET, ids=str)
def test_onset_of_unstable_whirl(case):
    """Onset is where a whirl is synchronous; its damping changes to equal growth."""
    name, polar = case
    (first, growth), _ = ONSET[case]
    onset = jr.onset_speed(rotor(name, polar=polar))
    close(onset.speed, first)
    assert float(onset.whirl_frequency) == pytest.approx(first, rel=1e-11)
    (crossing, lost), *rest = jr.stability_crossings(rotor(name, polar=polar))
    assert lost and not rest and float(crossing.speed) == float(onset.speed)
    for i, (speed, growth) in enumerate(ONSET[case]):
        whirl = lambda w, i=i: frequencies(rotor(name, w, polar))[i].real - w
        close(brentq(whirl, 0.99 * speed, 1.01 * speed, xtol=1e-12), speed)
        if growth is not None:
            below, above = (
                frequencies(rotor(name, speed + step, polar))[i].imag for step in (-1e-7, 1e-7)
            )
            close((below, -above), (growth, growth), 8)


# === 3.7: identities


@pytest.mark.hard("3.13 negative speed")
@pytest.mark.parametrize("name", SETS)
def test_identities(name):
    data = SETS[name]
    eta, m, inertia = data["eta"], data["m"], data["I"]
    det = data["k11"] * data["k22"] - data["k12"] ** 2
    still = frequencies(rotor(name))
    at_rest = np.array(AT_REST[name])
    np.testing.assert_allclose(np.abs(still[:2]), at_rest * (1 + eta**2) ** 0.25, rtol=1e-11)
    np.testing.assert_allclose(
        still.imag / np.abs(still.real), np.tan(np.arctan(eta) / 2), rtol=1e-11
    )
    for speed in (30.0, 240.8, 900.0):
        scene = rotor(name, speed)
        values, mirrored = frequencies(scene), frequencies(rotor(name, -speed))
        np.testing.assert_allclose(sheet_order(-mirrored.conj()), values, rtol=1e-12)
        plus = np.where(values.real < speed, values.conj(), values)  # all by +eta
        assert plus.sum() == pytest.approx(POLAR * speed / inertia, rel=1e-9)
        assert plus.prod() == pytest.approx((1 + 1j * eta) ** 2 * det / (m * inertia), rel=1e-11)
        undamped = frequencies(rotor(name, speed, eta=0.0)).real
        assert np.all(undamped[:2] > at_rest) and np.all(np.abs(undamped[2:]) < at_rest)
    if name == "CAN":
        assert np.tan(np.arctan(eta) / 2) == pytest.approx(0.014496953, abs=0.51e-9)


def test_limits_at_great_speed():
    """`+-sqrt(k11 / m)`, `I0 w / I`, `-det / (k11 I0 w)`."""
    speed, data = 1e9, CAN
    det = data["k11"] * data["k22"] - data["k12"] ** 2
    found = np.sort(frequencies(rotor("CAN", speed, eta=0.0)).real)
    slow = np.sqrt(data["k11"] / data["m"])
    limits = [-slow, -det / (data["k11"] * POLAR * speed), slow, POLAR * speed / data["I"]]
    np.testing.assert_allclose(found, limits, rtol=1e-4)


# === 4: hard cases


@pytest.mark.hard("3.1 the sign of hysteresis switches")
@pytest.mark.hard("3.2 exactly at a synchronous whirl")
def test_sign_exactly_at_a_synchronous_whirl():
    """Cases 1, 2: no oscillation and no NaN; the sign changes across equality, where both are finite."""
    speed = float(jr.onset_speed(rotor("CAN")).speed)
    for at in speed * (1 + np.array([-1e-12, 0.0, 1e-12])):
        values = frequencies(rotor("CAN", at))
        assert np.isfinite(values).all() and values.size == 4
        assert abs(abs(values[0].imag) - 1.334880550) < 1e-8


@pytest.mark.hard("3.3 the first order and the exact root differ in sign")
def test_between_the_undamped_and_the_damped_threshold():
    """Case 3: with L and Lambda on either side of w the first order has the wrong sign of damping."""
    scene = rotor("CAN", 92.6107, 4e-4)
    one = frequencies(scene)[0]
    two = -1j * np.asarray(jr.perturbed_roots(scene).values)[0]
    assert one.imag * two.imag < 0
    assert abs(two.imag) == pytest.approx(abs(one.imag), rel=2e-3)
    assert one.imag > 0  # the exact root whirls faster than the shaft turns


@pytest.mark.hard("3.4 zero speed")
@pytest.mark.hard("3.5 backward whirl is always damped")
def test_backward_whirl_is_always_damped():
    for speed in (0.0, 5.0, 400.0, 5e3):
        assert np.all(frequencies(rotor("CAN", speed))[2:].imag > 0)


@pytest.mark.hard("3.6 the pole of the first-order formula", outcome="flagged")
def test_first_order_says_where_it_ends():
    """Case 6: (5) has a pole at I0 w = 0.6967 I lambda2 (CAN), 0.6580 (PIN), flagged well before."""
    for name, pole in (("CAN", 0.696656), ("PIN", 0.657965)):
        inertia, second = SETS[name]["I"], AT_REST[name][1]
        at = lambda turn, name=name, inertia=inertia: jr.perturbed_roots(
            rotor(name, turn * inertia * AT_REST[name][1] / POLAR)
        )
        shift = lambda turn, at=at, second=second: second / (float(at(turn).undamped[1]) - second)
        assert brentq(shift, 0.6, 0.75, xtol=1e-10) == pytest.approx(pole, abs=0.6e-6)
        assert np.asarray(at(0.05).valid).all() and not bool(at(0.95 * pole).valid[1])
        assert abs(float(at(0.9999 * pole).undamped[1])) > 100 * second
        # With the exact undamped frequency the damping does not change its sign (case E9).
        values = frequencies(rotor(name, 3 * pole * inertia * second / POLAR))
        assert np.all(values[2:].imag > 0)


SHAFT, WHEEL = jr.MasslessShaft(0.6, 0.3, 1e5, -9e3, 1e3), jr.Disc(0.3, 2.0, 0.01, 0.02)
OTHERS = {
    "support": (SHAFT, WHEEL, jr.Support(0.3, 5e4, cross_stiffness=1.5e4)),
    "disc damping": (SHAFT, WHEEL, jr.DiscDamping(0.3, 5.0)),
    "internal damping": (SHAFT, WHEEL, jr.InternalDamping(1e-5)),
    "limiter": (SHAFT, WHEEL, jr.Limiter(0.3, 0.0, 1e-3, 1e5)),
    "two stiffnesses": (jr.MasslessShaft(0.6, 0.3, 1e5, -9e3, 1e3, anisotropy=0.1), WHEEL),
    "damped shaft": (jr.MasslessShaft(0.6, 0.3, 1e5, -9e3, 1e3, damping=1.0), WHEEL),
    "no slope": (jr.MasslessShaft(0.6, 0.3, 1e5), WHEEL),
    "no disc": (SHAFT, jr.Unbalance(0.3, 2.0, 1e-4)),
    "elastic ends": (
        jr.MasslessShaft(0.6, 0.3, 1.0, ends="elastic"),
        WHEEL,
        jr.Disc(0.0, 0.3),
        jr.Support(0.0, 0.5),
        jr.Support(0.6, 0.5),
    ),
    "flexible shaft of two nodes": (
        jr.FlexibleShaft(0.3, 0.02, nodes=2, constraints=[jr.Constraint(0.0, "clamp")]),
        WHEEL,
    ),
}


@pytest.mark.parametrize("name", OTHERS)
def test_first_order_refuses_what_it_does_not_know(name):
    with pytest.raises(ValueError, match="The first-order formulas are for a round MasslessShaft"):
        jr.perturbed_roots(jr.Scene(*OTHERS[name], spin=jr.ConstantSpeed(100.0)))


def test_first_order_of_two_discs_and_loads():
    """Discs at one station act as one, and loads do not matter."""
    parts = jr.Disc(0.3, 1.5, 0.004, 0.02), jr.Disc(0.3, 0.5, 0.006, 0.0)
    loads = jr.Gravity(), jr.Unbalance(0.3, 2.0, 1e-4)
    spin = jr.ConstantSpeed(10.0)
    one, two = (
        jr.perturbed_roots(jr.Scene(SHAFT, *effects, spin=spin))
        for effects in ((WHEEL,), (*parts, *loads))
    )
    np.testing.assert_allclose(two.values, one.values, rtol=1e-14)
    assert np.asarray(two.valid).all()


@pytest.mark.hard("3.7 a flat disc has one forward critical speed")
def test_no_second_forward_critical_speed_of_a_flat_disc():
    """Case 7: for I0 >= I one critical speed remains; at I0 = I it is sqrt(det / (m k22))."""
    data = CAN
    for polar in (data["I"], 1.5 * data["I"]):
        found = jr.critical_speeds(rotor("CAN", polar=polar))
        assert found.forward.size == 1 and found.backward.size == 2
        assert np.isfinite(found.speeds).all()
        if polar == data["I"]:
            condensed = data["k11"] - data["k12"] ** 2 / data["k22"]
            assert float(found.forward[0]) == pytest.approx(
                np.sqrt(condensed / data["m"]), rel=1e-10
            )


@pytest.mark.hard("3.9 decoupled modes cross, coupled ones veer")
def test_decoupled_modes_cross_and_keep_their_identity():
    """Case 9: k12 = 0, k11 / m = k22 / I: a double root at rest; tilt splits, displacement stays."""
    k22 = CAN["k11"] / CAN["m"] * CAN["I"]
    scene = rotor("CAN", eta=0.0, k12=0.0, k22=k22)
    own = np.sqrt(CAN["k11"] / CAN["m"])
    np.testing.assert_allclose(np.abs(frequencies(scene)), own, rtol=1e-7)
    shown = jr.campbell(scene, np.linspace(0, 800, 9), 4)
    straight = np.sort(np.abs(np.asarray(shown.frequencies)), axis=1)
    turn = POLAR * np.linspace(0, 800, 9) / CAN["I"] / 2
    faster, slower = np.hypot(turn, own) + turn, np.hypot(turn, own) - turn
    expected = np.sort(np.stack([0 * turn + own, 0 * turn + own, faster, slower], axis=1), axis=1)
    np.testing.assert_allclose(straight, expected, rtol=1e-7)
    # The derivative of the double root is the mean of both: half of that of the tilt.
    values = lambda k22: jr.roots(rotor("CAN", eta=0.0, k12=0.0).put({"shaft.k22": k22})).imag
    slope = np.asarray(jax.jvp(values, (k22,), (1.0,))[1])
    np.testing.assert_allclose(np.abs(slope), own / (4 * k22), rtol=1e-6)


@pytest.mark.hard("3.9 decoupled modes cross, coupled ones veer")
def test_veering_branches_do_not_cross():
    """For k12 != 0 the order by frequency is that by branch, and the diagram has the values of `roots`."""
    speeds = np.linspace(0, 600, 25)
    shown = jr.campbell(rotor("CAN"), speeds, 4)
    for i, speed in enumerate(speeds):
        close(sheet_order(shown.frequencies[i] - 1j * shown.growth[i]), exact("CAN", speed), 8)
    assert np.all(np.diff(np.abs(np.asarray(shown.frequencies)), axis=0).any(axis=0))


@pytest.mark.hard("3.14 no loss")
def test_no_loss_is_conservative_and_without_an_onset():
    for speed in (0.0, 240.8, 5e3):
        values = frequencies(rotor("CAN", speed, eta=0.0))
        assert np.abs(values.imag).max() < 1e-12 * np.abs(values).max()
    bare = SHIPPED["CAN"].without("hysteretic_damping")
    close(frequencies(bare), exact("CAN", 240.8, eta=0.0), 9)
    with pytest.raises(ValueError, match="no damping"):
        jr.onset_speed(bare)


@pytest.mark.hard("3.15 large loss")
def test_large_loss():
    """Case 15: the first order errs by eta^2 / 8; the exact root is exact."""
    for eta in (0.1, 0.3):
        close(frequencies(rotor("CAN", 200.0, eta=eta)), exact("CAN", 200.0, eta=eta), 10)
        assert mismatch("CAN", POLAR, 0.0, eta)[1] == pytest.approx(eta**2 / 8, rel=0.15)
