"""Steady response of a linear rotor: amplitude and phase against speed."""

from typing import Any

import numpy as np
from jaxtyping import Complex, Float
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from ..analysis import CriticalSpeeds
from . import colours, labels, page
from .record import signal


_DASHES = {"forward": "--", "backward": ":", "mixed": "-."}
_PARTS = {  # label and colour of each part
    "forward": ("forward part", colours.FORWARD),
    "backward": ("backward part", colours.BACKWARD),
    "twice": ("twice per revolution, by weight", colours.DARK),
}


def response(
    result: Any,
    axes: Any = None,
    station: int = 0,
    *,
    log: bool = False,
    critical: CriticalSpeeds | None = None,
    growth: Any = None,
) -> tuple[Axes, Axes]:
    """Amplitude of each part of a steady motion above, and its phase below, against speed.

    The parts are those that whirl forward and backward, or the twice-per-revolution response to weight; a
    part that is zero is left out. The response to a given force at one speed is drawn against frequency.
    The phase is unwrapped from a first value within half a revolution; a jump of exactly half a
    revolution (no damping) is drawn downwards.

    Args:
        result: result of `jaxrotor.unbalance_response`, `forced_response` or `weight_response`.
        axes: two Axes, upper and lower; a new figure if None.
        station: index of the station of the result.
        log: draw amplitudes on a logarithmic axis.
        critical: undamped `jaxrotor.critical_speeds`, marked by their kind of whirl.
        growth: (k,) growth rates at the speeds, see `jaxrotor.growth_rate`; the background is shaded where
            they are positive, as the response is unstable there.

    Returns:
        The upper Axes, amplitude, and the lower, phase [deg].

    Raises:
        ValueError: the result has no such station, or `axes` are not two.
    """
    names = ("twice",) if hasattr(result, "twice") else ("forward", "backward")
    parts = {name: signal(result, name, station) for name in names}
    shown = {name: part for name, part in parts.items() if np.any(part)} or {
        names[0]: parts[names[0]]
    }
    upper, lower = page.pair(axes, 170, 110)
    forced = np.ptp(result.speeds) == 0 and hasattr(result, "frequencies")
    speeds = np.asarray(result.frequencies if forced else result.speeds)
    largest = max(np.nanmax(np.abs(part), initial=0.0) for part in shown.values())
    for name, part in shown.items():
        _draw(upper, lower, speeds, part, largest, *_PARTS[name])
    marked = critical is not None and _mark(upper, lower, critical, speeds)
    unstable = np.zeros(speeds.shape, bool) if growth is None else np.asarray(growth) > 0
    for ax in (upper, lower) if unstable.any() else ():
        shade = {"color": colours.GREY, "alpha": 0.25, "linewidth": 0.0, "zorder": 0.1}
        whole = ax.get_xaxis_transform()
        ax.fill_between(speeds, 0, 1, where=unstable, transform=whole, label="unstable", **shade)
    if log:
        upper.set_yscale("log")
    else:
        upper.set_ylim(bottom=0.0)
    lower.set_xlabel("frequency [rad/s]" if forced else "spin speed [rad/s]")
    if marked or len(shown) > 1 or "twice" in shown or unstable.any():
        page.legend(upper, columns=3)
    return upper, lower


def _mark(upper: Axes, lower: Axes, critical: CriticalSpeeds, speeds: np.ndarray) -> bool:
    """Draw a line at every critical speed in range, one label per kind; returns whether there are any."""
    seen = set()
    for speed, kind in zip(np.asarray(critical.speeds).tolist(), critical.kinds, strict=True):
        if not speeds.min() <= speed <= speeds.max():
            continue
        name = None if kind in seen else f"critical, {kind}"
        seen.add(kind)
        for ax in (upper, lower):
            style = {"color": colours.GREY, "linewidth": 0.8, "zorder": 0.5}
            ax.axvline(speed, label=name, linestyle=_DASHES[kind], **style)
    return bool(seen)


def _draw(
    upper: Axes,
    lower: Axes,
    x: Float[np.ndarray, " w"],
    motion: Complex[np.ndarray, " w"],
    largest: float,
    name: str,
    colour: str,
) -> None:
    """Draw amplitude and phase of one complex motion, in the unit that suits the largest amplitude."""
    factor, unit = labels.length(largest)
    upper.plot(x, factor * np.abs(motion), color=colour, linewidth=1.2, label=name)
    lower.plot(x, _phase(motion), color=colour, linewidth=1.2, label=name)
    upper.set_ylabel(f"amplitude [{unit}]")
    lower.set_ylabel("phase [deg]")
    lower.yaxis.set_major_locator(MaxNLocator(7, steps=[1, 1.8, 3, 4.5, 9, 10]))
    for ax in (upper, lower):
        ax.margins(x=0)


def _phase(motion: Complex[np.ndarray, " w"]) -> Float[np.ndarray, " w"]:
    """Unwrapped phase [deg], NaN where there is no motion."""
    moves = np.isfinite(motion) & (motion != 0)
    phase = np.full(motion.shape, np.nan)
    turned = motion[moves]
    # Steps are in [-180, 180), up to rounding, so that half a revolution is downwards.
    steps = np.angle(turned[1:] / turned[:-1])
    steps = np.where(steps > np.pi * (1 - 1e-9), steps - 2 * np.pi, steps)
    first = np.angle(turned[:1])
    phase[moves] = np.degrees(np.cumsum(np.concatenate([first, steps])))
    return phase
