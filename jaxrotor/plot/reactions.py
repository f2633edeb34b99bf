"""Reactions: forces of bearings on the rotor, in time, as vectors, and as hodographs."""

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Complex
from matplotlib.axes import Axes

from . import colours, page
from .record import sample


_FINE = 40  # points per revolution of an interpolated path
_DASHES = ("-", (0, (5, 4)), (0, (1, 3)))  # of curves that coincide


class _Bearing(NamedTuple):
    """Path and static part of the reaction of one bearing, in the unit drawn."""

    name: str | None  # None if the reaction is zero throughout
    colour: str
    path: Complex[np.ndarray, " T"]
    static: complex | None  # None if unknown


def reactions(result: Any, ax: Axes | None = None, *, moment: bool = False) -> Axes:
    """Magnitude of every reaction against time; dashed lines are the reactions of the rotor at rest.

    Args:
        result: `Reactions`.
        ax: Axes to draw in; a new figure if None.
        moment: draw the moments of clamps instead of the forces.

    Returns:
        The Axes, reaction over time [s].
    """
    bearings, name, unit = _bearings(result, moment, False)
    ax = page.single(ax, 170, 70)
    time = np.asarray(result.time)
    dashes = _dashes([np.abs(one.path) for one in bearings])
    for one, line in zip(bearings, dashes, strict=True):
        page.curve(ax, time, np.abs(one.path), one.colour, one.name, 1.0, linestyle=line)
        if one.static:
            label = f"{one.name} at rest"
            ax.axhline(abs(one.static), color=one.colour, lw=0.8, ls="--", label=label)
    ax.margins(x=0)
    ax.set_ylim(bottom=0.0)
    return page.finish(ax, "time [s]", f"{name} [{unit}]", columns=4, scene=result.scene)


def reaction_vectors(
    result: Any,
    time: float | int,
    ax: Axes | None = None,
    *,
    rotating: bool = False,
    moment: bool = False,
) -> Axes:
    """Reactions as vectors at the sample closest to a time.

    Args:
        result: `Reactions`.
        time: instant [s] within the run.
        ax: Axes to draw in; a new figure if None.
        rotating: draw in the axes of the shaft instead of fixed axes.
        moment: draw the moments of clamps instead of the forces.

    Returns:
        The Axes, x and y of the reactions.
    """
    now = sample(result, time)
    bearings, name, unit = _bearings(result, moment, rotating)
    ax = page.single(ax, 85, 85)
    for one in bearings:
        tip = complex(one.path[now])
        style = {"angles": "xy", "scale_units": "xy", "scale": 1, "width": 0.008}
        ax.quiver(0, 0, tip.real, tip.imag, color=one.colour, label=one.name, **style)
    reach = 1.15 * max(*(abs(one.path[now]) for one in bearings), 1e-12)
    _finish(ax, name, unit, rotating, result)
    ax.set(xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal")
    page.note(ax, f"{result.time[now]:.4g} s")
    return ax


def hodograph(
    result: Any, ax: Axes | None = None, *, rotating: bool = False, moment: bool = False
) -> Axes:
    """Path of the tip of every reaction vector, from a ring to a dot.

    With fewer than 20 samples per revolution the dynamic part is interpolated linearly in the axes of
    the shaft, and the figure says so. Reactions whose static part is unknown (NaN) are drawn with
    straight chords.

    Args:
        result: `Reactions`.
        ax: Axes to draw in; a new figure if None.
        rotating: draw in the axes of the shaft instead of fixed axes.
        moment: draw the moments of clamps instead of the forces.

    Returns:
        The Axes, x and y of the reactions.
    """
    bearings, name, unit = _bearings(result, moment, rotating)
    ax = page.single(ax, 85, 85)
    angle = np.asarray(result.angle)
    widest = np.abs(np.diff(angle)).max(initial=0.0)
    coarse = not rotating and widest > 2 * np.pi / 20
    moving = [one for one in bearings if one.name is not None]
    for one, line in zip(moving, _dashes([one.path for one in moving]), strict=True):
        path: Any = _between(one, angle, widest) if coarse else one.path
        page.path(ax, path, one.colour, one.name, width=0.8, linestyle=line)
        for end, fill in ((0, "white"), (-1, one.colour)):
            ax.plot(path[end].real, path[end].imag, "o", color=one.colour, ms=4.0, mfc=fill)
    if coarse:
        known = any(one.static is not None for one in bearings)
        note = f"{2 * np.pi / widest:.2g} samples per revolution{', interpolated' if known else ''}"
        ax.text(0.03, 0.03, note, transform=ax.transAxes, fontsize=page.TEXT - 1, color="0.4")
    _finish(ax, name, unit, rotating, result)
    ax.set_aspect("equal", adjustable="datalim")
    return ax


def _bearings(result: Any, moment: bool, rotating: bool) -> tuple[list[_Bearing], str, str]:
    """All bearings, the name of what is drawn, and its unit."""
    names = ("moment", "static_moment") if moment else ("force", "static")
    values, static = (np.asarray(getattr(result, name)) for name in names)
    largest = np.abs(values).max(initial=0.0)
    scale, prefix = (1e-3, "k") if largest >= 1e4 else (1.0, "")
    if rotating:
        values = values * np.exp(-1j * np.asarray(result.angle))[:, None]
    bearings = []
    for i, name in enumerate(result.names):
        path, rest = values[:, i], complex(static[i])
        moves = np.abs(path).max(initial=0.0) > 1e-12 * largest
        rest = None if np.isnan(rest) else scale * rest * (abs(rest) > 1e-12 * largest)
        label = result.scene.where(name) if moves else None
        bearings.append(_Bearing(label, colours.cycled(i), scale * path, rest))
    if not bearings:
        raise ValueError(
            "The scene has no supports, constraints or contacts, so it has no reactions; add one."
        )
    return bearings, "moment" if moment else "reaction", f"{prefix}N m" if moment else f"{prefix}N"


def _dashes(curves: list[np.ndarray]) -> Iterator[Any]:
    """Line styles that keep a curve visible under others that coincide with it."""
    for i, curve in enumerate(curves):
        reach = 1e-3 * np.abs(curve).max(initial=0.0)
        below = sum(bool(np.allclose(curve, other, rtol=0, atol=reach)) for other in curves[:i])
        yield _DASHES[min(below, len(_DASHES) - 1)]


def _between(one: _Bearing, angle: np.ndarray, widest: float) -> Complex[np.ndarray, " P"]:
    """A path refined by linear interpolation of the dynamic part, if known, in the shaft's axes."""
    if one.static is None:
        return one.path
    dynamic = (one.path - one.static) * np.exp(-1j * angle)
    parts = int(np.ceil(_FINE * widest / (2 * np.pi)))
    samples = np.arange(angle.size)
    places = np.linspace(0, angle.size - 1, (angle.size - 1) * parts + 1)
    rotation = np.exp(1j * np.interp(places, samples, angle))
    return one.static + rotation * np.interp(places, samples, dynamic)


def _finish(ax: Axes, name: str, unit: str, rotating: bool, result: Any) -> None:
    """Labels of the plane of reactions, its axes, and the legend."""
    where = ", axes of the shaft" if rotating else ""
    page.zero(ax)
    ax.axvline(0.0, color="0.6", linewidth=0.6, zorder=0.5)
    texts = (f"{axis} {name}{where} [{unit}]" for axis in "xy")
    page.finish(ax, *texts, columns=4, scene=result.scene)
