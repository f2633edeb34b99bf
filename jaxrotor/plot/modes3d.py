"""Mode shapes in space, with the orbits of whirl."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Complex, Float
from matplotlib.axes import Axes

from ..analysis import Modes
from . import colours, labels, page
from .mode_shapes import single
from .units import length_unit


_PHASE = np.linspace(0.0, 2 * np.pi * 11 / 12, 67)  # eleven twelfths of an orbit


def modes3d(
    modes: Modes,
    numbers: Sequence[int] | None = None,
    axes: Any = None,
    *,
    orbits: int = 9,
) -> tuple[Axes, ...]:
    """Mode shapes in space: `z(x, phase) = shape exp(i phase) + conj(counter exp(i phase))`.

    The dark line is the shaft at phase 0. Each orbit begins at the dot and ends before it, so the gap
    is behind the moving dot. Its colour shows whether the shaft whirls there with the spin or against
    it; direction and frequency are those in fixed axes.

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
    stations = lengths * np.asarray(modes.stations)
    order = np.argsort(stations)
    shapes = np.asarray(modes.shapes)
    counters = np.zeros_like(shapes) if modes.counter is None else np.asarray(modes.counter)
    senses, seen = np.asarray(modes.senses), np.asarray(modes.fixed_values)
    chosen = np.flatnonzero(single(modes))[:4].tolist() if numbers is None else list(numbers)
    outside = [number for number in chosen if not -values.size <= number < values.size]
    if outside or not chosen:
        raise ValueError(
            f"`numbers` must be one or more of 0 to {values.size - 1}, but is {chosen}."
        )
    drawn = page.solid(axes, len(chosen))
    for ax, number in zip(drawn, chosen, strict=True):
        value = complex(values[number])
        shape, counter = shapes[number, order], counters[number, order]
        whirl = complex(seen[number]), senses[number, order]
        directions = _draw(ax, value, stations[order], shape, counter, *whirl, orbits)
        title = f"{' and '.join(directions)}{', ' if directions else ''}{labels.root(whirl[0])}"
        ax.set_title(title, fontsize=page.TEXT, y=1.05, pad=0.0)
    axis = " of the shaft" if modes.frame == "rotating" else ""
    for ax in drawn:
        ax.set(xlabel=f"position [{unit}]", ylabel=f"x{axis} [1]", zlabel=f"y{axis} [1]")
    return drawn


def _draw(
    ax: Any,
    value: complex,
    stations: Float[np.ndarray, " x"],
    shape: Complex[np.ndarray, " x"],
    counter: Complex[np.ndarray, " x"],
    seen: complex,
    sense: Float[np.ndarray, " x"],
    orbits: int,
) -> list[str]:
    """Draw the shaft and its orbits; returns the directions of whirl that occur."""
    size = (np.abs(shape) + np.abs(counter)).max()
    shape, counter = shape / size, counter / size
    line: Any = shape + np.conj(counter)
    radius = np.abs(shape) + np.abs(counter)
    rotation = np.exp(1j * np.copysign(_PHASE, value.imag))
    chosen = np.unique(np.linspace(0, stations.size - 1, orbits).round().astype(int))
    chosen = chosen[radius[chosen] > 1e-3]
    found = []
    for name, colour, belongs in (
        ("forward", colours.FORWARD, sense > 1e-6),
        ("backward", colours.BACKWARD, sense < -1e-6),
        ("straight", colours.UNDEFINED, np.abs(sense) <= 1e-6),
    ):
        members = chosen[belongs[chosen]]
        if not members.size or not labels.whirls(seen):
            continue
        found.append(name)
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
