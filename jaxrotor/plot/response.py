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
_LOOKS = {
    "forward": ("forward part", colours.FORWARD),
    "backward": ("backward part", colours.BACKWARD),
    "twice": ("twice a revolution, by weight", colours.DARK),
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

    The parts are those turning forward and backward, or what weight does twice a revolution; a part
    that is zero is left out. Of a response to a given force at one speed, against its frequency. The
    phase runs on over whole turns, from within half a turn at the first speed; where it jumps by just
    half a turn (no damping) it falls.

    Args:
        result: of `jaxrotor.unbalance_response`, `forced_response` or `weight_response`.
        axes: two Axes, upper and lower; a new figure if None.
        station: which of the result's stations.
        log: draw amplitudes on a logarithmic axis.
        critical: of `jaxrotor.critical_speeds`, undamped, marked by the way they whirl.
        growth: (k,) growth rates at the speeds, as of `jaxrotor.growth_rate`: where they are positive
            no motion settles on the response, and the ground is shaded.

    Returns:
        The upper and the lower Axes.
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
        _draw(upper, lower, speeds, part, largest, *_LOOKS[name])
    marked = critical is not None and _mark(upper, lower, critical, speeds)
    unstable = np.zeros(speeds.shape, bool) if growth is None else np.asarray(growth) > 0
    for ax in (upper, lower) if unstable.any() else ():
        ground = {"color": colours.GREY, "alpha": 0.25, "linewidth": 0.0, "zorder": 0.1}
        whole = ax.get_xaxis_transform()
        ax.fill_between(speeds, 0, 1, where=unstable, transform=whole, label="unstable", **ground)
    if log:
        upper.set_yscale("log")
    else:
        upper.set_ylim(bottom=0.0)
    lower.set_xlabel("frequency [rad/s]" if forced else "spin speed [rad/s]")
    if marked or len(shown) > 1 or "twice" in shown or unstable.any():
        page.legend(upper, columns=3)
    return upper, lower


def _mark(upper: Axes, lower: Axes, critical: CriticalSpeeds, speeds: np.ndarray) -> bool:
    """A line at every critical speed between the ends, named once for each kind; whether there are any."""
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
    """Amplitude and phase of one complex motion, in the unit that suits the largest."""
    factor, unit = labels.length(largest)
    upper.plot(x, factor * np.abs(motion), color=colour, linewidth=1.2, label=name)
    lower.plot(x, _phase(motion), color=colour, linewidth=1.2, label=name)
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
