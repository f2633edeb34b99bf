"""Units: the one door where quantities other than SI are understood.

A number is SI; a text carries its unit: "1500 rpm", "0.7 m", "60 deg", "4.087e6 N/m".
"""

import functools
import math
import re
import reprlib
import typing
from decimal import Decimal
from typing import Any, NoReturn


_HINTS = {"rad/s": " (write rpm or rad/s)", "rad": " (write deg or rad)"}
_NUMBER = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(.*?)\s*", re.ASCII)
_ENDLESS = re.compile(r"\s*[+-]?(nan|inf|infinity)\b.*", re.IGNORECASE)
_HALF = 1500  # characters of a sentence, from either end
_UNIT = re.compile(  # names, one-digit powers, 1 * / ( ): nothing pint could compute on for long
    r"(?:[\s*/·()°%]|1(?!\w)|[^\W\d]\w*+(?:\s*(?:\^|\*\*)\s*-?\d(?!\d))?)*+"
)


class SceneError(ValueError):
    """A scene file that cannot be used; its one sentence names the file, the key and what to do."""

    def __init__(self, sentence: str):
        """What does not print, such as what colours a terminal, is named; what is endless, cut."""
        shown = (c if c.isprintable() else c.encode("unicode_escape").decode() for c in sentence)
        text = "".join(shown)
        super().__init__(f"{text[:_HALF]} .. {text[-_HALF:]}" if len(text) > 2 * _HALF else text)


def quantity(value: Any, unit: str, path: str) -> float:
    """A number in `unit`, from a number or a text with a unit; `path` is for error messages."""
    number = None
    if isinstance(value, str):
        number = _converted(value, unit)
    elif isinstance(value, int | float) and not isinstance(value, bool):
        number = float(value) if abs(value) < 1e308 else math.inf
    wanted = "a number" if unit == "1" else f"in {unit}"
    endless = isinstance(value, str) and _ENDLESS.fullmatch(value) is not None
    if number is None and not endless:
        refuse(path, f"must be {wanted}, but is {show(value)}{_HINTS.get(unit, '')}.")
    if number is None or not math.isfinite(number):
        refuse(path, f"must be {wanted} and finite, but is {show(value)}.")
    return number


def _converted(text: str, unit: str) -> float | None:
    """A text in `unit`, or None; worked out in decimal, so "7.5 mm" is 0.0075 to the last bit."""
    match = _NUMBER.fullmatch(text)
    if match is None or not _UNIT.fullmatch(match[2]):
        return None
    if not match[2]:
        return float(match[1])
    registry = _registry()
    try:
        units = [registry.parse_units(u) for u in (match[2], "" if unit == "1" else unit)]
        # Angle counts as a dimension here, so that a Hz is no rad/s.
        given, wanted = (dict(registry.get_root_units(u)[1]._units).get("radian", 0) for u in units)
        return float(registry.convert(Decimal(match[1]), *units)) if given == wanted else None
    except Exception:  # pint lets errors of tokenize, assert and decimal through
        return None


@functools.cache
def _registry() -> Any:
    import pint  # half a second, so only for a file with units
    from platformdirs import user_cache_path

    build = functools.partial(pint.UnitRegistry, non_int_type=typing.cast(Any, Decimal))
    try:  # what it reads of its definitions is kept, which saves a fifth of a second
        return build(cache_folder=user_cache_path("jaxrotor") / "units")
    except (
        Exception
    ):  # a folder that cannot be written, a file that was cut off: any error of pickle
        return build()


def refuse(path: str, text: str) -> NoReturn:
    """Raise the one sentence on what is at `path`."""
    raise SceneError(f"{path} {text}") from None


def show(value: Any) -> str:
    """A value as it stands in a sentence."""
    try:
        return reprlib.repr(value)
    except ValueError:  # Python prints no whole number of thousands of digits
        return "a huge number"
