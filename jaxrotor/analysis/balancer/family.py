"""Main motions: the family of ball positions that balance the rotor."""

import math
from collections.abc import Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Complex, Float

from ...core.compiled import compiled_quickly
from ...core.extremes import larger, largest
from ...core.quantities import Scalar, known
from .groups import BalancerGroups


Positions = tuple[Float[Array, " _"], ...]  # psi [rad], one array a row
STEPS = 100  # of `nearest_balanced`; a position near the limit of the capacity takes half as many
LARGEST_STEP = 0.5  # rad, that a ball takes at once


def imbalance(groups: BalancerGroups, positions: Sequence) -> Complex[Array, ""]:
    """Imbalance left, `s_z = s0 + sum_l S_l sum_i exp(i psi_li)`; zero at a main motion."""
    return jnp.sum(row_imbalances(groups, positions))


def row_imbalances(groups: BalancerGroups, positions: Sequence) -> Complex[Array, " r"]:
    """`s_lz = S_l sum_i exp(i psi_li)` of each row; the first counts `s0` too."""
    sums = jnp.stack([jnp.sum(jnp.exp(1j * row)) for row in checked(groups, positions)])
    return (groups.moment * sums).at[0].add(groups.imbalance)


def second_harmonics(positions: Sequence) -> Complex[Array, " r"]:
    """`beta_l = b_l exp(i theta_l) = (1/n_l) sum_i exp(2 i psi_li)`: all that stability asks.

    Its size `b_l` is 1 for a row on one line. Source: Filimonikhin, Goncharov (2011), eq. (3.5).
    """
    return jnp.stack([jnp.mean(jnp.exp(2j * jnp.asarray(row, float))) for row in positions])


def balance_margin(groups: BalancerGroups) -> Scalar:
    """How far the largest of `s0, S_1, ..` (one a ball) is below the sum of the others.

    Positions that balance exist where this is not negative.
    """
    everything = groups.capacity + groups.imbalance
    heaviest = larger(groups.imbalance, largest(groups.moment))
    return everything - 2 * heaviest


def balanced_positions(
    groups: BalancerGroups, row_sums: Sequence, angles: Sequence[Sequence]
) -> Positions:
    """The balanced position with given imbalances of rows and given angles of all balls but two a row.

        psi = arg z ± arccos(|z| / 2),  z = what is left for the last two balls of a row [S_l]

    Args:
        groups: every row with two balls or more.
        row_sums: `s_1z, ..`, complex imbalance of each row but the last (the first counts s0): the last
            row takes the rest.
        angles: of each row, the angles [rad] of its first `n_l - 2` balls: `[[], [0.4]]` for 2 and 3.

    Returns:
        Positions: the given angles, then those with plus and minus. Differentiable unless |z| is 0, 2.

    Raises:
        ValueError: |z| > 2, out of reach of two balls; NaN where traced.
    """
    if len(row_sums) != groups.rows - 1:
        raise ValueError(
            f"`row_sums` must have one value a row but the last ({groups.rows - 1}), "
            f"but has {len(row_sums)}."
        )
    given = tuple(len(row) for row in angles)
    if given != tuple(n - 2 for n in groups.balls):
        raise ValueError(
            f"`angles` must give all balls but two of each row of {groups.balls}, but gives {given}."
        )
    sums = jnp.asarray([*row_sums, -sum(row_sums)], complex)
    sums = sums.at[0].add(-groups.imbalance) / groups.moment
    rows = []
    for number, (total, some) in enumerate(zip(sums, angles, strict=True), 1):
        fixed = jnp.asarray(some, float)
        z = total - jnp.sum(jnp.exp(1j * fixed))
        if known(z) and not bool(jnp.abs(z) <= 2):
            raise ValueError(
                f"Two balls of row {number} sum to 2 at most, but must sum to {abs(z):g}; "
                "change `row_sums` or `angles`."
            )
        spread = jnp.arccos(jnp.abs(z) / 2)
        pair = jnp.angle(z) + jnp.stack([spread, -spread])
        rows.append(jnp.concatenate([fixed, pair]))
    return tuple(rows)


def nearest_balanced(groups: BalancerGroups, start: Sequence) -> Positions:
    """A balanced position close to `start`: Gauss-Newton steps of least length on `s_z = 0`.

    For any rows, where `balanced_positions` needs two balls in each. Differentiable, in `start` too.

    Raises:
        EquinoxRuntimeError: nothing found: no position balances, or all balls start on one line.
    """
    return _nearest(groups, checked(groups, start))


@compiled_quickly
def _nearest(groups: BalancerGroups, rows: Positions) -> Positions:
    cuts = [sum(groups.balls[: i + 1]) for i in range(groups.rows - 1)]
    moments = groups.per_ball(groups.moment)
    # Equal pulls of every ball keep those of one line on it, so the step is damped, never undefined.
    floor = 1e-14 * jnp.sum(moments**2) * jnp.eye(2)

    def step(_, psi):
        left = groups.imbalance + jnp.sum(moments * jnp.exp(1j * psi))
        slope = moments * jnp.stack([-jnp.sin(psi), jnp.cos(psi)])  # (2, n)
        pull = jnp.linalg.solve(slope @ slope.T + floor, jnp.stack([left.real, left.imag]))
        move = slope.T @ pull
        size = jnp.max(jnp.abs(move))
        far = size > LARGEST_STEP
        return psi - move * jnp.where(far, LARGEST_STEP / jnp.where(far, size, 1.0), 1.0)

    found = jax.lax.fori_loop(0, STEPS, step, jnp.concatenate(rows))
    left = jnp.abs(groups.imbalance + jnp.sum(moments * jnp.exp(1j * found)))
    message = (
        "No balanced position was found from this start; see `balance_margin`, or start elsewhere."
    )
    found = eqx.error_if(found, ~(left < 1e-9 * jnp.sum(moments)), message)
    return tuple(jnp.split(found, cuts))


def checked(groups: BalancerGroups, positions: Sequence) -> Positions:
    """Positions as arrays, of the right number in each row."""
    rows = tuple(jnp.asarray(row, float) for row in positions)
    shapes = tuple(row.shape for row in rows)
    if shapes != tuple((n,) for n in groups.balls):
        raise ValueError(
            f"`positions` must have {groups.balls} angles, one array a row, but has shapes {shapes}."
        )
    return rows


def smallest_gap(positions: Sequence) -> Float[Array, " r"]:
    """Smallest angle [rad] between the centres of two balls of a row; 2 pi for one ball."""

    def gap(row):
        around = jnp.sort(jnp.mod(jnp.asarray(row, float), 2 * math.pi))
        return jnp.min(jnp.diff(around, append=around[:1] + 2 * math.pi))

    return jnp.stack([gap(row) for row in positions])


def pitch(ball_radius: Any, track_radius: Any) -> Array:
    """`2 asin(rho / r)` [rad]: angle between two balls that touch."""
    return 2 * jnp.arcsin(ball_radius / track_radius)


def packed_factor(balls: int, pitch: Any) -> Array:
    """`sin(n p / 2) / (n sin(p / 2))`: moment of a packed row of balls over that of balls in one point."""
    return jnp.sin(balls * pitch / 2) / (balls * jnp.sin(pitch / 2))
