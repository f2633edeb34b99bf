"""Level I stability: logarithmic decrement of the rotor against cross-coupled stiffness."""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import numpy as np
from jaxtyping import Float
from scipy.optimize import brentq

from ...effects import Support
from ...files.machine import Machine
from ...scene import Scene
from ..modal import modes
from .critical_map import bearings_of, rigid_speeds


POINTS = 21  # stiffnesses from zero to `MOST` times the anticipated one
MOST = 10.0
BEYOND = 1e12  # N/m up to which the threshold is sought
_FIRST = 1e3  # N/m from which it is sought without stages
_STEP = 4.0  # factor between two stiffnesses of the search
_LITTLE = 1e-9  # of the scale, in place of zero, which would be another program
_MODES = 12  # slowest ones, among which the least damped forward whirl is
RATIO = 2.0  # least Q_0 / Q_A
AMPLE = 10.0  # from which the density of the gas does not matter
DECREMENT = 0.1  # least logarithmic decrement at Q_A
_FORWARD = 0.2  # sense of whirl from which a mode is forward
_FLAT = (16.53, 2.5)  # kg/m^3 up to which the limit of the critical speed ratio is constant
_SLOPE = (-0.0115, 2.69)  # of the limit beyond
_DENSE = 60.0  # kg/m^3 from which every ratio is in region B


class LevelOne(eqx.Module):
    """Decrements `delta(Q)` at the maximum continuous speed, and what a standard reads from them."""

    applied: Float[np.ndarray, " q"]  # sum Q of the cross-coupled stiffnesses [N/m]
    decrements: Float[np.ndarray, " q"]  # least logarithmic decrement of forward whirl
    stations: tuple[float, ...]  # [m], at which it acts
    shares: tuple[float, ...]  # of each station in the sum
    speed: float | int  # [rad/s]
    anticipated: float | int  # Q_A [N/m]
    threshold: float | int  # Q_0 at which the rotor becomes unstable [N/m], inf beyond `BEYOND`
    decrement: float | int  # delta_A, at Q_A
    frequency: float | int  # of whirl there [rad/s]
    critical_ratio: float | int  # CSR: speed over the first critical speed on rigid bearings
    gas_density: float | int  # [kg/m^3], NaN where it is unknown

    @property
    def ratio(self) -> float:
        """`Q_0 / Q_A`; infinite without anticipated cross coupling."""
        return self.threshold / self.anticipated if self.anticipated else np.inf

    @property
    def needed(self) -> bool:
        """Whether a Level I analysis is asked for: the rotor runs above its first rigid critical speed."""
        return self.critical_ratio > 1

    @property
    def in_region_b(self) -> bool:
        """Whether critical speed ratio and density ask for more; true where the density is unknown."""
        return not self.critical_ratio <= ratio_limit(self.gas_density)

    @property
    def passed(self) -> bool:
        """Whether no Level II analysis is needed: `Q_0 >= 2 Q_A`, `delta_A >= 0.1`, and region A.

        From `Q_0 = 10 Q_A` on the region does not matter.
        """
        region = self.ratio >= AMPLE or not self.in_region_b
        return self.ratio >= RATIO and self.decrement >= DECREMENT and region


def ratio_limit(density: float) -> float:
    """Critical speed ratio between regions A and B at a mean gas density [kg/m^3].

    Args:
        density: mean of suction and discharge; NaN where it is unknown.

    Returns:
        The largest ratio in region A; 0 where the density is unknown or above 60 kg/m^3.

    Source: API RP 684 (2005), SP6.8.5.10 and its figure.
    """
    if density <= _FLAT[0]:
        return _FLAT[1]
    return _SLOPE[0] * density + _SLOPE[1] if density <= _DENSE else 0.0


def level_one(scene: Scene, machine: Machine, rigid: float | int | None = None) -> LevelOne:
    """`F = -i Q z` on the shaft: how far the rotor is from whirl that is driven by its stages.

    Q acts at the middle of the bearing span, or of an overhung stage, whose station is outside of it, at
    every stage by its share of Q_A. `delta` is the least logarithmic decrement of all forward whirls.

    Args:
        scene: the rotor, linear.
        machine: its speeds and stages.
        rigid: first critical speed on rigid bearings [rad/s], where it is known already.

    Returns:
        `LevelOne`. Without stages Q_A is zero, and Q goes to a quarter above Q_0.

    Raises:
        ValueError: an overhung machine has stages without a station, or there are not two bearings.

    Source: API RP 684 (2005), SP6.8.5.
    """
    bearings = bearings_of(scene, machine.bearings)
    rigid = float(rigid_speeds(scene, bearings, 1)[0]) if rigid is None else float(rigid)
    stations, shares = _places(machine, bearings)
    speed = float(scene.spin.sense) * float(machine.fastest)
    own = [Support(at, 0.0, cross_stiffness=-1.0) for at in stations]
    driven = scene.at_speed(speed).of_parts(*scene.effects, *own)
    names = [driven.name_of(one) for one in own]
    sense = float(np.sign(speed))

    def at(total: float) -> Scene:
        parts = zip(names, shares, strict=True)
        return driven.replace({f"{k}.cross_stiffness": -sense * total * part for k, part in parts})

    least = lambda total: _least(at(max(total, _LITTLE * (machine.anticipated or _FIRST))))
    threshold = _threshold(lambda total: least(total)[0], machine.anticipated or _FIRST)
    most = MOST * machine.anticipated or 1.25 * min(threshold, BEYOND)
    applied = np.linspace(0.0, most, POINTS)
    decrements = np.array([least(total)[0] for total in applied.tolist()])
    reached = least(machine.anticipated)
    return LevelOne(
        applied=applied,
        decrements=decrements,
        stations=tuple(stations),
        shares=tuple(shares),
        speed=abs(speed),
        anticipated=machine.anticipated,
        threshold=threshold,
        decrement=reached[0],
        frequency=reached[1],
        critical_ratio=abs(speed) / rigid,
        gas_density=np.nan if machine.gas_density is None else float(machine.gas_density),
    )


def _places(machine: Machine, bearings: np.ndarray) -> tuple[list[float], list[float]]:
    """Stations at which the cross coupling acts, and the share of each in its sum."""
    low, high = bearings.tolist()
    given = [None if stage.at is None else float(stage.at) for stage in machine.stages]
    if not any(at is not None and not low <= at <= high for at in given):
        return [(low + high) / 2], [1.0]
    if None in given:
        raise ValueError(
            "A stage outside of the bearings has its cross coupling at its own station, so every stage "
            f"needs `at [m]`, but stage {given.index(None) + 1} has none; give it."
        )
    each = np.array([one.cross_coupling(float(machine.fastest)) for one in machine.stages])
    return [float(at) for at in given if at is not None], (each / each.sum()).tolist()


def _least(scene: Scene) -> tuple[float, float]:
    """Least logarithmic decrement of forward whirl, and its frequency [rad/s]."""
    found = modes(scene, _MODES, points=2)
    decrement, frequency = np.asarray(found.log_decrement), np.abs(np.asarray(found.values.imag))
    forward = (np.asarray(found.forward) > _FORWARD) & np.isfinite(decrement) & (frequency > 0)
    k = int(np.where(forward, decrement, np.inf).argmin())
    return float(decrement[k]), float(frequency[k])


def _threshold(decrement: Callable[[float], float], first: float) -> float:
    """Stiffness [N/m] at which the least decrement is zero; 0 where it is so without, else inf."""
    low, high = 0.0, first
    if decrement(low) <= 0:
        return 0.0
    while decrement(high) > 0:
        low, high = high, _STEP * high
        if high > BEYOND:
            return np.inf
    zero: Any = brentq(decrement, low, high, xtol=1e-9 * high)
    return float(zero)
