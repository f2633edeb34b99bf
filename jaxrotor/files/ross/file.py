"""Elements of a file of ROSS, and notes on what is not carried over."""

import json
import tomllib
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

from ..units import quantity, refuse, show


Table = dict[str, Any]


_DRAWN = ("n", "tag", "color", "scale_factor")
_BEARING = ("n_link", "frequency", "speed", "interpolation", "seal_leakage", "leakage")
_BEARING += tuple(letter + axes for letter in "kcm" for axes in ("xx", "xy", "yx", "yy", "zz"))
_SHAFT = ("L", "idl", "odl", "idr", "odr", "material", "axial_force", "torque", "alpha", "beta")
_SHAFT += ("shear_effects", "rotary_inertia", "gyroscopic", "shear_method_calc")
_READ = {  # keys of elements that are read, or have no part in the motion
    "ShaftElement": _SHAFT,
    "DiskElement": ("m", "Id", "Ip"),
    "PointMass": ("m", "mx", "my", "mz"),
    "BearingElement": _BEARING,
    "SealElement": _BEARING,
}


class Element(NamedTuple):
    """Element of the file."""

    kind: str  # name of its class in ROSS
    path: str  # path of its table, for error messages
    table: Table
    version: int = 2  # first number of the version of ROSS that wrote the file

    @property
    def name(self) -> str:
        """Tag of the element, or else its kind, as one line."""
        return _line(self.table.get("tag") or self.kind)

    @property
    def node(self) -> int:
        """Number of its node."""
        return self.count("n")

    def count(self, key: str) -> int:
        """Integer value of a key."""
        value = self.table.get(key)
        if isinstance(value, bool) or not isinstance(value, int | float) or value != value // 1:
            refuse(f"{self.path}.{key}", f"must be a whole number, but is {show(value)}.")
        return int(value)

    def number(self, key: str, unit: str, default: float | None = None) -> float:
        """Value of a key in `unit`."""
        value = self.table.get(key, default)
        if value is None:
            refuse(f"{self.path}.{key}", f"is missing; a {self.kind} needs it.")
        return quantity(value, unit, f"{self.path}.{key}")


def _version(text: Any) -> int:
    """First number of a version, 2 where there is none, as in files of earlier versions."""
    first = str(text).partition(".")[0]
    return int(first) if first.isascii() and first.isdigit() and len(first) < 4 else 2


def _line(text: Any) -> str:
    """A text as one line, which fits into a comment."""
    words = " ".join(str(text).split())
    return "".join(letter for letter in words if letter.isprintable())


class Notes:
    """Notes on what was changed or left out, each with the elements concerned."""

    def __init__(self) -> None:
        self.found: dict[str, list[str]] = {}
        self.errors: dict[str, float] = {}

    def add(self, text: str, element: Element, error: float | None = None) -> None:
        """Add a note on an element; of relative errors the largest is told behind the text."""
        names = self.found.setdefault(text, [])
        if element.name not in names:
            names.append(element.name)
        if error is not None:
            self.errors[text] = max(error, self.errors.get(text, 0.0))

    def __iter__(self) -> Iterator[str]:
        for text, names in self.found.items():
            size = f" {100 * round(self.errors[text], 9):.2g} %" if text in self.errors else ""
            more = f" and {len(names) - 1} more" if len(names) > 1 else ""
            yield f"{text}{size}: {names[0]}{more}"


def read(source: str) -> list[Element]:
    """Elements of a file; raises if it cannot be read or has no shaft."""
    try:
        text = Path(source).read_bytes().decode("utf-8-sig")
        document = json.loads(text) if source.lower().endswith(".json") else tomllib.loads(text)
    except (OSError, ValueError, RecursionError) as error:
        reason = getattr(error, "strerror", None) or error
        refuse(source, f"cannot be read ({reason}); give a file that ROSS has written.")
    tables = document.items() if isinstance(document, dict) else ()
    version = _version(dict(tables).get("ross_version"))
    found = [
        Element(_line(name.partition("_")[0]), f"{source}: {name}", table, version)
        for name, table in tables
        if isinstance(table, dict) and name != "parameters" and not name.startswith("_")
    ]
    if not any(element.kind == "ShaftElement" for element in found):
        refuse(source, "has no shaft elements; give a file that ROSS has written by `Rotor.save`.")
    return found


def note_unread(elements: Iterable[Element], notes: Notes) -> None:
    """Note the keys of elements that have no place in a scene."""
    for element in elements:
        read = _READ.get(element.kind)
        if read is None:
            continue
        for key, value in element.table.items():
            if key not in read and key not in _DRAWN and value is not None:
                notes.add(f"`{_line(key)}` is not read", element)


def station(element: Element, places: dict[int, float]) -> float:
    """Station of an element [m]."""
    if element.node not in places:
        refuse(
            f"{element.path}.n", f"must be a node of the shaft, but is {show(element.table['n'])}."
        )
    return places[element.node]
