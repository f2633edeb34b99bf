"""Envelope: largest radius along a run, over a swept parameter, as a map."""

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from ..core.outcome import failed
from . import page
from .labels import coordinate, length, only_swept, parameter


def envelope(dataset: xr.Dataset, ax: Axes | None = None) -> Axes:
    """Largest radius of every window of a run, over one swept parameter, as colours.

    Across is the speed where all lanes have the same and it rises or falls throughout, else the time.
    A window ends at the time or speed that the dataset has of it, and begins where the one before it
    ends. The first is as long as the second, but begins at zero if zero lies within. Lanes without a
    result are grey.

    Args:
        dataset: sweep along `times` over one parameter, with `envelope`.
        ax: Axes to draw in; a new figure if None.

    Returns:
        The Axes, the parameter over speed or time [s].

    Raises:
        ValueError: the dataset has no `envelope`, is not over one parameter, or has too little to draw.
    """
    dim = only_swept(dataset, "envelope", ("window",))
    dataset = dataset[["envelope", "speed", "status"]].sortby(dim)
    lost = failed(dataset["status"].values)[:, None]
    radius = np.where(lost, np.nan, dataset["envelope"].transpose(dim, "window").values)
    if min(radius.shape) < 2:
        raise ValueError(
            f"An envelope needs two lanes and two windows to draw, but has {radius.shape[0]} and "
            f"{radius.shape[1]}."
        )
    speed = dataset["speed"].transpose(dim, "window").values
    changes = np.diff(speed[0])
    if np.allclose(speed, speed[0]) and (np.all(changes > 0) or np.all(changes < 0)):
        turns, label = parameter("speed", "rad/s")
        across = turns * speed[0]
    else:
        across, label = dataset["window"].values, "time [s]"
    first = 2 * across[0] - across[1]
    if first * across[0] < -1e-9 * first**2:  # zero lies within by more than rounding
        first = 0.0
    values, name = coordinate(dataset, dim)
    factor, unit = length(float(np.max(radius, initial=0.0, where=~np.isnan(radius))))

    ax = page.single(ax, 170, 90)
    mesh = ax.pcolormesh(
        np.append(first, across),
        page.ends_of_cells(values),
        factor * radius,
        cmap="viridis",
        shading="flat",
        rasterized=True,
    )
    ax.set_facecolor("0.8")
    page.colour_bar(ax, mesh, f"largest radius [{unit}]")
    ax.set_xlabel(label)
    ax.set_ylabel(name)
    return ax
