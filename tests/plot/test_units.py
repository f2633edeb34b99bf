"""Units of axes: what is drawn in revolutions per minute is what is drawn in radians per second."""

import jax.numpy as jnp
import numpy as np
import pytest
import xarray as xr

import jaxrotor as jr
from jaxrotor import plot
from jaxrotor.plot import labels


pytestmark = pytest.mark.usefixtures("rendered")

FACTORS = {"rpm": 30 / np.pi, "krpm": 0.03 / np.pi, "Hz": 0.5 / np.pi}
SPEEDS = np.linspace(0.0, 30.0, 4)
CRITICAL = jr.CriticalSpeeds(jnp.array([12.0]), jnp.ones(1), jnp.zeros(2), jnp.ones((1, 2)), None)


def campbell():
    values = np.stack(
        [-1.0 + 1j * (10.0 + 0.2 * SPEEDS), -1.0 - 1j * (10.0 - 0.2 * SPEEDS)], axis=1
    )
    result = jr.Campbell(jnp.asarray(SPEEDS), jnp.asarray(values), "fixed", True)
    return plot.campbell(result, critical=CRITICAL, operating=20.0)


def response():
    motion = jnp.full((4, 1), 1e-3 + 0j)
    found = jr.HarmonicResponse(*[jnp.asarray(SPEEDS)] * 2, jnp.zeros(1), motion, 0 * motion, None)
    ends = [np.array([value]) for value in (12.0, 1e-3, 11.0, 14.0)]
    peaks = jr.ResponsePeaks(found, CRITICAL, *ends)
    return plot.response(found, critical=CRITICAL, peaks=peaks, operating=(20.0, 20.0))


def curves(axes):
    """Data of all lines of some Axes."""
    return [np.array(line.get_data(), float) for ax in axes for line in ax.lines]


@pytest.mark.parametrize("unit", FACTORS)
@pytest.mark.parametrize("draw", [campbell, response])
def test_speeds_in_a_chosen_unit(draw, unit):
    plain = draw()
    with plot.units(speed=unit):
        chosen = draw()
    assert len(curves(plain)) == len(curves(chosen)) > 4
    for before, after in zip(curves(plain), curves(chosen), strict=True):
        horizontal = np.ptp(before[0]) == 1 and tuple(before[0]) == (0, 1)  # shares of the axis
        if not horizontal:
            np.testing.assert_allclose(after[0], FACTORS[unit] * before[0], rtol=1e-12)
    for ax in chosen:
        assert ax.get_xlim()[1] == pytest.approx(FACTORS[unit] * 30.0)
    assert chosen[1].get_xlabel() == f"spin speed [{unit}]"
    assert plain[1].get_xlabel() == "spin speed [rad/s]"


def test_whirl_frequencies_and_damping_keep_their_meaning():
    with plot.units(speed="Hz"):
        upper, lower = campbell()
    (forward,) = [line for line in upper.lines if line.get_label() == "forward whirl"]
    found = forward.get_ydata()
    np.testing.assert_allclose(found[np.isfinite(found)], (10 + 0.2 * SPEEDS) / (2 * np.pi))
    assert upper.get_ylabel() == "whirl frequency [Hz]"
    assert lower.get_ylabel() == "growth rate [1/s]" and upper.get_ylim()[1] < 3


def test_a_chosen_length():
    with plot.units(length="um"):
        upper, _ = response()
    assert upper.get_ylabel() == "amplitude [\N{MICRO SIGN}m]"
    np.testing.assert_allclose(upper.lines[0].get_ydata(), 1000.0)


def test_a_sweep_over_speed():
    speeds = xr.DataArray([10.0, 20.0], dims="spin.speed", attrs={"units": "rad/s"})
    points = xr.DataArray(np.ones((2, 3)), dims=("spin.speed", "kept"))
    data = xr.Dataset({"poincare_x": points}, {"spin.speed": speeds})
    with plot.units(speed="krpm"):
        values, label = labels.coordinate(data, "spin.speed")
    np.testing.assert_allclose(values, [0.03 / np.pi * 10, 0.03 / np.pi * 20])
    assert label == "spin speed [krpm]"


@pytest.mark.parametrize("given", [{"speed": "rev/s"}, {"length": "inch"}])
def test_unknown_units(given):
    with pytest.raises(ValueError, match="must be one of"), plot.units(**given):
        pass
