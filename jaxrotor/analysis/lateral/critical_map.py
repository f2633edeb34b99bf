"""Undamped critical speed map: forward critical speeds over the stiffness of the bearings."""

import warnings
from typing import Any

import equinox as eqx
import numpy as np
from jaxtyping import Float

from ...core.plausibility import ImplausibleWarning
from ...core.quantities import with_values
from ...effects import (
    AbstractContact,
    DiscDamping,
    ExternalDamping,
    HystereticDamping,
    InternalDamping,
    Support,
)
from ...effects.base import AbstractCasing, AbstractDamping
from ...effects.layout import check_one_shaft
from ...equations.speed_tables import speed_range
from ...scene import Scene
from ...shafts import Constraint, FlexibleShaft
from ..balancing import bearing_stations
from ..critical import critical_speeds
from ..linearized import BEARINGS, linearized
from ..whirl_tables import synchronous


POINTS = 41  # stiffnesses, by default, from a hundredth to a hundred times that of the bearings
DECADES = 2
_LEFT_OUT = (Support, *BEARINGS, AbstractContact, AbstractCasing, AbstractDamping)
_LEFT_OUT += (ExternalDamping, DiscDamping, InternalDamping, HystereticDamping)
OWN = 25  # speeds at which the stiffness of the bearings is read


class CriticalMap(eqx.Module):
    """`c` forward critical speeds over `s` stiffnesses, the same of every bearing along every axis.

    `own` are the direct stiffnesses of the `b` bearings themselves at `w` speeds, first along x, then
    along y. Where one of these curves crosses a branch, the undamped rotor is critical.
    """

    stiffnesses: Float[np.ndarray, " s"]  # [N/m]
    speeds: Float[np.ndarray, "s c"]  # [rad/s], NaN where there are fewer
    rigid: Float[np.ndarray, " c"]  # on rigid bearings [rad/s], NaN of a shaft that does not bend
    bearings: Float[np.ndarray, " b"]  # stations [m]
    own_speeds: Float[np.ndarray, " w"]  # [rad/s]
    own: Float[np.ndarray, "w b 2"]  # kxx and kyy [N/m]


def critical_map(
    scene: Scene,
    stiffnesses: Any = None,
    count: int = 4,
    *,
    bearings: Any = None,
    highest: float | int | None = None,
) -> CriticalMap:
    """`det( K0 + k Sum column row - Omega^2 (M - G) ) = 0`: critical speeds on bearings of stiffness k.

    `K0` is that of the shaft. All supports at the bearings become one spring each, the same along x and
    y; those at other stations, such as seals, are left out, and so is damping. With k to infinity the
    displacement is held there: `rigid`.

    Args:
        scene: a rotor of one shaft without constraints, on supports, films or rolling bearings.
        stiffnesses: k [N/m], ascending; by default from a hundredth of the softest to a hundred times the
            stiffest of the bearings' own.
        count: largest number of forward critical speeds at each stiffness.
        bearings: stations of the bearings [m], by default those of all supports, of which there may then
            be two.
        highest: speed [rad/s] up to which the stiffness of the bearings is read, by default the end of
            their tables, else 2.5 times the speed of the scene.

    Returns:
        `CriticalMap`.

    Raises:
        ValueError: the scene has several shafts or constraints, there are not two bearings, a bearing has
            no support, or `stiffnesses` are not positive and ascending.

    Source: API RP 684 (2005), 2.3; Gunter (1966) on critical speed maps.
    """
    check_one_shaft(scene.shafts, "`critical_map`")
    if getattr(scene.shaft, "constraints", ()):
        raise ValueError(
            "A critical speed map varies the stiffness of the bearings, but the shaft has constraints, "
            "which are rigid; put a Support in place of each."
        )
    stations = bearings_of(scene, bearings)
    speeds, own = _own(scene, stations, highest)
    if stiffnesses is None:
        ends = np.log10([own[own > 0].min(), own.max()]) if (own > 0).any() else (6.0, 10.0)
        stiffnesses = np.logspace(ends[0] - DECADES, ends[1] + DECADES, POINTS)
    springs = np.atleast_1d(np.asarray(stiffnesses, float))
    if springs.ndim != 1 or not (springs > 0).all() or (np.diff(springs) <= 0).any():
        raise ValueError(
            f"`stiffnesses [N/m]` must be positive and ascending, but is {stiffnesses}."
        )
    with warnings.catch_warnings():  # of the softest and the hardest springs
        warnings.simplefilter("ignore", ImplausibleWarning)
        first = sprung(scene, stations, np.full((2, 2), springs[0]))
        rows = [_forward(first.replace({"supports.stiffness": k}), count) for k in springs.tolist()]
    rigid = rigid_speeds(scene, stations, count)
    return CriticalMap(springs, np.stack(rows), rigid, stations, speeds, own)


def sprung(scene: Scene, stations: Float[np.ndarray, "2"], stiffness: np.ndarray) -> Scene:
    """The rotor on springs alone, `kxx, kyy` [N/m] of each bearing, without seals and damping."""
    equal = (stiffness[:, 0] == stiffness[:, 1]).all()
    springs = [
        Support(at, kxx) if equal else Support(at, kxx=kxx, kyy=kyy)
        for at, (kxx, kyy) in zip(stations.tolist(), stiffness.tolist(), strict=True)
    ]
    return scene.of_parts(*_bare(scene), *springs)


def bearings_of(scene: Scene, given: Any = None) -> Float[np.ndarray, "2"]:
    """Stations [m] of the two bearings of a rotor: those given, else those of its supports."""
    stations = np.asarray(bearing_stations(scene) if given is None else given, float)
    films = [float(one.at) for kind in BEARINGS for one in scene.of(kind)]
    if given is None:
        stations = np.unique([*stations, *films])
    if stations.size != 2:
        found = ", ".join(f"{at:g} m" for at in stations) or "none"
        raise ValueError(
            f"A lateral analysis is of a rotor in two bearings, but the scene has {stations.size} "
            f"({found}); name the stations of the two by `bearings`."
        )
    return stations


def _bare(scene: Scene) -> list[Any]:
    """Effects that are neither bearings nor seals nor pedestals, and damp nothing."""
    return [one for one in scene.effects if not isinstance(one, _LEFT_OUT)]


def _forward(scene: Scene, count: int) -> Float[np.ndarray, " c"]:
    """Magnitudes of the first forward critical speeds [rad/s], NaN where there are fewer."""
    found = np.abs(np.asarray(critical_speeds(scene, count).forward))
    return np.pad(found, (0, count - found.size), constant_values=np.nan)


def rigid_speeds(scene: Scene, stations: Float[np.ndarray, "2"], count: int) -> np.ndarray:
    """Critical speeds of the shaft held at its bearings [rad/s]; NaN of a rigid one, which has none."""
    if not isinstance(scene.shaft, FlexibleShaft):
        return np.full(count, np.nan)
    held = with_values(scene.shaft, constraints=tuple(map(Constraint, stations.tolist())))
    return _forward(Scene(held, *_bare(scene), spin=scene.spin), count)


def _own(scene: Scene, stations: np.ndarray, highest: float | int | None) -> tuple[Any, Any]:
    """Speeds [rad/s] and direct stiffnesses of the bearings there (w, b, 2) [N/m]."""
    span = speed_range(synchronous(scene))
    top = 2.5 * abs(float(scene.spin.speed)) if highest is None else float(highest)
    low, high = (0.05 * top, top) if span is None else map(float, span)
    speeds = np.linspace(low, high if highest is None else min(high, top), OWN)
    return speeds, np.array([own_stiffness(scene, stations, speed) for speed in speeds.tolist()])


def own_stiffness(scene: Scene, stations: np.ndarray, speed: float) -> Float[np.ndarray, "b 2"]:
    """`kxx, kyy` [N/m] of the bearings of a rotor at a speed [rad/s], of all supports at each station."""
    speed *= float(scene.spin.sense)
    there = scene.at_speed(speed)
    if any(scene.of(kind) for kind in BEARINGS):
        there = linearized(there)
    held = [one for one in synchronous(there).of(Support) if one.at is not None]
    return np.array([_direct(held, at, speed) for at in stations.tolist()])


def _direct(supports: list[Support], at: float, speed: float) -> list[float]:
    """`kxx, kyy` [N/m] of the supports at a station and a speed."""
    there = [one.at_speed(speed) for one in supports if np.isclose(float(one.at), at, rtol=1e-9)]
    if not there:
        raise ValueError(
            f"There is no bearing at {at:g} m; supports are at "
            f"{', '.join(f'{float(one.at):g} m' for one in supports) or 'no station'}."
        )
    return np.sum([np.real(one.direct) for one in there], axis=0).tolist()
