"""Mode shapes: along the shaft, and in space with the orbits of whirl."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Bool, Complex, Float, Int
from matplotlib.axes import Axes

from ..analysis import Modes
from ..analysis.modal import kind_of_whirl
from . import colours, labels, page
from .units import length_unit


_MARKED = 24  # largest number of stations that are marked by points
_LINES = {"forward": "-", "backward": "--", "mixed": "-."}
_COLOURS = {
    "forward": colours.FORWARD,
    "backward": colours.BACKWARD,
    "straight": colours.UNDEFINED,
}
_PHASE = np.linspace(0.0, 2 * np.pi * 11 / 12, 67)  # eleven twelfths of an orbit


def mode_shapes(modes: Modes, ax: Axes | None = None) -> Axes:
    """Shapes along the shaft, scaled to a largest displacement of 1, with the roots in the legend.

    Roots are those in fixed axes. Forward whirl is solid, backward whirl dashed, and mixed whirl, whose
    orbits are nearly straight lines, dash-dotted. A dotted curve is the imaginary part of a shape, 90
    degrees ahead in the plane of whirl; it is drawn if it exceeds 0.01. Of the two conjugate modes of a
    rotor with unequal axes, which are one motion, one is drawn. Shafts beside the first are thinner lines.

    Args:
        modes: result of `jaxrotor.modes`.
        ax: Axes to draw in; a new figure if None.

    Returns:
        The Axes, displacement [1] over the position.
    """
    lengths, unit = length_unit("m")
    stations = lengths * np.asarray(modes.stations, dtype=float)
    ax = page.single(ax, 140, 90)
    mark = {"marker": "." if stations.size <= _MARKED else "", "markersize": 3.5}
    parts = (np.asarray(part) for part in (modes.fixed_values, modes.forward, modes.shapes))
    rows = zip(*(part[_one_of_each_pair(modes)] for part in parts), strict=True)
    for number, (value, sense, shape) in enumerate(rows):
        largest = shape[np.argmax(np.abs(shape))]
        shape = shape / (largest if largest != 0 else 1.0)
        colour, kind = colours.cycled(number), kind_of_whirl(float(sense))
        name = f"{kind} " if value.imag else ""
        style: Any = {"linestyle": _LINES[kind] if value.imag else "-", **mark}
        title, width = f"{name}{labels.root(complex(value))}", 1.2
        for own in _of_shafts(modes):
            at, moved = stations[own], shape[own]
            page.curve(ax, at, np.real(moved), colour, title, width, **style)
            if np.abs(np.imag(shape)).max() > 0.01:
                page.curve(ax, at, np.imag(moved), colour, width=min(width, 1.0), linestyle=":")
            title, width = None, 0.6
    page.zero(ax)
    ax.set_ylim(-1.1, 1.1)
    label = f"position along the shaft [{unit}]"
    return page.finish(ax, label, "displacement / largest [1]", columns=2)


def modes3d(
    modes: Modes, numbers: Sequence[int] | None = None, axes: Any = None, *, orbits: int = 9
) -> tuple[Axes, ...]:
    """Mode shapes in space: `z(x, phase) = shape exp(i phase) + conj(counter exp(i phase))`.

    The dark line is the shaft at phase 0, each of several. Each orbit begins at the dot and ends before
    it, so the gap is behind the moving dot. Its colour shows whether the shaft whirls there with the spin
    or against it; direction and frequency are those in fixed axes.

    Args:
        modes: result of `jaxrotor.modes`; drawn in the axes of the shaft if `modes.frame` is "rotating".
        numbers: indices of the modes, by default the first four (one of each conjugate pair).
        axes: one 3-D Axes per mode; a new figure if None.
        orbits: number of orbits along the shaft.

    Returns:
        One 3-D Axes per mode.

    Raises:
        ValueError: there is no such mode, or `axes` are not as many 3-D Axes.
    """
    values: Any = np.asarray(modes.values)
    lengths, unit = length_unit("m")
    stations, parts = lengths * np.asarray(modes.stations), _of_shafts(modes)
    shapes = np.asarray(modes.shapes)
    counters = np.zeros_like(shapes) if modes.counter is None else np.asarray(modes.counter)
    senses, seen = np.asarray(modes.senses), np.asarray(modes.fixed_values)
    first = np.flatnonzero(_one_of_each_pair(modes))[:4].tolist()
    chosen = first if numbers is None else list(numbers)
    outside = [number for number in chosen if not -values.size <= number < values.size]
    if outside or not chosen:
        raise ValueError(
            f"`numbers` must be one or more of 0 to {values.size - 1}, but is {chosen}."
        )
    drawn = page.solid(axes, len(chosen))
    axis = " of the shaft" if modes.frame == "rotating" else ""
    for ax, number in zip(drawn, chosen, strict=True):
        value, whirl = complex(values[number]), complex(seen[number])
        size = (np.abs(shapes[number]) + np.abs(counters[number])).max()
        found: set[str] = set()
        for own in parts:
            shape, counter = shapes[number, own] / size, counters[number, own] / size
            placed = stations[own], shape, counter, whirl, senses[number, own]
            found |= _draw(ax, value, *placed, orbits)
        directions = [name for name in _COLOURS if name in found]
        title = f"{' and '.join(directions)}{', ' if directions else ''}{labels.root(whirl)}"
        ax.set_title(title, fontsize=page.TEXT, y=1.05, pad=0.0)
        ax.set(xlabel=f"position [{unit}]", ylabel=f"x{axis} [1]", zlabel=f"y{axis} [1]")
    return drawn


def _one_of_each_pair(modes: Modes) -> Bool[np.ndarray, " m"]:
    """Mask of the modes without the second of each conjugate pair."""
    values: Any = np.asarray(modes.values)
    return np.full(values.shape, modes.counter is None) | (values.imag >= 0)


def _of_shafts(modes: Modes) -> list[Int[np.ndarray, " s"]]:
    """Numbers of the stations of each shaft, from left to right."""
    stations = np.asarray(modes.stations)
    ends = np.cumsum([count for _, count in modes.shafts])[:-1]
    return [own[np.argsort(stations[own])] for own in np.split(np.arange(stations.size), ends)]


def _draw(
    ax: Any,
    value: complex,
    stations: Float[np.ndarray, " x"],
    shape: Complex[np.ndarray, " x"],
    counter: Complex[np.ndarray, " x"],
    seen: complex,
    sense: Float[np.ndarray, " x"],
    orbits: int,
) -> set[str]:
    """Draw a shaft and its orbits; returns the directions of whirl that occur."""
    line: Any = shape + np.conj(counter)
    radius = np.abs(shape) + np.abs(counter)
    rotation = np.exp(1j * np.copysign(_PHASE, value.imag))
    chosen = np.unique(np.linspace(0, stations.size - 1, orbits).round().astype(int))
    chosen = chosen[radius[chosen] > 1e-3]
    found = set()
    ways = sense > 1e-6, sense < -1e-6, np.abs(sense) <= 1e-6
    for (name, colour), belongs in zip(_COLOURS.items(), ways, strict=True):
        members = chosen[belongs[chosen]]
        if not members.size or not labels.whirls(seen):
            continue
        found.add(name)
        if not labels.whirls(value):  # a shaft that stands bent in its own axes has no orbit there
            continue
        orbit = shape[members, None] * rotation + np.conj(counter[members, None] * rotation)
        paths: Any = np.pad(orbit, ((0, 0), (0, 1)), constant_values=np.nan).ravel()
        at = np.repeat(stations[members], _PHASE.size + 1)
        style = {"color": colour, "linewidth": 0.9, "clip_on": False, "label": name}
        ax.plot(at, paths.real, paths.imag, **style)
    ends = np.array([min(0.0, stations[0]), stations[-1]])
    ax.plot(ends, [0, 0], [0, 0], color="0.6", linewidth=0.6)
    style = {"color": colours.DARK, "linewidth": 1.4, "clip_on": False}
    ax.plot(stations, line.real, line.imag, label="phase 0", **style)
    style |= {"linestyle": "none", "marker": ".", "markersize": 5.0}
    ax.plot(stations[chosen], line[chosen].real, line[chosen].imag, **style)
    ax.set(ylim=(-1, 1), zlim=(-1, 1), yticks=(-1, 0, 1), zticks=(-1, 0, 1))
    return found
