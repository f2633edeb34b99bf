"""Bifurcations: what happens to an orbit on its branch, and where.

    fold             dp/ds = 0                     of the parameter p along the branch
    flip             det(M + 1) = 0                multiplier -1
    Neimark-Sacker   prod(mu_i mu_j - 1) = 0       a pair of multipliers on the unit circle
    branching        det(J; tangent) = 0           another branch crosses
    grazing          min clearance = 0             a contact begins or ends to be touched

Each is a number that changes its sign between two points of the branch; its root is found on the
branch in between.

Source: Kuznetsov (2004), Elements of Applied Bifurcation Theory, sections 10.2, 10.3.
"""

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float
from scipy.optimize import brentq

from .corrector import Corrector, LostError, Point, recentred
from .curve import Curve, Look


KINDS = ("fold", "flip", "neimark-sacker", "branching", "grazing")
SAME = 1e-2  # of the range of the radius: where two motions meet they are known to less
NEAR = 1e-5  # of the unit circle or of -1: a multiplier further off has not crossed, but jumped


ALIKE = 1e-6  # of a clearance: contacts that are touched in the same way
Test = Callable[[Any], float]  # of a `Point`


class Found(NamedTuple):
    """What was found between two points of a branch."""

    kind: str
    contact: int | None  # that is grazed
    share: float  # of the way from the one to the other
    point: Point


def bifurcations(corrector: Corrector, a: Point, b: Point) -> tuple[list[Found], list[str]]:
    """All between two neighbours, in their order, and the kinds of those that were not located."""
    found, lost = [], []
    for kind, contact, test in _changed(a, b):
        try:
            share, point = _located(corrector, a, b, test)
        except LostError:
            lost.append(kind)
            continue
        if _is_one(kind, point):
            found.append(Found(kind, contact, share, point))
        elif _stable(a) != _stable(b):  # multipliers jumped, as where contact begins
            lost.append(kind)
    return sorted(found, key=lambda one: one.share), lost


def _stable(point: Point) -> bool:
    return bool(np.all(np.abs(point.look.multipliers) < 1))


def _changed(a: Point, b: Point) -> Iterator[tuple[str, int | None, Test]]:
    """The tests that differ in sign."""
    border = np.linalg.slogdet(_bordered(a))[1]
    tests: dict[str, Test] = {
        "fold": lambda point: point.tangent[-1],
        "flip": lambda point: np.prod(1 + point.look.multipliers).real,
        "neimark-sacker": _pairs,
        "branching": lambda point: _determinant(_bordered(point), border),
    }
    for kind, test in tests.items():
        if np.sign(test(a)) * np.sign(test(b)) < 0:
            yield kind, None, test
    before, after = touches(a.look), touches(b.look)
    changed = [k for k in before if before[k][0] != after[k][0]]
    seen: list[np.ndarray] = []
    for k in changed:  # contacts that a symmetry takes to each other are touched alike
        margins = np.array([before[k][1], after[k][1]])
        if not any(np.allclose(margins, one, rtol=ALIKE, atol=0.0) for one in seen):
            seen.append(margins)
            yield "grazing", k, _grazing(k, before[k][0])


def _grazing(k: int, touched: int) -> Test:
    """Clearance nearest to zero, above it while a contact is touched so often."""

    def test(point: Point) -> float:
        count, margin = touches(point.look)[k]
        return abs(margin) if count == touched else -abs(margin)

    return test


def _located(corrector: Corrector, a: Point, b: Point, test: Test) -> tuple[float, Point]:
    """The root of a test, in planes across the chord of two points."""
    chord = b.u - a.u
    length = float(np.linalg.norm(chord))
    row, gauge = chord / length, a.gauge(corrector.curve)
    known = {0.0: a, 1.0: b}

    def value(share: float) -> float:
        if share not in known:
            guess = _between(a, b, length, share)
            known[share] = corrector.point(guess, row, gauge, row)
        return test(known[share])

    find: Any = brentq
    share, how = find(value, 0.0, 1.0, xtol=1e-12, rtol=1e-14, full_output=True, disp=False)
    if not how.converged:
        raise LostError("the root of a test was not found")
    value(share)
    return share, known[share]


def _between(a: Point, b: Point, length: float, share: float) -> np.ndarray:
    """Cubic by two points and the tangents there."""
    ease = share**2 * (3 - 2 * share)
    first, last = share * (1 - share) ** 2, -(share**2) * (1 - share)
    return a.u + ease * (b.u - a.u) + length * (first * a.tangent + last * b.tangent)


def _is_one(kind: str, point: Point) -> bool:
    """Whether it is what its test says: multipliers may jump, and real ones have products of 1."""
    multipliers: Any = np.asarray(point.look.multipliers)
    if kind == "flip":
        return bool(np.abs(multipliers + 1).min() < NEAR)
    if kind == "neimark-sacker":
        whirling = multipliers[np.abs(multipliers.imag) > NEAR]
        return bool(np.abs(np.abs(whirling) - 1).min(initial=1.0) < NEAR)
    return True


def _pairs(point: Point) -> float:
    multipliers = np.asarray(point.look.multipliers)
    first, second = np.triu_indices(multipliers.size, 1)
    return float(np.prod(multipliers[first] * multipliers[second] - 1).real)


def _bordered(point: Point) -> np.ndarray:
    return np.vstack([recentred(point.look), point.tangent])


def _determinant(matrix: np.ndarray, scale: float) -> float:
    sign, size = np.linalg.slogdet(matrix)
    return sign * np.exp(np.clip(size - scale, -600.0, 600.0))


def halved(curve: Curve, point: Point) -> bool:
    """Whether an orbit is one of half the period, taken twice."""
    z = point.look.seen.displacement[:, 0]
    half, odd = divmod(z.size - 1, 2)
    if odd or (curve.revolutions or 2) % 2:
        return False
    turns = float(curve.turn) / 2 + np.pi * np.arange(2 if curve.revolutions is None else 1)
    back = [np.abs(z[half:] - np.exp(1j * turn) * z[: half + 1]).max() for turn in turns]
    allowed = np.abs(np.exp(1j * curve.order * turns) - 1) < SAME  # leaves the scene as it is
    return bool(np.min(back, where=allowed, initial=np.inf) < SAME * np.ptp(np.abs(z)))


def touches(look: Look) -> dict[int, tuple[int, float]]:
    """Of contacts that may be free: how often each is touched, and its clearance nearest to zero [m].

    That is an extremum in time.
    """
    found = {}
    for k in range(look.clearance.shape[-1]):
        if np.isfinite(look.clearance[..., k]).all():
            extrema = _extrema(look, k)
            inside = extrema < 0
            count = int(np.sum(inside != np.roll(inside, 1))) // 2
            found[k] = count, float(extrema[np.argmin(np.abs(extrema))])
    return found


def least(look: Look) -> Float[np.ndarray, " k"]:
    """Least clearance of every contact [m], -inf of one that always acts."""
    clearance = np.asarray(look.clearance)
    free = [k for k in range(clearance.shape[-1]) if np.isfinite(clearance[..., k]).all()]
    found = np.full(clearance.shape[-1], -np.inf)
    for k in free:
        found[k] = min(_extrema(look, k).min(), clearance[..., k].min())
    return found


def _extrema(look: Look, k: int) -> Float[np.ndarray, " e"]:
    """Extrema of a clearance [m] in the order of time, by cubics between samples."""
    clearance, parting = (np.asarray(part[..., k]).T for part in (look.clearance, look.parting))
    h = float(look.period) / (clearance.shape[1] - 1)
    c0, c1 = clearance[:, :-1].ravel(), clearance[:, 1:].ravel()
    r0, r1 = h * parting[:, :-1].ravel(), h * parting[:, 1:].ravel()
    turns = (r0 * r1 < 0) | (r0 == 0)
    if not turns.any():
        return c0[:1]
    c0, c1, r0, r1 = (part[turns] for part in (c0, c1, r0, r1))
    square, cube = 3 * (c1 - c0) - 2 * r0 - r1, 2 * (c0 - c1) + r0 + r1
    at = r0 / np.where(r0 == r1, 1.0, r0 - r1)
    for _ in range(4):
        slope, curve = r0 + at * (2 * square + 3 * cube * at), 2 * square + 6 * cube * at
        at = np.clip(at - slope / np.where(curve == 0, np.inf, curve), 0.0, 1.0)
    return c0 + at * (r0 + at * (square + at * cube))
