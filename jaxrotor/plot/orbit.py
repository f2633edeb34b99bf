"""Orbits: paths of the shaft's centre in the plane of whirl with the limiters around them, and films."""

import os
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.animation import FFMpegWriter, PillowWriter
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..effects import AbstractBodies
from ..files.draft import replacing
from . import colours, labels, page
from .balancer import Rows
from .marks import draw_stops, stops_at
from .record import once_per_revolution, signal, station_of
from .units import length_unit


_TURNS = 30  # of the first shaft, drawn of a torus
_IMAGES = 360  # largest number of rotated periods drawn
_WRITERS: dict[str, Any] = {".gif": PillowWriter, ".mp4": FFMpegWriter}
_DPI = 100  # of films


def orbit(response: Any, station: int = 0, ax: Axes | None = None) -> Axes:
    """Orbit at one station, with a red point once per revolution, and the limiters there.

    A limiter is drawn to scale, as the line that the centre of the shaft reaches when the rim touches the
    stop, and a ring as the circle of its clearance.

    Args:
        response: one simulation, with `displacement` [m], `angle`, `stations`, `scene`.
        station: index of the station of the response.
        ax: Axes to draw in; a new figure if None.

    Returns:
        The Axes, x and y.

    Source: Azarov, Gouskov, Panovko (2023), Fig. 4b.
    """
    ax = page.single(ax, 85, 85)
    _draw_orbit(ax, response, station, *length_unit("mm"))
    return page.finish(ax, columns=3)


def orbits(response: Any, axes: Any = None) -> tuple[Axes, ...]:
    """Orbits at all stations of a response, drawn as by `orbit`, a small picture each with its own scale.

    Args:
        response: one simulation, as for `orbit`.
        axes: as many Axes as there are stations; a new figure if None.

    Returns:
        The Axes by stations, x and y.
    """
    stations = np.asarray(response.stations, float)
    drawn = page.grid(axes, len(stations), 57, 62)
    lengths, name = length_unit("mm")
    scale = labels.length(response.displacement)
    for number, (ax, at) in enumerate(zip(drawn, stations.tolist(), strict=True)):
        _draw_orbit(ax, response, number, *scale)
        ax.set_title(f"at {lengths * at:.5g} {name}", fontsize=page.TEXT)
    handles = {}
    for ax in drawn:  # one legend names all that is drawn anywhere
        handles |= dict(zip(*ax.get_legend_handles_labels()[::-1], strict=True))
    figure: Any = drawn[0].figure
    style: Any = {"loc": "outside upper left"} if axes is None else {"loc": "upper left"}
    figure.legend(handles.values(), handles, ncols=3, fontsize=page.TEXT, frameon=False, **style)
    return drawn


def periodic(result: Any, axes: Any = None, *, station: int = 0) -> tuple[Axes, Axes]:
    """One period of an orbit, its continuation, and its multipliers, unstable outside the unit circle.

    Args:
        result: `jaxrotor.PeriodicOrbit`.
        axes: two Axes, left and right; a new figure if None.
        station: index of the station of the result.

    Returns:
        The left Axes, path, and the right, multipliers [1].
    """
    left, right = page.pair(axes, 170, 85, beside=True)
    path = signal(result, "displacement", station)
    factor, unit = labels.length(path)
    path = factor * path
    for number in range(1, _images(float(result.turn))):
        image = path * np.exp(1j * number * float(result.turn))
        label = "next periods" if number == 1 else None
        page.path(left, image, colours.GREY, label, width=0.6)
    page.path(left, path, colours.BLUE, "one period", width=1.4)
    left.plot(path.real[:1], path.imag[:1], "o", color=colours.BLUE, ms=4.0, label="start")
    _draw_surroundings(left, result, station, path, factor, unit)

    circle = np.exp(2j * np.pi * np.linspace(0.0, 1.0, 181))
    page.path(right, circle, colours.GREY, "unit circle", width=0.8)
    values: Any = np.asarray(result.multipliers)
    outside = np.abs(values) >= 1
    for chosen, colour, name in (
        (values[~outside], colours.BLUE, "attracts"),
        (values[outside], colours.RED, "repels"),
    ):
        if chosen.size:
            right.plot(chosen.real, chosen.imag, "o", color=colour, markersize=4.0, label=name)
    if result.trivial is not None:
        trivial = [float(result.trivial)], [0.0]
        right.plot(*trivial, "D", color=colours.DARK, mfc="none", label="in time")
    right.set_aspect("equal", adjustable="datalim")
    page.finish(left, columns=2)
    page.finish(right, "Re multiplier [1]", "Im multiplier [1]", columns=2, scene=result.scene)
    return left, right


def torus(result: Any, ax: Axes | None = None, *, station: int = 0) -> Axes:
    """Path of a motion of two speeds, and the closed curves on which it is once a turn of each shaft.

    Args:
        result: `jaxrotor.Torus` of two shafts.
        ax: Axes to draw in; a new figure if None.
        station: index of the station of the result.

    Returns:
        The Axes, x and y.

    Raises:
        ValueError: the torus has the angles of more than two shafts.
    """
    if len(result.samples) != 2:
        raise ValueError(
            f"This plot is of two angles, but the torus has {len(result.samples)} "
            f"({', '.join(result.shafts)})."
        )
    ax = page.single(ax, 85, 85)
    surface = signal(result, "displacement", station).reshape(result.samples)
    factor, unit = labels.length(surface)
    turn = 2 * np.pi / abs(float(result.speeds[0]))
    times = np.linspace(0.0, _TURNS * turn, _TURNS * 128)
    path = factor * np.asarray(result.at(times))[:, station]
    page.path(ax, path, colours.GREY, f"{_TURNS} turns of {result.shafts[0]}", width=0.4)
    for number, colour in enumerate((colours.BLUE, colours.MAGENTA)):
        curve = factor * np.take(surface, 0, axis=number)
        name = f"{result.shafts[number]} at angle 0"
        page.path(ax, np.append(curve, curve[0]), colour, name, width=1.4)
    _draw_surroundings(ax, result, station, path, factor, unit)
    return page.finish(ax, columns=2, scene=result.scene)


def resilience(result: Any, ax: Axes | None = None) -> Axes:
    """Smallest impulses that change a motion, along every direction, and the smallest of all.

    Args:
        result: `jaxrotor.Resilience`.
        ax: Axes to draw in; a new figure if None.

    Returns:
        The Axes, impulses along x and y.
    """
    ax = page.single(ax, 85, 85)
    sizes = np.where(np.isfinite(result.sizes), result.sizes, np.nan)  # gaps where there is none
    ends = sizes * np.exp(1j * result.angles)
    smallest = complex(result.impulse)
    circle = abs(smallest) * np.exp(1j * np.linspace(0.0, 2 * np.pi, 361))
    page.path(ax, circle, colours.GREY, "no impulse changes the motion", linestyle="--")
    every = np.append(ends, ends[0])
    page.path(ax, every, colours.BLUE, "smallest along each direction", marker=".")
    page.path(ax, np.array([0.0, smallest]), colours.RED, "smallest of all")
    ax.plot(smallest.real, smallest.imag, "o", color=colours.RED, markersize=4)
    ax.set(xlabel="impulse along $x$ [N s]", ylabel="impulse along $y$ [N s]", aspect="equal")
    return page.finish(ax, columns=1, scene=result.orbit.scene)


def animate(
    run: Any,
    path: str | os.PathLike[str],
    *,
    station: int = 0,
    seconds: float | int = 4,
    rate: int = 15,
) -> None:
    """Write a film of a run: the orbit at one station, and beside it the balancer if there is one.

    The orbit is in fixed axes, its latest part in colour; balls are drawn in the axes of the rotor. The
    frames are evenly spaced in samples of the run.

    Args:
        run: a `TimeHistory`.
        path: file name in `.gif`, or in `.mp4`, which needs the program ffmpeg.
        station: index of the station of the run.
        seconds: duration of the film [s], shorter if the run has too few samples.
        rate: frames per second.

    Raises:
        ValueError: the path has another ending, ffmpeg is missing, `seconds` or `rate` is too small, or
            the run has no such station.
    """
    target = Path(path)
    writer = _WRITERS.get(target.suffix.lower())
    if writer is None:
        raise ValueError(f"`path` must end in .gif or .mp4, but is {os.fspath(path)!r}.")
    if not writer.isAvailable():
        raise ValueError("A film in .mp4 needs the program ffmpeg, which was not found; use .gif.")
    if not (rate >= 1 and 0 < seconds < np.inf):
        raise ValueError(
            f"`seconds` must be above 0 and `rate` at least 1, but are {seconds!r} and {rate!r}."
        )
    signal(run, "displacement", station)  # raises if there is no such station
    count = max(2, round(seconds * rate))
    last = np.asarray(run.time).size - 1
    samples: list[int] = np.unique(np.linspace(0, last, count).round().astype(int)).tolist()
    balanced = Rows.of(run) if run.scene.of(AbstractBodies) else None
    with rc_context(page.STYLE):
        figure = Figure(figsize=page.inches(170 if balanced else 85, 90), dpi=_DPI)
        axes = figure.subplots(1, 2 if balanced else 1, squeeze=False)[0]
        figure.subplots_adjust(0.11 if balanced else 0.2, 0.14, 0.98, 0.84, wspace=0.3)
        film = writer(fps=rate)
        with replacing(target) as draft, film.saving(figure, os.fspath(draft), _DPI):
            for number, now in enumerate(samples):
                for ax in axes:
                    ax.clear()
                _draw_frame(axes[0], run, station, samples[max(0, number - 3)], now)
                if balanced:
                    balanced.draw(axes[1], now)
                film.grab_frame()


def _draw_orbit(ax: Axes, response: Any, station: int, factor: float, unit: str) -> None:
    """Path, points and limiters of one station, in a unit: its factor from m, and its name."""
    path = factor * signal(response, "displacement", station)
    points = path[once_per_revolution(response)]
    page.path(ax, path, colours.GREY, "orbit", width=0.5)
    style = {"marker": ".", "markersize": 5.0, "markeredgewidth": 0.0, "color": colours.RED}
    ax.plot(points.real, points.imag, linestyle="none", label="once a revolution", **style)
    _draw_surroundings(ax, response, station, path, factor, unit)


def _draw_surroundings(
    ax: Axes, response: Any, station: int, path: np.ndarray, factor: float, unit: str
) -> None:
    """Limiters around a path, equal scales, and axis labels."""
    radius = np.abs(path).max(initial=0.0)
    draw_stops(ax, response.scene, station_of(response, station), radius, factor)
    ax.set_aspect("equal", adjustable="datalim")
    page.finish(ax, f"x displacement [{unit}]", f"y displacement [{unit}]")


def _images(turn: float) -> int:
    """Number of periods after which the rotated orbit closes."""
    ahead = np.abs(np.angle(np.exp(1j * turn * np.arange(1, _IMAGES + 1))))
    return int(np.argmax(ahead < 1e-9)) + 1


def _draw_frame(ax: Axes, run: Any, station: int, before: int, now: int) -> None:
    """The whole path, its part between two samples in colour, and the stops."""
    path, at = signal(run, "displacement", station), station_of(run, station)
    factor, unit = labels.length(path)
    path = factor * path
    radius = np.abs(path).max(initial=0.0)
    gaps = [factor * float(stop.gap) for stop in stops_at(run.scene, at)]
    near = [gap for gap in gaps if gap < 3 * radius]  # showing wider gaps would shrink the orbit
    reach = 1.1 * max(radius, *near, 0.0) or 1.0
    ax.plot(path.real, path.imag, color="0.85", lw=0.4, label="whole path")
    draw_stops(ax, run.scene, at, radius, factor)
    page.path(ax, path[before : now + 1], colours.BLUE, "shaft", width=0.8)
    ax.plot(path[now].real, path[now].imag, "o", color=colours.BLUE, ms=5.0)
    ax.set(xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal")
    page.note(ax, f"{float(run.time[now]):.3f} s")
    page.note(ax, f"{float(run.speed[now]):.4g} rad/s", right=True)
    page.finish(ax, f"x displacement [{unit}]", f"y displacement [{unit}]", columns=2)
