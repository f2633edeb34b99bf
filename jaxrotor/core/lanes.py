"""Lanes: trajectories that are stepped as one array, whose last axis is that of the lanes.

An array that all lanes share has a last axis of length one. See docs/concepts/lanes.md.
"""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Inexact


THIN = 8  # columns, up to which a product is a sum over columns


def reduced(operation: Callable, rows: Array) -> Array:
    """`operation` of two arrays, as `jnp.add`, over all rows of the first axis, by halves.

    All lanes are taken at once, which `jnp.sum` does of some numbers of rows alone: 32 rows of 128
    lanes take it 13 times as long.
    """
    while len(rows) > 1:
        half = len(rows) // 2
        last = rows[2 * half :]
        rows = operation(rows[:half], rows[half : 2 * half])
        rows = jnp.concatenate([rows, last]) if len(last) else rows
    return rows[0]


def computed_once(x: Array) -> Array:
    """`x`, of which a last axis are lanes, by a sum, which ends a kernel.

    Without one the compiler repeats `x`, and all before it, in each of its uses, also for every lane
    where it is shared by all. Barriers do not stop it.
    """
    if x.ndim == 0:
        return x
    weights = np.array([1.0, 0.0], x.real.dtype).reshape(2, *[1] * x.ndim)
    return (x * weights).sum(0)


def one_lane(tree: Any) -> Any:
    """Arrays of one trajectory with a last axis of one lane."""
    return jax.tree.map(lambda leaf: leaf[..., None] if eqx.is_array(leaf) else leaf, tree)


def product(
    matrix: Inexact[Array, "a b ..."], x: Inexact[Array, "b ..."]
) -> Inexact[Array, "a ..."]:
    """`matrix @ x`, in every lane where there are some."""
    if 0 < matrix.shape[1] <= THIN:
        columns = [matrix[:, k] * x[k] for k in range(matrix.shape[1])]
        return sum(columns[1:], start=columns[0])
    if x.ndim == 1:
        return matrix @ x
    if matrix.shape[-1] == 1:
        return matrix[..., 0] @ x
    return jnp.sum(matrix * x, axis=1)


def per_lane(call: Callable, tree: Any, x: Any) -> Any:
    """`call(tree, x)`, written for one trajectory, in every lane.

    Arrays of both have a last axis of lanes, or of one lane that all share; where all are shared it is
    called once, and the arrays that it returns have one lane.
    """
    arrays, constant = eqx.partition((tree, x), eqx.is_array)
    leaves, treedef = jax.tree.flatten(arrays)
    alone = lambda leaf: leaf.ndim == 0 or leaf.shape[-1] == 1  # shared by all lanes
    axes = [None if alone(leaf) else -1 for leaf in leaves]
    leaves = [leaf[..., 0] if leaf.ndim and alone(leaf) else leaf for leaf in leaves]

    def one(leaves):
        return call(*eqx.combine(jax.tree.unflatten(treedef, leaves), constant))

    if not any(axes):
        return one_lane(one(leaves))
    return jax.vmap(one, in_axes=(axes,), out_axes=-1)(leaves)


def lanes_last(call: Callable, tree: Any, y: Float[Array, " m"], *, batch: bool = True) -> Any:
    """`call(tree, y)`, written for lanes last, of one trajectory, or under `jax.vmap` of all at once.

    Without `batch`, `jax.vmap` maps over `call`, and derivatives are in reverse mode too.
    """
    arrays, constant = eqx.partition(tree, eqx.is_array)

    def alone(arrays, y):
        out = call(one_lane(eqx.combine(arrays, constant)), y[:, None])
        return jax.tree.map(lambda leaf: leaf[..., 0], out)

    if not batch:
        return alone(arrays, y)
    run = jax.custom_batching.custom_vmap(alone)

    @run.def_vmap
    def _(size, batched, arrays, y):
        last = lambda leaf, own: jnp.moveaxis(leaf, 0, -1) if own else leaf[..., None]
        own, y_own = batched
        arrays, y = jax.tree.map(last, arrays, own), last(y, y_own)
        out = call(eqx.combine(arrays, constant), jnp.broadcast_to(y, (*y.shape[:-1], size)))
        return jax.tree.map(lambda leaf: jnp.moveaxis(leaf, -1, 0), out), jax.tree.map(
            lambda _: True, out
        )

    return run(arrays, y)
