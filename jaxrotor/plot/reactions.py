"""Reactions: forces of bearings on the rotor, in time, at an instant, and their paths."""

from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Complex
from matplotlib.axes import Axes

from . import colours, page
from .record import sample


class _Bearing(NamedTuple):
    """What is drawn of one bearing, in the unit on paper."""

    name: str
    colour: str
    path: Complex[np.ndarray, " T"]
    static: complex


def reactions(result: Any, ax: Axes | None = None, *, moment: bool = False) -> Axes:
    """Magnitude of every reaction against time; dashed what the rotor at rest presses with.

    Args:
        result: `Reactions`.
        ax: Axes to draw in; a new figure if None.
        moment: draw the moments of clamps in place of the forces.
    """
    bearings, what = _bearings(result, moment, False)
    ax = page.single(ax, 170, 70)
    time = np.asarray(result.time)
    for one in bearings:
        many = time.size > page.RASTER
        ax.plot(time, np.abs(one.path), color=one.colour, lw=1.0, label=one.name, rasterized=many)
        if one.static:
            label = f"{one.name} at rest"
            ax.axhline(abs(one.static), color=one.colour, lw=0.8, ls="--", label=label)
    ax.margins(x=0)
    ax.set_ylim(bottom=0.0)
    ax.set_xlabel("time [s]")
    ax.set_ylabel(what)
    page.assumption(ax, result)
    page.legend(ax, columns=4)
    return ax


def reaction_vectors(
    result: Any,
    time: float | int,
    ax: Axes | None = None,
    *,
    rotating: bool = False,
    moment: bool = False,
) -> Axes:
    """Reactions as vectors at the sample next to a time.

    Args:
        result: `Reactions`.
        time: instant [s], within the run.
        ax: Axes to draw in; a new figure if None.
        rotating: in the axes of the shaft instead of fixed ones.
        moment: draw the moments of clamps in place of the forces.
    """
    now = sample(result, time)
    bearings, what = _bearings(result, moment, rotating)
    ax = page.single(ax, 85, 85)
    for one in bearings:
        tip = complex(one.path[now])
        style = {"angles": "xy", "scale_units": "xy", "scale": 1, "width": 0.008}
        ax.quiver(0, 0, tip.real, tip.imag, color=one.colour, label=one.name, **style)
    reach = 1.15 * max(*(abs(one.path[now]) for one in bearings), 1e-12)
    _finish(ax, what, rotating, result)
    ax.set(xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal")
    ax.text(0.03, 0.03, f"{result.time[now]:.4g} s", transform=ax.transAxes, fontsize=page.TEXT)
    return ax


def hodograph(
    result: Any, ax: Axes | None = None, *, rotating: bool = False, moment: bool = False
) -> Axes:
    """Path of the tip of every reaction; a ring where it begins, a dot where it ends.

    Args:
        result: `Reactions`.
        ax: Axes to draw in; a new figure if None.
        rotating: in the axes of the shaft instead of fixed ones.
        moment: draw the moments of clamps in place of the forces.
    """
    bearings, what = _bearings(result, moment, rotating)
    ax = page.single(ax, 85, 85)
    for one in bearings:
        x, y = np.real(one.path), np.imag(one.path)
        many = x.size > page.RASTER
        ax.plot(x, y, color=one.colour, lw=0.8, label=one.name, rasterized=many)
        for end, fill in ((0, "white"), (-1, one.colour)):
            ax.plot(x[end], y[end], "o", color=one.colour, ms=4.0, mfc=fill)
    _finish(ax, what, rotating, result)
    ax.set_aspect("equal", adjustable="datalim")
    return ax


def _bearings(result: Any, moment: bool, rotating: bool) -> tuple[list[_Bearing], str]:
    """All bearings, and what is drawn of them with its unit."""
    values, static = (
        np.asarray(getattr(result, name))
        for name in (("moment", "static_moment") if moment else ("force", "static"))
    )
    large = np.abs(values).max(initial=0.0) >= 1e4
    scale, prefix = (1e-3, "k") if large else (1.0, "")
    if rotating:
        values = values * np.exp(-1j * np.asarray(result.angle))[:, None]
    many = len(colours.CYCLE)
    bearings = [
        _Bearing(name, colours.CYCLE[i % many], scale * values[:, i], complex(scale * static[i]))
        for i, name in enumerate(result.names)
    ]
    if not bearings:
        raise ValueError("The scene has no supports, constraints or contacts to react.")
    unit = f"{prefix}N m" if moment else f"{prefix}N"
    return bearings, f"{'moment' if moment else 'reaction'} [{unit}]"


def _finish(ax: Axes, what: str, rotating: bool, result: Any) -> None:
    where = ", axes of the shaft" if rotating else ""
    name, _, unit = what.rpartition(" [")
    ax.set_xlabel(f"x {name}{where} [{unit}")
    ax.set_ylabel(f"y {name}{where} [{unit}")
    page.zero(ax)
    ax.axvline(0.0, color="0.6", linewidth=0.6, zorder=0.5)
    page.assumption(ax, result)
    page.legend(ax, columns=2)
