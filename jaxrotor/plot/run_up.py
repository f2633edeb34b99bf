"""Run-up: speed of rotation, and amplitude while it changes."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes

from ..analysis import CriticalSpeeds
from ..analysis.critical import critical_between
from . import clearance, colours, labels, page
from .critical import mark_critical
from .record import signal
from .units import speed_unit


EXCITED = 1e-9  # least forward share of a whirl that an unbalance excites


def speed(run: Any, axes: Any = None) -> tuple[Axes, Axes]:
    """Speed of rotation above and its acceleration below, against time.

    Args:
        run: a `TimeHistory`, with `time` [s], `speed` [rad/s], `acceleration` [rad/s^2].
        axes: two Axes, upper and lower; a new figure if None.

    Returns:
        The upper Axes, speed, and the lower, acceleration [rad/s^2].

    Raises:
        ValueError: `axes` are not two.
    """
    upper, lower = page.pair(axes, 170, 100)
    _draw_speed(upper, run)
    lower.plot(np.asarray(run.time), _acceleration(run), color=colours.ORANGE, lw=1.2)
    page.zero(lower)
    page.assumption(lower, run.scene)
    lower.margins(x=0)
    lower.set_ylabel("acceleration [rad/s$^2$]")
    lower.set_xlabel("time [s]")
    return upper, lower


def run_up(run: Any, station: int = 0, axes: Any = None) -> tuple[Axes, Axes]:
    """Amplitude `|z|` at one station above and the speed of rotation below, against time.

    Args:
        run: a `TimeHistory`, with `displacement` [m].
        station: index of the station of the run.
        axes: two Axes, upper and lower; a new figure if None.

    Returns:
        The upper Axes, amplitude, and the lower, speed.

    Raises:
        ValueError: the run has no such station, or `axes` are not two.
    """
    upper, lower = page.pair(axes, 170, 100)
    _draw_amplitude(upper, np.asarray(run.time), run, station)
    _draw_speed(lower, run)
    lower.set_xlabel("time [s]")
    return upper, lower


def passage(run: Any, station: int = 0, ax: Axes | None = None) -> Axes:
    """Amplitude `|z|` at one station against the speed of rotation at the same time.

    Contact with a stop is red, motion without it blue. Lines are at the clearance of the stops there and
    at the critical speeds of the undamped linear rotor that an unbalance can excite, each with its speed.

    Args:
        run: a `TimeHistory`, with `displacement` [m] and `speed` [rad/s].
        station: index of the station of the run.
        ax: Axes to draw in; a new figure if None.

    Returns:
        The Axes, amplitude over speed.

    Raises:
        ValueError: the run has no such station.
    """
    ax = page.single(ax, 170, 60)
    turns = speed_unit()[0]
    speed = turns * np.asarray(run.speed)
    free = None if run.contact_force is None else "no contact"
    _draw_amplitude(ax, speed, run, station, free)
    amplitude = np.abs(signal(run, "displacement", station))
    if run.contact_force is not None:
        touching = (np.abs(np.asarray(run.contact_force)) > 0).any(axis=1)
        factor = labels.length(amplitude.max(initial=0.0))[0]
        touched = np.where(touching, factor * amplitude, np.nan)
        ax.plot(speed, touched, color=colours.RED, lw=1.2, label="contact")
    largest = float(amplitude.max(initial=0.0))
    at = float(np.asarray(run.stations)[station])
    clearance.draw_amplitudes(ax, run.scene, at, labels.length(largest), largest)
    ends = float(speed.min()), float(speed.max())
    critical = _critical(run.scene, ends[0] / turns, ends[1] / turns)
    if critical is not None:
        mark_critical((ax,), critical, *ends, written=True)
    page.legend(ax, columns=3)
    ax.set_xlabel(labels.spin("speed of rotation", speed))
    return ax


def _critical(scene: Any, low: float, high: float) -> CriticalSpeeds | None:
    """Critical speeds of a range that an unbalance can excite; None if the rotor has none."""
    try:
        found = critical_between(scene, low, high)
    except ValueError:
        return None
    return found.where(np.asarray(found.forward_share) > EXCITED)


def _draw_amplitude(
    ax: Axes, x: np.ndarray, run: Any, station: int, label: str | None = None
) -> None:
    amplitude = np.abs(signal(run, "displacement", station))
    factor, unit = labels.length(amplitude.max(initial=0.0))
    many = amplitude.size > page.RASTER
    ax.plot(x, factor * amplitude, color=colours.BLUE, lw=0.8, rasterized=many, label=label)
    page.assumption(ax, run.scene)
    ax.margins(x=0)
    ax.set_ylim(bottom=0.0)
    ax.set_ylabel(f"amplitude [{unit}]")


def _acceleration(run: Any) -> np.ndarray:
    """Acceleration [rad/s^2] of every sample; that of the last is taken just before, off a jump there.

    A profile that ends with the run is constant from there on, but that is no part of the run.
    """
    found, end = np.array(run.acceleration), float(run.time[-1])
    kinks = run.scene.spin.kinks
    if kinks is not None and np.isclose(np.asarray(kinks), end, rtol=1e-12, atol=0.0).any():
        found[-1] = run.scene.spin.turning(end * (1 - 1e-9)).acceleration
    return found


def _draw_speed(ax: Axes, run: Any) -> None:
    speed = speed_unit()[0] * np.asarray(run.speed)
    ax.plot(np.asarray(run.time), speed, color=colours.DARK, lw=1.2)
    ax.margins(x=0)
    ax.set_ylabel(labels.spin("speed", speed))
