"""Corrector: from a guess of an orbit and its parameter to the curve of orbits, by Newton's method.

    missed(u) = 0,   row . (u - guess) = 0,   u = (x, s)

Source: Allgower, Georg (2003), Introduction to Numerical Continuation Methods, chapters 2, 6.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from .curve import Curve, Gauge, Look, look


Unknowns = Float[np.ndarray, " b"]


class LostError(Exception):
    """The curve was not reached; says why."""


class Point(NamedTuple):
    """A point of the curve."""

    u: Unknowns
    tangent: Unknowns  # of unit length, onward
    look: Look
    iterations: int

    def gauge(self, curve: Curve) -> Gauge:
        """The state itself, of those that its motion goes through."""
        m = self.look.direction.size
        return Gauge(self.u[:m], self.look.direction)


class Corrector(NamedTuple):
    """Newton's method on a curve; derivatives are those of every trial."""

    curve: Curve
    tolerance: float
    max_iterations: int

    def look(self, u: Unknowns, gauge: Gauge) -> Look:
        """A trial."""
        seen = look(self.curve, jnp.asarray(u), Gauge(*map(jnp.asarray, gauge)))
        return jax.tree.map(np.asarray, seen)

    def point(self, guess: Unknowns, row: Unknowns, gauge: Gauge, onward: Unknowns) -> Point:
        """The point of the curve in the plane across `row` through a guess."""
        u = np.array(guess, float)
        count, seen = 0, self.look(u, gauge)
        while True:
            if not (np.isfinite(seen.missed).all() and np.isfinite(seen.jacobian).all()):
                raise LostError("the motion, or its derivative, did not stay finite")
            if np.abs(seen.missed).max() < self.tolerance:
                return Point(u, tangent(seen, onward), seen, count)
            if count == self.max_iterations:
                raise LostError(_unfinished(count, seen))
            matrix = np.vstack([seen.jacobian, row])
            try:
                u = u - np.linalg.solve(matrix, np.append(seen.missed, row @ (u - guess)))
            except np.linalg.LinAlgError:
                raise LostError("the equations of the corrector became singular") from None
            count, seen = count + 1, self.look(u, gauge)


def _unfinished(iterations: int, seen: Look) -> str:
    """Why Newton's method did not arrive."""
    left = np.abs(seen.missed).max()
    reason = f"after {iterations} iterations a period still missed {left:.1e} of the state"
    if seen.outcome.unresolved:
        reason += (
            f", and in {int(seen.outcome.unresolved)} of its steps contact changed without end, as where "
            "a rim sticks to its stop; friction smoothed by `slip` can be followed further"
        )
    return reason


def tangent(seen: Look, onward: Unknowns) -> Unknowns:
    """Of the curve, of states across the motion, of unit length."""
    jacobian = recentred(seen)
    if not np.isfinite(jacobian).all():
        raise LostError("the motion came to rest")
    along = np.linalg.svd(jacobian)[2][-1]
    return along if along @ onward >= 0 else -along


def recentred(seen: Look) -> Float[np.ndarray, "a b"]:
    """The Jacobian with the state itself as the one that is meant."""
    jacobian, m = np.array(seen.jacobian), seen.direction.size
    if len(jacobian) > m:
        jacobian[m] = 0.0
        jacobian[m, :m] = seen.direction
    return jacobian
