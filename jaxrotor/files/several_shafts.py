"""Several shafts in a scene file: their tables `[shafts.NAME]`, and the shafts that parts name.

The first table is the shaft to whose speed those of the others refer. A part names its shaft in its
station, `at = "hp 0.3 m"`, or by the key `shaft`.
"""

import dataclasses
import re
from collections.abc import Sequence
from typing import Any, NoReturn

from ..core.checks import suggest
from ..core.quantities import known, unit_of
from ..effects import AbstractEffect, CoaxialShaft
from .units import quantity, refuse, show


SHAFTS = "shafts"  # the table of tables
KEYS = {  # of a shaft beside the first one, with their units
    field.name: str(unit_of(field))
    for field in dataclasses.fields(CoaxialShaft)
    if unit_of(field) is not None
}


def named_shaft(cls: Any, table: dict[str, Any], names: Sequence[str], path: str) -> str | None:
    """Name of the shaft of a part, which is taken out of its table; None in a scene of one shaft."""
    name, at = table.pop("shaft", None), table.get("at")
    either = " or ".join(f"'{one}'" for one in names)
    if name is not None and name not in names:
        if not names:
            refuse(
                f"{path}.shaft",
                "names a shaft, but the scene has one [shaft]; leave it out, or give several shafts as "
                "[shafts.lp] and [shafts.hp].",
            )
        refuse(f"{path}.shaft", f"must be {either}, but is {show(name)}{_near(name, names)}.")
    first, rest = _split(at, names)
    if first is not None:
        if name not in (None, first):
            refuse(f"{path}.at", f"names the shaft '{first}', but `shaft` is '{name}'.")
        name, table["at"] = first, rest
    if len(names) < 2 or name is not None:
        return name
    if "at" in table:
        _refuse_unnamed(at, names, f"{path}.at")
    if cls.along_shaft:
        refuse(f"{path}.shaft", f"is missing; it names the shaft along which it acts, {either}.")
    return None


def station(text: str, names: Sequence[str], path: str) -> float | tuple[str, float]:
    """Station of a text [m], of several shafts with a name, as `Scene.stations` takes it."""
    name, rest = _split(text, names)
    if names and name is None:
        _refuse_unnamed(text, names, path)
    own = quantity(rest, "m", path)
    return own if name is None else (name, own)


def placed_text(effect: AbstractEffect) -> str | None:
    """Station with the name of its shaft, `hp 0.3 m`, by which `named_shaft` reads both."""
    name, at = effect.shaft, getattr(effect, "at", None)
    if name is None or at is None or not known(at) or name != name.strip():
        return None
    return f"{name} {float(at)!r} m"


def check_names(names: Sequence[str], path: str) -> None:
    """Raise unless there are shafts, and every name can stand before a station."""
    if not names:
        refuse(path, "has no shafts; give each a table of its own, as [shafts.lp] and [shafts.hp].")
    for name in names:
        if name != name.strip() or not name:
            refuse(
                path, f"has a shaft of the name {show(name)}; a name begins and ends with a letter."
            )


def _split(at: Any, names: Sequence[str]) -> tuple[str | None, Any]:
    """Name of a shaft at the beginning of a text, and the rest; None and the value itself without one."""
    text = at.strip() if isinstance(at, str) else ""
    there = [one for one in names if re.match(rf"{re.escape(one)}\s", text)]
    if not there:
        return None, at
    name = max(there, key=len)
    return name, text[len(name) :].strip()


def _refuse_unnamed(at: Any, names: Sequence[str], path: str) -> NoReturn:
    words = at.split() if isinstance(at, str) else []
    near = _near(words[0], names) if words else ""
    either = " or ".join(f"'{one}'" for one in names)
    example = f'as in "{names[0]} 0.3 m"'
    refuse(path, f"must name its shaft, {either}, {example}, but is {show(at)}{near}.")


def _near(name: Any, names: Sequence[str]) -> str:
    return suggest(str(name), list(names))
