"""Bordered systems: one equation more, which holds where an orbit bifurcates, and its derivatives.

    A y + b g = 0,  c . y = 1        g(x, s) = 0 where A is singular;  dg = -z . dA y

`A` is the Jacobian of the residual for a fold, `M + 1` for a flip; `z` solves the transposed equations,
`b` and `c` are the null vectors at the last point. Of a Neimark-Sacker pair, with the multipliers `mu_1`
and `mu_2`, the null spaces `V`, `W` of `M^2 - (mu_1 + mu_2) M + mu_1 mu_2` have two dimensions:

    S = (W' V)^-1 W' M V,    g = det S - 1,    2 cos(angle) = tr S

`M` is the derivative of the period map, without its multiplier 1 along a motion of unknown period.

Source: Govaerts (2000), Numerical Methods for Bifurcations of Dynamical Equilibria, chapter 4; Kuznetsov
(2004), Elements of Applied Bifurcation Theory, sections 10.3, 10.4.
"""

import abc
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float, Int

from ..core.compiled import QUICKLY
from ..motion.revolutions import joined
from .bifurcations import nearest_extremum
from .corrector import StepError, Unknowns, jacobian_at_own_phase
from .problem import (
    ContinuationProblem,
    Evaluation,
    PhaseCondition,
    clearances,
    evaluation_of,
    with_slopes,
)


Matrix = Float[np.ndarray, "m m"]


class Anchor(NamedTuple):
    """Phase condition and null vectors of a neighbour, with which a point of a curve is computed."""

    phase: PhaseCondition
    right: Float[np.ndarray, "a r"]
    left: Float[np.ndarray, "a r"]
    angle: float  # of the multipliers on the unit circle [rad]


class Trial(NamedTuple):
    """An evaluation with one equation more, `g = 0`."""

    evaluation: Evaluation
    value: float  # g
    slope: Unknowns  # its derivatives by all unknowns
    anchor: Anchor  # for the next trial

    @property
    def residual(self) -> np.ndarray:
        return np.append(self.evaluation.residual, self.value)

    @property
    def jacobian(self) -> np.ndarray:
        return np.vstack([self.evaluation.jacobian, self.slope])

    @property
    def jacobian_at_own_phase(self) -> np.ndarray:
        return np.vstack([jacobian_at_own_phase(self.evaluation), self.slope])

    @property
    def outcome(self) -> Any:
        return self.evaluation.outcome


class AbstractCondition(eqx.Module):
    """An equation that holds along a curve of bifurcations of one kind."""

    kind: eqx.AbstractVar[str]
    contact: eqx.AbstractVar[int | None]

    @abc.abstractmethod
    def evaluation(self, problem: ContinuationProblem, u: Unknowns) -> Evaluation:
        """The residual and all that comes with it, by the program that trials are evaluated with."""

    @abc.abstractmethod
    def anchor(self, evaluation: Evaluation, u: Unknowns) -> Anchor:
        """The anchor of the first point of a curve, from its evaluation."""

    @abc.abstractmethod
    def trial(self, problem: ContinuationProblem, u: Unknowns, anchor: Anchor) -> Trial:
        """The residual and the equation at a trial, with their derivatives."""


class SingularMatrix(AbstractCondition):
    """`det A = 0` by a bordered equation: a fold, or a flip."""

    kind: str = eqx.field(static=True)
    contact: int | None = eqx.field(static=True, default=None)

    def evaluation(self, problem: ContinuationProblem, u: Unknowns) -> Evaluation:
        return observed(problem, u, problem.any_phase(u), np.zeros((0, 1)))[0]

    def anchor(self, evaluation: Evaluation, u: Unknowns) -> Anchor:
        left, _, right = np.linalg.svd(self._matrix(evaluation))
        angle = 0.0 if self.kind == "fold" else np.pi
        return Anchor(phase_at(evaluation, u), right[-1:].T, left[:, -1:], angle)

    def trial(self, problem: ContinuationProblem, u: Unknowns, anchor: Anchor) -> Trial:
        evaluation, bent = self._observed(problem, u, anchor)
        matrix = self._matrix(evaluation)
        bordered = np.block([[matrix, anchor.left], [anchor.right.T, np.zeros((1, 1))]])
        if not np.isfinite(bordered).all():
            raise StepError("the motion, or its derivative, did not stay finite")
        unit = np.append(np.zeros(len(matrix)), 1.0)
        y, z = np.linalg.solve(bordered, unit), np.linalg.solve(bordered.T, unit)
        right, left = (part[:-1, None] / np.linalg.norm(part[:-1]) for part in (y, z))
        # The derivative of `A` was taken along the vector of the anchor, which `y` approaches.
        slope = -z[:-1] @ bent
        next_ = Anchor(phase_at(evaluation, u), right, left, anchor.angle)
        return Trial(evaluation, float(y[-1]), slope, next_)

    def _matrix(self, evaluation: Evaluation) -> Matrix:
        if self.kind == "flip":
            matrix = period_map(evaluation)
            return matrix + np.eye(len(matrix))
        jacobian = jacobian_at_own_phase(evaluation)
        return jacobian[:, : len(jacobian)]

    def _observed(
        self, problem: ContinuationProblem, u: Unknowns, anchor: Anchor
    ) -> tuple[Evaluation, np.ndarray]:
        """The evaluation, and the derivatives of `A` times the vector of the anchor."""
        evaluation, bent, turning = observed(problem, u, anchor.phase, anchor.right)
        if self.kind == "fold":
            return evaluation, bent[:, 0]
        return evaluation, without_motion(evaluation, bent, turning, anchor)[:, 0]


class UnitPair(AbstractCondition):
    """`mu_1 mu_2 = 1` of a pair of multipliers: a Neimark-Sacker point."""

    kind: str = eqx.field(static=True, default="neimark-sacker")
    contact: int | None = eqx.field(static=True, default=None)

    def evaluation(self, problem: ContinuationProblem, u: Unknowns) -> Evaluation:
        return observed(problem, u, problem.any_phase(u), np.zeros((0, 2)))[0]

    def anchor(self, evaluation: Evaluation, u: Unknowns) -> Anchor:
        values: Any = np.asarray(evaluation.multipliers)
        whirling = values[np.abs(values.imag) > 0]
        nearest = whirling[np.argmin(np.abs(np.abs(whirling) - 1))]
        total, product = 2 * nearest.real, abs(nearest) ** 2
        right, left = null_spaces(period_map(evaluation), total, product)
        return Anchor(phase_at(evaluation, u), right, left, abs(float(np.angle(nearest))))

    def trial(self, problem: ContinuationProblem, u: Unknowns, anchor: Anchor) -> Trial:
        evaluation, bent, turning = observed(problem, u, anchor.phase, anchor.right)
        matrix = period_map(evaluation)
        if not np.isfinite(matrix).all():
            raise StepError("the motion, or its derivative, did not stay finite")
        total, product = pair_near(np.asarray(evaluation.multipliers), anchor.angle)
        right, left = null_spaces(matrix, total, product)
        across = left.T @ right
        block = np.linalg.solve(across, left.T @ matrix @ right)
        # The derivative of `M` was taken along the plane of the anchor, which that of `right` approaches.
        along = np.linalg.lstsq(anchor.right, right, rcond=None)[0]
        bent = without_motion(evaluation, bent, turning, anchor)
        changes = np.linalg.solve(across, np.einsum("mi,mjb,jk->bik", left, bent, along))
        slope = product * np.trace(np.linalg.solve(block, changes), axis1=1, axis2=2)
        angle = float(np.arccos(np.clip(total / 2, -1.0, 1.0)))
        next_ = Anchor(phase_at(evaluation, u), right, left, angle)
        return Trial(evaluation, product - 1.0, slope, next_)


class ZeroClearance(AbstractCondition):
    """The extremum of a clearance that is nearest to zero is zero: a grazing contact."""

    contact: int | None = eqx.field(static=True)
    kind: str = eqx.field(static=True, default="grazing")

    def evaluation(self, problem: ContinuationProblem, u: Unknowns) -> Evaluation:
        traced = _traced(u, problem.any_phase(u))
        found = _clearing(problem, *traced, jnp.asarray(self.contact))
        return jax.tree.map(np.asarray, found[0])

    def anchor(self, evaluation: Evaluation, u: Unknowns) -> Anchor:
        none = np.zeros((len(evaluation.residual), 0))
        return Anchor(phase_at(evaluation, u), none, none, 0.0)

    def trial(self, problem: ContinuationProblem, u: Unknowns, anchor: Anchor) -> Trial:
        found = _clearing(problem, *_traced(u, anchor.phase), jnp.asarray(self.contact))
        evaluation, *parts = jax.tree.map(np.asarray, found)
        value, slope = nearest_extremum(*parts)
        size = float(problem.size[0])
        return Trial(evaluation, value / size, slope / size, self.anchor(evaluation, u))


def condition_of(kind: str, contact: int | None) -> AbstractCondition:
    """The condition of bifurcations of a kind."""
    if kind == "grazing":
        return ZeroClearance(contact=contact)
    return UnitPair() if kind == "neimark-sacker" else SingularMatrix(kind)


# === the parts of a trial


def period_map(evaluation: Evaluation) -> Matrix:
    """`M - f f'`: along a motion `f` of unknown period the multiplier is 0 instead of 1."""
    along, jacobian = np.asarray(evaluation.direction), np.asarray(evaluation.jacobian)
    m = along.size
    return jacobian[:m, :m] + np.eye(m) - np.outer(along, along)


def phase_at(evaluation: Evaluation, u: Unknowns) -> PhaseCondition:
    """The phase condition that the state of an evaluation meets."""
    return PhaseCondition(u[: evaluation.direction.size], evaluation.direction)


def pair_near(multipliers: Complex[np.ndarray, " r"], angle: float) -> tuple[float, float]:
    """Sum and product of the two multipliers, a pair or both real, nearest to those at an angle."""
    first, second = np.triu_indices(multipliers.size, 1)
    total: Any = multipliers[first] + multipliers[second]
    product: Any = multipliers[first] * multipliers[second]
    real = (np.abs(total.imag) < 1e-9) & (np.abs(product.imag) < 1e-9)
    far = np.where(real, np.abs(total - 2 * np.cos(angle)) + np.abs(product - 1), np.inf)
    nearest = int(np.argmin(far))
    return float(total[nearest].real), float(product[nearest].real)


def null_spaces(matrix: Matrix, total: float, product: float) -> tuple[np.ndarray, np.ndarray]:
    """Right and left null space of `M^2 - total M + product`, of two dimensions."""
    polynomial = matrix @ matrix - total * matrix + product * np.eye(len(matrix))
    left, _, right = np.linalg.svd(polynomial)
    return right[-2:].T, left[:, -2:]


def without_motion(
    evaluation: Evaluation,
    bent: Float[np.ndarray, "a r b"],
    turning: Float[np.ndarray, "m b"],
    anchor: Anchor,
) -> Float[np.ndarray, "m r b"]:
    """Derivatives of `M - f f'` times the vectors of the anchor, from those of the residual and of `f`."""
    along, m = evaluation.direction, evaluation.direction.size
    vectors = anchor.right[:m]
    changed = np.einsum("mb,r->mrb", turning, along @ vectors)
    changed += np.einsum("m,nb,nr->mrb", along, turning, vectors)
    return bent[:m] - changed


def observed(
    problem: ContinuationProblem,
    u: Unknowns,
    phase: PhaseCondition,
    vectors: Float[np.ndarray, "v r"],
) -> tuple[Evaluation, Float[np.ndarray, "a r b"], Float[np.ndarray, "m b"]]:
    """The evaluation, the derivatives of the Jacobian by `x` times vectors, and those of `f`.

    Vectors that end early go on with zeros.
    """
    size = u.size - len(problem.parameters)
    padded = np.vstack([vectors, np.zeros((size - len(vectors), vectors.shape[1]))])
    found = _bending(problem, *_traced(u, phase), jnp.asarray(padded))
    return jax.tree.map(np.asarray, found)


def _traced(u: Unknowns, phase: PhaseCondition) -> tuple[Array, PhaseCondition]:
    return jnp.asarray(u), PhaseCondition(*map(jnp.asarray, phase))


def _bending_of(
    problem: ContinuationProblem,
    u: Float[Array, " b"],
    condition: PhaseCondition,
    vectors: Float[Array, "a r"],
) -> tuple[Evaluation, Float[Array, "a r b"], Float[Array, "m b"]]:
    autonomous = problem.revolutions is None

    def both(shooting, x):
        push = lambda v: jax.jvp(shooting.residual, (x,), (v,), has_aux=True)
        residual, image, motion = jax.vmap(push, out_axes=(None, -1, None))(vectors.T)
        direction = shooting.direction(x) if autonomous else jnp.zeros_like(shooting.guess)
        return (residual, image, direction), motion

    found, slopes, motion, shooting = with_slopes(problem, u, condition, both)
    evaluation = evaluation_of(problem, shooting, u, found[0], slopes[0], motion)
    return evaluation, slopes[1], slopes[2]


def _clearing_of(
    problem: ContinuationProblem,
    u: Float[Array, " b"],
    condition: PhaseCondition,
    contact: Int[Array, ""],
) -> tuple[Evaluation, Array, Array, Array, Array]:
    def both(shooting, x):
        residual, motion = shooting.residual(x)
        samples = jax.tree.map(joined, motion[0])
        clearance, rate = clearances(problem, shooting.system, samples)
        period = shooting.revolutions * shooting.length(x) / shooting.rate
        step = period / (clearance.shape[0] - 1)
        return (residual, clearance[..., contact], step * rate[..., contact]), motion

    found, slopes, motion, shooting = with_slopes(problem, u, condition, both)
    evaluation = evaluation_of(problem, shooting, u, found[0], slopes[0], motion)
    return evaluation, *found[1:], *slopes[1:]


_bending = eqx.filter_jit(_bending_of, **QUICKLY)
_clearing = eqx.filter_jit(_clearing_of, **QUICKLY)
