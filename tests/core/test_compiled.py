"""Functions compiled without optimisation give the same numbers, called directly and inside programs."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxrotor.core.compiled import compiled_quickly
from jaxrotor.core.constants import with_arrays, with_constants
from jaxrotor.core.quantities import known


def test_alone_inside_a_program_mapped_and_differentiated():
    """Inside another program, where jax refuses compiler options, the function has none."""
    traced = []

    @compiled_quickly
    def solved(k, names=("static",)):
        traced.append(names)
        return jnp.linalg.solve(jnp.array([[k, 1.0], [1.0, 3.0]]), jnp.ones(2))

    exact = lambda k: np.array([2.0, k - 1]) / (3 * k - 1)
    np.testing.assert_allclose(solved(jnp.asarray(2.0)), exact(2.0), rtol=1e-14)
    np.testing.assert_allclose(solved(jnp.asarray(4.0)), exact(4.0), rtol=1e-14)
    assert len(traced) == 1  # one trace serves all values
    np.testing.assert_allclose(jax.jit(lambda k: 2 * solved(k))(2.0), 2 * exact(2.0), rtol=1e-14)
    np.testing.assert_allclose(
        jax.vmap(solved)(jnp.array([2.0, 5.0])), [exact(2.0), exact(5.0)], rtol=1e-14
    )
    np.testing.assert_allclose(jax.jacfwd(solved)(2.0), np.array([-6, 2]) / 25, rtol=1e-13)
    assert solved.__name__ == "solved" and traced[-1] == ("static",)


def test_constants_are_known_within_a_program():
    """Equal values of a constant share a program, others take another; what is no constant is traced."""
    traced = []

    @compiled_quickly
    def sums(pair):
        a, b = with_arrays(pair)
        traced.append((known(a), known(b)))
        return a + b if np.asarray(a)[0] > 0 else a - b

    def found(first, second):
        pair = jnp.array([first, 1.0]), jnp.asarray(second)
        return sums(with_constants(pair, [pair[0], None])).tolist()

    assert found(2.0, 5.0) == [7.0, 6.0] and found(2.0, 4.0) == [6.0, 5.0]
    assert found(-2.0, 4.0) == [-6.0, -3.0]
    assert traced == [(True, False)] * 2


def test_constants_must_be_leaves_of_their_tree():
    """An array of equal values is not the leaf, which would be traced; what is no array is passed over."""
    a, b = jnp.ones(2), jnp.ones(2)
    assert with_constants((a, 3.0), [None, 3.0, "pedestal"]) == (a, 3.0)
    with pytest.raises(LookupError, match="1 of 2 arrays that decide .* not leaves of its tuple"):
        with_constants((a, b), [a, b + 0.0])
