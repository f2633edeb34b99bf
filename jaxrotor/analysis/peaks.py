"""Peaks of the response to unbalance: amplification factors and separation margins."""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from ..core.checks import in_order
from ..core.compiled import compiled_quickly
from ..core.roots import sign_change
from ..core.tables import RPM, notebook_table
from ..equations.pencil import isotropic
from ..equations.system import structure
from ..scene import Scene
from .critical import CriticalSpeeds, critical_between
from .forced import (
    HarmonicResponse,
    radius_and_distance,
    unbalance_response,
    unbalance_system,
)
from .observed import Unbalanced
from .resonance import CRITICAL


SAME = 1e-6  # distance, relative to the range, below which two speeds count as one
NARROWINGS = 60  # golden sections of a bracket at most
HALF_POWER = np.sqrt(0.5)  # amplitude there over that of the peak
DAMPED = 2.5  # amplification factor below which a peak needs no margin
MOST = {"below": 0.16, "above": 0.26}  # largest margins that are required


class Margins(NamedTuple):
    """Separation of `k` peaks from a range of operating speeds, relative to its nearer end."""

    actual: Float[np.ndarray, " k"]  # 0 within the range
    required: Float[np.ndarray, " k"]  # NaN where AF is unknown and may be large

    @property
    def kept(self) -> Bool[np.ndarray, " k"]:
        """Whether a peak is as far away as required; false where that is unknown."""
        return self.actual >= self.required


class ResponsePeaks(eqx.Module):
    """`k` peaks of the synchronous response at one station, and the speeds at half power.

    Peaks are ordered by the magnitude of their speeds, which are negative for reversed rotation.
    A critical speed without damping is a peak of infinite amplitude, whatever the unbalance excites.
    """

    response: HarmonicResponse  # at the speeds between which peaks were sought
    # Of the undamped rotor in that range; of circular orbits the forward ones
    critical: CriticalSpeeds
    speeds: Float[np.ndarray, " k"]  # [rad/s]
    amplitudes: Float[np.ndarray, " k"]  # major half axis [m]
    lower: Float[np.ndarray, " k"]  # half power, of smaller magnitude [rad/s], NaN if there is none
    upper: Float[np.ndarray, " k"]  # the same, of larger magnitude

    @property
    def amplification(self) -> Float[np.ndarray, " k"]:
        """`AF = N_c / (N_2 - N_1)`, by the speeds of half power on either side; NaN without them.

        Source: API RP 684 (2005), SP6.8.2.1.
        """
        width = self.upper - self.lower
        return np.where(width == 0, np.inf, self.speeds / np.where(width == 0, 1.0, width))

    @property
    def amplification_at_most(self) -> Float[np.ndarray, " k"]:
        """The amplification factor, or where it is unknown the largest one that the response allows.

        The speeds of half power are at least as far apart as those around the peak at which the response
        is known to be larger than there.
        """
        speeds, heights = np.asarray(self.response.speeds), np.asarray(self.response.major)[:, 0]
        found = self.amplification
        for k in np.flatnonzero(np.isnan(found)).tolist():
            small = heights < HALF_POWER * self.amplitudes[k]
            below, above = speeds < self.speeds[k], speeds > self.speeds[k]
            first = max(speeds[small & below], default=speeds.min())
            last = min(speeds[small & above], default=speeds.max())
            high = speeds[(first <= speeds) & (speeds <= last) & ~small]
            ends = np.nan_to_num([self.lower[k], self.upper[k]], nan=self.speeds[k])
            width = np.ptp([*high, *ends])
            found[k] = abs(self.speeds[k]) / width if width else np.nan
        return found

    def margins(self, slowest: float | int, fastest: float | int | None = None) -> Margins:
        """Separation margins: `17 (1 - 1 / (AF - 1.5))` % is required below the range of operation.

        Below, it is taken of the slowest operating speed, and 16 % suffice. Above, it is 10 % more and
        taken of the fastest operating speed, and 26 % suffice. A peak with `AF < 2.5` needs none; where
        the response shows that AF is smaller, its value need not be known.

        Args:
            slowest: slowest operating speed [rad/s], negative for reversed rotation.
            fastest: fastest one [rad/s], of the same sense, by default the same.

        Returns:
            `Margins`, actual and required ones as fractions.

        Raises:
            ValueError: the speeds are zero, or not of one sense and in order from slow to fast.

        Source: API RP 684 (2005), SP6.8.2.10; the same as API Standard 617, part 1.
        """
        fastest = slowest if fastest is None else fastest
        sense = -1 if slowest < 0 else 1
        if not 0 < sense * slowest <= sense * fastest < np.inf:
            raise ValueError(
                "Operating speeds [rad/s] must be of one sense of rotation, not zero, and the slower one "
                f"first, but are {slowest!r} and {fastest!r}."
            )
        below, above = (slowest - self.speeds) / slowest, (self.speeds - fastest) / fastest
        factor, damped = self.amplification, self.amplification_at_most < DAMPED
        needed = 0.17 * (1 - 1 / np.where(damped, DAMPED, factor - 1.5))
        bounds = (np.minimum(needed, MOST["below"]), np.minimum(0.1 + needed, MOST["above"]))
        required = np.where(above > 0, bounds[1], bounds[0])
        other = sense * self.speeds < 0  # a speed that the rotor never passes
        required = np.where(damped | other, 0.0, required)
        actual = np.maximum(0.0, np.maximum(below, above))
        return Margins(np.where(other, np.inf, actual), required)

    def _repr_html_(self) -> str:
        columns = {
            "speed [rad/s]": self.speeds,
            "[rpm]": self.speeds * RPM,
            "amplitude [m]": self.amplitudes,
            "half power from [rad/s]": self.lower,
            "to [rad/s]": self.upper,
            "amplification": self.amplification,
        }
        rows = list(zip(*columns.values(), strict=True))
        (station,) = np.asarray(self.response.stations).tolist()
        at = f"at {station:.6g} m" if np.isfinite(station) else "of a casing"
        return notebook_table(f"{len(rows)} peaks of the response {at}", list(columns), rows)


def response_peaks(
    scene: Scene,
    speeds,
    at=None,
    by: str | None = None,
    critical: CriticalSpeeds | None = None,
) -> ResponsePeaks:
    """`d |z| / d Omega = 0`: peaks of the response to unbalance, refined, and where they fall by sqrt 2.

    A speed of half power lies between a peak and the valley beside it, or the end of the range; where the
    amplitude does not fall so far there, it is NaN. Peaks are sought between the speeds that are given and
    the critical speeds among them, so a few hundred speeds miss none of use.

    Args:
        scene: a rotor without contact.
        speeds: three or more speeds [rad/s], ascending or descending; those of a reversed rotor are
            negative; of several shafts those of the first one.
        at: one station [m] or the name of a casing, by default the observed station of `simulate`; of
            several shafts `("hp", 0.3)`.
        by: name of the shaft whose unbalance acts, where there are several, by default the first one.
        critical: `critical_speeds` of the rotor in the sense of `speeds`, where they are known already, as
            of the same rotor with another unbalance.

    Returns:
        `ResponsePeaks`. Neither differentiable nor traceable; differentiate `unbalance_response`.

    Raises:
        ValueError: the speeds are fewer or not in order, there are several stations, or
            `unbalance_response` or `critical_speeds` refuses the scene.
    """
    speeds = np.asarray(speeds, float)
    if speeds.ndim != 1 or speeds.size < 3 or not in_order(speeds):
        raise ValueError(
            f"`speeds` must be three or more in ascending or descending order, but is {speeds}."
        )
    way = 1 if speeds[0] < speeds[-1] else -1
    speeds = speeds[::way]
    critical = _excited(scene, float(speeds[0]), float(speeds[-1]), by, critical)
    rotor = unbalance_system(scene, at, by)
    distances = [radius_and_distance(rotor, speed)[1] for speed in critical.speeds]
    unbounded = np.array(distances) < CRITICAL
    grid = _united(speeds, np.asarray(critical.speeds), unbounded)
    found = unbalance_response(scene, grid[::way], at, by)
    if found.stations.size != 1:
        raise ValueError(
            f"Peaks are those of one station, but `at` has {found.stations.size}; give one of them."
        )
    heights, sharp = np.asarray(found.major)[::way, 0], np.asarray(critical.speeds)[unbounded]
    rows: list[tuple[float, ...]] = [(speed, np.inf, speed, speed) for speed in sharp.tolist()]
    for k in _summits(heights).tolist():
        around = grid[k - 1 : k + 2]
        if not np.any((around[0] <= sharp) & (sharp <= around[2])):
            peak = _summit(rotor, around)
            distance = radius_and_distance(rotor, jnp.asarray(peak[0], float))[1]
            if distance < CRITICAL:  # where the rotor loses its stability or regains it
                rows.append((peak[0], np.inf, peak[0], peak[0]))
                continue
            outward = 1 if peak[0] > 0 else -1
            ends = (_half_power(rotor, grid, heights, k, peak, w) for w in (-outward, outward))
            rows.append((*peak, *ends))
    table = np.array(sorted(rows, key=lambda row: abs(row[0])), float).reshape(-1, 4)
    return ResponsePeaks(found, critical, *table.T)


def _excited(
    scene: Scene, low: float, high: float, by: str | None, given: CriticalSpeeds | None
) -> CriticalSpeeds:
    """Critical speeds in a range: where orbits are circles, the forward ones, as unbalance is forward."""
    if given is None:
        found = critical_between(scene, low, high, by)
    else:
        every = np.asarray(given.speeds)
        found = given.where((every >= low) & (every <= high))
    if isotropic(structure(scene).blocks):
        return found.where(np.array(found.kinds) == "forward")
    return found


def _united(speeds: np.ndarray, critical: np.ndarray, unbounded: np.ndarray) -> np.ndarray:
    """Speeds, and critical ones where the response is finite; of two that coincide the critical one.

    Between two critical speeds, also those of an unbounded response, there is another one at least, for
    the valley between their peaks.
    """
    apart = SAME * (speeds[-1] - speeds[0])
    near = np.abs(speeds[:, None] - critical) < apart
    every = np.union1d(speeds[~near.any(axis=1)], critical)
    own = np.isin(every, critical)
    valley = own[1:] & own[:-1] & (np.diff(every) > apart)
    between = (every[1:] + every[:-1])[valley] / 2
    return np.union1d(every[~np.isin(every, critical[unbounded])], between)


def _summits(heights: np.ndarray) -> np.ndarray:
    """Indices of the local maxima between the ends."""
    rises, falls = heights[1:-1] > heights[:-2], heights[1:-1] >= heights[2:]
    return np.flatnonzero(rises & falls) + 1


def _summit(rotor: Unbalanced, speeds: np.ndarray) -> tuple[float, float]:
    """Speed and amplitude of a maximum between three speeds of which the middle one is the highest.

    It is a zero of the slope where the amplitude is at least the largest one known. Where none is found,
    the bracket is narrowed by golden section.
    """
    low, best, high = speeds
    height = lambda speed: float(radius_and_distance(rotor, jnp.asarray(speed, float))[0][0])
    top = height(best)
    for _ in range(NARROWINGS):
        zero = _zero_between(rotor, low, high, np.nan)
        if np.isfinite(zero) and (found := height(zero)) >= top:
            return zero, found
        right = high - best > best - low
        speed = best + (3 - 5**0.5) / 2 * ((high if right else low) - best)
        new = height(speed)
        inner = best if new > top else speed
        low, high = (inner, high) if (new > top) == right else (low, inner)
        best, top = (speed, new) if new > top else (best, top)
    return float(best), top


def _zero_between(rotor: Unbalanced, low: float, high: float, level: float) -> float:
    """See `_zero`."""
    return float(_zero(rotor, jnp.asarray([low, high], float), jnp.asarray(level, float)))


@compiled_quickly
def _zero(rotor: Unbalanced, ends: Array, level: Array) -> Array:
    """Speed between two others at which the amplitude has a level, or if that is NaN a maximum.

    NaN where the amplitude is not on different sides of the level, or does not rise and then fall.
    """

    @jax.jit  # traced once a program
    def value(speed: Array) -> Array:
        radius = lambda speed: radius_and_distance(rotor, speed)[0][0]
        height, slope = jax.jvp(radius, (speed,), (jnp.ones_like(speed),))
        return jnp.where(jnp.isnan(level), slope, height - level)

    low, high = jax.lax.map(value, ends)
    found = sign_change(value, ends[0], ends[1], low, high, high > 0)
    between = jnp.where(jnp.isnan(level), (low > 0) & (high < 0), (low > 0) != (high > 0))
    return jnp.where(between, found, jnp.nan)


def _half_power(
    rotor: Unbalanced, grid, heights, k: int, peak: tuple[float, float], way: int
) -> float:
    """Speed of half power on one side of a peak, NaN if the valley or the end comes first."""
    (near, previous), half = peak, HALF_POWER * peak[1]
    k = k if (grid[k] - near) * way > 0 else k + way
    while 0 <= k < grid.size and heights[k] <= previous:
        if heights[k] < half:
            low, high = sorted((near, grid[k]))
            return _zero_between(rotor, low, high, half)
        near, previous, k = grid[k], heights[k], k + way
    return np.nan
