"""Lyapunov exponents: convergence of the mean growth of disturbances."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes

from . import colours, page


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
        colour = colours.CYCLE[number % len(colours.CYCLE)]
        ax.plot([0, len(running)], [rate, rate], color=colour, linewidth=0.8, linestyle="--")
        label = f"$\\lambda_{{{number + 1}}}$ = {rate:.3g} $\\pm$ {error:.1g}"
        ax.axhspan(rate - error, rate + error, color=colour, alpha=0.25, linewidth=0)
        ax.plot(count, running[:, number], color=colour, linewidth=1.0, label=label)
    ax.axhline(0.0, color=colours.GREY, linewidth=0.8)
    # Growth over the first revolutions varies far more than the exponents differ, so it is cut off.
    late = running[len(running) // 20 :]
    low, high = min(late.min(), 0.0), max(late.max(), 0.0)
    margin = 0.05 * (high - low)
    ax.set_ylim(low - margin, high + margin)
    ax.set_xlim(0, len(running))
    ax.set_xlabel("revolutions [1]")
    ax.set_ylabel("mean growth of a disturbance [1/s]")
    page.legend(ax, columns=3)
    page.assumption(ax, result.scene)
    return ax
