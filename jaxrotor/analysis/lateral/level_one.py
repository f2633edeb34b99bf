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
from ..whirl_tables import synchronous
from .critical_map import bearings_of, rigid_speeds
from .unbalance_cases import is_overhung, overhung_masses


POINTS = 21  # stiffnesses from zero to `MOST` times the anticipated one
MOST = 10.0
BEYOND = 1e12  # N/m up to which the threshold is sought
_FIRST = 1e3  # N/m from which it is sought without stages
_STEP = 4.0  # factor between two stiffnesses of the search
_LITTLE = 1e-9  # of the scale, in place of zero, which would be another program
_MODES = 16  # slowest ones, among which the one that Q drives is
_ROUNDING = 1e-9  # decrement, or imaginary part over the root, that is rounding
_FAR = 12  # stiffnesses from `MOST` Q_A to beyond Q_0, by which the mode is followed
_BEYOND_ZERO = 1.02  # times Q_0, where it is unstable
RATIO = 2.0  # least Q_0 / Q_A
AMPLE = 10.0  # from which the density of the gas does not matter
DECREMENT = 0.1  # least logarithmic decrement at Q_A
_FLAT = (16.53, 2.5)  # kg/m^3 up to which the limit of the critical speed ratio is constant
_SLOPE = (-0.0115, 2.69)  # of the limit beyond
_DENSE = 60.0  # kg/m^3 from which every ratio is in region B


class LevelOne(eqx.Module):
    """Decrements `delta(Q)` at the maximum continuous speed, and what a standard reads from them."""

    applied: Float[np.ndarray, " q"]  # sum Q of the cross-coupled stiffnesses [N/m]
    decrements: Float[np.ndarray, " q"]  # logarithmic decrement of the mode that Q drives
    stations: tuple[float, ...]  # [m], at which it acts
    shares: tuple[float, ...]  # of each station in the sum
    speed: float | int  # [rad/s]
    anticipated: float | int  # Q_A [N/m]
    threshold: float | int  # Q_0 at which the rotor becomes unstable [N/m], inf beyond `BEYOND`
    decrement: float | int  # delta_A, at Q_A
    frequency: float | int  # of whirl there [rad/s]
    critical_ratio: float | int  # CSR: speed over the first critical speed on rigid bearings
    gas_density: float | int  # [kg/m^3], NaN where it is unknown
    # Whether all stages are axial, which `delta_A` alone judges
    axial: bool = eqx.field(static=True)

    @property
    def ratio(self) -> float:
        """`Q_0 / Q_A`; infinite without anticipated cross coupling."""
        return self.threshold / self.anticipated if self.anticipated else np.inf

    @property
    def above_rigid(self) -> bool:
        """Whether the rotor runs above its first critical speed on rigid bearings."""
        return self.critical_ratio > 1

    @property
    def in_region_b(self) -> bool:
        """Whether critical speed ratio and density ask for more; true where the density is unknown."""
        return not self.critical_ratio <= ratio_limit(self.gas_density)

    @property
    def conditions(self) -> list[tuple[str, float, float, bool]]:
        """Conditions that spare a Level II analysis: words, number, limit, and whether it is met.

        `delta_A >= 0.1`, and of rotors with impellers `Q_0 >= 2 Q_A`, and region A or `Q_0 >= 10 Q_A`.
        """
        damped = self.decrement >= DECREMENT
        found = [("logarithmic decrement at QA", self.decrement, DECREMENT, damped)]
        if not self.axial:
            found.append(("Q0 / QA", self.ratio, RATIO, self.ratio >= RATIO))
        if not self.axial and self.ratio < AMPLE:
            density = "" if np.isfinite(self.gas_density) else ", of unknown gas density region B"
            what, limit = (
                f"critical speed ratio, in region A{density}",
                ratio_limit(self.gas_density),
            )
            found.append((what, self.critical_ratio, limit, not self.in_region_b))
        return found

    @property
    def passed(self) -> bool:
        """Whether no Level II analysis is needed."""
        return all(met for *_, met in self.conditions)


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

    Q acts at the middle of the bearing span or, where a stage is outside of it, at every stage by its
    share of Q_A. `delta` is the logarithmic decrement of the mode that becomes unstable at Q_0, followed
    from there back to Q = 0; of a rotor that stays stable, of the least damped one. Coefficients over the
    frequency of whirl are reduced to those of synchronous whirl.

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
    scene = synchronous(scene)
    bearings = bearings_of(scene, machine.bearings)
    rigid = float(rigid_speeds(scene, bearings, 1)[0]) if rigid is None else float(rigid)
    stations, shares = _places(scene, machine, bearings)
    speed = float(scene.spin.sense) * float(machine.fastest)
    own = [Support(at, 0.0, cross_stiffness=-1.0) for at in stations]
    driven = scene.at_speed(speed).of_parts(*scene.effects, *own)
    names = [driven.name_of(one) for one in own]
    sense = float(np.sign(speed))

    def at(total: float) -> Scene:
        parts = zip(names, shares, strict=True)
        return driven.replace({f"{k}.cross_stiffness": -sense * total * part for k, part in parts})

    first = machine.anticipated or _FIRST
    rooted = lambda total: _oscillating(at(max(total, _LITTLE * first)))
    threshold = _threshold(lambda total: min(map(_decrement, rooted(total))), first)
    most = MOST * machine.anticipated or 1.25 * min(threshold, BEYOND)
    applied = np.linspace(0.0, most, POINTS)
    followed = _followed(rooted, applied, threshold)
    reached = followed[np.abs(applied - machine.anticipated).argmin()]
    return LevelOne(
        applied=applied,
        decrements=np.array([_decrement(root) for root in followed]),
        stations=tuple(stations),
        shares=tuple(shares),
        speed=abs(speed),
        anticipated=machine.anticipated,
        threshold=threshold,
        decrement=_decrement(reached),
        frequency=abs(reached.imag),
        critical_ratio=abs(speed) / rigid,
        gas_density=np.nan if machine.gas_density is None else float(machine.gas_density),
        axial=bool(machine.stages) and all(one.kind == "axial" for one in machine.stages),
    )


def _places(
    scene: Scene, machine: Machine, bearings: np.ndarray
) -> tuple[list[float], list[float]]:
    """Stations at which the cross coupling acts, and the share of each in its sum."""
    low, high = bearings.tolist()
    given = [None if stage.at is None else float(stage.at) for stage in machine.stages]
    outside = any(at is not None and not low <= at <= high for at in given)
    heavy = is_overhung(scene, max(overhung_masses(scene, bearings)))
    if None in given and (outside or heavy):
        raise ValueError(
            "A stage outside of the bearings has its cross coupling at its own station, so every stage "
            f"of an overhung rotor needs `at [m]`, but {machine.stages[given.index(None)].label} has "
            "none; give it."
        )
    if not outside:
        return [(low + high) / 2], [1.0]
    each = np.array(machine.cross_couplings)
    return [float(at) for at in given if at is not None], (each / each.sum()).tolist()


def _oscillating(scene: Scene) -> list[complex]:
    """The slowest roots [rad/s] that oscillate."""
    every = np.asarray(modes(scene, _MODES, points=2).fixed_values).tolist()
    kept = [root for root in every if abs(root.imag) > _ROUNDING * abs(root)]
    if not kept:
        raise ValueError(
            "No motion of the rotor oscillates, so it has no logarithmic decrement; check its damping."
        )
    return kept


def _decrement(root: complex) -> float:
    """Logarithmic decrement of a root."""
    return -2 * np.pi * root.real / abs(root.imag)


def _followed(
    rooted: Callable[[float], list[complex]], applied: np.ndarray, threshold: float
) -> list[complex]:
    """The root that becomes unstable, at every stiffness: followed down from where it is."""
    most = float(applied[-1])
    far = np.geomspace(most, _BEYOND_ZERO * threshold, _FAR) if most < threshold < np.inf else []
    root = min(rooted(float(far[-1]) if len(far) else most), key=_decrement)
    found = []
    for total in [*far[-2:0:-1], *applied[::-1].tolist()]:
        before = root
        root = min(rooted(float(total)), key=lambda one: abs(one - before))
        found.append(root)
    return found[::-1][: applied.size]


def _threshold(decrement: Callable[[float], float], first: float) -> float:
    """Stiffness [N/m] at which the least decrement is zero; 0 where it is so without, else inf."""
    above = lambda total: decrement(total) + _ROUNDING
    low, high = 0.0, first
    if above(low) < 0:
        return 0.0
    while above(high) > 0:
        low, high = high, _STEP * high
        if high > BEYOND:
            return np.inf
    zero: Any = brentq(above, low, high, xtol=1e-9 * high)
    return float(zero)
