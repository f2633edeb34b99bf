"""Steady response of a linear rotor: amplitude and phase against speed."""

from collections.abc import Iterable
from typing import Any

import numpy as np
from jaxtyping import Complex, Float
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from . import colours, page
from .record import signal


def response(
    result: Any,
    axes: Any = None,
    station: int = 0,
    *,
    log: bool = False,
    critical: Iterable[Any] = (),
) -> tuple[Axes, Axes]:
    """Radius of the synchronous orbit above, and its lead over the rotation below, against speed.

    The phase runs on over whole turns, from within half a turn at the first speed; where it jumps by
    just half a turn (no damping) it falls.

    Args:
        result: of `jaxrotor.unbalance_response`.
        axes: two Axes, upper and lower; a new figure if None.
        station: which of the result's stations.
        log: draw amplitudes on a logarithmic axis.
        critical: speeds [rad/s] to mark, as of `jaxrotor.critical_speeds(scene).forward`.

    Returns:
        The upper and the lower Axes.
    """
    motion = signal(result, "displacement", station)
    upper, lower = page.pair(axes, 170, 110)
    speeds = np.asarray(result.speeds)
    _draw(upper, lower, speeds, motion, colours.BLUE)
    marks = [speed for speed in map(float, critical) if speeds.min() <= speed <= speeds.max()]
    for ax in (upper, lower):
        for number, speed in enumerate(marks):
            name = None if number else "critical speed"
            style = {"color": colours.GREY, "linewidth": 0.8, "linestyle": "--", "zorder": 0.5}
            ax.axvline(speed, label=name, **style)
    if log:
        upper.set_yscale("log")
    else:
        upper.set_ylim(bottom=0.0)
    lower.set_xlabel("spin speed [rad/s]")
    if marks:
        page.legend(upper, columns=1)
    return upper, lower


def _draw(
    upper: Axes,
    lower: Axes,
    x: Float[np.ndarray, " w"],
    motion: Complex[np.ndarray, " w"],
    colour: str,
) -> None:
    """Amplitude and phase of one complex motion, in the unit that suits its size."""
    amplitude = np.abs(motion)
    small = np.nanmax(amplitude, initial=0.0) < 1e-4
    unit, factor = ("\N{MICRO SIGN}m", 1e6) if small else ("mm", 1e3)
    upper.plot(x, factor * amplitude, color=colour, linewidth=1.2)
    lower.plot(x, _phase(motion), color=colour, linewidth=1.2)
    upper.set_ylabel(f"amplitude [{unit}]")
    lower.set_ylabel("phase [deg]")
    lower.yaxis.set_major_locator(MaxNLocator(7, steps=[1, 1.8, 3, 4.5, 9, 10]))
    for ax in (upper, lower):
        ax.margins(x=0)


def _phase(motion: Complex[np.ndarray, " w"]) -> Float[np.ndarray, " w"]:
    """Phase [deg] without jumps of a turn; NaN where there is no motion."""
    moves = np.isfinite(motion) & (motion != 0)
    phase = np.full(motion.shape, np.nan)
    turned = motion[moves]
    # Steps in [-180, 180) and a rounding more, so that half a turn is a fall.
    steps = np.angle(turned[1:] / turned[:-1])
    steps = np.where(steps > np.pi * (1 - 1e-9), steps - 2 * np.pi, steps)
    first = np.angle(turned[:1])
    phase[moves] = np.degrees(np.cumsum(np.concatenate([first, steps])))
    return phase
