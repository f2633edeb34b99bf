"""Axis units: pictures and tables of commands are in the units in which their numbers were typed."""

import math
import re
from collections import Counter
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from ..files.toml import texts
from ..plot.units import LENGTHS, SMALL, SPEEDS, unit_of_text, units
from ..scene import Scene


_TYPED = re.compile(r"\s*([+-]?[\d.]+(?:e[+-]?\d+)?)\s*(\D\S*)\s*", re.IGNORECASE)
_SPELT = {name.lower(): name for name in (*SPEEDS, *LENGTHS)}
_SPELT |= dict.fromkeys(("um", "\N{GREEK SMALL LETTER MU}m", "micron"), "\N{MICRO SIGN}m")
_STORED = "speed_unit", "length_unit"  # attributes of data that are drawn later


def axis_units(scene: str, rotor: Scene, *options: str | None) -> dict[str, Any]:
    """Keywords of `plot.units`: the units of speeds and of deflections that were typed.

    A unit of `options` comes first, then the one that the scene file has most often, then the default of
    each picture. Deflections take the unit of lengths below a hundredth of the shaft's.

    Args:
        scene: name or path of the scene.
        rotor: the scene itself.
        options: texts of options, such as "0:6000rpm:61" or "unbalance.eccentricity=0.2mm".
    """
    parts = [text.rpartition("=")[2] for text in options if text is not None]
    longest = SMALL * float(rotor.shaft.length)
    typed = [_typed(group, longest) for group in (parts, texts(scene))]
    first = lambda k, default: next((group[k][0] for group in typed if group[k]), default)
    return {"speed": first(0, "rad/s"), "length": first(1, None)}


def angle_unit(scene: str, *options: str | None) -> tuple[float, str]:
    """Factor from rad to the unit in which angles were typed, and that unit: degrees if one was."""
    parts = [text.rpartition("=")[2] for text in options if text is not None]
    typed = [_TYPED.fullmatch(text) for text in (*parts, *texts(scene))]
    in_degrees = any(match and match[2].lower() == "deg" for match in typed)
    return (math.degrees(1.0), "deg") if in_degrees else (1.0, "rad")


def written_in(
    chosen: Mapping[str, Any], unit: str, values: Any, rotor: Scene
) -> tuple[float, str]:
    """Factor from SI to the unit of a table for numbers of a unit, and that unit, see `unit_of_text`."""
    with units(**chosen):
        return unit_of_text(
            unit, float(np.max(np.abs(values), initial=0.0)), float(rotor.shaft.length)
        )


def ends_in(chosen: Mapping[str, Any], unit: str, values: Any, rotor: Scene) -> str:
    """First and last of some numbers of a unit, as "1 to 2 mm", see `written_in`."""
    factor, unit = written_in(chosen, unit, values, rotor)
    return f"{factor * values[0]:.6g} to {factor * values[-1]:.6g} {unit}"


def stored(chosen: Mapping[str, Any]) -> dict[str, str]:
    """Attributes of data by which they are drawn in the same units later."""
    pairs = zip(_STORED, (chosen["speed"], chosen["length"]), strict=True)
    return {name: unit for name, unit in pairs if unit is not None}


def units_of(attributes: Mapping[str, Any]) -> Any:
    """`plot.units` as data were stored with, or by default."""
    speed, length = (attributes.get(name) for name in _STORED)
    return units(speed=speed or "rad/s", length=length)


def _typed(parts: Iterable[str], longest: float) -> tuple[list[str], list[str]]:
    """Units of speeds, and of lengths up to `longest` [m], the most frequent first."""
    speeds, lengths = Counter(), Counter()
    for part in parts:
        for text in re.split("[:,]", part):
            match = _TYPED.fullmatch(text)
            unit = None if match is None else _SPELT.get(match[2].lower())
            if match is None or unit is None:
                continue
            if unit in SPEEDS:
                speeds[unit] += 1
            elif abs(_number(match[1])) <= longest * LENGTHS[unit]:
                lengths[unit] += 1
    return ([unit for unit, _ in speeds.most_common()], [unit for unit, _ in lengths.most_common()])


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.inf
