"""Stability: maps and boundaries over two parameters, dry whirl, onsets, errors of an approximation."""

from collections.abc import Sequence
from typing import Any

import matplotlib
import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.ticker import MaxNLocator

from . import colours, labels, page
from .units import speed_unit


_CHARTED = {  # parameters of the ball balancer's groups
    "speed": r"speed $\omega/\omega_0$ [1]",
    "damping": r"damping of the mount $h_\alpha/(A\,\omega_0)$ [1]",
    "polar": "polar / transverse inertia $C/A$ [1]",
    "drag": "factor on the drag of balls [1]",
    "mass": "factor on the mass of balls [1]",
}
_WHIRLS = (  # of a map of dry whirl: name and colour
    ("none", "#FFFFFF"),
    ("unstable alone", "#DDDDDD"),
    ("rim rolls", "#99C9E5"),
    ("rim slips (whip)", "#F4B58C"),
    ("rolls or slips", "#99D6CF"),
)


def stability_map(result: Any, ax: Axes | None = None) -> Axes:
    """Growth rate where the rotor is unstable, as colour, and the boundaries of stability.

    Points where the growth rate is unknown (NaN) are hatched.

    Args:
        result: `jaxrotor.StabilityMap`.
        ax: Axes to draw in; a new figure if None.

    Returns:
        The Axes, both parameters.
    """
    ax = _shade(result, ax, "growth rate where unstable [1/s]")
    if len(result.boundaries) or np.isnan(np.asarray(result.growth)).any():
        page.legend(ax, columns=2)
    return ax


def stability_chart(chart: Any, ax: Axes | None = None) -> Axes:
    """Exact stability boundary of a balanced position, and that of the first approximation.

    The approximation of Filimonikhin, Goncharov (2011) predicts stability where `a11 < 0`; points where
    it is wrong are hatched.

    Args:
        chart: `jaxrotor.balancer.StabilityChart`; growth rates in units of the natural frequency.
        ax: Axes to draw in; a new figure if None.

    Returns:
        The Axes, both parameters.
    """
    ax = _shade(chart, ax, "growth rate where unstable [1]")
    x, y, a11 = (np.asarray(a, float) for a in (chart.x, chart.y, chart.a11))
    if a11.min() < 0 < a11.max():
        ax.contour(x, y, a11.T, [0.0], colors=colours.BLUE, linewidths=1.2, linestyles="--")
        ax.plot([], [], color=colours.BLUE, lw=1.2, ls="--", label="$a_{11} = 0$")
    if chart.misjudged.any():
        growth = np.asarray(chart.growth, float)
        parts = [part / np.abs(part).max() for part in (growth, -a11)]
        _hatch(ax, x, y, np.minimum(*parts).T, 0.0, 1.0)
        ax.fill([], [], fill=False, hatch="///", lw=0, label="$a_{11} < 0$ but unstable")
    return page.finish(ax, *(_CHARTED[name] for name in chart.paths), columns=3)


def boundary_family(results: Sequence[Any], names: Sequence[str], ax: Axes | None = None) -> Axes:
    """Boundaries of several maps over the same two parameters: sections of a boundary surface.

    Args:
        results: stability maps, each for one value of a third parameter.
        names: one label per map, as in `["k = 0", "k = 0.1"]`.
        ax: Axes to draw in; a new figure if None.

    Returns:
        The Axes, both parameters.

    Raises:
        ValueError: there is not one name per map, or the maps are over different parameters.
    """
    if not results or len(results) != len(names):
        raise ValueError(
            f"A family needs one name per map, but has {len(results)} maps and {len(names)} names."
        )
    if len({tuple(result.paths) for result in results}) != 1:
        raise ValueError("The maps of a family must be over the same two parameters.")
    (to_x, x_label), (to_y, y_label) = _parameters(results[0])
    ax = page.single(ax, 120, 85)
    shades = matplotlib.colormaps["viridis"](np.linspace(0.0, 0.85, len(results)))
    for result, name, shade in zip(results, names, shades, strict=True):
        _draw_boundaries(ax, result, (to_x, to_y), shade, name)
    ends = [(np.min(r.x), np.max(r.x), np.min(r.y), np.max(r.y)) for r in results]
    left, right, bottom, top = np.transpose(ends)
    ax.set_xlim(to_x * left.min(), to_x * right.max())
    ax.set_ylim(to_y * bottom.min(), to_y * top.max())
    return page.finish(ax, x_label, y_label, columns=4)


def dry_whirl(result: Any, ax: Axes | None = None) -> Axes:
    """Where a rim rolls or slips round its ring against the spin, over speed and friction.

    The line is the least friction of any such whirl.

    Args:
        result: `jaxrotor.DryWhirlMap`.
        ax: Axes to draw in; a new figure if None.

    Returns:
        The Axes, friction [1] over spin speed.
    """
    ax = page.single(ax, 120, 85)
    x, y = speed_unit()[0] * np.asarray(result.speeds), np.asarray(result.frictions)
    rolls, slips = np.asarray(result.rolls), np.asarray(result.slips)
    kinds = np.where(np.asarray(result.exists), 1, 0)
    kinds = np.where(rolls & slips, 4, np.where(slips, 3, np.where(rolls, 2, kinds)))
    page.shade_classes(ax, x, y, kinds.T, [colour for _, colour in _WHIRLS])
    for kind in np.unique(kinds):
        name, colour = _WHIRLS[kind]
        ax.fill([], [], facecolor=colour, edgecolor=colours.DARK, lw=0.4, label=name)
    page.curve(ax, x, np.asarray(result.least_friction), colours.DARK, "least friction", 1.3)
    ax.set(xlim=(x.min(), x.max()), ylim=(y.min(), y.max()))
    return page.finish(ax, labels.spin("spin speed", x), "friction [1]", columns=4)


def onset(
    x: Any,
    speeds: Any,
    frequencies: Any,
    axes: Any = None,
    *,
    x_label: str = "internal damping ratio [1]",
    speed_label: str = "onset speed [rad/s]",
    frequency_label: str = "whirl frequency at onset [rad/s]",
) -> tuple[Axes, Axes]:
    """Onset speed of instability, and the whirl frequency there, against a parameter.

    NaN (no onset) leaves a gap.

    Args:
        x: (N,) the parameter, by default a damping ratio [1].
        speeds: (N,) onset speed [rad/s].
        frequencies: (N,) whirl frequency at the onset [rad/s].
        axes: two Axes, left and right; a new figure if None.
        x_label: label of both horizontal axes.
        speed_label: label of the speeds.
        frequency_label: label of the frequencies.

    Returns:
        The Axes of the speeds and of the frequencies.

    Source: Azarov, Gouskov, Panovko (2023), Fig. 2.
    """
    left, right = page.pair(axes, 170, 65, beside=True)
    points = {"marker": "o", "markersize": 3.0}
    page.curve(left, np.asarray(x), np.asarray(speeds), colours.BLUE, **points)
    page.curve(right, np.asarray(x), np.asarray(frequencies), colours.ORANGE, **points)
    return page.finish(left, x_label, speed_label), page.finish(right, x_label, frequency_label)


def error_map(
    x: Any,
    y: Any,
    error: Any,
    valid: Any,
    ax: Axes | None = None,
    *,
    x_label: str = r"spin speed / second frequency $\Omega/\lambda_2$ [1]",
    y_label: str = r"polar / diametral inertia $I_0/I$ [1]",
    label: str = "relative error [1]",
    marked: Sequence[float] = (0.01, 0.05),
) -> Axes:
    """Relative error as colour by decades, hatched where the approximation is not valid.

    Args:
        x: (a,) horizontal parameter, by default the speed over the second frequency at rest.
        y: (b,) vertical parameter, by default the polar over the diametral inertia.
        error: (a, b) relative error, not negative.
        valid: (a, b) whether the approximation is valid.
        ax: Axes to draw in; a new figure if None.
        x_label: label of the horizontal axis.
        y_label: label of the vertical axis.
        label: label of the colours.
        marked: errors drawn as contour lines.

    Returns:
        The Axes, both parameters.

    Raises:
        ValueError: no error is above zero.
    """
    x, y, valid = np.asarray(x), np.asarray(y), np.asarray(valid, bool).T
    error = np.asarray(error, float).T
    positive = error[np.isfinite(error) & (error > 0)]
    if not positive.size:
        raise ValueError(
            "An error map needs an error above zero, but all are zero or undefined; check `error`."
        )
    low, high = np.floor(np.log10(positive.min())), np.ceil(np.log10(positive.max()))
    levels = 10.0 ** np.arange(max(low, high - 6), max(high, low + 1) + 1)
    ax = page.single(ax, 120, 85)
    norm = LogNorm(levels[0], levels[-1])
    mesh = ax.contourf(x, y, np.maximum(error, levels[0]), levels, norm=norm, cmap=colours.RAMP)
    page.colour_bar(ax, mesh, label)
    inside = [mark for mark in marked if positive.min() < mark < positive.max()]
    if inside:
        lines = ax.contour(x, y, error, inside, colors=colours.DARK, linewidths=1.0)
        ax.clabel(lines, fmt=lambda mark: f"{100 * mark:g} %", fontsize=page.TEXT)
    if not valid.all():
        _hatch(ax, x, y, ~valid)
        ax.contour(x, y, ~valid, [0.5], colors=colours.BLUE, linewidths=1.2)
    return page.finish(ax, x_label, y_label)


def _shade(result: Any, ax: Axes | None, label: str) -> Axes:
    """Draw the growth rate as colour where it is above zero, and its zero curves."""
    (to_x, x_label), (to_y, y_label) = _parameters(result)
    growth = np.asarray(result.growth, float)
    top = float(np.max(growth, initial=0.0, where=np.isfinite(growth)))
    ax = page.single(ax, 120, 85)
    x, y = to_x * np.asarray(result.x), to_y * np.asarray(result.y)
    if top > 0:
        steps = MaxNLocator(10).tick_values(0.0, top)
        levels = np.maximum(steps, 1e-6 * top)  # smaller values are rounding of an undamped root
        mesh = ax.contourf(x, y, growth.T, levels=levels, cmap=colours.RAMP, zorder=0.5)
        bar = page.colour_bar(ax, mesh, label)
        bar.set_ticks(levels[::2].tolist(), labels=[f"{step:g}" for step in steps[::2]])
    unknown = np.isnan(growth).T
    if unknown.any():
        _hatch(ax, x, y, unknown)
        ax.fill([], [], facecolor="none", edgecolor=colours.DARK, hatch="///", label="unknown")
    _draw_boundaries(ax, result, (to_x, to_y), colours.DARK, "boundary of stability")
    ax.set(xlim=(x.min(), x.max()), ylim=(y.min(), y.max()))
    return page.finish(ax, x_label, y_label)


def _hatch(ax: Axes, x: Any, y: Any, values: Any, low: float = 0.5, high: float = 1.5) -> None:
    """Hatch where values are between two levels, by default where a mask is set."""
    ax.contourf(x, y, values, [low, high], colors="none", hatches=["///"])


def _parameters(result: Any) -> list[tuple[float, str]]:
    """Factor from SI and axis label of the two parameters."""
    rows = zip(result.paths, result.units, (result.x, result.y), strict=True)
    return [labels.parameter(labels.words(path), unit, values) for path, unit, values in rows]


def _draw_boundaries(
    ax: Axes, result: Any, factors: tuple[float, float], colour: Any, name: str
) -> None:
    for number, curve in enumerate(result.boundaries):
        curve: Float[np.ndarray, "k 2"] = np.asarray(curve) * factors
        label = None if number else name
        page.curve(ax, curve[:, 0], curve[:, 1], colour, label, 1.6)
