"""Remainder: unequal axes for which no axes of constant coefficients are left, and what steps make of them.

It acts through ports, see `in_constant_axes`. Without contact a revolution of such a rotor is linear.
"""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from ..core.extremes import larger
from ..core.quantities import Scalar
from ..equations.stationary_frame import Motion
from ..equations.system import System
from .basis import Basis
from .exponential import Exponential, revolution


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
        """The map of a system `in_constant_axes`, for so many steps in an angle `span` [rad]."""
        bare = dataclasses.replace(system, ports=system.ports[-system.remainder :], members=())
        motion = Motion(bare, rate, loads=False)
        form = solver.form(bare, motion, jnp.zeros((0, system.n)), basis)

        def run(steps: int) -> tuple[Array, Array]:
            step = solver.stepper(form, steps, span)
            after = jax.vmap(lambda y: revolution(step, y, steps, None)[0])
            rest = jnp.zeros_like(form.steady)
            offset, *ends = after(jnp.concatenate([rest[None], jnp.eye(rest.size)]))
            return jnp.stack(ends, axis=1) - offset[:, None], offset

        (matrix, offset), (finer, _) = run(steps), run(2 * steps)
        size = lambda power: jnp.linalg.norm(jnp.linalg.matrix_power(power, WINDOWS))
        least = jnp.sqrt(1.0 * len(offset))  # that of motions which neither grow nor decay
        within = size(matrix) <= GROWTH * larger(size(finer), least)
        return cls(matrix, offset, ~within)

    def __call__(self, y: Float[Array, " m"]) -> Float[Array, " m"]:
        return self.matrix @ y + self.offset
