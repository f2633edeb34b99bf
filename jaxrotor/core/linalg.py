"""Decompositions and solutions of dense matrices: `a x = b`, `a = q r`, `a = u s vᵀ`, `a v = v λ`.

Every one in the package is called here.
"""

from jax.numpy.linalg import (
    cond,
    det,
    eig,
    eigvals,
    inv,
    matrix_power,
    norm,
    pinv,
    qr,
    solve,
    svd,
)
from jax.scipy.linalg import block_diag, expm, lu_factor, lu_solve, solve_triangular


__all__ = [
    "block_diag",
    "cond",
    "det",
    "eig",
    "eigvals",
    "expm",
    "inv",
    "lu_factor",
    "lu_solve",
    "matrix_power",
    "norm",
    "pinv",
    "qr",
    "solve",
    "solve_triangular",
    "svd",
]
