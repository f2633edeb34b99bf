"""Orbit: path of the shaft's centre in the plane of whirl, and the limiters around it."""

from typing import Any

import numpy as np
from jaxtyping import Complex
from matplotlib.axes import Axes

from ..effects import AnnularStator, Limiter
from ..effects.rub import AbstractRub
from . import colours, page
from .record import once_per_revolution, signal


def orbit(response: Any, station: int = 0, ax: Axes | None = None) -> Axes:
    """Orbit at one station, with a red point once per revolution, and the limiters there.

    A limiter is drawn to scale, as the line that the centre of the shaft reaches when the rim touches the
    stop, and a ring as the circle of its clearance.

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


def limiters_at(response: Any, station: int) -> list[AbstractRub]:
    """Limiters and rings of the scene at a station of the response."""
    at = float(np.asarray(response.stations)[station])
    return [s for s in response.scene.of(AbstractRub) if np.isclose(float(s.at), at, rtol=1e-9)]


def draw_limiters(ax: Axes, response: Any, station: int, radius: float, factor: float) -> None:
    """Draw a tangent at each limiter's gap and angle, and a circle for a ring, scaled by `factor` from m.

    The length of a tangent follows the gap, but is at least a quarter of `radius`.
    """
    named = set()
    for stop in limiters_at(response, station):
        if isinstance(stop, AnnularStator):
            path, name = factor * clearance_circle(stop), "ring"
        else:
            assert isinstance(stop, Limiter)
            gap, outward = factor * float(stop.gap), np.exp(1j * float(stop.angle))
            half = 0.25 * max(gap, 0.5 * radius)
            path, name = outward * (gap + half * np.array([-1j, 1j])), "limiter"
        ax.plot(
            path.real,
            path.imag,
            color=colours.ORANGE,
            linewidth=2.5,
            solid_capstyle="butt",
            label=None if name in named else name,
        )
        named.add(name)


def clearance_circle(ring: AnnularStator) -> Complex[np.ndarray, " c"]:
    """Path [m] of the shaft's centre along which the rim touches the ring."""
    around = np.exp(1j * np.linspace(0.0, 2 * np.pi, 181))
    centre = float(ring.offset) * np.exp(1j * float(ring.angle))
    return centre + float(ring.gap) * around
