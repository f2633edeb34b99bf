"""Lanes last: what all lanes share stays of one lane, and steps are handed their data in turn."""

import jax
import jax.numpy as jnp
import numpy as np

from jaxrotor.solvers.lanes import per_lane
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
