"""Lateral analysis of one scene, such as a rotor in bearings of the smallest clearance."""

from collections.abc import Iterator
from typing import Any

import equinox as eqx
import numpy as np
from jaxtyping import Float

from ...core.tables import RPM
from ...effects import AbstractContact, JournalBearing, Support
from ...effects.film import AbstractFluid
from ...effects.layout import check_one_shaft
from ...equations.speed_tables import has_whirl_tables, speed_range
from ...files.machine import Machine
from ...scene import Scene
from ..campbell import Campbell, campbell
from ..critical import CriticalSpeeds, critical_speeds
from ..films import StaticPositions
from ..growth import growth_rates
from ..linearized import BEARINGS, linearized, static_positions
from ..modal import Modes, modes
from ..peaks import MOST
from ..whirl_tables import OverWhirl, synchronous
from .critical_map import CriticalMap, bearings_of, critical_map
from .damped_response import SHARE, CaseResponse, damped_response
from .level_one import LevelOne, level_one
from .unbalance_cases import HIGHEST, critical_modes, of_modes, unbalance_cases


BRANCHES = 8  # of the Campbell diagram
_POINTS = 201  # speeds of the response
_EVERY = 4  # of these speeds the Campbell diagram has
_SLOW = 0.1  # of the slowest speed: where the response begins
_TABLES = 40  # speeds at which films are linearized
_SLOWEST = 24  # modes among which those shown are
_SHOWN = 1.25  # times the maximum continuous speed: frequencies of the modes that are shown


class SceneAnalysis(eqx.Module):
    """Answers for one scene, such as that with the smallest clearance of the bearings."""

    scene: Scene
    bearings: Float[np.ndarray, "2"]  # stations [m]
    map: CriticalMap
    growth: float | int  # largest one up to the trip speed [1/s], NaN where it is unknown
    undamped: Modes  # at the critical speeds of the undamped rotor, which place the unbalance
    campbell: Campbell
    critical: CriticalSpeeds  # undamped, on the bearings as they are
    modes: Modes  # damped, at the maximum continuous speed
    statics: StaticPositions | None  # of films, at the minimum, rated and maximum continuous speed
    cases: tuple[CaseResponse, ...]
    stability: LevelOne
    # Whether a bearing is a plain one, which drives whirl
    fixed_pads: bool = eqx.field(static=True)

    @property
    def speeds(self) -> tuple[float, float]:
        """Slowest and fastest speed of the response [rad/s], magnitudes."""
        every = np.abs(np.asarray(self.cases[0].response.speeds))
        return float(every.min()), float(every.max())

    @property
    def reduced(self) -> bool:
        """Whether coefficients over the frequency of whirl were reduced to synchronous ones."""
        return any(one.synchronous for one in self.scene.of(Support))

    def coefficients(self, machine: Machine) -> Iterator[dict[str, float]]:
        """Rows of the table of bearings: `at` [m], `speed` [rad/s], `kxx` .. `kyy` [N/m], `cxx` .. `cyy`.

        Each support at a bearing has rows at the minimum, rated and maximum continuous speed.
        """
        for support in self.scene.of(Support):
            if support.at is None or not np.isclose(self.bearings, float(support.at)).any():
                continue
            for speed in judged_speeds(machine):
                there = support.at_speed(float(self.scene.spin.sense) * speed)
                own = {name: float(value) for name, value in there.coefficients.items()}
                yield {"at": float(support.at), "speed": speed} | own

    def clearances(self, machine: Machine) -> Iterator[dict[str, Any]]:
        """Rows of the table of close clearances: `case`, `clearance`, `scale`, `scaled`, `limit`, `kept`.

        The scaled vibration and its limit are peak to peak [m].
        """
        for response in self.cases:
            for clearance, used in zip(machine.clearances, response.scaled.tolist(), strict=True):
                limit = SHARE * float(clearance.diametral)
                yield {
                    "case": response.case.name,
                    "clearance": clearance.label,
                    "scale": response.scale,
                    "scaled": used,
                    "limit": limit,
                    "kept": used < limit,
                }

    def margins(self, machine: Machine) -> Iterator[dict[str, Any]]:
        """Rows of the table of peaks, see `LateralAnalysis.margins`."""
        sense = float(self.scene.spin.sense)
        slowest, fastest = sense * float(machine.slowest), sense * float(machine.fastest)
        for response in self.cases:
            for probe, peaks in zip(machine.probes, response.peaks, strict=True):
                actual, required = peaks.margins(slowest, fastest)
                caps = np.where(np.abs(peaks.speeds) > abs(fastest), MOST["above"], MOST["below"])
                required = np.where(np.isnan(required), caps, required)  # of an unknown AF
                for k, speed in enumerate(peaks.speeds.tolist()):
                    yield {
                        "case": response.case.name,
                        "probe": probe.label,
                        "speed": speed,
                        "amplitude": 2 * float(peaks.amplitudes[k]),
                        "amplification": float(peaks.amplification_at_most[k]),
                        "margin": float(actual[k]),
                        "required": float(required[k]),
                        "kept": bool(actual[k] >= required[k]),
                    }


def analysed(scene: Scene, machine: Machine) -> SceneAnalysis:
    """Answers for a scene, see `lateral_analysis`."""
    check_one_shaft(scene.shafts, "`lateral_analysis`")
    _check_stations(scene, machine)
    bearings = bearings_of(scene, machine.bearings)
    speeds = _speeds(synchronous(scene), machine)
    own = _linear(scene, speeds)
    rotor = synchronous(own)
    diagram = campbell(rotor, speeds[::_EVERY], BRANCHES)
    undamped = critical_modes(rotor, machine, bearings)
    cases = unbalance_cases(rotor, machine, bearings, undamped)
    found = critical_map(rotor, bearings=bearings, highest=float(abs(speeds).max()))
    critical = critical_speeds(rotor)
    return SceneAnalysis(
        scene=rotor,
        bearings=bearings,
        map=found,
        growth=_growth(own, diagram, machine),
        undamped=undamped,
        campbell=diagram,
        critical=critical,
        modes=_modes(rotor, machine),
        statics=_statics(scene, machine),
        cases=tuple(damped_response(rotor, case, machine, speeds, critical) for case in cases),
        stability=level_one(rotor, machine, float(found.rigid[0])),
        fixed_pads=bool(scene.of(JournalBearing)),
    )


def judged_speeds(machine: Machine) -> list[float]:
    """Minimum operating, rated and maximum continuous speed [rad/s], equal ones once."""
    speeds = float(machine.slowest), machine.rated_speed, float(machine.fastest)
    return list(dict.fromkeys(speeds))


def _growth(scene: Scene, diagram: Campbell, machine: Machine) -> float:
    """Largest growth rate up to the trip speed [1/s]; over the frequency of whirl by that of each root."""
    running = np.abs(np.asarray(diagram.speeds)) <= machine.highest
    if has_whirl_tables(scene):
        return float(growth_rates(OverWhirl.of(scene), diagram.speeds[running]).max())
    return float(np.asarray(diagram.growth)[running].max())


def _modes(rotor: Scene, machine: Machine) -> Modes:
    """Damped modes of frequencies up to 1.25 times the maximum continuous speed, or up to the trip speed.

    Those that are damped so far that they have no resonance, by more than `1 / sqrt(2)`, are left out.
    """
    found = modes(rotor.at_speed(float(rotor.spin.sense) * float(machine.fastest)), _SLOWEST)
    frequencies = np.abs(np.imag(found.fixed_values))
    within = frequencies <= max(_SHOWN * float(machine.fastest), machine.highest)
    return of_modes(found, within & (np.asarray(found.damping_ratio) < np.sqrt(0.5)))


def _statics(scene: Scene, machine: Machine) -> StaticPositions | None:
    """Static positions in films; None where there are none."""
    if not scene.of(AbstractFluid):
        return None
    found = static_positions(scene, float(scene.spin.sense) * np.array(judged_speeds(machine)))
    return found if isinstance(found, StaticPositions) else None


def _check_stations(scene: Scene, machine: Machine) -> None:
    """Raise unless everything of the machine is on the shaft."""
    places = [(one.label, one.at) for one in (*machine.probes, *machine.clearances)]
    places += [(one.label, one.at) for one in machine.stages if one.at is not None]
    couplings = [] if machine.couplings is None else np.asarray(machine.couplings).tolist()
    for name, at in [*places, *(("coupling", at) for at in couplings)]:
        if float(at) > float(scene.shaft.length):
            raise ValueError(
                f"The {name} of the machine is at {float(at):g} m, but the shaft ends at "
                f"{float(scene.shaft.length):g} m; give a station on it."
            )


def _speeds(scene: Scene, machine: Machine) -> Float[np.ndarray, " w"]:
    """Speeds of the response [rad/s]: up to 1.5 times the maximum continuous one, within the tables."""
    low, high = (
        _SLOW * float(machine.slowest),
        max(HIGHEST * float(machine.fastest), machine.highest),
    )
    sense = float(scene.spin.sense)
    if (span := speed_range(scene, sense)) is not None:
        first, last = map(float, span)
        if first > machine.slowest or last < machine.highest:
            raise ValueError(
                f"Coefficients over speed go from {RPM * first:.6g} to {RPM * last:.6g} rpm, but the "
                f"machine runs from {RPM * float(machine.slowest):.6g} to a trip speed of "
                f"{RPM * machine.highest:.6g} rpm; extend the tables, or set `hold`."
            )
        low, high = max(low, first), min(high, last)
    return np.sort(sense * np.linspace(low, high, _POINTS))


def _linear(scene: Scene, speeds: np.ndarray) -> Scene:
    """The rotor without contact, on supports in place of films and rolling bearings."""
    if any(scene.of(kind) for kind in BEARINGS):
        ends = float(speeds.min()), float(speeds.max())
        scene = linearized(scene, np.linspace(*ends, _TABLES))
    others = (one for one in scene.effects if not isinstance(one, AbstractContact))
    return scene.of_parts(*others)
