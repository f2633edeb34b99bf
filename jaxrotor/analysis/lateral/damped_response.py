"""Damped unbalance response of one case: peaks at probes, and amplitudes at close clearances."""

import equinox as eqx
import numpy as np
from jaxtyping import Float

from ...core.tables import RPM
from ...files.machine import Machine
from ...scene import Scene
from ..critical import CriticalSpeeds
from ..forced import HarmonicResponse, unbalance_response
from ..peaks import ResponsePeaks, response_peaks
from .unbalance_cases import UnbalanceCase


LARGEST = 25.4e-6  # m peak to peak
AT = 12_000.0  # rpm up to which it is the limit
LARGEST_SCALE = 6.0
SHARE = 0.75  # of a clearance that may be used
_POINTS = 61  # stations of a deflected shape
_CLOSE = 0.05  # relative distance of peaks below which they have one shape


class CaseResponse(eqx.Module):
    """Response of a rotor to one unbalance case, peak to peak on the major axis of its orbits."""

    case: UnbalanceCase
    peaks: tuple[ResponsePeaks, ...]  # at every probe
    response: HarmonicResponse  # at the probes, then at the close clearances
    shapes: HarmonicResponse  # of the whole shaft, at its peaks and at the rated speed
    limit: float | int  # A_vl, peak to peak [m]
    slowest: float | int  # minimum operating speed [rad/s]
    fastest: float | int  # maximum continuous speed [rad/s]
    trip: float | int  # [rad/s]

    @property
    def largest(self) -> Float[np.ndarray, " p"]:
        """Largest amplitude at each probe over the running range, peak to peak [m]."""
        speeds = np.abs(np.asarray(self.response.speeds))
        running = (speeds >= self.slowest) & (speeds <= self.fastest)
        return 2 * np.asarray(self.response.major)[running, : len(self.peaks)].max(axis=0)

    @property
    def scale(self) -> float:
        """`S_cc = A_vl / A_max`, at most 6: factor of amplitudes at close clearances."""
        return min(self.limit / max(float(self.largest.max()), 1e-300), LARGEST_SCALE)

    @property
    def scaled(self) -> Float[np.ndarray, " c"]:
        """Largest scaled amplitude at each close clearance up to the trip speed, peak to peak [m]."""
        below = np.abs(np.asarray(self.response.speeds)) <= self.trip
        return (
            2 * self.scale * np.asarray(self.response.major)[below, len(self.peaks) :].max(axis=0)
        )


def vibration_limit(speed: float | int) -> float:
    """`A_vl = 25.4 sqrt(12000 / N)` um, at most 25.4 um: limit of vibration, peak to peak [m].

    Args:
        speed: maximum continuous speed N [rad/s].

    Returns:
        Limit, peak to peak [m].

    Source: API RP 684 (2005), SP6.8.2.11.
    """
    return LARGEST * min(1.0, (AT / (RPM * abs(speed))) ** 0.5)


def damped_response(
    scene: Scene,
    case: UnbalanceCase,
    machine: Machine,
    speeds: Float[np.ndarray, " w"],
    critical: CriticalSpeeds,
) -> CaseResponse:
    """Response to an unbalance case at probes and close clearances, see `unbalance_response`.

    Peaks at the probes are those of `response_peaks`; their speeds are among those at which amplitudes
    are read. Of peaks at several probes within 5 % the first one has a shape.

    Args:
        scene: the rotor, linear; its own unbalance is left out.
        case: the unbalances.
        machine: its running range, probes and clearances.
        speeds: speeds [rad/s], of the sense of the scene, which have the running range within.
        critical: critical speeds of the rotor.

    Returns:
        `CaseResponse`.

    Source: API RP 684 (2005), SP6.8.2.7 to SP6.8.2.13.
    """
    rotor = case.on(scene)
    read = lambda probe: response_peaks(rotor, speeds, float(probe.at), critical=critical)
    peaks = tuple(map(read, machine.probes))
    sharp = [one.speeds[np.isfinite(one.amplitudes)] for one in peaks]
    named = float(machine.slowest), machine.rated_speed, float(machine.fastest), machine.highest
    ends = float(scene.spin.sense) * np.array(named)
    every = np.unique(np.concatenate([speeds, *sharp, ends]))
    stations = [float(one.at) for one in (*machine.probes, *machine.clearances)]
    along = np.linspace(0.0, float(scene.shaft.length), _POINTS)
    found = unbalance_response(rotor, every, [*stations, *along.tolist()])
    shown = np.searchsorted(every, [*_apart(np.concatenate(sharp)), ends[1]])
    part = lambda rows, columns: HarmonicResponse(
        found.speeds[rows],
        found.frequencies[rows],
        found.stations[columns],
        found.forward[rows][:, columns],
        found.backward[rows][:, columns],
        None,
    )
    whole = slice(None)
    responses = part(whole, slice(len(stations))), part(shown, slice(len(stations), None))
    limits = vibration_limit(float(machine.fastest)), float(machine.slowest), float(machine.fastest)
    return CaseResponse(case, peaks, *responses, *limits, machine.highest)


def _apart(speeds: np.ndarray) -> list[float]:
    """Speeds by rising magnitude, of several close to each other the first one."""
    found: list[float] = []
    for speed in sorted(speeds.tolist(), key=abs):
        if not found or abs(speed) > (1 + _CLOSE) * abs(found[-1]):
            found.append(speed)
    return found
