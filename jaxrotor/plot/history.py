"""History: motion of one station in time."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes

from . import colours, page
from .record import revolutions, signal
from .units import length_unit


def history(
    response: Any, station: int = 0, ax: Axes | None = None, *, slope: bool = False
) -> Axes:
    """Displacement x and y, or slope x' and y' [mrad], against time in revolutions.

    Args:
        response: one simulation, with `angle` and `displacement` [m] or `slope` [rad].
        station: index of the station of the response.
        ax: Axes to draw in; a new figure if None.
        slope: draw the slope of the shaft instead of the displacement.

    Returns:
        The Axes.

    Raises:
        ValueError: the response has no such station, or is of many lanes.

    Source: Azarov, Gouskov, Panovko (2023), Fig. 4a.
    """
    turns, motion = (
        revolutions(response),
        signal(response, "slope" if slope else "displacement", station),
    )
    ax = page.single(ax, 170, 60)
    factor, unit = (1e3, "mrad") if slope else length_unit("mm")
    names = ("x'", "y'") if slope else ("x", "y")
    for name, part, colour in zip(
        names, (np.real(motion), np.imag(motion)), (colours.BLUE, colours.ORANGE), strict=True
    ):
        ax.plot(
            turns,
            factor * part,
            color=colour,
            linewidth=0.8,
            rasterized=turns.size > page.RASTER,
            label=name,
        )
    ax.margins(x=0)
    ax.set_xlabel("time [revolutions]")
    ax.set_ylabel(f"{'slope' if slope else 'displacement'} [{unit}]")
    page.legend(ax, columns=2)
    return ax
