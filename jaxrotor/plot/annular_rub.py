"""Rub in a ring: full rubs over speed, and a map of dry whirl over speed and friction."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap

from . import colours, labels, page
from .branch import MARKERS, runs
from .units import speed_unit


_KINDS = (  # of a map of dry whirl: name and colour
    ("none", "#FFFFFF"),
    ("unstable alone", "#DDDDDD"),
    ("rim rolls", "#99C9E5"),
    ("rim slips (whip)", "#F4B58C"),
    ("rolls or slips", "#99D6CF"),
)


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
    factor, unit = labels.length(float(np.max(radius, initial=gap, where=exists)))
    onsets, folds, merged = (
        np.asarray(part)
        for part in (turns * result.onsets, turns * result.folds, result.fold_radius)
    )
    free = np.abs(rising(result.free))
    ends = onsets, np.full(onsets.size, gap)
    curves = [(free, free <= gap, rising(result.free_growth) < 0, *ends, colours.TEAL, "free")]
    ends = np.concatenate([onsets, folds]), np.concatenate([ends[1], merged])
    for j, stable in enumerate(rising(result.stable).T):
        curves.append((radius[:, j], exists[:, j], stable, *ends, colours.BLUE, "full rub"))
    for heights, there, stable, at, height, colour, name in curves:
        # A line runs to the onset or fold where it begins or ends.
        place = np.clip(np.searchsorted(speeds, at), 1, speeds.size - 1)
        ends = there[place] != there[place - 1]
        at, height = at[ends], height[ends]
        order = np.argsort(np.concatenate([speeds, at]), kind="stable")
        x, y = (np.concatenate(pair)[order] for pair in ((speeds, at), (heights, height)))
        kinds = np.concatenate([np.where(there, stable, -1.0), np.full(at.size, np.nan)])[order]
        for chosen, line in ((True, "-"), (False, (0, (4, 2)))):
            shown = runs(kinds, chosen)
            if shown.any():
                label = f"{name}, {'stable' if chosen else 'unstable'}"
                taken = label in ax.get_legend_handles_labels()[1]
                style = {"color": colour, "linewidth": 1.3, "linestyle": line}
                y_shown = np.where(shown, factor * y, np.nan)
                ax.plot(x, y_shown, label="_" if taken else label, **style)
    ax.axhline(factor * gap, color=colours.ORANGE, linewidth=0.8, zorder=0.5, label="gap")
    for kind, name, places, heights in (
        ("grazing", "onset of contact", onsets, np.full(onsets.size, gap)),
        ("fold", "fold", folds, merged),
    ):
        if places.size:
            marker, shade = MARKERS[kind]
            style = {"color": shade, "markersize": 4.0, "markerfacecolor": "none"}
            ax.plot(places, factor * heights, marker, label=name, **style)
    ax.set_xlim(speeds.min(), speeds.max())
    ax.set_ylim(bottom=0.0)
    ax.set_xlabel(labels.spin("spin speed", speeds))
    ax.set_ylabel(f"radius at the ring [{unit}]")
    page.legend(ax, columns=3)
    return ax


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
    turns = speed_unit()[0]
    x, y = turns * np.asarray(result.speeds), np.asarray(result.frictions)
    rolls, slips = np.asarray(result.rolls), np.asarray(result.slips)
    kinds = np.where(np.asarray(result.exists), 1, 0)
    kinds = np.where(rolls & slips, 4, np.where(slips, 3, np.where(rolls, 2, kinds)))
    palette = ListedColormap([colour for _, colour in _KINDS])
    drawn = {"cmap": palette, "vmin": -0.5, "vmax": len(_KINDS) - 0.5, "shading": "nearest"}
    ax.pcolormesh(x, y, kinds.T, rasterized=True, **drawn)
    for kind in np.unique(kinds):
        name, colour = _KINDS[kind]
        ax.fill([], [], facecolor=colour, edgecolor=colours.DARK, lw=0.4, label=name)
    least = np.asarray(result.least_friction)
    ax.plot(x, least, color=colours.DARK, linewidth=1.3, label="least friction")
    ax.set(xlim=(x.min(), x.max()), ylim=(y.min(), y.max()))
    ax.set_xlabel(labels.spin("spin speed", x))
    ax.set_ylabel("friction [1]")
    page.legend(ax, columns=4)
    return ax
