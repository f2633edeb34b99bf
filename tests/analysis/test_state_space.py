"""State spaces, against closed forms and independently computed responses and motions."""

import numpy as np
import pytest
from scipy.signal import StateSpace, lsim, step

import jaxrotor as jr


MASS, STIFFNESS, DAMPING = 2.0, 800.0, 3.0
FREQUENCIES = np.array([2.0, 17.0, 55.0, 140.0, 700.0])


def jeffcott(*effects, speed=15.0, damping=DAMPING):
    return jr.Scene(
        jr.MasslessShaft(1.0, 0.5, STIFFNESS),
        jr.Disc(0.5, MASS),
        jr.DiscDamping(0.5, damping),
        *effects,
        spin=jr.ConstantSpeed(speed),
    )


def flexible(k=((4e5, 5e4), (-2e4, 7e5))):
    """Two discs on a shaft in bearings, by default unequal and cross-coupled."""
    bearings = [jr.Support(at, k, [[90.0, 0.0], [0.0, 90.0]]) for at in (0.0, 1.0)]
    discs = [jr.Disc(0.4, 9.0, 0.03, 0.05), jr.Disc(0.7, 4.0, 0.01, 0.02)]
    shaft = jr.FlexibleShaft(1.0, 0.03, nodes=3, constraints=())
    return jr.Scene(shaft, *discs, *bearings, spin=jr.ConstantSpeed(300.0))


def gain(system, frequency):
    states = np.eye(system.A.shape[0])
    return system.C @ np.linalg.solve(1j * frequency * states - system.A, system.B + 0j) + system.D


def whirls(system, frequency, angle):
    """Forward and backward parts of `z` under a force along `angle` at the first station."""
    force = np.zeros(system.B.shape[1])
    force[:2] = np.cos(angle), np.sin(angle)
    x, y = (gain(system, frequency) @ force).reshape(-1, 2).T
    return (x + 1j * y) / 2, np.conj(x - 1j * y) / 2


def test_one_mass_in_closed_form():
    """`z = F / (k - m w^2 + i w c)` without cross-coupling, as the disc does not tilt."""
    system = jr.state_space(jeffcott())
    assert isinstance(system, StateSpace)
    assert [part.shape for part in (system.A, system.B, system.C, system.D)] == [
        *((4, 4), (4, 2), (2, 4), (2, 2))
    ]
    for frequency in FREQUENCIES:
        expected = 1 / (STIFFNESS - MASS * frequency**2 + 1j * frequency * DAMPING)
        found = gain(system, frequency)
        np.testing.assert_allclose(found, expected * np.eye(2), rtol=0, atol=1e-13 * abs(expected))


def test_push_from_rest():
    """The step response to weight equals `simulate` and the closed form of a damped oscillator."""
    scene = jeffcott(jr.Gravity(9.81, angle=0.0))
    run = jr.simulate(scene, 3, 64, start=jr.AtRest())
    time = np.asarray(run.time)
    push = np.stack([np.full(time.size, MASS * 9.81), np.zeros(time.size)], axis=1)
    _, seen, _ = lsim(jr.state_space(scene), push, time)
    largest = np.abs(seen).max()
    z = np.asarray(run.displacement)[:, 0]
    np.testing.assert_allclose(seen[:, 0] + 1j * seen[:, 1], z, atol=1e-9 * largest)
    decay = DAMPING / 2 / MASS
    rate = np.sqrt(STIFFNESS / MASS - decay**2)
    wave = np.cos(rate * time) + decay / rate * np.sin(rate * time)
    swing = 9.81 * MASS / STIFFNESS * (1 - np.exp(-decay * time) * wave)
    np.testing.assert_allclose(seen[:, 0], swing, atol=1e-9 * largest)
    one = jr.state_space(scene)
    single = StateSpace(one.A, one.B[:, :1], one.C[:1], one.D[:1, :1])
    np.testing.assert_allclose(step(single, T=time)[1] * MASS * 9.81, swing, atol=1e-9 * largest)


@pytest.fixture(scope="module")
def unequal():
    scene = flexible()
    return scene, jr.state_space(scene, 0.4, [0.4, 0.7])


@pytest.mark.slow
def test_roots_are_the_eigenvalues(unequal):
    """The slowest roots have all digits, which they would lose with displacements as states."""
    scene, system = unequal
    roots = np.asarray(jr.roots(scene))
    assert system.A.shape == (roots.size, roots.size)
    slowest = np.linalg.eigvals(system.A)
    slowest = slowest[np.argsort(np.abs(slowest))][:8]
    for value in slowest:
        assert np.min(np.abs(roots - value)) < 1e-12 * abs(value)


@pytest.mark.slow
def test_response_is_that_of_a_harmonic_force(unequal):
    scene, system = unequal
    force = jr.HarmonicForce(0.4, angle=0.3)
    known = jr.forced_response(scene, FREQUENCIES, force, at=[0.4, 0.7])
    largest = np.abs(np.asarray(known.major)).max()
    for i, frequency in enumerate(FREQUENCIES):
        forward, backward = whirls(system, frequency, 0.3)
        np.testing.assert_allclose(forward, known.forward[i], rtol=0, atol=1e-12 * largest)
        np.testing.assert_allclose(backward, known.backward[i], rtol=0, atol=1e-12 * largest)


def mirrored(*effects):
    """Two equal discs on a free shaft at rest."""
    shaft = jr.FlexibleShaft(1.0, 0.03, nodes=3, constraints=())
    discs = [jr.Disc(at, 5.0, 0.02, 0.03) for at in (0.3, 0.7)]
    return jr.Scene(shaft, *discs, *effects, spin=jr.ConstantSpeed(0.0))


ONE, OTHER = np.diag([4e5, 7e5]), np.diag([7e5, 4e5])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("ats", "damping"), [(((0.0, 1.0), (0.0, 1.0)), 0.0), (((0.0,), (1.0,)), 90.0)]
)
def test_equal_roots(ats, damping):
    """The x and y axes are alike, by equal or by mirrored supports, so all roots are double."""
    loss = damping * np.eye(2) if damping else None
    supports = [
        jr.Support(at, k, loss)
        for k, places in zip((ONE, OTHER), ats, strict=True)
        for at in places
    ]
    scene = mirrored(*supports)
    roots = np.asarray(jr.roots(scene))
    assert np.sum(np.abs(roots[:, None] - roots) < 1e-9 * np.abs(roots)) == 2 * roots.size
    system = jr.state_space(scene, 0.3, [0.3, 0.7])
    force = jr.HarmonicForce(0.3, angle=0.3)
    known = jr.forced_response(scene, FREQUENCIES, force, at=[0.3, 0.7])
    for i, frequency in enumerate(FREQUENCIES):
        largest = np.abs(known.major[i]).max()
        forward, backward = whirls(system, frequency, 0.3)
        np.testing.assert_allclose(forward, known.forward[i], rtol=0, atol=1e-12 * largest)
        np.testing.assert_allclose(backward, known.backward[i], rtol=0, atol=1e-12 * largest)


@pytest.mark.slow
def test_roots_at_zero():
    """Two discs of a free shaft in a medium drift and tilt freely: the gain tends to `C (i w)^-1`."""
    scene = mirrored(*(jr.DiscDamping(at, DAMPING) for at in (0.3, 0.7)))
    slow = 1e-3
    expected = 1 / (1j * slow * DAMPING)
    for system in (jr.state_space(scene, 0.3), jr.state_space(scene, 0.3, modes=2)):
        np.testing.assert_allclose(
            gain(system, slow), expected * np.eye(2), atol=1e-2 * abs(expected)
        )
    with pytest.raises(
        ValueError, match="must be at least 2 to keep the roots at zero, .* but is 1"
    ):
        jr.state_space(scene, 0.3, modes=1)


@pytest.mark.slow
@pytest.mark.parametrize("equal", [True, False])
def test_few_modes(unequal, equal):
    """Modes left out are in the static response, so the error is small below their frequencies."""
    scene, at = (
        (unequal[0], [0.4, 0.7]) if not equal else (flexible(((5e5, 3e4), (-3e4, 5e5))), 0.7)
    )
    whole = unequal[1] if not equal else jr.state_space(scene, 0.4, at)
    few = jr.state_space(scene, 0.4, at, modes=4)
    assert few.A.shape == (8, 8) and np.abs(whole.D).max() == 0 and np.abs(few.D).max() > 0
    np.testing.assert_allclose(gain(few, 0.0), gain(whole, 0.0), rtol=1e-9)
    np.testing.assert_allclose(
        gain(few, 40.0), gain(whole, 40.0), atol=1e-3 * np.abs(gain(whole, 40.0)).max()
    )
    less = jr.state_space(scene, 0.4, at, modes=2)
    error = lambda system: np.abs(gain(system, 60.0) - gain(whole, 60.0)).max()
    assert error(few) < error(less) / 5


def test_axes_that_turn_with_the_shaft():
    """In rotating axes unbalance is a constant force: the circle is `Omega^2 m e` times the gain at 0."""
    unbalance = jr.Unbalance(0.5, MASS, 1e-3, phase=0.7)
    shaft = jr.MasslessShaft(1.0, 0.5, STIFFNESS, anisotropy=0.2)
    effects = jr.Disc(0.5, MASS), jr.DiscDamping(0.5, DAMPING), unbalance
    scene = jr.Scene(shaft, *effects, spin=jr.ConstantSpeed(15.0))
    force = MASS * 1e-3 * 15.0**2 * np.array([np.cos(0.7), np.sin(0.7)])
    x, y = gain(jr.state_space(scene), 0.0).real @ force
    circle = complex(np.asarray(jr.unbalance_response(scene, 15.0).forward).squeeze())
    assert x + 1j * y == pytest.approx(circle, rel=1e-12)


def test_coordinates_without_mass():
    """A damper and a spring in series with a shaft: `1 / H = 1 / (1/k + 1/(2 K + 2 i w C)) - m w^2`."""
    supports = [jr.Support(at, 300.0, damping=40.0) for at in (0.0, 1.0)]
    shaft = jr.MasslessShaft(1.0, 0.5, STIFFNESS, ends="elastic")
    scene = jr.Scene(shaft, jr.Disc(0.5, MASS), *supports, spin=jr.ConstantSpeed(15.0))
    system = jr.state_space(scene)
    for frequency in FREQUENCIES:
        soft = 1 / STIFFNESS + 1 / (600.0 + 80j * frequency)
        expected = 1 / (1 / soft - MASS * frequency**2)
        np.testing.assert_allclose(np.diag(gain(system, frequency)), expected, rtol=1e-10)


@pytest.mark.slow
def test_refusals():
    stops = jr.load("limiter-rotor")
    with pytest.raises(ValueError, match="contacts or balls"):
        jr.state_space(stops)
    with pytest.raises(ValueError, match="whole number of at least 1, but is 0"):
        jr.state_space(jeffcott(), modes=0)
    with pytest.raises(ValueError, match="on the shaft"):
        jr.state_space(jeffcott(), forces=3.0)
    with pytest.raises(ValueError, match="have merged"):
        jr.state_space(jeffcott(damping=2 * np.sqrt(MASS * STIFFNESS), speed=0.0))
    with pytest.raises(ValueError, match="known for harmonic motions only"):
        jr.state_space(jr.load("gyroscopic-cantilever"))
