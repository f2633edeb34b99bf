"""Campbell diagrams follow every branch through crossings and bands of real roots."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxrotor as jr


def unequal(delta=0.02, ratio=0.1):
    """A rotor of unit mass and mean stiffness; its speeds are p of sheet 2."""
    shaft = jr.MasslessShaft(0.6, 0.3, 1.0, anisotropy=ratio)
    on_it = jr.Disc(0.3, 1.0), jr.DiscDamping(0.3, delta)
    return jr.Scene(shaft, *on_it, spin=jr.ConstantSpeed(1.0))


def quartic(p, delta=0.02, ratio=0.1):
    """Roots of scheme 1 of the sheet, section 1.6, without internal friction."""
    last = (1 - p**2) ** 2 - ratio**2 + (delta * p) ** 2
    middle = 2 * delta * (1 - p**2) + 4 * p**2 * delta
    return np.roots([1, 2 * delta, delta**2 + 2 * (1 + p**2), middle, last])


@pytest.mark.parametrize("speeds", [(0.8, 1.2, 3), (0.8, 1.2, 15), (0.8, 1.2, 60), (0.96, 1.04, 9)])
def test_a_pair_that_parts_keeps_both_of_its_roots(speeds):
    """Between the critical speeds one of two real roots is unstable; a branch must show it."""
    speeds = np.linspace(*speeds)
    found = jr.campbell(unequal(), speeds, count=4)
    assert not found.circular and found.frame == "rotating"
    for p, growth in zip(speeds, np.asarray(found.growth), strict=True):
        assert growth.max() == pytest.approx(quartic(p).real.max(), rel=1e-9, abs=1e-12)


def test_pairs_that_stay_conjugate_are_drawn_once():
    found = jr.campbell(unequal(), np.linspace(1.2, 2.0, 5))
    assert found.values.shape == (5, 2)
    for p, values in zip(np.linspace(1.2, 2.0, 5), np.asarray(found.values), strict=True):
        expected = quartic(p)
        np.testing.assert_allclose(
            np.sort(values.imag), np.sort(expected.imag[expected.imag > 0]), rtol=1e-9
        )


@pytest.mark.slow
@pytest.mark.parametrize("discs", [(), (jr.Disc(0.4, 3.0, 0.01, 0.018),)])
def test_a_free_shaft_has_no_critical_speed_of_zero(discs):
    """The frequency of its rigid motions is zero, computed as 4e-6 rad/s by rounding."""
    shaft = jr.FlexibleShaft(1.0, 0.03, constraints=())
    found = jr.critical_speeds(jr.Scene(shaft, *discs, spin=jr.ConstantSpeed(0.0)), 2)
    if not discs:  # cosh b cos b = 1, with rotary inertia a little less
        euler = 4.730040744862704**2 * np.sqrt(2.1e11 * 0.03**2 / (16 * 7850.0))
        assert 0.99 * euler < found.forward[0] < euler * 1.02
        assert 0.97 * euler < found.backward[0] < euler
    assert min(found.forward[0], found.backward[0]) > 100.0


@pytest.mark.slow
def test_branches_cross():
    """Forward whirl of a slow mode and backward whirl of a fast one stay on their branches."""
    rotor = jr.load("two-discs")
    speeds = np.linspace(0.0, 900.0, 31)
    found = jr.campbell(rotor, speeds, count=6)
    assert found.circular
    values = np.asarray(found.values)
    for k in (0, 15, 30):  # at every speed they are the roots
        exact = np.asarray(jr.roots(rotor.replace({"spin.speed": speeds[k]})))
        off = np.abs(values[k][:, None] - exact).min(axis=1)
        assert off.max() < 1e-9 * np.abs(values[k]).max()
    # Whirl keeps its direction, and no branch jumps.
    assert (np.sign(values.imag) == np.sign(values[0].imag)).all()
    second = np.diff(values.imag, 2, axis=0)
    assert np.abs(second).max() < 0.02 * np.abs(values.imag).max()


def tilting(coupling):
    """Disc of unit mass and inertias: `w^2 = 1` in translation, `w^2 - Omega w = 1.44` in tilt."""
    shaft = jr.MasslessShaft(1.0, 0.5, 1.0, coupling, 1.44)
    return jr.Scene(shaft, jr.Disc(0.5, 1.0, 1.0, 1.0), spin=jr.ConstantSpeed(0.0))


def tilt(speed, sense):
    """Whirl frequency of the tilt alone."""
    return speed / 2 + sense * np.sqrt(speed**2 / 4 + 1.44)


@pytest.mark.parametrize("speeds", [(0.0, 1.5, n) for n in (2, 3, 8, 61)] + [(0.0, 0.88, 3)])
def test_like_modes_cross_where_they_are_not_coupled(speeds):
    """Both modes whirl backward; the tilt crosses the translation at 0.44, whatever the grid of speeds."""
    speeds = np.linspace(*speeds)
    points = len(speeds)
    found = np.asarray(jr.campbell(tilting(0.0), speeds, 4).values).imag
    expected = [np.ones(points), -np.ones(points), tilt(speeds, 1), tilt(speeds, -1)]
    for branch in expected:
        (one,) = np.flatnonzero(np.abs(found[0] - branch[0]) < 1e-9)
        np.testing.assert_allclose(found[:, one], branch, atol=1e-9)


def test_there_may_be_fewer_branches_than_asked_for():
    assert jr.campbell(tilting(0.0), [0.0, 1.0], 50).values.shape == (2, 4)


def backward(speeds, coupling):
    """The two backward whirls by numpy; as they do not cross, they are sorted by magnitude."""
    found = []
    for speed in speeds:
        # (1 - w^2)(1.44 + W w - w^2) = coupling^2
        polynomial = np.polymul([-1.0, 0.0, 1.0], [-1.0, speed, 1.44])
        polynomial[-1] -= coupling**2
        found.append(np.sort(np.roots(polynomial).real)[:2])
    return np.array(found)


@pytest.mark.parametrize("coupling", [0.02, 0.002])
@pytest.mark.parametrize("points", [2, 4, 8, 301])
def test_like_modes_part_where_they_are_coupled(points, coupling):
    """With coupling the same two modes veer, so the slower branch stays the slower."""
    speeds = np.linspace(0.0, 1.5, points)
    found = np.asarray(jr.campbell(tilting(coupling), speeds, 4).values).imag
    for branch in backward(speeds, coupling).T:
        (one,) = np.flatnonzero(np.abs(found[0] - branch[0]) < 1e-9)
        np.testing.assert_allclose(found[:, one], branch, atol=1e-9)


def test_campbell_says_that_it_cannot_be_traced():
    scene = tilting(0.0)
    at = lambda mass: jr.campbell(scene.put({"disc.mass": mass}), [0.0, 1.0], 2).values
    sentence = r"cannot run inside jax.jit, .* or use `roots`\."
    with pytest.raises(ValueError, match=sentence):
        jax.jit(at)(1.0)
    with pytest.raises(ValueError, match=sentence):
        jax.vmap(at)(jnp.ones(2))


@pytest.mark.parametrize("points", [5, 12])
def test_branches_keep_their_direction(points):
    """In round rotors without overdamped modes forward whirl stays forward at every speed."""
    branches = jr.campbell(jr.load("two-discs"), np.linspace(0.0, 400.0, points), count=8).values
    sides = np.sign(np.imag(np.asarray(branches)))
    assert (sides[1:] == sides[1]).all()
    assert sorted(sides[1]) == [-1.0] * 4 + [1.0] * 4


def test_senses_between_unequal_cross_coupled_supports():
    """Forward less backward share of the translation of a disc, from its two equations of motion."""
    stiffness, damping = np.array([[1e5, 4e3], [-6e3, 1.1e5]]), np.diag([60.0, 20.0])
    names = ("kxx", "kxy", "kyx", "kyy")
    coefficients = dict(zip(names, stiffness.ravel() / 2, strict=True))
    supports = [jr.Support(at, **coefficients, cxx=30.0, cyy=10.0) for at in (0.0, 0.6)]
    disc = jr.Disc(0.3, 10.0, 0.1, 0.1)  # its tilt is two to three times as fast
    scene = jr.Scene(jr.RigidShaft(0.6), disc, *supports, spin=jr.ConstantSpeed(0.0))
    matrix = np.block([[np.zeros((2, 2)), np.eye(2)], [-stiffness / 10, -damping / 10]])
    values, vectors = np.linalg.eig(matrix)
    order = [k for k in np.argsort(np.abs(values)) if values[k].imag > 0]
    x, y = vectors[:2, order]
    ahead, behind = np.abs(x + 1j * y) ** 2, np.abs(x - 1j * y) ** 2
    expected = (ahead - behind) / (ahead + behind)
    found = jr.campbell(scene, [0.0, 40.0, 80.0], count=2)
    np.testing.assert_allclose(found.values, np.tile(values[order], (3, 1)), rtol=1e-9)
    np.testing.assert_allclose(found.senses, np.tile(expected, (3, 1)), atol=1e-9)
    assert np.asarray(found.forward).tolist() == [np.sign(expected).tolist()] * 3
    assert set(np.sign(expected)) == {1.0, -1.0}


@pytest.mark.slow
def test_senses_are_those_of_modes():
    rotor = jr.load("two-discs-unequal")
    found = jr.campbell(rotor, [10.0, 200.0], count=4)
    for speed, values, senses in zip(found.speeds, found.values, found.senses, strict=True):
        modes = jr.modes(rotor.replace({"spin.speed": speed}), 8)
        there = [int(np.argmin(np.abs(np.asarray(modes.values) - value))) for value in values]
        np.testing.assert_allclose(np.asarray(modes.forward)[there], senses, atol=1e-6)
