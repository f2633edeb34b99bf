"""Symbols of parts that have no size of their own in the drawing of a rotor."""

from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Polygon

from ..effects import (
    Coupling,
    Crack,
    JournalBearing,
    LinearMagneticBearing,
    MagneticBearing,
    OldhamCoupling,
    Seal,
    SqueezeFilm,
)
from . import colours, page


Outline = list[tuple[float, float]]  # closed if it ends where it begins, else a line


class Symbol(NamedTuple):
    """Outlines above the axis, in units of a size; the same are drawn below it."""

    label: str
    colour: str
    outlines: tuple[Outline, ...]  # x from the station, y from the surface of the shaft
    within: bool = False  # whether y is the share of the radius of the shaft

    @property
    def height(self) -> float:
        return max(y for outline in self.outlines for _, y in outline)


def _box(left: float, right: float, low: float, high: float) -> Outline:
    return [(left, low), (right, low), (right, high), (left, high), (left, low)]


def _teeth(count: int, low: float, high: float, base: float) -> Outline:
    """A ring of a seal: teeth to the shaft under a base."""
    x = np.linspace(-1.0, 1.0, 2 * count + 1)
    edge = list(zip(x.tolist(), [high, low] * count + [high], strict=True))
    return [*edge, (1.0, base), (-1.0, base), edge[0]]


_MAGNET = (_box(-1.2, 1.2, 1.3, 1.8), _box(-1.2, -0.5, 0.3, 1.3), _box(0.5, 1.2, 0.3, 1.3))
_HUBS = (_box(-0.9, -0.35, 0.0, 1.5), _box(0.35, 0.9, 0.0, 1.5))
_SPRING = [(-0.35, 1.0), (-0.2, 1.25), (0.0, 0.75), (0.2, 1.25), (0.35, 1.0)]
SYMBOLS: dict[type, Symbol] = {
    MagneticBearing: Symbol("magnetic bearing", colours.TEAL, _MAGNET),
    LinearMagneticBearing: Symbol("magnetic bearing", colours.TEAL, _MAGNET),
    JournalBearing: Symbol("journal bearing", colours.MAGENTA, (_box(-1.0, 1.0, 0.2, 0.8),)),
    SqueezeFilm: Symbol("squeeze film", colours.MAGENTA, (_box(-0.7, 0.7, 0.2, 0.5),)),
    Seal: Symbol("seal", colours.ORANGE, (_teeth(4, 0.25, 0.8, 1.2),)),
    Coupling: Symbol("coupling", colours.GREY, (*_HUBS, _SPRING)),
    OldhamCoupling: Symbol("floating disc", colours.GREY, (*_HUBS, _box(-0.25, 0.25, 0.0, 1.3))),
    Crack: Symbol(
        "crack", colours.RED, ([(0.15, 1.0), (-0.15, 0.6), (0.15, 0.3), (0.0, 0.0)],), within=True
    ),
}


def draw(ax: Axes, part: Any, at: float, radius: float, size: float) -> float:
    """Draw the symbol of a part at a station, on a shaft of a radius; returns how far it reaches."""
    symbol = SYMBOLS[type(part)]
    base, scale = (0.0, max(radius, size)) if symbol.within else (radius, size)
    for outline in symbol.outlines:
        x, heights = np.array(outline).T * np.array([[size], [scale]]) + [[at], [base]]
        for side in (1, -1):
            label, y = page.once(ax, symbol.label), side * heights
            if outline[0] == outline[-1]:
                style: Any = {"facecolor": symbol.colour, "alpha": 0.7, "zorder": 3.0}
                style |= {"edgecolor": colours.DARK, "linewidth": 0.6}
                ax.add_patch(Polygon(np.stack([x, y], axis=1), label=label, **style))
            else:
                colour = symbol.colour if symbol.within else colours.DARK
                page.curve(ax, x, y, colour, label, zorder=4.0)
    return base + symbol.height * scale


def draw_sensor(ax: Axes, at: float, radius: float, size: float) -> None:
    """Draw a sensor that points to the surface of the shaft, above it and below."""
    for side, marker in ((1, "v"), (-1, "^")):
        style: Any = {"color": colours.BLUE, "markersize": 4.0, "linestyle": "none", "zorder": 4.0}
        place = side * (radius + 0.6 * size)
        ax.plot([at], [place], marker, label=page.once(ax, "sensor"), **style)
