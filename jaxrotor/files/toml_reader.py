"""Reading of scene files: tables of TOML as shafts, effects, spins and sweeps.

`path` is the name of the file and the key, as in "my.toml: limiters.0.gap", for error messages.
"""

import dataclasses
import inspect
import re
import tomllib
import types
import typing
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any

import equinox as eqx
import numpy as np

from .. import shafts, spins
from ..core.checks import suggest
from ..core.quantities import (
    COUNTED,
    is_series,
    least_count,
    takes_matrix,
    takes_table,
    unit_of,
    with_values,
)
from ..effects import CoaxialShaft
from ..scene import Scene
from ..shafts import AbstractShaft
from ..shafts.materials import NAMED, Material
from ..spins.base import AbstractSpin
from ..spins.constant import ConstantSpeed
from .several_shafts import KEYS, SHAFTS, check_names, named_shaft
from .tables.in_scenes import with_tables
from .units import SceneError, quantity, refuse, show
from .vocabulary import COUNTS, FORMS, START, TEXTS, Form, kinds, models, repeated


Table = dict[str, Any]

_MOST = 10_000_000  # largest integer that is accepted; a larger one is a mistake
_WORDS = {int: f"a whole number up to {_MOST}", bool: "true or false", str: "a text"}
_OTHER_WORDS = {  # for parts, as an engineer may call them
    **dict.fromkeys(("bearing", "seal", "wear_ring", "magnetic_pull", "spring"), "support"),
    **dict.fromkeys(("impeller", "wheel", "coupling", "fan", "rotor_core", "point_mass"), "disc"),
    **dict.fromkeys(("foundation", "pedestal", "housing"), "casing"),
    **{"stop": "limiter", "rub_ring": "annular_stator", "weight": "gravity", "speed": "spin"},
    **dict.fromkeys(("coaxial_shaft", "coaxial_shafts", "shaft2", "second_shaft"), "shafts.hp"),
}


def read(text: str, source: str) -> tuple[Scene, Table]:
    """Scene of a text, and its `[sweep]` table in SI units; `source` names the text."""
    try:
        document = tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        refuse(source, repeated(text, str(error)) or f"is not valid TOML: {error}.")
    if not document:
        refuse(source, "is empty; a scene needs at least [shaft] and [spin].")
    try:
        scene = _scene(with_tables(document, source, _material), f"{source}: ")
        return scene, _sweep(document.get("sweep", {}), scene, f"{source}: sweep")
    except RecursionError:
        refuse(source, "is nested too deeply; a scene has tables of plain values.")


def _scene(document: Table, prefix: str) -> Scene:
    """Scene of a document; `prefix` is the start of every path."""
    groups = {kind: cls for kind, cls in kinds().items() if cls is not CoaxialShaft}
    named = {name: cls for cls in groups.values() for name in (cls.kind, cls.plural)}
    known = (*TEXTS, "shaft", SHAFTS, *groups, "spin", "sweep", "machine")
    for key in document:
        if key not in (*known, *named):
            names = {
                name: f"[{named[name].kind if name in named else name}]"
                for name in (*known, *named)
            } | {word: f"[{kind}]" for word, kind in _OTHER_WORDS.items()}
            near = suggest(key, names, names.get)
            own = "" if near else "; a part of your own is known once its class is defined"
            parts = f"{near}; it has: {', '.join(known)}{own}."
            refuse(f"{prefix}{key}", f"is not a part of a scene{parts}")
    several = SHAFTS in document
    if several and "shaft" in document:
        refuse(
            f"{prefix}{SHAFTS}",
            "stands beside [shaft]; give that a name, too, as [shafts.lp], before the others.",
        )
    _check_keys(document, document, (SHAFTS if several else "shaft", "spin"), prefix, "scene")
    for key in TEXTS:
        if not isinstance(document.get(key, ""), str):
            refuse(f"{prefix}{key}", f"must be a text, but is {show(document[key])}.")
    if several:
        shaft = _shafts(document[SHAFTS], f"{prefix}{SHAFTS}")
    else:
        shaft = _part(
            document["shaft"], "flexible", models(shafts, AbstractShaft), f"{prefix}shaft"
        )
    names = tuple(shaft) if isinstance(shaft, dict) else ()
    spin = _part(document["spin"], "constant", models(spins, AbstractSpin), f"{prefix}spin")
    found = []
    for key in (key for key in document if key in named):
        many = isinstance(document[key], list)
        for i, table in enumerate(document[key] if many else [document[key]]):
            here = f"{prefix}{key}.{i}" if many else f"{prefix}{key}"
            found += _effects(named[key], _table(table, here), here, spin, names)
    try:
        return Scene(shaft, *found, spin=spin, assumption=document.get("assumption", ""))
    except ValueError as error:
        raise SceneError(f"{prefix}{error}") from None


def _part(
    value: Any, default: str, models: Mapping[str, type], path: str, more: Iterable[str] = ()
) -> Any:
    """Shaft or spin of the class that its `model` names; `more` are further keys that it may have."""
    table = {"model": default} | _table(value, path)
    model = table.pop("model")
    if model not in list(models):
        refuse(f"{path}.model", f"must be {_either(models)}, but is {show(model)}.")
    noun = "shaft" if f" {SHAFTS}." in path else path.rpartition(" ")[2]
    return built(models[model], table, path, f"{model} {noun}", more)


def _shafts(value: Any, path: str) -> dict[str, Any]:
    """Shafts by their names, the first one as it is, the others coaxial ones."""
    tables, found = _table(value, path), {}
    check_names(list(tables), path)
    for name, one in tables.items():
        here = f"{path}.{name}"
        own = _table(one, here)
        beside = {key: own.pop(key) for key in KEYS if key in own}
        if beside and not found:
            refuse(
                f"{here}.{next(iter(beside))}",
                "is that of a further shaft; the first one begins at 0 and turns at the speed of [spin].",
            )
        more = KEYS if found else ()
        body = _part(own, "flexible", models(shafts, AbstractShaft), here, more)
        if found:
            numbers = {k: quantity(v, KEYS[k], f"{here}.{k}") for k, v in beside.items()}
            body = _checked(CoaxialShaft, {"body": body, **numbers}, here)
        found[name] = body
    return found


def _effects(
    cls: Any, table: Table, path: str, spin: AbstractSpin, names: tuple[str, ...]
) -> Iterator[Any]:
    """Effects of a table: several if it has `angles`; `names` are those of several shafts."""
    shaft = named_shaft(cls, table, names, path)
    for effect in _unnamed(cls, table, path, spin):
        yield effect if shaft is None else with_values(effect, shaft=shaft)


def _unnamed(cls: Any, table: Table, path: str, spin: AbstractSpin) -> Iterator[Any]:
    """Effects of a table that names no shaft."""
    form = next((form for form in FORMS if form.of is cls and table.keys() & form.marks), None)
    if form is not None:
        if "speed" in form.units and isinstance(spin, ConstantSpeed):
            table = {"speed": float(spin.speed)} | table
        yield _formed(form, table, path)
    elif "angles" in table and "angle" in cls.__dataclass_fields__:
        angles = table.pop("angles")
        if "angle" in table or not isinstance(angles, list) or not angles:
            refuse(f"{path}.angles", 'must be a list such as [0.0, "90 deg"], in place of angle.')
        for i, value in enumerate(angles):
            angle = quantity(value, "rad", f"{path}.angles.{i}")
            yield built(cls, table | {"angle": angle}, path, cls.kind)
    else:
        yield built(cls, table, path, cls.kind)


def _formed(form: Form, table: Table, path: str) -> Any:
    """Part that is given by other keys than its fields."""
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


def built(cls: Any, table: Any, path: str, noun: str, more: Iterable[str] = ()) -> Any:
    """Module of a class from a table with its fields: quantities, nested modules and plain values."""
    table = _table(table, path)
    fields = {f.name: f for f in dataclasses.fields(cls) if f.init and f.name != "shaft"}
    required = [n for n, p in inspect.signature(cls).parameters.items() if p.default is p.empty]
    _check_keys(table, [*fields, *more], required, f"{path}.", noun)
    values = {}
    for key, value in table.items():
        unit = unit_of(fields[key])
        matrix = next((n for n, f in fields.items() if takes_matrix(f) and unit_of(f) == unit), "")
        values[key] = _value(value, fields[key], f"{path}.{key}", matrix)
    return _checked(cls, values, path)


def _checked(build: Callable, values: Table, path: str) -> Any:
    """Result of `build(**values)`, with `path` in the message of an error."""
    try:
        return build(**values)
    except ValueError as error:
        raise SceneError(f"{path}: {error}") from None


def _value(value: Any, field: dataclasses.Field, path: str, matrix: str = "") -> Any:
    """Value of a field; `matrix` names the field that accepts a matrix of such values."""
    unit, kind = unit_of(field), typing.cast(Any, field.type)
    if unit is not None and is_series(field):
        if not isinstance(value, list):
            least = COUNTED[least_count(field)]
            refuse(path, f"must be a list of {least} or more numbers, but is {show(value)}.")
        return [quantity(one, unit, f"{path}.{i}") for i, one in enumerate(value)]
    if unit is not None and takes_table(field) and isinstance(value, list):
        return _table_of(value, unit, path)
    if unit is not None and takes_matrix(field) and isinstance(value, list):
        return _matrix(value, unit, path)
    if unit is not None and isinstance(value, list):
        one = "one number" + ("" if unit == "1" else f" in {unit}")
        also = f", or {matrix} = [[xx, xy], [yx, yy]] in its place" if matrix else ""
        refuse(path, f"must be {one}, but is the list {show(value)}; write one{also}.")
    if unit is not None:
        return quantity(value, unit, path)
    if Material in (kind, *typing.get_args(kind)):
        return _material(value, path)
    for own in (kind, *typing.get_args(kind)):  # a module, possibly optional or in a tuple
        if inspect.isclass(own) and issubclass(own, eqx.Module):
            if typing.get_origin(kind) is not tuple:
                return built(own, value, path, own.__name__.lower())
            if not isinstance(value, list):
                refuse(path, f"must be a list of tables, but is {show(value)}.")
            parts = [(one, f"{path}.{i}") for i, one in enumerate(value)]
            return tuple(built(own, *part, own.__name__.lower()) for part in parts)
    words, plain = choices_of(kind)
    fits = type(value) in plain and not (type(value) is int and abs(value) > _MOST)
    if (words or plain) and not fits and value not in words:
        wanted = " or ".join(
            [*([_either(words)] if words else []), *(_WORDS[one] for one in plain)]
        )
        refuse(path, f"must be {wanted}, but is {show(value)}.")
    return value


def _material(value: Any, path: str) -> Material:
    """Material by its name, or from a table of its numbers."""
    if not isinstance(value, str):
        return built(Material, value, path, "material")
    if value not in NAMED:
        refuse(path, f"must be a table or {_either(NAMED)}, but is {show(value)}.")
    return NAMED[value]()


def _table_of(value: list, unit: str, path: str) -> list:
    """Quantities of a list, or of a list of rows."""
    return [
        _table_of(one, unit, f"{path}.{i}")
        if isinstance(one, list)
        else quantity(one, unit, f"{path}.{i}")
        for i, one in enumerate(value)
    ]


def choices_of(kind: Any) -> tuple[list[str], list[type]]:
    """Texts that a field accepts literally, and the classes of plain values that it accepts."""
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
    """Dotted keys with their values, as TOML reads an unquoted `disc.mass = ..` as a nested table."""
    for key, value in table.items():
        if isinstance(value, dict):
            yield from _flat(value, f"{head}{key}.")
        else:
            yield head + key, value


def swept_values(value: Any, scene: Scene, name: str, path: str) -> np.ndarray:
    """Values of the swept parameter `name` in SI units, from "start : stop : count" or a list.

    `start.radius`, `start.rate` and `start.angle` are parameters of the initial state, and
    `start.balls.0.angle` those of balls.
    """
    head, _, own = name.partition(".")
    own = re.sub(r"balls\.\d+\.(angle|rate)(\.\d+)?", r"\1", own)
    try:
        unit = START[own] if head == "start" and own in START else scene.unit(name)
    except ValueError as error:
        raise SceneError(f"{path}: {error}") from None
    return value_list(value, unit, path)


def value_list(value: Any, unit: str, path: str) -> np.ndarray:
    """Values in `unit` from "start : stop : count" or a list."""
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
