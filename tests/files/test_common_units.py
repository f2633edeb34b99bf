"""Common units convert as pint converts them, to the last bit, and without pint."""

import itertools

import pytest

from jaxrotor.files import common_units, units
from jaxrotor.files.common_units import factor


WANTED = ["m", "rad/s", "rad", "s", "N/m", "N s/m", "kg", "1/s", "kg m^2", "N m", "Pa", "m/s^2"]
WANTED += ["kg/s", "kg/m^3", "N/m^3", "N s/m^2", "N m/rad", "N m s^2", "N m s/rad", "N"]
GIVEN = [
    *common_units._KNOWN,
    *WANTED,
    "MN/m",
    "g*mm",
    "g mm^2",
    "kN s/m",
    "N/mm",
    "1/min",
    "N m s",
]
GIVEN += ["g/cm^3", "kN mm/deg", "m**2", "s^-1", "rad s^-1", "mm / s", "g * mm", "mm/s^2"]


@pytest.mark.parametrize("number", ["7.5", "0.1", "-1e-3", "3000", "0.7182818284590452"])
def test_numbers_are_those_of_pint(number, monkeypatch):
    pairs = list(itertools.product(GIVEN, WANTED))
    ours = [units._converted(f"{number} {given}", wanted) for given, wanted in pairs]
    known = [factor(given, wanted) is not None for given, wanted in pairs]
    monkeypatch.setattr(units, "factor", lambda given, wanted: None)
    for (given, wanted), found, common in zip(pairs, ours, known, strict=True):
        assert found == units._converted(f"{number} {given}", wanted), (given, wanted)
        assert common or found is None or given in ("s^-1", "Hz"), (given, wanted)


def test_common_units_do_not_load_pint(monkeypatch):
    monkeypatch.setattr(units, "_registry", None)
    assert units.quantity("7.5 mm", "m", "gap") == 0.0075
    assert units.quantity("60 rpm", "rad/s", "speed") == 6.283185307179586


@pytest.mark.parametrize(
    "text", ["", "furlong", "m^", "m^0", "m^12", "kg/m/s", "N m/s rad", "m//s", "1", "%"]
)
def test_other_texts_are_left_to_pint(text):
    assert factor(text, "m") is None and factor("m", text) is None
