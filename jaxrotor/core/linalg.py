"""Decompositions and solutions of dense matrices: `a x = b`, `a = q r`, `a = u s vᴴ`, `a v = v λ`.

Every one in the package is called here. On a CPU, a batch is taken one matrix after the other. Jax 0.9.1
and 0.9.2 do so as well, but for the divide-and-conquer method (`gesdd`) of `jax.numpy.linalg.svd`: it
gives the matrices of a batch to the pool of threads, and waits for them in a thread of that pool. Where
that is the only thread, as on one processor, or where all wait, it never returns. So singular values and
what has them come by the QR method (`gesvd`).
"""

from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
from jax.lax.linalg import SvdAlgorithm, svd as _svd
from jax.numpy.linalg import (
    cholesky as cholesky,
    det as det,
    eig as eig,
    eigh as eigh,
    eigvals as eigvals,
    inv as inv,
    matrix_power as matrix_power,
    norm as norm,
    qr as qr,
    solve as solve,
)
from jax.scipy.linalg import (
    block_diag as block_diag,
    expm as expm,
    lu_factor as lu_factor,
    lu_solve as lu_solve,
    solve_triangular as solve_triangular,
)
from jaxtyping import Array, Float, Inexact


def svd(
    a: Inexact[Array, "*batch m n"], full_matrices: bool = True, compute_uv: bool = True
) -> Any:
    """Factors `u`, `s` and `vᴴ` of `a = u diag(s) vᴴ`, or `s` alone."""
    options = {"full_matrices": full_matrices, "compute_uv": compute_uv}
    return jax.lax.platform_dependent(
        a,
        cpu=partial(_svd, algorithm=SvdAlgorithm.QR, **options),
        default=partial(_svd, **options),
    )


def spectral_norm(a: Inexact[Array, "*batch m n"]) -> Float[Array, "*batch"]:
    """The largest singular value."""
    return svd(a, compute_uv=False)[..., 0]


def cond(a: Inexact[Array, "*batch m n"]) -> Float[Array, "*batch"]:
    """The largest singular value over the smallest."""
    sizes = svd(a, compute_uv=False)
    return sizes[..., 0] / sizes[..., -1]


@jax.custom_jvp
def pinv(a: Inexact[Array, "m n"]) -> Inexact[Array, "n m"]:
    """Pseudo-inverse; singular values at the rounding error of the largest one are zero."""
    u, sizes, v = svd(a, full_matrices=False)
    least = 10 * max(a.shape) * jnp.finfo(a.dtype).eps * sizes[0]
    return (v.conj().T / jnp.where(sizes > least, sizes, jnp.inf)) @ u.conj().T


@pinv.defjvp
def _pinv_moved(primals: tuple[Array], tangents: tuple[Array]) -> tuple[Array, Array]:
    """`dp = -p da p + p pᴴ daᴴ (1 - a p) + (1 - p a) daᴴ pᴴ p`, at constant rank.

    Source: Golub and Pereyra, SIAM Journal on Numerical Analysis 10 (1973) 413-432.
    """
    (a,), (change,) = primals, tangents
    p, back = pinv(a), change.conj().T
    left, right = p @ p.conj().T @ back, back @ p.conj().T @ p
    return p, left - (left @ a) @ p + right - p @ (a @ right) - p @ change @ p
