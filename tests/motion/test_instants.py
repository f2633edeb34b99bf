"""Accelerations of a motion without steps, which are computed where they are asked for."""

import numpy as np
import pytest

import jaxrotor as jr


@pytest.mark.slow
@pytest.mark.parametrize("name", ["two-discs", "two-discs-unequal"])
def test_accelerations_are_the_slopes_of_the_velocities(name):
    """From an angle of its own, at uneven and at even times, by differences of fourth order."""
    scene = jr.load(name).replace({"shaft.nodes": 2}).at_speed(40.0)
    start = jr.Launch(jr.Whirl(1e-3), angle=0.7)
    step = 2e-7
    times = (np.array([0.0, 0.013, 0.1])[:, None] + 0.01 + step * np.arange(-2, 3)).ravel()
    history = jr.run_up(scene, times, start=start, progress=False)
    even = jr.run_up(scene, np.linspace(0.01, 0.11, 11), start=start, progress=False)
    now = history.instants
    rates = np.asarray(history.rates).reshape(3, 5, -1)
    slope = (rates[:, 0] - 8 * rates[:, 1] + 8 * rates[:, 3] - rates[:, 4]) / (12 * step)
    middle = slice(2, None, 5)
    absolute = np.asarray(now.absolute * np.exp(1j * now.turning.angle)[:, None])[middle]
    np.testing.assert_allclose(absolute, slope, atol=1e-6 * np.abs(slope).max())
    atol = 1e-9 * np.abs(rates).max()
    np.testing.assert_allclose(np.asarray(even.rates)[[0, -1]], rates[[0, -1], 2], atol=atol)
