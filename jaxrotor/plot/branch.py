"""Branch of orbits: largest radius or whirl rate against the parameter."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes

from . import colours, labels, page


MARKERS = {  # kind of bifurcation: marker and colour
    "fold": ("o", colours.DARK),
    "flip": ("s", colours.ORANGE),
    "neimark-sacker": ("^", colours.MAGENTA),
    "branching": ("x", colours.TEAL),
    "grazing": ("D", colours.TEAL),
}


def branch(
    result: Any,
    ax: Axes | None = None,
    *,
    of: str = "radius",
    station: int = 0,
    colour: str = colours.BLUE,
) -> Axes:
    """Orbits of a branch against its parameter: stable ones solid, unstable dashed.

    Args:
        result: `jaxrotor.Branch`.
        ax: Axes to draw in, which may hold other branches; a new figure if None.
        of: "radius", the largest at a station, or "whirl_rate".
        station: index of the station of the result.
        colour: colour of the line.

    Returns:
        The Axes, radius [mm] or whirl rate [1] over the parameter (in mm if it is a length).

    Raises:
        ValueError: `of` is neither.
    """
    if of not in ("radius", "whirl_rate"):
        raise ValueError(f"`of` must be 'radius' or 'whirl_rate', but is {of!r}.")
    ax = page.single(ax, 85, 65)
    named = {line.get_label() for line in ax.get_lines()}  # labels of branches drawn before
    called = lambda name: "_" if name in named else name
    heights, marks, label = _heights(result, of, station)
    factor, name = labels.parameter(labels.words(result.path), result.scene.unit(result.path))
    # Lines go through the bifurcations, where they change.
    places = np.array([point.place for point in result.points])
    order = np.argsort(np.concatenate([np.arange(result.values.size), places]), kind="stable")
    merge = lambda ours, theirs: np.concatenate([ours, np.asarray(theirs, float)])[order]
    x = factor * merge(result.values, [point.value for point in result.points])
    y = merge(heights, marks)
    stable = merge(result.stable, np.full(places.size, np.nan))
    for part, chosen in (("stable", True), ("unstable", False)):
        shown = runs(stable, chosen)
        if shown.any():
            style = {"color": colour, "linewidth": 1.3, "linestyle": "-" if chosen else (0, (4, 2))}
            ax.plot(x, np.where(shown, y, np.nan), label=called(part), **style)
    for kind, (sign, shade) in MARKERS.items():
        here = [i for i, point in enumerate(result.points) if point.kind == kind]
        if here:
            ax.plot(
                [factor * result.points[i].value for i in here],
                [marks[i] for i in here],
                sign,
                color=shade,
                markersize=4.0,
                markerfacecolor="none",
                label=called("Neimark-Sacker" if kind == "neimark-sacker" else kind),
            )
    ax.set_xlabel(name)
    ax.set_ylabel(label)
    if result.curve.parameters[0].decades:
        ax.set_xscale("log")
    page.legend(ax, columns=2)
    page.assumption(ax, result.scene)
    return ax


def _heights(result: Any, of: str, station: int) -> tuple[np.ndarray, np.ndarray, str]:
    """Heights of the points and of the bifurcations, and the axis label."""
    if of == "whirl_rate":
        marks = np.array([point.whirl_rate for point in result.points])
        return np.asarray(result.whirl_rate), marks, "whirl rate [1]"
    radius = np.asarray(result.radius_max[:, station])
    factor, unit = labels.length(float(radius.max()))
    marks = np.array([point.radius_max[station] for point in result.points])
    return factor * radius, factor * marks, f"largest radius [{unit}]"


def runs(kinds: np.ndarray, chosen: bool) -> np.ndarray:
    """Mask of the points on lines of a kind; bifurcations (NaN) between two kinds end both lines."""
    own = kinds == chosen
    shown = own.copy()
    for i in np.flatnonzero(np.isnan(kinds)):
        before = next((own[k] for k in range(i - 1, -1, -1) if not np.isnan(kinds[k])), False)
        after = next((own[k] for k in range(i + 1, own.size) if not np.isnan(kinds[k])), False)
        shown[i] = before or after
    return shown
