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

    Derivatives are those of the solution, as the last iteration starts from it. Where the iterations do
    not converge, as for a spring that is very steep beside what yields, the force is not a number.
    """

    def newton(force: Array) -> Array:
        place = seen + through @ force
        gain = jax.jacfwd(law)(place) @ through
        return force + eliminated(jnp.eye(force.size) - gain, law(place) - force, pivots=True)

    none = jnp.zeros(through.shape[1])
    near = jax.lax.fori_loop(0, ITERATIONS - 1, lambda _, force: newton(force), none)
    near = jax.lax.stop_gradient(near)
    force = newton(near)
    along_axes = lambda change: jnp.abs(change).reshape(2, 2, -1)  # displacements, then velocities
    moved, at = along_axes(through @ (force - near)), along_axes(seen + through @ force)
    good = jnp.all(moved <= CONVERGED * jnp.max(at, axis=(0, 2), keepdims=True))
    return jnp.where(jax.lax.stop_gradient(good), force, jnp.nan)
