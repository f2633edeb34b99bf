"""Main motions: the family of ball positions that balance the rotor, and its critical cases."""

import itertools
import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float, Int

from ...core import linalg
from ...core.compiled import compiled_quickly
from ...core.extremes import larger, largest
from ...core.quantities import Scalar, known
from .groups import BalancerGroups


Positions = tuple[Float[Array, " _"], ...]  # psi [rad], one array per row
# Newton steps of `nearest_balanced`; a position near the limit of the capacity takes half
STEPS = 100
LARGEST_STEP = 0.5  # rad, largest move of a ball in one step


def imbalance(groups: BalancerGroups, positions: Sequence) -> Complex[Array, ""]:
    """`s_z = s0 + sum_l S_l sum_i exp(i psi_li)`: residual imbalance, zero at a main motion.

    Args:
        groups: the balancer.
        positions: psi [rad], one array per row.

    Returns:
        s_z. Differentiable.

    Raises:
        ValueError: the positions are not one angle per ball.
    """
    return jnp.sum(row_imbalances(groups, positions))


def row_imbalances(groups: BalancerGroups, positions: Sequence) -> Complex[Array, " r"]:
    """`s_lz = S_l sum_i exp(i psi_li)`: imbalance of each row; that of the first includes `s0`.

    Args:
        groups: the balancer.
        positions: psi [rad], one array per row.

    Returns:
        s_lz. Differentiable.

    Raises:
        ValueError: the positions are not one angle per ball.
    """
    sums = jnp.stack([jnp.sum(jnp.exp(1j * row)) for row in checked(groups, positions)])
    return (groups.moment * sums).at[0].add(groups.imbalance)


def second_harmonics(positions: Sequence) -> Complex[Array, " r"]:
    """`beta_l = b_l exp(i theta_l) = (1/n_l) sum_i exp(2 i psi_li)`: they determine stability.

    Args:
        positions: psi [rad], one array per row.

    Returns:
        beta_l; `b_l` is 1 for a row on one line. Differentiable.

    Source: Filimonikhin, Goncharov (2011), eq. (3.5).
    """
    return jnp.stack([jnp.mean(jnp.exp(2j * jnp.asarray(row, float))) for row in positions])


def balance_margin(groups: BalancerGroups) -> Scalar:
    """Margin by which the largest of `s0, S_1, ..` (one per ball) is below the sum of the others.

    Args:
        groups: the balancer.

    Returns:
        Margin; balanced positions exist where it is not negative. Differentiable.
    """
    everything = groups.capacity + groups.imbalance
    heaviest = larger(groups.imbalance, largest(groups.moment))
    return everything - 2 * heaviest


def balanced_positions(
    groups: BalancerGroups, row_sums: Sequence, angles: Sequence[Sequence]
) -> Positions:
    """`psi = arg z ± arccos(|z| / 2)`: last two balls of each row in a balanced position.

    `z` is the sum `exp(i psi) + exp(i psi')` that remains for them, given the imbalances of rows and
    the angles of all other balls.

    Args:
        groups: a balancer with two balls or more in every row.
        row_sums: `s_1z, ..`, complex imbalance of each row but the last, that of the first including s0;
            the last row compensates them.
        angles: angles [rad] of the first `n_l - 2` balls of each row: `[[], [0.4]]` for 2 and 3 balls.

    Returns:
        Positions: the given angles, then those with plus and minus. Differentiable unless |z| is 0 or
        2; NaN where traced and |z| > 2.

    Raises:
        ValueError: the numbers of sums or angles do not fit, or |z| > 2 is out of reach of two balls.
    """
    if len(row_sums) != groups.rows - 1:
        raise ValueError(
            f"`row_sums` must have one value per row but the last ({groups.rows - 1}), "
            f"but has {len(row_sums)}."
        )
    given = tuple(len(row) for row in angles)
    if given != tuple(n - 2 for n in groups.balls):
        raise ValueError(
            f"`angles` must have all balls but two of each row of {groups.balls}, but has {given}."
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
    """A balanced position close to `start`, by Gauss-Newton steps of least norm on `s_z = 0`.

    Unlike `balanced_positions` it takes rows of any number of balls.

    Args:
        groups: the balancer.
        start: psi [rad], one array per row.

    Returns:
        Positions. Differentiable, also by `start`.

    Raises:
        ValueError: `start` is not one angle per ball.
        EquinoxRuntimeError: none was found: no position balances, or all balls start on one line.
    """
    return _nearest(groups, checked(groups, start))


@compiled_quickly
def _nearest(groups: BalancerGroups, rows: Positions) -> Positions:
    cuts = [sum(groups.balls[: i + 1]) for i in range(groups.rows - 1)]
    moments = groups.per_ball(groups.moment)
    # For balls on one line the matrix is singular; this floor keeps the step defined.
    floor = 1e-14 * jnp.sum(moments**2) * jnp.eye(2)

    def step(_, psi):
        left = groups.imbalance + jnp.sum(moments * jnp.exp(1j * psi))
        slope = moments * jnp.stack([-jnp.sin(psi), jnp.cos(psi)])  # (2, n)
        pull = linalg.solve(slope @ slope.T + floor, jnp.stack([left.real, left.imag]))
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
    """Positions as arrays; raises unless there is one angle per ball."""
    rows = tuple(jnp.asarray(row, float) for row in positions)
    shapes = tuple(row.shape for row in rows)
    if shapes != tuple((n,) for n in groups.balls):
        raise ValueError(
            f"`positions` must have {groups.balls} angles, one array per row, but has shapes {shapes}."
        )
    return rows


def smallest_gap(positions: Sequence) -> Float[Array, " r"]:
    """Smallest angle between the centres of two balls of each row.

    Args:
        positions: psi [rad], one array per row.

    Returns:
        Angle [rad] of each row; 2 pi for a single ball.
    """

    def gap(row):
        around = jnp.sort(jnp.mod(jnp.asarray(row, float), 2 * math.pi))
        return jnp.min(jnp.diff(around, append=around[:1] + 2 * math.pi))

    return jnp.stack([gap(row) for row in positions])


def pitch(ball_radius: Any, track_radius: Any) -> Array:
    """`2 asin(rho / r)`: angle between the centres of two balls that touch.

    Args:
        ball_radius: rho.
        track_radius: r of the circle of the balls' centres, in the same unit.

    Returns:
        Angle [rad]. Differentiable.
    """
    return 2 * jnp.arcsin(ball_radius / track_radius)


def packed_factor(balls: int, pitch: Any) -> Array:
    """`sin(n p / 2) / (n sin(p / 2))`: moment of a packed row over that of balls in one point.

    Args:
        balls: n, number of balls.
        pitch: p [rad], see `pitch`.

    Returns:
        Factor [1]. Differentiable.
    """
    return jnp.sin(balls * pitch / 2) / (balls * jnp.sin(pitch / 2))


# === critical cases: all balls on one line


class CriticalCases(NamedTuple):
    """Balanced positions with all balls on the line of the imbalance, `j_l` of row l on its side."""

    sides: Int[np.ndarray, "k r"]  # j_l of the cases with imbalance, x > 0
    imbalance: Float[np.ndarray, " k"]  # s0 = x(j) of each case, ascending
    distinct: Float[np.ndarray, " d"]  # distinct critical values of s0, ascending
    balanced: Int[np.ndarray, "z r"]  # j_l of the cases without imbalance, x = 0
    # Number of cases without imbalance; cases that differ by a half-turn count once (k_kr)
    halves: int


def critical_cases(balls: Sequence[int], moment: Any) -> CriticalCases:
    """All `x(j) = sum_l S_l (n_l - 2 j_l)` that can be an imbalance: `s0 = x > 0`, or `s0 = 0 = x`.

    At a critical `s0` the slowest root of the position on one line is zero, so the balancing time tends
    to infinity nearby; avoid these values. Values within 1e-12 of the capacity count as one.

    Args:
        balls: n_l, number of balls in each of any number of rows.
        moment: S_l of each row.

    Returns:
        `CriticalCases`.

    Raises:
        ValueError: `moment` does not have one number per row.

    Source: Filimonikhin, Goncharov (2011), eqs. (7.1)-(7.4), with H(0) = 0.
    """
    balls, weights = tuple(balls), np.asarray(moment, float)
    if weights.shape != (len(balls),):
        raise ValueError(
            f"`moment` must have one number per row of `balls` ({len(balls)}), "
            f"but has shape {weights.shape}."
        )
    sides = np.array(list(itertools.product(*(range(n + 1) for n in balls))))
    x = (np.array(balls) - 2 * sides) @ weights
    small = 1e-12 * (np.array(balls) @ weights)
    above = np.flatnonzero(x > small)
    above = above[np.argsort(x[above], kind="stable")]
    values = x[above]
    distinct = values[np.diff(values, prepend=-np.inf) > small]
    balanced = sides[np.abs(x) <= small]
    return CriticalCases(sides[above], values, distinct, balanced, (len(balanced) + 1) // 2)


def critical_count(balls: Sequence[int], numerator: int, denominator: int) -> int:
    """`k_kr`: number of critical cases of two rows without imbalance, `S_2 = p2 / p1`.

        min( [n1 / 2 p2], [n2 / 2 p1] ) + 1                      n1, n2 both even
        min( [(n1 / p2 + 1) / 2], [(n2 / p1 + 1) / 2] )          else, if n1 - p2 and n2 - p1 are even
        0                                                        else

    Positions that differ by a half-turn count as one.

    Args:
        balls: n1, n2.
        numerator: p2, or a multiple.
        denominator: p1, or the same multiple.

    Returns:
        k_kr.

    Raises:
        ValueError: there are not two rows.

    Source: Filimonikhin, Goncharov (2011), section 7, its third and fourth rows and its last sentence
    corrected.
    """
    if len(balls) != 2:
        raise ValueError(f"The formula is for two rows, but there are {len(balls)}.")
    common = math.gcd(numerator, denominator)
    p2, p1 = numerator // common, denominator // common
    n1, n2 = balls
    if n1 % 2 == 0 and n2 % 2 == 0:
        return min(n1 // (2 * p2), n2 // (2 * p1)) + 1
    if (n1 - p2) % 2 == 0 and (n2 - p1) % 2 == 0:
        return min((n1 // p2 + 1) // 2, (n2 // p1 + 1) // 2)
    return 0


def labellings(balls: Sequence[int], sides: Any) -> int:
    """`prod C(n_l, j_l)`: number of ways in which numbered balls can take these sides.

    Args:
        balls: n_l, number of balls in each row.
        sides: j_l, number of balls of each row on one side.

    Returns:
        Number of labellings.
    """
    count = 1
    for n, j in zip(balls, sides, strict=True):
        count *= math.comb(n, int(j))
    return count
