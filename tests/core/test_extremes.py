"""Maximum and minimum by comparison: values and slopes by hand, at a tie too, and NaN."""

import jax
import jax.numpy as jnp
import pytest

from jaxrotor.core.extremes import bounded, larger, largest, smaller


@pytest.mark.parametrize(
    ("function", "x", "value", "slope"),
    [
        (lambda x: larger(x**2, 4.0), 3.0, 9.0, 6.0),
        (lambda x: larger(x**2, 4.0), 1.0, 4.0, 0.0),
        (lambda x: larger(x**2, 4.0), 2.0, 4.0, 4.0),
        (lambda x: smaller(x**2, 4.0), 3.0, 4.0, 0.0),
        (lambda x: smaller(x**2, 4.0), 1.0, 1.0, 2.0),
        (lambda x: bounded(x**2, 1.0, 4.0), 3.0, 4.0, 0.0),
        (lambda x: bounded(x**2, 1.0, 4.0), 0.5, 1.0, 0.0),
        (lambda x: bounded(x**2, 1.0, 4.0), 1.5, 2.25, 3.0),
        (lambda x: largest(jnp.stack([x, x**3, -x])), 2.0, 8.0, 12.0),
        (lambda x: largest(jnp.stack([x, -x, -(x**3)])), -2.0, 8.0, -12.0),
    ],
)
def test_value_and_slope(function, x, value, slope):
    for derivative in (jax.value_and_grad(function), jax.jit(jax.value_and_grad(function))):
        assert tuple(map(float, derivative(x))) == (value, slope)


def test_nan_propagates():
    nan = jnp.array(jnp.nan)
    for found in (larger(nan, 0.0), smaller(nan, 0.0), bounded(nan, 0.0, 1.0)):
        assert jnp.isnan(found)
    assert jnp.isnan(largest(jnp.array([1.0, jnp.nan, 2.0])))
