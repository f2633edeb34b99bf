"""Settling of a drive: the steady speed that its torque leads to, and the time it takes."""

from typing import NamedTuple

import numpy as np

from ..spins.drive import Drive


_FAR = 1e6  # rad/s from the start: farthest speed at which a torque balance is sought
_POINTS = 4001
_NEAR = 1e-3  # relative distance from the steady speed that counts as settled


class Settled(NamedTuple):
    """Steady speed of a drive and its settling time."""

    speed: float  # [rad/s]
    time: float  # [s] until the speed stays within 0.1 %


def settled(drive: Drive, polar: float) -> Settled:
    """`M(Omega*) = 0`, the first torque balance from `Omega_0` on; `t = I Int dOmega / M(Omega)`.

    Settled means within 0.1 % of the steady speed, or of the initial one where the rotor comes to rest.
    Unbalance, balls and contact are left out.

    Args:
        drive: motor and resistance.
        polar: I [kg m^2].

    Returns:
        `Settled` speed [rad/s] and time [s]. Not differentiable.

    Raises:
        ValueError: the torques balance at no speed ahead, so the speed runs away.
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
            "The torques of this drive balance at no speed ahead, so its speed runs away; give the "
            "duration of the run, or a speed."
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
