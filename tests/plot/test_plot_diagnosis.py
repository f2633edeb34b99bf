"""Plot of a diagnosis: bars of the probabilities, the record and the fits."""

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
def found():
    amplitude = 5e-4 * SPEEDS**2 / (8e5 - 5.0 * SPEEDS**2 + 60j * SPEEDS)
    record = jr.ResponseRecord(amplitude * (1 + 0.01 * np.cos(9 * SPEEDS)), SPEEDS)
    candidates = {
        "unbalance": (None, {"unbalance.eccentricity": (1e-6, 1e-2)}),
        "damping": (None, {"disc_damping.translational": (10.0, 70.0)}),
    }
    return jr.diagnose(record, ROTOR, candidates, draws=4, starts=1, progress=False)


def test_bars_and_fits(found):
    first, second = plot.diagnosis(found)
    names = sorted(found.probabilities, key=lambda name: found.probabilities[name])
    assert [bar.get_width() for bar in first.patches] == [found.probabilities[n] for n in names]
    assert first.get_xlabel() == "probability [1]"
    assert first.get_title(loc="left") == f"cause: {found.cause or 'none of these'}"
    drawn = lines(second)
    for name, one in found.explanations.items():
        z = np.asarray(jr.unbalance_response(one.scene, SPEEDS).forward)[:, 0]
        np.testing.assert_allclose(drawn[name].get_ydata(), 1e3 * np.abs(z), rtol=1e-6)
    assert drawn[names[-1]].get_linewidth() > drawn[names[0]].get_linewidth()
    assert second.get_ylabel() == "amplitude [mm]"


def test_orbit_is_a_path(found):
    z = 1e-3 * np.exp(2j * np.pi * np.arange(12) / 12)
    records, left = (jr.OrbitRecord(z),), (jnp.full((12, 1), 1e-5 + 0j),)
    explanations = {
        name: dataclasses.replace(one, records=records, residuals=left)
        for name, one in found.explanations.items()
    }
    _, second = plot.diagnosis(dataclasses.replace(found, explanations=explanations))
    path = lines(second)["unbalance"].get_xdata()
    np.testing.assert_allclose(path, 1e3 * np.append(z, z[0]).real + 0.01)


def test_refusals(found):
    for wrong in ({"record": 1}, {"channel": 2}):
        (name,) = wrong
        with pytest.raises(ValueError, match=f"`{name}` must be 0 to 0"):
            plot.diagnosis(found, **wrong)
