"""Stability maps: stable regions of a rotor over two parameters, and their boundaries."""

from collections.abc import Sequence
from typing import Any

import matplotlib
import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from . import colours, labels, page


_CHARTED = {  # parameters of the ball balancer's groups
    "speed": r"speed $\omega/\omega_0$ [1]",
    "damping": r"damping of the mount $h_\alpha/(A\,\omega_0)$ [1]",
    "polar": "polar / transverse inertia $C/A$ [1]",
    "drag": "factor on the drag of balls [1]",
    "mass": "factor on the mass of balls [1]",
}


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
        ax.contourf(x, y, np.minimum(*parts).T, [0.0, 1.0], colors="none", hatches=["///"])
        ax.fill([], [], fill=False, hatch="///", lw=0, label="$a_{11} < 0$ but unstable")
    for name, label in zip(chart.paths, (ax.set_xlabel, ax.set_ylabel), strict=True):
        label(_CHARTED[name])
    page.legend(ax, columns=3)
    return ax


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
        ax.contourf(x, y, unknown, [0.5, 1.5], colors="none", hatches=["///"])
        ax.fill([], [], facecolor="none", edgecolor=colours.DARK, hatch="///", label="unknown")
    _draw_boundaries(ax, result, (to_x, to_y), colours.DARK, "boundary of stability")
    ax.set(xlim=(x.min(), x.max()), ylim=(y.min(), y.max()))
    ax.set_xlabel(x_label)
    ax.set_ylabel(y_label)
    return ax


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
    ax.set_xlabel(x_label)
    ax.set_ylabel(y_label)
    page.legend(ax, columns=4)
    return ax


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
        ax.plot(curve[:, 0], curve[:, 1], color=colour, linewidth=1.6, label=label)
