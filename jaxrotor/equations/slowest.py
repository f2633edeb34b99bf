"""The slowest eigenvalues of a pencil, by a Krylov space that is checked for missing ones."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Complex, Inexact

from ..core import linalg
from ..core.quantities import Scalar


BLOCK = 2  # vectors that start the space, so that pairs of equal eigenvalues are found
SPARE = 8  # eigenvalues found beyond those wanted, so that the rest is clearly smaller
ROUGHLY = 1e-9  # residual of these, relative to the matrix
SWEEPS = 4  # steps for left vectors, each of which gains about a digit for the slowest roots
DOUBLINGS = 6  # of the power of the rest at most
# Largest dimension of the space, relative to the matrix, that saves time, without and with vectors:
WORTH = {"real": (0.5, 0.6), "complex": (0.4, 0.45)}
UNIT = (
    30.0  # of velocities: they are as large as displacements in the fastest motions that are wanted
)


class Found(NamedTuple):
    """Some eigenvalues `w` of a matrix with their vectors, in any order."""

    values: Complex[Array, " k"]
    right: Complex[Array, "N k"] | None  # None where they are not wanted
    left: Complex[Array, "k N"] | None  # biorthogonal to the right ones, to some digits


def slowest(
    upper: Inexact[Array, "m N"], count: int, left: bool = False, right: bool = True
) -> Found:
    """Eigenvalues `w = 1 / (x - 1)` of `P(x) q = 0`, among them the `count` ones with the least `|x|`.

    They are those of the matrix `B = (T, U s; 1 / s, 0)` of the state `(q, (x q - q) / s)`, s = `UNIT`.

    A Krylov space gives them in a fraction of the time of all eigenvalues. Where it is too large to pay,
    or a missing one cannot be excluded (equal roots of more than `BLOCK` vectors, as those of a free
    shaft at zero; too little distance to the rest), all are computed.

    Args:
        upper: `(T, U s) = -P(1)^-1 (P'(1), M s)`, with time scaled so that the shift is 1.
        count: how many eigenvalues are wanted. At most `SPARE` more are returned.
        left: whether left vectors are wanted.
        right: whether right vectors are wanted, as they are where left ones are.

    Returns:
        `Found`, not differentiable.
    """
    kind = "complex" if jnp.iscomplexobj(upper) else "real"
    if _dimension(count) > WORTH[kind][right] * upper.shape[1]:
        return _whole(upper, count, left, right)

    # Under jax.vmap a `cond` of the whole batch would compute all eigenvalues of every matrix, too.
    @jax.custom_batching.sequential_vmap
    def one(upper: Array) -> Found:
        found, sure = _checked(upper, count, left)
        found = found if right else found._replace(right=None)
        return jax.lax.cond(sure, lambda _: found, lambda b: _whole(b, count, left, right), upper)

    return one(upper)


def _whole(upper: Inexact[Array, "m N"], count: int, left: bool, right: bool) -> Found:
    """Eigenvalues by all of them."""
    m = upper.shape[0]
    whole = jnp.concatenate([upper, jnp.eye(m, 2 * m) / UNIT])
    if not right:
        values = linalg.eigvals(whole)
        return Found(values[jnp.argsort(_magnitude(values))[: count + SPARE]], None, None)
    values, vectors = linalg.eig(whole)
    order = jnp.argsort(_magnitude(values))[: count + SPARE]
    inverse = linalg.inv(vectors)[order] if left else None
    return Found(values[order], vectors[:, order], inverse)


def _magnitude(values: Complex[Array, " k"]) -> Array:
    """`|x| = |1 + 1 / w|`, infinite for coordinates without mass."""
    none = jnp.abs(values) < 1e-10
    return jnp.where(none, jnp.inf, jnp.abs(1 + 1 / jnp.where(none, 1.0, values)))


def _dimension(count: int) -> int:
    """Dimension of a Krylov space in which `count` eigenvalues converge, as they decay in rotors."""
    return 2 * (count + SPARE) + 28


def _checked(upper: Inexact[Array, "m N"], count: int, left: bool) -> tuple[Found, Bool[Array, ""]]:
    """Eigenvalues by block Arnoldi, and whether they are accurate and none of those wanted is missing.

    `Q' B Q = H` with an orthonormal basis `Q` of `span(X, B X, B^2 X, ..)`. An eigenvalue is accurate
    where `|B v - w v|` is rounding, as it is of those of LAPACK. The invariant space `V` of those found is
    taken out, and powers of the rest bound its spectral radius, see `_less`.

    Source: Saad, Numerical Methods for Large Eigenvalue Problems (2011), sections 6.2 and 6.5.
    """
    basis, beside = _krylov(upper, _dimension(count))  # rows
    image = _image(upper, basis)
    small, outside = basis.conj() @ image.T, beside.conj() @ image.T
    values, vectors = linalg.eig(small)
    order = jnp.argsort(-jnp.abs(values))
    inverse = linalg.inv(vectors)[order[: count + SPARE]] if left else None
    order = order[: count + SPARE]
    values, vectors = values[order], vectors[:, order]
    sizes = _magnitude(values)
    slow = jnp.sort(sizes)[count - 1]
    missed = linalg.norm(outside @ vectors, axis=0)
    digits = jnp.where(sizes <= slow, 0.0, ROUGHLY) + jnp.finfo(missed.dtype).eps
    accurate = jnp.all(missed <= digits * linalg.norm(small))
    space = basis.T @ _invariant(values, vectors, small)
    complete = _less(upper, space, 1 / (1 + 1.001 * slow))
    right, ways = _times(vectors.T, basis).T, None
    if inverse is not None:
        ways = _left(upper, values, right, _times(inverse, basis.conj()))
    return Found(values, right, ways), accurate & complete


def _image(upper: Inexact[Array, "m N"], rows: Inexact[Array, "k N"]) -> Inexact[Array, "k N"]:
    """`B v` of vectors that are rows."""
    m = upper.shape[0]
    half = (upper @ rows.T).T  # `rows @ upper.T` would transpose the matrix every time
    return jnp.concatenate([half, rows[:, :m] / UNIT], axis=1)


def _krylov(upper: Inexact[Array, "m N"], size: int) -> tuple[Array, Array]:
    """Orthonormal rows of a Krylov space of a dimension, and those of its next block."""
    start = np.random.default_rng(0).standard_normal((BLOCK, upper.shape[1]))
    unit = lambda v: v / jnp.where(jnp.any(v != 0), linalg.norm(v), 1.0)

    def orthonormal(rows: Array) -> Array:
        one = unit(rows[0])
        other = unit(rows[1] - (one.conj() @ rows[1]) * one)
        return jnp.stack([one, unit(other - (one.conj() @ other) * one)])

    def step(k, basis):
        rows = _image(upper, jax.lax.dynamic_slice_in_dim(basis, BLOCK * k, BLOCK))
        for _ in range(2):  # the second time regains the digits that the first one loses
            rows = orthonormal(rows - (rows @ basis.conj().T) @ basis)
        return jax.lax.dynamic_update_slice_in_dim(basis, rows, BLOCK * (k + 1), 0)

    basis = jnp.zeros((size + BLOCK, upper.shape[1]), upper.dtype)
    basis = basis.at[:BLOCK].set(orthonormal(jnp.asarray(start, upper.dtype)))
    basis = jax.lax.fori_loop(0, size // BLOCK, step, basis)
    return basis[:size], basis[size:]


def _invariant(values: Array, vectors: Array, small: Array) -> Array:
    """Orthonormal columns that span eigenvectors of a real or complex matrix, of its own kind.

    Values are ordered by size. A pair of vectors `a +- i b` of a real matrix spans `a, b`; a last one
    without its conjugate gives a column of zeros.
    """
    if jnp.iscomplexobj(small):
        return linalg.qr(vectors)[0]
    columns = linalg.qr(jnp.where(values.imag < 0, vectors.imag, vectors.real))[0]
    alone = jnp.abs(jnp.sum(values.imag)) > jnp.abs(values.imag[-1]) / 2
    return columns.at[:, -1].multiply(~alone)


def _less(upper: Array, space: Array, limit: Scalar) -> Bool[Array, ""]:
    """Whether all eigenvalues that do not belong to the invariant space `V` are below a limit.

        rho <= |((I - V V') B (I - V V'))^p|_F^(1/p),    p = 2, 4, .., 2^DOUBLINGS

    Powers are needed because the rest is far from normal: a fast motion has small displacements and large
    velocities. They are those of `B / limit`, and the first with a norm below 1 ends the search.

    Source: Horn, Johnson, Matrix Analysis (2013), theorem 5.6.9.
    """
    m, own = upper.shape[0], space.conj().T
    half, lower = upper / limit**2, upper / (UNIT * limit**2)
    # One difference after products: passes over the matrix cost more than they do.
    square = jnp.concatenate([(upper[:, :m] @ half).at[:, :m].add(lower[:, m:]), lower])
    ahead = own @ square
    back = square @ space - space @ (ahead @ space)
    rest = square - jnp.concatenate([space, back], axis=1) @ jnp.concatenate([ahead, own])

    def above(state):
        doubling, _, norm = state
        return ~(norm < 1) & (doubling < DOUBLINGS)

    def double(state):
        doubling, power, _ = state
        power = power @ power
        return doubling + 1, power, linalg.norm(power)

    return jax.lax.while_loop(above, double, (1, rest, linalg.norm(rest)))[-1] < 1


def _left(upper: Array, values: Array, right: Array, ways: Array) -> Array:
    """Left vectors of `B` from those of `Q' B Q`, by `y <- y B / w` with `y V = 1` for the right ones.

    Every step makes the part along other vectors smaller by the ratio of the eigenvalues.
    """
    m, own = upper.shape[0], ways
    for _ in range(SWEEPS):
        above, below = ways[:, :m], ways[:, m:]
        ways = _times(above, upper).at[:, :m].add(below / UNIT) / values[:, None]
        ways = ways + (jnp.eye(values.size) - ways @ right) @ own  # rounding grows without this
    return ways


def _times(left: Complex[Array, "a b"], right: Inexact[Array, "b c"]) -> Complex[Array, "a c"]:
    """The product, in half the time where the second matrix is real."""
    if jnp.iscomplexobj(right):
        return left @ right
    return left.real @ right + 1j * (left.imag @ right)
