"""Branches of motions against a parameter: solid where they are stable, dashed where unstable."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Bool
from matplotlib import patheffects
from matplotlib.axes import Axes

from . import colours, labels, page
from .units import speed_unit


MARKERS = {  # kind of bifurcation: marker and colour
    "fold": ("o", colours.DARK),
    "flip": ("s", colours.ORANGE),
    "neimark-sacker": ("^", colours.MAGENTA),
    "branching": ("x", colours.TEAL),
    "grazing": ("D", colours.TEAL),
}
CRITICAL = 1e-5  # distance of a multiplier from 1
_OUTLINE: Any = [patheffects.withStroke(linewidth=2.6, foreground="white")]


def branch(
    result: Any,
    ax: Axes | None = None,
    *,
    of: str = "radius",
    station: int = 0,
    colour: str = colours.BLUE,
) -> Axes:
    """Orbits of branches against their parameter: stable ones solid, unstable dashed.

    Args:
        result: `jaxrotor.Branch`, or several of the same parameter, such as one and those that
            `jaxrotor.switch` found at its flips.
        ax: Axes to draw in, which may hold other branches; a new figure if None.
        of: "radius", the largest at a station, or "whirl_rate".
        station: index of the station of the result.
        colour: colour of the lines.

    Returns:
        The Axes, radius [mm] or whirl rate [1] over the parameter (in mm if it is a length).

    Raises:
        ValueError: `of` is neither, or the branches have different parameters.
    """
    if of not in ("radius", "whirl_rate"):
        raise ValueError(f"`of` must be 'radius' or 'whirl_rate', but is {of!r}.")
    every = list(result) if isinstance(result, Sequence) else [result]
    first = _alike(every, [one.path for one in every], "Branches", "parameter")
    ax = page.single(ax, 85, 65)
    factor, name = labels.parameter(labels.words(first.path), first.scene.unit(first.path))
    scale, label = _height(every, of, station)
    for one in every:
        places = np.arange(one.values.size), np.array([point.place for point in one.points])
        at = factor * np.array([point.value for point in one.points])
        heights, marks = (scale * part for part in _heights(one, of, station))
        line = (factor * one.values, at), (heights, marks), _stable(one)
        _draw_through(ax, places, *line, colour, ("stable", "unstable"))
        for kind in MARKERS:
            here = np.array([point.kind == kind for point in one.points], bool)
            if here.any():
                _mark(ax, kind, at[here], marks[here], page.once(ax, _name(kind)))
    if first.curve.parameters[0].decades:
        ax.set_xscale("log")
    return page.finish(ax, name, label, columns=2, scene=first.scene)


def curves(result: Any, ax: Axes | None = None) -> Axes:
    """Curves of bifurcations over both parameters: solid where a stable orbit is on one side, else dashed.

    Points of codimension two are named.

    Args:
        result: `jaxrotor.BifurcationCurve`, or several of the same two parameters.
        ax: Axes to draw in, as of `sweep_map` over the same parameters, in either order: they keep their
            limits; a new figure if None.

    Returns:
        The Axes, both parameters (in mm if it is a length).

    Raises:
        ValueError: the curves, or the Axes, have other parameters.
    """
    every = list(result) if isinstance(result, Sequence) else [result]
    named = [" and ".join(curve.paths) for curve in every]
    first = _alike(every, named, "Curves", "two parameters")
    scales = [labels.parameter(labels.words(path), first.scene.unit(path)) for path in first.paths]
    drawn_before = ax is not None and ax.has_data()
    ax = page.single(ax, 85, 65)
    across, up = _order(ax, [label for _, label in scales], drawn_before)
    limits = {"xlim": ax.get_xlim(), "ylim": ax.get_ylim()}
    for curve in every:
        x, y = (scales[k][0] * curve.values[:, k] for k in (across, up))
        # A line goes on to the first point of the other kind.
        masks = [on | np.append(False, on[:-1]) for on in (curve.stable, ~curve.stable)]
        shade = MARKERS[curve.kind][1]
        _solid_and_dashed(ax, x, y, masks, shade, [_name(curve.kind)] * 2, path_effects=_OUTLINE)
        for point in curve.points:
            place = tuple(scales[k][0] * point.values[k] for k in (across, up))
            _mark(ax, curve.kind, *place, fill="white")
            text: Any = {"textcoords": "offset points", "fontsize": page.TEXT}
            text |= {"color": colours.DARK, "path_effects": _OUTLINE}
            ax.annotate(point.kind, place, (4.0, 4.0), **text)
    if drawn_before:
        ax.set(**limits)
    else:
        ax.set(xscale=_scale(every, across), yscale=_scale(every, up))
        page.finish(ax, scales[across][1], scales[up][1])
    return page.finish(ax, columns=2, scene=first.scene)


def annular_rub(result: Any, ax: Axes | None = None) -> Axes:
    """Radius of whirl at a ring against speed: free, and full rubs, stable solid and unstable dashed.

    Onsets of contact and the folds, where both full rubs merge, are marked.

    Args:
        result: `jaxrotor.AnnularRub` at ascending or descending speeds.
        ax: Axes to draw in; a new figure if None.

    Returns:
        The Axes, radius over spin speed.
    """
    ax = page.single(ax, 120, 80)
    turns = speed_unit()[0]
    order, gap = np.argsort(np.asarray(result.speeds)), float(result.gap)
    rising = lambda part: np.asarray(part)[order]
    speeds, radius, exists = (
        turns * rising(result.speeds),
        rising(result.radius),
        rising(result.exists),
    )
    factor, unit = labels.length(np.max(radius, initial=gap, where=exists))
    onsets, folds = turns * np.asarray(result.onsets), turns * np.asarray(result.folds)
    grazing, merged = np.full(onsets.size, gap), np.asarray(result.fold_radius)
    free = np.abs(rising(result.free))
    ends = onsets, grazing
    curves = [(free, free <= gap, rising(result.free_growth) < 0, *ends, colours.TEAL, "free")]
    ends = np.concatenate([onsets, folds]), np.concatenate([grazing, merged])
    for j, stable in enumerate(rising(result.stable).T):
        curves.append((radius[:, j], exists[:, j], stable, *ends, colours.BLUE, "full rub"))
    for heights, there, stable, at, height, colour, name in curves:
        # A line runs to the onset or fold where it begins or ends.
        place = np.clip(np.searchsorted(speeds, at), 1, speeds.size - 1)
        ends = there[place] != there[place - 1]
        x, y = (speeds, at[ends]), (factor * heights, factor * height[ends])
        names = f"{name}, stable", f"{name}, unstable"
        _draw_through(ax, x, x, y, np.where(there, stable, -1.0), colour, names)
    ax.axhline(factor * gap, color=colours.ORANGE, linewidth=0.8, zorder=0.5, label="gap")
    for kind, name, places, heights in (
        ("grazing", "onset of contact", onsets, grazing),
        ("fold", "fold", folds, merged),
    ):
        if places.size:
            _mark(ax, kind, places, factor * heights, name)
    ax.set_xlim(speeds.min(), speeds.max())
    ax.set_ylim(bottom=0.0)
    return page.finish(
        ax, labels.spin("spin speed", speeds), f"radius at the ring [{unit}]", columns=3
    )


def _draw_through(
    ax: Axes, places: Any, x: Any, y: Any, stable: Any, colour: Any, names: Sequence[str]
) -> None:
    """Draw a line through its points and the bifurcations among them, at which it changes or ends.

    `places` (by which both are ordered), `x` and `y` have two parts: of the points, and of the
    bifurcations. `stable` is of the points.
    """
    order = np.argsort(np.concatenate(places), kind="stable")
    x, y = np.concatenate(x)[order], np.concatenate(y)[order]
    kinds = np.concatenate([stable, np.full(len(places[1]), np.nan)])[order]
    masks = [_between_bifurcations(kinds, chosen) for chosen in (True, False)]
    _solid_and_dashed(ax, x, y, masks, colour, names)


def _solid_and_dashed(
    ax: Axes, x: Any, y: Any, masks: Sequence[Any], colour: Any, names: Sequence[str], **style: Any
) -> None:
    """Draw a curve solid at the points of the first mask and dashed at those of the second."""
    for shown, name, dashes in zip(masks, names, ("-", (0, (4, 2))), strict=True):
        if np.any(shown):
            style |= {"width": 1.3, "linestyle": dashes}
            right, up = np.where(shown, x, np.nan), np.where(shown, y, np.nan)
            page.curve(ax, right, up, colour, page.once(ax, name), **style)


def _mark(
    ax: Axes, kind: str, x: Any, y: Any, label: str | None = None, fill: str = "none"
) -> None:
    """Draw the markers of a kind of bifurcation."""
    marker, shade = MARKERS[kind]
    ax.plot(x, y, marker, color=shade, markersize=4.0, markerfacecolor=fill, label=label)


def _name(kind: str) -> str:
    """Name of a kind of bifurcation in a legend."""
    return "Neimark-Sacker" if kind == "neimark-sacker" else kind


def _alike(every: list, named: list[str], what: str, shared: str) -> Any:
    """The first of several results; raises unless all of them have the same parameters."""
    if len(set(named)) != 1:
        told = ", ".join(sorted(set(named))) or "none"
        raise ValueError(f"{what} in one picture have the same {shared}, but these have {told}.")
    return every[0]


def _heights(result: Any, of: str, station: int) -> tuple[np.ndarray, np.ndarray]:
    """Heights of the points and of the bifurcations, radii in m."""
    if of == "whirl_rate":
        return np.asarray(result.whirl_rate), np.array([one.whirl_rate for one in result.points])
    marks = np.array([point.radius_max[station] for point in result.points])
    return np.asarray(result.radius_max[:, station]), marks


def _height(every: list, of: str, station: int) -> tuple[float, str]:
    """Factor from SI to the unit drawn, and the axis label."""
    if of == "whirl_rate":
        return 1.0, "whirl rate [1]"
    largest = max(np.max(one.radius_max[:, station]) for one in every)
    factor, unit = labels.length(largest)
    return factor, f"largest radius [{unit}]"


def _stable(result: Any) -> np.ndarray:
    """Whether the orbits are stable; NaN at a bifurcation where a branch begins."""
    stable = np.array(result.stable, float)
    if hasattr(result, "multipliers"):  # of tori there are none
        stable[np.abs(result.multipliers - 1).min(axis=1) < CRITICAL] = np.nan
    return stable


def _between_bifurcations(kinds: np.ndarray, chosen: bool) -> Bool[np.ndarray, " n"]:
    """Mask of the points on lines of a kind; bifurcations (NaN) between two kinds end both lines."""
    own = kinds == chosen
    shown = own.copy()
    for i in np.flatnonzero(np.isnan(kinds)):
        before = next((own[k] for k in range(i - 1, -1, -1) if not np.isnan(kinds[k])), False)
        after = next((own[k] for k in range(i + 1, own.size) if not np.isnan(kinds[k])), False)
        shown[i] = before or after
    return shown


def _scale(every: list, which: int) -> str:
    """Scale of an axis: logarithmic where the range is, and the curves span a decade of it."""
    values = np.concatenate([curve.values[:, which] for curve in every])
    decades = every[0].problem.parameters[which].decades
    return "log" if decades and values.max() > 10 * values.min() else "linear"


def _order(ax: Axes, names: list[str], drawn_before: bool) -> tuple[int, int]:
    """Numbers of the parameters that are drawn to the right and upwards."""
    if not drawn_before or [ax.get_xlabel(), ax.get_ylabel()] == names:
        return 0, 1
    if [ax.get_ylabel(), ax.get_xlabel()] == names:
        return 1, 0
    raise ValueError(
        f"`ax` must have the parameters of the curve, {names[0]} and {names[1]}, but has "
        f"{ax.get_xlabel()!r} and {ax.get_ylabel()!r}."
    )
