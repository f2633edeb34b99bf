"""Units: those of speeds, frequencies and lengths on axes, chosen in one place."""

import contextlib
from collections.abc import Iterator
from contextvars import ContextVar

import numpy as np

from ..core.tables import RPM


SPEEDS = {"rad/s": 1.0, "rpm": RPM, "krpm": 1e-3 * RPM, "Hz": 1 / (2 * np.pi)}
SMALL = 0.01  # of the shaft's length: gaps and eccentricities are smaller, stations are not
LENGTHS = {"m": 1.0, "mm": 1e3, "\N{MICRO SIGN}m": 1e6}
_SPELT = {"um": "\N{MICRO SIGN}m"}

_speed: ContextVar[str] = ContextVar("speed", default="rad/s")
_length: ContextVar[str | None] = ContextVar("length", default=None)


@contextlib.contextmanager
def units(*, speed: str = "rad/s", length: str | None = None) -> Iterator[None]:
    """Draw speeds of rotation, whirl frequencies and lengths in chosen units within a `with` block.

        with plot.units(speed="rpm"):
            plot.campbell(result)

    Arguments of plot functions stay in SI units, and texts beside modes name rad/s.

    Args:
        speed: "rad/s", "rpm", "krpm" or "Hz".
        length: "m", "mm" or "um"; by default mm, and micrometres for small amplitudes.

    Returns:
        A context manager, which gives nothing.

    Raises:
        ValueError: a unit is another one.
    """
    length = _SPELT.get(length, length) if length is not None else None
    for name, unit, known in (("speed", speed, SPEEDS), ("length", length, LENGTHS)):
        if unit is not None and unit not in known:
            raise ValueError(f"`{name}` must be one of {', '.join(known)}, but is {unit!r}.")
    tokens = _speed.set(speed), _length.set(length)
    try:
        yield
    finally:
        _speed.reset(tokens[0])
        _length.reset(tokens[1])


def speed_unit() -> tuple[float, str]:
    """Factor from rad/s to the unit drawn, and that unit."""
    return SPEEDS[_speed.get()], _speed.get()


def length_unit(own: str) -> tuple[float, str]:
    """Factor from m to the unit drawn, and that unit: `own` unless another is chosen."""
    unit = _length.get() or own
    return LENGTHS[unit], unit


def unit_of_text(unit: str, largest: float, span: float) -> tuple[float, str]:
    """Factor from SI to the unit in which numbers of a table are written, and that unit.

    Speeds are in the unit chosen. So are lengths if one is chosen and the `largest` number [m] is below a
    hundredth of the shaft's length, `span` [m]; others stay in SI.
    """
    if unit == "rad/s":
        return speed_unit()
    small = unit == "m" and largest <= SMALL * span
    return length_unit("m") if small else (1.0, unit)
