"""Corrector: Newton's method from a predicted point to the branch.

    residual(u) = 0,   normal . (u - guess) = 0,   u = (x, s)

Source: Allgower, Georg (2003), Introduction to Numerical Continuation Methods, chapters 2, 6.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from .problem import ContinuationProblem, Evaluation, PhaseCondition, evaluate


Unknowns = Float[np.ndarray, " b"]


class StepError(Exception):
    """A step failed: the corrector did not converge, or its result was rejected; the text says why."""


class Point(NamedTuple):
    """A point of a branch."""

    u: Unknowns
    tangent: Unknowns  # of unit length, in the direction of travel
    evaluation: Evaluation
    iterations: int

    @property
    def anchor(self) -> PhaseCondition:
        """The condition that picks this state of its orbit; neighbours are corrected with it."""
        m = self.evaluation.direction.size
        return PhaseCondition(self.u[:m], self.evaluation.direction)


class Corrector(NamedTuple):
    """Newton's method for `residual(u) = 0`, with the Jacobian of every trial."""

    problem: ContinuationProblem
    tolerance: float
    max_iterations: int

    def evaluate(self, u: Unknowns, condition: PhaseCondition) -> Evaluation:
        """The residual of a trial and all that comes with it, as arrays of numpy."""
        traced = PhaseCondition(*map(jnp.asarray, condition))
        return jax.tree.map(np.asarray, evaluate(self.problem, jnp.asarray(u), traced))

    def point(
        self, guess: Unknowns, normal: Unknowns, anchor: PhaseCondition, forward: Unknowns
    ) -> Point:
        """The point of the branch in the plane through a guess; its tangent points along `forward`."""
        evaluate = lambda u: self.evaluate(u, anchor)
        u, trial, count = newton(evaluate, guess, normal, self.tolerance, self.max_iterations)
        return Point(u, tangent(jacobian_at_own_phase(trial), forward), trial, count)


def newton(
    evaluate: Callable[[Unknowns], Any],
    guess: Unknowns,
    normal: Unknowns,
    tolerance: float,
    max_iterations: int,
) -> tuple[Unknowns, Any, int]:
    """Root of a residual in the plane through a guess, its last trial, and the number of corrections.

    `evaluate` gives a trial with `residual`, `jacobian` and `outcome`.
    """
    u = np.array(guess, float)
    count, trial = 0, evaluate(u)
    while True:
        if not (np.isfinite(trial.residual).all() and np.isfinite(trial.jacobian).all()):
            raise StepError("the motion, or its derivative, did not stay finite")
        if np.abs(trial.residual).max() < tolerance:
            return u, trial, count
        if count == max_iterations:
            raise StepError(_unfinished(count, trial))
        matrix = np.vstack([trial.jacobian, normal])
        try:
            u = u - np.linalg.solve(matrix, np.append(trial.residual, normal @ (u - guess)))
        except np.linalg.LinAlgError:
            raise StepError("the equations of the corrector became singular") from None
        count, trial = count + 1, evaluate(u)


def _unfinished(iterations: int, trial: Any) -> str:
    """Why Newton's method did not converge."""
    left = np.abs(trial.residual).max()
    reason = f"after {iterations} iterations the residual was still {left:.1e} of the state"
    if trial.outcome.unresolved:
        reason += (
            f", and in {int(trial.outcome.unresolved)} of its steps contact changed without end, as where "
            "a rim sticks to its stop; friction smoothed by `slip` can be followed further"
        )
    return reason


def tangent(jacobian: Float[np.ndarray, "a b"], forward: Unknowns) -> Unknowns:
    """Unit tangent of the branch along `forward`, its states moving across the motion."""
    if not np.isfinite(jacobian).all():
        raise StepError("the motion came to rest")
    along = np.linalg.svd(jacobian)[2][-1]
    return along if along @ forward >= 0 else -along


def jacobian_at_own_phase(evaluation: Evaluation) -> Float[np.ndarray, "a b"]:
    """The Jacobian with the phase condition of the state itself."""
    jacobian, m = np.array(evaluation.jacobian), evaluation.direction.size
    if len(jacobian) > m:
        jacobian[m] = 0.0
        jacobian[m, :m] = evaluation.direction
    return jacobian
