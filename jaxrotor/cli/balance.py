"""Command `balance`: corrections in two planes, or what a ball balancer can do."""

import math
from typing import Annotated, Any

import jax.numpy as jnp
import numpy as np
import typer

from ..analysis import (
    balance_grade,
    balancer,
    first_moments,
    permissible_unbalance,
    rigid_correction,
    rigid_residual,
    total_mass,
)
from ..dataset import assumed
from ..effects import AbstractBodies, BallContact, Disc, Unbalance
from ..riccati import steady_speed
from ..scene import Scene
from ..shafts import RigidShaft
from ..spin import AbstractSpin, Drive, SpeedProfile
from ..units import quantity
from . import answer
from .options import AsJson, Layout, Row, SceneName, Settings, optional, rpm, scene_of


def balance(
    scene: SceneName,
    settings: Settings = None,
    row: Row = None,
    layout: Layout = None,
    planes: Annotated[
        str | None,
        typer.Option(
            metavar="LENGTH,LENGTH",
            help="Stations to correct at. [default: the outermost discs or unbalances]",
        ),
    ] = None,
    speed: Annotated[
        str | None,
        typer.Option(metavar="SPEED", help="Speed of service. [default: the scene's highest]"),
    ] = None,
    grade: Annotated[float, typer.Option(help="Grade G to be met [mm/s].")] = 6.3,
    as_json: AsJson = False,
) -> None:
    """Balance a rotor as a rigid body: what to add in two planes, and the grade G before and after.

    Of a rotor with a ball balancer: how much it can balance, and whether balance is stable. It is
    corrected in planes only where --planes asks for it.

    jaxrotor balance turbine-run-up --planes 0m,0.453m
    jaxrotor balance ball-balancer --set spin.speed=3000rpm
    """
    rotor = scene_of(scene, settings, row, layout)
    service = optional(speed, "rad/s", "--speed")
    service = _highest(rotor.spin) if service is None else service
    found: dict[str, Any] = {"scene": scene, **assumed(rotor), "speed": service}
    if rotor.of(AbstractBodies):
        found["balancer"] = _balancer(rotor.at_speed(service))
    if planes is not None or not rotor.of(AbstractBodies):
        found["planes"] = _corrections(rotor, _planes(rotor, planes), service, grade)
        if not isinstance(rotor.shaft, RigidShaft):
            typer.echo(
                "Note: this shaft bends, so the correction holds well below its first critical speed.",
                err=True,
            )
    if as_json:
        answer.print_json(found)
        return
    speeds = [("speed", f"{service:.6g} rad/s, {rpm(service):.6g} rpm")]
    answer.print_table([*speeds, *answer.assumed(rotor)])
    if "planes" in found:
        _print_planes(found["planes"], grade)
    if "balancer" in found:
        _print_balancer(found["balancer"])


# === two planes


def _planes(rotor: Scene, text: str | None) -> np.ndarray:
    if text is not None:
        stations = [quantity(part.strip(), "m", "--planes") for part in text.split(",")]
    else:
        placed = sorted(float(one.at) for one in (*rotor.of(Disc), *rotor.of(Unbalance)))
        stations = [*placed[:1], *placed[-1:]]
    if len(stations) != 2 or stations[0] == stations[1]:
        raise ValueError("A correction takes two different stations; add --planes, as in 0m,0.4m.")
    return np.asarray(rotor.stations(stations))


def _corrections(rotor: Scene, planes: np.ndarray, speed: float, grade: float) -> dict[str, Any]:
    moments, mass = first_moments(rotor), float(total_mass(rotor))
    corrections = rigid_correction(*moments, planes)
    left = rigid_residual(*moments, planes, corrections)
    residual = rigid_correction(*left, planes)
    before, after = (float(jnp.sum(jnp.abs(one))) for one in (corrections, residual))
    graded = [balance_grade(value, mass, speed) for value in (before, after)]
    return {
        "mass": mass,
        "unbalance": complex(moments.unbalance),
        "product": complex(moments.product),
        "corrections": [
            {"plane": plane, "moment": abs(one), "angle": math.atan2(one.imag, one.real)}
            for plane, one in zip(planes.tolist(), np.asarray(corrections).tolist(), strict=True)
        ],
        "before": {"unbalance": before, "grade": float(graded[0].value)},
        "residual": {"unbalance": after, "grade": float(graded[1].value)},
        "standard": float(graded[0].standard),
        "permissible": float(permissible_unbalance(grade, mass, speed)),
    }


def _print_planes(found: dict[str, Any], grade: float) -> None:
    rows = [
        (
            f"{one['plane']:.6g}",
            f"{1e6 * one['moment']:.6g}",
            f"{math.degrees(one['angle']):.5g}",
        )
        for one in found["corrections"]
    ]
    answer.print_table(rows, ("add at [m]", "[g mm]", "angle [deg]"), numbers=[0, 1, 2])
    before, after = found["before"], found["residual"]
    size = lambda one: f"{1e6 * one['unbalance']:.4g} g mm, G {one['grade']:.3g}"
    answer.print_table(
        [
            ("rotor", f"{found['mass']:.6g} kg"),
            ("before", f"{size(before)}, meets G {found['standard']:g}"),
            ("after", size(after)),
            (f"permissible at G {grade:g}", f"{1e6 * found['permissible']:.4g} g mm"),
        ]
    )


# === ball balancer


def _balancer(rotor: Scene) -> dict[str, Any]:
    groups, scales = balancer.groups_of(rotor)
    spread = [  # rows off one line, and not alike
        2 * np.pi * np.arange(count) / count + 0.3 * (row + 1)
        for row, count in enumerate(groups.balls)
    ]
    reaches = float(balancer.balance_margin(groups)) >= 0
    position = balancer.nearest_balanced(groups, spread) if reaches else spread
    contact = next(iter(rotor.of(BallContact)), None)
    pitch = None
    if contact is not None:
        radii = [row.race_radius for row in rotor.of(AbstractBodies) if float(row.masses.sum()) > 0]
        pitch = jnp.stack([balancer.pitch(contact.ball_radius, radius) for radius in radii])
    growth = float(balancer.growth_rate(groups, balancer.second_harmonics(position)))
    critical = float(groups.critical_speed * scales.rate)
    return {
        "capacity": float(groups.capacity * scales.moment),
        "imbalance": float(groups.imbalance * scales.moment),
        "balances": reaches,
        "critical_speed": critical,
        "above": float(rotor.spin.speed) > critical,
        "position": [np.mod(np.asarray(row), 2 * np.pi) for row in position] if reaches else None,
        "growth": growth * float(scales.rate) if reaches else None,
        "stable": growth <= 0 if reaches else None,
        "cautions": list(balancer.cautions(groups, position, pitch=pitch)),
    }


def _print_balancer(found: dict[str, Any]) -> None:
    critical, growth = found["critical_speed"], found["growth"]
    side = "above" if found["above"] else "not above"
    rows = [
        ("balls can balance", f"{1e3 * found['capacity']:.6g} g m"),
        ("the rotor has", f"{1e3 * found['imbalance']:.6g} g m"),
        (
            "critical speed",
            f"{critical:.6g} rad/s, the speed is {side} it"
            if math.isfinite(critical)
            else "none: the rotor is not long",
        ),
    ]
    if growth is not None:
        word = "stable" if found["stable"] else "unstable"
        rows.append(("balance", f"{word}, largest growth rate {growth:.4g} /s"))
        for number, row in enumerate(found["position"], 1):
            angles = ", ".join(f"{angle:.1f}" for angle in np.degrees(row))
            rows.append((f"for row {number} at", f"{angles} deg"))
    rows += [("caution", sentence) for sentence in found["cautions"]]
    answer.print_table(rows)


def _highest(spin: AbstractSpin) -> float:
    """Highest speed of service [rad/s] that the spin names."""
    speeds = [abs(float(spin.speed))]
    if isinstance(spin, SpeedProfile):
        speeds.append(float(jnp.max(jnp.abs(spin.speeds))))
    if isinstance(spin, Drive):
        parts = [0.0 if part is None else part for part in (spin.slope, spin.drag)]
        steady = abs(float(steady_speed(spin.torque, *parts)))
        speeds += [steady] if math.isfinite(steady) else []
    if not max(speeds):
        raise ValueError(
            "The rotor does not turn; add the speed of service, as in --speed 3000rpm."
        )
    return max(speeds)
