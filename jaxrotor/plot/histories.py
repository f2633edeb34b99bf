"""Histories: motion at one station and speed of rotation, in time or one over the other."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes

from ..analysis.critical import critical_if_any
from . import colours, labels, page
from .marks import amplitudes, draw_amplitudes, draw_critical
from .record import revolutions, signal, station_of, whirl_speed
from .units import length_unit, speed_unit


EXCITED = 1e-9  # least forward share of a whirl that an unbalance excites


def history(
    response: Any, station: int = 0, ax: Axes | None = None, *, slope: bool = False
) -> Axes:
    """Displacement x and y, or slope x' and y' [mrad], against time in revolutions.

    Args:
        response: one simulation, with `angle` and `displacement` [m] or `slope` [rad].
        station: index of the station of the response.
        ax: Axes to draw in; a new figure if None.
        slope: draw the slope of the shaft instead of the displacement.

    Returns:
        The Axes.

    Source: Azarov, Gouskov, Panovko (2023), Fig. 4a.
    """
    name, mark = ("slope", "'") if slope else ("displacement", "")
    turns, motion = revolutions(response), signal(response, name, station)
    ax = page.single(ax, 170, 60)
    factor, unit = (1e3, "mrad") if slope else length_unit("mm")
    page.curve(ax, turns, factor * np.real(motion), colours.BLUE, f"x{mark}", 0.8)
    page.curve(ax, turns, factor * np.imag(motion), colours.ORANGE, f"y{mark}", 0.8)
    ax.margins(x=0)
    return page.finish(ax, "time [revolutions]", f"{name} [{unit}]", columns=2)


def whirl_history(response: Any, station: int = 0, ax: Axes | None = None) -> Axes:
    """Relative whirl speed against time in revolutions, and its mean, the precession index.

    +1 is synchronous forward whirl, and negative values are backward whirl. The curve has gaps where the
    rotor is at rest in the centre.

    Args:
        response: one simulation, with `time`, `angle`, `displacement` and `velocity`.
        station: index of the station of the response.
        ax: Axes to draw in; a new figure if None.

    Returns:
        The Axes, relative whirl speed [1] over revolutions.

    Source: Azarov, Gouskov, Panovko (2023), Fig. 5a.
    """
    turns, whirl = revolutions(response), whirl_speed(response, station)
    ax = page.single(ax, 170, 60)
    page.curve(ax, turns, whirl, colours.BLUE, width=0.8)
    page.zero(ax)
    if np.isfinite(whirl).any():
        mean = float(np.nanmean(whirl))
        label = f"mean {mean:.3g}".replace("-", "\N{MINUS SIGN}")
        ax.axhline(mean, color=colours.RED, linewidth=0.8, linestyle="--", label=label)
    ax.margins(x=0)
    label = "relative whirl speed\n" r"$\dot\psi/\Omega$ [1]"
    return page.finish(ax, "time [revolutions]", label, columns=1)


def speed(run: Any, axes: Any = None) -> tuple[Axes, Axes]:
    """Speed of rotation above and its acceleration below, against time.

    Args:
        run: a `TimeHistory`, with `time` [s], `speed` [rad/s], `acceleration` [rad/s^2].
        axes: two Axes, upper and lower; a new figure if None.

    Returns:
        The upper Axes, speed, and the lower, acceleration [rad/s^2].
    """
    upper, lower = page.pair(axes, 170, 100)
    _draw_speed(upper, run)
    lower.plot(np.asarray(run.time), _acceleration(run), color=colours.ORANGE, lw=1.2)
    page.zero(lower)
    lower.margins(x=0)
    page.finish(lower, "time [s]", "acceleration [rad/s$^2$]", scene=run.scene)
    return upper, lower


def run_up(run: Any, station: int = 0, axes: Any = None) -> tuple[Axes, Axes]:
    """Amplitude `|z|` at one station above and the speed of rotation below, against time.

    Args:
        run: a `TimeHistory`, with `displacement` [m].
        station: index of the station of the run.
        axes: two Axes, upper and lower; a new figure if None.

    Returns:
        The upper Axes, amplitude, and the lower, speed.
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
    """
    ax = page.single(ax, 170, 60)
    turns = speed_unit()[0]
    speed = turns * np.asarray(run.speed)
    free = None if run.contact_force is None else "no contact"
    amplitude = _draw_amplitude(ax, speed, run, station, free)
    scale = labels.length(amplitude)
    if run.contact_force is not None:
        touching = (np.abs(np.asarray(run.contact_force)) > 0).any(axis=1)
        touched = np.where(touching, scale[0] * amplitude, np.nan)
        ax.plot(speed, touched, color=colours.RED, lw=1.2, label="contact")
    gaps = amplitudes(run.scene, station_of(run, station))
    draw_amplitudes(ax, gaps, scale, float(amplitude.max(initial=0.0)))
    ends = float(speed.min()), float(speed.max())
    critical = critical_if_any(run.scene, ends[0] / turns, ends[1] / turns)
    if critical is not None:
        excited = critical.where(np.asarray(critical.forward_share) > EXCITED)
        draw_critical((ax,), excited, *ends, written=True)
    return page.finish(ax, labels.spin("speed of rotation", speed), columns=3)


def _draw_amplitude(
    ax: Axes, x: np.ndarray, run: Any, station: int, label: str | None = None
) -> np.ndarray:
    """Draw the amplitude at a station, and return it [m]."""
    amplitude = np.abs(signal(run, "displacement", station))
    factor, unit = labels.length(amplitude)
    page.curve(ax, x, factor * amplitude, colours.BLUE, label, 0.8)
    ax.margins(x=0)
    ax.set_ylim(bottom=0.0)
    page.finish(ax, y=f"amplitude [{unit}]", scene=run.scene)
    return amplitude


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
