"""Marks: lines at critical and operating speeds, at clearances, and at the stops about a station."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr
from jaxtyping import Complex
from matplotlib.axes import Axes

from ..analysis import CriticalSpeeds
from ..effects import AnnularStator
from ..effects.rub import AbstractRub
from ..files.toml import loads
from ..scene import Scene
from . import colours, page
from .units import speed_unit


BEYOND = 4.0  # a clearance larger than this many times the motion does not stretch the axis
_PLACING = ("at", "gap", "angle", "offset")  # values that move a stop
_STYLE: Any = {"color": colours.ORANGE, "linewidth": 1.0, "linestyle": (0, (6, 2)), "zorder": 0.6}
_DASHES = {"forward": "--", "backward": ":", "mixed": "-."}
_CLOSE = 0.025  # distance of speeds, over the range, below which the second is not written


# === speeds


def draw_critical(
    axes: tuple[Axes, ...],
    critical: CriticalSpeeds,
    low: float,
    high: float,
    *,
    written: bool = False,
) -> None:
    """Draw a line at every critical speed from `low` to `high` [unit drawn], one label per kind.

    With `written` the speed stands beside its line, at the top of the first Axes.
    """
    last = -np.inf
    places = speed_unit()[0] * np.asarray(critical.speeds)
    for speed, kind in zip(places.tolist(), critical.kinds, strict=True):
        if not low <= speed <= high:
            continue
        style: Any = {"color": colours.GREY, "linewidth": 0.8, "zorder": 0.5}
        for ax in axes:
            label = page.once(ax, f"critical, {kind}")
            ax.axvline(speed, label=label, linestyle=_DASHES[kind], **style)
        if written and abs(speed - last) > _CLOSE * (high - low):
            style = {"rotation": 90, "ha": "right", "va": "top", "fontsize": page.TEXT - 1}
            where = axes[0].get_xaxis_transform()
            axes[0].text(speed, 0.98, f"{speed:.4g}", transform=where, color="0.35", **style)
            last = speed


def draw_operating(axes: tuple[Axes, ...], slowest: float | int, fastest: float | int) -> None:
    """Draw the range of operating speeds [rad/s] as a band, or a line if there is one."""
    style: Any = {"color": colours.TEAL, "label": "operating speed", "zorder": 0.3}
    ends = axes[0].get_xlim()
    slowest, fastest = (speed_unit()[0] * end for end in (slowest, fastest))
    for ax in axes:
        if slowest == fastest:
            ax.axvline(slowest, linewidth=1.0, **style)
        else:
            ax.axvspan(slowest, fastest, alpha=0.2, linewidth=0.0, **style)
        ax.set_xlim(ends)  # a speed outside does not stretch the axis


# === stops


def stops_at(scene: Scene, at: float, shaft: str | None = None) -> list[AbstractRub]:
    """Limiters and rings at a station [m] of a shaft, None the first, but those on casings, which move."""
    first = scene.name
    stops = [one for one in scene.of(AbstractRub) if (one.shaft or first) == (shaft or first)]
    there = lambda stop: stop.on is None and np.isclose(float(stop.at), at, rtol=1e-9)
    return [stop for stop in stops if there(stop)]


def placing(scene: Scene, dataset: xr.Dataset) -> list[str]:
    """Paths of a sweep that move a stop of its scene."""
    named = {name for stop in scene.of(AbstractRub) for name in (stop.kind, stop.plural)}
    paths = {str(name): str(name).split(".") for name in dataset.coords}
    return [p for p, parts in paths.items() if parts[0] in named and parts[-1] in _PLACING]


def amplitudes(scene: Scene, at: float, shaft: str | None = None) -> list[float]:
    """Smallest `|z|` [m] that reaches each stop at a station of a shaft, ascending; equal ones once."""
    gaps = [float(stop.gap) - _offset(stop) for stop in stops_at(scene, at, shaft)]
    return np.unique(np.round(np.maximum(gaps, 0.0), 12)).tolist()


def sideways(scene: Scene, at: float) -> list[float]:
    """Displacements x [m] of the stops at a station: `gap` on the side to which a stop faces.

    A ring has both sides, about its centre. Of a limiter at an angle it is the x of a circular whirl that
    reaches it, not the x of the point of contact; one that faces along y has none.
    """
    found = []
    for stop in stops_at(scene, at):
        gap, side = float(stop.gap), float(np.cos(stop.angle))
        if isinstance(stop, AnnularStator):
            found += [_offset(stop) * side - gap, _offset(stop) * side + gap]
        elif abs(side) > 1e-9:
            found.append(float(np.sign(side)) * gap)
    return found


def lines_of_stops(
    scene: Scene, at: float, radius: float, factor: float
) -> list[tuple[str, Complex[np.ndarray, " p"]]]:
    """Kind of each stop at a station, and the line along which the rim touches it, times `factor` from m.

    The line is a circle for a ring, and for a limiter a tangent at its gap and angle, whose length follows
    the gap, but is at least a quarter of `radius`.
    """
    found = []
    for stop in stops_at(scene, at):
        gap, outward = factor * float(stop.gap), np.exp(1j * float(stop.angle))
        if isinstance(stop, AnnularStator):
            around = np.exp(1j * np.linspace(0.0, 2 * np.pi, 181))
            found.append(("ring", factor * _offset(stop) * outward + gap * around))
        else:
            half = 0.25 * max(gap, 0.5 * radius)
            found.append(("limiter", outward * (gap + half * np.array([-1j, 1j]))))
    return found


def draw_stops(ax: Axes, scene: Scene, at: float, radius: float, factor: float) -> None:
    """Draw the lines of `lines_of_stops`."""
    for name, line in lines_of_stops(scene, at, radius, factor):
        style: Any = {"width": 2.5, "solid_capstyle": "butt"}
        page.path(ax, line, colours.ORANGE, page.once(ax, name), **style)


def draw_amplitudes(
    ax: Axes,
    gaps: Sequence[float | int],
    scale: tuple[float, str],
    largest: float,
    name: str = "clearance",
) -> None:
    """Draw lines at amplitudes [m], as those that reach a stop; `scale` is a unit: factor from m, name.

    One far beyond the `largest` amplitude [m] of a motion is only named in the legend.
    """
    factor, unit = scale
    for gap in gaps:
        if gap > BEYOND * largest > 0:
            ax.plot([], [], label=f"{name} {factor * gap:.3g} {unit}, beyond", **_STYLE)
        else:
            ax.axhline(factor * gap, label=page.once(ax, name), **_STYLE)


def draw_sideways(
    ax: Axes,
    dataset: xr.Dataset,
    dim: str,
    values: np.ndarray,
    scale: tuple[float, str],
    largest: float,
) -> None:
    """Draw lines at the displacements x of the stops of a sweep over `dim`, drawn at `values`.

    The unit of `scale` is its factor from m, and its name. Nothing is drawn if the data set does not keep
    its scene and station; if all lines are far beyond the `largest` displacement [m], the nearest is named
    in the legend.
    """
    if "scene" not in dataset.attrs or "station" not in dataset.attrs:
        return
    try:
        scene, at = loads(dataset.attrs["scene"]), float(dataset.attrs["station"])
    except ValueError:  # it names an effect of the user's own
        return
    paths = [path for path in placing(scene, dataset) if dataset[path].dims in ((), (dim,))]
    moved = any(dataset[path].dims for path in paths)
    each = {path: np.broadcast_to(dataset[path].values, len(values)) for path in paths}
    found = []
    for k in range(len(values) if moved else 1):
        placed = {path: float(column[k]) for path, column in each.items()}
        found.append(sideways(scene.replace(placed) if placed else scene, at))
    if not found[0] or len(set(map(len, found))) > 1:  # an angle is swept past that of y
        return
    (factor, unit), name = scale, "clearance"
    lines = np.unique(np.round(found, 12), axis=1).T
    near = [line for line in lines if not np.abs(line).min() > BEYOND * largest > 0]
    if not near:
        label = f"{name} {factor * np.abs(lines).min():.3g} {unit}, beyond"
        ax.plot([], [], label=label, **_STYLE)
    for line in near:
        label = page.once(ax, name)
        if moved:
            ax.plot(values, factor * line, label=label, **_STYLE)
        else:
            ax.axhline(factor * line[0], label=label, **_STYLE)


def _offset(stop: AbstractRub) -> float:
    """Eccentricity [m] of a ring, zero of a limiter."""
    return float(stop.offset) if isinstance(stop, AnnularStator) else 0.0
