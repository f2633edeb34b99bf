"""Motions of lanes of a sweep, run again by the attributes of its data set, or taken from it."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from ..core.outcome import failed
from ..files.toml import loads
from ..results.provenance import check_repeatable, period_of, start_and_solver
from ..sweeps.axes import at_point
from ..sweeps.observe import Orbit, WhirlSpectrum
from ..sweeps.sweep import sweep


LONGEST = 50  # the most revolutions of a motion that are shown, its last ones


def check_lanes(dataset: xr.Dataset) -> None:
    """Raise unless each lane of a data set can be run alone."""
    otherwise = "have no orbit to explore; draw it by `plot.envelope` or `plot.sweep_map`."
    check_repeatable(dataset, "explored", otherwise)


def motion_of(dataset: xr.Dataset, lane: int) -> tuple[Any, dict[str, Any]]:
    """Scene of a lane, and the options by which `simulate` repeats its motion."""
    status, how = dataset["status"], _options(dataset.attrs)
    place = dict(zip(status.dims, np.unravel_index(lane, status.shape), strict=True))
    values = {name: float(value) for name, value in _values(dataset, place).items()}
    scene, how["start"] = at_point(loads(dataset.attrs["scene"]), how["start"], values)
    how["revolutions"] = how.pop("settle") + how["keep"]
    return scene, how


def motions_of(dataset: xr.Dataset, lanes: np.ndarray) -> xr.Dataset:
    """Orbit and whirl spectrum of some lanes, by their numbers in the order of `status`.

    They are taken from the data set if it has them. Otherwise the lanes are run again as one sweep.

    Args:
        dataset: data set of a sweep.
        lanes: numbers of the lanes.

    Returns:
        Data set over `lane` with `orbit` (lane, revolution, sample, axis) [m] and `spectrum`
        (lane, frequency) [1].
    """
    status = dataset["status"]
    numbers = np.unravel_index(lanes, status.shape)
    places = {d: xr.DataArray(n, dims="lane") for d, n in zip(status.dims, numbers, strict=True)}
    if "orbit" in dataset and "spectrum" in dataset:
        return dataset[["orbit", "spectrum"]].isel(places).load()
    count, values = len(lanes), _values(dataset, places)
    over = {name: np.broadcast_to(np.asarray(one, float), count) for name, one in values.items()}
    how = _options(dataset.attrs)
    observe = Orbit(), WhirlSpectrum(how["steps_per_revolution"])
    scene = loads(dataset.attrs["scene"])
    return sweep(scene, {"lane": over}, observe=observe, error_sample=0, **how)


def _values(dataset: xr.Dataset, place: Mapping[Any, Any]) -> dict[str, Any]:
    """Swept and other values of paths at one or more lanes."""
    coords = dataset["status"].isel(place).coords
    return {str(name): value for name, value in coords.items() if "." in str(name)}


def _options(attributes: Mapping[str, Any]) -> dict[str, Any]:
    """Options by which lanes are run again, to keep their last `LONGEST` revolutions."""
    start, solver = start_and_solver(attributes)
    kept, shaft = int(attributes["keep"]), attributes.get("observed_shaft")
    keep, at = min(kept, LONGEST), float(attributes["station"])
    return {
        "start": start,
        "solver": solver,
        "settle": int(attributes["settle"]) + kept - keep,
        "keep": keep,
        "steps_per_revolution": int(attributes["steps_per_revolution"]),
        "at": at if shaft is None else (shaft, at),
        "period": period_of(attributes),
    }


def spread_lanes(
    shape: Sequence[int], starts: Sequence[int], most: int, status: np.ndarray
) -> np.ndarray:
    """Numbers of lanes with a result, spread evenly over the swept values.

    Every value that is taken has its lanes of all starts, as far as there are not more than `most`.

    Args:
        shape: number of values of each swept parameter, one or two.
        starts: number of values of each quantity of the start, which follow in the order of lanes.
        most: the most lanes to take.
        status: statuses of all lanes.

    Returns:
        Numbers in the flattened order of lanes, ascending.
    """
    if not most:
        return np.zeros(0, int)
    count = int(np.prod(starts, dtype=int))
    values = max(most // count, 1)
    side = values if len(shape) == 1 else int(np.sqrt(values))
    chosen = [_spread(*each) for each in zip(shape, (side, values // side), strict=False)]
    numbers = np.ravel_multi_index(np.meshgrid(*chosen, indexing="ij"), tuple(shape)).ravel()
    lanes = numbers[:, None] * count + _spread(count, most)
    return lanes.ravel()[~failed(status.ravel()[lanes.ravel()])]


def _spread(size: int, count: int) -> np.ndarray:
    """At most `count` of the numbers below `size`, the first and the last among them."""
    return np.unique(np.linspace(0, size - 1, min(size, count)).round().astype(int))
