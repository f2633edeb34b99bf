"""Harmonics: the full spectrum of a periodic motion, forward and backward whirl apart."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes

from . import colours, labels, page
from .record import signal


DECADES = 8  # below the largest amplitude: what is smaller is not drawn


def harmonics(result: Any, ax: Axes | None = None, *, station: int = 0) -> Axes:
    """Radius of every circle that a motion is the sum of, against its whirl speed over that of the rotor.

    Args:
        result: `jaxrotor.HarmonicOrbit`.
        ax: Axes to draw in; a new figure if None.
        station: which of the result's stations.

    Returns:
        The Axes, amplitude [mm] on a logarithmic scale over the order of whirl, backward left of zero.
    """
    ax = page.single(ax, 120, 75)
    orders = np.asarray(result.orders)
    amplitude = np.abs(signal(result, "coefficients", station))
    largest = float(amplitude.max(initial=0.0))
    if not largest > 0:
        raise ValueError("This orbit is at rest in the centre, so it has no harmonics to draw.")
    factor, unit = labels.length(largest)
    floor = factor * largest * 10.0**-DECADES
    for chosen, colour, name in (
        (orders > 0, colours.FORWARD, "forward"),
        (orders < 0, colours.BACKWARD, "backward"),
        (orders == 0, colours.UNDEFINED, "mean"),
    ):
        drawn = chosen & (factor * amplitude > floor)
        if drawn.any():
            heights = factor * amplitude[drawn]
            ax.vlines(orders[drawn], floor, heights, color=colour, linewidth=1.2)
            ax.plot(orders[drawn], heights, "o", color=colour, markersize=3.5, label=name)
    ax.set_yscale("log")
    ax.set_ylim(floor, 3 * factor * largest)
    ax.set_xlim(1.05 * orders[0], 1.05 * orders[-1])
    ax.set_xlabel("order of whirl [1]")
    ax.set_ylabel(f"amplitude [{unit}]")
    page.legend(ax, columns=3)
    page.assumption(ax, result.scene)
    return ax
