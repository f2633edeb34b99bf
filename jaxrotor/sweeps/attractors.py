"""Attractors: the motions in which lanes of a sweep end, followed as parameters change."""

from collections.abc import Sequence

import numpy as np
import xarray as xr
from jaxtyping import Float, Int
from scipy.optimize import linear_sum_assignment
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from ..core.outcome import failed
from ..results.provenance import ensemble_of


FEATURES = ("whirl_rate", "radius_rms")


def attractors(
    dataset: xr.Dataset,
    features: Sequence[str] = FEATURES,
    *,
    within: float = 0.1,
    apart: float | None = None,
    like: xr.Dataset | None = None,
) -> xr.Dataset:
    """The data set with the number of the `attractor` of every lane, 0 for the most frequent one.

    Distances are those of `features`, each over its range in the whole data set. Lanes of the same
    parameters, which differ by their start or branch, are in one attractor if a chain of lanes leads
    from one to the other in steps of at most `within`. From one value of a parameter to the next, a
    cluster takes the number of the known attractor whose mean is nearest, if nearer than `apart`; an
    attractor that changes fast therefore needs close values.

    Args:
        dataset: sweep with one number a lane for every feature; an undefined whirl rate counts as 0.
        features: names of variables.
        within: largest distance of neighbours in a chain.
        apart: distance that an attractor may move to the next value; by default twice `within`.
        like: an earlier result for another sweep, whose numbers are kept for the attractors in it.

    Returns:
        The data set with `attractor`, -1 where a lane failed; its attribute `means` lists the features of
        every attractor. Motions with equal features count as one; not differentiable.

    Raises:
        ValueError: if a feature is missing or is not one number a lane, `within` is not above 0 or is
            above `apart`, or `like` has no attractors by the same features.

    Source: Stender, Hoffmann (2022), bSTAB, Nonlinear Dynamics 107, 1451-1468; matching: Datseris, Rossi,
    Wagemakers (2023), Chaos 33, 073151.
    """
    if not features:
        raise ValueError("`features` must name at least one variable, but is empty.")
    for name in features:
        if name not in dataset:
            raise ValueError(
                f"The dataset has no `{name}`; choose `features` of {', '.join(map(str, dataset))}."
            )
    apart = 2 * within if apart is None else apart
    if not 0 < within <= apart:
        raise ValueError(
            f"`within` must be above 0 and `apart` not below it, but are {within} and {apart}."
        )
    status = dataset["status"]
    ensemble = ensemble_of(status.dims)
    parameters = [d for d in map(str, status.dims) if d not in ensemble]
    order = (*parameters, *ensemble)
    for name in features:
        if set(dataset[name].dims) != set(order):
            raise ValueError(f"`{name}` is not one number a lane, but over {dataset[name].dims}.")
    shape = [dataset.sizes[d] for d in parameters]
    cells = int(np.prod(shape, dtype=int))
    columns = [dataset[name].transpose(*order).values.ravel() for name in features]
    table = np.nan_to_num(np.stack(columns, axis=-1))
    good = ~failed(status.transpose(*order).values).ravel()
    spread = np.ptp(table[good], axis=0) if good.any() else np.ones(len(features))
    scaled = (table / np.where(spread > 0, spread, 1.0)).reshape(cells, -1, len(features))
    earlier = [] if like is None else _means(like, features)
    known = [np.array(mean) / np.where(spread > 0, spread, 1.0) for mean in earlier]
    label = _numbered(scaled, good.reshape(cells, -1), _serpentine(shape), within, apart, known)
    label = label.ravel()
    means = [
        table[label == number].mean(axis=0).tolist() if (label == number).any() else earlier[number]
        for number in range(max(label.max(initial=-1) + 1, len(earlier)))
    ]
    attrs = {"long_name": "attractor", "features": list(features), "means": means, "within": within}
    sizes = [dataset.sizes[d] for d in order]
    found = xr.DataArray(label.reshape(sizes), dims=order, attrs=attrs)
    return dataset.assign(attractor=found.transpose(*status.dims))


def _numbered(
    points: Float[np.ndarray, "c l f"],
    good: np.ndarray,
    path: list[int],
    within: float,
    apart: float,
    known: list[np.ndarray],
) -> Int[np.ndarray, "c l"]:
    """Numbers of the attractors of all lanes, cells taken along a path of neighbours.

    `known` holds the mean of every attractor in the last cell where it occurred.
    """
    label, first = np.full(points.shape[:2], -1), len(known)
    for cell in path:
        lanes = np.flatnonzero(good[cell])
        if not lanes.size:
            continue
        here = points[cell, lanes]
        cluster = _clusters(here, within)
        means = np.stack([here[cluster == k].mean(axis=0) for k in range(cluster.max() + 1)])
        numbers = np.full(len(means), -1)
        if known:
            distance = np.linalg.norm(means[:, None] - np.stack(known), axis=-1)
            # Beyond `apart` all cost the same, more than any admissible match.
            matches = linear_sum_assignment(np.minimum(distance, apart))
            for row, column in zip(*matches, strict=True):
                if distance[row, column] < apart:
                    numbers[row] = column
        for k, mean in enumerate(means):
            if numbers[k] < 0:
                numbers[k] = len(known)
                known.append(mean)
            known[numbers[k]] = mean
        label[cell, lanes] = numbers[cluster]
    sizes = np.bincount(label[label >= 0], minlength=len(known))
    rank = np.append(np.arange(len(known)), -1)
    rank[first + np.argsort(-sizes[first:], kind="stable")] = np.arange(first, len(known))
    return rank[label]


def _means(like: xr.Dataset, features: Sequence[str]) -> list[list[float]]:
    """Means of the attractors in another data set."""
    if "attractor" not in like or like["attractor"].attrs["features"] != list(features):
        raise ValueError("`like` must be a result of `attractors` by the same `features`.")
    return like["attractor"].attrs["means"]


def _clusters(points: Float[np.ndarray, "l f"], within: float) -> Int[np.ndarray, " l"]:
    """Number of the cluster of every point, where steps of at most `within` join points."""
    pairs = KDTree(points).query_pairs(within, output_type="ndarray")
    joined = coo_matrix((np.ones(len(pairs)), pairs.T), shape=(len(points), len(points)))
    return connected_components(joined, directed=False)[1]


def _serpentine(shape: Sequence[int]) -> list[int]:
    """Cells of a grid in an order in which each is a neighbour of the one before."""
    path = []
    for index in np.ndindex(*shape):
        cell, rank = [], 0
        for at, size in zip(index, shape, strict=True):
            cell.append(size - 1 - at if rank % 2 else at)
            rank = rank * size + at
        path.append(int(np.ravel_multi_index(cell, shape)) if len(shape) else 0)
    return path
