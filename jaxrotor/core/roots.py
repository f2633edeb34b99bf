"""Roots of a function of one number: a change of sign within a bracket, and its derivative."""

from collections.abc import Callable

import jax
import jax.numpy as jnp
from jaxtyping import Array

from .extremes import larger
from .quantities import Scalar


def sign_change(
    function: Callable[[Scalar], Scalar],
    low: Scalar,
    high: Scalar,
    at_low: Scalar,
    at_high: Scalar,
    rises: Array | bool,
) -> Scalar:
    """Place where a function becomes positive, or ceases to be unless it `rises`, to rounding.

    The interpolation is truncated towards the middle of the bracket, so the bracket is never wider than
    that of bisection one step before, also where the function jumps. Where a value takes all eigenvalues,
    eight to ten of them do, and bisection takes 53, also that of optimistix.

    Source: Oliveira, Takahashi, ACM Trans. Math. Softw. 47 (2020), algorithm ITP, kappa_2 = 2, n_0 = 1.
    """
    width = jnp.asarray(high - low)
    precision = jnp.finfo(width.dtype).eps
    narrow = larger(precision * width / 2, precision * jnp.abs(high))
    most = jnp.ceil(jnp.log2(width / (2 * narrow))) + 1

    def unfinished(state):
        step, low, high, *_ = state
        return (high - low > 2 * narrow) & (step < most)

    def halve(state):
        step, low, high, at_low, at_high = state
        middle = (low + high) / 2
        slope = at_high - at_low
        secant = jnp.where(slope == 0, middle, (low * at_high - high * at_low) / slope)
        towards = jnp.sign(middle - secant)
        shift = 0.2 / width * (high - low) ** 2
        truncated = jnp.where(shift <= jnp.abs(middle - secant), secant + towards * shift, middle)
        reach = larger(narrow * 2.0 ** (most - step) - (high - low) / 2, 0.0)
        near = jnp.abs(truncated - middle) <= reach
        speed = jnp.where(near, truncated, middle - towards * reach)
        value = function(speed)
        beyond = (value > 0) == rises
        pick = lambda a, b: jnp.where(beyond, a, b)
        return (
            step + 1,
            pick(low, speed),
            pick(speed, high),
            pick(at_low, value),
            pick(value, at_high),
        )

    state = (jnp.zeros(()), low, high, at_low, at_high)
    _, low, high, _, _ = jax.lax.while_loop(unfinished, halve, state)
    return (low + high) / 2


def implicit_root(function: Callable[[Scalar], Scalar], root: Scalar) -> Scalar:
    """A known root of a function, with the derivatives of the implicit function theorem."""
    root = jax.lax.stop_gradient(root)
    value, slope = jax.jvp(function, (root,), (jnp.ones_like(root),))
    return root - (value - jax.lax.stop_gradient(value)) / jax.lax.stop_gradient(slope)
