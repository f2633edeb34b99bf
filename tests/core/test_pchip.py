"""Shape-preserving cubics, against numbers of their own and against SciPy."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from differences import check_forward
from scipy.interpolate import PchipInterpolator

from jaxrotor.core.pchip import pchip


NODES = np.array([100.0, 200.0, 300.0, 500.0, 800.0])
VALUES = 1e7 * np.array([1.0, 1.4, 2.2, 2.3, 1.9])
at = jax.jit(jax.vmap(pchip, (0, None, None)))


def read(x, nodes=NODES, values=VALUES):
    """Values of one or several tables at places, (p,) or (p, t)."""
    found = np.asarray(at(jnp.asarray(x, float), jnp.asarray(nodes), jnp.atleast_2d(values)))
    return found[:, 0] if np.ndim(values) == 1 else found


def test_known_values_and_slopes_at_the_ends():
    known = {150: 11583333.333333, 250: 18536231.884058, 400: 22760869.565217, 650: 21912500.0}
    np.testing.assert_allclose(read(list(known)), list(known.values()), rtol=1e-13)
    np.testing.assert_array_equal(read(NODES), VALUES)
    slope = jax.jit(jax.grad(lambda x: pchip(x, jnp.asarray(NODES), jnp.asarray(VALUES)[None])[0]))
    ends = [float(slope(x)) for x in (100.0, 800.0)]
    assert ends == pytest.approx([20000, -24333.333333], rel=1e-10)


@pytest.mark.parametrize("count", [2, 3, 7])
def test_tables_with_turns_and_plateaus_are_those_of_scipy(count):
    draw = np.random.default_rng(count)
    for _ in range(20):
        nodes = np.cumsum(draw.uniform(0.01, 3.0, count)) - 2.0
        values = draw.choice([0.0, 1.0, -1.0, 0.5], (4, count)) * draw.uniform(0.1, 1.0, (4, count))
        values[0] = draw.choice([0.0, 1.0], count)  # with plateaus
        x = np.linspace(nodes[0], nodes[-1], 41)
        expected = PchipInterpolator(nodes, values, axis=1)(x).T
        np.testing.assert_allclose(read(x, nodes, values), expected, rtol=0, atol=4e-15)


def test_outside_of_the_nodes_there_is_no_value():
    assert np.isnan(read([99.999, 800.001])).all()


@pytest.mark.parametrize("x", [130.0, 420.0, 700.0])
def test_derivatives_by_the_table(x):
    """By entries near enough to matter; the others have none."""
    near = slice(0, 3) if x < 200 else slice(1, 4) if x < 500 else slice(2, 5)

    def value(own):
        table = jnp.asarray(VALUES).at[near].set(own)
        return pchip(jnp.asarray(x), jnp.asarray(NODES), table[None])[0]

    check_forward(value, jnp.asarray(VALUES[near]), 1e-4)
    whole = lambda table: pchip(jnp.asarray(x), jnp.asarray(NODES), table[None])[0]
    gradient = np.array(jax.jit(jax.grad(whole))(jnp.asarray(VALUES)))
    gradient[near] = 0
    assert not gradient.any()
