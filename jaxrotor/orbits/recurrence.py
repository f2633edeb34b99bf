"""Recurrence: the time after which a motion returns to where it was, up to a rotation."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np


APART = 0.2  # of the state: a motion further away than this has left its starting state
NEAR = 0.02  # of the state: a settled motion returns at least this near, as its samples show
WORSE = 2.0  # times the nearest return: returns up to this distance count as well
LOOPS = 12  # near returns before the one that counts: more call for the check of `_recurs`
REPEATED = 1.5  # times the distance of the first return: the limit for the returns after it
RESOLVED = 5e-3  # of the state: samples cannot tell nearer returns apart


def recurrence(response: Any, rate: float, turns: Sequence[float]) -> tuple[float, float]:
    """Time [s] and turn [rad] of `e^(-i turn) (q, q.)(t) = (q, q.)(t - time)` at the end of a response.

    The result is the shortest time after which some rotation brings the motion about as near as any
    does. A quasi-periodic or chaotic motion comes near by chance after a long time, and is further away
    after twice and three times as long, where a periodic one is equally near: such a return raises a
    ValueError.

    Args:
        response: samples of one motion, as of `jaxrotor.simulate`.
        rate: velocities are divided by it to compare with displacements [rad/s].
        turns: rotations to choose from [rad].
    """
    states = np.concatenate([response.coordinates, np.asarray(response.rates) / rate], axis=1)
    states, step = states[::-1], float(response.time[1] - response.time[0])
    size = np.linalg.norm(states[0])
    distances = np.stack([_distances(states, turn) for turn in turns])
    left = distances.min(axis=0) > APART
    if not size or not left.any():
        raise ValueError(
            "The guess hardly moves, so it shows no period; start from a motion, or give `revolutions` "
            "for a rotor that is to stand still."
        )
    found = []
    for turn, squares in zip(turns, distances**2, strict=True):
        for k in range(int(np.argmax(left)), squares.size - 1):
            before, here, after = squares[k - 1 : k + 2]
            if here <= before and here < after:
                found.append((*_lowest(squares, k), float(turn)))
    best = min((nearest for _, nearest, _ in found), default=np.inf)
    if best > APART:
        raise ValueError(
            f"The motion of the guess is not back where it was within {float(step * len(states)):.3g} s, "
            "whatever the turn; let it settle for longer, keep more revolutions, or give `period` and "
            "`turn`."
        )
    samples, nearest, turn = min(one for one in found if one[1] <= max(WORSE * best, NEAR))
    period = float(step * samples)
    loops = sum(one[0] < samples for one in found) / len(turns)
    if loops > LOOPS and not _recurs(states, samples, turn, nearest):
        raise ValueError(
            f"The motion of the guess first comes back after {period:.4g} s, to {100 * nearest:.2g} % of "
            "its state, but its samples do not show it as near after multiples of that time, so it seems "
            "quasi-periodic or chaotic (see `jaxrotor.lyapunov`); let it settle for longer, keep more "
            f"revolutions, or, if this is its period, give period={period:.6g} and turn={turn:.6g}."
        )
    return period, turn


def _distances(states: np.ndarray, turn: float) -> np.ndarray:
    """Distance `|z_0 - e^(i turn) z_k|` over `|z_0|` of states of shape (T, 2 n)."""
    size = np.linalg.norm(states[0]) or 1.0
    return np.linalg.norm(states[0] - np.exp(1j * turn) * states, axis=1) / size


def _lowest(squares: np.ndarray, k: int) -> tuple[float, float]:
    """Place [samples] and root of the minimum of the parabola through three squares about sample `k`."""
    before, here, after = squares[k - 1 : k + 2]
    slope, bend = (after - before) / 2, after - 2 * here + before
    return k - slope / bend, math.sqrt(max(here - slope**2 / (2 * bend), 0.0))


def _recurs(states: np.ndarray, samples: float, turn: float, nearest: float) -> bool:
    """Whether a motion is about as near after each multiple of a period that its samples show.

    False where the samples end before a second period.
    """
    multiples = range(2, int((len(states) - 2) / samples) + 1)
    for times in multiples:
        squares = _distances(states, times * turn) ** 2
        begin = round(times * (samples - 1))
        k = begin + int(np.argmin(squares[begin : round(times * (samples + 1)) + 1]))
        near = _lowest(squares, k)[1] if 0 < k < squares.size - 1 else math.sqrt(squares[k])
        if near > max(REPEATED * nearest, RESOLVED):
            return False
    return len(multiples) > 0
