"""Error map: error of an approximation over two parameters, and where it is not valid."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm

from . import colours, page


def error_map(
    x: Any,
    y: Any,
    error: Any,
    valid: Any,
    ax: Axes | None = None,
    *,
    x_label: str = r"spin speed / second frequency $\Omega/\lambda_2$ [1]",
    y_label: str = r"polar / diametral inertia $I_0/I$ [1]",
    label: str = "relative error [1]",
    marked: Sequence[float] = (0.01, 0.05),
) -> Axes:
    """Relative error as colour by decades, hatched where the approximation is not valid.

    Args:
        x: (a,) horizontal parameter, by default the speed over the second frequency at rest.
        y: (b,) vertical parameter, by default the polar over the diametral inertia.
        error: (a, b) relative error, not negative.
        valid: (a, b) whether the approximation is valid.
        ax: Axes to draw in; a new figure if None.
        x_label: label of the horizontal axis.
        y_label: label of the vertical axis.
        label: label of the colours.
        marked: errors drawn as contour lines.

    Returns:
        The Axes, both parameters.

    Raises:
        ValueError: no error is above zero.
    """
    x, y, valid = np.asarray(x), np.asarray(y), np.asarray(valid, bool).T
    error = np.asarray(error, float).T
    positive = error[np.isfinite(error) & (error > 0)]
    if not positive.size:
        raise ValueError(
            "An error map needs an error above zero, but all are zero or undefined; check `error`."
        )
    low, high = np.floor(np.log10(positive.min())), np.ceil(np.log10(positive.max()))
    levels = 10.0 ** np.arange(max(low, high - 6), max(high, low + 1) + 1)
    ax = page.single(ax, 120, 85)
    norm = LogNorm(levels[0], levels[-1])
    mesh = ax.contourf(x, y, np.maximum(error, levels[0]), levels, norm=norm, cmap=colours.RAMP)
    page.colour_bar(ax, mesh, label)
    inside = [mark for mark in marked if positive.min() < mark < positive.max()]
    if inside:
        lines = ax.contour(x, y, error, inside, colors=colours.DARK, linewidths=1.0)
        ax.clabel(lines, fmt=lambda mark: f"{100 * mark:g} %", fontsize=page.TEXT)
    if not valid.all():
        ax.contourf(x, y, ~valid, [0.5, 1.5], colors="none", hatches=["///"])
        ax.contour(x, y, ~valid, [0.5], colors=colours.BLUE, linewidths=1.2)
    ax.set_xlabel(x_label)
    ax.set_ylabel(y_label)
    return ax
