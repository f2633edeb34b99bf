"""Writing of scenes as TOML."""

import dataclasses
from collections.abc import Mapping
from typing import Any

import equinox as eqx
import numpy as np

from .. import shafts, spins
from ..core.quantities import is_series, is_table, taken_for, takes_table, unit_of
from ..effects import AbstractEffect, CoaxialShaft
from ..scene import Scene
from ..shafts import AbstractShaft
from ..spins.base import AbstractSpin
from .several_shafts import KEYS, SHAFTS, placed_text
from .units import refuse
from .vocabulary import TEXTS, kinds, models


def dumps(scene: Scene, title: str = "") -> str:
    """Text of a scene in TOML: SI units, all digits of every number, and its unit in a comment."""
    import tomlkit

    document = tomlkit.document()
    for key, text in zip(TEXTS, (title, scene.assumption), strict=True):
        if text:
            document[key] = text
    if scene.name is None:
        document["shaft"] = _written(scene.shaft, "shaft", models(shafts, AbstractShaft))
    else:
        named = tomlkit.table(is_super_table=True)
        named[scene.name] = _written(scene.shaft, "shaft", models(shafts, AbstractShaft))
        for one in scene.of(CoaxialShaft):
            named[one.name] = _coaxial(one)
        document[SHAFTS] = named
    parts = [effect for effect in scene.effects if not isinstance(effect, CoaxialShaft)]
    for kind in dict.fromkeys(effect.kind for effect in parts):
        members = [effect for effect in parts if effect.kind == kind]
        tables = [_written(effect, kind, kinds()) for effect in members]
        name, item = (members[0].plural, tables) if len(tables) > 1 else (kind, tables[0])
        document[name] = tomlkit.item(item)
    document["spin"] = _written(scene.spin, "spin", models(spins, AbstractSpin))
    return tomlkit.dumps(document)


def shaft_table(shaft: AbstractShaft) -> dict[str, Any]:
    """Keys and values of a shaft, as a scene file has them."""
    return _written(shaft, "shaft", models(shafts, AbstractShaft)).unwrap()


def _coaxial(shaft: CoaxialShaft) -> Any:
    """Table of a shaft beside the first one: its model and own keys among those of its body."""
    import tomlkit

    table, body = tomlkit.table(), _written(shaft.body, "shaft", models(shafts, AbstractShaft))
    own = _written(shaft, f"{SHAFTS}.{shaft.name}")
    for source, keys in ((body, ("model",)), (own, KEYS), (body, body)):
        for key in (one for one in keys if one in source and one not in table):
            table.append(key, source.value.item(key))
    return table


def _written(module: Any, path: str, known: Mapping[str, type] | None = None) -> Any:
    """Table of a module; `known` are the classes that a file can name at this place."""
    import tomlkit

    table, nested = tomlkit.table(), {}
    if known is not None:
        model = next((name for name, cls in known.items() if cls is type(module)), None)
        if model is None:
            name = type(module).__name__
            other = f", as {path!r} is another class" if path in known else ""
            refuse(path, f"cannot be written: no scene file can name a {name}{other}.")
        if model != path:
            table["model"] = model
    place = placed_text(module) if isinstance(module, AbstractEffect) else None
    for field in (field for field in dataclasses.fields(module) if field.init):
        if place is not None and field.name in ("at", "shaft"):
            table["at"] = place
            continue
        value, unit, here = getattr(module, field.name), unit_of(field), f"{path}.{field.name}"
        if isinstance(value, eqx.Module):
            nested[field.name] = _written(value, here)
        elif isinstance(value, tuple):
            tables = [_written(one, f"{here}.{i}") for i, one in enumerate(value)]
            nested[field.name] = tomlkit.item(tables) if tables else []
        elif unit is not None and value is not None:
            many = is_series(field) or (takes_table(field) and is_table(value) and np.ndim(value))
            item = tomlkit.item(_plain(value, here, many))
            comment = "; ".join([*[unit] * (unit != "1"), *_implied(module, field.name)])
            table[field.name] = item.comment(comment) if comment else item
        elif isinstance(value, bool | int | str):
            table[field.name] = value
        elif value is not None:
            refuse(here, f"cannot be written: a scene file holds no {type(value).__name__}.")
    table.update(nested)
    return table


def _implied(module: Any, source: str) -> list[str]:
    """Values that a given quantity implies for others that are not given: `kyy = kxx`."""
    names = [field.name for field in dataclasses.fields(module)]
    found = {name: taken_for(module, name) for name in names}
    return [
        f"{name} = {one.formula}" for name, one in found.items() if one and one.source == source
    ]


def _plain(value: Any, path: str, many: int) -> float | list:
    """A known number, or a list of as `many` dimensions."""
    try:
        numbers = np.asarray(value, float)
        plain = numbers.ndim == many and bool(np.isfinite(numbers).all())
    except TypeError:  # traced
        numbers, plain = np.zeros(()), False
    if not plain:
        wanted = "a list of known finite numbers" if many else "one known finite number"
        refuse(path, f"cannot be written: it must be {wanted}, but is {value}.")
    return numbers.tolist()
