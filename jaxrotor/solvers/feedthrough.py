"""Feedthrough: forces on ports without mass, whose displacement and velocity they change at once."""

from collections.abc import Callable

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..core.elimination import eliminated


ITERATIONS = 6  # of Newton's method; one is exact while a stop stays pressed or free


def force_through(
    law: Callable[[Array], Array], seen: Float[Array, " p4"], through: Float[Array, "p4 p2"]
) -> Float[Array, " p2"]:
    """`f = law(seen + D f)`, by Newton's method from no force on.

    For one stop without friction, along its normal,

        N = (k g0 + d g0') / (1 + k D_0 + d D_v)

    Derivatives are those of the solution, as the last iteration starts from it.
    """

    def newton(force: Array) -> Array:
        place = seen + through @ force
        gain = jax.jacfwd(law)(place) @ through
        return force + eliminated(jnp.eye(force.size) - gain, law(place) - force)

    none = jnp.zeros(through.shape[1])
    near = jax.lax.fori_loop(0, ITERATIONS - 1, lambda _, force: newton(force), none)
    return newton(jax.lax.stop_gradient(near))
