"""Campbell diagrams keep every branch: through crossings and bands where a pair parts."""

import numpy as np
import pytest

import jaxrotor as jr


def unequal(delta=0.02, ratio=0.1):
    """Unit mass and mean stiffness; speeds are p of sheet 2."""
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
    """Between the critical speeds one of two real roots grows: no branch may hide it."""
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


@pytest.mark.parametrize("discs", [(), (jr.Disc(0.4, 3.0, 0.01, 0.018),)])
def test_a_free_shaft_has_no_critical_speed_of_zero(discs):
    """Its rigid motions have the frequency zero, which rounding makes 4e-6 rad/s."""
    shaft = jr.FlexibleShaft(1.0, 0.03, constraints=())
    found = jr.critical_speeds(jr.Scene(shaft, *discs, spin=jr.ConstantSpeed(0.0)), 2)
    if not discs:  # cosh b cos b = 1, with rotary inertia a little less
        euler = 4.730040744862704**2 * np.sqrt(2.1e11 * 0.03**2 / (16 * 7850.0))
        assert 0.99 * euler < found.forward[0] < euler * 1.02
        assert 0.97 * euler < found.backward[0] < euler
    assert min(found.forward[0], found.backward[0]) > 100.0


def test_branches_cross():
    """Forward whirl of a slow mode and backward whirl of a fast one keep their names."""
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
