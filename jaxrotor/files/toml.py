"""Scene files: TOML in, TOML out.

A number is SI; a text carries its unit, see `units`. What parts are called, see `vocabulary`.
"""

import contextlib
import dataclasses
import inspect
import os
import re
import secrets
import tomllib
import types
import typing
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import equinox as eqx
import numpy as np

from .. import shafts, spins
from ..core.checks import suggest
from ..core.quantities import is_series, takes_matrix, unit_of
from ..scene import Scene
from ..shafts import AbstractShaft
from ..shafts.materials import NAMED, Material
from ..spins.base import AbstractSpin
from ..spins.constant import ConstantSpeed
from .shipped import text_of
from .toml_writer import dumps
from .units import SceneError, quantity, refuse, show
from .variants import CHAIN, NAME as TABLE, Variant, variant
from .vocabulary import COUNTS, FORMS, START, TEXTS, Form, kinds, models, twice


Table = dict[str, Any]

_MOST = 10_000_000  # any whole number: a greater one is a slip
_WORDS = {int: f"a whole number up to {_MOST}", bool: "true or false", str: "a text"}


def load(
    name_or_path: str | os.PathLike[str], row: int | None = None, layout: str | None = None
) -> Scene:
    """Scene of a TOML file, or a shipped scene by its name, such as `limiter-rotor`.

    `row`, from 1 to 30, and the `layout` assumed ("chain", see `Variant.scene`) are of
    `turbine-variants`, whose file is row 1.
    """
    if row is not None or layout is not None:
        return _variant(name_or_path, row).scene(layout or CHAIN)
    return _read(*text_of(name_or_path))[0]


def loads(text: str, source: str = "<text>") -> Scene:
    """Scene written in TOML; `source` names the text in error messages."""
    return _read(text, source)[0]


def study(name_or_path: str | os.PathLike[str]) -> Table:
    """The `[sweep]` table of a scene file, in SI; {} without one.

    Returns:
        Of the keys `over` (parameter path -> array of values), `settle`, `keep`,
        `steps_per_revolution` and `start` (`radius` [m], `rate` [rad/s], `angle` [rad]) those that
        the file gives.
    """
    return _read(*text_of(name_or_path))[1]


def title(
    name_or_path: str | os.PathLike[str], row: int | None = None, layout: str | None = None
) -> str:
    """Title of a scene file, "" without one; of a `row` see `Variant.title`."""
    if row is not None or layout is not None:
        return _variant(name_or_path, row).title(layout or CHAIN)
    return tomllib.loads(text_of(name_or_path)[0]).get("title", "")


def save(scene: Scene, path: str | os.PathLike[str], title: str = "") -> None:
    """Write a scene to a `.toml` file, whole or not at all; an existing file is replaced.

    Reading it back gives every parameter to the last bit. Effects of one kind are written together.
    """
    target, text = Path(path), dumps(scene, title)
    if target.suffix != ".toml":
        refuse(f"{target}", "cannot be written; the name of a scene file ends in .toml.")
    with whole(target) as draft:
        draft.write_text(text, "utf-8", newline="\n")


@contextlib.contextmanager
def whole(target: Path) -> Iterator[Path]:
    """A draft beside a file, which takes its place once all is written."""
    draft = target.with_name(f".{secrets.token_hex(8)}{target.suffix}")
    try:
        yield draft
        os.replace(draft, target)
    except OSError as error:
        reason = error.strerror or error
        refuse(f"{target}", f"cannot be written ({reason}); choose another place.")
    finally:
        with contextlib.suppress(OSError):
            draft.unlink()


# === reading; a path is the file and the key so far, as in "my.toml: limiters.0.gap"


def _variant(name_or_path: str | os.PathLike[str], row: int | None) -> Variant:
    if os.fspath(name_or_path) != TABLE:
        refuse(
            os.fspath(name_or_path), f"has no rows and no layouts; give none, or load '{TABLE}'."
        )
    if row is None:
        refuse(TABLE, "needs the row that the layout is for; add `row`, from 1 to 30.")
    return variant(row)


def _read(text: str, source: str) -> tuple[Scene, Table]:
    try:
        document = tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        refuse(source, twice(text, str(error)) or f"is not valid TOML: {error}.")
    if not document:
        refuse(source, "is empty; a scene needs at least [shaft] and [spin].")
    try:
        scene = _scene(document, f"{source}: ")
        return scene, _sweep(document.get("sweep", {}), scene, f"{source}: sweep")
    except RecursionError:
        refuse(source, "is nested too deeply; a scene has tables of plain values.")


def _scene(document: Table, prefix: str) -> Scene:
    named = {name: cls for cls in kinds().values() for name in (cls.kind, cls.plural)}
    known = (*TEXTS, "shaft", *kinds(), "spin", "sweep")
    for key in document:
        if key not in (*known, *named):
            names = {
                name: f"[{named[name].kind if name in named else name}]"
                for name in (*known, *named)
            }
            near = suggest(key, names, names.get)
            refuse(f"{prefix}{key}", f"is not a part of a scene{near}; it has: {', '.join(known)}.")
    _check_keys(document, document, ("shaft", "spin"), prefix, "scene")
    for key in TEXTS:
        if not isinstance(document.get(key, ""), str):
            refuse(f"{prefix}{key}", f"must be a text, but is {show(document[key])}.")
    shaft = _part(document["shaft"], "flexible", models(shafts, AbstractShaft), f"{prefix}shaft")
    turning = _part(document["spin"], "constant", models(spins, AbstractSpin), f"{prefix}spin")
    found = []
    for key in (key for key in document if key in named):
        many = isinstance(document[key], list)
        for i, table in enumerate(document[key] if many else [document[key]]):
            here = f"{prefix}{key}.{i}" if many else f"{prefix}{key}"
            found += _effects(named[key], table, here, turning)
    try:
        return Scene(shaft, *found, spin=turning, assumption=document.get("assumption", ""))
    except ValueError as error:
        raise SceneError(f"{prefix}{error}") from None


def _part(value: Any, default: str, models: Mapping[str, type], path: str) -> Any:
    """The shaft or the spin, of the class that its `model` names."""
    table = {"model": default} | _table(value, path)
    model = table.pop("model")
    if model not in list(models):
        refuse(f"{path}.model", f"must be {_either(models)}, but is {show(model)}.")
    return _built(models[model], table, path, f"{model} {path.rpartition(' ')[2]}")


def _effects(cls: Any, value: Any, path: str, turning: AbstractSpin) -> Iterator[Any]:
    """The effects of one table: several if it has `angles`."""
    table = _table(value, path)
    form = next((form for form in FORMS if form.of is cls and table.keys() & form.marks), None)
    if form is not None:
        if "speed" in form.units and isinstance(turning, ConstantSpeed):
            table = {"speed": float(turning.speed)} | table
        yield _formed(form, table, path)
    elif "angles" in table and "angle" in cls.__dataclass_fields__:
        angles = table.pop("angles")
        if "angle" in table or not isinstance(angles, list) or not angles:
            refuse(f"{path}.angles", 'must be a list such as [0.0, "90 deg"], in place of angle.')
        for i, value in enumerate(angles):
            angle = quantity(value, "rad", f"{path}.angles.{i}")
            yield _built(cls, table | {"angle": angle}, path, cls.kind)
    else:
        yield _built(cls, table, path, cls.kind)


def _formed(form: Form, table: Table, path: str) -> Any:
    """A part that is given by other keys than its fields."""
    fields = {field.name: field for field in dataclasses.fields(form.of)}
    _check_keys(table, (*form.units, *form.fields), form.needed, f"{path}.", form.noun)
    values = {}
    for key, value in table.items():
        here = f"{path}.{key}"
        if key == "grade" and isinstance(value, str) and value.lstrip().startswith("G"):
            values[key] = value
        elif key in form.units:
            values[key] = quantity(value, form.units[key], here)
        else:
            values[key] = _value(value, fields[key], here)
    return _checked(form.build, values, path)


def _built(cls: Any, table: Table, path: str, noun: str) -> Any:
    """A module from a table, by its fields: quantities, nested modules and plain values."""
    fields = {field.name: field for field in dataclasses.fields(cls) if field.init}
    required = [n for n, p in inspect.signature(cls).parameters.items() if p.default is p.empty]
    _check_keys(table, list(fields), required, f"{path}.", noun)
    values = {}
    for key, value in table.items():
        unit = unit_of(fields[key])
        matrix = next((n for n, f in fields.items() if takes_matrix(f) and unit_of(f) == unit), "")
        values[key] = _value(value, fields[key], f"{path}.{key}", matrix)
    return _checked(cls, values, path)


def _checked(build: Callable, values: Table, path: str) -> Any:
    try:
        return build(**values)
    except ValueError as error:
        raise SceneError(f"{path}: {error}") from None


def _value(value: Any, field: dataclasses.Field, path: str, matrix: str = "") -> Any:
    """A value of a field; `matrix` names the field that takes a matrix of such values."""
    unit, kind = unit_of(field), typing.cast(Any, field.type)
    if unit is not None and is_series(field):
        if not isinstance(value, list):
            refuse(path, f"must be a list of two or more numbers, but is {show(value)}.")
        return [quantity(one, unit, f"{path}.{i}") for i, one in enumerate(value)]
    if unit is not None and takes_matrix(field) and isinstance(value, list):
        return _matrix(value, unit, path)
    if unit is not None and isinstance(value, list):
        one = "one number" + ("" if unit == "1" else f" in {unit}")
        also = f", or {matrix} = [[xx, xy], [yx, yy]] in its place" if matrix else ""
        refuse(path, f"must be {one}, but is the list {show(value)}; write one{also}.")
    if unit is not None:
        return quantity(value, unit, path)
    if Material in (kind, *typing.get_args(kind)) and isinstance(value, str):
        if value not in NAMED:
            refuse(path, f"must be a table or {_either(NAMED)}, but is {show(value)}.")
        return NAMED[value]()
    for own in (kind, *typing.get_args(kind)):  # a module, an optional one, or a tuple of them
        if inspect.isclass(own) and issubclass(own, eqx.Module):
            if typing.get_origin(kind) is not tuple:
                return _built(own, _table(value, path), path, own.__name__.lower())
            if not isinstance(value, list):
                refuse(path, f"must be a list of tables, but is {show(value)}.")
            parts = [(_table(one, f"{path}.{i}"), f"{path}.{i}") for i, one in enumerate(value)]
            return tuple(_built(own, *part, own.__name__.lower()) for part in parts)
    words, plain = choices_of(kind)
    fits = type(value) in plain and not (type(value) is int and abs(value) > _MOST)
    if (words or plain) and not fits and value not in words:
        wanted = " or ".join(
            [*([_either(words)] if words else []), *(_WORDS[one] for one in plain)]
        )
        refuse(path, f"must be {wanted}, but is {show(value)}.")
    return value


def choices_of(kind: Any) -> tuple[list[str], list[type]]:
    """Texts that a field takes as they are, and the classes of plain values that it takes."""
    unions = (types.UnionType, typing.Union)
    kinds = typing.get_args(kind) if typing.get_origin(kind) in unions else (kind,)
    literals = [one for one in kinds if typing.get_origin(one) is typing.Literal]
    words = [word for one in literals for word in typing.get_args(one)]
    return words, [one for one in _WORDS if one in kinds]


def _matrix(value: list, unit: str, path: str) -> np.ndarray:
    if len(value) != 2 or not all(isinstance(row, list) and len(row) == 2 for row in value):
        example = "[[8e7, 1e7], [-2e7, 4e7]]"
        refuse(
            path, f"must be a number or a 2 by 2 matrix such as {example}, but is {show(value)}."
        )
    return np.array(
        [
            [quantity(one, unit, f"{path}.{i}.{j}") for j, one in enumerate(row)]
            for i, row in enumerate(value)
        ]
    )


def _sweep(value: Any, scene: Scene, path: str) -> Table:
    table = _table(value, path)
    _check_keys(table, ("over", *COUNTS, "start"), (), f"{path}.", "sweep")
    for key, least in COUNTS.items():
        count = table.get(key, least)
        if type(count) is not int or not least <= count <= _MOST:
            wanted = f"a whole number from {least} to {_MOST}"
            refuse(f"{path}.{key}", f"must be {wanted}, but is {show(count)}.")
    if "start" in table:
        table["start"] = _quantities(table["start"], START, (), f"{path}.start", "start")
    if "over" in table:
        over = dict(_flat(_table(table["over"], f"{path}.over")))
        table["over"] = {k: swept_values(v, scene, k, f"{path}.over.{k}") for k, v in over.items()}
    return table


def _flat(table: Table, head: str = "") -> Iterator[tuple[str, Any]]:
    """Dotted keys and values: TOML reads an unquoted `disc.mass = ..` as a table in a table."""
    for key, value in table.items():
        if isinstance(value, dict):
            yield from _flat(value, f"{head}{key}.")
        else:
            yield head + key, value


def swept_values(value: Any, scene: Scene, name: str, path: str) -> np.ndarray:
    """Values in SI of the swept parameter `name`, from "start : stop : count" or a list.

    `path` names the value in error messages. `start.radius` and its like are of the starting state.
    """
    head, _, own = name.partition(".")
    try:
        unit = START[own] if head == "start" and own in START else scene.unit(name)
    except ValueError as error:
        raise SceneError(f"{path}: {error}") from None
    return many(value, unit, path)


def many(value: Any, unit: str, path: str) -> np.ndarray:
    """Values in SI of "start : stop : count" or a list."""
    if isinstance(value, list) and value:
        return np.array([quantity(v, unit, f"{path}.{i}") for i, v in enumerate(value)])
    parts = [part.strip() for part in value.split(":")] if isinstance(value, str) else []
    count = int(parts[2]) if len(parts) == 3 and re.fullmatch("[0-9]{1,8}", parts[2]) else 0
    if not 2 <= count <= _MOST:
        wanted = f'a list, or "start : stop : count" with a count from 2 to {_MOST}'
        refuse(path, f"must be {wanted}, but is {show(value)}.")
    start, stop = (quantity(part, unit, path) for part in parts[:2])
    return np.linspace(start, stop, count)


# === quantities


def _quantities(value: Any, units: Mapping[str, str], needed: Any, path: str, noun: str) -> Table:
    table = _table(value, path)
    _check_keys(table, units, needed, f"{path}.", noun)
    return {key: quantity(value, units[key], f"{path}.{key}") for key, value in table.items()}


# === names and messages


def _table(value: Any, path: str) -> Table:
    if not isinstance(value, dict):
        refuse(path, f"must be a table, but is {show(value)}.")
    return dict(value)


def _check_keys(table: Table, known: Any, needed: Any, prefix: str, noun: str) -> None:
    article = "an" if noun[0] in "aeiou" else "a"
    for key in table:
        if key not in known:
            near, names = suggest(key, list(known)), ", ".join(known)
            what = f"is not a parameter of {article} {noun}{near}"
            refuse(f"{prefix}{key}", f"{what}; it has: {names}.")
    for key in needed:
        if key not in table:
            refuse(f"{prefix}{key}", f"is missing; {article} {noun} needs: {', '.join(needed)}.")


def _either(words: Iterable[str]) -> str:
    return " or ".join(f"'{word}'" for word in words)
