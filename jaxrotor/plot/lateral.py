"""Lateral analysis: undamped critical speed map, deflected shapes, and Level I stability."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from ..analysis.lateral import CaseResponse, CriticalMap, LevelOne, ratio_limit
from ..analysis.lateral.damped_response import SHARE
from ..analysis.lateral.level_one import DECREMENT
from ..files.machine import Clearance
from . import colours, page
from .marks import BEYOND
from .units import length_unit, speed_unit


_DASHES = "-", "--"  # of the direct stiffnesses of a bearing along x and y


def critical_map(
    result: CriticalMap,
    ax: Axes | None = None,
    operating: tuple[float | int, float | int] | None = None,
) -> Axes:
    """Forward critical speeds over the stiffness of the bearings, and the bearings' own over it.

    Where a curve of a bearing crosses a branch, the undamped rotor is critical.

    Args:
        result: result of `jaxrotor.critical_map`.
        ax: Axes to draw in; a new figure if None.
        operating: slowest and fastest operating speed [rad/s], shaded.

    Returns:
        The Axes, both of its axes logarithmic.

    Source: API RP 684 (2005), 2.3.
    """
    ax = page.single(ax, 170, 95)
    turns, unit = speed_unit()
    for number, branch in enumerate(turns * result.speeds.T, 1):
        page.curve(ax, result.stiffnesses, branch, colours.BLUE, page.once(ax, "critical speeds"))
        inside: Any = {"xytext": (-4, 2), "textcoords": "offset points", "ha": "right"}
        ax.annotate(str(number), (result.stiffnesses[-1], branch[-1]), fontsize=page.TEXT, **inside)
    alike = np.allclose(result.own[:, :1], result.own)
    bearings = zip(result.bearings.tolist(), np.moveaxis(result.own, 1, 0), strict=True)
    for number, (at, bearing) in enumerate(list(bearings)[: 1 if alike else None], 1):
        own = [bearing[:, 0]] if np.allclose(*bearing.T) else list(bearing.T)
        for axis, dashes, stiffness in zip("xy", _DASHES, own, strict=False):
            where = "" if len(own) == 1 else f", k{axis}{axis}"
            name = f"bearings{where}" if alike else f"bearing at {at:g} m{where}"
            colour, speeds = colours.cycled(number), turns * result.own_speeds
            page.curve(ax, stiffness, speeds, colour, name, linestyle=dashes)
    ax.set_xscale("log")
    ax.set_yscale("log")
    ax.set_xlim(result.stiffnesses[0], result.stiffnesses[-1])
    if operating is not None:
        low, high = (turns * abs(end) for end in operating)
        ax.axhspan(low, high, color=colours.TEAL, alpha=0.2, linewidth=0, label="running range")
    name = f"critical speed [{unit}]"
    return page.finish(ax, "stiffness of every bearing [N/m]", name, columns=3)


def deflected_shapes(
    result: CaseResponse, ax: Axes | None = None, clearances: Sequence[Clearance] = ()
) -> Axes:
    """Scaled response along the shaft at its peaks and at the rated speed, peak to peak, below clearances.

    Amplitudes are the major axes of the orbits times `result.scale`. A bar over the station of a close
    clearance goes from 75 % of it, which is its limit, to the whole; clearances far beyond all shapes are
    only named by the smallest. Shapes beyond the trip speed, where the limit does not apply, are dashed.

    Args:
        result: one of `cases` of a scene of `jaxrotor.lateral_analysis`.
        ax: Axes to draw in; a new figure if None.
        clearances: those of the machine.

    Returns:
        The Axes, displacement over the position.

    Source: API RP 684 (2005), SP6.8.2.12, SP6.8.2.13.
    """
    ax = page.single(ax, 170, 75)
    shapes, (turns, unit) = 2 * result.scale * np.asarray(result.shapes.major), speed_unit()
    spans = [float(one.diametral) for one in clearances]
    (lengths, along), (factor, across) = length_unit("m"), length_unit("\N{MICRO SIGN}m")
    stations = lengths * np.asarray(result.shapes.stations)
    speeds = np.abs(np.asarray(result.shapes.speeds)).tolist()
    kinds = ["peak"] * (len(speeds) - 1) + ["rated"]
    for number, (speed, kind, shape) in enumerate(zip(speeds, kinds, shapes, strict=True)):
        name, dashes = f"{kind}, {turns * speed:.0f} {unit}", "--" if speed > result.trip else "-"
        colour = colours.DARK if kind == "rated" else colours.cycled(number)
        page.curve(ax, stations, factor * shape, colour, name, linestyle=dashes)
    bar: Any = {"color": colours.ORANGE, "linewidth": 4.0}
    far = SHARE * min(spans, default=0.0) > BEYOND * shapes.max()
    if far:
        ax.plot([], [], label=f"clearance {factor * min(spans):.3g} {across}, beyond", **bar)
    for one, span in () if far else zip(clearances, spans, strict=True):
        at = lengths * float(one.at)
        label = page.once(ax, "clearance")
        ax.vlines(at, factor * SHARE * span, factor * span, label=label, **bar)
        away, side = (4, "left") if at < 0.7 * stations[-1] else (-4, "right")
        text: Any = {
            "textcoords": "offset points",
            "ha": side,
            "va": "top",
            "fontsize": page.TEXT - 1,
        }
        ax.annotate(one.label, (at, factor * span), (away, -2), **text)
    ax.margins(x=0)
    ax.set_ylim(bottom=0.0)
    return page.finish(
        ax, f"position along the shaft [{along}]", f"scaled, peak to peak [{across}]", columns=3
    )


def level_one(result: LevelOne, axes: Any = None) -> tuple[Axes, Axes]:
    """Logarithmic decrement over the cross-coupled stiffness, and the critical speed ratio over density.

    Marks are Q_A, the anticipated stiffness, and Q_0, at which the rotor becomes unstable. Beside it the
    regions A and B of the standard, with the machine where its gas density is known.

    Args:
        result: `stability` of a scene of `jaxrotor.lateral_analysis`.
        axes: two Axes beside each other; a new figure if None.

    Returns:
        The two Axes.

    Source: API RP 684 (2005), SP6.8.5.
    """
    left, right = page.pair(axes, 170, 75, beside=True)
    page.curve(left, 1e-6 * result.applied, result.decrements, colours.BLUE)
    page.zero(left)
    left.axhline(DECREMENT, color=colours.GREY, linewidth=0.8, linestyle=":")
    marks = (
        (result.anticipated, result.decrement, "Q_A", colours.ORANGE),
        (result.threshold, 0.0, "Q_0", colours.RED),
    )
    for stiffness, decrement, name, colour in marks:
        if 0 < stiffness <= result.applied[-1]:
            label = f"${name}$ = {1e-6 * stiffness:.3g} MN/m"
            left.plot(1e-6 * stiffness, decrement, "o", color=colour, markersize=4, label=label)
    page.finish(left, "cross-coupled stiffness [MN/m]", "logarithmic decrement", columns=2)
    known = np.isfinite(result.gas_density)
    densities = np.linspace(0.0, max(100.0, 1.2 * result.gas_density if known else 0.0), 401)
    limits = [ratio_limit(one) for one in densities.tolist()]
    top = 1.25 * max(3.2, result.critical_ratio)
    right.fill_between(densities, limits, top, color=colours.ORANGE, alpha=0.2, linewidth=0)
    for x, y, name in ((0.62, 0.9, "region B"), (0.06, 0.06, "region A")):
        right.text(x, y, name, transform=right.transAxes, fontsize=page.TEXT)
    if known:
        where = result.gas_density, result.critical_ratio
        right.plot(*where, "o", color=colours.BLUE, markersize=4, label="this machine")
    right.set_xlim(0.0, densities[-1])
    right.set_ylim(0.0, top)
    page.finish(right, "mean gas density [kg/m$^3$]", "critical speed ratio", columns=1)
    return left, right
