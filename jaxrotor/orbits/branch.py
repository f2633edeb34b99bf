"""Branch: orbits along one parameter of a scene, with the bifurcations between them."""

import math
from collections.abc import Sequence
from typing import Any

import equinox as eqx
import numpy as np
from jaxtyping import Bool, Complex, Float, Int

from ..core.tables import notebook_table
from ..scene import Scene
from .bifurcations import KINDS, Bifurcation, least_clearance, of_kind
from .corrector import Corrector, Point, Unknowns
from .orbit import PeriodicOrbit
from .problem import ContinuationProblem, Evaluation


class BranchPoint(eqx.Module):
    """A bifurcation on a branch: fold, flip, neimark-sacker, branching or grazing."""

    kind: str = eqx.field(static=True)
    value: float = eqx.field(static=True)  # of the parameter
    contact: int | None = eqx.field(static=True)  # of the scene, the one that is grazed
    place: float = eqx.field(static=True)  # between which points: 2.3 is after point 2
    whirl_rate: float = eqx.field(static=True)  # [1]
    radius_min: Float[np.ndarray, " s"]  # [m]
    radius_max: Float[np.ndarray, " s"]  # [m]
    multipliers: Complex[np.ndarray, " r"]  # largest first
    unknowns: Float[np.ndarray, " b"]  # of the problem of its branch

    @property
    def angle(self) -> float:
        """Angle of the multiplier nearest to the unit circle [rad], from 0 to pi."""
        nearest = np.argmin(np.abs(np.abs(self.multipliers) - 1))
        return abs(float(np.angle(self.multipliers[nearest])))


class AbstractBranch(eqx.Module):
    """Motions along one parameter of a scene, with the bifurcations between them."""

    values: eqx.AbstractVar[Float[np.ndarray, " N"]]  # of the parameter, SI
    # Bifurcations that were detected but not located: after which point, of which kind.
    unlocated: eqx.AbstractVar[tuple[tuple[int, str], ...]]
    reasons: eqx.AbstractVar[tuple[str, str]]  # why it ends, at its first and last point
    curve: eqx.AbstractVar[Any]

    @property
    def path(self) -> str:
        """Path of the parameter."""
        return self.curve.parameters[0].path

    @property
    def scene(self) -> Scene:
        """The scene of the motion that the branch was begun with."""
        return self.curve.scene

    @property
    def remarks(self) -> list[str]:
        """Lines on what was not located, and on both ends."""
        values = self.values
        lines = [
            f"  {kind} not located between {values[k]:.6g} and {values[k + 1]:.6g}"
            for k, kind in self.unlocated
        ]
        return [*lines, f"  begins: {self.reasons[0]}", f"  ends: {self.reasons[1]}"]


class Branch(AbstractBranch):
    """`N` orbits along a branch, at `s` stations, and the bifurcations between them."""

    values: Float[np.ndarray, " N"]  # of the parameter, SI
    period: Float[np.ndarray, " N"]  # [s]
    turn: Float[np.ndarray, " N"]  # [rad] in a period, whole turns included
    whirl_rate: Float[np.ndarray, " N"]  # turn / (period Omega) [1]
    radius_min: Float[np.ndarray, "N s"]  # [m] at the samples
    radius_max: Float[np.ndarray, "N s"]
    clearance: Float[np.ndarray, "N k"]  # least of every contact [m]; -inf where it always acts
    multipliers: Complex[np.ndarray, "N r"]  # largest first
    trivial: Float[np.ndarray, " N"] | None  # multiplier along a motion without unbalance
    unresolved: Int[np.ndarray, " N"]  # steps whose changes of contact were not located
    iterations: Int[np.ndarray, " N"]  # of the corrector
    points: tuple[BranchPoint, ...]
    # Bifurcations that were detected but not located: after which point, of which kind.
    unlocated: tuple[tuple[int, str], ...] = eqx.field(static=True)
    reasons: tuple[str, str] = eqx.field(static=True)  # why it ends, at its first and last point
    unknowns: Float[np.ndarray, "N b"]
    curve: ContinuationProblem
    tolerance: float = eqx.field(static=True)
    max_iterations: int = eqx.field(static=True)

    @property
    def stable(self) -> Bool[np.ndarray, " N"]:
        """Whether every multiplier is inside the unit circle."""
        return np.all(np.abs(self.multipliers) < 1, axis=1)

    def of(self, kind: str) -> tuple[BranchPoint, ...]:
        """The bifurcations of a kind."""
        return of_kind(self.points, kind, KINDS)

    def orbit(self, where: "int | BranchPoint") -> PeriodicOrbit:
        """The orbit at a point of the branch, by its number, or at a bifurcation."""
        return self.curve.orbit(self._at(where), self.look(where))

    def look(self, where: "int | BranchPoint") -> Evaluation:
        """The residual at a point or a bifurcation, with its Jacobian and samples of the motion."""
        u = self._at(where)
        return self.corrector.evaluate(u, self.curve.any_phase(u))

    def _at(self, where: "int | BranchPoint") -> Unknowns:
        return where.unknowns if isinstance(where, BranchPoint) else self.unknowns[where]

    @property
    def corrector(self) -> Corrector:
        """Newton's method for further orbits of the branch."""
        return Corrector(self.curve, self.tolerance, self.max_iterations)

    def _repr_html_(self) -> str:
        first, *rest = str(self).split("\n")
        texts = [line.strip() for line in rest[len(self.points) :]]
        rows = [(p.kind, p.value, p.whirl_rate, p.radius_max.max(), p.contact) for p in self.points]
        heads = ("point", self.path, "whirl rate", "largest radius [m]", "contact")
        return notebook_table("\n".join([first, *texts]), heads, rows)

    def __str__(self) -> str:
        values, folds = self.values, np.flatnonzero(np.diff(np.sign(np.diff(self.values)))) + 1
        way = " to ".join(f"{values[k]:.6g}" for k in (0, *folds, values.size - 1))
        lines = [
            f"Branch of {values.size} orbits, {self.path} from {way} [{self.scene.unit(self.path)}], "
            f"{int(self.stable.sum())} stable"
        ]
        lines += [f"  {_described(point)}" for point in self.points]
        return "\n".join([*lines, *self.remarks])


def check_point(branch: Any, point: Any, kinds: Sequence[str], why: str) -> None:
    """Raise unless a point is one of the bifurcations of a branch, of some kinds."""
    if not isinstance(branch, Branch):
        raise ValueError(
            "`branch` must be a result of `jaxrotor.continue_` or `jaxrotor.switch`, but is a "
            f"{type(branch).__name__}."
        )
    if isinstance(point, tuple) and point in branch.unlocated:
        after, kind = point
        low, high = branch.values[after : after + 2]
        raise ValueError(
            f"The {kind} between {branch.path} = {low:.6g} and {high:.6g} was detected but not located; "
            "continue there with a smaller `max_step`, and give one of `branch.points`."
        )
    kind = point.kind if isinstance(point, BranchPoint) else type(point).__name__
    if kind not in kinds:
        raise ValueError(
            f"`point` must be a {' or '.join(kinds)} of `branch.points`, {why}, but is a {kind}."
        )
    if not any(one is point for one in branch.points):
        raise ValueError(f"`point` must be of this `branch`, but is the {kind} of another one.")


def _described(point: BranchPoint) -> str:
    """A line on a bifurcation."""
    text = f"{point.kind} at {point.value:.9g}"
    if point.contact is not None:
        text += f", contact {point.contact}"
    if point.kind == "neimark-sacker":
        text += f", at {math.degrees(point.angle):.6g} degrees"
    return text


def branch_of(
    corrector: Corrector,
    points: Sequence[Point],
    found: Sequence[tuple[int, Bifurcation]],
    lost: Sequence[tuple[int, str]],
    reasons: tuple[str, str],
) -> Branch:
    """The branch of points in their order, with bifurcations by the point that each comes after."""
    problem, evaluations = corrector.problem, [point.evaluation for point in points]
    each = lambda name: np.array([getattr(evaluation, name) for evaluation in evaluations])
    whirl = each("turn") / (each("period") * each("speed"))
    radius = [problem.radius(evaluation) for evaluation in evaluations]
    unknowns = np.stack([point.u for point in points])
    return Branch(
        values=np.array([_value(problem, u) for u in unknowns]),
        period=each("period"),
        turn=each("turn"),
        whirl_rate=whirl,
        radius_min=np.stack([low for low, _ in radius]),
        radius_max=np.stack([high for _, high in radius]),
        clearance=np.stack([least_clearance(evaluation) for evaluation in evaluations]),
        multipliers=each("multipliers"),
        trivial=None if evaluations[0].trivial is None else each("trivial"),
        unresolved=np.array([int(evaluation.outcome.unresolved) for evaluation in evaluations]),
        iterations=np.array([point.iterations for point in points]),
        points=tuple(_branch_point(problem, after, one) for after, one in found),
        unlocated=tuple(lost),
        reasons=reasons,
        unknowns=unknowns,
        curve=problem,
        tolerance=corrector.tolerance,
        max_iterations=corrector.max_iterations,
    )


def _branch_point(problem: ContinuationProblem, after: int, found: Bifurcation) -> BranchPoint:
    evaluation = found.point.evaluation
    low, high = problem.radius(evaluation)
    return BranchPoint(
        found.kind,
        _value(problem, found.point.u),
        found.contact,
        after + found.fraction,
        float(evaluation.turn / (evaluation.period * evaluation.speed)),
        low,
        high,
        np.asarray(evaluation.multipliers),
        found.point.u,
    )


def _value(problem: ContinuationProblem, u: Unknowns) -> float:
    return float(problem.values(u)[0])
