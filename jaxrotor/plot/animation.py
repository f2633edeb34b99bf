"""Animation: a run as a small film of the orbit of the rotor and the balls it carries."""

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
from .orbit import draw_limiters, limiters_at
from .record import signal


_WRITERS: dict[str, Any] = {".gif": PillowWriter, ".mp4": FFMpegWriter}
_DPI = 100


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
                _draw_orbit(axes[0], run, station, samples[max(0, number - 3)], now)
                if balanced:
                    balanced.draw(axes[1], now)
                film.grab_frame()


def _draw_orbit(ax: Axes, run: Any, station: int, before: int, now: int) -> None:
    z = signal(run, "displacement", station)
    reach = np.abs(z).max(initial=0.0)
    factor, unit = labels.length(reach)
    path, radius = factor * z, factor * reach
    gaps = [factor * float(stop.gap) for stop in limiters_at(run, station)]
    near = [gap for gap in gaps if gap < 3 * radius]  # showing wider gaps would shrink the orbit
    reach = 1.1 * max(radius, *near, 0.0) or 1.0
    ax.plot(path.real, path.imag, color="0.85", lw=0.4, label="whole path")
    draw_limiters(ax, run, station, radius, factor)
    recent = path[before : now + 1]
    ax.plot(recent.real, recent.imag, color=colours.BLUE, lw=0.8, label="shaft")
    ax.plot(path[now].real, path[now].imag, "o", color=colours.BLUE, ms=5.0)
    ax.set(xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal")
    ax.set_xlabel(f"x displacement [{unit}]")
    ax.set_ylabel(f"y displacement [{unit}]")
    ax.text(0.03, 0.03, f"{float(run.time[now]):.3f} s", transform=ax.transAxes)
    ax.text(0.97, 0.03, f"{float(run.speed[now]):.4g} rad/s", transform=ax.transAxes, ha="right")
    page.legend(ax, columns=2)
