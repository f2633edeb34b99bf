"""Gauss-Jordan elimination for a few linear equations, in plain arithmetic."""

import jax.numpy as jnp
from jaxtyping import Array, Float


def eliminated(
    matrix: Float[Array, "u u"], known: Float[Array, " u"], *, pivots: bool = False
) -> Float[Array, " u"]:
    """Solution `x` of `matrix x = known` by Gauss-Jordan elimination.

    Without `pivots`, no leading minor of the matrix may vanish. Calling LAPACK at every stage of every
    lane would cost several times more.
    """
    rows, order = jnp.concatenate([matrix, known[:, None]], axis=1), jnp.arange(known.size)
    for j in range(known.size):
        if pivots:
            best = j + jnp.argmax(jnp.abs(rows[j:, j]))
            rows = rows[jnp.where(order == j, best, jnp.where(order == best, j, order))]
        head = rows[j] / rows[j, j]
        rows = (rows - rows[:, j : j + 1] * head).at[j].set(head)
    return rows[:, -1]
