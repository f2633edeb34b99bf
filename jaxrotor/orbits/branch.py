"""Branch: orbits along one parameter of a scene, with the bifurcations between them."""

import dataclasses
import math
from collections.abc import Sequence

import equinox as eqx
import numpy as np
from jaxtyping import Bool, Complex, Float, Int

from ..core.tables import notebook_table
from ..scene import Scene
from .bifurcations import KINDS, Bifurcation, least_clearance, of_kind
from .corrector import Corrector, Point, StepError, Unknowns
from .orbit import PeriodicOrbit
from .problem import ContinuationProblem, Evaluation, PhaseCondition


# Of the state: distances from a flip to seek its branch at
OFFSETS = (3e-3, 1e-3, 3e-4, 1e-4, 3e-5)


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


class Branch(eqx.Module):
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
    def path(self) -> str:
        """Path of the parameter."""
        return self.curve.parameters[0].path

    @property
    def scene(self) -> Scene:
        """The scene of the orbit that the branch was begun with."""
        return self.curve.scene

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
        return self._corrector.evaluate(u, self.curve.any_phase(u))

    def doubled(self, flip: BranchPoint) -> PeriodicOrbit:
        """An orbit of twice the period on the branch that begins at a flip, near it.

            x = x* + h v,   M v = -v

        The derivative of that branch by the parameter is zero at the flip, so its first orbit is sought
        at a distance. The orbit can be continued like any other.

        Args:
            flip: one of `Branch.of("flip")`.

        Returns:
            A `PeriodicOrbit` of twice the period.

        Raises:
            ValueError: if `flip` is not a point of the kind "flip".
            RuntimeError: if no orbit of twice the period is found near it.
        """
        kind = flip.kind if isinstance(flip, BranchPoint) else type(flip).__name__
        if kind != "flip":
            raise ValueError(f"`flip` must be a point of the kind 'flip', but is a {kind}.")
        u, evaluation = flip.unknowns, self.look(flip)
        m = evaluation.direction.size
        along = np.linalg.svd(evaluation.jacobian[:m, :m] + 2 * np.eye(m))[2][-1]
        normal = np.append(along, np.zeros(u.size - m))
        corrector = self._corrector._replace(problem=_with_twice_the_period(self.curve))
        condition = PhaseCondition(u[:m], evaluation.direction)
        for offset in OFFSETS:
            distance = offset * float(np.linalg.norm(u[:m]))
            guess = u + distance * normal
            try:
                point = corrector.point(guess, normal, condition, normal)
            except StepError:
                continue
            if np.linalg.norm(point.u - guess) < 0.3 * distance:
                return corrector.problem.orbit(point.u, point.evaluation, point.iterations)
        raise RuntimeError(
            f"No orbit of twice the period was found near the flip at {self.path} = {flip.value:.9g}; "
            "continue with more steps, or a smaller `tolerance`."
        )

    def _at(self, where: "int | BranchPoint") -> Unknowns:
        return where.unknowns if isinstance(where, BranchPoint) else self.unknowns[where]

    @property
    def _corrector(self) -> Corrector:
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
        lines += [
            f"  {kind} not located between {self.values[k]:.6g} and {self.values[k + 1]:.6g}"
            for k, kind in self.unlocated
        ]
        lines += [f"  begins: {self.reasons[0]}", f"  ends: {self.reasons[1]}"]
        return "\n".join(lines)


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


def _with_twice_the_period(problem: ContinuationProblem) -> ContinuationProblem:
    steps = 2 * problem.plan.steps
    plan = dataclasses.replace(problem.plan, steps=steps, max_steps=steps)
    if problem.revolutions is not None:
        plan = plan if problem.beats else problem.plan  # which is of one revolution
        return dataclasses.replace(problem, plan=plan, revolutions=2 * problem.revolutions)
    images = 1 if problem.images == 1 else problem.images // math.gcd(problem.images, 2)
    turn = 2 * problem.turn
    return dataclasses.replace(problem, plan=plan, span=2 * problem.span, turn=turn, images=images)
