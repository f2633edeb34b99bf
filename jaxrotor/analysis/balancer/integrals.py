"""First integrals of the linear motion about a balanced position, and final positions of the balls."""

from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex

from ...core.quantities import Scalar
from .groups import BalancerGroups


def ball_momenta(groups: BalancerGroups, displacement: Any, rate: Any) -> Complex[Array, " r"]:
    """`S_lz = (s_l' + h_l s_l) / m_l`, which obeys `S_l' = a_z - beta_l conj(a_z)`.

    Args:
        groups: the balancer.
        displacement: change `s_l` (r,) of each row's imbalance, see `row_imbalances`.
        rate: its rate `s_l'` (r,).

    Returns:
        S_lz. Differentiable.
    """
    return (jnp.asarray(rate) + groups.drag * jnp.asarray(displacement)) / groups.mass


def first_integral(
    beta: Complex[Array, " r"], momenta: Complex[Array, " r"], reference: int = 0
) -> Complex[Array, " _"]:
    """`B_j S_l - B_4 S_j - B_3 conj(S_j)`, constant for every row `l` but the `reference` row `j`.

        B_j = 1 - |beta_j|^2,  B_3 = beta_j - beta_l,  B_4 = 1 - conj(beta_j) beta_l

    It is degenerate where the balls of row `j` are on one line (B_j = 0): take another row, or use
    `integral_rows`.

    Args:
        beta: `second_harmonics` of the position.
        momenta: S_lz, see `ball_momenta`.
        reference: index j of the reference row.

    Returns:
        The integral for every other row. Differentiable.

    Source: Filimonikhin, Goncharov (2011), eq. (6.4).
    """
    own, held = beta[reference], momenta[reference]
    others = np.delete(np.arange(len(beta)), reference)
    b3, b4 = own - beta[others], 1 - jnp.conj(own) * beta[others]
    return (1 - jnp.abs(own) ** 2) * momenta[others] - b4 * held - b3 * jnp.conj(held)


def integral_rows(
    beta: Complex[Array, " r"], tolerance: float = 1e-9
) -> Complex[np.ndarray, "k r"]:
    """All linear first integrals, degenerate cases included: `Re sum_l conj(w_l) S_lz` is constant.

    Args:
        beta: `second_harmonics` of the position.
        tolerance: relative singular value below which a direction counts as conserved.

    Returns:
        Orthonormal rows `w`: `k = 2 r - 2` of them, or `2 r - 1` where all balls are on one line (the
        critical case). Not differentiable.

    Source: Filimonikhin, Goncharov (2011), section 6.
    """
    known = np.asarray(beta)
    # a_z = x + i y drives S_l by (1 - beta_l) x + i (1 + beta_l) y.
    driven: Any = np.stack([1 - known, 1j * (1 + known)], axis=1)
    u, sizes, _ = np.linalg.svd(np.concatenate([driven.real, driven.imag]))
    free = u[:, int(np.sum(sizes > tolerance * sizes[0])) :].T
    return free[:, : len(beta)] + 1j * free[:, len(beta) :]


def final_displacement(
    groups: BalancerGroups, beta: Complex[Array, " r"], momenta: Complex[Array, " r"]
) -> Complex[Array, " r"]:
    """Final change `s_l` of the imbalance of each row.

        s_l = (m_l / h_l) (S_l + p - beta_l conj(p)),  sum s_l = 0
        mu0 p - nu0 conj(p) = -sum m_l S_l / h_l,  mu0 = sum m_l / h_l,  nu0 = sum m_l beta_l / h_l

    `p` is the impulse that the rotor will transfer to the balls.

    Args:
        groups: the balancer.
        beta: `second_harmonics` of a stable position.
        momenta: S_lz, see `ball_momenta`.

    Returns:
        s_l (r,), NaN in a critical case. Differentiable.

    Source: Filimonikhin, Goncharov (2011), eqs. (6.5)-(6.6) for two rows; this form holds for any number
    of rows, also for rows on one line.
    """
    ratio = groups.mass / groups.drag
    mu0, nu0, load = jnp.sum(ratio), jnp.sum(ratio * beta), jnp.sum(ratio * momenta)
    impulse = -(mu0 * load + nu0 * jnp.conj(load)) / _gap(mu0, nu0)
    return ratio * (momenta + impulse - beta * jnp.conj(impulse))


def _gap(mu0: Scalar, nu0: Array) -> Scalar:
    """`mu0^2 - |nu0|^2`; NaN where all balls are on one line."""
    gap = mu0**2 - jnp.abs(nu0) ** 2
    return jnp.where(gap > 1e-12 * mu0**2, gap, jnp.nan)
