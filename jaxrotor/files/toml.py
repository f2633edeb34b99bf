"""Scene files: scenes are read from TOML and written to TOML.

A number is in SI units; a text carries its unit, see `units`. For the names of parts see `vocabulary`.
"""

import os
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from ..scene import Scene
from .draft import replacing
from .shipped import text_of
from .toml_reader import read
from .toml_writer import dumps
from .units import refuse
from .variants import CHAIN, NAME as TABLE, Variant, variant
from .vocabulary import TEXTS as TITLES


def load(
    name_or_path: str | os.PathLike[str], row: int | None = None, layout: str | None = None
) -> Scene:
    """Scene of a TOML file, or a shipped scene.

    Args:
        name_or_path: path of a file, or name of a shipped scene, such as `limiter-rotor`.
        row: row of `turbine-variants`, from 1 to 30; its file is row 1.
        layout: layout to assume for the row, "chain" (default) or "example31", see `Variant.scene`.

    Returns:
        The scene.

    Raises:
        SceneError: If the file cannot be read, or does not describe a scene. The message names the key.
        ValueError: If there is no such row or layout.
    """
    if row is not None or layout is not None:
        return _variant(name_or_path, row).scene(layout or CHAIN)
    return read(*text_of(name_or_path))[0]


def loads(text: str, source: str = "<text>") -> Scene:
    """Scene from a text in TOML.

    Args:
        text: content of a scene file.
        source: name of the text in error messages.

    Returns:
        The scene.

    Raises:
        SceneError: If the text does not describe a scene. The message names the key.
    """
    return read(text, source)[0]


def study(name_or_path: str | os.PathLike[str]) -> dict[str, Any]:
    """The `[sweep]` table of a scene file, in SI units.

    Args:
        name_or_path: path of a file, or name of a shipped scene.

    Returns:
        Those of the keys `over` (parameter path -> array of values), `settle`, `keep`,
        `steps_per_revolution` and `start` (`radius` [m], `rate` [rad/s], `angle` [rad]) that the file
        has; {} if it has no such table.

    Raises:
        SceneError: If the file cannot be read, or does not describe a scene.
    """
    return read(*text_of(name_or_path))[1]


def title(
    name_or_path: str | os.PathLike[str], row: int | None = None, layout: str | None = None
) -> str:
    """Title of a scene file.

    Args:
        name_or_path: path of a file, or name of a shipped scene.
        row: row of `turbine-variants`, as of `load`.
        layout: layout to assume for the row, as of `load`.

    Returns:
        The title, "" if the file has none; of a row `Variant.title`.

    Raises:
        SceneError: If the file cannot be read.
        ValueError: If there is no such row or layout.
    """
    if row is not None or layout is not None:
        return _variant(name_or_path, row).title(layout or CHAIN)
    return tomllib.loads(text_of(name_or_path)[0]).get("title", "")


def texts(name_or_path: str | os.PathLike[str]) -> list[str]:
    """All texts that a scene file gives as values, in order, but for its title and its assumption.

    Args:
        name_or_path: path of a file, or name of a shipped scene.

    Returns:
        The texts as they were typed, such as "0.2 mm"; numbers without a unit are not among them.

    Raises:
        SceneError: If the file cannot be read.
    """
    document = tomllib.loads(text_of(name_or_path)[0])
    return list(_texts({key: value for key, value in document.items() if key not in TITLES}))


def save(scene: Scene, path: str | os.PathLike[str], title: str = "") -> None:
    """Write a scene to a TOML file, which gives every parameter back to the last bit.

    An existing file is replaced once the new one is complete. Effects of one kind are grouped.

    Args:
        scene: the scene to write.
        path: path of the file, which ends in ".toml".
        title: title of the file.

    Raises:
        SceneError: If the file cannot be written, or the scene has traced values.
    """
    target, text = Path(path), dumps(scene, title)
    if target.suffix != ".toml":
        refuse(f"{target}", "cannot be written; the name of a scene file ends in .toml.")
    with replacing(target) as draft:
        draft.write_text(text, "utf-8", newline="\n")


def _texts(value: Any) -> Iterator[str]:
    """The texts in a value and in its parts."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, dict | list):
        for one in value.values() if isinstance(value, dict) else value:
            yield from _texts(one)


def _variant(name_or_path: str | os.PathLike[str], row: int | None) -> Variant:
    if os.fspath(name_or_path) != TABLE:
        refuse(
            os.fspath(name_or_path), f"has no rows and no layouts; give none, or load '{TABLE}'."
        )
    if row is None:
        refuse(TABLE, "needs the row that the layout is for; add `row`, from 1 to 30.")
    return variant(row)
