"""Rayleigh and modal damping: closed forms, finite elements of the tests' own, reactions, derivatives."""

import equinox as eqx
import fem
import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.linalg
from differences import check_forward

import jaxrotor as jr
from jaxrotor import (
    Constraint,
    Disc,
    FlexibleShaft,
    InternalDamping,
    MasslessShaft,
    ModalDamping,
    RayleighDamping,
    RigidShaft,
    Scene,
    Support,
)
from jaxrotor.effects import modal_damping


LENGTH, DIAMETER = 1.0, 0.03
YOUNG, DENSITY, SHEAR = 2.1e11, 7850.0, 8.1e10
STEEL = jr.Material(YOUNG, DENSITY, SHEAR)
RIGIDITY = YOUNG * np.pi * DIAMETER**4 / 64
PER_LENGTH = DENSITY * np.pi * DIAMETER**2 / 4
PINS = (Constraint(0.0), Constraint(LENGTH))
BEAM = (np.arange(1, 4) * np.pi / LENGTH) ** 2 * np.sqrt(RIGIDITY / PER_LENGTH)


def beam(*effects, speed=0.0, **shaft):
    """Pinned beam without rotary inertia, whose frequencies are `BEAM` at any speed."""
    shaft = {"nodes": 16, "rotary_inertia": False, "constraints": PINS} | shaft
    return Scene(
        FlexibleShaft(LENGTH, DIAMETER, STEEL, **shaft), *effects, spin=jr.ConstantSpeed(speed)
    )


def ahead(scene, count):
    """Roots of positive frequency, the slowest first."""
    found = np.asarray(jr.roots(scene, 2 * count))
    return found[found.imag > 0]


def damped(omega, twice):
    """Root of `x^2 + twice x + omega^2`."""
    return -twice / 2 + 1j * np.sqrt(omega**2 - twice**2 / 4)


# === Rayleigh damping


@pytest.mark.parametrize("speed", [0.0, 3000.0])
def test_rayleigh_damping_of_a_beam(speed):
    """`x^2 + (alpha + beta omega^2) x + omega^2 = 0` at any speed, above the onset of internal damping."""
    alpha, beta = 6.0, 2e-5
    found = ahead(beam(RayleighDamping(alpha, beta), speed=speed), 3)
    np.testing.assert_allclose(found, damped(BEAM, alpha + beta * BEAM**2), rtol=1e-8)
    turning = beam(InternalDamping(beta), speed=speed)
    assert (float(jnp.max(jr.roots(turning, 4).real)) > 1.0) == (speed > 0)


DISC = (0.3, 12.0, 0.05, 0.1)
SPRINGS = ((0.0, np.diag([3e6, 2e6])), (LENGTH, np.array([[4e6, 5e5], [-2e5, 5e6]])))


def on_springs(*effects, speed):
    shaft = FlexibleShaft(LENGTH, DIAMETER, STEEL, nodes=12, constraints=(), shear=True)
    bearings = [Support(at, stiffness) for at, stiffness in SPRINGS]
    return Scene(shaft, Disc(*DISC), *bearings, *effects, spin=jr.ConstantSpeed(speed))


def of_elements(damping, speed, pieces):
    """Roots of positive frequency of finite elements; `damping(M, K of the shaft, K)` is their `C`."""
    stretch, material = [fem.Stretch(LENGTH, DIAMETER)], (YOUNG, DENSITY, SHEAR)
    _, mass, gyroscopic, stiffness = fem.matrices(
        stretch, [DISC], SPRINGS, material, LENGTH / pieces
    )
    _, _, _, alone = fem.matrices(stretch, [DISC], [], material, LENGTH / pieces)
    both = damping(mass, alone, stiffness) + speed * gyroscopic
    inverse = np.linalg.inv(stiffness)
    size = len(mass)
    state = np.block([[-inverse @ both, -inverse @ mass], [np.eye(size), np.zeros((size, size))]])
    found = 1 / scipy.linalg.eigvals(state)
    found = found[found.imag > 1.0]
    return found[np.argsort(np.abs(found))][:5]


def extrapolated(damping, speed):
    """Limit of fine elements, whose error goes with the square of their length."""
    coarse, fine = (of_elements(damping, speed, pieces) for pieces in (20, 40))
    return (4 * fine - coarse) / 3


def in_modes(ratios):
    """`C = M Phi diag(2 zeta omega) Phi' M` of the modes of both planes, in pairs of mean stiffness."""

    def damping(mass, alone, stiffness):
        size = len(mass) // 2
        planes = np.concatenate([np.arange(0, 2 * size, 2), np.arange(1, 2 * size, 2)])
        swap = np.eye(2 * size)[planes]
        own, other = (swap @ block @ swap.T for block in (mass, stiffness))
        plane = own[:size, :size]
        mean = (other[:size, :size] + other[size:, size:]) / 2
        squares, modes = scipy.linalg.eigh(mean, plane)
        modes = modes[:, : len(ratios)]
        rates = 2 * np.array(ratios) * np.sqrt(squares[: len(ratios)])
        one = plane @ modes @ np.diag(rates) @ modes.T @ plane
        return swap.T @ np.kron(np.eye(2), one) @ swap

    return damping


WAYS = {
    "rayleigh": (RayleighDamping(9.0, 4e-5), lambda mass, alone, _: 9.0 * mass + 4e-5 * alone),
    "modal": (ModalDamping([0.03, 0.01, 0.02]), in_modes([0.03, 0.01, 0.02])),
}


@pytest.mark.slow
@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("speed", [0.0, 700.0])
def test_finite_elements(way, speed):
    """A disc on a shaft with shear, in bearings that are unequal and coupled, with gyroscopic moments."""
    effect, damping = WAYS[way]
    found = np.asarray(jr.roots(on_springs(effect, speed=speed), 20))
    found = found[found.imag > 1.0][:5]
    np.testing.assert_allclose(found, extrapolated(damping, speed), rtol=3e-6)


# === modal damping


@pytest.mark.slow
def test_modal_damping_of_a_beam():
    """The first two modes have their ratios, the third none, with one span and with a disc of no mass."""
    ratios = np.array([0.02, 0.3, 0.0])
    for scene in (beam(ModalDamping([0.02, 0.3])), beam(ModalDamping([0.02, 0.3]), Disc(0.3, 0.0))):
        found = ahead(scene, 3)
        np.testing.assert_allclose(found, damped(BEAM, 2 * ratios * BEAM), rtol=1e-7)
        assert abs(found[2].real) < 1e-9 * abs(found[2])


def test_modal_damping_depends_on_the_modes_at_rest_alone():
    """With gyroscopic moments the roots move with the speed, the block of damping does not."""
    discs = Disc(0.3, 5.0, 0.02, 0.04), Disc(0.8, 3.0, 0.01, 0.02)
    still, turning = (
        jr.assemble(beam(ModalDamping([0.02]), *discs, speed=speed, nodes=5, rotary_inertia=True))
        for speed in (0.0, 500.0)
    )
    np.testing.assert_array_equal(still.blocks.damping, turning.blocks.damping)
    assert still.owners_of("damping") == "modal_damping" and still.blocks.circulatory is None


def rigid(*effects, stiffness=4e5, speed=0.0):
    bearings = [Support(at, stiffness) for at in (0.0, LENGTH)]
    disc = Disc(LENGTH / 2, 10.0, 0.5, 0.0)
    return Scene(RigidShaft(LENGTH), bearings, disc, *effects, spin=jr.ConstantSpeed(speed))


def test_modal_damping_of_a_rigid_rotor():
    """Bounce `2 k / m` and tilt `k l^2 / (2 J)`, of which the first has the first ratio."""
    found = ahead(rigid(ModalDamping([0.1, 0.4])), 2)
    bounce, tilt = np.sqrt(8e5 / 10.0), np.sqrt(4e5 / (2 * 0.5))
    np.testing.assert_allclose(found[0], damped(bounce, 0.2 * bounce), rtol=1e-12)
    np.testing.assert_allclose(found[1], damped(tilt, 0.8 * tilt), rtol=1e-12)


def test_free_motions_have_no_damping():
    """The two rigid motions of a free shaft come first, then bending."""
    scene = beam(ModalDamping([0.5, 0.5, 0.01]), constraints=())
    found = np.asarray(jr.roots(scene))
    assert np.sum(np.abs(found) < 1e-2) == 4
    bent = found[np.abs(found) > 1.0][:2]
    np.testing.assert_allclose(-bent.real / np.abs(bent), 0.01, rtol=1e-7)


def test_coordinates_without_mass_have_no_mode():
    """A disc on a massless shaft between soft supports: `1 / k = 1 / k_shaft + 1 / (2 k_support)`."""
    shaft = MasslessShaft(1.0, 0.5, 3e5, ends="elastic")
    bearings = [Support(at, 2e5) for at in (0.0, 1.0)]
    scene = Scene(shaft, bearings, Disc(0.5, 8.0), ModalDamping([0.05]), spin=jr.ConstantSpeed(0.0))
    omega = np.sqrt(1 / (1 / 3e5 + 1 / 4e5) / 8.0)
    np.testing.assert_allclose(ahead(scene, 1)[0], damped(omega, 0.1 * omega), rtol=1e-12)


@pytest.mark.slow
def test_free_decay_in_time():
    """`z = z_0 exp(-zeta omega t) (cos + ..)` of a rotor of one coordinate, released at rest."""
    zeta, omega = 0.04, np.sqrt(3e5 / 8.0)
    scene = Scene(
        MasslessShaft(1.0, 0.5, 3e5),
        Disc(0.5, 8.0),
        ModalDamping([zeta]),
        spin=jr.ConstantSpeed(150.0),
    )
    run = jr.simulate(scene, 6, 64, start=jr.Whirl(1e-3))
    time, own = np.asarray(run.time), omega * np.sqrt(1 - zeta**2)
    wave = np.cos(own * time) + zeta / np.sqrt(1 - zeta**2) * np.sin(own * time)
    expected = 1e-3 * np.exp(-zeta * omega * time) * wave
    np.testing.assert_allclose(run.displacement[:, 0], expected, atol=1e-12)


@pytest.mark.long
@pytest.mark.parametrize(
    "effect", [RayleighDamping(30.0, 1e-4), ModalDamping([0.1, 0.05])], ids=lambda one: one.kind
)
def test_reactions_of_pins_are_those_of_stiff_bearings(effect):
    """The work on influence lines has the damping, too: near resonance, beside bearings of 1e11 N/m."""

    def forces(*effects, **shaft):
        scene = beam(*effects, Disc(0.3, 4.0), jr.Unbalance(0.3, moment=1e-3), speed=275.0, **shaft)
        start = jr.Continued(*jr.steady_state(scene))
        return np.asarray(jr.reactions(jr.simulate(scene, 1, 16, start=start, at=0.3)).force)

    bearings = [Support(at, 1e11) for at in (0.0, LENGTH)]
    pinned, stiff = forces(effect, nodes=7), forces(effect, *bearings, nodes=7, constraints=())
    size = np.abs(pinned).max()
    assert np.abs(pinned - stiff).max() < 1e-4 * size
    assert np.abs(pinned - forces(nodes=7)).max() > 0.1 * size


# === derivatives


PATHS = ("rayleigh_damping.mass", "rayleigh_damping.stiffness", "supports.stiffness", "disc.mass")


@pytest.mark.slow
def test_derivatives_of_a_root():
    """Of real and imaginary part together, by the damping, the stiffness and the mass."""
    scene = beam(
        RayleighDamping(3.0, 2e-4),
        ModalDamping([0.1, 0.02]),
        [Support(at, 4e5) for at in (0.0, LENGTH)],
        Disc(0.3, 10.0),
        nodes=4,
        constraints=(),
    )
    own = jnp.array([3.0, 2e-4, 4e5, 10.0, 0.1, 0.02])

    def root(values):
        ratios = {"modal_damping.ratios": values[4:]}
        put = dict(zip(PATHS, values[:4], strict=True)) | ratios
        found = jr.roots(scene.put(put), 4)
        return jnp.sum(jnp.array([1.0, 0.7, 0.3, 0.2]) * (found.real + 0.5 * found.imag))

    check_forward(root, own, 1e-4)


@pytest.mark.slow
def test_derivatives_of_equal_modes():
    """Two modes of one frequency and one ratio have a derivative, by which both move."""
    stiffness = jnp.diag(jnp.array([2.0, 2.0, 5.0]))
    turn = jnp.array([[1.0, 0.2, 0.1], [0.2, 1.0, 0.0], [0.1, 0.0, 1.0]])
    ratios = jnp.array([0.1, 0.1])

    def total(change):
        flexibility = jnp.linalg.inv(turn @ stiffness * (1 + change) @ turn.T + jnp.eye(3))
        return jnp.trace(modal_damping._rates(flexibility, jnp.ones(()), ratios))

    value, slope = jax.jvp(total, (jnp.zeros(()),), (jnp.ones(()),))
    step = 1e-5
    expected = (total(jnp.asarray(step)) - total(jnp.asarray(-step))) / (2 * step)
    assert float(slope) == pytest.approx(float(expected), rel=1e-7) and float(value) > 0


# === input


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda: ModalDamping([]), "must be a list of one or more finite numbers"),
        (lambda: ModalDamping(0.02), "must be a list of one or more finite numbers"),
        (lambda: ModalDamping([0.1, -0.02]), "must not be negative, but one is -0.02"),
        (lambda: RayleighDamping(-1.0), "`mass .1/s.` must not be negative"),
        (
            lambda: jr.roots(rigid(ModalDamping([0.1] * 3))),
            "first 3 modes, but the rotor has only 2",
        ),
    ],
)
def test_refusals(make, sentence):
    with pytest.raises(ValueError, match=sentence):
        make()


def test_scene_file():
    text = """
[shaft]
length = "1 m"
diameter = "30 mm"
constraints = [{at = "0 m", holds = "clamp"}]
[rayleigh_damping]
mass = "6 1/s"
stiffness = "20 us"
[modal_damping]
ratios = [0.02, "0.01"]
[spin]
speed = 0.0
"""
    scene = jr.loads(text)
    assert float(scene.get("rayleigh_damping.stiffness")) == pytest.approx(2e-5)
    assert scene.get("modal_damping.ratios").tolist() == [0.02, 0.01]
    with pytest.raises(jr.SceneError, match="ratios must be a list of one or more numbers, but is"):
        jr.loads(text.replace('[0.02, "0.01"]', "0.02"))
    assert eqx.tree_equal(scene.effects[0], RayleighDamping(6.0, 2e-5))
