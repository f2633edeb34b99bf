"""Worked designs of `notebooks/designs`: against closed forms, scipy, the sheets and ensembles.

Notebook 06 computes most of them, and is run once for all tests that look at its numbers.
"""

import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from executed import NOTEBOOKS, OPTIMISED, check_found, check_runs, executed, found
from scipy.optimize import brentq, minimize


sys.path.insert(0, str(Path(__file__).parents[2] / "notebooks"))
from designs import balancing, damping, identification, limiters  # noqa: E402


# Numbers of the notebook and their tolerances; others are below, each with its reference.
FOUND = {
    "nu0 at alpha 1 from -0.9": (-0.362049935181, 1e-9),
    "nu0 at alpha 1 from 0.5": (-0.362049935181, 1e-9),
    "whips that stay, before": (1.0, 1e-12),
    "largest radius before [mm]": (0.1439 * 700, 0.1),
    "backward after": (0.0, 1e-12),
    "cost of the dampers": (1.7711834, 2e-5),
    "onset speed [rad/s]": (300.0, 1e-3),
    "left by gradient [um]": (0.0, 1.0),
    "distance from the truth": (0.0, 11.345),
    "gap [mm]": (7.5, 0.03),
    "friction": (0.1, 1.4e-3),
}


@pytest.fixture(scope="module")
def cells(tmp_path_factory):
    """Code cells of the notebook after its run."""
    (path,) = [path for path in NOTEBOOKS if path.stem == "06_design"]
    return executed([path], tmp_path_factory.mktemp(path.stem), OPTIMISED)[0]


@pytest.fixture(scope="module")
def numbers(cells):
    """What the notebook has found."""
    return found(cells)


@pytest.mark.long
def test_notebook_runs_and_finds_its_numbers(cells):
    check_runs(cells)
    check_found(cells, FOUND)


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
FEW = {"eccentricities": 3, "angles": 3, "settle": 200}


@pytest.mark.long
def test_backward_rub_between_published_stops(numbers):
    """Sheet, section 3.4; the violent whip is above."""
    assert numbers["rubs that stay, before"] > 0.3


@pytest.mark.long
def test_no_backward_whirl_between_designed_stops():
    after = limiters.ensemble(limiters.rotor().replace(DESIGNED), **FEW)
    assert limiters.summary(after)["all"] == 0.0 and after["winding"].size == 27
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


@pytest.mark.long
def test_cheapest_dampers_against_scipy(numbers):
    constraint = {"type": "ineq", "fun": lambda x: (onset_by_hand(*x) - 300.0) / 100}
    price = lambda x: (10 * x[0] + 2 * x[1]) / 1000
    expected = minimize(
        price, [100.0, 300.0], constraints=[constraint], method="SLSQP", options={"ftol": 1e-14}
    )
    values = [numbers["damper at the disc"], numbers["dampers in bearings"]]
    assert numbers["cost of the dampers"] == pytest.approx(expected.fun, rel=1e-5)
    assert values == pytest.approx(expected.x, rel=5e-3)
    assert onset_by_hand(*values) == pytest.approx(300.0, abs=1e-2)
    # price of another 100 rad/s, from the closed form
    more = constraint | {"fun": lambda x: (onset_by_hand(*x) - 301.0) / 100}
    dearer = minimize(
        price, expected.x, constraints=[more], method="SLSQP", options={"ftol": 1e-14}
    )
    slope = 100 * (dearer.fun - expected.fun)
    assert numbers["price of 100 rad/s"] == pytest.approx(slope, rel=1e-2)


@pytest.mark.long
def test_medium_of_the_limiter_rotor():
    """Table 3.2: at eta_e = 0.025, which is 7.778381808870701 N s/m^2, the onset is N = 13.9041252."""
    tuned = damping.medium(13.9041251, quick=True)
    found = float(tuned.values["external_damping.per_length"])
    assert found == pytest.approx(7.778381808870701, rel=1e-6)


# === balancing, identification


@pytest.mark.long
def test_balanced_through_a_rub(numbers):
    """Corrections are judged by the linear rotor, which the fit has never seen."""
    names = ("gradient", "influence", "nothing")
    right, wrong, none = (1e-6 * numbers[f"left by {name} [um]"] for name in names)
    assert right < 1e-6 < 1e-5 < wrong < balancing.GAP < none
    assert numbers["largest share left"] < 0.05
    residuals = 2 * balancing.STEPS * 2
    assert abs(numbers["misfit of the rub"] - residuals) < 3 * np.sqrt(2 * residuals)


def test_fits_that_fail_are_left_out_and_counted(monkeypatch, capsys):
    """A fit that ends on a bound does not end the study; a fit that is asked for wrongly does."""
    true = list(identification.TRUTH.values())

    def fit(scene, record, where, progress):
        del scene, progress
        size = float(record.displacement[0, 0].real)
        if size > 1.0:
            raise (RuntimeError if size < 3.0 else ValueError)(f"of {size}")
        return SimpleNamespace(values=dict(zip(where, [x + size for x in true], strict=True)))

    monkeypatch.setattr(identification.jr, "fit", fit)
    of = lambda *sizes: np.array(sizes)[:, None] * np.ones(1281, complex)
    found = identification.scatter(of(0.5, 2.0, 1.0))
    np.testing.assert_allclose(found, [[x + 0.5 for x in true], [x + 1.0 for x in true]])
    assert capsys.readouterr().out == "1 of 3 fits ended on a bound or found no minimum.\n"
    assert identification.scatter(of(2.0)).shape == (0, 3)
    with pytest.raises(ValueError, match="of 4"):
        identification.scatter(of(4.0))


@pytest.mark.long
def test_limiter_is_identified_within_its_covariance(numbers):
    """Chi-square of 3 degrees of freedom below its 99 %; that of 2 records within its 1 and 99 %."""
    samples = 2 * (identification.REVOLUTIONS * identification.STEPS // identification.EVERY + 1)
    assert abs(numbers["misfit of the record"] - samples) < 3 * np.sqrt(2 * samples)
    own, again = (numbers[f"distance from the truth{more}"] for more in ("", ", fitted again"))
    assert own < 11.345 and again == pytest.approx(own, rel=1e-3)
    assert 0.872 < numbers["distances of all records"] < 16.812
