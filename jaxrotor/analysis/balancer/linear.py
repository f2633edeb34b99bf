"""Linear motion about a balanced position: the closed system, its spectrum and its first integrals."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float

from ...core import linalg
from ...core.compiled import compiled_quickly
from ...core.extremes import largest
from ...core.plane import real_matrix
from ...core.quantities import Scalar
from ...equations.pencil import Pencil, root_changes
from .groups import BalancerGroups
from .positions import checked, second_harmonics


@compiled_quickly
def closed_matrix(groups: BalancerGroups, beta: Complex[Array, " r"]) -> Float[Array, "k k"]:
    """`x' = A x` of the closed linear equations in axes of the rotor, `k = 4 + 4 r`.

        delta'' + (ha + i a13) delta' + A_z delta + i (s'' + 2 i om s' - om^2 s) = 0,  s = sum s_l
        s_l'' + h_l s_l' = m_l (a_z - beta_l conj(a_z)),  a_z = i (delta'' + 2 i om delta' - om^2 delta)

    The equations are exact; nothing is averaged. `x` is real: real parts of `delta, s_1, .., s_r`,
    their imaginary parts, then the rates of all these.

    Args:
        groups: the balancer.
        beta: `second_harmonics` of the position.

    Returns:
        A. Differentiable.

    Raises:
        ValueError: `beta` does not have one value per row.

    Source: Filimonikhin, Goncharov (2011), eqs. (5.4)-(5.7).
    """
    return first_order(*_accelerations(groups, beta))


@compiled_quickly
def settling_matrix(groups: BalancerGroups, beta: Complex[Array, " r"]) -> Float[Array, "k k"]:
    """`x' = A x` of the closed system without the drift along the family, `k = 6 + 2 r`.

    It has none of the zeros of that drift. The rows act through their sum alone, so `x` is the real and
    imaginary parts of `delta, s`, then the rates of the real and imaginary parts of `delta, s_1, .., s_r`.
    """
    place, rates = _accelerations(groups, beta)
    rows = groups.rows
    sums = np.concatenate([np.eye(2)[:1], np.tile(np.eye(2)[1:], (rows, 1))])  # (1 + r, 2)
    both = np.kron(np.eye(2), sums)  # (2 + 2 r, 4)
    # The columns of `place` are the same for all rows, so one of them acts on the sum.
    through = place @ np.kron(np.eye(2), np.eye(rows + 1)[:, :2])  # (2 + 2 r, 4)
    upper = jnp.concatenate([jnp.zeros((4, 4)), jnp.asarray(both.T)], axis=1)
    return jnp.concatenate([upper, jnp.concatenate([through, rates], axis=1)])


def _accelerations(groups: BalancerGroups, beta: Array) -> tuple[Array, Array]:
    """`place, rates` of `x'' = place x + rates x'`, with `x` the first half of that in `closed_matrix`."""
    om, m, rows = groups.speed, groups.mass, groups.rows
    beta = jnp.asarray(beta, complex)
    if beta.shape != (rows,):
        raise ValueError(
            f"`beta` must have one value per row ({rows}), but has shape {beta.shape}."
        )

    def block(pull, rotor, row):
        """`u z + v conj(z)` as a real matrix; `pull` couples the rows to delta and, in `a_z`, back."""
        u = jnp.diag(jnp.concatenate([jnp.asarray(rotor, complex)[None], row]))
        u = u.at[0, 1:].set(pull).at[1:, 0].set(-m * pull)
        v = jnp.zeros_like(u).at[1:, 0].set(m * beta * jnp.conj(pull))
        return real_matrix(u, v)

    inertia = block(1j, 1.0, jnp.ones(rows))
    damping = block(-2 * om + 0j, groups.damping + 1j * groups.a13, groups.drag)
    stiffness = block(-1j * om**2, groups.a_z, jnp.zeros(rows))
    return solved_for_accelerations(inertia, damping, stiffness)


def solved_for_accelerations(
    inertia: Array, damping: Array, stiffness: Array
) -> tuple[Array, Array]:
    """`place, rates` of `x'' = place x + rates x'`, from the matrices of the equations of motion."""
    solved = -linalg.solve(inertia, jnp.concatenate([stiffness, damping], axis=1))
    place, rates = jnp.split(solved, 2, axis=1)
    return place, rates


def first_order(place: Float[Array, "n n"], rates: Float[Array, "n n"]) -> Float[Array, "k k"]:
    """Matrix of `x'' = place x + rates x'` for the unknowns `(x, x')`."""
    return jnp.block([[jnp.zeros_like(place), jnp.eye(len(place))], [place, rates]])


@compiled_quickly
def spectrum(groups: BalancerGroups, beta: Complex[Array, " r"]) -> Complex[Array, " k"]:
    """Roots of the closed linear system at a balanced position, without its `2 (r - 1)` zeros.

    The zeros belong to the drift along the family of main motions. They are removed by construction, not
    by size: near a critical case a true root is arbitrarily small, and in it exactly zero. For a row
    on one line another pair of roots is no motion of balls; see `ball_spectrum`.

    Args:
        groups: the balancer.
        beta: `second_harmonics` of the position.

    Returns:
        `k = 6 + 2 r` roots by rising real part. Differentiable; equal roots by the mean of theirs.

    Raises:
        ValueError: `beta` does not have one value per row.
    """
    return jnp.sort(matrix_roots(settling_matrix(groups, beta)))


def growth_rate(groups: BalancerGroups, beta: Complex[Array, " r"]) -> Scalar:
    """Largest real part of the `spectrum`: negative if stable, zero in a critical case.

    Args:
        groups: the balancer.
        beta: `second_harmonics` of the position.

    Returns:
        Growth rate in units of omega0. Differentiable.

    Raises:
        ValueError: `beta` does not have one value per row.
    """
    return largest(spectrum(groups, beta).real)


class Zeros(NamedTuple):
    """Numbers of exact zeros in the spectra at a balanced position."""

    closed: int  # in the closed linear system: 2 (r - 1), one more in a critical case
    full: int  # in the full model: n - 2, one more in a critical case
    ranks: tuple[int, ...]  # directions in which each row can change its imbalance: 1 on one line


def zero_count(groups: BalancerGroups, positions: Sequence, tolerance: float = 1e-9) -> Zeros:
    """Zeros of the closed and the full spectrum, counted from the position and not from the roots.

    Args:
        groups: the balancer.
        positions: psi [rad], one array per row.
        tolerance: angle [rad] within which balls count as on one line.

    Returns:
        `Zeros`.

    Raises:
        ValueError: the positions are not one angle per ball.
    """
    lines = [np.asarray(row, float) for row in checked(groups, positions)]
    on_line = lambda row: bool(np.all(np.abs(np.sin(row - row[0])) <= tolerance))
    ranks = tuple(1 if on_line(row) else 2 for row in lines)
    critical = on_line(np.concatenate(lines))
    return Zeros(
        2 * (groups.rows - 1) + critical,
        2 * (groups.rows - 1) + critical + sum(groups.balls) - 2 * groups.rows,
        ranks,
    )


def ball_spectrum(groups: BalancerGroups, positions: Sequence) -> Complex[np.ndarray, " k"]:
    """Roots of the full model, `k = 4 + 2 n` for `n` balls, from those of the closed system.

    A row of rank 2 (1 on one line) loses `2 - rank` copies of {0, -h_l}, which are no motion of balls,
    and gains `n_l - rank` copies, of motions of balls that do not change the imbalance.

    Args:
        groups: the balancer.
        positions: psi [rad], one array per row.

    Returns:
        Roots by rising real part. Not differentiable.

    Raises:
        ValueError: the positions are not one angle per ball.
    """
    beta = second_harmonics(checked(groups, positions))
    found = [*np.asarray(spectrum(groups, beta)), *np.zeros(2 * (groups.rows - 1))]
    ranks = zero_count(groups, positions).ranks
    for count, rank, drag in zip(groups.balls, ranks, np.asarray(groups.drag), strict=True):
        for value in (0.0, -float(drag)):
            for _ in range(2 - rank):
                found.pop(int(np.argmin(np.abs(np.array(found) - value))))
            found += [value] * (count - rank)
    return np.sort(np.array(found, complex))


@jax.custom_jvp
def matrix_roots(matrix: Float[Array, "k k"]) -> Complex[Array, " k"]:
    """Eigenvalues of a real matrix, unordered; the derivative of equal ones is the mean of theirs."""
    return linalg.eigvals(matrix)


@matrix_roots.defjvp
def _matrix_roots_jvp(primals, tangents):
    values = matrix_roots(*primals)
    one, none = jnp.eye(len(values), dtype=complex), jnp.zeros(primals[0].shape, complex)
    at, change = Pencil(none, one, -primals[0] + none), Pencil(none, none, -tangents[0] + none)
    return values, root_changes(values, at, change)


# === first integrals


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
