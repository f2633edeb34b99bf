"""Plot of the envelope of runs along times."""

import numpy as np
import pytest
import xarray as xr
from drawn import check_axes

import jaxrotor as jr
from jaxrotor import plot


pytestmark = pytest.mark.usefixtures("rendered")

ECCENTRICITY = "unbalance.eccentricity"


def runs(speeds, values=(1e-4, 2e-4, 4e-4)):
    rotor = jr.Scene(
        jr.MasslessShaft(0.7, 0.35, 2e5),
        jr.Disc(0.35, 2.0),
        jr.DiscDamping(0.35, 60.0),
        jr.Unbalance(0.35, 2.0, 1e-4),
        spin=jr.SpeedProfile([0.0, 0.15, 0.3], speeds),
    )
    over, times = {ECCENTRICITY: values}, np.linspace(0, 0.3, 257)
    return jr.sweep(rotor, over, times=times, observe=[jr.observe.Envelope()])


def edges(mesh):
    """Ends of the drawn cells, across and up."""
    corners = mesh.get_coordinates()
    return corners[0, :, 0], corners[:, 0, 1]


@pytest.fixture(scope="module")
def rising():
    return runs([100.0, 300.0, 350.0])


def test_over_the_speed_where_it_rises(rising):
    ax = plot.envelope(rising)
    check_axes(lambda ax: plot.envelope(rising, ax))
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("speed [rad/s]", "unbalance eccentricity [mm]")
    (mesh,) = ax.collections
    assert np.allclose(mesh.get_array().ravel(), 1e3 * rising.envelope.values.ravel())
    assert ax.figure.axes[1].get_ylabel() == "largest radius [mm]"
    across, values = edges(mesh)
    expected = np.interp(
        np.linspace(0.0, 0.3, across.size), [0.0, 0.15, 0.3], [100.0, 300.0, 350.0]
    )
    assert np.allclose(across, expected, rtol=1e-12)
    assert np.allclose(values, [0.05, 0.15, 0.3, 0.5], rtol=1e-12)


def test_over_time_where_the_speed_turns_round():
    ax = plot.envelope(runs([100.0, 300.0, 100.0]))
    assert ax.get_xlabel() == "time [s]"
    (mesh,) = ax.collections
    across, _ = edges(mesh)
    assert np.allclose(across, np.linspace(0.0, 0.3, across.size), rtol=1e-12, atol=1e-15)


def test_the_first_window_begins_no_earlier_than_rest(rising):
    """A speed as of a drive that builds up its torque: the second window gains more than the first."""
    speed = np.cumsum(np.arange(1.0, rising.window.size + 1))
    ax = plot.envelope(
        rising.assign(speed=rising["speed"] * 0 + xr.DataArray(speed, dims="window"))
    )
    (mesh,) = ax.collections
    assert np.allclose(edges(mesh)[0], [0.0, *speed], rtol=1e-12)


@pytest.mark.parametrize("end", [0.0, 1e-14, -1e-14])  # [rad/s], zero within rounding
def test_the_first_window_may_end_at_rest(rising, end):
    """A speed from -30 rad/s on, which passes zero between the first window and the second."""
    speed = 30.0 * np.arange(rising.window.size)
    speed[0] = end
    ax = plot.envelope(
        rising.assign(speed=rising["speed"] * 0 + xr.DataArray(speed, dims="window"))
    )
    (mesh,) = ax.collections
    assert np.allclose(edges(mesh)[0], [-30.0, *speed], rtol=1e-12, atol=1e-12)


def test_too_little_to_draw(rising):
    with pytest.raises(ValueError, match="needs two lanes and two windows"):
        plot.envelope(rising.isel({ECCENTRICITY: [0]}))
    with pytest.raises(ValueError, match="has no `envelope`"):
        plot.envelope(rising.drop_vars("envelope"))
