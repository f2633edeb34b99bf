"""Lateral analysis of a machine as a standard asks for it, and what it passes."""

import dataclasses
from collections.abc import Mapping
from typing import Any

import equinox as eqx
import numpy as np

from ...core.plain import plain
from ...core.progress import waiting
from ...core.tables import notebook_table
from ...effects import Disc
from ...files.machine import Machine
from ...scene import Scene
from .criteria import HEADS, Criterion, criteria, verdict
from .scene_analysis import SceneAnalysis, analysed


ONLY = "as given"  # name of the scene where there is one
_MAP = ("stiffnesses", "speeds", "rigid", "own_speeds", "own")
_CAMPBELL = ("speeds", "frequencies", "growth")
_CASE = ("largest", "scale", "scaled")
_RESPONSE = ("speeds", "stations", "major")
_MODES = ("values", "stations", "shapes", "counter")
_STATICS = ("films", "speeds", "load", "eccentricity", "attitude")


class LateralAnalysis(eqx.Module):
    """Lateral analysis of a machine: answers for each of its scenes, and the criteria of the standard."""

    machine: Machine
    scenes: Mapping[str, SceneAnalysis]

    @property
    def criteria(self) -> list[Criterion]:
        """Every demand, scene by scene."""
        parts = self.scenes.items()
        return [one for name, part in parts for one in criteria(name, part, self.machine)]

    @property
    def summary(self) -> list[Criterion]:
        """Demands that are not met, and of each paragraph that is met the one with the least room."""
        ordered = sorted(self.criteria, key=lambda one: one.room)
        least: dict[tuple[str, str], Criterion] = {}
        for one in ordered:
            least.setdefault((one.paragraph, one.unit), one)
        return [one for one in ordered if not one.passed or one in least.values()]

    @property
    def passed(self) -> bool:
        """Whether every demand is met."""
        return all(one.passed for one in self.criteria)

    def margins(self, name: str) -> list[dict[str, Any]]:
        """Rows of the table of peaks of a scene: amplification factors and separation margins.

        Each row has `case`, `probe`, `speed` [rad/s], `amplitude` (peak to peak [m]), `amplification`,
        `margin`, `required` and `kept`.
        """
        return list(self.scenes[name].margins(self.machine))

    def data(self) -> dict[str, Any]:
        """All numbers in plain lists and dictionaries, SI, as for JSON; infinite ones are None."""
        found = {
            "passed": self.passed,
            "criteria": [one._asdict() for one in self.criteria],
            "scenes": {name: _data(part, self.machine) for name, part in self.scenes.items()},
        }
        return plain(found)

    def _repr_html_(self) -> str:
        rows = [one.texts for one in self.summary]
        return notebook_table(f"Lateral analysis: {verdict(self.passed)}", HEADS, rows)


def lateral_analysis(
    scene: Scene | Mapping[str, Scene], machine: Machine, *, progress: bool | None = None
) -> LateralAnalysis:
    """Lateral analysis in the style of API Standard 617 and API RP 684, with pass or fail of each demand.

    Undamped critical speed map, Campbell diagram, damped response to the unbalance cases that the
    standard places by mode shape, amplification factors with separation margins, close clearances, and
    Level I stability. Contacts such as limiters are left out; films and rolling bearings are linear about
    their static position. Coefficients over the frequency of whirl are reduced to those of synchronous
    whirl; the largest growth rate alone is that of whirls with the coefficients at their own frequencies.

    Args:
        scene: the rotor, or several by name, as with the smallest and the largest clearance of the
            bearings: `{"smallest clearance": .., "largest clearance": ..}`.
        machine: running range, probes, close clearances and stages.
        progress: whether to report after two seconds that it is running; by default on a terminal.

    Returns:
        `LateralAnalysis`.

    Raises:
        ValueError: a scene has several shafts, constraints or not two bearings, `machine` has no probe, or
            coefficients over speed do not reach from the slowest to the trip speed.

    Source: API RP 684, 2nd edition (2005), standard paragraphs SP6.8.2 and SP6.8.5.
    """
    scenes = {ONLY: scene} if isinstance(scene, Scene) else dict(scene)
    if not machine.probes:
        raise ValueError(
            "A lateral analysis reads the response at probes, but the machine has none; give `probes`."
        )
    if not scenes:
        raise ValueError("A lateral analysis needs a scene, but `scene` has none; give one.")
    _check_same(scenes)
    with waiting(progress, "lateral analysis"):
        found = {name: analysed(one, machine) for name, one in scenes.items()}
        return LateralAnalysis(machine, found)


def _check_same(scenes: Mapping[str, Scene]) -> None:
    """Raise unless the scenes are of one rotor: as long, with its discs at the same stations."""
    rotors = {}
    for name, one in scenes.items():
        discs = sorted((float(disc.at), float(disc.mass)) for disc in one.of(Disc))
        rotors[name] = np.array([float(one.shaft.length), *np.ravel(discs)])
    (first, own), *others = rotors.items()
    for name, other in others:
        if own.shape != other.shape or not np.allclose(own, other, rtol=1e-9):
            raise ValueError(
                f"Scenes of one analysis are one rotor in other bearings, but {first!r} and {name!r} "
                "differ in the length of the shaft or in their discs; change the bearings alone."
            )


def _data(part: SceneAnalysis, machine: Machine) -> dict[str, Any]:
    """Numbers of a scene."""
    read = lambda source, names: {name: getattr(source, name) for name in names}
    own = part.stability
    return {
        "bearings": part.bearings,
        "coefficients": list(part.coefficients(machine)),
        "reduced": part.reduced,
        "statics": None if part.statics is None else read(part.statics, _STATICS),
        "critical_map": read(part.map, _MAP),
        "undamped": read(part.undamped, _MODES),
        "campbell": read(part.campbell, _CAMPBELL) | {"critical": part.critical.speeds},
        "growth": part.growth,
        "modes": read(part.modes, _MODES),
        "margins": list(part.margins(machine)),
        "clearances": list(part.clearances(machine)),
        "cases": [
            one.case._asdict()
            | read(one, _CASE)
            | read(one.response, _RESPONSE)
            | {"shapes": read(one.shapes, _RESPONSE)}
            for one in part.cases
        ],
        "level_one": read(own, [f.name for f in dataclasses.fields(own)] + ["ratio"]),
    }
