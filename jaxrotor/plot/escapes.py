"""Escapes: surviving share of an ensemble, and rate of escape."""

from typing import Any

import matplotlib
import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from . import colours, labels, page


MOST = 8  # largest number of survival curves drawn


def escapes(dataset: xr.Dataset, axes: Any = None) -> tuple[Axes, Axes]:
    """Survival against revolutions for up to 8 values of a parameter, and rate against the parameter.

    Bands and bars are the bounds of the data set. Where no lane escaped there is only an upper bound,
    drawn as a triangle.

    Args:
        dataset: result of `jaxrotor.escapes` over one parameter.
        axes: two Axes, left and right; a new figure if None.

    Returns:
        The left Axes, survival [1], and the right, rate [1/revolution].

    Raises:
        ValueError: the dataset has no `rate` or is not over one parameter, or `axes` are not two.
    """
    dim = labels.only_swept(dataset, "rate")
    values, label = labels.coordinate(dataset, dim)
    left, right = page.pair(axes, 170, 75, beside=True)
    revolution = dataset["revolution"].values
    chosen = np.unique(np.linspace(0, len(values) - 1, min(MOST, len(values))).astype(int))
    shades = matplotlib.colormaps["viridis"](np.linspace(0.0, 0.85, len(chosen)))
    for number, shade in zip(chosen, shades, strict=True):
        one = dataset.isel({dim: number})
        bounds = one["survival_low"], one["survival_high"]
        left.fill_between(revolution, *bounds, color=shade, alpha=0.25, linewidth=0)
        left.plot(revolution, one["survival"], color=shade, lw=1.0, label=f"{values[number]:.3g}")
    left.set_yscale("log")
    low = float(dataset["survival"].where(dataset["survival"] > 0).min())
    left.set_ylim(min(0.5, 0.7 * low), 1.1)
    left.set_xlim(0, revolution[-1])
    left.set_xlabel("revolutions [1]")
    left.set_ylabel("surviving share [1]")

    rate, low, high = (dataset[f"rate{end}"].values for end in ("", "_low", "_high"))
    seen = rate > 0
    bars = np.stack([rate - low, high - rate])[:, seen]
    style = {"color": colours.BLUE, "markersize": 3.0, "linewidth": 0.8, "capsize": 1.5}
    right.errorbar(
        values[seen],
        rate[seen],
        bars,
        fmt="o",
        label=f"rate, {dataset.attrs['confidence']:.0%} bounds",
        **style,
    )
    if not seen.all():
        right.plot(
            values[~seen], high[~seen], "v", color=colours.GREY, ms=3.0, label="upper bound only"
        )
    right.set_yscale("log")
    right.set_xlabel(label)
    right.set_ylabel("rate of escape [1/revolution]")
    page.legend(left, columns=4)
    named: Any = left.get_legend()
    named.set_title(label)
    named.get_title().set_fontsize(page.TEXT)
    page.legend(right, columns=2)
    return left, right
