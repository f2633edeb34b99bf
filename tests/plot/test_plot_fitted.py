"""Plot of a fit: the record, the prediction and the residuals with the noise."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest
from drawn import lines

import jaxrotor as jr
from jaxrotor import plot


pytestmark = pytest.mark.usefixtures("rendered")

ROTOR = jr.Scene(
    jr.MasslessShaft(1.0, 0.5, 8e5),
    jr.Disc(0.5, 5.0),
    jr.DiscDamping(0.5, 60.0),
    jr.Unbalance(0.5, 5.0, eccentricity=1e-4),
    spin=jr.ConstantSpeed(300.0),
)
SPEEDS = np.linspace(350.0, 450.0, 12)


@pytest.fixture(scope="module")
def fitted():
    stiff = 8e5 - 5.0 * SPEEDS**2 + 60j * SPEEDS
    amplitude = 5e-4 * SPEEDS**2 / stiff * (1 + 0.1j * np.cos(SPEEDS))
    record = jr.ResponseRecord(amplitude, SPEEDS)
    return jr.fit(ROTOR, record, {"unbalance.eccentricity": (1e-6, 1e-2)}, progress=False)


def test_a_response_and_what_is_left(fitted):
    """The line is the response of the fitted scene; residuals are prediction less measurement."""
    upper, lower = plot.fitted(fitted)
    drawn, left = lines(upper), lines(lower)
    measured = np.asarray(fitted.records[0].amplitude)[:, 0]
    found = np.asarray(jr.unbalance_response(fitted.scene, SPEEDS).forward)[:, 0]
    np.testing.assert_allclose(drawn["measured"].get_ydata(), 1e3 * np.abs(measured))
    np.testing.assert_allclose(drawn["fitted"].get_ydata(), 1e3 * np.abs(found), rtol=1e-4)
    off = 1e3 * (found - measured)
    np.testing.assert_allclose(left["real part"].get_ydata(), off.real, atol=1e-6)
    np.testing.assert_allclose(left["imaginary part"].get_ydata(), off.imag, atol=1e-6)
    (band,) = lower.patches
    assert band.get_height() == pytest.approx(4e3 * float(fitted.noise[0]))
    assert upper.get_ylabel() == "amplitude [mm]" and lower.get_ylabel() == "residual [mm]"
    assert lower.get_xlabel() == "speed [rad/s]"
    with plot.units(speed="rpm"):
        _, lower = plot.fitted(fitted)
    assert lines(lower)["real part"].get_xdata()[0] == pytest.approx(350 * 30 / np.pi)


def test_an_orbit_and_a_motion_of_probes(fitted):
    """An orbit is drawn in its plane, closed; a real record has one line."""
    z = 1e-3 * np.exp(2j * np.pi * np.arange(12) / 12)
    left = jnp.asarray(np.full((12, 1), 1e-5 + 2e-5j))
    orbit = dataclasses.replace(fitted, records=(jr.OrbitRecord(z),), residuals=(left,))
    path, rest = plot.fitted(orbit)
    drawn = lines(path)
    np.testing.assert_allclose(drawn["fitted"].get_xdata(), 1e3 * np.append(z, z[0]).real + 0.01)
    np.testing.assert_allclose(drawn["measured"].get_ydata(), 1e3 * z.imag)
    np.testing.assert_allclose(lines(rest)["y"].get_ydata(), 20.0)
    assert rest.get_ylabel() == "residual [\N{MICRO SIGN}m]"
    probes = jr.TimeRecord(np.stack([z.real, z.imag], 1), times=np.arange(12.0), angle=[0, 1])
    off = jnp.zeros((12, 2)).at[:, 1].set(1e-5)
    timed = dataclasses.replace(fitted, records=(probes,), residuals=(off,))
    upper, lower = plot.fitted(timed, channel=1)
    np.testing.assert_allclose(lines(upper)["fitted"].get_ydata(), 1e3 * z.imag + 0.01)
    assert upper.get_ylabel() == "displacement [mm]" and lower.get_xlabel() == "time [s]"
    whole = dataclasses.replace(
        fitted, records=(jr.TimeRecord(z, times=np.arange(12.0)),), residuals=(left,)
    )
    upper, _ = plot.fitted(whole)
    assert list(lines(upper)) == ["x fitted", "x measured", "y fitted", "y measured"]


def test_refusals(fitted):
    with pytest.raises(ValueError, match="`record` must be 0 to 0, but is 1"):
        plot.fitted(fitted, record=1)
    with pytest.raises(ValueError, match="`channel` must be 0 to 0, but is 2"):
        plot.fitted(fitted, channel=2)
