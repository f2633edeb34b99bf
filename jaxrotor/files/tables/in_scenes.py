"""Tables in scene files: supports and shafts that name a file in place of their numbers."""

from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ...effects import Support
from ...shafts.materials import Material
from ..several_shafts import SHAFTS
from ..toml_writer import shaft_table
from ..units import SceneError, refuse, show
from .bearing import coefficients
from .shaft import read_shaft


_SHAPE = ("model", "length", "diameter", "inner_diameter", "material", "steps")


def with_tables(
    document: dict[str, Any], source: str, material: Callable[[Any, str], Material]
) -> dict[str, Any]:
    """A scene whose supports and shafts have the numbers of the tables that they name.

    The path of a `table` begins in the folder of the scene file, `source`; one of Excel may have a
    `sheet`. What a table could not say exactly becomes an assumption of the scene. A shaft may have
    `materials` by their names in its table, which `material` builds.
    """
    document, notes = dict(document), {}

    def of_shaft(part: Any, path: str) -> Any:
        if not isinstance(part, dict) or not {"table", "materials"} <= part.keys():
            return _filled(part, _of_shaft, path, source, notes)
        part = dict(part)
        given = part.pop("materials")
        if not isinstance(given, dict):
            refuse(f"{path}.materials", f"must be a table of materials, but is {show(given)}.")
        known = {name: material(one, f"{path}.materials.{name}") for name, one in given.items()}
        return _filled(part, partial(_of_shaft, materials=known), path, source, notes)

    for key in {Support.kind, Support.plural} & document.keys():
        own = document[key]
        many = isinstance(own, list)
        parts = [
            _filled(one, _of_support, f"{source}: {key}{f'.{k}' * many}", source, notes)
            for k, one in enumerate(own if many else [own])
        ]
        document[key] = parts if many else parts[0]
    if "shaft" in document:
        document["shaft"] = of_shaft(document["shaft"], f"{source}: shaft")
    if isinstance(document.get(SHAFTS), dict):
        document[SHAFTS] = {
            name: of_shaft(own, f"{source}: {SHAFTS}.{name}")
            for name, own in document[SHAFTS].items()
        }
    if notes and isinstance(said := document.get("assumption", ""), str):
        document["assumption"] = "; ".join(filter(None, (said, *notes)))
    return document


def _filled(part: Any, numbers: Callable, path: str, source: str, notes: dict[str, None]) -> Any:
    """A part with the numbers of its table in place of its keys `table` and `sheet`."""
    if not isinstance(part, dict) or "table" not in part:
        return part
    for key in ("table", "sheet"):
        if not isinstance(part.get(key, ""), str):
            refuse(f"{path}.{key}", f"must be a text, but is {show(part[key])}.")
    others = {key: value for key, value in part.items() if key not in ("table", "sheet")}
    file = Path(source).parent / part["table"]
    try:
        found, read, said = numbers(file, part.get("sheet"))
    except SceneError as error:
        raise SceneError(f"{path}.table: {error}") from None
    if twice := [key for key in others if key in read]:
        refuse(
            f"{path}.{twice[0]}",
            "is given beside `table`, which has it, too; leave out one of them.",
        )
    notes |= dict.fromkeys(f"{file.name}: {note}" for note in said)
    return found | others


def _of_support(path: Path, sheet: str | None) -> tuple[dict[str, Any], Any, Iterable[str]]:
    """Numbers of a support, the keys that these take the place of, and what is assumed."""
    own, notes = coefficients(path, sheet)
    own = {key: np.asarray(value).tolist() for key, value in own.items()}
    return own, own, notes


def _of_shaft(path: Path, sheet: str | None, **materials: Any) -> tuple[Any, Any, Iterable[str]]:
    """The same of a shaft."""
    shaft, notes = read_shaft(path, sheet=sheet, **materials)
    return shaft_table(shaft), _SHAPE, notes
