"""Shafts of every kind: end conditions, spans, steps, shear, bearings, two stiffnesses.

They are compared with closed forms, exact transfer matrices, and the verification rotors of the sheet
(Friswell, Penny, Garvey, Lees, 2010, computed by other finite element programs).
"""

import itertools

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import brentq
from transfer import Joint, Stretch, whirl_near

import jaxrotor as jr
from jaxrotor import Constraint, Disc, FlexibleShaft, Scene, Step, Support
from jaxrotor.equations.pencil import Pencil, eigenvalues
from jaxrotor.files.toml import dumps


LENGTH, DIAMETER = 1.3, 0.02
STEEL = jr.Material(2.1e11, 7850.0, 2.1e11 / 2.6)
RIGIDITY, PER_LENGTH = 2.1e11 * np.pi * DIAMETER**4 / 64, 7850 * np.pi * DIAMETER**2 / 4


def at_rest(shaft, *effects, speed=0.0):
    return Scene(shaft, *effects, spin=jr.ConstantSpeed(speed))


def forward(scene, count=None):
    """Whirl rates of forward bending modes, ascending."""
    whirl = np.sort(np.asarray(jr.roots(scene)).imag)
    return whirl[whirl > 1e-3 * np.abs(whirl).min(where=np.abs(whirl) > 1.0, initial=1e9)][:count]


# === uniform beams: every kind of end, on either side

RIGID = {("free", "free"): 2, ("pin", "free"): 1, ("guide", "guide"): 1}  # number of rigid motions
C, S, CH, TH = np.cos, np.sin, np.cosh, np.tanh
CHARACTERISTIC = {
    ("clamp", "free"): lambda b: C(b) + 1 / CH(b),
    ("clamp", "pin"): lambda b: S(b) - C(b) * TH(b),
    ("free", "free"): lambda b: C(b) - 1 / CH(b),
    ("pin", "free"): lambda b: S(b) - C(b) * TH(b),
    ("guide", "guide"): S,
    ("guide", "clamp"): lambda b: S(b) + C(b) * TH(b),
}


def ends(first, last):
    both = ((0.0, first), (LENGTH, last))
    return tuple(Constraint(at, holds) for at, holds in both if holds != "free")


def first_roots(function, count):
    """First positive roots of a characteristic equation."""
    grid = np.arange(0.3, 6 * np.pi, 0.05)
    values = function(grid)
    places = np.flatnonzero(values[:-1] * values[1:] < 0)[:count]
    return np.array([brentq(function, grid[i], grid[i + 1], xtol=1e-15) for i in places])


# An end knows nothing of the other, so every kind is at either end once.
PAIRS = [pair for pair in CHARACTERISTIC if pair != ("clamp", "free")] + [("free", "clamp")]


@pytest.mark.slow
@pytest.mark.parametrize("pair", PAIRS, ids="-".join)
def test_end_conditions(pair):
    """First five frequencies of a slender beam with 20 nodes, and the number of rigid motions."""
    constraints = ends(*pair)
    pair = pair if pair in CHARACTERISTIC else pair[::-1]
    function = CHARACTERISTIC[pair]
    shaft = FlexibleShaft(
        LENGTH, DIAMETER, STEEL, nodes=20, rotary_inertia=False, constraints=constraints
    )
    expected = first_roots(function, 5) ** 2 * np.sqrt(RIGIDITY / PER_LENGTH) / LENGTH**2
    values = np.asarray(jr.roots(at_rest(shaft)))
    bent = np.sort(values.imag[values.imag > 1e-2 * expected[0]])[:5]
    np.testing.assert_allclose(bent, expected, rtol=1e-9)
    assert np.sum(np.abs(values) < 1e-2 * expected[0]) == 2 * RIGID.get(pair, 0)


@pytest.mark.slow
def test_convergence_is_exponential():
    """The error of the third frequency of the pinned beam falls by a factor with every node."""
    exact = (3 * np.pi) ** 2 * np.sqrt(RIGIDITY / PER_LENGTH) / LENGTH**2
    nodes, errors = [6, 9, 12], []
    for n in nodes:
        shaft = FlexibleShaft(
            LENGTH, DIAMETER, STEEL, nodes=n, rotary_inertia=False, constraints=ends("pin", "pin")
        )
        errors.append(abs(forward(at_rest(shaft), 3)[2] / exact - 1))
    slope, _ = np.polyfit(nodes, np.log(errors), 1)
    assert np.exp(-slope) > 5 and errors[-1] < 1e-8


# === closed forms of the pinned shaft


def pinned_whirls(number, speed, shear):
    """Whirl rates of `w = sin kx, psi = cos kx`: four with shear, two without, where psi = dw/dx.

    EI k^4 + 2 rI Omega k^2 w - (rA + rI k^2) w^2 = 0                              (no shear)
    (S k^2 - rA w^2) (EI k^2 + S + 2 rI Omega w - rI w^2) = (S k)^2,  S = kGA      (shear)
    """
    k = number * np.pi / LENGTH
    area, second = np.pi * DIAMETER**2 / 4, np.pi * DIAMETER**4 / 64
    gyroscopic = 2 * 7850 * second * speed
    if not shear:
        inertia = 7850 * (area + second * k**2)
        return np.roots([-inertia, gyroscopic * k**2, 2.1e11 * second * k**4])
    nu = 0.3
    stiff = 6 * (1 + nu) / (7 + 6 * nu) * 2.1e11 / 2.6 * area
    one = np.array([-7850 * area, 0.0, stiff * k**2])
    other = np.array([-7850 * second, gyroscopic, 2.1e11 * second * k**2 + stiff])
    return np.roots(np.polysub(np.polymul(one, other), [(stiff * k) ** 2]))


@pytest.mark.parametrize("shear", [True, False])
@pytest.mark.parametrize("speed", [0.0, 3000.0])
def test_rotating_pinned_shaft(shear, speed):
    shaft = FlexibleShaft(
        LENGTH, DIAMETER, STEEL, nodes=18, constraints=ends("pin", "pin"), shear=shear
    )
    found = np.asarray(jr.roots(at_rest(shaft, speed=speed))).imag
    for number in (1, 2, 3):
        expected = np.sort_complex(pinned_whirls(number, speed, shear)).real
        slow = expected[np.argsort(np.abs(expected))][:2]
        for whirl in slow:
            assert np.min(np.abs(found / whirl - 1)) < 1e-9
    if shear:  # the branch where the sections rotate against the slope of the line
        fast = np.sort(pinned_whirls(1, speed, True).real)[-1]
        assert np.min(np.abs(found / fast - 1)) < 1e-9


def flat_pinned_whirls(number, speed, ratio, length, diameter):
    """Roots in rotating axes of `w = sin kx, psi = cos kx`, for a Timoshenko shaft with EI (1 +- mu).

    rA z.. + S k (k z - psi) = 0,  rI psi.. - 2 i rI Omega psi. + EI k^2 psi + .. + S (psi - k z) = 0
    """
    k, nu = number * np.pi / length, 0.3
    area, second = np.pi * diameter**2 / 4, np.pi * diameter**4 / 64
    stiff = 6 * (1 + nu) / (7 + 6 * nu) * 2.1e11 / 2.6 * area
    i = np.array(
        [[0.0, -1.0], [1.0, 0.0]]
    )  # rotation in the plane; coordinates are (z, psi) by (x, y)
    both = lambda matrix: np.kron(matrix, np.eye(2))
    mass, gyroscopic = 7850 * np.diag([area, second]), 7850 * np.diag([0.0, 2 * second])
    sheared = stiff * np.array([[k**2, -k], [-k, 1.0]])
    bent = np.kron(np.diag([0.0, 2.1e11 * second * k**2]), np.diag([1 + ratio, 1 - ratio]))
    damping = speed * np.kron(2 * mass - gyroscopic, i)
    stiffness = both(sheared) + bent + speed**2 * both(gyroscopic - mass)
    inverse = np.linalg.inv(both(mass))
    low = np.concatenate([-inverse @ stiffness, -inverse @ damping], axis=1)
    return np.linalg.eigvals(np.concatenate([np.eye(4, 8, 4), low]))


@pytest.mark.parametrize("speed", [0.0, 4000.0, 15500.0])
def test_two_stiffnesses_with_shear(speed):
    """Shear stiffness is isotropic; at 15500 rad/s, between the critical speeds, one root is unstable."""
    length, diameter, ratio = 0.2, 0.05, 0.3
    shaft = FlexibleShaft(
        length,
        diameter,
        STEEL,
        nodes=14,
        constraints=(Constraint(0.0), Constraint(length)),
        shear=True,
        anisotropy=ratio,
    )
    found = np.asarray(jr.roots(at_rest(shaft, speed=speed)))
    expected = flat_pinned_whirls(1, speed, ratio, length, diameter)
    for root in expected[np.argsort(np.abs(expected))][:4]:
        assert np.min(np.abs(found - root)) < 1e-8 * np.max(np.abs(expected))
    if speed == 0:  # frequency of the stiff axis in closed form, derived independently
        assert np.min(np.abs(found.imag - 16738.39)) < 0.01
    assert (expected.real.max() > 100) == (speed == 15500.0)


# === verification rotors of the sheet

FRISWELL = jr.Material(2.11e11, 7810.0, 8.12e10)
DISCS = [
    (0.5, 32.58972765, 0.1780892826, 0.3295636209),
    (1.0, 51.52526111, 0.4235805841, 0.8050822049),
]
HERTZ = {  # V1: slender or not -> rpm -> frequencies
    True: {
        0: [13.792051, 13.792051, 43.657334, 43.657334, 114.044739, 114.044739],
        2000: [13.693908, 13.884994, 41.901915, 45.326450, 104.620495, 123.199446],
        4000: [13.590141, 13.973129, 40.072117, 46.903894, 95.505954, 131.566732],
    },
    False: {
        0: [13.801234, 13.801234, 43.731355, 43.731355, 114.190747, 114.190747],
        4000: [13.601419, 13.980302, 40.140819, 46.987591, 95.680826, 131.686768],
    },
}


def two_discs(shear, speed, softer=0.0, nodes=8):
    shaft = FlexibleShaft(
        1.5, 0.05, FRISWELL, nodes=nodes, rotary_inertia=shear, constraints=(), shear=shear
    )
    mean, share = 1e6 - softer / 2, softer / 2 / (1e6 - softer / 2)
    bearings = [Support(x, mean, anisotropy=share or None) for x in (0.0, 1.5)]
    return at_rest(shaft, *(Disc(*disc) for disc in DISCS), *bearings, speed=speed)


@pytest.mark.slow
@pytest.mark.parametrize(("shear", "rpm"), [(s, rpm) for s in HERTZ for rpm in HERTZ[s]])
def test_two_discs_on_bearings(shear, rpm):
    """Within 2e-6 of 60 finite elements (sheet), and within 1e-9 of exact transfer matrices."""
    speed = rpm * np.pi / 30
    found = np.asarray(jr.roots(two_discs(shear, speed), 6)).imag
    hertz = np.sort(np.abs(found)) / (2 * np.pi)
    np.testing.assert_allclose(hertz, HERTZ[shear][rpm], rtol=2e-6)
    stretch = Stretch(0.5, 0.05, 2.11e11, 7810.0, 8.12e10 if shear else np.inf, rotary=shear)
    joints = [Joint(stiffness=1e6), *(Joint(*disc[1:]) for disc in DISCS), Joint(stiffness=1e6)]
    exact = [whirl_near(whirl, [stretch] * 3, joints, speed) for whirl in found]
    np.testing.assert_allclose(found, exact, rtol=2e-9)


UNEQUAL = {  # V2, rad/s
    0.0: "82.652948 86.658013 254.515629 274.307120 679.296525 716.564231 1031.759092 1065.444226",
    300.0: "82.481239 86.767241 245.486850 282.326385 613.938852 778.744936 1023.989749 1070.768092",
}


@pytest.mark.slow
@pytest.mark.parametrize("speed", UNEQUAL)
def test_two_discs_on_unequal_bearings(speed):
    found = np.asarray(jr.roots(two_discs(True, speed, softer=0.2e6), 16))
    assert np.abs(found.real).max() < 1e-9 * np.abs(found).max()
    np.testing.assert_allclose(
        np.sort(found.imag)[8:], np.fromstring(UNEQUAL[speed], sep=" "), rtol=3e-6
    )
    finer = np.asarray(jr.roots(two_discs(True, speed, softer=0.2e6, nodes=11), 16))
    np.testing.assert_allclose(np.sort(found.imag), np.sort(finer.imag), rtol=1e-9)


OVERHUNG = {  # V3
    0: (
        [-0.037995, -0.010054, -1.218516, -0.849979],
        [44.332124, 44.409440, 400.396901, 401.014567],
    ),
    3000: (
        [-0.013854, -0.038880, -0.000333, -1.786307],
        [38.241459, 50.591610, 356.896622, 412.980617],
    ),
}


def overhung(rpm, *bearings):
    material = jr.Material(2.11e11, 7810.0, 2.11e11 / 2.6)
    shaft = FlexibleShaft(1.5, 0.025, material, constraints=(), shear=True)
    return at_rest(shaft, Disc(1.5, 15.3, 0.062, 0.120), *bearings, speed=rpm * np.pi / 30)


@pytest.mark.parametrize("rpm", OVERHUNG)
def test_overhung_disc_on_damped_bearings(rpm):
    matrix = np.diag([10e6, 20e6])
    damped = Support(1.0, matrix, 60e3 * np.eye(2))
    found = np.asarray(jr.roots(overhung(rpm, Support(0.0, matrix), damped), 10))
    whirl = found[found.imag > 1.0]
    np.testing.assert_allclose(whirl.real, OVERHUNG[rpm][0], atol=6e-7, rtol=3e-6)
    np.testing.assert_allclose(whirl.imag, OVERHUNG[rpm][1], rtol=1e-6)


def test_overhung_disc_without_damping():
    found = np.asarray(jr.roots(overhung(1000, Support(0.0, 10e6), Support(1.0, 10e6)), 4))
    whirl = np.sort(np.abs(found.imag))
    np.testing.assert_allclose(whirl, [42.249895, 46.403790, 389.655579, 402.151511], rtol=1e-6)


LIMITER = {  # V4, in rad per T*: forward and backward
    False: (
        [1.73662, 20.3876, 50.26983, 84.65958],
        [1.45102, 12.50768, 35.89358, 79.37068],
    ),
    True: (
        [1.73665, 20.34871, 50.13287, 84.0191],
        [1.45025, 12.48739, 35.74866, 78.61795],
    ),
}


@pytest.mark.parametrize("shear", LIMITER)
def test_shaft_of_the_limiter_rotor(shear):
    rotor = jr.load("limiter-rotor")
    shaft = FlexibleShaft(
        0.7,
        0.02,
        STEEL,
        nodes=18,
        rotary_inertia=shear,
        shear=shear,
        constraints=[Constraint(0.0, "clamp")],
    )
    disc = next(effect for effect in rotor.effects if effect.kind == "disc")
    found = np.asarray(jr.roots(at_rest(shaft, disc, speed=float(rotor.spin.speed)))).imag
    time = 15 / float(rotor.spin.speed)
    for sense, expected in zip((1, -1), LIMITER[shear], strict=True):
        whirl = np.sort(sense * found[sense * found > 0])[:4] * time
        np.testing.assert_allclose(whirl, expected, atol=6e-6, rtol=5e-7)
    stretch = Stretch(0.7, 0.02, 2.1e11, 7850.0, 2.1e11 / 2.6 if shear else np.inf, rotary=shear)
    clamp, end = (
        Joint(pinned=True, slope=True),
        Joint(*(float(getattr(disc, name)) for name in ("mass", "diametral", "polar"))),
    )
    slow = found[np.argsort(np.abs(found))][:8]
    exact = [whirl_near(whirl, [stretch], [clamp, end], float(rotor.spin.speed)) for whirl in slow]
    np.testing.assert_allclose(slow, exact, rtol=1e-7)


# === steps, bores and inner constraints: exact transfer matrices


@pytest.mark.slow
def test_steps_and_constraints_against_transfer_matrices():
    """Hollow and solid sections of two materials, with an inner pin, a guide at the end, and a disc."""
    bronze = jr.Material(1.1e11, 8800.0, 4.1e10)
    for shear in (False, True):
        shaft = FlexibleShaft(
            1.2,
            0.03,
            STEEL,
            inner_diameter=0.01,
            steps=(Step(0.25, 0.04), Step(0.7, 0.025, 0.015, bronze)),
            constraints=(Constraint(0.4, "pin"), Constraint(1.2, "guide")),
            nodes=14,
            shear=shear,
        )
        disc, speed = Disc(0.9, 3.0, 0.01, 0.018), 500.0
        scene = at_rest(shaft, disc, Support(0.0, 2e6), speed=speed)
        modulus = (2.1e11 / 2.6, 4.1e10) if shear else (np.inf, np.inf)
        steel, other = (2.1e11, 7850.0, modulus[0]), (1.1e11, 8800.0, modulus[1])
        stretches = [
            Stretch(0.25, 0.03, *steel, 0.01),
            Stretch(0.15, 0.04, *steel),
            Stretch(0.3, 0.04, *steel),
            Stretch(0.2, 0.025, *other, 0.015),
            Stretch(0.3, 0.025, *other, 0.015),
        ]
        joints = [
            Joint(stiffness=2e6),
            Joint(),
            Joint(pinned=True),
            Joint(),
            Joint(3.0, 0.01, 0.018),
            Joint(slope=True),
        ]
        found = np.asarray(jr.roots(scene, 8)).imag
        exact = [whirl_near(whirl, stretches, joints, speed) for whirl in found]
        np.testing.assert_allclose(found, exact, rtol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("holds", ["pin", "guide", "clamp"])
def test_two_equal_spans(holds):
    """Beam pinned at both ends and held at the middle: modes of half of it, by symmetry."""
    held = (*ends("pin", "pin"), Constraint(LENGTH / 2, holds))
    shaft = FlexibleShaft(LENGTH, DIAMETER, STEEL, nodes=16, rotary_inertia=False, constraints=held)
    by_symmetry = {"pin": [S, CHARACTERISTIC["clamp", "pin"]]}
    by_symmetry["clamp"] = [CHARACTERISTIC["clamp", "pin"]] * 2
    by_symmetry["guide"] = [C, CHARACTERISTIC["clamp", "pin"]]
    betas = np.sort(np.concatenate([first_roots(f, 3) for f in by_symmetry[holds]]))[:4]
    expected = betas**2 * np.sqrt(RIGIDITY / PER_LENGTH) / (LENGTH / 2) ** 2
    np.testing.assert_allclose(forward(at_rest(shaft), 4), expected, rtol=1e-9)


@pytest.mark.slow
def test_a_stiff_support_is_a_pin():
    """The roots differ from those with a pin in inverse proportion to the stiffness of the support."""
    held = FlexibleShaft(LENGTH, DIAMETER, STEEL, constraints=(Constraint(0.3), Constraint(1.0)))
    loose = FlexibleShaft(LENGTH, DIAMETER, STEEL, constraints=())
    expected = np.asarray(jr.roots(at_rest(held, Disc(0.65, 2.0)), 6))
    off = []
    for stiffness in (1e9, 1e10):
        bearings = [Support(at, stiffness) for at in (0.3, 1.0)]
        found = np.asarray(jr.roots(at_rest(loose, Disc(0.65, 2.0), *bearings), 6))
        off.append(np.max(np.abs(found.imag / expected.imag - 1)))
    assert off[0] < 1e-3 and off[0] / off[1] == pytest.approx(10, rel=0.02)


# === laws that hold for any rotor


def random_rotor(seed):
    """An undamped rotor with random parts."""
    rng = np.random.default_rng(seed)
    length = 1.0
    places = rng.permutation(np.arange(1, 20))[:6] / 20
    steps = tuple(Step(at, rng.uniform(0.02, 0.05)) for at in sorted(places[:2]))
    kinds = rng.choice(["pin", "guide", "clamp", "free"], 3).tolist()
    held = zip((0.0, places[2], length), kinds, strict=True)
    shaft = FlexibleShaft(
        length,
        rng.uniform(0.02, 0.05),
        STEEL,
        nodes=int(rng.integers(3, 11)),
        steps=steps,
        constraints=tuple(Constraint(at, kind) for at, kind in held if kind != "free"),
        shear=bool(rng.integers(2)),
    )
    discs = [
        Disc(at, m := rng.uniform(1, 30), 0.003 * m, 0.006 * m * rng.uniform(0.1, 1))
        for at in places[3:5]
    ]
    bearings = [Support(at, 10 ** rng.uniform(5, 8)) for at in (0.05, places[5])]
    return at_rest(shaft, *discs, *bearings, speed=rng.uniform(-2000, 2000))


@eqx.filter_jit
def computed(scene):
    """Eigenvalues as they come out of the solver, and the roots."""
    return eigenvalues(Pencil.of(jr.assemble(scene))), jr.roots(scene)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(5))
def test_conservative_roots_are_imaginary(seed):
    """Eigenvalues before `roots` removes rounding, 1e-9, have real parts well below that.

    By the vector units of a processor they are 3e-11 to 1.1e-10 of the largest root.
    """
    values, roots = map(np.asarray, computed(random_rotor(seed)))
    assert np.abs(values.real).max() < 5e-10 * np.abs(values).max()
    assert np.all(roots.real == 0)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2))
def test_external_damping_alone_is_stable_at_every_speed(seed):
    rotor = random_rotor(seed)
    damped = Scene(rotor.shaft, *rotor.effects, jr.ExternalDamping(20.0), spin=rotor.spin)
    for speed in (0.0, 100.0, 1000.0, 10_000.0):
        assert np.max(np.asarray(jr.roots(damped.replace({"spin.speed": speed}))).real) < 0


@pytest.mark.slow
def test_internal_damping_alone_destabilises_at_the_first_critical_speed():
    shaft = FlexibleShaft(
        LENGTH, DIAMETER, STEEL, constraints=ends("pin", "pin"), shear=True, nodes=10
    )
    scene = at_rest(shaft, Disc(0.5, 4.0, 0.01, 0.02), jr.InternalDamping(1e-5))
    critical = float(jr.critical_speeds(scene).forward[0])
    for share, sign in ((1 - 1e-6, -1), (1 + 1e-6, 1)):
        values = np.asarray(jr.roots(scene.replace({"spin.speed": share * critical})))
        assert np.sign(values.real.max()) == sign


@pytest.mark.slow
def test_one_physics_two_descriptions():
    """Disc at mid-span of a shaft of two stiffnesses: massless, and flexible with a tiny mass."""
    stiffness = 48 * RIGIDITY / LENGTH**3
    light = jr.Material(2.1e11, 1e-7)
    middle, ratio = LENGTH / 2, 0.2
    flexible = FlexibleShaft(
        LENGTH, DIAMETER, light, constraints=ends("pin", "pin"), anisotropy=ratio, nodes=4
    )
    massless = jr.MasslessShaft(LENGTH, middle, stiffness, anisotropy=ratio)
    on_it = [Disc(middle, 3.0), jr.DiscDamping(middle, 4.0)]
    for share in (0.5, 0.95, 1.05, 1.7):
        speed = share * np.sqrt(stiffness / 3.0)
        one, other = (
            np.asarray(jr.roots(at_rest(shaft, *on_it, speed=speed), 4))
            for shaft in (flexible, massless)
        )
        in_order = lambda roots: roots[np.lexsort((roots.real, roots.imag.round(6)))]
        np.testing.assert_allclose(in_order(one), in_order(other), rtol=1e-8)


# === gradients and refusals


@pytest.mark.slow
@pytest.mark.parametrize("shear", [False, True])
def test_gradient_by_steps_and_constraints(shear):
    shaft = FlexibleShaft(
        1.2,
        0.03,
        STEEL,
        steps=(Step(0.5, 0.04, 0.01),),
        constraints=(Constraint(0.3), Constraint(0.9)),
        shear=shear,
    )
    scene = at_rest(shaft, Disc(1.1, 3.0, 0.01, 0.018), speed=300.0)
    paths = (
        "constraints.1.at",
        "steps.0.at",
        "steps.0.diameter",
        "steps.0.inner_diameter",
        "length",
    )
    paths, step = [f"shaft.{path}" for path in paths], 1e-6
    own = jnp.array([float(scene.get(path)) for path in paths])
    slowest = lambda own: jr.roots(scene.replace(dict(zip(paths, own, strict=True))), 4).imag

    @jax.jit
    def both(own):  # values, and derivatives by every path in a row of its own
        push = lambda along: jax.jvp(slowest, (own,), (along,))
        return jax.vmap(push, out_axes=(None, 0))(jnp.eye(len(paths)))

    exact = np.asarray(both(own)[1])
    at = lambda own: np.asarray(both(jnp.asarray(own))[0])
    apart = step * np.eye(len(paths))
    differences = [(at(own + one) - at(own - one)) / (2 * step) for one in apart]
    np.testing.assert_allclose(exact, differences, rtol=2e-5)
    assert np.abs(exact).min() > 1e-3


def build(**options):
    return at_rest(FlexibleShaft(1.0, 0.02, **options))


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (
            lambda: build(constraints=(Constraint(0.5), Constraint(0.501))),
            "is nearer than 0.002 m .* which is 1 m long",
        ),
        (lambda: build(constraints=(Constraint(0.0), Constraint(0.0, "guide"))), "Two constraints"),
        (lambda: build(constraints=(Constraint(1.5),)), "is off the shaft"),
        (lambda: build(steps=(Step(1.0, 0.03),)), "is at an end of the shaft"),
        (lambda: build(steps=(Step(0.6, 0.03), Step(0.4, 0.02))), "in the order of their stations"),
        (lambda: build(steps=(Step(0.4, 0.03), Step(0.4, 0.02))), "Two steps are at 0.4 m"),
        (lambda: build(inner_diameter=0.03), "`inner_diameter [m]` must be below"),
        (
            lambda: build(shear=True, material=jr.Material(2e11, 7800.0)),
            "needs the `shear_modulus [Pa]`",
        ),
        (lambda: build(shear=True, rotary_inertia=False), "slopes are coordinates"),
        (lambda: build(anisotropy=1.2), "must be between -1 and 1"),
        (lambda: build(rule="trapezoid", constraints=(Constraint(0.5),)), "at its ends only"),
        (lambda: build(rule="trapezoid", steps=(Step(0.5, 0.03),)), "uniform shaft"),
    ],
)
def test_refusals(make, sentence):
    with pytest.raises(ValueError, match=sentence.replace("[", r"\[").replace("]", r"\]")):
        make()


def test_general_shaft_as_a_file():
    text = """
[shaft]
length = "1.2 m"
diameter = "30 mm"
material = "steel"
shear = true
steps = [{at = 0.4, diameter = "40 mm", inner_diameter = "10 mm"}, {at = 0.8, diameter = 0.03}]
constraints = [{at = 0.0, holds = "pin"}, {at = 1.0, holds = "guide"}]

[spin]
speed = 0.0
"""
    scene = jr.loads(text)
    assert float(scene.get("shaft.steps.0.inner_diameter")) == 0.01
    assert [one.holds for one in scene.shaft.constraints] == ["pin", "guide"]
    again = jr.loads(dumps(scene))
    np.testing.assert_array_equal(jr.roots(again), jr.roots(scene))
    free = jr.loads(text.replace('[{at = 0.0, holds = "pin"}, {at = 1.0, holds = "guide"}]', "[]"))
    assert free.shaft.constraints == ()


@pytest.mark.slow
def test_more_constraints_in_any_order_are_the_same():
    held = [Constraint(0.0), Constraint(0.4), Constraint(LENGTH, "clamp")]
    found = [
        np.asarray(jr.roots(at_rest(FlexibleShaft(LENGTH, DIAMETER, constraints=order)), 6))
        for order in itertools.islice(itertools.permutations(held), 0, None, 2)
    ]
    np.testing.assert_allclose(found, np.broadcast_to(found[0], np.shape(found)), rtol=1e-12)


@pytest.mark.parametrize(
    ("options", "at", "expected"),
    [
        ({}, 2.0, 8 / 3),
        ({"rule": "trapezoid"}, 2.0, 8 / 3),
        ({"constraints": (jr.Constraint(0.0), jr.Constraint(2.0))}, 1.0, 8 / 48),
        ({"steps": (jr.Step(1.0, 0.1),)}, 2.0, 7 / 3 + 1 / 3 / 16),
        ({"shear": True}, 2.0, 8 / 3 + 2 * (7 + 6 * 0.3) * 0.05**2 / 48),
    ],
    ids=["cantilever", "trapezoid", "pinned", "stepped", "shear"],
)
def test_strain_energy_is_the_work_of_a_force(options, at, expected):
    """Deflection due to a unit force, times E I; shear adds l / kGA = l (7 + 6 nu) D^2 / 48 to it."""
    shear = 2e11 / 2 / 1.3
    options = {"nodes": 6, "constraints": (jr.Constraint(0.0, "clamp"),)} | options
    shaft = jr.FlexibleShaft(2.0, 0.05, jr.Material(2e11, 7850.0, shear), **options)
    scene = jr.Scene(shaft, jr.Disc(at, 1.0), spin=jr.ConstantSpeed(0.0))
    stiffness, strain_energy, row, column = map(np.asarray, at_station(scene, jnp.asarray(at)))
    bent = np.linalg.solve(stiffness, column) * 2e11 * np.pi * 0.05**4 / 64
    energy = bent @ strain_energy @ bent / (2e11 * np.pi * 0.05**4 / 64)
    np.testing.assert_allclose(energy, expected, rtol=1e-8)
    np.testing.assert_allclose(bent @ row, expected, rtol=1e-8)


@eqx.filter_jit
def at_station(scene, at):
    """Stiffness and strain energy of the shaft, and the row and column of a station."""
    line = scene.line()
    return line.stiffness, line.energy(bending=False), line.row(at), line.column(at)
