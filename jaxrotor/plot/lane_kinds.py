"""Kinds of lanes: names and colours by which pictures of a sweep tell its lanes apart."""

from collections.abc import Iterable
from typing import Any

import numpy as np
import xarray as xr
from jaxtyping import Bool, Float, Int

from ..core.outcome import STATUS, failed
from ..files.toml import loads
from ..sweeps.observe_regular import SETTLED
from . import colours
from .labels import swept, words


LOST = "no result"
_MOST = 8  # classes that a variable with whole numbers may have; more have a colour bar
_FAR = 0.1  # of the length of the shaft: a lane that went farther has run away
_KINDS = {  # name -> colour, in the order of the legend
    "no contact": "#E4E4E4",
    "rub, forward whirl": colours.FORWARD,
    "rub, backward whirl": colours.BACKWARD,
    "rub, undefined": colours.UNDEFINED,
    "rub, irregular": colours.ORANGE,
    "rub": colours.ORANGE,
    "forward whirl": colours.FORWARD,
    "backward whirl": colours.BACKWARD,
    "undefined": colours.UNDEFINED,
    "steps too long": colours.DARK,
    "ran away": colours.MAGENTA,
    LOST: "white",
}

Group = tuple[str, str, Bool[np.ndarray, "..."]]  # name, colour, and the lanes of this kind
# Number of each lane's; name and colour
Classes = tuple[Int[np.ndarray, "y x"], list[tuple[str, str]]]


def groups_of_lanes(dataset: xr.Dataset, lanes: tuple[str, ...]) -> list[Group]:
    """Kinds of motion, or attractors, or directions of whirl, as is known, that occur among all lanes."""
    name = next((name for name in ("motion", "attractor") if name in dataset), "index")
    array = dataset[name].transpose(*lanes)
    number = array.values.ravel()
    if name == "index":
        ahead, back = number > 0, number < 0
        chosen = {"forward whirl": ahead, "backward whirl": back, "undefined": ~ahead & ~back}
        found = [(kind, _KINDS[kind], mask) for kind, mask in chosen.items()]
    else:
        attrs = array.attrs
        count = len(attrs["flag_meanings"].split() if name == "motion" else attrs["means"])
        found = [(*kind, number == k) for k, kind in enumerate(_named(array, range(count)))]
    return [group for group in found if group[2].any()]


def groups_of_map(dataset: xr.Dataset, dims: tuple[str, str]) -> list[Group]:
    """Kinds of `kinds_of_map` that occur, with their lanes over both parameters."""
    number, kinds = kinds_of_map(dataset, dims)
    found = [(*kind, np.equal(number.T, k)) for k, kind in enumerate(kinds)]
    return [group for group in found if group[2].any()]


def kinds_of_map(dataset: xr.Dataset, dims: tuple[str, str]) -> Classes:
    """Kind of motion of every lane over two parameters, the first along columns; see `sweep_map`."""
    whirl = next((name for name in ("winding", "index") if name in dataset), None)
    if "duty" not in dataset and whirl is None:
        raise ValueError(
            "The kind of motion needs `duty`, `winding` or `index`, but the dataset has none of them; "
            f"name the variable to draw, of {', '.join(map(str, dataset.data_vars))}."
        )
    status = dataset["status"].transpose(*dims).values.T
    conditions: dict[str, Bool[np.ndarray, "y x"]] = {
        LOST: failed(status),
        "steps too long": status == STATUS.index("steps_too_long_for_a_stop"),
    }
    if "radius_max" in dataset and "scene" in dataset.attrs:
        conditions["ran away"] = numbers(dataset, dims, "radius_max") > _FAR * _length(dataset)
    rub = "rub" if "duty" in dataset else ""
    if rub:
        conditions["no contact"] = numbers(dataset, dims, "duty") == 0
    if rub and "regularity" in dataset:
        conditions["rub, irregular"] = ~(numbers(dataset, dims, "regularity") < SETTLED)
    if whirl is not None:
        rub = rub and f"{rub}, "
        turns = numbers(dataset, dims, whirl)
        conditions |= {f"{rub}forward whirl": turns > 0, f"{rub}backward whirl": turns < 0}
        rub += "undefined"
    names = list(_KINDS)
    codes = [names.index(kind) for kind in conditions]
    return np.select(list(conditions.values()), codes, names.index(rub)), list(_KINDS.items())


def classes(
    dataset: xr.Dataset, dims: tuple[str, str], name: str, lost: Bool[np.ndarray, "y x"]
) -> Classes | None:
    """Classes of a variable with few whole numbers over two parameters; None of another variable."""
    values = numbers(dataset, dims, name)
    if dataset[name].dtype.kind not in "iub":
        return None
    if name == "status":  # tells itself why there is no result
        lost = np.zeros_like(lost)
    elif name == "attractor":
        lost = lost | (values < 0)
    present = np.unique(values[~lost])
    if len(present) > _MOST and name != "attractor":
        return None
    codes = np.where(lost, len(present), np.searchsorted(present, values))
    return codes, [*_named(dataset[name], present), (LOST, "white")]


def _named(array: xr.DataArray, values: Iterable[Any]) -> list[tuple[str, str]]:
    """Name and colour of some of the whole numbers that a variable has."""
    name, about = str(array.name), array.attrs
    if name == "attractor":
        feature, means = words(about["features"][0]), [mean[0] for mean in about["means"]]
        rounding = 1e-4 * max(map(abs, means), default=0.0)  # of a short run
        means = [mean if abs(mean) > rounding else 0.0 for mean in means]
        names = [f"{feature} {means[int(value)]:.3g}" for value in values]
    elif "flag_meanings" in about:
        meanings = [about["flag_meanings"].split()[int(value)] for value in values]
        names = list(map(words, meanings))
        if name == "motion":
            return list(zip(names, [colours.MOTIONS[one] for one in meanings], strict=True))
    else:
        names = [f"{words(name)} {value:g}" for value in values]
    return list(zip(names, colours.shades(len(names)), strict=True))


def numbers(dataset: xr.Dataset, dims: tuple[str, str], name: str) -> Float[np.ndarray, "y x"]:
    """A variable with one number a lane, of limiters the largest, the first parameter along columns."""
    own = set(swept(dataset, name)) - set(dims)
    array = dataset[name].max("limiter") if own == {"limiter"} else dataset[name]
    if set(array.dims) != set(dims):
        raise ValueError(
            f"A sweep map draws one number a lane, but `{name}` is over "
            f"{', '.join(map(repr, dataset[name].dims))}; reduce it first, or name another variable."
        )
    return array.transpose(*dims).values.astype(float).T


def _length(dataset: xr.Dataset) -> float:
    """Length of the shaft [m]; of several that are swept the largest."""
    if "shaft.length" in dataset.coords:
        return float(dataset["shaft.length"].max())
    return float(loads(dataset.attrs["scene"]).shaft.length)
