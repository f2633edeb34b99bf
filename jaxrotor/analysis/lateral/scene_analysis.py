"""Lateral analysis of one scene, such as a rotor in bearings of the smallest clearance."""

from collections.abc import Iterator
from typing import Any

import equinox as eqx
import numpy as np
from jaxtyping import Float

from ...core.tables import RPM
from ...effects import AbstractContact, JournalBearing
from ...effects.layout import check_one_shaft
from ...equations.speed_tables import speed_range
from ...files.machine import Machine
from ...scene import Scene
from ..campbell import Campbell, campbell
from ..critical import CriticalSpeeds, critical_speeds
from ..linearized import BEARINGS, linearized
from ..peaks import MOST
from .critical_map import CriticalMap, bearings_of, critical_map
from .damped_response import CaseResponse, damped_response
from .level_one import LevelOne, level_one
from .unbalance_cases import HIGHEST, unbalance_cases


BRANCHES = 8  # of the Campbell diagram
_POINTS = 201  # speeds of the response
_EVERY = 4  # of these speeds the Campbell diagram has
_SLOW = 0.1  # of the slowest speed: where the response begins
_TABLES = 40  # speeds at which films are linearized


class SceneAnalysis(eqx.Module):
    """Answers for one scene, such as that with the smallest clearance of the bearings."""

    scene: Scene
    bearings: Float[np.ndarray, "2"]  # stations [m]
    map: CriticalMap
    campbell: Campbell
    critical: CriticalSpeeds  # undamped, on the bearings as they are
    cases: tuple[CaseResponse, ...]
    stability: LevelOne
    # Whether a bearing is a plain one, which drives whirl
    fixed_pads: bool = eqx.field(static=True)

    @property
    def speeds(self) -> tuple[float, float]:
        """Slowest and fastest speed of the response [rad/s], magnitudes."""
        every = np.abs(np.asarray(self.cases[0].response.speeds))
        return float(every.min()), float(every.max())

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
    speeds = _speeds(scene, machine)
    rotor, plain = _linear(scene, speeds), bool(scene.of(JournalBearing))
    cases = unbalance_cases(rotor, machine, bearings)
    found = critical_map(rotor, bearings=bearings, highest=float(abs(speeds).max()))
    diagram = campbell(rotor, speeds[::_EVERY], BRANCHES)
    critical = critical_speeds(rotor)
    responses = [damped_response(rotor, case, machine, speeds, critical) for case in cases]
    stability = level_one(rotor, machine, float(found.rigid[0]))
    return SceneAnalysis(
        rotor, bearings, found, diagram, critical, tuple(responses), stability, plain
    )


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
