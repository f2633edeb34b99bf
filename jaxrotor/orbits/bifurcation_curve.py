"""Bifurcation curve: the bifurcations of one kind over two parameters of a scene."""

import math
from collections.abc import Sequence
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Complex, Float, Int

from ..core.tables import notebook_table
from ..scene import Scene
from .bifurcations import Bifurcation, of_kind
from .bordered import AbstractCondition
from .codimension_two import KINDS, PointOfCurve, other_multipliers, side_of
from .corrector import Unknowns
from .orbit import PeriodicOrbit
from .parameter_range import ParameterRange, own
from .problem import ContinuationProblem, check_symmetry


class CurvePoint(eqx.Module):
    """A point of codimension two on a curve of bifurcations, named as in `BifurcationCurve.of`."""

    kind: str = eqx.field(static=True)
    values: Float[np.ndarray, "2"]  # of the parameters
    place: float = eqx.field(static=True)  # between which points: 2.3 is after point 2
    multipliers: Complex[np.ndarray, " r"]  # largest first
    unknowns: Float[np.ndarray, " b"]  # of the problem of its curve


class BifurcationCurve(eqx.Module):
    """`N` orbits at a bifurcation, at `s` stations, and the points of codimension two between them."""

    values: Float[np.ndarray, "N 2"]  # of the parameters, SI
    period: Float[np.ndarray, " N"]  # [s]
    whirl_rate: Float[np.ndarray, " N"]  # turn / (period Omega) [1]
    radius_min: Float[np.ndarray, "N s"]  # [m] at the samples
    radius_max: Float[np.ndarray, "N s"]
    multipliers: Complex[np.ndarray, "N r"]  # largest first
    angle: Float[np.ndarray, " N"]  # of the critical multipliers [rad], 0 to pi; 0 of grazing
    outside: Int[np.ndarray, " N"]  # multipliers outside the unit circle, without the critical ones
    # Unit vectors across the curve, in the units of the ranges. They point to where there are two orbits
    # (fold), the critical multipliers are inside the unit circle (flip, Neimark-Sacker), or the clearance
    # is positive (grazing).
    side: Float[np.ndarray, "N 2"]
    iterations: Int[np.ndarray, " N"]  # of the corrector
    points: tuple[CurvePoint, ...]
    # Points that were detected but not located: after which point, of which kind.
    unlocated: tuple[tuple[int, str], ...] = eqx.field(static=True)
    reasons: tuple[str, str] = eqx.field(static=True)  # why it ends, at its first and last point
    unknowns: Float[np.ndarray, "N b"]
    problem: ContinuationProblem
    condition: AbstractCondition

    @property
    def kind(self) -> str:
        """Kind of the bifurcation: fold, flip, neimark-sacker or grazing."""
        return self.condition.kind

    @property
    def contact(self) -> int | None:
        """The contact of the scene that is grazed."""
        return self.condition.contact

    @property
    def paths(self) -> tuple[str, ...]:
        """Paths of the two parameters."""
        return tuple(one.path for one in self.problem.parameters)

    @property
    def scene(self) -> Scene:
        """The scene of the orbit that the curve was begun with."""
        return self.problem.scene

    @property
    def stable(self) -> Bool[np.ndarray, " N"]:
        """Whether a stable orbit gains or loses its stability here: all other multipliers are inside."""
        return self.outside == 0

    def of(self, kind: str) -> tuple[CurvePoint, ...]:
        """The points of codimension two of a kind, such as "cusp" or "1:2 resonance"."""
        return of_kind(self.points, kind, KINDS)

    def orbit(self, where: int | CurvePoint) -> PeriodicOrbit:
        """The orbit at a point of the curve, by its number, or at one of codimension two."""
        u = self._at(where)
        return self.problem.orbit(u, self.condition.evaluation(self.problem, u))

    def derivative(self, where: int | CurvePoint, path: str) -> Float[np.ndarray, "2"]:
        """How the curve moves at a point with a third parameter, by the implicit function theorem.

            residual(x, p1, p2, p3) = 0,  g(x, p1, p2, p3) = 0

        It takes one more compiled program.

        Args:
            where: number of a point, or a point of codimension two, which itself moves along the curve,
                too.
            path: path of the third parameter.

        Returns:
            `dp1/dp3` at constant `p2`, and `dp2/dp3` at constant `p1`; infinite where the curve is
            parallel to the axis.

        Raises:
            ValueError: if `path` is one of the curve's own parameters, has several values, or breaks the
                symmetry of an orbit without unbalance.
        """
        if path in self.paths:
            raise ValueError(
                f"`path` must be a third parameter, but `{path}` is one of the curve's own."
            )
        u, problem = self._at(where), self.problem
        value = own(problem.scene, path)
        scale = abs(value) or 1.0
        if problem.revolutions is None:
            check_symmetry(problem.scene, path, float(problem.turn), (value, value + 1e-3 * scale))
        third = ParameterRange(
            jnp.asarray(value, float), jnp.asarray(value + scale, float), path, False
        )
        problem = eqx.tree_at(lambda one: one.parameters, problem, (*problem.parameters, third))
        u = np.append(u, 0.0)
        anchor = self.condition.anchor(self.condition.evaluation(problem, u), u)
        jacobian = self.condition.trial(problem, u, anchor).jacobian_at_own_phase
        state, (first, second, change) = jacobian[:, :-3], jacobian[:, -3:].T
        return np.array(
            [
                _moved(state, first, change) * problem.rates(u)[0] / scale,
                _moved(state, second, change) * problem.rates(u)[1] / scale,
            ]
        )

    def _at(self, where: int | CurvePoint) -> Unknowns:
        return where.unknowns if isinstance(where, CurvePoint) else self.unknowns[where]

    def _repr_html_(self) -> str:
        first, *rest = str(self).split("\n")
        texts = [line.strip() for line in rest[len(self.points) :]]
        rows = [(point.kind, *point.values) for point in self.points]
        return notebook_table("\n".join([first, *texts]), ("point", *self.paths), rows)

    def __str__(self) -> str:
        count, stable = len(self.values), int(self.stable.sum())
        low, high = self.values.min(axis=0), self.values.max(axis=0)
        spans = [
            f"{path} from {a:.6g} to {b:.6g} [{self.scene.unit(path)}]"
            for path, a, b in zip(self.paths, low, high, strict=True)
        ]
        kind = self.kind if self.contact is None else f"{self.kind} of contact {self.contact}"
        lines = [
            f"Curve of {count} orbits ({kind}), {', '.join(spans)}; {stable} of them bound stable orbits"
        ]
        lines += [
            f"  {one.kind} at {one.values[0]:.9g}, {one.values[1]:.9g}" for one in self.points
        ]
        lines += [f"  {kind} not located after point {after}" for after, kind in self.unlocated]
        lines += [f"  begins: {self.reasons[0]}", f"  ends: {self.reasons[1]}"]
        return "\n".join(lines)


def _moved(state: np.ndarray, place: np.ndarray, change: np.ndarray) -> float:
    """Derivative of a place by the third one, with the other constant."""
    matrix = np.column_stack([state, place])
    if np.linalg.matrix_rank(matrix) < len(matrix):
        return math.inf
    return -float(np.linalg.solve(matrix, change)[-1])


def curve_of(
    problem: ContinuationProblem,
    condition: AbstractCondition,
    points: Sequence[PointOfCurve],
    found: Sequence[tuple[int, Bifurcation]],
    lost: Sequence[tuple[int, str]],
    reasons: tuple[str, str],
) -> BifurcationCurve:
    """The curve of points in their order, with those of codimension two by the point each comes after."""
    evaluations: Any = [point.evaluation for point in points]
    each = lambda name: np.array([getattr(evaluation, name) for evaluation in evaluations])
    kind, radius = condition.kind, [problem.radius(evaluation) for evaluation in evaluations]
    others = [other_multipliers(kind, point) for point in points]
    located = [
        CurvePoint(
            one.kind,
            _values(problem, one.point.u),
            after + one.fraction,
            np.asarray(one.point.evaluation.multipliers),
            one.point.u,
        )
        for after, one in found
    ]
    return BifurcationCurve(
        values=np.stack([_values(problem, point.u) for point in points]),
        period=each("period"),
        whirl_rate=each("turn") / (each("period") * each("speed")),
        radius_min=np.stack([low for low, _ in radius]),
        radius_max=np.stack([high for _, high in radius]),
        multipliers=each("multipliers"),
        angle=np.array([point.anchor.angle for point in points]),
        outside=np.array([int(np.sum(np.abs(values) >= 1)) for values in others]),
        side=np.stack([side_of(kind, point) for point in points]),
        iterations=np.array([point.iterations for point in points]),
        points=tuple(located),
        unlocated=tuple(lost),
        reasons=reasons,
        unknowns=np.stack([point.u for point in points]),
        problem=problem,
        condition=condition,
    )


def _values(problem: ContinuationProblem, u: Unknowns) -> Float[np.ndarray, "2"]:
    return np.array([float(value) for value in problem.values(u)])
