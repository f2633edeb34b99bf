"""Remainder: unequal axes that stand still where others turn, and what steps make of them.

It acts through ports, see `in_constant_axes`. Without contact a revolution of such a rotor is linear.
"""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from ..core import linalg
from ..core.extremes import larger
from ..core.lanes import one_lane
from ..core.quantities import Scalar
from ..equations.stationary_frame import Motion
from ..equations.system import System
from .basis import Basis
from .exponential import Exponential
from .step import Step, StepData


WINDOWS = 64  # whose growth is looked at
GROWTH = 2.0  # in these, by which the steps may exceed steps of half the size


class RemainderMap(eqx.Module):
    """`y -> matrix y + offset`, the state after a window of steps under the remainder alone.

    Steps of an undamped mode that is about as fast as they are may amplify it where its bearing is
    unequal. So it is compared, in the growth over many windows, with steps of half the size.
    """

    matrix: Float[Array, "m m"]
    offset: Float[Array, " m"]
    amplified: Bool[Array, ""]  # whether the steps make a motion grow that does not, or grows less

    @classmethod
    def of(
        cls,
        system: System,
        rate: Scalar,
        solver: Exponential,
        basis: Basis,
        steps: int,
        span: Scalar,
    ) -> "RemainderMap":
        """The map of a system `in_constant_axes`, for so many steps in revolutions, `span` [rad]."""
        bare = dataclasses.replace(system, ports=system.ports[-system.remainder :], members=())
        motion = Motion(bare, rate, loads=False)
        form = solver.form(bare, motion, jnp.zeros((0, system.n)), basis)
        size = basis.vectors.shape[1]  # all real, as axes are unequal

        def run(share: Scalar) -> Float[Array, "m m1"]:
            """States that steps lead to from one in every coordinate, and from rest."""
            step = solver.stepper(form, steps, share * span)
            assert isinstance(step, Step), "the laws of a remainder have no kinks"
            lanes, begin = one_lane(step), jnp.eye(size, size + 1)
            phases = step.tableau.phases(step.tableau.h * jnp.arange(steps))
            each = jax.vmap(lambda phases: lanes(StepData(phases), begin)[0])(phases)
            advance = lambda y, one: (_linear(one) @ y + one[:, -1:], None)
            ends, _ = jax.lax.scan(advance, begin, each)
            return ends

        # What turns by twice the angle repeats itself after half a window: so many steps of half the size.
        whole, half = jax.lax.map(run, jnp.array([1.0, 0.5]))
        after = lambda one: linalg.norm(linalg.matrix_power(one, WINDOWS))
        matrix, finer = _linear(whole), _linear(half) @ _linear(half)
        least = jnp.sqrt(1.0 * size)  # that of motions which neither grow nor decay
        within = after(matrix) <= GROWTH * larger(after(finer), least)
        return cls(matrix, whole[:, -1], ~within)

    def __call__(self, y: Float[Array, " m"]) -> Float[Array, " m"]:
        return self.matrix @ y + self.offset


def _linear(ends: Float[Array, "m m1"]) -> Float[Array, "m m"]:
    """Matrix of an affine map, by where it leads from unit vectors and from zero."""
    return ends[:, :-1] - ends[:, -1:]
