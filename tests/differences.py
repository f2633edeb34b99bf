"""Central differences of sixth order, and derivatives held against them."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest


STENCIL = {1: 3 / 4, 2: -3 / 20, 3: 1 / 60}


def central(at, h):
    """Derivative at 0 of `at(k)`, what a function is `k` steps of `h` away."""
    return sum(w * (at(k) - at(-k)) for k, w in STENCIL.items()) / h


def check_forward(function, own, step):
    """Forward-mode derivatives by every entry equal differences to 1e-5; `step` is relative.

    One program has values and derivatives, for to compile it is most of what a test costs.
    """
    push = jax.jit(lambda at, along: jax.jvp(function, (at,), (along,)))
    for i, along in enumerate(jnp.eye(own.size)):
        h = step * abs(float(own[i]))
        at = lambda k, along=along, h=h: float(push(own + k * h * along, 0 * along)[0])
        expected = central(at, h)
        assert expected != 0
        assert float(push(own, along)[1]) == pytest.approx(expected, rel=1e-5)


def check_by_each(function, values, step, least):
    """Derivatives by relative changes of every value equal differences, to 1e-6 of the largest of each.

    One program has values and derivatives; `step` is relative, and each derivative above `least`.
    """
    push = jax.jit(lambda at, along: jax.jvp(function, (at,), (along,)))
    for along in jnp.diag(values):
        slopes = push(values, along)[1]
        away = lambda k, along=along: push(values + k * step * along, along)[0]
        size = float(jnp.abs(slopes).max())
        assert size > least
        np.testing.assert_allclose(central(away, step), slopes, rtol=0, atol=1e-6 * size)
