"""Commands `roots` and `onset`: the straight rotor's own motions."""

import math
from typing import Annotated, Any

import numpy as np
import typer

from ..analysis import Onset, onset_speed, roots as roots_of
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
        rotor = rotor.replace({"spin.speed": quantity(speed, "rad/s", "--speed")})
    found = [_described(complex(value)) for value in np.asarray(roots_of(rotor, count))]
    if as_json:
        answer.print_json({"scene": scene, "speed": rotor.get("spin.speed"), "roots": found})
        return
    rows = [
        (
            f"{root['frequency']:.7g}",
            f"{root['frequency_hz']:.6g}",
            f"{root['damping_ratio']:.4g}",
            root["direction"],
            root["stability"],
        )
        for root in found
    ]
    heads = ("whirl [rad/s]", "[Hz]", "damping ratio", "direction", "stability")
    answer.print_table(rows, heads, numbers=[0, 1, 2])


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
    found = described_onset(onset_speed(rotor, _range(low, high)))
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
    answer.print_table(rows)


def described_onset(found: Onset) -> dict[str, float]:
    """An onset in numbers: speed [rad/s] and [rpm], whirl frequency [rad/s] and [Hz]."""
    speed, whirl = float(found.speed), float(found.whirl_frequency)
    return {
        "speed": speed,
        "rpm": rpm(speed),
        "whirl_frequency": whirl,
        "whirl_frequency_hz": whirl / (2 * math.pi),
    }


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


def _described(root: complex) -> dict[str, Any]:
    still, undamped = bool(marginal(root.imag, root)), bool(marginal(root.real, root))
    return {
        "root": root,
        "frequency": abs(root.imag),
        "frequency_hz": abs(root.imag) / (2 * math.pi),
        "damping_ratio": -root.real / abs(root) if root else math.nan,
        "direction": "none" if still else "forward" if root.imag > 0 else "backward",
        "stability": "marginal" if undamped else "stable" if root.real < 0 else "unstable",
    }
