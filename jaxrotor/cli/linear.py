"""Commands `roots` and `onset`: the straight rotor's own motions."""

import math
from typing import Annotated, Any

import equinox as eqx
import numpy as np
import typer

from ..analysis import Onset, modes, onset_speed, roots as roots_of
from ..blocks import Blocks
from ..pencil import frame, isotropic
from ..scene import Scene
from ..system import assemble
from ..units import quantity
from . import answer
from .options import MOST, AsJson, Low, SceneName, Settings, interval, rpm, scene_with


def roots(
    scene: SceneName,
    settings: Settings = None,
    count: Annotated[int, typer.Option(min=1, max=MOST, help="How many, the slowest first.")] = 8,
    speed: Annotated[
        str | None,
        typer.Option(metavar="SPEED", help="Speed of rotation. [default: the scene's]"),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Complex roots: whirl frequencies, damping, direction and stability, without contact.

    jaxrotor roots limiter-rotor --speed 6000rpm --count 4
    """
    rotor = scene_with(scene, settings)
    if speed is not None:
        rotor = rotor.at_speed(quantity(speed, "rad/s", "--speed"))
    axes, found = described_roots(rotor, count)
    if as_json:
        now = rotor.spin.speed
        answer.print_json({"scene": scene, "speed": now, "axes": axes, "roots": found})
        return
    turning = axes == "rotating"
    rows = [
        (
            f"{root['frequency']:.7g}",
            f"{root['frequency_hz']:.6g}",
            *([f"{root['shaft_frequency']:.7g}"] if turning else []),
            f"{root['damping_ratio']:.4g}",
            root["direction"],
            root["stability"],
        )
        for root in found
    ]
    own = ["shaft's axes [rad/s]"] if turning else []
    heads = ("whirl [rad/s]", "[Hz]", *own, "damping ratio", "direction", "stability")
    answer.print_table(rows, heads, numbers=range(len(own) + 3))


def onset(
    scene: SceneName,
    settings: Settings = None,
    low: Low = None,
    high: Annotated[
        str | None,
        typer.Option(
            "--to",
            metavar="SPEED",
            help="Where to end. [default: 40 first frequencies]",
        ),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Lowest speed at which the straight rotor loses stability, and how it whirls there.

    jaxrotor onset limiter-rotor --set internal_damping.voigt_time=0.1ms
    jaxrotor onset limiter-rotor --from 1000rpm --to 9000rpm
    """
    rotor = scene_with(scene, settings)
    found = described_onset(onset_speed(rotor, _range(low, high)), axes_of(rotor))
    if as_json:
        answer.print_json({"scene": scene, **found})
        return
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
    answer.print_table(rows)


def described_onset(found: Onset, axes: str) -> dict[str, Any]:
    """An onset in numbers: speed [rad/s] and [rpm], whirl frequency [rad/s] and [Hz] in its axes."""
    speed, whirl = float(found.speed), float(found.whirl_frequency)
    if axes == "rotating" and marginal(whirl, speed):
        whirl = 0.0
    return {
        "speed": speed,
        "rpm": rpm(speed),
        "axes": axes,
        "whirl_frequency": whirl,
        "whirl_frequency_hz": whirl / (2 * math.pi),
        "kind": _kind(speed, whirl, axes),
    }


def _kind(speed: float, whirl: float, axes: str) -> str:
    """What the whirl at an onset looks like."""
    if axes == "rotating" and not whirl:
        return "with the shaft: it stands bent in its axes"
    if axes == "rotating":
        return f"at {speed - whirl:.7g} and {speed + whirl:.7g} rad/s in fixed axes"
    return "forward" if whirl > 0 else "backward" if whirl < 0 else "not at all"


def marginal(part: Any, root: Any) -> Any:
    """Whether the part of a root is zero within rounding."""
    return np.abs(part) <= 1e-9 * np.abs(root)


def _range(low: str | None, high: str | None) -> tuple[float, float] | None:
    """Speeds to search, or None for the default."""
    if high is None:
        if low is not None:
            raise ValueError("--from needs the other end of the range; add --to.")
        return None
    return interval(low, high)


def axes_of(rotor: Scene) -> str:
    """Axes of its roots: "fixed" or, turning with the shaft, "rotating"."""
    return frame(_blocks(rotor))


def _blocks(rotor: Scene) -> Blocks:
    """Which blocks there are, not their values."""
    return eqx.filter_eval_shape(assemble, rotor).blocks


def described_roots(rotor: Scene, count: int | None = None) -> tuple[str, list[dict[str, Any]]]:
    """Axes and the slowest roots; where axes are unequal, one of each conjugate pair.

    In axes that turn with the shaft a root `s + i w` whirls at `speed + w` and `speed - w` in fixed
    ones; its whirl is that of the larger part.
    """
    axes = axes_of(rotor)
    if isotropic(_blocks(rotor)):
        values = np.asarray(roots_of(rotor, count))
        return axes, [_described(value, value.imag, np.sign(value.imag)) for value in values]
    shown = modes(rotor)
    parts = [np.asarray(part) for part in (shown.shapes, shown.counter)]
    ahead, behind = (np.sum(np.abs(part) ** 2, axis=1) for part in parts)
    line = (ahead - behind) / (ahead + behind)  # 0 a straight one
    senses = np.where(np.abs(line) < 1e-6, 0.0, np.sign(line))
    speed = float(rotor.spin.speed)
    found = []
    for value, sense in zip(np.asarray(shown.values), senses.tolist(), strict=True):
        still = marginal(value.imag, value)
        if not np.isfinite(value) or (value.imag < 0 and not still):
            continue
        whirl = 0.0 if still else value.imag
        if axes == "rotating":
            root = value.real + 1j * (speed + (whirl if sense >= 0 else -whirl))
            straight = speed == sense == 0
            one = _described(root, root.imag, 0.0 if straight else np.sign(root.imag))
            found.append(one | {"root": value, "shaft_frequency": whirl})
        else:
            found.append(_described(value, whirl, 0.0 if still else sense))
    return axes, found[:count]


def _described(root: complex, whirl: float, sense: float) -> dict[str, Any]:
    """A root in numbers; `sense` of its whirl +1 forward, -1 backward, 0 neither."""
    still = bool(marginal(whirl, root)) or sense == 0
    return {
        "root": complex(root),
        "frequency": abs(whirl),
        "frequency_hz": abs(whirl) / (2 * math.pi),
        "damping_ratio": -root.real / abs(root) if root else math.nan,
        "direction": "none" if still else "forward" if sense > 0 else "backward",
        "stability": _stability(root),
    }


def _stability(root: complex) -> str:
    if marginal(root.real, root):
        return "marginal"
    return "stable" if root.real < 0 else "unstable"
