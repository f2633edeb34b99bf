"""Provenance: the attributes by which data tell where they come from."""

import dataclasses
import functools
import importlib.metadata
import json
import math
import re
from collections.abc import Hashable, Iterable, Mapping
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ..core.pilot import Pilot
from ..equations.start import AbstractStart, AtRest, Continued, Whirl
from ..scene import Scene


TURN = "a turn of "  # before the name of the shaft whose turns are the revolutions
BRANCHES = ("up", "down")  # directions in which states are carried through values of a parameter


def ensemble_of(dims: Iterable[Hashable]) -> tuple[str, ...]:
    """Dimensions along which parameters are equal: starting states, and the direction of a branch."""
    return tuple(dim for dim in map(str, dims) if dim.startswith("start.") or dim == "branch")


def chosen(pilots: tuple[Pilot, ...]) -> dict[str, str]:
    """The attribute that names what pilot runs have chosen, or none."""
    return {"chosen": "; ".join(map(str, pilots))} if pilots else {}


def assumed(scene: Scene) -> dict[str, str]:
    """The attribute that names what is assumed of a scene, or none."""
    return {"assumption": scene.assumption} if scene.assumption else {}


def versions() -> str:
    """Versions of the packages a result depends on."""
    names = ("jaxrotor", "jax", "diffrax", "equinox")
    return " ".join(f"{name} {importlib.metadata.version(name)}" for name in names)


# === settings as JSON


def as_json(setting: Any) -> str:
    """A start, a solver or another setting as JSON, every number to its last digit.

    An object has its `class` and its fields by name; complex numbers have `real` and `imag`; numbers
    that JSON does not know are "inf", "-inf" and "nan". Equal settings have equal texts, in every
    process and whatever the options of numpy.
    """
    return json.dumps(_plain(setting), allow_nan=False)


def check_repeatable(dataset: Any, done: str, along_times: str) -> None:
    """Raise unless lanes of a data set can be run again, each alone.

    Messages tell what is to be `done` with them, and what to do with motions `along_times`.
    """
    if "scene" not in dataset.attrs or "status" not in dataset:
        raise ValueError(
            f"Only a data set of `sweep` can be {done}: this one has no scene or status."
        )
    if "keep" not in dataset.attrs:
        raise ValueError(f"The lanes of this sweep are motions along times, which {along_times}")
    if "branch" in dataset.dims or "branch" in dataset.coords:
        raise ValueError(
            "In a sweep with `carry` a lane depends on all lanes before it, so it cannot be run alone; "
            "take a sweep without."
        )


def period_of(attributes: Mapping[Any, Any]) -> float | str | None:
    """Length of a "revolution" [s] by which a sweep was run, None where it is that of the spin."""
    period = attributes["period"]
    if isinstance(period, str) and period.startswith(TURN):
        return period.removeprefix(TURN)
    return period if isinstance(period, float) else None


def start_and_solver(attributes: Mapping[Any, Any], other: Any = None) -> tuple[AbstractStart, Any]:
    """Start and solver of a sweep, or an`other` solver, from the attributes of its data set.

    Raises:
        ValueError: if the sweep began from another class of start, or was stepped by another solver,
            than can be built from its attributes.
    """
    from ..solvers.exponential import Exponential  # loads diffrax, a third of a second

    if attributes["start"].startswith("{"):
        start, solver = (json.loads(attributes[name]) for name in ("start", "solver_settings"))
        starts = (AtRest, Whirl, Continued)
    else:
        start, solver = _printed_settings(attributes["start"], attributes["solver"])
        starts = (AtRest, Whirl)
    known = {cls.__name__: cls for cls in starts}
    if start["class"] not in known:
        raise ValueError(
            f"A sweep from {start['class']} cannot be run again from its data set; only one from "
            f"{' or '.join(known)} can."
        )
    begin = known[start["class"]](**_fields(start))
    if other is not None:
        return begin, other
    if solver["class"] != Exponential.__name__:
        raise ValueError(
            f"A sweep by {solver['class']} cannot be run again from its data set; only `Exponential` "
            "can."
        )
    return begin, Exponential(**_fields(solver))


def _printed_settings(start: str, solver: str) -> tuple[dict[str, Any], dict[str, Any]]:
    """Settings of a store from before they were JSON: a start printed by equinox, a solver's name."""
    numbers = re.findall(r"(\w+)=Array\(([^,\[]+),", start)
    begin = {"class": start.partition("(")[0], **{name: float(value) for name, value in numbers}}
    found = re.fullmatch(r"Exponential\(order=(\d), basis='(\w+)'(, located=True)?\)", solver)
    if found is None:
        return begin, {"class": solver}
    order, basis, located = found.groups()
    step = {"order": int(order), "basis": basis, "located": bool(located)}
    return begin, {"class": "Exponential", **step}


def _fields(settings: Mapping[str, Any]) -> dict[str, Any]:
    """Values of the fields of an object that was read from JSON."""
    return {name: _value(value) for name, value in settings.items() if name != "class"}


def _value(value: Any) -> Any:
    """A number, text or array from what JSON has of it."""
    if isinstance(value, dict):
        value = value.get("values", value)
    if isinstance(value, dict):
        return jnp.asarray(value["real"], float) + 1j * jnp.asarray(value["imag"], float)
    return value


def _plain(value: Any) -> Any:
    """A setting as JSON can hold it: texts, numbers, lists and dictionaries."""
    match value:
        case None | bool() | int() | str():
            return value
        case float():
            return float(value) if math.isfinite(value) else str(float(value))
        case complex():
            return {"real": _plain(value.real), "imag": _plain(value.imag)}
        case list() | tuple():
            return [_plain(one) for one in value]
        case dict():
            return {str(name): _plain(one) for name, one in value.items()}
        case np.ndarray() | np.generic() | jax.Array():
            return _plain_array(np.asarray(value))
        case functools.partial():
            parts = {"arguments": value.args, "keywords": value.keywords}
            return {"function": _plain(value.func), **_plain(parts)}
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        names = [field.name for field in dataclasses.fields(value)]
        fields = {name: _plain(getattr(value, name, None)) for name in names}
        return {"class": type(value).__name__, **fields}
    return getattr(value, "__qualname__", None) or repr(value)


def _plain_array(array: Any) -> Any:
    """Numbers of an array in lists; with its `dtype` where that is not the one of the precision."""
    if np.iscomplexobj(array):
        numbers = {"real": _plain(array.real.tolist()), "imag": _plain(array.imag.tolist())}
    else:
        numbers = _plain(array.tolist())
    if array.dtype in map(jax.dtypes.canonicalize_dtype, (bool, int, float, complex)):
        return numbers
    return {"dtype": str(array.dtype), "values": numbers}
