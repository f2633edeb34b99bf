"""Command `response`: steady response to unbalance, its peaks, and its values at critical speeds."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array
from scipy.optimize import brentq, minimize_scalar

from ..analysis import (
    CriticalSpeeds,
    HarmonicResponse,
    critical_speeds,
    growth_rate,
    unbalance_response,
)
from ..core.attributes import about
from ..core.compiled import compiled_quickly
from ..effects import AbstractContact
from ..equations.pencil import isotropic
from ..equations.system import structure
from ..scene import Scene
from . import answer
from .options import (
    AsJson,
    At,
    High,
    Low,
    Out,
    Overwrite,
    Points,
    SceneName,
    Settings,
    optional,
    rpm,
    scene_with,
    speeds_between,
)
from .output import draft_or_none, draw, labelled, write_dataset, written_to


_FILES = ("response.zarr", "response.png")
_SAME = 1e-6  # distance, relative to the range, below which two speeds count as one


def response(
    scene: SceneName,
    settings: Settings = None,
    low: Low = None,
    high: High = None,
    points: Points = 401,
    at: At = None,
    out: Out = None,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """Steady response to unbalance: its peaks, and its values at the critical speeds.

    The phase is the lead over the rotation. Contacts are left out: where the amplitude exceeds a
    gap, use `simulate`. Where the rotor is unstable (growth above 0) the response is not attained.
    With --out, DIR/response.zarr and DIR/response.png.

    jaxrotor response limiter-rotor --set unbalance.eccentricity=0.1mm --to 5000rpm --out run
    """
    rotor = scene_with(scene, settings)
    station = rotor.stations(
        optional(at, "m", "--at")
    )  # by default of a contact, before it is left out
    contacts = sorted({effect.plural for effect in rotor.of(AbstractContact)})
    for kind in contacts:
        rotor = rotor.without(kind)
    speeds = speeds_between(rotor, low, high, points)
    with draft_or_none(out, _FILES, overwrite) as folder:
        whirls = _excited(rotor, speeds)
        critical = [
            {"kind": kind, **_at(rotor, speed, station)}
            for kind, speed in zip(whirls.kinds, np.asarray(whirls.speeds).tolist(), strict=True)
        ]
        bounded = [one["speed"] for one in critical if one["amplitude"] is not None]
        unbounded = np.array([one["speed"] for one in critical if one["amplitude"] is None])
        result = unbalance_response(rotor, _merged(speeds, bounded, unbounded), station)
        if not np.asarray(result.major).any():
            raise ValueError(
                "The response is zero at that station; give the scene an unbalance, as in "
                "--set unbalance.eccentricity=0.1mm."
            )
        peaks = _peaks(rotor, result, unbounded)
        growth = _growth(rotor, result.speeds)
        if folder is not None:
            data = labelled(_variables(result, growth), "jaxrotor unbalance response", rotor)
            write_dataset(data, folder / "response.zarr")
            _draw(result, whirls, growth, folder)
    largest = max(one["amplitude"] or 0.0 for one in (*peaks, *critical, {"amplitude": 0.0}))
    answer.note_large(largest, float(rotor.shaft.length))
    unstable = float(np.mean(growth > 0))
    if as_json:
        found = {"station": result.stations[0], "without": contacts}
        found |= {"peaks": peaks, "critical": critical, "unstable_share": unstable}
        found |= {"written": written_to(out, _FILES)}
        answer.print_json({"scene": scene, **found})
        return
    rows = [("peak", *_row(one)) for one in peaks]
    rows += [(f"critical, {one['kind']}", *_row(one)) for one in critical]
    heads = ("", "[rad/s]", "[rpm]", "amplitude [mm]", "phase [deg]", "growth [1/s]")
    if rows:
        answer.print_table(rows, heads, numbers=[1, 2, 3, 4, 5])
    notes = [("station", f"{result.stations[0]:g} m")]
    notes += [("without", ", ".join(contacts))] if contacts else []
    notes += [("peak", "none between these speeds")] if not rows else []
    if unstable:
        notes.append(
            ("unstable", f"at {100 * unstable:.3g} % of the speeds, where no response is attained")
        )
    answer.print_table([*notes, *answer.written(written_to(out, _FILES))])


def _row(one: dict[str, Any]) -> tuple[str, ...]:
    speed, growth = (f"{one['speed']:.7g}", f"{rpm(one['speed']):.6g}"), f"{one['growth']:.4g}"
    if one["amplitude"] is None:
        return (*speed, "unbounded", "-", growth)
    return (*speed, f"{1e3 * one['amplitude']:.6g}", f"{math.degrees(one['phase']):.5g}", growth)


def _growth(rotor: Scene, speeds: Any) -> np.ndarray:
    """Largest growth rate [1/s] at each of the speeds."""
    return np.asarray(_growth_rates(rotor, jnp.asarray(speeds)))


@compiled_quickly
def _growth_rates(rotor: Scene, speeds: Array) -> Array:
    return jax.lax.map(lambda speed: growth_rate(rotor.at_speed(speed)), speeds)


def _at(rotor: Scene, speed: float, station: Any) -> dict[str, Any]:
    """Amplitude [m] and phase [rad] at a speed, None where unbounded, and growth rate [1/s]."""
    growth = float(growth_rate(rotor.at_speed(speed)))
    try:
        found = unbalance_response(rotor, speed, station)
    except ValueError:
        return {"speed": speed, "amplitude": None, "phase": None, "growth": growth}
    phase = float(np.angle(found.forward[0, 0]))
    amplitude = float(found.major[0, 0])
    return {"speed": speed, "amplitude": amplitude, "phase": phase, "growth": growth}


def _excited(rotor: Scene, speeds: np.ndarray) -> CriticalSpeeds:
    """Critical speeds in a range that unbalance excites: where orbits are circles, the forward ones."""
    found = critical_speeds(rotor)
    values, kinds = np.asarray(found.speeds), np.array(found.kinds)
    inside = (values >= speeds[0]) & (values <= speeds[-1])
    if isotropic(structure(rotor).blocks):
        inside &= kinds == "forward"
    return found.where(inside)


def _merged(speeds: np.ndarray, added: list[float], unbounded: np.ndarray) -> np.ndarray:
    """Speeds with the added ones, without those that coincide with an added or an unbounded one."""
    taken = np.concatenate([added, unbounded])
    near = np.abs(speeds[:, None] - taken) < _SAME * (speeds[-1] - speeds[0])
    return np.union1d(speeds[~near.any(axis=1)], added)


def _peaks(rotor: Scene, result: HarmonicResponse, unbounded: np.ndarray) -> list[dict[str, Any]]:
    """Local maxima of the amplitude, each refined to the zero of its derivative."""
    speeds, amplitude = np.asarray(result.speeds), np.asarray(result.major)[:, 0]
    rises, falls = amplitude[1:-1] > amplitude[:-2], amplitude[1:-1] >= amplitude[2:]
    at = lambda speed: _height_and_slope(rotor, jnp.asarray(np.asarray(speed)), result.stations)
    found = []
    for k in np.flatnonzero(rises & falls) + 1:
        low, high = speeds[k - 1], speeds[k + 1]
        if np.any((low <= unbounded) & (unbounded <= high)):
            continue
        found.append(_at(rotor, _summit(at, low, high), result.stations))
    return found


@compiled_quickly
def _height_and_slope(rotor: Scene, speed: Array, stations: Array) -> tuple[Array, Array]:
    """Amplitude at a speed and its derivative by the speed: one program for all peaks."""
    height = lambda speed: unbalance_response(rotor, speed, stations).major[0, 0]
    return jax.value_and_grad(height)(speed)


def _summit(height_and_slope: Callable, low: float, high: float) -> float:
    """Speed of the maximum between two speeds, to rounding: the zero of its slope."""
    depth = lambda speed: -float(height_and_slope(speed)[0])
    slope = lambda speed: float(height_and_slope(speed)[1])
    near = minimize_scalar(depth, bounds=(low, high), method="bounded").x
    apart = 1e-3 * (high - low)
    below, above = max(low, near - apart), min(high, near + apart)
    if not slope(below) > 0 > slope(above):
        return float(near)
    zero: Any = brentq(slope, below, above)
    return float(zero)


def _variables(
    result: HarmonicResponse, growth: np.ndarray
) -> tuple[dict[str, Any], dict[str, Any]]:
    dims, phase = ("speed", "station"), about("rad", "lead of the forward part over the rotation")
    major, minor = np.asarray(result.major), np.asarray(result.minor)
    return (
        {
            "amplitude": (dims, major, about("m", "major half axis of the synchronous orbit")),
            "minor": (dims, minor, about("m", "minor half axis, negative if backward")),
            "phase": (dims, np.angle(result.forward), phase),
            "growth": ("speed", growth, about("1/s", "largest growth rate, positive unstable")),
        },
        {
            "speed": ("speed", np.asarray(result.speeds), about("rad/s", "spin speed")),
            "station": ("station", np.asarray(result.stations), about("m", "station")),
        },
    )


def _draw(
    result: HarmonicResponse, critical: CriticalSpeeds, growth: np.ndarray, folder: Path
) -> None:
    from .. import plot

    def both(axes: Any) -> None:
        plot.response(result, axes, critical=critical, growth=growth)

    draw(folder / "response.png", both, 170, 110, rows=2)
