"""Polynomials on the spans of a shaft: nodes, interpolants, their integrals, and a clamped span."""

import functools
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from numpy.polynomial import legendre

from ..core.quantities import Scalar


def node_of_ends(degrees: tuple[int, ...]) -> np.ndarray:
    """Index of the node at every end of the spans: (ends,)."""
    return np.concatenate([[0], np.cumsum(degrees)])


def nodes_of_spans(degrees: tuple[int, ...], ends: Float[Array, " ends"]) -> Float[Array, " nodes"]:
    """Lobatto nodes of all spans [m]; neighbouring spans share the node at their common end."""
    # Zero beyond a degree, as NaN would spoil derivatives.
    inner = np.zeros((len(degrees), max(degrees)))
    for k, degree in enumerate(degrees):
        inner[k, :degree] = lobatto(degree)[1:]
    beyond = ends[:-1, None] + jnp.diff(ends)[:, None] * inner
    # If all spans have the same degree, all nodes are used and nothing is gathered.
    own = np.flatnonzero(inner)
    return jnp.append(ends[0], beyond if own.size == inner.size else beyond.ravel()[own])


def nodes_in_spans(degrees: tuple[int, ...]) -> np.ndarray:
    """Indices of the nodes of every span among those of the shaft; -1 beyond its degree."""
    own = np.arange(max(degrees) + 1)
    within = own <= np.array(degrees)[:, None]
    return np.where(within, node_of_ends(degrees)[:-1, None] + own, -1)


def numbered(indices: np.ndarray, kept: np.ndarray) -> np.ndarray:
    """Places of indices among those `kept`, in order; their number where an index is not, or is -1."""
    places = np.full(max(indices.max(), kept.max(initial=0)) + 2, kept.size)
    places[kept] = np.arange(kept.size)
    return places[indices]  # of -1 the last place, which is not kept


@functools.cache
def lobatto(degree: int) -> np.ndarray:
    """The `degree + 1` Legendre-Gauss-Lobatto nodes on [0, 1], ascending."""
    inner = np.sort(legendre.Legendre.basis(degree).deriv().roots().real)
    return (np.concatenate([[-1.0], inner, [1.0]]) + 1) / 2


@functools.cache
def interpolants(degree: int, left: bool = False, right: bool = False) -> np.ndarray:
    """Legendre coefficients of the interpolants at Lobatto nodes: (coefficient, interpolant).

    The columns belong to the values at the `degree + 1` nodes, then to the slopes, by the coordinate in
    [0, 1], at the `left` and the `right` end where those are given as well.
    """
    given = [True] * (degree + 1) + [left, right]
    values = legendre.legvander(2 * lobatto(degree) - 1, degree + 2)
    slopes = 2 * legendre.legval([-1, 1], legendre.legder(np.eye(degree + 3))).T
    conditions = np.concatenate([values, slopes])[given]
    return np.linalg.inv(conditions[:, : sum(given)])


@functools.cache
def products(degree: int, derivative: int) -> Float[np.ndarray, "k k"]:
    """`Int P_i P_j dxi` over [0, 1] of Legendre polynomials to a degree, or of their derivatives."""
    points, weights = legendre.leggauss(degree + 1)
    differentiated = legendre.legder(np.eye(degree + 1), derivative) * 2.0**derivative
    values = legendre.legval(points, differentiated)
    return values * weights / 2 @ values.T


@functools.cache
def bubble_flexibility(degree: int, highest: int) -> Float[np.ndarray, "node node"]:
    """`Sum_k (2 k + 1) B_k(xi_i) B_k(xi_j)` at Lobatto nodes, `B_k'' = P_k` up to the `highest` degree.

    It is the flexibility of a beam of unit length and stiffness with both ends clamped, on polynomials.
    """
    rank = np.arange(2, highest - 1)
    found = np.zeros((degree + 1, degree + 1))
    if rank.size:
        curvature = np.eye(highest - 1)[:, rank]
        shapes = legendre.legint(curvature, 2, lbnd=-1, scl=0.5)
        values = legendre.legval(2 * lobatto(degree) - 1, shapes)
        found = values.T * (2 * rank + 1) @ values
    return found


@functools.cache
def cubics(degree: int) -> Float[np.ndarray, "node 4"]:
    """Hermite's cubics of value and slope at 0, then at 1, at the Lobatto nodes."""
    return np.stack(hermite(lobatto(degree), 0), axis=1)


@functools.cache
def in_hermite_and_bubbles(
    degree: int, left: bool, right: bool
) -> Float[np.ndarray, "part interpolant"]:
    """Interpolants as sums of Hermite's cubics and of `B_2, B_3, ..`, in the order of `parts`.

    Values and slopes that are given at the ends are the factors of the cubics, without rounding, and the
    Legendre coefficients of the curvature from `P_2` on those of the others.
    """
    coefficients = interpolants(degree, left, right)
    count = coefficients.shape[1]
    of_cubics = np.zeros((4, count))
    of_cubics[[0, 2], [0, degree]] = 1
    for row, end, given, own in ((1, -1, left, degree + 1), (3, 1, right, count - 1)):
        slopes = 2 * legendre.legval(end, legendre.legder(coefficients))
        of_cubics[row] = np.eye(count)[own] if given else slopes
    return np.concatenate([of_cubics, 4 * legendre.legder(coefficients, 2)[2:]])


def hermite_and_bubbles(highest: int, local: Scalar, derivative: int) -> Float[Array, " part"]:
    """Hermite's cubics of value and slope at 0 and at 1, then `B_2 .. B_(highest - 2)`; or derivatives."""
    p, k = legendre_polynomials(highest, local), np.arange(2, highest - 1)
    if derivative:
        beyond = (p[k + 1] - p[k - 1]) / (2 * (2 * k + 1))
    else:
        twice = (p[k + 2] - p[k]) / (2 * k + 3) - (p[k] - p[k - 2]) / (2 * k - 1)
        beyond = twice / (4 * (2 * k + 1))
    return jnp.concatenate([jnp.stack(hermite(local, derivative)), beyond])


def hermite(xi: Any, derivative: int) -> list[Any]:
    """Hermite's cubics of value and slope at 0, then at 1, or their first derivatives."""
    if derivative:
        rise = 6 * xi * (1 - xi)
        return [-rise, (1 - xi) * (1 - 3 * xi), rise, xi * (3 * xi - 2)]
    left, right = (1 + 2 * xi) * (1 - xi) ** 2, xi**2 * (3 - 2 * xi)
    return [left, xi * (1 - xi) ** 2, right, xi**2 * (xi - 1)]


def legendre_polynomials(degree: int, local: Scalar) -> Float[Array, " k"]:
    """`P_k(2 local - 1)` for k = 0..degree."""
    t = 2 * jnp.asarray(local) - 1

    def up(carry, k):  # a loop, as unrolled it would dominate the time to compile a scene
        before, now = carry
        value = ((2 * k + 1) * t * now - k * before) / (k + 1)
        return (now, value), value

    begin = jnp.ones_like(t), t
    _, found = jax.lax.scan(up, begin, jnp.arange(1, degree, dtype=t.dtype))
    return jnp.concatenate([jnp.stack(begin), found])
