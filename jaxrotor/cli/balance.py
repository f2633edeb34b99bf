"""Command `balance`: corrections in two planes, or capacity and stability of a ball balancer."""

import math
from typing import Annotated, Any, NamedTuple

import jax.numpy as jnp
import numpy as np
import typer

from ..analysis import (
    allocated_unbalance,
    balance_grade,
    balancer,
    bearing_grade,
    bearing_stations,
    centre_of_mass,
    first_moments,
    permissible_unbalance,
    rigid_correction,
    rigid_residual,
    settled,
    total_mass,
)
from ..effects import AbstractBodies, Disc, Unbalance
from ..equations.system import polar_inertia
from ..files.units import quantity
from ..results.provenance import assumed
from ..scene import Scene
from ..shafts import RigidShaft
from ..spins.drive import Drive
from ..spins.profile import SpeedProfile
from . import answer, options


_ROUNDING = 1e-12  # residual, relative to the state before, that counts as zero


def balance(
    scene: options.SceneName,
    settings: options.Settings = None,
    row: options.Row = None,
    layout: options.Layout = None,
    planes: Annotated[
        str | None,
        typer.Option(
            metavar="LENGTH,LENGTH",
            help="Stations of the two correction planes. [default: the outermost discs or unbalances]",
        ),
    ] = None,
    speed: Annotated[
        str | None,
        typer.Option(
            metavar="SPEED",
            help="Service speed. [default: that of the scene: the steady speed of a drive, the highest of "
            "a profile]",
        ),
    ] = None,
    grade: Annotated[
        float,
        typer.Option(
            help="Grade G to be met [mm/s]: the permissible unbalance, G m / speed, is allocated to the "
            "two bearings by ISO 21940-11, and the unbalance in each must not exceed its share."
        ),
    ] = 6.3,
    as_json: options.AsJson = False,
) -> None:
    """Balance a rotor as a rigid body: corrections in two planes, and grade G before and after.

    Static unbalance and couple are referred to the planes of the two bearings, so G does not depend on
    --planes. For a rotor without two bearings, G is that of the static unbalance alone. No files are
    written; use --json for the numbers.

    For a rotor with a ball balancer, the answer is how much it can balance, and whether balance is
    stable. Corrections are then computed only if --planes is given.

    jaxrotor balance turbine-run-up --planes 0m,0.453m
    jaxrotor balance ball-balancer --set spin.speed=3000rpm
    """
    rotor = options.scene_of(scene, settings, row, layout)
    service, origin = _service(rotor, speed)
    found: dict[str, Any] = {"scene": scene, **assumed(rotor), "speed": service, "speed_of": origin}
    if rotor.of(AbstractBodies):
        found["balancer"] = _balancer(rotor.at_speed(service))
    if planes is not None or not rotor.of(AbstractBodies):
        found["planes"] = _corrections(rotor, _planes(rotor, planes), service, grade)
        if not isinstance(rotor.shaft, RigidShaft):
            answer.note(
                "this shaft bends, so the correction holds only well below its first critical speed."
            )
    speed_row = ("speed", f"{service:.6g} rad/s, {options.rpm(service):.6g} rpm, {origin}")
    shown: list[Any] = [[speed_row, *answer.assumed(rotor.assumption)]]
    if "planes" in found:
        shown += _plane_tables(found["planes"], grade)
    if "balancer" in found:
        shown.append(_balancer_rows(found["balancer"]))
    answer.give(as_json, found, *shown)


# === two planes


def _planes(rotor: Scene, text: str | None) -> np.ndarray:
    """Stations [m] of the two correction planes."""
    if text is not None:
        stations = [quantity(part.strip(), "m", "--planes") for part in text.split(",")]
    else:
        placed = sorted(float(one.at) for one in (*rotor.of(Disc), *rotor.of(Unbalance)))
        stations = [*placed[:1], *placed[-1:]]
    if len(stations) != 2 or stations[0] == stations[1]:
        known = ", ".join(f"{at:g} m" for at in stations) or "none"
        raise ValueError(
            f"A correction needs two different stations, but has {known}; give --planes, as in "
            f"--planes 0m,{float(rotor.shaft.length):g}m."
        )
    return np.asarray(rotor.stations(stations))


def _corrections(rotor: Scene, planes: np.ndarray, speed: float, grade: float) -> dict[str, Any]:
    moments = first_moments(rotor)
    corrections = rigid_correction(*moments, planes)
    left = rigid_residual(*moments, planes, corrections)
    state = _State.of(rotor, speed)
    before = state.described(*moments)
    return {
        "mass": state.mass,
        "centre": state.centre,
        "unbalance": complex(moments.unbalance),
        "product": complex(moments.product),
        "corrections": [
            {"plane": plane, "moment": abs(one), "angle": _angle(one)}
            for plane, one in zip(planes.tolist(), np.asarray(corrections).tolist(), strict=True)
        ],
        "bearings": state.bearings.tolist() if state.held else None,
        "before": before,
        "residual": state.described(*left, before),
        "grade": grade,
        "permissible": state.permissible(grade),
    }


class _State(NamedTuple):
    """Properties of a rotor that determine its grade for a given unbalance."""

    mass: float
    centre: float
    bearings: np.ndarray
    speed: float

    @classmethod
    def of(cls, rotor: Scene, speed: float) -> "_State":
        stations = np.asarray(bearing_stations(rotor))
        stations = stations[[0, -1]] if stations.size > 1 else np.zeros(0)
        return cls(float(total_mass(rotor)), float(centre_of_mass(rotor)), stations, speed)

    @property
    def held(self) -> bool:
        """Whether there are two bearings."""
        return self.bearings.size > 0

    def described(self, unbalance: Any, product: Any, whole: Any = None) -> dict[str, Any]:
        """Static unbalance, couple, unbalance at the bearings [kg m] and grade.

        Values within rounding of those of the `whole` unbalance, if given, are zero.
        """
        couple = abs(complex(product - unbalance * self.centre))
        found: dict[str, Any] = {"static": abs(complex(unbalance)), "couple": couple}
        if self.held:
            loads = np.abs(np.asarray(rigid_correction(unbalance, product, self.bearings)))
            found["bearings"] = loads.tolist()
            place = (self.mass, self.centre, self.bearings, self.speed)
            graded = bearing_grade(unbalance, product, *place)
        else:
            graded = balance_grade(unbalance, self.mass, self.speed)
        found |= {"grade": float(graded.value), "standard": float(graded.standard)}
        if whole is None:
            return found
        most = max(whole["static"], *whole.get("bearings", [0.0]))
        small = lambda now, once: 0.0 if now < _ROUNDING * once else now
        found["static"] = small(found["static"], most)
        found["couple"] = small(found["couple"], whole["couple"] + most * abs(self.centre))
        found["grade"] = small(found["grade"], whole["grade"])
        if self.held:
            found["bearings"] = [small(one, most) for one in found["bearings"]]
        return found

    def permissible(self, grade: float) -> dict[str, Any]:
        """Permissible unbalance of a grade [kg m], in total and at each bearing."""
        total = permissible_unbalance(grade, self.mass, self.speed)
        found: dict[str, Any] = {"static": float(total)}
        if self.held:
            shares = allocated_unbalance(total, self.centre, self.bearings)
            found["bearings"] = np.asarray(shares).tolist()
        return found


def _angle(moment: complex) -> float:
    """Angle [rad], with parts within rounding set to zero."""
    size = abs(moment)
    parts = (0.0 if abs(part) < _ROUNDING * size else part for part in (moment.imag, moment.real))
    return math.atan2(*parts)


def _plane_tables(found: dict[str, Any], grade: float) -> list[answer.Table]:
    """Corrections in the planes, and unbalance and grade before, after and as permitted."""
    size = lambda value, factor=1e6, digits=4: f"{factor * value:.{digits}g}"
    added = [
        (f"{one['plane']:.6g}", size(one["moment"], digits=6), f"{math.degrees(one['angle']):.5g}")
        for one in found["corrections"]
    ]
    states = [found[key] for key in ("before", "residual", "permissible")]
    rows = [
        ("static [g mm]", *(size(one["static"]) for one in states)),
        ("couple [g mm^2]", *(size(one["couple"], 1e9) for one in states[:2]), ""),
    ]
    for i, at in enumerate(found["bearings"] or ()):
        name = f"bearing at {at:.6g} m [g mm]"
        rows.append((name, *(size(one["bearings"][i]) for one in states)))
    rows.append(("grade G [mm/s]", *(f"{one['grade']:.3g}" for one in states[:2]), f"{grade:g}"))
    heads = (f"rotor of {found['mass']:.6g} kg", "before", "after", "permitted")
    return [
        answer.Table(added, ("add at [m]", "[g mm]", "angle [deg]"), range(3)),
        answer.Table(rows, heads, range(1, 4)),
    ]


# === ball balancer


def _balancer(rotor: Scene) -> dict[str, Any]:
    groups, scales = balancer.groups_of(rotor)
    spread = [  # positions off one line, different for every row
        2 * np.pi * np.arange(count) / count + 0.3 * (row + 1)
        for row, count in enumerate(groups.balls)
    ]
    reaches = float(balancer.balance_margin(groups)) >= 0
    position = balancer.nearest_balanced(groups, spread) if reaches else spread
    rows = [row for row in rotor.of(AbstractBodies) if float(row.masses.sum()) > 0]
    pitch = None
    if all(row.ball_radius is not None for row in rows):
        pitch = jnp.stack([balancer.pitch(row.ball_radius, row.race_radius) for row in rows])
    growth = float(balancer.growth_rate(groups, balancer.second_harmonics(position)))
    critical = float(groups.critical_speed * scales.rate)
    return {
        "capacity": float(groups.capacity * scales.moment),
        "imbalance": float(groups.imbalance * scales.moment),
        "balances": reaches,
        "critical_speed": critical,
        "above": abs(float(rotor.spin.speed)) > critical,
        "position": [np.mod(np.asarray(row), 2 * np.pi) for row in position] if reaches else None,
        "growth": growth * float(scales.rate) if reaches else None,
        "stable": growth <= 0 if reaches else None,
        "cautions": list(balancer.cautions(groups, position, pitch=pitch)),
    }


def _balancer_rows(found: dict[str, Any]) -> answer.Rows:
    """Capacity of the balls, and where they balance the rotor."""
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
    return rows + [("caution", sentence) for sentence in found["cautions"]]


def _service(rotor: Scene, text: str | None) -> tuple[float, str]:
    """Service speed [rad/s], and a description of its origin."""
    spin = rotor.spin
    if text is not None:
        speed, origin = quantity(text, "rad/s", "--speed"), "as given"
        if not speed:
            raise ValueError("--speed must not be 0.")
    elif isinstance(spin, Drive):
        polar = float(spin.inertia(polar_inertia(rotor)))
        speed, origin = settled(spin, polar).speed, "steady speed of the drive"
    elif isinstance(spin, SpeedProfile):
        highest = spin.speeds[jnp.argmax(jnp.abs(spin.speeds))]
        speed, origin = float(highest), "highest of the profile"
    else:
        speed, origin = float(spin.speed), "that of the scene"
    if not speed:
        raise ValueError(
            "The speed of the rotor is 0; add the service speed, as in --speed 3000rpm."
        )
    return speed, origin
