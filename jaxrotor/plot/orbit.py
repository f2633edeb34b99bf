"""Orbit: path of the shaft's centre in the plane of whirl, and the limiters around it."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes

from ..effects import Limiter
from . import colours, page
from .record import once_per_revolution, signal


def orbit(response: Any, station: int = 0, ax: Axes | None = None) -> Axes:
    """Orbit at one station, with a red point once per revolution, and the limiters there.

    A limiter is drawn to scale, as the line that the centre of the shaft reaches when the rim touches the
    stop.

    Args:
        response: one simulation, with `displacement` [m], `angle`, `stations`, `scene`.
        station: index of the station of the response.
        ax: Axes to draw in; a new figure if None.

    Returns:
        The Axes, x and y [mm].

    Raises:
        ValueError: the response has no such station, or is of many lanes.

    Source: Azarov, Gouskov, Panovko (2023), Fig. 4b.
    """
    path = 1e3 * signal(response, "displacement", station)
    points = path[once_per_revolution(response)]
    ax = page.single(ax, 85, 85)
    ax.plot(
        path.real,
        path.imag,
        color=colours.GREY,
        linewidth=0.5,
        rasterized=path.size > page.RASTER,
        label="orbit",
    )
    ax.plot(
        points.real,
        points.imag,
        linestyle="none",
        marker=".",
        markersize=4.0,
        markeredgewidth=0.0,
        color=colours.RED,
        label="once a revolution",
    )
    draw_limiters(ax, response, station, np.abs(path).max(initial=0.0), 1e3)
    ax.set_aspect("equal", adjustable="datalim")
    ax.set_xlabel("x displacement [mm]")
    ax.set_ylabel("y displacement [mm]")
    page.legend(ax, columns=3)
    return ax


def limiters_at(response: Any, station: int) -> list[Limiter]:
    """Limiters of the scene at a station of the response."""
    at = float(np.asarray(response.stations)[station])
    return [s for s in response.scene.of(Limiter) if np.isclose(float(s.at), at, rtol=1e-9)]


def draw_limiters(ax: Axes, response: Any, station: int, radius: float, factor: float) -> None:
    """Draw a tangent at each limiter's gap and angle, scaled by `factor` from m.

    Its length follows the gap, but is at least a quarter of `radius`.
    """
    for number, stop in enumerate(limiters_at(response, station)):
        gap, outward = factor * float(stop.gap), np.exp(1j * float(stop.angle))
        half = 0.25 * max(gap, 0.5 * radius)
        ends = outward * (gap + half * np.array([-1j, 1j]))
        ax.plot(
            ends.real,
            ends.imag,
            color=colours.ORANGE,
            linewidth=2.5,
            solid_capstyle="butt",
            label="limiter" if number == 0 else None,
        )
