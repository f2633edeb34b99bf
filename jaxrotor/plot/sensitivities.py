"""Sensitivities: Sobol indices of every parameter as bars with their bounds."""

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from . import colours, page


def sensitivities(dataset: xr.Dataset, ax: Axes | None = None) -> Axes:
    """Share of the variance that each parameter makes, alone and with interactions.

    Whiskers are the bounds of the data set.

    Args:
        dataset: result of `jaxrotor.sensitivities`.
        ax: Axes to draw in; a new figure if None.

    Returns:
        The Axes, the most important parameter at the top.

    Raises:
        ValueError: the dataset has no `first` and `total`.
    """
    if not {"first", "total"} <= set(dataset):
        raise ValueError(
            "The dataset has no `first` and `total`; call `jaxrotor.sensitivities` first."
        )
    dataset = dataset.sortby("total")
    places = np.arange(dataset.sizes["path"])
    ax = page.single(ax, 120, 20 + 12 * len(places))
    for name, label, shift, colour in (
        ("total", "with interactions", -0.18, colours.ORANGE),
        ("first", "alone", 0.18, colours.BLUE),
    ):
        value = dataset[name].values
        ends = (value - dataset[f"{name}_low"].values, dataset[f"{name}_high"].values - value)
        ax.barh(
            places + shift,
            value,
            height=0.34,
            color=colour,
            label=label,
            xerr=np.clip(ends, 0.0, None),
            error_kw={"elinewidth": 0.8, "capsize": 2},
        )
    ax.set_yticks(places, dataset["path"].values)
    ax.set_xlabel("share of the variance [1]")
    ax.axvline(0.0, color=colours.GREY, linewidth=0.6)
    page.legend(ax, columns=2)
    return ax
