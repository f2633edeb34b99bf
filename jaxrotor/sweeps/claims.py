"""Claims: the kinds of motion that can be shown of lanes that were followed."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Complex, Float, Int
from scipy import stats

from ..orbits.lyapunov import BLOCKS, mean_and_error, taper
from ..orbits.memory import go_one_way
from .followed import Followed


MOTIONS = ("periodic", "quasi_periodic", "chaotic", "transient", "undecided", "failed")
PERIODIC, QUASI_PERIODIC, CHAOTIC, TRANSIENT, UNDECIDED, FAILED = range(len(MOTIONS))
REGULAR_KINDS = PERIODIC, QUASI_PERIODIC
NEAR = 1e-3  # of the state: a motion that returns at least as near may be periodic
CLOSED = 1e-8  # of the state: what an orbit may miss after its period
FAR = 0.2  # of the state: an orbit that attracts a motion from further away is another motion
TRIES = 3  # periods of a lane for which an orbit is sought
REGULAR = 1e-5  # change of weighted averages from one half of a regular run to the other
STILL = 2e-3  # growth in a revolution that a regular motion may have at most
ZERO = 1e-6  # growth in a revolution that is rounding
MARGIN = 1e-7  # of the multiplier of an orbit that attracts, below 1
BOUNDED = 10.0  # times the largest distance of the first half: a motion that goes further grows
GROWN = 10.0  # logarithm of the growth of a disturbance in half of a run that no regular motion has
CONFIDENCE = 0.95  # of the bounds of an exponent and of a lifetime


class Claims(NamedTuple):
    """Claims about lanes, each (lanes,)."""

    motion: Int[np.ndarray, " l"]  # number in `MOTIONS`
    period: Int[np.ndarray, " l"]  # revolutions, 0 where it is not periodic
    multiplier: Float[np.ndarray, " l"]  # largest modulus
    rotation: Float[np.ndarray, " l"]
    rotation_error: Float[np.ndarray, " l"]
    exponent: Float[np.ndarray, " l"]  # a revolution
    error: Float[np.ndarray, " l"]  # standard error of it


def claims_of(
    followed: Followed, returned: Float[np.ndarray, "l p"], near: Callable, again: Callable
) -> Claims:
    """Claims about lanes that were followed, and whose ends miss themselves by `returned` after 1, 2, ..

    `near` gives orbits of a period near the ends of lanes, `again` the misses of such orbits. Where no
    lane can return, `returned` is infinite, and none is sought.
    """
    growth, turned, section = map(np.asarray, followed[2:5])
    exponent, error = map(np.asarray, mean_and_error(growth.T))
    rotation, change = _average(turned)
    half = growth.shape[1] // 2
    early, late = growth[:, :half].sum(axis=1), growth[:, -half:].sum(axis=1)
    settling = growth[:, -(half // 4) :].sum(axis=1) < 0
    smooth = (change < REGULAR) & _converges(section)
    regular = smooth & (np.abs(exponent) < np.minimum(quantile() * error + ZERO, STILL))
    before, after = (np.abs(part).max(axis=1) for part in (section[:, :half], section[:, -half:]))
    chaotic = ~smooth & (early > GROWN) & (late > GROWN) & (after < BOUNDED * before)
    motion = np.full(len(growth), UNDECIDED)
    motion[(early > GROWN) & (late < 0)] = TRANSIENT
    motion[chaotic] = CHAOTIC
    motion[regular & (returned.min(axis=1) > CLOSED)] = QUASI_PERIODIC
    period, multiplier = np.zeros(len(growth), int), np.full(len(growth), np.nan)
    for candidate in _candidates(returned).T if not np.isinf(returned).all() else ():
        tried = np.where((settling | regular) & (period == 0), candidate, 0)
        for p in np.unique(tried[tried > 0]):
            orbits = near(p)
            miss, shift, largest = map(np.asarray, orbits[1:])
            closed = (tried == p) & (miss < CLOSED) & (largest < 1 - MARGIN)
            here = closed & (shift < NEAR)
            motion[closed & ~here & (shift < FAR) & (late < -1) & ~regular] = TRANSIENT
            if here.any():
                back = again(orbits.y) < CLOSED
                least = 1 + np.argmax(back, axis=1)  # of which `p` is a multiple
                motion[here], period[here] = PERIODIC, least[here]
                multiplier[here] = largest[here] ** (least[here] / p)
    wearing = go_one_way(np.asarray(followed.states), lasting=True).any(axis=-1)
    motion = np.where(wearing & (motion != PERIODIC), UNDECIDED, motion)
    motion = np.where(np.asarray(followed.outcome.ok), motion, FAILED)
    for k in np.flatnonzero(motion == PERIODIC):  # of the last periods, not of what led there
        last, former = turned[k, -period[k] :].mean(), turned[k, -2 * period[k] : -period[k]].mean()
        rotation[k], change[k] = last, abs(last - former)
    return Claims(motion, period, multiplier, rotation, change, exponent, error)


def _converges(section: Complex[np.ndarray, "l R"]) -> Bool[np.ndarray, " l"]:
    """Whether averages of displacements at the ends of revolutions converge, over their spread."""
    apart = section - section.mean(axis=1, keepdims=True)
    spread = np.sqrt(np.mean(np.abs(apart) ** 2, axis=1))
    rounding = np.finfo(float).eps * np.abs(section).max(axis=1)
    changes = [_average(part)[1] for part in (apart.real, apart.imag, np.abs(apart) ** 2)]
    limits = [REGULAR * spread + rounding] * 2 + [REGULAR * spread**2 + rounding**2]
    return np.all([c <= limit for c, limit in zip(changes, limits, strict=True)], axis=0)


def _candidates(distances: Float[np.ndarray, "l p"]) -> Int[np.ndarray, "l t"]:
    """Periods of which orbits are sought: those of near returns, the shortest first, else the nearest.

    0 where there are no more.
    """
    near = distances < NEAR
    order = np.argsort(~near, axis=1, kind="stable")[:, :TRIES]
    found = np.where(np.take_along_axis(near, order, 1), order + 1, 0)
    found[:, 0] = np.where(near.any(axis=1), found[:, 0], np.argmin(distances, axis=1) + 1)
    return found


def quantile() -> float:
    """Standard errors of the mean of blocks to the bounds."""
    return float(stats.t.ppf((1 + CONFIDENCE) / 2, BLOCKS - 1))


def _average(values: Float[np.ndarray, "l R"]) -> tuple[np.ndarray, np.ndarray]:
    """Weighted averages over revolutions, and their change from the first half to the second."""
    mean = lambda part: part @ taper(part.shape[1])
    half = values.shape[1] // 2
    return mean(values), np.abs(mean(values[:, :half]) - mean(values[:, -half:]))


def confirmed(
    found: Claims, finer: Claims, later: Int[np.ndarray, " l"]
) -> tuple[Claims, Bool[np.ndarray, " l"]]:
    """Claims with the numbers of the finer run, and which it contradicts: these are undecided.

    `later` are kinds of motion after further runs. Chaos that has ended by then is a transient, and may
    have ended in the finer run as well. Chaos of which these do not tell is undecided.
    """
    ended = np.isin(later, (*REGULAR_KINDS, TRANSIENT)) & (found.motion == CHAOTIC)
    lasting = np.where(ended, TRANSIENT, np.minimum(later, UNDECIDED))
    motion = np.where(found.motion == CHAOTIC, lasting, found.motion)
    same = (finer.motion == motion) & (finer.period == found.period)
    same |= (motion == TRANSIENT) & np.isin(finer.motion, REGULAR_KINDS)
    same |= ended & (finer.motion == CHAOTIC)
    withdrawn = ~same & (motion < UNDECIDED)
    motion = np.where(withdrawn, UNDECIDED, motion)
    return finer._replace(motion=np.where(finer.motion == FAILED, FAILED, motion)), withdrawn
