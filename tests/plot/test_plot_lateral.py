"""Plots of a lateral analysis: critical speed map, deflected shapes below clearances, labels of roots."""

import jax.numpy as jnp
import numpy as np
import pytest
from drawn import lines

import jaxrotor as jr
from jaxrotor import plot
from jaxrotor.plot import labels


pytestmark = pytest.mark.usefixtures("rendered")


def case():
    """Half sines of 20 um at a peak and of 5 um at the rated speed, read at a probe in the middle."""
    stations = np.linspace(0.0, 2.0, 5)
    shapes = np.array([20e-6, 5e-6])[:, None] * np.sin(np.pi * stations / 2)
    found = jr.HarmonicResponse(
        *[jnp.array([300.0, 500.0])] * 2,
        jnp.asarray(stations),
        jnp.asarray(shapes + 0j),
        jnp.zeros((2, 5), complex),
        None,
    )
    middle = found.forward[:, 2:3]
    at_probe = jr.HarmonicResponse(
        found.speeds, found.speeds, found.stations[2:3], middle, 0 * middle, None
    )
    none = jnp.zeros(0)
    critical = jr.CriticalSpeeds(none, none, found.stations, jnp.zeros((0, 5)), None)
    peaks = jr.ResponsePeaks(at_probe, critical, *[np.array([300.0])] * 4)
    placed = jr.UnbalanceCase("mid-span", np.nan, (1.0,), (1.0,), (1e-3,))
    return jr.CaseResponse(placed, (peaks,), at_probe, found, 25e-6, 400.0, 600.0, 620.0)


def test_shapes_are_scaled_by_the_limit_over_the_largest_vibration():
    """10 um peak to peak in the running range, of 25 um: 2.5 times 40 um and 10 um, below 225 um."""
    ax = plot.deflected_shapes(case(), clearances=[jr.Clearance(1.0, 3e-4, "labyrinth")])
    drawn = lines(ax)
    np.testing.assert_allclose(drawn["peak, 300 rad/s"].get_ydata().max(), 100.0)
    np.testing.assert_allclose(drawn["rated, 500 rad/s"].get_ydata().max(), 25.0)
    ((bar,),) = [one.get_segments() for one in ax.collections]
    np.testing.assert_allclose(bar, [[1.0, 225.0], [1.0, 300.0]])
    assert [text.get_text() for text in ax.texts] == ["labyrinth"]
    assert ax.get_ylabel().startswith("scaled, peak to peak")


def test_a_clearance_far_beyond_is_named():
    ax = plot.deflected_shapes(case(), clearances=[jr.Clearance(1.0, 3e-3)])
    assert "clearance 3e+03 \N{MICRO SIGN}m, beyond" in lines(ax) and ax.get_ylim()[1] < 200


def test_numbers_of_branches_are_inside_the_frame():
    springs, speeds = (
        np.array([1e6, 1e7, 1e8]),
        np.array([[10.0, 20.0], [20.0, 40.0], [40.0, 90.0]]),
    )
    own = np.array([[2e6, 3e6], [1e7, 2e7]])[:, None]
    chart = jr.CriticalMap(springs, speeds, speeds[-1], np.zeros(1), np.array([1.0, 90.0]), own)
    ax = plot.critical_map(chart)
    ax.figure.canvas.draw()
    assert [text.get_text() for text in ax.texts] == ["1", "2"]
    assert all(text.get_window_extent().x1 < ax.bbox.x1 for text in ax.texts)


def test_fast_roots_are_whole_numbers_of_the_unit_drawn():
    """1267.3 rad/s are 12101.8 rpm."""
    assert labels.root(-2.5 + 1267.3j) == "1267 rad/s, decay 2.5 /s"
    with plot.units(speed="rpm"):
        assert labels.root(-2.5 + 1267.3j) == "12102 rpm, decay 2.5 /s"
