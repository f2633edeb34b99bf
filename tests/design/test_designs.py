"""Worked designs of `notebooks/designs`: against closed forms, scipy, the sheets and ensembles."""

import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq, minimize


sys.path.insert(0, str(Path(__file__).parents[2] / "notebooks"))
from designs import balancing, damping, identification, limiters  # noqa: E402


# === limiters


@pytest.mark.parametrize("number", [3, 4, 6, 8])
def test_restitution_of_a_rub_among_hard_stops(number):
    """At it a point that flies straight from stop to stop, rebounds and rubs, keeps its speed."""
    friction, turn = 0.1, 2 * np.pi / number

    def growth(restitution):
        angle = np.pi / number  # at which it meets a stop
        for _ in range(200):
            normal, along = np.sin(angle), np.cos(angle)
            along += friction * (1 + restitution) * normal
            speed = np.hypot(along, restitution * normal)
            angle = turn - np.arctan2(restitution * normal, along)
        return np.log(speed)

    expected = brentq(growth, 0.3, 0.999)
    assert limiters.restitution(number, friction) == pytest.approx(expected, rel=1e-9)


DESIGNED = {  # as `python notebooks/designs/limiters.py` prints
    "limiters.stiffness": 337_682.0,
    "limiters.damping": 151.7,
    "limiters.gap": 6.6154e-3,
}
FEW = {"eccentricities": 5, "angles": 3, "settle": 200}


@pytest.mark.slow
def test_no_backward_whirl_between_designed_stops():
    before = limiters.summary(limiters.ensemble(limiters.rotor(), **FEW))
    assert before["violent whip"] == 1.0 and before["backward rub"] > 0.3  # sheet, section 3.4
    assert before["largest radius"] == pytest.approx(1e3 * 0.7 * 0.1439, rel=1e-3)
    after = limiters.ensemble(limiters.rotor().replace(DESIGNED), **FEW)
    assert limiters.summary(after)["all"] == 0.0 and after["winding"].size == 45
    assert limiters.summary(after)["largest radius"] < 1e3 * limiters.PEAK


# === damping


def series(whirl, disc, bearing):
    """Dynamic stiffness that the shaft must have for a whirl on the boundary."""
    carried = 10.0 * whirl**2 - 1j * disc * whirl
    bearings = 2e5 + 2j * bearing * whirl
    return carried * bearings / (bearings - carried)


def onset_by_hand(disc, bearing):
    off = lambda whirl: series(whirl, disc, bearing).real - 1e5
    whirl = brentq(off, 75.0, 95.0, xtol=1e-13)
    return whirl - series(whirl, disc, bearing).imag / 160.0


@pytest.mark.slow
def test_cheapest_dampers_against_scipy():
    constraint = {"type": "ineq", "fun": lambda x: (onset_by_hand(*x) - 300.0) / 100}
    price = lambda x: (10 * x[0] + 2 * x[1]) / 1000
    expected = minimize(
        price, [100.0, 300.0], constraints=[constraint], method="SLSQP", options={"ftol": 1e-14}
    )
    tuned = damping.dampers(quick=True)
    values = [float(np.ravel(value)[0]) for value in tuned.values.values()]
    assert float(tuned.loss) == pytest.approx(expected.fun, rel=1e-5)
    assert values == pytest.approx(expected.x, rel=5e-3)
    assert onset_by_hand(*values) == pytest.approx(300.0, abs=1e-2)
    # price of another 100 rad/s, from the closed form
    more = constraint | {"fun": lambda x: (onset_by_hand(*x) - 301.0) / 100}
    dearer = minimize(
        price, expected.x, constraints=[more], method="SLSQP", options={"ftol": 1e-14}
    )
    slope = 100 * (dearer.fun - expected.fun)
    assert float(tuned.multipliers["onset"]) == pytest.approx(slope, rel=1e-2)


@pytest.mark.slow
def test_medium_of_the_limiter_rotor():
    """Table 3.2: at eta_e = 0.025, which is 7.778381808870701 N s/m^2, the onset is N = 13.9041252."""
    tuned = damping.medium(13.9041251, quick=True)
    found = float(tuned.values["external_damping.per_length"])
    assert found == pytest.approx(7.778381808870701, rel=1e-6)


# === balancing, identification


@pytest.mark.slow
def test_balanced_through_a_rub():
    """Corrections are judged by the linear rotor, which the fit has never seen."""
    solution = balancing.solve(quick=True)
    wrong, right = (balancing.left(c) for c in solution.corrections.values())
    assert right < 1e-6 < 1e-5 < wrong < balancing.GAP < balancing.left(np.zeros(2))
    share = solution.corrections["by gradient"] / balancing.HIDDEN
    np.testing.assert_allclose(share, -1, atol=0.05)
    residuals = 2 * balancing.STEPS * 2
    assert abs(float(solution.tuned.loss) - residuals) < 3 * np.sqrt(2 * residuals)


@pytest.mark.slow
def test_limiter_is_identified_within_its_covariance():
    """Chi-square of 3 degrees of freedom below its 99 %; that of 8 records within its 1 and 99 %."""
    recorded = identification.records(8)
    tuned, known = identification.identify(recorded[0])
    samples = 2 * recorded[0].size
    assert abs(float(tuned.loss) - samples) < 3 * np.sqrt(2 * samples)
    assert float(known.distance(identification.TRUTH)) < 11.345
    every = identification.distances(known, identification.scatter(recorded))
    assert every[0] == pytest.approx(float(known.distance(identification.TRUTH)), rel=1e-3)
    assert 10.856 < every.sum() < 42.980
