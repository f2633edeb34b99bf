"""Units: conversion of texts with units to numbers in SI units.

A number is in SI units; a text carries its unit: "1500 rpm", "0.7 m", "60 deg", "4.087e6 N/m".
"""

import contextlib
import functools
import importlib.metadata
import json
import math
import os
import re
import reprlib
import secrets
import typing
from decimal import Decimal
from pathlib import Path
from typing import Any, NoReturn

from platformdirs import user_cache_path


_HINTS = {"rad/s": " (write rpm or rad/s)", "rad": " (write deg or rad)"}
_NUMBER = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(.*?)\s*", re.ASCII)
_ENDLESS = re.compile(r"\s*[+-]?(nan|inf|infinity)\b.*", re.IGNORECASE)
_HALF = 1500  # characters to show of a long sentence, at its start and at its end
_UNIT = re.compile(  # names, one-digit powers, 1 * / ( ): nothing that takes pint long to compute
    r"(?:[\s*/·()°%]|1(?!\w)|[^\W\d]\w*+(?:\s*(?:\^|\*\*)\s*-?\d(?!\d))?)*+"
)


class SceneError(ValueError):
    """A scene file is invalid; the message names the file and the key, and says what to do."""

    def __init__(self, sentence: str):
        """Escape unprintable characters, such as codes of a terminal, and shorten a long sentence."""
        shown = (c if c.isprintable() else c.encode("unicode_escape").decode() for c in sentence)
        text = "".join(shown)
        super().__init__(f"{text[:_HALF]} .. {text[-_HALF:]}" if len(text) > 2 * _HALF else text)


def quantity(value: Any, unit: str, path: str) -> float:
    """Number in `unit`, from a number or a text with a unit; `path` is for error messages."""
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
    """Number of a text in `unit`, or None; by decimal arithmetic, so "7.5 mm" is exactly 0.0075."""
    match = _NUMBER.fullmatch(text)
    if match is None or not _UNIT.fullmatch(match[2]):
        return None
    if not match[2]:
        return float(match[1])
    factor = _factor(match[2], unit)
    try:
        return None if factor is None else float(Decimal(match[1]) * factor)
    except ArithmeticError:  # a number beyond those of decimal arithmetic
        return None


def _factor(given: str, wanted: str) -> Decimal | None:
    """Factor from one unit to another by pint, which takes half a second to load; it is remembered."""
    factors, pair = _remembered(), f"{given} -> {wanted}"
    if pair not in factors:
        factor = _factor_by_pint(given, wanted)
        if factor is None:
            return None
        factors[pair] = str(factor)
        _remember(factors)
    return Decimal(factors[pair])


def _factor_by_pint(given: str, wanted: str) -> Decimal | None:
    registry = _registry()
    try:
        units = [registry.parse_units(u) for u in (given, "" if wanted == "1" else wanted)]
        # Angle counts as a dimension here, so that Hz cannot be converted to rad/s.
        one, other = (dict(registry.get_root_units(u)[1]._units).get("radian", 0) for u in units)
        factor, none = (registry.convert(Decimal(number), *units) for number in (1, 0))
        return factor if one == other and none == 0 else None
    except Exception:  # pint also raises errors of tokenize, assert and decimal
        return None


@functools.cache
def _remembered() -> dict[str, str]:
    """Factors that pint has given to this or an earlier process."""
    try:
        factors = json.loads(_factors_file().read_text())
        return {str(pair): str(Decimal(factor)) for pair, factor in factors.items()}
    except (OSError, ValueError, ArithmeticError, AttributeError):  # none yet, or damaged
        return {}


def _remember(factors: dict[str, str]) -> None:
    with contextlib.suppress(OSError):  # the folder is not writable
        file = _factors_file()
        file.parent.mkdir(parents=True, exist_ok=True)
        draft = file.with_suffix(f".{secrets.token_hex(8)}")  # no process reads a part of a file
        draft.write_text(json.dumps(factors))
        os.replace(draft, file)


def _factors_file() -> Path:
    version = importlib.metadata.version("pint")
    return user_cache_path("jaxrotor") / "units" / f"factors-of-pint-{version}.json"


@functools.cache
def _registry() -> Any:
    import pint

    build = functools.partial(pint.UnitRegistry, non_int_type=typing.cast(Any, Decimal))
    try:  # a cache of the definitions of units saves a fifth of a second
        registry = build(cache_folder=user_cache_path("jaxrotor") / "units")
    except Exception:  # the folder is not writable, or the cache is corrupt: any error of pickle
        registry = build()
    registry.define("@alias revolutions_per_minute = RPM")
    return registry


def refuse(path: str, text: str) -> NoReturn:
    """Raise a `SceneError` with the sentence "`path` `text`"."""
    raise SceneError(f"{path} {text}") from None


def show(value: Any) -> str:
    """Text of a value for an error message."""
    try:
        return reprlib.repr(value)
    except ValueError:  # Python does not print integers with thousands of digits
        return "a huge number"
