"""Criteria: demands of the standard on a rotor, each with the number found and its limit."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from ...core.tables import FAIL, RPM
from ...files.machine import Machine
from ..peaks import DAMPED
from .scene_analysis import BRANCHES, SceneAnalysis


REACH = 1.26  # times the maximum continuous speed, below which a peak may be too close
HEADS = ("paragraph", "scene", "demand", "found", "limit", "unit", "verdict")


class Criterion(NamedTuple):
    """One demand of the standard: the number found, its limit, and whether it is met."""

    paragraph: str  # of API RP 684 (2005), "-" of a demand that is not in it
    scene: str
    what: str
    value: float
    limit: float
    unit: str
    passed: bool

    @property
    def room(self) -> float:
        """Distance from the limit over the limit, negative where the demand is not met.

        It is infinite of a limit of zero and where the number found is unknown.
        """
        known = self.limit != 0 and not np.isnan(self.value)
        distance = abs(self.value - self.limit) / abs(self.limit) if known else np.inf
        return distance if self.passed else -distance

    @property
    def texts(self) -> tuple[str, ...]:
        """Cells of its row in a table, below `HEADS`."""
        numbers = f"{self.value:.4g}", f"{self.limit:.4g}"
        return self.paragraph, self.scene, self.what, *numbers, self.unit, verdict(self.passed)


def criteria(name: str, part: SceneAnalysis, machine: Machine) -> Iterator[Criterion]:
    """Demands on one scene, by its name."""
    for row in part.margins(machine):
        if row["amplification"] < DAMPED:
            continue
        where = f"margin of the peak at {RPM * abs(row['speed']):.0f} rpm, {row['case']}, {row['probe']}"
        numbers = 100 * row["margin"], 100 * row["required"]
        yield Criterion("SP6.8.2.10", name, where, *numbers, "%", row["kept"])
    for response in part.cases:
        case, limit = response.case.name, 1e6 * response.limit
        for probe, largest in zip(machine.probes, 1e6 * response.largest, strict=True):
            what = f"largest vibration in the running range, {case}, {probe.label}"
            yield Criterion(
                "SP6.8.2.11", name, what, float(largest), limit, "um", bool(largest <= limit)
            )
    for row in part.clearances(machine):
        what = f"scaled vibration up to trip speed, {row['case']}, {row['clearance']}"
        numbers = 1e6 * row["scaled"], 1e6 * row["limit"]
        yield Criterion("SP6.8.2.13", name, what, *numbers, "um", row["kept"])
    reach = part.speeds[1] / float(machine.fastest)
    what = "reach of the response, in maximum continuous speeds"
    yield Criterion("SP6.8.2.10", name, what, reach, REACH, "1", reach >= REACH)
    whose = "coefficients of each whirl" if part.reduced else f"{BRANCHES} slowest branches"
    unknown = ", unknown as one beyond the tables may grow" if np.isnan(part.growth) else ""
    what = f"largest growth rate up to trip speed, {whose}{unknown}"
    yield Criterion("-", name, what, part.growth, 0.0, "1/s", part.growth < 0)
    own = part.stability
    if machine.stages and (own.above_rigid or part.fixed_pads):
        for what, value, limit, met in own.conditions:
            yield Criterion("SP6.8.5.10", name, f"{what}, or Level II", value, limit, "1", met)


def verdict(passed: bool) -> str:
    """Word for a demand that is met or not."""
    return "pass" if passed else FAIL
