"""Feedthrough: forces on ports without mass, whose displacement and velocity they change at once."""

from collections.abc import Callable

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..core.elimination import eliminated


ITERATIONS = 6  # of Newton's method; one is exact while a stop stays pressed or free
CONVERGED = 1e-8  # what the last iteration moves the ports by, relative to where they are


def force_through(
    law: Callable[[Array], Array], seen: Float[Array, " p4"], through: Float[Array, "p4 p2"]
) -> Float[Array, " p2"]:
    """`f = law(seen + D f)`, by Newton's method from no force on.

    For one stop without friction, along its normal,

        N = (k g0 + d g0') / (1 + k D_0 + d D_v)

    Derivatives are those of the solution. Where the iterations do not converge, as for a spring that is
    very steep beside what yields, the force is not a number.
    """

    def missing(force: Array) -> Array:
        return law(seen + through @ force) - force

    def solve(missing: Callable, force: Array) -> Array:
        def newton(_, state):
            force, _ = state
            change = -eliminated(jax.jacfwd(missing)(force), missing(force))
            return force + change, change

        force, change = jax.lax.fori_loop(0, ITERATIONS, newton, (force, jnp.zeros_like(force)))
        # Displacements and velocities are measured apart.
        sizes = lambda parts: jnp.max(jnp.abs(parts).reshape(2, 2, -1), axis=(0, 2))
        good = sizes(through @ change) <= CONVERGED * sizes(seen + through @ force)
        return jnp.where(jnp.all(good), force, jnp.nan)

    def linear(slope: Callable, value: Array) -> Array:
        return eliminated(jax.jacfwd(slope)(value), value)

    return jax.lax.custom_root(missing, jnp.zeros(through.shape[1]), solve, linear)
