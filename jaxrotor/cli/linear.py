"""Commands `roots` and `onset`: natural motions of the straight rotor, and their stability."""

import math
from typing import Annotated, Any

import jax.numpy as jnp
import numpy as np
import typer
from jaxtyping import Array

from ..analysis import Modes, Onset, linearized, modes, onset_speed
from ..analysis.growth import growth_rates
from ..analysis.linearized import BEARINGS
from ..analysis.modal import kind_of_whirl
from ..analysis.resolved import resolved
from ..analysis.whirl_tables import OverWhirl
from ..core.compiled import compiled_quickly
from ..effects.film import AbstractFluid
from ..equations.pencil import frame, is_rounding
from ..equations.system import structure
from ..files.units import quantity
from ..scene import Scene
from . import answer, options


def roots(
    scene: options.SceneName,
    settings: options.Settings = None,
    count: Annotated[int, options.count("Number of roots, the slowest first.")] = 8,
    speed: Annotated[
        str | None,
        typer.Option(metavar="SPEED", help="Speed of rotation. [default: the scene's]"),
    ] = None,
    as_json: options.AsJson = False,
) -> None:
    """Complex roots: whirl frequencies, damping, direction and stability, without contact.

    The logarithmic decrement (log dec) is `-2 pi Re / |Im|` of a root; one that does not whirl
    has its growth per second there. In films, seals, rolling and magnetic bearings the roots are those
    about the static position at the speed.

    jaxrotor roots limiter-rotor --speed 6000rpm --count 4
    """
    rotor = options.scene_with(scene, settings)
    if speed is not None:
        rotor = rotor.at_speed(quantity(speed, "rad/s", "--speed"))
    axes, found = described_roots(resolved(linear_at_speed(rotor), count), count)
    facts = {"scene": scene, "speed": rotor.spin.speed, "axes": axes, "roots": found}
    rotating = axes == "rotating"
    rows = [
        (
            f"{root['frequency']:.7g}",
            f"{root['frequency_hz']:.6g}",
            *([f"{root['shaft_frequency']:.7g}"] if rotating else []),
            f"{root['damping_ratio']:.4g}" if root["root"] else "-",
            f"{root['log_decrement']:.4g}" if root["frequency"] else f"{root['root'].real:.3g}/s",
            root["direction"],
            root["stability"],
        )
        for root in found
    ]
    own = ["shaft's axes"] if rotating else []
    heads = ("whirl [rad/s]", "[Hz]", *own, "damping", "log dec", "direction", "stability")
    answer.give(as_json, facts, answer.Table(rows, heads, range(len(own) + 4)))


def onset(
    scene: options.SceneName,
    settings: options.Settings = None,
    low: options.Low = None,
    high: Annotated[
        str | None,
        typer.Option(
            "--to",
            metavar="SPEED",
            help="Last speed, negative for reversed rotation. [default: 40 times the first natural "
            "frequency in the scene's sense]",
        ),
    ] = None,
    as_json: options.AsJson = False,
) -> None:
    """Lowest speed at which the straight rotor loses stability, and its whirl there.

    jaxrotor onset limiter-rotor --set internal_damping.voigt_time=0.1ms
    jaxrotor onset limiter-rotor --from 1000rpm --to 9000rpm
    """
    rotor = options.scene_with(scene, settings)
    found = described_onset(onset_speed(rotor, _range(low, high)), axes_of(rotor))
    rows = [
        ("onset speed", f"{found['speed']:.9g} rad/s", f"{found['rpm']:.7g} rpm"),
        (
            "whirl there",
            f"{found['whirl_frequency']:.9g} rad/s",
            f"{found['whirl_frequency_hz']:.7g} Hz",
        ),
    ]
    if found["axes"] == "rotating":
        rows[1] = ("in the shaft's axes", *rows[1][1:])
        rows.append(("it whirls", found["kind"], ""))
    answer.give(as_json, {"scene": scene, **found}, answer.Table(rows))


def described_onset(found: Onset, axes: str) -> dict[str, Any]:
    """An onset in numbers: speed [rad/s] and [rpm], whirl frequency [rad/s] and [Hz] in its axes."""
    speed, whirl = float(found.speed), float(found.whirl_frequency)
    if axes == "rotating" and is_rounding(whirl, speed):
        whirl = 0.0
    return {
        "speed": speed,
        "rpm": options.rpm(speed),
        "axes": axes,
        "whirl_frequency": whirl,
        "whirl_frequency_hz": whirl / (2 * math.pi),
        "kind": _kind(speed, whirl, axes),
    }


def _kind(speed: float, whirl: float, axes: str) -> str:
    """Description of the whirl at an onset."""
    if axes == "rotating" and not whirl:
        return "with the shaft, which stands bent in its own axes"
    if axes == "rotating":
        return f"at {speed - whirl:.7g} and {speed + whirl:.7g} rad/s in fixed axes"
    with_spin = -whirl if speed < 0 else whirl
    return "forward" if with_spin > 0 else "backward" if with_spin < 0 else "not at all"


def _range(low: str | None, high: str | None) -> tuple[float, float] | None:
    """Speeds to search, or None for the default."""
    if high is None:
        if low is not None:
            raise ValueError("--from needs the other end of the range; add --to.")
        return None
    return options.interval(low, high)


def axes_of(rotor: Scene) -> str:
    """Axes of the roots: "fixed", or "rotating" with the shaft."""
    return frame(structure(rotor).blocks)


def linear_at_speed(scene: Scene) -> Scene:
    """A scene with its films, seals, rolling and magnetic bearings linear about the static position."""
    return linearized(scene) if any(map(scene.of, BEARINGS)) else scene


def linear_over_speeds(
    scene: Scene, low: str | None, high: str | None, points: int
) -> tuple[Scene, np.ndarray]:
    """A scene as of `linear_at_speed`, at each of the speeds [rad/s] of `--from`, `--to` and `--points`.

    In films these are by default between zero, where a film bears nothing, and 2.5 times the scene's.
    """
    if not scene.of(AbstractFluid):
        linear = linear_at_speed(scene)
        return linear, options.speeds_between(linear, low, high, points)
    if high is None:
        high = repr(options.BEYOND * float(scene.spin.speed))
        if not float(scene.spin.speed):
            raise ValueError(
                "The range of speeds ends at 2.5 times the speed of the scene by default, but that is 0, "
                "where films bear nothing; give it a speed, as by --set spin.speed=3000rpm."
            )
    last = quantity(high, "rad/s", "--to")
    speeds = np.linspace(*options.interval(low or repr(last / points), high), points)
    running = float(scene.spin.speed)
    between = speeds.min() <= running <= speeds.max()
    return linearized(scene, np.union1d(speeds, [running] if between else [])), speeds


def described_roots(rotor: Scene, count: int | None = None) -> tuple[str, list[dict[str, Any]]]:
    """Axes and the slowest roots; where axes are unequal, one of each conjugate pair."""
    shown = modes(rotor)
    seen = zip(*map(np.asarray, _in_fixed_axes(shown)), strict=True)
    found = []
    for value, fixed, sense in seen:
        still = is_rounding(value.imag, value)
        if not np.isfinite(value) or (shown.counter is not None and value.imag < 0 and not still):
            continue
        one = _described(fixed, sense)
        if shown.frame == "rotating":
            one |= {"root": complex(value), "shaft_frequency": 0.0 if still else value.imag}
        found.append(one)
    return shown.frame, found[:count]


@compiled_quickly
def _in_fixed_axes(shown: Modes) -> tuple[Array, Array, Array]:
    """Roots, the same in fixed axes, and the senses of the whirl."""
    return shown.values, shown.fixed_values, shown.forward


def _described(root: complex, sense: float) -> dict[str, Any]:
    """A root in numbers, in fixed axes; its sense is that of `Modes.forward`."""
    whirl = 0.0 if is_rounding(root.imag, root) else root.imag
    return {
        "root": complex(root),
        "frequency": abs(whirl),
        "frequency_hz": abs(whirl) / (2 * math.pi),
        "damping_ratio": 0.0 - root.real / abs(root) if root else math.nan,
        "log_decrement": 0.0 - 2 * math.pi * root.real / abs(whirl) if whirl else math.nan,
        "direction": kind_of_whirl(float(sense)) if whirl else "none",
        "stability": _stability(root),
    }


def _stability(root: complex) -> str:
    if is_rounding(root.real, root):
        return "marginal"
    return "stable" if root.real < 0 else "unstable"


def growth_at(rotor: Scene, speeds: Any) -> np.ndarray:
    """Largest growth rate [1/s] at each of the speeds [rad/s], NaN where it is unknown."""
    return np.asarray(growth_rates(OverWhirl.of(rotor), jnp.asarray(speeds)))
