"""Curves of bifurcations in the plane of two parameters, alone or over a map of a sweep."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib import patheffects
from matplotlib.axes import Axes

from . import colours, labels, page
from .branch import MARKERS


OUTLINE: Any = [patheffects.withStroke(linewidth=2.6, foreground="white")]


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
    named = {curve.paths for curve in every}
    if len(named) != 1:
        told = ", ".join(" and ".join(paths) for paths in sorted(named)) or "none"
        raise ValueError(
            f"Curves in one picture have the same two parameters, but these have {told}."
        )
    first = every[0]
    scales = [labels.parameter(labels.words(path), first.scene.unit(path)) for path in first.paths]
    drawn_before = ax is not None and ax.has_data()
    ax = page.single(ax, 85, 65)
    across, up = _order(ax, [label for _, label in scales], drawn_before)
    limits = ax.get_xlim(), ax.get_ylim()
    known = {line.get_label() for line in ax.get_lines()}
    for curve in every:
        x, y = (scales[k][0] * curve.values[:, k] for k in (across, up))
        marker, shade = MARKERS[curve.kind]
        name = "Neimark-Sacker" if curve.kind == "neimark-sacker" else curve.kind
        style: Any = {"color": shade, "linewidth": 1.3, "path_effects": OUTLINE}
        for chosen, dashes in ((curve.stable, "-"), (~curve.stable, (0, (4, 2)))):
            if chosen.any():
                # A line goes on to the first point of the other kind.
                shown = chosen | np.append(False, chosen[:-1])
                label = name if name not in known else None
                known.add(name)
                ax.plot(np.where(shown, x, np.nan), y, linestyle=dashes, label=label, **style)
        for point in curve.points:
            place = scales[across][0] * point.values[across], scales[up][0] * point.values[up]
            ax.plot(*place, marker, color=shade, markersize=4.0, markerfacecolor="white")
            offset: Any = {
                "textcoords": "offset points",
                "fontsize": page.TEXT,
                "color": colours.DARK,
            }
            ax.annotate(point.kind, place, (4.0, 4.0), path_effects=OUTLINE, **offset)
    if drawn_before:
        ax.set_xlim(limits[0])
        ax.set_ylim(limits[1])
    else:
        ax.set_xlabel(scales[across][1])
        ax.set_ylabel(scales[up][1])
        ax.set_xscale(_scale(every, across))
        ax.set_yscale(_scale(every, up))
    page.legend(ax, columns=2)
    page.assumption(ax, first.scene)
    return ax


def _scale(every: list, which: int) -> str:
    """The scale of an axis: logarithmic where the range is, and the curves span a decade of it."""
    values = np.concatenate([curve.values[:, which] for curve in every])
    decades = every[0].problem.parameters[which].decades
    return "log" if decades and values.max() > 10 * values.min() else "linear"


def _order(ax: Axes, names: list[str], drawn_before: bool) -> tuple[int, int]:
    """Which parameter is drawn to the right, and which upwards."""
    if not drawn_before or [ax.get_xlabel(), ax.get_ylabel()] == names:
        return 0, 1
    if [ax.get_ylabel(), ax.get_xlabel()] == names:
        return 1, 0
    raise ValueError(
        f"`ax` must have the parameters of the curve, {names[0]} and {names[1]}, but has "
        f"{ax.get_xlabel()!r} and {ax.get_ylabel()!r}."
    )
