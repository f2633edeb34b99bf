"""Extremes by comparison, whose derivatives outlast the compiler.

The derivative of `jnp.maximum(x, y)` goes to whichever of the two equals the result bit by bit. A
compiler that computes `x` twice, and rounds it differently, leaves none, and the derivative is zero
without a word (jax issue 40564; a per cent of that of contact forces by friction, jax 0.10.2).
"""

import jax.numpy as jnp
from jax.lax import stop_gradient as still
from jaxtyping import Array, ArrayLike, Float


def larger(x: ArrayLike, y: ArrayLike) -> Array:
    """`max(x, y)` of a number `x` that is looked at; its derivative where they are equal, NaN if it is."""
    return jnp.where(jnp.asarray(x) < y, y, x)


def smaller(x: ArrayLike, y: ArrayLike) -> Array:
    """`min(x, y)`, as `larger`."""
    return jnp.where(jnp.asarray(x) > y, y, x)


def within(x: ArrayLike, low: ArrayLike, high: ArrayLike) -> Array:
    """`x`, or the bound that it is beyond, as `larger`."""
    return smaller(larger(x, low), high)


def largest(x: Float[Array, "n ..."]) -> Array:
    """The largest of the first axis; the mean of the derivatives of equals."""
    first = jnp.argmax(x, axis=0)[None]
    equal = x == jnp.take_along_axis(x, first, axis=0)
    number = jnp.arange(len(x)).reshape(-1, *(1,) * (x.ndim - 1))
    equal |= number == first  # whatever the compiler
    top, share = still(jnp.take_along_axis(x, first, axis=0)[0]), jnp.sum(equal, axis=0)
    change = jnp.where(equal & jnp.isfinite(x), x - still(x), 0.0)  # nothing but its derivative
    return top + jnp.sum(change, axis=0) / share
