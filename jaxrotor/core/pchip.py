"""Interpolation of tables by shape-preserving cubics or by straight lines."""

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from .quantities import Scalar


def pchip(x: Scalar, nodes: Float[Array, " n"], values: Float[Array, "t n"]) -> Float[Array, " t"]:
    """`y = y_k + h s (d_k + s (3 m - 2 d_k - d_(k+1) + s (d_k + d_(k+1) - 2 m)))`, `s = (x - x_k) / h`.

    `h` and `m` are the length and the mean slope of the interval of `x`. A slope `d_k` is the weighted
    harmonic mean of both mean slopes beside its node, and zero where these differ in sign, so the curve
    has no extremum between nodes, and its first derivative is continuous.

    Args:
        x: place at which the tables are read.
        nodes: ascending nodes, two or more, which all tables share.
        values: values of every table at the nodes.

    Returns:
        One value of every table, NaN outside the nodes. Differentiable by all three; where a slope begins
        to be limited the derivative is one-sided.

    Source: Fritsch, Butland, SIAM J. Sci. Stat. Comput. 5 (1984); the ends as in SciPy.
    """
    h = jnp.diff(nodes)
    means = jnp.diff(values, axis=1) / h
    slopes = _slopes(h, means)
    k = _interval(x, nodes)
    s, m, first, last = (x - nodes[k]) / h[k], means[:, k], slopes[:, k], slopes[:, k + 1]
    cubic = 3 * m - 2 * first - last + s * (first + last - 2 * m)
    found = values[:, k] + h[k] * s * (first + s * cubic)
    return jnp.where((x >= nodes[0]) & (x <= nodes[-1]), found, jnp.nan)


def linear(x: Scalar, nodes: Float[Array, " n"], values: Float[Array, "t n"]) -> Float[Array, " t"]:
    """`y = y_k + m_k (x - x_k)`, `m_k = (y_(k+1) - y_k) / (x_(k+1) - x_k)`, in the interval of `x`.

    Arguments and result are those of `pchip`. At a node the derivative is that of the interval above
    it, at the last node that below.
    """
    k = _interval(x, nodes)
    share = (x - nodes[k]) / (nodes[k + 1] - nodes[k])
    found = values[:, k] + share * (values[:, k + 1] - values[:, k])
    return jnp.where((x >= nodes[0]) & (x <= nodes[-1]), found, jnp.nan)


INTERPOLATIONS = {"pchip": pchip, "linear": linear}


def _interval(x: Scalar, nodes: Float[Array, " n"]) -> Int[Array, ""]:
    """Number of the interval between nodes that `x` is in, of one beyond the ends the nearest."""
    return jnp.sum(nodes[1:-1] <= x)


def _slopes(h: Float[Array, " i"], m: Float[Array, "t i"]) -> Float[Array, "t n"]:
    """Slopes at the nodes, from the lengths of all intervals and the mean slopes in them."""
    if h.size == 1:
        return jnp.concatenate([m, m], axis=1)
    one, other = 2 * h[1:] + h[:-1], h[1:] + 2 * h[:-1]
    before, after = m[:, :-1], m[:, 1:]
    alike = before * after > 0
    mean = one / jnp.where(alike, before, 1.0) + other / jnp.where(alike, after, 1.0)
    inner = jnp.where(alike, (one + other) / mean, 0.0)
    # At an end by three points, limited to keep the shape.
    outer, second = np.array([0, -1]), np.array([1, -2])
    h, next_h, m, next_m = h[outer], h[second], m[:, outer], m[:, second]
    ends = ((2 * h + next_h) * m - h * next_m) / (h + next_h)
    turns = (jnp.sign(m) != jnp.sign(next_m)) & (jnp.abs(ends) > 3 * jnp.abs(m))
    ends = jnp.where(jnp.sign(ends) != jnp.sign(m), 0.0, jnp.where(turns, 3 * m, ends))
    return jnp.concatenate([ends[:, :1], inner, ends[:, 1:]], axis=1)
