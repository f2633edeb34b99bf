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

    Raises:
        ValueError: the scene has no supports, constraints or contacts.
    """
    bearings, what = _bearings(result, moment, False)
    ax = page.single(ax, 170, 70)
    time = np.asarray(result.time)
    dashes = _dashes([np.abs(one.path) for one in bearings])
    for one in bearings:
        many = time.size > page.RASTER
        style = {"color": one.colour, "lw": 1.0, "ls": next(dashes), "rasterized": many}
        ax.plot(time, np.abs(one.path), label=one.name, **style)
        if one.static:
            label = f"{one.name} at rest"
            ax.axhline(abs(one.static), color=one.colour, lw=0.8, ls="--", label=label)
    ax.margins(x=0)
    ax.set_ylim(bottom=0.0)
    ax.set_xlabel("time [s]")
    ax.set_ylabel(what)
    page.assumption(ax, result.scene)
    page.legend(ax, columns=_columns(ax, 84))
    return ax


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

    Raises:
        ValueError: the time is outside the run, or the scene has no supports, constraints or contacts.
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

    Raises:
        ValueError: the scene has no supports, constraints or contacts.
    """
    bearings, what = _bearings(result, moment, rotating)
    ax = page.single(ax, 85, 85)
    angle = np.asarray(result.angle)
    widest = np.abs(np.diff(angle)).max(initial=0.0)
    coarse = not rotating and widest > 2 * np.pi / 20
    dashes = _dashes([one.path for one in bearings if one.name is not None])
    for one in bearings:
        if one.name is None:
            continue
        path: Any = _between(one, angle, widest) if coarse else one.path
        many = path.size > page.RASTER
        style = {"color": one.colour, "lw": 0.8, "ls": next(dashes), "rasterized": many}
        ax.plot(path.real, path.imag, label=one.name, **style)
        for end, fill in ((0, "white"), (-1, one.colour)):
            ax.plot(path[end].real, path[end].imag, "o", color=one.colour, ms=4.0, mfc=fill)
    if coarse:
        known = any(one.static is not None for one in bearings)
        note = f"{2 * np.pi / widest:.2g} samples per revolution{', interpolated' if known else ''}"
        ax.text(0.03, 0.03, note, transform=ax.transAxes, fontsize=page.TEXT - 1, color="0.4")
    _finish(ax, what, rotating, result)
    ax.set_aspect("equal", adjustable="datalim")
    return ax


def _bearings(result: Any, moment: bool, rotating: bool) -> tuple[list[_Bearing], str]:
    """All bearings, and the axis label of what is drawn."""
    values, static = (
        np.asarray(getattr(result, name))
        for name in (("moment", "static_moment") if moment else ("force", "static"))
    )
    large = np.abs(values).max(initial=0.0) >= 1e4
    scale, prefix = (1e-3, "k") if large else (1.0, "")
    if rotating:
        values = values * np.exp(-1j * np.asarray(result.angle))[:, None]
    many = len(colours.CYCLE)
    rounding = 1e-12 * np.abs(values).max(initial=0.0)
    bearings = []
    for i, name in enumerate(result.names):
        path, rest = values[:, i], complex(static[i])
        label = result.scene.where(name) if np.abs(path).max(initial=0.0) > rounding else None
        rest = None if np.isnan(rest) else rest * (abs(rest) > rounding)
        parts = scale * path, None if rest is None else scale * rest
        bearings.append(_Bearing(label, colours.CYCLE[i % many], *parts))
    if not bearings:
        raise ValueError(
            "The scene has no supports, constraints or contacts, so it has no reactions; add one."
        )
    unit = f"{prefix}N m" if moment else f"{prefix}N"
    return bearings, f"{'moment' if moment else 'reaction'} [{unit}]"


def _columns(ax: Axes, letters: int) -> int:
    """Number of columns of a legend that has room for `letters` letters per line."""
    longest = max(map(len, ax.get_legend_handles_labels()[1]), default=0)
    return max(1, min(4, letters // (longest + 5)))


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


def _finish(ax: Axes, what: str, rotating: bool, result: Any) -> None:
    where = ", axes of the shaft" if rotating else ""
    name, _, unit = what.rpartition(" [")
    ax.set_xlabel(f"x {name}{where} [{unit}")
    ax.set_ylabel(f"y {name}{where} [{unit}")
    page.zero(ax)
    ax.axvline(0.0, color="0.6", linewidth=0.6, zorder=0.5)
    page.assumption(ax, result.scene)
    page.legend(ax, columns=_columns(ax, 36))
