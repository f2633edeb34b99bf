"""Steady response of a linear rotor: amplitude and phase against speed."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Complex, Float
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator, MultipleLocator

from ..analysis import CriticalSpeeds, ResponsePeaks
from ..analysis.peaks import HALF_POWER
from . import colours, labels, page
from .marks import draw_amplitudes, draw_critical, draw_operating
from .record import signal
from .units import speed_unit


_PARTS = {  # label and colour of each part
    "forward": ("forward part", colours.FORWARD),
    "backward": ("backward part", colours.BACKWARD),
    "twice": ("twice per revolution", colours.DARK),
}


def response(
    result: Any,
    axes: Any = None,
    station: int = 0,
    *,
    log: bool = False,
    probes: Sequence[float | int] = (),
    critical: CriticalSpeeds | None = None,
    growth: Any = None,
    peaks: ResponsePeaks | None = None,
    operating: tuple[float | int, float | int] | None = None,
    clearance: float | int | None = None,
    limit: float | int | None = None,
) -> tuple[Axes, Axes]:
    """Amplitude of each part of a steady motion above, and its phase below, against speed.

    The parts are those that whirl forward and backward, with their sum, the major half axis, or the
    twice-per-revolution response to weight or a misaligned coupling; a part that is zero is left out.
    With `probes` their readings are drawn instead. The response to a given force at one speed is drawn
    against frequency. The phase is in the sense of rotation, unwrapped from a first value within half
    a revolution; a jump of exactly half a revolution (no damping) is drawn downwards.

    Args:
        result: result of `jaxrotor.unbalance_response`, `forced_response` or `weight_response`.
        axes: two Axes, upper and lower; a new figure if None.
        station: index of the station of the result.
        log: draw amplitudes on a logarithmic axis.
        probes: directions of probes [rad], as `(0, pi / 2)` of an X and a Y probe.
        critical: undamped `jaxrotor.critical_speeds`, marked by their kind of whirl.
        growth: (k,) growth rates at the speeds, see `jaxrotor.growth_rate`; the background is shaded where
            they are positive, as the response is unstable there.
        peaks: `jaxrotor.response_peaks` of the major axis, marked with their amplification factors and
            with a bar between the speeds of half power.
        operating: slowest and fastest operating speed [rad/s], shaded.
        clearance: amplitude [m] at which the shaft would touch, a line; only named if it is far beyond.
        limit: limit of vibration, peak to peak [m], a line like `clearance`; all amplitudes are then drawn
            peak to peak.

    Returns:
        The upper Axes, amplitude, and the lower, phase [deg].
    """
    shown = _probed(result, probes, station) if len(probes) else _parts(result, station)
    upper, lower = page.pair(axes, 170, 110)
    forced = np.ptp(result.speeds) == 0 and hasattr(result, "frequencies")
    turns, unit = speed_unit()
    speeds = turns * np.asarray(result.frequencies if forced else result.speeds)
    whirls = np.asarray(getattr(result, "frequencies", result.speeds))
    if not forced:  # phases are counted in the sense of rotation of the shaft whose unbalance acts
        shown = {name: np.where(whirls < 0, np.conj(part), part) for name, part in shown.items()}
    largest = sum(np.nanmax(np.abs(part), initial=0.0) for part in shown.values())
    factor, length = labels.length(largest if limit is None else 2 * largest)
    factor *= 1 if limit is None else 2
    for (name, colour), part in shown.items():
        page.curve(upper, speeds, factor * np.abs(part), colour, name)
        page.curve(lower, speeds, _phase(part), colour, name)
    for ax in (upper, lower):
        ax.margins(x=0)
    spread = np.ptp(lower.get_ylim())
    if spread > 180:  # whole quarters of a turn
        lower.yaxis.set_major_locator(MultipleLocator(90 * np.ceil(spread / 630)))
    else:
        lower.yaxis.set_major_locator(MaxNLocator(7, steps=[1, 1.8, 3, 4.5, 9, 10]))
    if not len(probes) and len(shown) > 1:  # an ellipse, which only its axis measures
        major = factor * sum(np.abs(part) for part in shown.values())
        page.curve(
            upper, speeds, major, colours.DARK, "major half axis" if limit is None else "major axis"
        )
    if critical is not None:
        draw_critical((upper, lower), critical, float(speeds.min()), float(speeds.max()))
    if peaks is not None:
        _draw_peaks(upper, peaks, factor)
    if operating is not None:
        draw_operating((upper, lower), *operating)
    if limit is not None:
        draw_amplitudes(upper, [limit / 2], (factor, length), largest, "limit")
    if clearance is not None:
        draw_amplitudes(upper, [clearance], (factor, length), largest)
    unstable = np.zeros(speeds.shape, bool) if growth is None else np.asarray(growth) > 0
    for ax in (upper, lower) if unstable.any() else ():
        shade = {"color": colours.GREY, "alpha": 0.25, "linewidth": 0.0, "zorder": 0.1}
        whole = ax.get_xaxis_transform()
        ax.fill_between(speeds, 0, 1, where=unstable, transform=whole, label="unstable", **shade)
    if log:
        upper.set_yscale("log")
    else:
        upper.set_ylim(bottom=0.0)
    several = len(upper.get_legend_handles_labels()[1]) > 1 or hasattr(result, "twice")
    name = "amplitude" if limit is None else "peak to peak"
    page.finish(upper, y=f"{name} [{length}]", columns=3 if several else 0)
    name = (
        "spin speed" if np.array_equal(whirls, result.speeds) else "spin speed of the first shaft"
    )
    label = f"frequency [{unit}]" if forced else labels.spin(name, speeds)
    return upper, page.finish(lower, label, "phase [deg]")


def _parts(result: Any, station: int) -> dict[tuple[str, str], Complex[np.ndarray, " w"]]:
    """Parts that are not zero, by label and colour."""
    names = ("twice",) if hasattr(result, "twice") else ("forward", "backward")
    parts = {_PARTS[name]: signal(result, name, station) for name in names}
    moving = {name: part for name, part in parts.items() if np.any(part)}
    return moving or dict([next(iter(parts.items()))])


def _probed(result: Any, probes: Any, station: int) -> dict[tuple[str, str], Any]:
    """Readings of probes, by label and colour."""
    if not hasattr(result, "probe"):
        raise ValueError("Probes read the parts at one frequency; leave `probes` out of this plot.")
    signal(result, "forward", station)  # raises if there is no such station
    angles = [float(angle) for angle in probes]
    names = [f"probe at {np.degrees(angle):.4g}\N{DEGREE SIGN}" for angle in angles]
    readings = [np.asarray(result.probe(angle))[:, station] for angle in angles]
    return dict(zip(zip(names, colours.shades(len(names)), strict=True), readings, strict=True))


def _draw_peaks(ax: Axes, peaks: ResponsePeaks, factor: float) -> None:
    """Amplification factors over the peaks, and bars at half power."""
    places = speed_unit()[0] * np.stack([peaks.speeds, peaks.lower, peaks.upper], axis=1)
    rows = zip(places, peaks.amplitudes, peaks.amplification, strict=True)
    for (speed, left, right), amplitude, amplification in rows:
        if np.isfinite(amplification):
            height = factor * amplitude * HALF_POWER
            ax.plot([left, right], [height, height], "|-", color=colours.DARK, linewidth=0.8)
            above: Any = {"xytext": (0, 2), "textcoords": "offset points", "ha": "center"}
            above["fontsize"] = page.TEXT - 1
            ax.annotate(f"AF {amplification:.3g}", (speed, factor * amplitude), **above)
            ax.update_datalim([(speed, factor * amplitude)])  # a peak between two speeds is higher
    ax.margins(y=0.12)  # for the texts


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
