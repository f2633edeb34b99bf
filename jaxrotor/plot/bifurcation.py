"""Bifurcation diagram: extrema of the displacement, and direction of whirl."""

from typing import Any

import numpy as np
import xarray as xr
from jaxtyping import Float
from matplotlib.axes import Axes

from ..core.outcome import failed
from . import colours, page
from .labels import coordinate, ensemble, only_swept, words


def bifurcation(
    dataset: xr.Dataset, axes: Any = None, *, section: bool = False, size: float | int = 1
) -> tuple[Axes, Axes]:
    """Local extrema of the x displacement, and the precession index below, over one parameter.

    Colours are those of the attractors if the data set has them (`jaxrotor.attractors`). Otherwise they
    mark forward whirl (index > 0), backward whirl (< 0) and undefined whirl (NaN: at rest in the
    centre; 0: no net whirl). Several starts are drawn over each other, as are the branches up and down,
    which have different markers in the lower Axes.

    Args:
        dataset: result of a sweep over one parameter, and any starts or a `branch`, with `extrema` [m] and
            `index` [1].
        axes: two Axes, upper and lower; a new figure if None.
        section: draw x once per revolution (`section` [m]) instead of its extrema.
        size: marker size of the points [pt].

    Returns:
        The upper Axes, displacement [mm], and the lower, precession index [1].

    Raises:
        ValueError: a variable is missing, it is not over one swept parameter, or both are not over
            the same one.

    Source: Azarov, Gouskov, Panovko (2023), Fig. 3.
    """
    name, own = (
        ("section", ("revolution", "axis")) if section else ("extrema", ("revolution", "extremum"))
    )
    others = ensemble(dataset, name, own)
    dim = only_swept(dataset, name, (*own, *others))
    if only_swept(dataset, "index", others) != dim:
        raise ValueError(
            f"`{name}` and `index` must be over the same swept dimension, but are over '{dim}' and "
            f"'{only_swept(dataset, 'index', others)}'."
        )
    lanes = (dim, *others)
    array = dataset[name].isel(axis=0) if section else dataset[name]
    index = dataset["index"].transpose(*lanes).values
    displacement = 1e3 * array.transpose(*lanes, ...).values.reshape(index.size, -1)
    values, label = coordinate(dataset, dim)
    values = np.repeat(values, index.size // len(values))
    if "status" in dataset:  # failed lanes are not drawn
        displacement[failed(dataset["status"].transpose(*lanes)).ravel()] = np.nan

    upper, lower = page.pair(axes, 170, 110)
    ways = {".": np.ones(index.size, bool)}
    if "branch" in lanes:
        branch = np.indices(index.shape)[lanes.index("branch")].ravel()
        ways = {marker: branch == k for k, marker in enumerate("^v")}
        for marker, name in zip("^v", dataset["branch"].values, strict=True):
            upper.plot([], [], marker, color=colours.DARK, label=f"below: {name}")
    for about, colour, chosen in coloured_groups(dataset, lanes):
        x, y = _cloud(values[chosen], displacement[chosen])
        style = {"linestyle": "none", "marker": ".", "markeredgewidth": 0.0, "color": colour}
        upper.plot(x, y, markersize=size, rasterized=x.size > page.RASTER, label=about, **style)
        for marker, belongs in ways.items():
            some = chosen & belongs
            marked: Any = style | {"marker": marker}
            lower.plot(values[some], index.ravel()[some], markersize=3.0, **marked)
    for ax in (upper, lower):
        ax.margins(x=0.01)
    page.zero(lower)
    what = "once a revolution" if section else "local extrema"
    upper.set_ylabel(f"x displacement,\n{what} [mm]")
    lower.set_ylabel("precession index\n" r"mean of $\dot\psi/\Omega$ [1]")
    lower.set_xlabel(label)
    about = dataset["index"].attrs
    if "error" in about:
        text = (
            f"twice the steps: {about['error_median']:.0e} (median), {about['error']:.0e} (largest)"
        )
        style = {"fontsize": page.TEXT - 1, "color": "0.35", "ha": "right"}
        lower.annotate(text, (0.99, 0.04), xycoords="axes fraction", **style)
    page.legend(upper, columns=3)
    return upper, lower


def coloured_groups(
    dataset: xr.Dataset, lanes: tuple[str, ...]
) -> list[tuple[str, str, np.ndarray]]:
    """Name, colour and lanes of each attractor, or of each direction of whirl where none are known."""
    if "attractor" in dataset:
        return _attractors(dataset["attractor"].transpose(*lanes))
    return _directions(dataset["index"].transpose(*lanes).values.ravel())


def _attractors(numbers: xr.DataArray) -> list[tuple[str, str, np.ndarray]]:
    """Name, colour and lanes of each attractor."""
    name, means = words(numbers.attrs["features"][0]), numbers.attrs["means"]
    found, shades = numbers.values.ravel(), colours.shades(len(means))
    return [
        (f"{name} {mean[0]:.3g}", shades[k], found == k)
        for k, mean in enumerate(means)
        if (found == k).any()
    ]


def _directions(index: np.ndarray) -> list[tuple[str, str, np.ndarray]]:
    """Name, colour and lanes of each direction of whirl that occurs."""
    found = [
        ("forward whirl", colours.FORWARD, index > 0),
        ("backward whirl", colours.BACKWARD, index < 0),
        ("undefined", colours.UNDEFINED, ~(index > 0) & ~(index < 0)),
    ]
    return [row for row in found if row[2].any()]


def _cloud(
    values: np.ndarray, displacement: Float[np.ndarray, "N e"]
) -> tuple[np.ndarray, np.ndarray]:
    """All points of the lanes, without the padding."""
    x = np.repeat(values, displacement.shape[1])
    y = displacement.ravel()
    return x[np.isfinite(y)], y[np.isfinite(y)]
