"""Orbit: path of the shaft's centre in the plane of whirl, and the limiters around it."""

from typing import Any

import numpy as np
from jaxtyping import Complex
from matplotlib.axes import Axes

from ..effects import AnnularStator, Limiter
from ..effects.rub import AbstractRub
from . import colours, labels, page
from .clearance import stops_at
from .record import once_per_revolution, signal
from .units import length_unit


def orbit(response: Any, station: int = 0, ax: Axes | None = None) -> Axes:
    """Orbit at one station, with a red point once per revolution, and the limiters there.

    A limiter is drawn to scale, as the line that the centre of the shaft reaches when the rim touches the
    stop, and a ring as the circle of its clearance.

    Args:
        response: one simulation, with `displacement` [m], `angle`, `stations`, `scene`.
        station: index of the station of the response.
        ax: Axes to draw in; a new figure if None.

    Returns:
        The Axes, x and y.

    Raises:
        ValueError: the response has no such station, or is of many lanes.

    Source: Azarov, Gouskov, Panovko (2023), Fig. 4b.
    """
    ax = page.single(ax, 85, 85)
    _draw_orbit(ax, response, station, *length_unit("mm"))
    page.legend(ax, columns=3)
    return ax


def orbits(response: Any, axes: Any = None) -> tuple[Axes, ...]:
    """Orbits at all stations of a response, a small picture each, with a red point once per revolution.

    Every picture has a scale of its own, and the limiters of its station, as `orbit` draws them.

    Args:
        response: one simulation, as for `orbit`.
        axes: as many Axes as there are stations; a new figure if None.

    Returns:
        The Axes by stations, x and y.

    Raises:
        ValueError: there are not as many `axes` as stations, or the response is of many lanes.
    """
    stations = np.asarray(response.stations, float)
    drawn = page.grid(axes, len(stations), 57, 62)
    lengths, name = length_unit("mm")
    largest = np.abs(np.asarray(response.displacement)).max(initial=0.0)
    factor, unit = labels.length(float(largest))
    for number, (ax, at) in enumerate(zip(drawn, stations.tolist(), strict=True)):
        _draw_orbit(ax, response, number, factor, unit)
        ax.set_title(f"at {lengths * at:.5g} {name}", fontsize=page.TEXT)
    handles = {}
    for ax in drawn:  # one legend names all that is drawn anywhere
        handles |= dict(zip(*ax.get_legend_handles_labels()[::-1], strict=True))
    figure: Any = drawn[0].figure
    style: Any = {"loc": "outside upper left"} if axes is None else {"loc": "upper left"}
    figure.legend(handles.values(), handles, ncols=3, fontsize=page.TEXT, frameon=False, **style)
    return drawn


def _draw_orbit(ax: Axes, response: Any, station: int, factor: float, unit: str) -> None:
    """Path, points and limiters of one station, in a unit: its factor from m, and its name."""
    path = factor * signal(response, "displacement", station)
    points = path[once_per_revolution(response)]
    many = path.size > page.RASTER
    style: Any = {"color": colours.GREY, "linewidth": 0.5, "rasterized": many}
    ax.plot(path.real, path.imag, label="orbit", **style)
    style = {"marker": ".", "markersize": 5.0, "markeredgewidth": 0.0, "color": colours.RED}
    ax.plot(points.real, points.imag, linestyle="none", label="once a revolution", **style)
    draw_limiters(ax, response, station, np.abs(path).max(initial=0.0), factor)
    ax.set_aspect("equal", adjustable="datalim")
    ax.set_xlabel(f"x displacement [{unit}]")
    ax.set_ylabel(f"y displacement [{unit}]")


def limiters_at(response: Any, station: int) -> list[AbstractRub]:
    """Limiters and rings of the scene at a station of the response."""
    at = float(np.asarray(response.stations)[station])
    return stops_at(response.scene, at)


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
