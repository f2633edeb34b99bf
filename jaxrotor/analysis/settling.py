"""Settling of a drive: the speed it comes to by its own torque alone, and when."""

from typing import NamedTuple

import numpy as np

from ..spins.drive import Drive


_FAR = 1e6  # rad/s from the start, beyond which no balance of torques is looked for
_POINTS = 4001
_NEAR = 1e-3  # of the speed: as good as there


class Settled(NamedTuple):
    """Where a drive comes to, and when."""

    speed: float  # [rad/s]
    time: float  # until within 0.1 % of it [s]


def settled(drive: Drive, polar: float) -> Settled:
    """`M(Omega*) = 0`, the first balance on the way from `Omega_0`; `t = I Int dOmega / M(Omega)`.

    0.1 % are of the steady speed, or of the first one where the rotor comes to rest. Unbalance, balls
    and contact are left out. Not differentiable.

    Args:
        drive: motor and resistance.
        polar: I [kg m^2].

    Raises:
        ValueError: torques balance nowhere on the way, so the speed runs away.
    """
    start = float(drive.speed)
    moment = lambda speeds: np.asarray(drive.moment(np.asarray(speeds)))
    sense = float(np.sign(moment(start)))
    marks = [0.0] if drive.table_speeds is None else [0.0, *np.asarray(drive.table_speeds)]
    ahead = [mark for mark in marks if sense * (mark - start) > 0]
    way = np.sort(
        [*(sense * np.array(ahead)), *(sense * start + np.geomspace(1e-6, _FAR, _POINTS))]
    )
    turned = np.flatnonzero(sense * moment(sense * way) <= 0)
    if sense == 0:
        return Settled(start, 0.0)
    if not turned.size:
        raise ValueError(
            "The torques of this drive balance at no speed that it comes to, so it runs away; say how "
            "long to run, or at what speed."
        )
    high = way[turned[0]]
    low = way[turned[0] - 1] if turned[0] else sense * start
    for _ in range(100):
        middle = (low + high) / 2
        low, high = (middle, high) if sense * moment(sense * middle) > 0 else (low, middle)
    steady = float(sense * high)
    near, far = _NEAR * (abs(steady) or abs(start)), abs(steady - start)
    if far <= near:
        return Settled(steady, 0.0)
    left = np.geomspace(near, far, _POINTS)
    rate = left * polar / np.abs(moment(steady - sense * left))
    return Settled(steady, float(np.trapezoid(rate, np.log(left))))
