"""Attractors: map of the final motion over two parameters."""

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, ListedColormap

from . import colours, page
from .labels import coordinate, swept, words


def attractors(dataset: xr.Dataset, ax: Axes | None = None) -> Axes:
    """Basins of attraction: the attractor of every lane over two swept parameters, as colour.

    The legend names the mean of the first feature of each; failed lanes are white.

    Args:
        dataset: result of `jaxrotor.attractors` over two dimensions; the first is drawn to the right.
        ax: Axes to draw in; a new figure if None.

    Returns:
        The Axes, both parameters.

    Raises:
        ValueError: the dataset has no `attractor`, or not two swept dimensions.
    """
    if "attractor" not in dataset:
        raise ValueError(
            "The dataset has no `attractor`; call `jaxrotor.attractors(dataset)` first."
        )
    dims = swept(dataset, "attractor")
    if len(dims) != 2:
        named = ", ".join(f"'{dim}'" for dim in dims) or "none"
        raise ValueError(
            f"This plot takes two swept dimensions, but `attractor` has {named}; select the others with "
            "`.sel` or `.isel`."
        )
    (x, x_label), (y, y_label) = (coordinate(dataset, dim) for dim in dims)
    about = dataset["attractor"].attrs
    count = len(about["means"])
    shades = colours.shades(count)
    ax = page.single(ax, 120, 90)
    norm = BoundaryNorm(np.arange(-1.5, count), count + 1)
    number = dataset["attractor"].transpose(*dims).values.T
    ax.pcolormesh(x, y, number, cmap=ListedColormap(["white", *shades]), norm=norm, rasterized=True)
    ax.set_xlabel(x_label)
    ax.set_ylabel(y_label)
    name = words(about["features"][0])
    means = [mean[0] for mean in about["means"]]
    rounding = 1e-4 * max(map(abs, means), default=0.0)  # digits below are those of a short run
    for shade, mean in zip(shades, means, strict=True):
        ax.fill([], [], color=shade, label=f"{name} {mean if abs(mean) > rounding else 0.0:.3g}")
    if (number < 0).any():
        ax.fill([], [], facecolor="white", edgecolor=colours.GREY, label="failed")
    page.legend(ax, columns=3)
    return ax
