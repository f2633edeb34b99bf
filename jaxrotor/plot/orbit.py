"""Orbit: the path of the shaft's centre in the plane of whirl, and the stops around it."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes

from ..effects import Limiter
from . import colours, page
from .record import once_a_turn, signal


def orbit(response: Any, station: int = 0, ax: Axes | None = None) -> Axes:
    """Orbit at one station, red points once a revolution, and the limiters there.

    A limiter is the line that the centre of the shaft touches when the rim touches the stop, drawn
    to scale. Azarov, Gouskov, Panovko (2023), Fig. 4b.

    Args:
        response: one simulation, with `displacement` [m], `angle`, `stations`, `scene`.
        station: which of the response's stations.
        ax: Axes to draw in; a new figure if None.
    """
    path = 1e3 * signal(response, "displacement", station)
    points = path[once_a_turn(response)]
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
    """A tangent at each limiter's gap and angle, in `factor` of m; `radius` scales those without a gap."""
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
