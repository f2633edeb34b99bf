"""Tuning: loss and parameters against steps."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes

from . import colours, page
from .labels import parameter, words


def tuning(result: Any, axes: Any = None) -> tuple[Axes, Axes]:
    """Loss above and parameters below, against steps; all starts in grey, the best one in colour.

    Positive losses that span two decades are drawn on a logarithmic axis. Several parameters are each
    scaled from 0 to 1 over their range, which is in the legend. A dot marks the best step; a cross marks
    the end of a start whose loss became infinite or NaN.

    Args:
        result: result of `jaxrotor.tune`.
        axes: two Axes, upper and lower; a new figure if None.

    Returns:
        The upper Axes, loss, and the lower, parameters.

    Raises:
        ValueError: `axes` are not two.
    """
    first, second = page.pair(axes, 170, 110)
    loss, values = result.history.loss, result.history.values
    steps = np.arange(loss.shape[1])
    best = int(np.nanargmin(np.abs(loss[result.start] - float(result.loss))))
    for start in [i for i in range(len(loss)) if i != result.start] + [result.start]:
        chosen = start == result.start
        colour = colours.BLUE if chosen else "0.75"
        first.plot(steps, loss[start], color=colour, linewidth=1.2 if chosen else 0.7)
        if "not finite" in result.reasons[start]:
            last = np.flatnonzero(np.isfinite(loss[start]))[-1:]
            first.plot(last, loss[start][last], "x", color=colours.RED, markersize=4)
    first.plot(best, loss[result.start][best], "o", color=colours.BLUE, markersize=4)
    if np.nanmin(loss) > 0 and np.nanmax(loss) > 100 * np.nanmin(loss):
        first.set_yscale("log")
    first.set_ylabel("loss")
    several = len(values) > 1
    for (path, rows), colour in zip(values.items(), _cycle(len(values)), strict=True):
        factor, label = parameter(words(path), result.scene.unit(path))
        low, high = np.nanmin(rows) * factor, np.nanmax(rows) * factor
        shown = rows * factor
        if several:
            shown = (shown - low) / (high - low if high > low else 1.0)
            label = f"{label} {low:.4g} to {high:.4g}"
        for start, row in enumerate(shown):
            if start != result.start:
                second.plot(steps, row, color=colour, linewidth=0.5, alpha=0.35)
        second.plot(steps, shown[result.start], color=colour, linewidth=1.2, label=label)
        second.plot(best, shown[result.start][best], "o", color=colour, markersize=4)
        if not several:
            second.set_ylabel(label)
    if several:
        second.set_ylabel("share of the range [1]")
        page.legend(second, 2)
    second.set_xlabel("steps [1]")
    for ax in (first, second):
        ax.margins(x=0.02)
    return first, second


def _cycle(count: int) -> list[str]:
    return [colours.CYCLE[i % len(colours.CYCLE)] for i in range(count)]
