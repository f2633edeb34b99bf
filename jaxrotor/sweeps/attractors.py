"""Attractors: which lanes of a sweep end in the same motion, and in which one as parameters change."""

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
    """The data set with a number of the `attractor` of every lane, the commonest 0.

    Lanes of the same parameters, which differ by their start or branch, are in one attractor if a chain of
    lanes leads from one to the other in steps of `within`, of `features` over their ranges in the whole
    data set. From one value of a parameter to the next, clusters keep the number of the known one whose
    mean is nearest, if nearer than `apart`; so an attractor that changes fast needs close values.

    Args:
        dataset: sweep of one number a lane for every feature; undefined whirl counts as none.
        features: names of variables.
        within: distance of neighbours, of the range of every feature.
        apart: farthest that an attractor moves to the next value; by default twice `within`.
        like: an earlier answer, of another sweep, whose numbers are kept for the attractors it knows.

    Returns:
        The data set with `attractor`, -1 where a lane failed; its attribute `means` lists the features of
        every attractor. Motions with equal features count as one; not differentiable.

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
    before = [] if like is None else _means(like, features)
    known = [np.array(mean) / np.where(spread > 0, spread, 1.0) for mean in before]
    label = _numbered(scaled, good.reshape(cells, -1), _serpentine(shape), within, apart, known)
    label = label.ravel()
    means = [
        table[label == number].mean(axis=0).tolist() if (label == number).any() else before[number]
        for number in range(max(label.max(initial=-1) + 1, len(before)))
    ]
    about = {"long_name": "attractor", "features": list(features), "means": means, "within": within}
    sizes = [dataset.sizes[d] for d in order]
    found = xr.DataArray(label.reshape(sizes), dims=order, attrs=about)
    return dataset.assign(attractor=found.transpose(*status.dims))


def _numbered(
    points: Float[np.ndarray, "c l f"],
    good: np.ndarray,
    path: list[int],
    within: float,
    apart: float,
    known: list[np.ndarray],
) -> Int[np.ndarray, "c l"]:
    """Numbers of the lanes of every cell, cells taken along a path of neighbours.

    `known` is the mean of every attractor where it was last seen.
    """
    label, first = np.full(points.shape[:2], -1), len(known)
    for cell in path:
        lanes = np.flatnonzero(good[cell])
        if not lanes.size:
            continue
        mine = points[cell, lanes]
        cluster = _clusters(mine, within)
        means = np.stack([mine[cluster == k].mean(axis=0) for k in range(cluster.max() + 1)])
        names = np.full(len(means), -1)
        if known:
            away = np.linalg.norm(means[:, None] - np.stack(known), axis=-1)
            # No match is dearer than any that counts, and all that do not cost the same.
            for row, column in zip(*linear_sum_assignment(np.minimum(away, apart)), strict=True):
                if away[row, column] < apart:
                    names[row] = column
        for number, mean in enumerate(means):
            if names[number] < 0:
                names[number] = len(known)
                known.append(mean)
            known[names[number]] = mean
        label[cell, lanes] = names[cluster]
    sizes = np.bincount(label[label >= 0], minlength=len(known))
    rank = np.append(np.arange(len(known)), -1)
    rank[first + np.argsort(-sizes[first:], kind="stable")] = np.arange(first, len(known))
    return rank[label]


def _means(like: xr.Dataset, features: Sequence[str]) -> list[list[float]]:
    """Of the attractors that another data set knows."""
    if "attractor" not in like or like["attractor"].attrs["features"] != list(features):
        raise ValueError("`like` must be an answer of `attractors` by the same `features`.")
    return like["attractor"].attrs["means"]


def _clusters(points: Float[np.ndarray, "l f"], within: float) -> Int[np.ndarray, " l"]:
    """Which points are joined by steps of at most `within`."""
    pairs = KDTree(points).query_pairs(within, output_type="ndarray")
    joined = coo_matrix((np.ones(len(pairs)), pairs.T), shape=(len(points), len(points)))
    return connected_components(joined, directed=False)[1]


def _serpentine(shape: Sequence[int]) -> list[int]:
    """Cells of a grid in an order in which each is a neighbour of the one before."""
    path = []
    for index in np.ndindex(*shape):
        turned, rank = [], 0
        for at, size in zip(index, shape, strict=True):
            turned.append(size - 1 - at if rank % 2 else at)
            rank = rank * size + at
        path.append(int(np.ravel_multi_index(turned, shape)) if len(shape) else 0)
    return path
