"""Lanes last: what all lanes share stays of one lane, and steps are handed their data in turn."""

import functools

import jax
import jax.numpy as jnp
import numpy as np

from jaxrotor.core.elimination import eliminated_in_order
from jaxrotor.core.lanes import computed_once, per_lane
from jaxrotor.solvers.step import in_turn


def test_what_all_lanes_share_is_computed_once():
    shared, own = jnp.arange(3.0)[:, None], jnp.ones((3, 5)) * jnp.arange(5.0)
    call = lambda tree, x: (tree["a"] * x, jnp.sum(tree["a"]))
    every, once = per_lane(call, {"a": shared}, own)
    assert every.shape == (3, 5)
    np.testing.assert_array_equal(every, shared * own)
    np.testing.assert_array_equal(once, np.full(5, 3.0))
    product, total = per_lane(call, {"a": shared}, jnp.ones((3, 1)))
    assert product.shape == (3, 1)
    assert total.shape == (1,)


def test_lanes_may_be_in_what_is_called_alone():
    found = per_lane(lambda tree, x: tree + x, jnp.arange(4.0)[None], jnp.full((1, 1), 2.0))
    np.testing.assert_array_equal(found, [[2.0, 3.0, 4.0, 5.0]])


def test_steps_have_their_starts_in_turn():
    starts = {"time": jnp.arange(5.0), "load": jnp.arange(10.0).reshape(5, 2)}
    first, after = in_turn(starts)
    _, seen = jax.lax.scan(lambda now, following: (following, now), first, after)
    jax.tree.map(np.testing.assert_array_equal, seen, starts)


def test_a_kernel_ends_where_its_result_is_to_be_computed_once():
    """Otherwise the compiled program has a cosine in each of its two uses."""

    def both(once, x):
        seen = once(jnp.cos(x))
        return jnp.concatenate([seen, seen[::-1]]), seen[:1] * seen[1:]

    x = jnp.linspace(0.0, 1.0, 10).reshape(2, 5)
    cosines = []
    for once in (computed_once, lambda x: x):
        program = jax.jit(functools.partial(both, once)).lower(x).compile()
        cosines.append(program.as_text().count(" cosine("))
        jax.tree.map(np.testing.assert_array_equal, program(x), both(lambda x: x, x))
    assert cosines[0] == 1 < cosines[1]
    assert computed_once(jnp.asarray(2.0)) == 2.0
    assert computed_once(x.astype(jnp.float32)).dtype == jnp.float32


def test_equations_of_lanes_by_elimination():
    draw = np.random.default_rng(0)
    root = draw.normal(size=(7, 4, 4))
    matrix, known = root @ root.swapaxes(1, 2) + np.eye(4), draw.normal(size=(7, 4))
    wanted = np.linalg.solve(matrix, known[..., None])[..., 0]
    found = eliminated_in_order(jnp.moveaxis(jnp.asarray(matrix), 0, -1), jnp.asarray(known.T))
    np.testing.assert_allclose(found.T, wanted, rtol=1e-10)
    alone = eliminated_in_order(jnp.asarray(matrix[0]), jnp.asarray(known[0]))
    np.testing.assert_allclose(alone, wanted[0], rtol=1e-10)
