"""A measured rotor: its influence coefficients, and runs that a model fitted to others predicts.

The numbers of the coefficients are those of least squares by NumPy. The model is fitted by
`notebooks/10_measured_rotor.ipynb`, whose numbers are repeated here.
"""

import sys
from pathlib import Path

import numpy as np
import pytest

import jaxrotor as jr


sys.path.insert(0, str(Path(__file__).parents[2] / "notebooks"))
from measured import rk4  # noqa: E402


UM = 1e-6
EVERY = rk4.runs()
ONE, BOTH = rk4.split(EVERY)
SEEN = [1, 2, 3]  # probes that are fitted
FITTED = dict(
    zip(
        rk4.SOUGHT,
        (86257.0, 416330.0, 1.91925, 3.38052, 0.0365014, 0.487161, 1.38067),
        strict=True,
    )
)
# nm per g mm and lag in degrees of p1x, p1y, p2x, p2y, to masses on disc 1 and 2
PRINTED = {
    (0, 0): ((62, -20), (108, -1), (195, -76), (167, 8)),
    (0, 1): ((55, -23), (92, 1), (224, -74), (194, 10)),
    (1, 0): ((122, -21), (216, 0), (401, -74), (346, 9)),
    (1, 1): ((111, -23), (194, 2), (443, -73), (389, 11)),
}
rms = lambda errors: np.sqrt(np.mean(np.abs(errors) ** 2, axis=(0, 2)))


@pytest.fixture(scope="module")
def influence():
    return jr.fitted_influence(ONE.trials, ONE.readings)


def test_the_split_is_that_of_the_page():
    assert (len(EVERY.condition), len(ONE.condition), len(BOTH.condition)) == (85, 43, 36)
    assert not set(ONE.condition) & set(BOTH.condition)


def test_influence_coefficients_are_those_of_the_description():
    sound = EVERY.of(EVERY.condition != "B047")
    days = np.where(np.isin(sound.condition, rk4.LATE), "late", "first").tolist()
    whole = jr.fitted_influence(sound.trials, sound.readings, offset=days)
    a = np.asarray(whole.coefficients)
    for (n, disc), row in PRINTED.items():
        sizes, lags = np.array(row, float).T
        assert np.all(np.abs(1e3 * np.abs(a[n, :, disc]) - sizes) < 0.6)
        assert np.all(np.abs(np.degrees(-np.angle(a[n, :, disc])) - lags) < 0.6)
    np.testing.assert_allclose(np.linalg.cond(a), [19, 26], atol=0.5)
    said = [whole.predict(t, day) for t, day in zip(sound.trials, days, strict=True)]
    np.testing.assert_allclose(
        rms(np.asarray(said) - sound.readings) / UM, [0.38, 0.65], atol=0.005
    )


@pytest.mark.slow
def test_the_model_predicts_the_runs_that_it_has_not_seen(influence):
    """0.42 and 0.78 um, where the coefficients leave 0.36 and 0.69 um."""
    a = rk4.coefficients(rk4.rig().replace(FITTED))[:, SEEN]
    said = lambda runs: np.einsum("npd,cd->cnp", a, runs.trials)
    constant = np.mean(ONE.readings[:, :, SEEN] - said(ONE), axis=0)
    errors = rms(said(BOTH) + constant - BOTH.readings[:, :, SEEN]) / UM
    assert np.all(errors < [0.45, 0.83])
    others = np.asarray([influence.predict(t) for t in BOTH.trials])
    best = rms((others - BOTH.readings)[:, :, SEEN]) / UM
    np.testing.assert_allclose(best, [0.361, 0.693], atol=0.002)
    assert np.all(errors < 1.25 * best)


def test_circles_of_estimates_contain_most_masses(influence):
    """MAE 1.1 g mm; the circles cover less than 95 %, as masses on both discs leave more."""
    told = [influence.estimate(readings) for readings in BOTH.readings]
    value = np.asarray([one.value for one in told])
    radius = np.asarray([one.radius() for one in told])
    assert np.mean(np.abs(np.abs(value) - np.abs(BOTH.trials))) < 1.3 * UM
    inside = np.abs(value - BOTH.trials) < radius
    assert 0.8 < np.mean(inside) < 0.97
