"""Clearance: displacements at which the shaft reaches the stops at its station."""

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from ..effects import AnnularStator
from ..effects.rub import AbstractRub
from ..files.toml import loads
from ..scene import Scene
from . import colours


_PLACING = ("at", "gap", "angle", "offset")  # values that move a stop
BEYOND = 4.0  # a clearance larger than this many times the motion does not stretch the axis
_STYLE: Any = {"color": colours.ORANGE, "linewidth": 1.0, "linestyle": (0, (6, 2)), "zorder": 0.6}


def stops_at(scene: Scene, at: float) -> list[AbstractRub]:
    """Limiters and rings of a scene at a station [m]; those on a casing move, so they are left out."""
    there = lambda stop: stop.on is None and np.isclose(float(stop.at), at, rtol=1e-9)
    return [stop for stop in scene.of(AbstractRub) if there(stop)]


def placing(scene: Scene, dataset: xr.Dataset) -> list[str]:
    """Paths of a sweep that move a stop of its scene."""
    named = {name for stop in scene.of(AbstractRub) for name in (stop.kind, stop.plural)}
    paths = {str(name): str(name).split(".") for name in dataset.coords}
    return [p for p, parts in paths.items() if parts[0] in named and parts[-1] in _PLACING]


def amplitudes(scene: Scene, at: float) -> list[float]:
    """Smallest `|z|` [m] that reaches each stop at a station, ascending; equal ones once."""
    gaps = [float(stop.gap) - _offset(stop) for stop in stops_at(scene, at)]
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


def draw_amplitudes(
    ax: Axes, scene: Scene, at: float, scale: tuple[float, str], largest: float
) -> None:
    """Lines at the amplitudes that reach a stop, in a unit: its factor from m, and its name.

    One far beyond the `largest` amplitude [m] is only named in the legend.
    """
    for number, gap in enumerate(amplitudes(scene, at)):
        draw_amplitude(ax, gap, scale, largest, label=None if number else "clearance")


def draw_amplitude(
    ax: Axes,
    gap: float | int,
    scale: tuple[float, str],
    largest: float,
    label: str | None = "clearance",
) -> None:
    """A line at an amplitude [m], or its name in the legend; see `draw_amplitudes`."""
    factor, unit = scale
    if gap > BEYOND * largest > 0:
        ax.plot([], [], label=f"clearance {factor * gap:.3g} {unit}, beyond", **_STYLE)
    else:
        ax.axhline(factor * gap, label=label, **_STYLE)


def draw_sideways(
    ax: Axes,
    dataset: xr.Dataset,
    dim: str,
    values: np.ndarray,
    scale: tuple[float, str],
    largest: float,
) -> None:
    """Lines at the displacements x of the stops of a sweep over `dim`, drawn at `values`.

    The unit of `scale` is its factor from m, and its name. Nothing is drawn if the data set does not keep
    its scene and station; lines far beyond the `largest` displacement [m] are only named in the legend.
    """
    if "scene" not in dataset.attrs or "station" not in dataset.attrs:
        return
    try:
        scene, at = loads(dataset.attrs["scene"]), float(dataset.attrs["station"])
    except ValueError:  # it names an effect of the user's own
        return
    paths = placing(scene, dataset)
    fixed = {path: float(dataset[path]) for path in paths if not dataset[path].dims}
    moved = [path for path in paths if dataset[path].dims == (dim,)]
    scene = scene.replace(fixed) if fixed else scene
    scenes = [scene] * 2
    if moved:
        rows = zip(*(dataset[path].values.tolist() for path in moved), strict=True)
        scenes = [scene.replace(dict(zip(moved, row, strict=True))) for row in rows]
    found = [sideways(one, at) for one in scenes]
    if not found[0] or len({len(one) for one in found}) > 1:  # an angle is swept past that of y
        return
    (factor, unit), name = scale, "clearance"
    lines = np.unique(np.round(found, 12), axis=1).T
    near = [line for line in lines if not np.abs(line).min() > BEYOND * largest > 0]
    if not near:
        label = f"{name} {factor * np.abs(lines).min():.3g} {unit}, beyond"
        ax.plot([], [], label=label, **_STYLE)
    for number, line in enumerate(near):
        label = "_" if number else name
        if moved:
            ax.plot(values, factor * line, label=label, **_STYLE)
        else:
            ax.axhline(factor * line[0], label=label, **_STYLE)


def _offset(stop: AbstractRub) -> float:
    """Eccentricity [m] of a ring, zero of a limiter."""
    return float(stop.offset) if isinstance(stop, AnnularStator) else 0.0
