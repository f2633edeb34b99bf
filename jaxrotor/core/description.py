"""Description of a value: equal for two values exactly where they lead to the same compiled program."""

import dataclasses
import enum
import functools
import sys
import types
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax.core
import numpy as np


# Packages whose code the key of a program covers, by versions or sources: classes and functions of
# others are not described.
TRUSTED = ("jaxrotor", "jax", "jaxlib", "equinox", "diffrax", "lineax", "optimistix", "numpy")
_STANDARD = ("builtins", "functools", "operator", "math", "enum", "collections")
_NUMERIC = "biufc"  # kinds of numpy's types that a program takes
_LITERAL = (bool, int, str, bytes, type(None), type(Ellipsis), type(NotImplemented))


class Indescribable(Exception):
    """A value has a part that cannot be described exactly."""


def described(value: Any, arrays: list[Any] | None = None) -> Any:
    """Exact description of a value by nested tuples of numbers and texts.

    Args:
        value: a tree of modules, tuples, dictionaries and arrays, or a static value.
        arrays: a list that receives the arrays in the order of `jax.tree.leaves`; they are described by
            shape and type alone, as a program takes them. None: arrays are described by their values.

    Returns:
        The description. Equal descriptions have equal `repr`, and no others have.

    Raises:
        Indescribable: a part of the value is of an unknown class, a function that cannot be imported
            or an array on another device.
    """
    kind = type(value)
    if kind in _LITERAL:
        return kind.__name__, value
    if kind is float:
        return "float", value.hex()
    if kind is complex:
        return "complex", value.real.hex(), value.imag.hex()
    if isinstance(value, jax.Array | np.ndarray | np.generic):
        return _array(value, arrays)
    if isinstance(value, np.dtype):
        return "dtype", _name_of(value)
    if kind in (tuple, list):
        return kind.__name__, tuple([described(one, arrays) for one in value])
    if kind is dict:
        keys = _keys(value, arrays)
        return "dict", tuple([(described(key), described(value[key], arrays)) for key in keys])
    if isinstance(value, eqx.Module):
        return _module(value, arrays)
    if isinstance(value, jax.Device):
        return "device", value.platform, value.id
    if isinstance(value, type):
        return "class", _importable(value)
    describe = _OTHERS.get(kind)
    if describe is not None:
        return describe(value, arrays)
    if isinstance(value, enum.Enum):
        return "member", _importable(kind), value.name
    if isinstance(value, tuple) and hasattr(value, "_fields"):
        return _importable(kind), tuple([described(one, arrays) for one in value])
    if dataclasses.is_dataclass(value) and hasattr(value, "__dict__"):
        own = [(name, described(part)) for name, part in sorted(vars(value).items())]
        return _importable(kind), tuple(own)
    if callable(value):
        return "function", _importable(value)
    raise Indescribable(f"{kind.__module__}.{kind.__qualname__}")


def _array(value: Any, arrays: list[Any] | None) -> Any:
    kind = _name_of(value.dtype)
    if isinstance(value, jax.Array):
        if arrays is None or isinstance(value, jax.core.Tracer):
            raise Indescribable("a static or traced array of jax")
        if not isinstance(value.sharding, jax.sharding.SingleDeviceSharding):
            raise Indescribable("an array on several devices")
        arrays.append(value)
        place = bool(value.committed), value.sharding.memory_kind
        return "array", value.shape, kind, bool(value.weak_type), *place
    if not (type(value) is np.ndarray or isinstance(value, np.generic)):
        raise Indescribable(type(value).__name__)
    if arrays is None:
        return type(value).__name__, value.shape, kind, value.tobytes()
    arrays.append(value)
    return type(value).__name__, value.shape, kind


def _name_of(kind: Any) -> str:
    """Name of a numeric type of numpy, with its byte order."""
    if not isinstance(kind, np.dtype) or kind.kind not in _NUMERIC:
        raise Indescribable(f"an array of {kind}")
    return kind.str


def _module(value: eqx.Module, arrays: list[Any] | None) -> Any:
    """Class of a module and its fields; static ones are described by their values."""
    own = vars(value)
    name, fields = _fields(type(value))
    if not own.keys() <= fields.keys():
        raise Indescribable(f"{name} with attributes that are no fields")
    parts = [
        (field, described(own[field], None if static else arrays))
        for field, static in fields.items()
        if field in own
    ]
    return name, tuple(parts)


@functools.cache
def _fields(kind: type[eqx.Module]) -> tuple[tuple[str, str], dict[str, bool]]:
    """Name of a class of modules, and for each of its fields whether it is static."""
    fields = {f.name: bool(f.metadata.get("static")) for f in dataclasses.fields(kind)}
    return _importable(kind), fields


def _keys(value: dict, arrays: list[Any] | None) -> list[Any]:
    """Keys of a dictionary in the order in which jax takes them, those of a static one in its own."""
    if arrays is None:
        return list(value)
    try:
        return sorted(value)
    except TypeError:
        raise Indescribable("a dictionary whose keys have no order") from None


def _importable(value: Any) -> tuple[str, str]:
    """Module and name of a class or function that can be imported from a known package."""
    module = getattr(value, "__module__", None)
    name = getattr(value, "__qualname__", None)
    if type(module) is not str or type(name) is not str:
        raise Indescribable(repr(value))
    if module.partition(".")[0] not in (*TRUSTED, *_STANDARD):
        raise Indescribable(f"{module}.{name}")
    found: Any = sys.modules.get(module)
    for part in name.split("."):
        found = getattr(found, part, None)
    if found is not value:
        raise Indescribable(f"{module}.{name}")
    return module, name


def _partial(value: functools.partial, arrays: list[Any] | None) -> Any:
    del arrays  # a partial function is a leaf for `jax.tree`
    return "partial", described(value.func), described(value.args), described(value.keywords)


_OTHERS: dict[type, Callable[[Any, list[Any] | None], Any]] = {
    functools.partial: _partial,
    types.MethodType: lambda value, arrays: (
        "method",
        described(value.__func__),
        described(value.__self__),
    ),
    slice: lambda value, arrays: ("slice", described((value.start, value.stop, value.step))),
    frozenset: lambda value, arrays: ("frozenset", tuple(sorted(map(repr, map(described, value))))),
}
