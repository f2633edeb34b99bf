"""Doubts: sentences on implausible numbers, with the unit that may be meant."""

import math
from typing import NamedTuple


RPM = math.pi / 30  # [rad/s]

UNITS = {  # units that may be meant in place of the SI unit, with the factor to it
    "m": (("mm", 1e-3), ("um", 1e-6)),
    "kg": (("g", 1e-3),),
    "kg m": (("kg mm", 1e-3), ("g mm", 1e-6)),
    "kg m^2": (("kg cm^2", 1e-4), ("kg mm^2", 1e-6)),
    "rad/s": (("rpm", RPM),),
    "rad": (("deg", math.pi / 180),),
    "N/m": (("N/mm", 1e3), ("N/um", 1e6)),
    "Pa": (("MPa", 1e6), ("GPa", 1e9)),
    "kg/m^3": (("g/cm^3", 1e3), ("g/m^3", 1e-3)),
    "Pa s": (("cP", 1e-3),),
    "m/s^2": (("mm/s^2", 1e-3),),
}


class Known(NamedTuple):
    """A number with its unit; of a table the numbers of largest and of least magnitude."""

    value: float
    unit: str
    least: float


class Doubt(NamedTuple):
    """An implausible number, and the unit that may be meant, with its factor to SI."""

    path: str
    value: float
    unit: str
    why: str
    other: str
    factor: float

    def __str__(self) -> str:
        likely = f"{self.value:g} {self.other} is {self.factor * self.value:.6g} {self.unit}"
        return f"`{self.path}` is {self.value:g} {self.unit}, {self.why}; check its unit: {likely}."


def doubt(path: str, value: float, unit: str, why: str, usual: tuple[float, float]) -> Doubt:
    """A doubt with the first unit that brings the number between bounds, else with the last."""
    other, factor = meant(value, unit, usual) or UNITS[unit][-1]
    return Doubt(path, value, unit, why, other, factor)


def meant(value: float, unit: str, usual: tuple[float, float]) -> tuple[str, float] | None:
    """The first unit in which a number is between bounds, with its factor to SI."""
    fits = ((other, f) for other, f in UNITS[unit] if between(abs(f * value), usual))
    return next(fits, None)


def times(ratio: float) -> str:
    """A ratio in words, "56 times"."""
    return f"{ratio:.0f} times" if 10 <= ratio < 1e6 else f"{ratio:.2g} times"


def between(value: float, bounds: tuple[float, float]) -> bool:
    """Whether a value is not outside bounds."""
    return bounds[0] <= value <= bounds[1]
