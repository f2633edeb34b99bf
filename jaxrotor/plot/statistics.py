"""Statistics: survival of an ensemble, Sobol indices, and Lyapunov exponents, with their errors."""

from typing import Any

import matplotlib
import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from . import colours, labels, page


_MOST = 8  # largest number of survival curves drawn


def escapes(dataset: xr.Dataset, axes: Any = None) -> tuple[Axes, Axes]:
    """Survival against revolutions for up to 8 values of a parameter, and rate against the parameter.

    Bands and bars are the bounds of the data set. Where no lane escaped there is only an upper bound,
    drawn as a triangle.

    Args:
        dataset: result of `jaxrotor.escapes` over one parameter.
        axes: two Axes, left and right; a new figure if None.

    Returns:
        The left Axes, survival [1], and the right, rate [1/revolution].
    """
    dim = labels.only_swept(dataset, "rate")
    values, label = labels.coordinate(dataset, dim)
    left, right = page.pair(axes, 170, 75, beside=True)
    revolution = dataset["revolution"].values
    chosen = np.unique(np.linspace(0, len(values) - 1, min(_MOST, len(values))).astype(int))
    shades = matplotlib.colormaps["viridis"](np.linspace(0.0, 0.85, len(chosen)))
    for number, shade in zip(chosen, shades, strict=True):
        one = dataset.isel({dim: number})
        bounds = one["survival_low"], one["survival_high"]
        left.fill_between(revolution, *bounds, color=shade, alpha=0.25, linewidth=0)
        left.plot(revolution, one["survival"], color=shade, lw=1.0, label=f"{values[number]:.3g}")
    low = float(dataset["survival"].where(dataset["survival"] > 0).min())
    left.set(yscale="log", ylim=(min(0.5, 0.7 * low), 1.1), xlim=(0, revolution[-1]))

    rate, low, high = (dataset[f"rate{end}"].values for end in ("", "_low", "_high"))
    seen = rate > 0
    bars = np.stack([rate - low, high - rate])[:, seen]
    name = f"rate, {dataset.attrs['confidence']:.0%} bounds"
    style: Any = {"color": colours.BLUE, "markersize": 3.0, "linewidth": 0.8, "capsize": 1.5}
    right.errorbar(values[seen], rate[seen], bars, fmt="o", label=name, **style)
    if not seen.all():
        style = {"color": colours.GREY, "markersize": 3.0, "label": "upper bound only"}
        right.plot(values[~seen], high[~seen], "v", **style)
    right.set_yscale("log")
    page.finish(left, "revolutions [1]", "surviving share [1]", columns=4)
    named: Any = left.get_legend()
    named.set_title(label)
    named.get_title().set_fontsize(page.TEXT)
    page.finish(right, label, "rate of escape [1/revolution]", columns=2)
    return left, right


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
        value, low, high = (dataset[f"{name}{end}"].values for end in ("", "_low", "_high"))
        whiskers: Any = {"xerr": np.clip((value - low, high - value), 0.0, None)}
        whiskers["error_kw"] = {"elinewidth": 0.8, "capsize": 2}
        ax.barh(places + shift, value, height=0.34, color=colour, label=label, **whiskers)
    ax.set_yticks(places, dataset["path"].values)
    ax.axvline(0.0, color=colours.GREY, linewidth=0.6)
    return page.finish(ax, "share of the variance [1]", columns=2)


def lyapunov(result: Any, ax: Axes | None = None) -> Axes:
    """Mean growth up to every revolution, and the exponents (dashed) with their standard errors.

    Exponents are means with a smooth weight, so a curve need not end on its line.

    Args:
        result: `jaxrotor.Lyapunov`.
        ax: Axes to draw in; a new figure if None.

    Returns:
        The Axes, growth [1/s] over revolutions.
    """
    ax = page.single(ax, 120, 75)
    running = np.asarray(result.running)
    count = np.arange(1, len(running) + 1)
    pairs = zip(np.asarray(result.exponents), np.asarray(result.error), strict=True)
    for number, (rate, error) in enumerate(pairs):
        colour = colours.cycled(number)
        page.curve(ax, [0, len(running)], [rate, rate], colour, width=0.8, linestyle="--")
        label = f"$\\lambda_{{{number + 1}}}$ = {rate:.3g} $\\pm$ {error:.1g}"
        ax.axhspan(rate - error, rate + error, color=colour, alpha=0.25, linewidth=0)
        page.curve(ax, count, running[:, number], colour, label, 1.0)
    ax.axhline(0.0, color=colours.GREY, linewidth=0.8)
    # Growth over the first revolutions varies far more than the exponents differ, so it is cut off.
    late = running[len(running) // 20 :]
    low, high = min(late.min(), 0.0), max(late.max(), 0.0)
    margin = 0.05 * (high - low)
    ax.set(xlim=(0, len(running)), ylim=(low - margin, high + margin))
    label = "mean growth of a disturbance [1/s]"
    return page.finish(ax, "revolutions [1]", label, columns=3, scene=result.scene)
