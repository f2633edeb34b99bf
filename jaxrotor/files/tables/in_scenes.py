"""Tables in scene files: supports and shafts that name a file in place of their numbers."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from ...effects import Support
from ..several_shafts import SHAFTS
from ..toml_writer import shaft_table
from ..units import SceneError, refuse, show
from .bearing import coefficients
from .shaft import read_shaft


_SHAPE = ("model", "length", "diameter", "inner_diameter", "material", "steps")


def with_tables(document: dict[str, Any], source: str) -> dict[str, Any]:
    """A scene whose supports and shafts have the numbers of the tables that they name.

    The path of a `table` begins in the folder of the scene file, `source`; one of Excel may have a
    `sheet`. What the table of a shaft could not say exactly becomes an assumption of the scene.
    """
    document, notes = dict(document), []
    for key in {Support.kind, Support.plural} & document.keys():
        own = document[key]
        many = isinstance(own, list)
        parts = [
            _filled(
                part, _coefficients, f"{source}: {key}.{k}" if many else f"{source}: {key}", source
            )
            for k, part in enumerate(own if many else [own])
        ]
        document[key] = parts if many else parts[0]
    shaft = lambda path, sheet: _of_shaft(path, sheet, notes)
    if "shaft" in document:
        document["shaft"] = _filled(document["shaft"], shaft, f"{source}: shaft", source)
    if isinstance(document.get(SHAFTS), dict):
        document[SHAFTS] = {
            name: _filled(own, shaft, f"{source}: {SHAFTS}.{name}", source)
            for name, own in document[SHAFTS].items()
        }
    if notes and "assumption" not in document:
        document["assumption"] = "; ".join(notes)
    return document


def _filled(part: Any, numbers: Callable, path: str, source: str) -> Any:
    """A part with the numbers of its table in place of its keys `table` and `sheet`."""
    if not isinstance(part, dict) or "table" not in part:
        return part
    for key in ("table", "sheet"):
        if not isinstance(part.get(key, ""), str):
            refuse(f"{path}.{key}", f"must be a text, but is {show(part[key])}.")
    others = {key: value for key, value in part.items() if key not in ("table", "sheet")}
    try:
        found, read = numbers(Path(source).parent / part["table"], part.get("sheet"))
    except SceneError as error:
        raise SceneError(f"{path}.table: {error}") from None
    if twice := [key for key in others if key in read]:
        refuse(
            f"{path}.{twice[0]}",
            "is given beside `table`, which has it, too; leave out one of them.",
        )
    return found | others


def _coefficients(path: Path, sheet: str | None) -> tuple[dict[str, Any], Any]:
    """Numbers of a support, and the keys that these take the place of."""
    own = {key: np.asarray(value).tolist() for key, value in coefficients(path, sheet).items()}
    return own, own


def _of_shaft(path: Path, sheet: str | None, notes: list[str]) -> tuple[dict[str, Any], Any]:
    shaft, left_out = read_shaft(path, sheet=sheet)
    notes += [f"{path.name}: {note}" for note in left_out]
    return shaft_table(shaft), _SHAPE
