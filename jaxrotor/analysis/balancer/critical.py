"""Critical cases: imbalances that can be balanced with all balls on one line."""

import itertools
from collections.abc import Sequence
from math import comb, gcd
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float, Int


class CriticalCases(NamedTuple):
    """Balanced positions with all balls on the line of the imbalance, `j_l` of row l on its side."""

    sides: Int[np.ndarray, "k r"]  # j_l of the cases with imbalance, x > 0
    imbalance: Float[np.ndarray, " k"]  # s0 = x(j) of each case, ascending
    distinct: Float[np.ndarray, " d"]  # distinct critical values of s0, ascending
    balanced: Int[np.ndarray, "z r"]  # j_l of the cases without imbalance, x = 0
    halves: (
        int  # number of cases without imbalance; cases that differ by a half-turn count once (k_kr)
    )


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
    common = gcd(numerator, denominator)
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
        count *= comb(n, int(j))
    return count
