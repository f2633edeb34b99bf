"""Harmonics: full spectrum of a periodic motion, with forward and backward whirl separate."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes

from . import colours, labels, page
from .record import signal


DECADES = 8  # range of amplitudes drawn, downwards from the largest


def harmonics(result: Any, ax: Axes | None = None, *, station: int = 0) -> Axes:
    """Amplitude of every harmonic `exp(i k Omega t)` of a motion against its order `k`.

    Args:
        result: `jaxrotor.HarmonicOrbit`.
        ax: Axes to draw in; a new figure if None.
        station: index of the station of the result.

    Returns:
        The Axes, amplitude on a logarithmic scale over the order of whirl, negative if backward.

    Raises:
        ValueError: the orbit is at rest in the centre, or the result has no such station.
    """
    ax = page.single(ax, 120, 75)
    orders = np.asarray(result.orders)
    amplitude = np.abs(signal(result, "coefficients", station))
    largest = float(amplitude.max(initial=0.0))
    if not largest > 0:
        raise ValueError(
            "This orbit is at rest in the centre, so it has no harmonics to draw; draw another orbit."
        )
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
