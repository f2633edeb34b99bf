"""Maximum and minimum by comparison, with derivatives that do not depend on rounding.

`jnp.maximum(x, y)` gives its derivative to the argument that equals the result bit by bit. A compiler
may compute `x` twice and round it differently; then neither is equal, and the derivative is silently
zero (jax issue 40564; with jax 0.10.2 one per cent of the derivative of contact forces by friction).
"""

import jax.numpy as jnp
from jax.lax import stop_gradient as still
from jaxtyping import Array, ArrayLike, Float


def larger(x: ArrayLike, y: ArrayLike) -> Array:
    """`max(x, y)`; at a tie the derivative is that of `x`; a NaN in `x` propagates."""
    return jnp.where(jnp.asarray(x) < y, y, x)


def smaller(x: ArrayLike, y: ArrayLike) -> Array:
    """`min(x, y)`; ties and NaN as in `larger`."""
    return jnp.where(jnp.asarray(x) > y, y, x)


def bounded(x: ArrayLike, low: ArrayLike, high: ArrayLike) -> Array:
    """`min(max(x, low), high)`; ties and NaN as in `larger`."""
    return smaller(larger(x, low), high)


def largest(x: Float[Array, "n ..."]) -> Array:
    """Maximum over the first axis; at ties the derivative is the mean of theirs."""
    first = jnp.argmax(x, axis=0)[None]
    equal = x == jnp.take_along_axis(x, first, axis=0)
    number = jnp.arange(len(x)).reshape(-1, *(1,) * (x.ndim - 1))
    equal |= number == first  # even if rounded differently
    top, share = still(jnp.take_along_axis(x, first, axis=0)[0]), jnp.sum(equal, axis=0)
    change = jnp.where(equal & jnp.isfinite(x), x - still(x), 0.0)  # zero, with the derivative of x
    return top + jnp.sum(change, axis=0) / share
