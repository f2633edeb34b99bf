"""Motions of some lanes of a sweep, run again together or taken from its data set."""

from collections.abc import Sequence

import numpy as np
import xarray as xr

from ..core.outcome import failed
from ..files.toml import loads
from ..sweeps.observe import Orbit, WhirlSpectrum
from ..sweeps.sweep import sweep
from .explore import run_of


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


def motions_of(dataset: xr.Dataset, lanes: np.ndarray) -> xr.Dataset:
    """Orbit and whirl spectrum of some lanes, by their numbers in the order of `status`.

    What the data set has is taken from it. Otherwise the lanes are run again as one sweep, from the
    attributes of the data set, and their last revolutions are observed, see `run_of`.

    Args:
        dataset: data set of a sweep.
        lanes: numbers of the lanes.

    Returns:
        Data set over `lane` with `orbit` (lane, revolution, sample, axis) [m] and `spectrum`
        (lane, frequency) [1].
    """
    status, attributes = dataset["status"], dataset.attrs
    numbers = np.unravel_index(lanes, status.shape)
    places = {d: xr.DataArray(n, dims="lane") for d, n in zip(status.dims, numbers, strict=True)}
    if "orbit" in dataset and "spectrum" in dataset:
        return dataset[["orbit", "spectrum"]].isel(places).load()
    coords = status.isel(places).coords
    values = {
        str(name): np.broadcast_to(np.asarray(one, float), len(lanes))
        for name, one in coords.items()
        if "." in str(name)
    }
    how = run_of(attributes)
    observe = Orbit(), WhirlSpectrum(how["steps_per_revolution"])
    return sweep(
        loads(attributes["scene"]), {"lane": values}, observe=observe, error_sample=0, **how
    )
