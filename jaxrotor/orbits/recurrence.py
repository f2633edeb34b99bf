"""Recurrence: when a motion is back where it was, but for a turn."""

from collections.abc import Sequence
from typing import Any

import numpy as np


APART = 0.2  # of the state: farther off it has left where it was
NEAR = 0.02  # as near as a motion that has settled is seen by its samples
WORSE = 2.0  # times the nearest return: a return that counts as well


def recurrence(response: Any, rate: float, turns: Sequence[float]) -> tuple[float, float]:
    """Time [s] and turn [rad] of `e^(-i turn) (q, q.)(t) = (q, q.)(t - time)` at the end of a response.

    The shortest time after which some turn brings the motion about as near as any does.

    Args:
        response: samples of one motion, as of `jaxrotor.simulate`.
        rate: by which velocities count beside displacements [rad/s].
        turns: to choose from.
    """
    states = np.concatenate([response.coordinates, np.asarray(response.rates) / rate], axis=1)
    states, step = states[::-1], float(response.time[1] - response.time[0])
    size = np.linalg.norm(states[0])
    back = np.exp(1j * np.asarray(turns))
    off = np.linalg.norm(states[0] - back[:, None, None] * states, axis=2) / (size or 1.0)
    left = off.min(axis=0) > APART
    if not size or not left.any():
        raise ValueError(
            "The guess hardly moves, so it shows no period; start from a motion, or give `revolutions` "
            "for a rotor that is to stand still."
        )
    found = []
    for turn, far in zip(turns, off**2, strict=True):
        for k in range(int(np.argmax(left)), far.size - 1):
            before, here, after = far[k - 1 : k + 2]
            if here <= before and here < after:  # a parabola through the three
                slope, bend = (after - before) / 2, after - 2 * here + before
                nearest = np.sqrt(max(here - slope**2 / (2 * bend), 0.0))
                found.append((step * (k - slope / bend), float(turn), nearest))
    best = min((off for *_, off in found), default=np.inf)
    if best > APART:
        raise ValueError(
            f"The motion of the guess is not back where it was within {float(step * len(states)):.3g} s, "
            "whatever the turn; let it settle for longer, keep more revolutions, or give `period` and "
            "`turn`."
        )
    time, turn, _ = min(one for one in found if one[2] <= max(WORSE * best, NEAR))
    return time, turn
