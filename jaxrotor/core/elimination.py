"""Gauss-Jordan elimination for a few linear equations, in plain arithmetic."""

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .lanes import computed_once


def eliminated(matrix: Float[Array, "u u"], known: Float[Array, " u"]) -> Float[Array, " u"]:
    """Solution `x` of `matrix x = known` by Gauss-Jordan elimination with pivots.

    Calling LAPACK at every stage of every lane would cost several times more.
    """
    rows, order = jnp.concatenate([matrix, known[:, None]], axis=1), jnp.arange(known.size)
    for j in range(known.size):
        best = j + jnp.argmax(jnp.abs(rows[j:, j]))
        rows = rows[jnp.where(order == j, best, jnp.where(order == best, j, order))]
        head = rows[j] / rows[j, j]
        rows = (rows - rows[:, j : j + 1] * head).at[j].set(head)
    return rows[:, -1]


def eliminated_in_order(
    matrix: Float[Array, "u u ..."], known: Float[Array, "u ..."]
) -> Float[Array, "u ..."]:
    """The same where no leading minor vanishes; arrays may have lanes last."""
    rows = jnp.concatenate([matrix, known[:, None]], axis=1)
    for j in range(len(known)):
        rows = computed_once(rows)
        head = rows[j] * computed_once(1 / rows[j, j : j + 1])
        this = (np.arange(len(known)) == j).reshape(-1, *[1] * (rows.ndim - 1))
        rows = jnp.where(this, head, rows - rows[:, j : j + 1] * head)
    return computed_once(rows[:, -1])
