"""Means: the largest of many numbers, its smooth neighbour, and values over speeds."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ...core.extremes import largest
from ...core.quantities import Scalar


def peak(sizes: Float[Array, "..."], power: float | int | None) -> Scalar:
    """The largest size, `max s`, or the smooth mean `mean(s^p)^(1/p)`, which is at most the largest.

    The largest has kinks, where it moves to another of the sizes.

    Args:
        sizes: numbers, none negative.
        power: `p` of the mean; None for the largest.

    Returns:
        The largest size or the mean, in the unit of the sizes.
    """
    most = largest(sizes.ravel())
    if power is None:
        return most
    unit = jax.lax.stop_gradient(jnp.where(most == 0, 1.0, most))
    mean = jnp.mean((sizes / unit) ** power)
    return unit * jnp.where(mean == 0, 0.0, jnp.where(mean == 0, 1.0, mean) ** (1 / power))


def square(vectors: Array) -> Array:
    """`|z|^2` of complex numbers, smooth at zero."""
    return vectors.real**2 + vectors.imag**2


def over(speeds: Any, of: Callable[[Scalar], Scalar]) -> Float[Array, " w"]:
    """Values at speeds, one after the other, so that memory does not grow with their number."""
    return jax.lax.map(of, jnp.atleast_1d(jnp.asarray(speeds, float)))
