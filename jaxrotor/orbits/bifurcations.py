"""Bifurcations: special points of a branch, found by test functions that change sign there.

    fold             dp/ds = 0                     of the parameter p along the branch
    flip             det(M + 1) = 0                multiplier -1
    Neimark-Sacker   prod(mu_i mu_j - 1) = 0       a pair of multipliers on the unit circle
    branching        det(J; tangent) = 0           another branch crosses
    grazing          min clearance = 0             a contact begins or ends to be touched

Where a test function changes sign between two points of the branch, its root on the branch in between
is computed.

Source: Kuznetsov (2004), Elements of Applied Bifurcation Theory, sections 10.2, 10.3.
"""

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Complex, Float, Int
from scipy.optimize import brentq

from .corrector import Corrector, Point, StepError, jacobian_at_own_phase
from .problem import ContinuationProblem, Evaluation


KINDS = ("fold", "flip", "neimark-sacker", "branching", "grazing")
CROSSED = ("fold", "branching")  # what a branch may have where it meets another one
# Of the range of the radius: accuracy to which an orbit is known where two of them meet
SAME = 1e-2
NEAR = 1e-5  # from the unit circle or from -1: a multiplier further away has jumped, not crossed
SINGULAR = 1e-3  # smallest singular value of the Jacobian where branches cross, at most
ALIKE = 1e-6  # of a clearance: contacts that are touched in the same way

TestFunction = Callable[[Any], float]  # of a `Point`


class Bifurcation(NamedTuple):
    """A special point located between two points of a branch."""

    kind: str
    contact: int | None  # the one that is grazed
    fraction: float  # of the way from the first point to the second
    point: Any  # of the branch, or of the curve, that it is on


def of_kind(points: tuple, kind: str, kinds: tuple[str, ...]) -> tuple:
    """The points of a kind, which must be one of some `kinds`."""
    if kind not in kinds:
        raise ValueError(f"`kind` must be one of {', '.join(kinds)}, but is {kind!r}.")
    return tuple(point for point in points if point.kind == kind)


def bifurcations(corrector: Corrector, a: Point, b: Point) -> tuple[list[Bifurcation], list[str]]:
    """Bifurcations between two neighbours, in order, and the kinds that could not be located."""
    found, lost = [], []
    for kind, contact, test in _sign_changes(a, b):
        try:
            fraction, point = root_between(corrector, a, b, test)
        except StepError:
            lost.append(kind)
            continue
        by_multipliers = kind in ("flip", "neimark-sacker")
        if not by_multipliers or is_at(kind, point.evaluation.multipliers):
            found.append(Bifurcation(kind, contact, fraction, point))
        elif _stable(a) != _stable(b):  # multipliers jumped, as where contact begins
            lost.append(kind)
    return sorted(found, key=lambda one: one.fraction), lost


def _stable(point: Point) -> bool:
    return bool(np.all(np.abs(point.evaluation.multipliers) < 1))


def _sign_changes(a: Point, b: Point) -> Iterator[tuple[str, int | None, TestFunction]]:
    """The test functions of different sign at two points, with their kinds and contacts."""
    scale = max(np.linalg.slogdet(_bordered(one))[1] for one in (a, b))
    tests: dict[str, TestFunction] = {
        "fold": lambda point: point.tangent[-1],
        "flip": lambda point: np.prod(1 + point.evaluation.multipliers).real,
        "neimark-sacker": lambda point: pair_products(point.evaluation.multipliers),
        "branching": lambda point: _determinant(_bordered(point), scale),
    }
    for kind, test in tests.items():
        if np.sign(test(a)) * np.sign(test(b)) < 0:
            yield kind, None, test
    before, after = touches(a.evaluation), touches(b.evaluation)
    changed = [k for k in before if before[k][0] != after[k][0]]
    done: list[np.ndarray] = []
    for k in changed:  # contacts that a symmetry maps to each other graze together
        margins = np.array([before[k][1], after[k][1]])
        if not any(np.allclose(margins, one, rtol=ALIKE, atol=0.0) for one in done):
            done.append(margins)
            yield "grazing", k, _grazing(k, before[k][0])


def _grazing(k: int, count: int) -> TestFunction:
    """Size of the extremum of clearance nearest to zero, positive while `k` is touched `count` times."""

    def test(point: Point) -> float:
        touched, margin = touches(point.evaluation)[k]
        return abs(margin) if touched == count else -abs(margin)

    return test


def root_between(corrector: Any, a: Any, b: Any, test: TestFunction) -> tuple[float, Any]:
    """The root of a test function, in planes across the chord of two points.

    They are of a branch or of a curve, as its corrector gives them.
    """
    chord = b.u - a.u
    length = float(np.linalg.norm(chord))
    normal, known = chord / length, {0.0: a, 1.0: b}

    def value(fraction: float) -> float:
        if fraction not in known:
            guess = _interpolated(a, b, length, fraction)
            known[fraction] = corrector.point(guess, normal, a.anchor, normal)
        return test(known[fraction])

    find: Any = brentq
    fraction, report = find(value, 0.0, 1.0, xtol=1e-12, rtol=1e-14, full_output=True, disp=False)
    if not report.converged:
        raise StepError("the root of a test function was not found")
    value(fraction)
    return fraction, known[fraction]


def _interpolated(a: Any, b: Any, length: float, fraction: float) -> np.ndarray:
    """Unknowns by the cubic through two points with their tangents."""
    ease = fraction**2 * (3 - 2 * fraction)
    first, last = fraction * (1 - fraction) ** 2, -(fraction**2) * (1 - fraction)
    return a.u + ease * (b.u - a.u) + length * (first * a.tangent + last * b.tangent)


def is_at(kind: str, multipliers: Complex[np.ndarray, " r"]) -> bool:
    """Whether a root is a bifurcation: multipliers may jump, and two real ones have a product of 1."""
    values: Any = np.asarray(multipliers)
    if kind == "neimark-sacker":
        whirling = values[np.abs(values.imag) > NEAR]
        return bool(np.abs(np.abs(whirling) - 1).min(initial=1.0) < NEAR)
    return bool(np.abs(values - (1 if kind == "fold" else -1)).min(initial=1.0) < NEAR)


def pair_products(multipliers: Complex[np.ndarray, " r"]) -> float:
    """Test function of a Neimark-Sacker point: `prod(mu_i mu_j - 1)`."""
    first, second = np.triu_indices(multipliers.size, 1)
    return float(np.prod(multipliers[first] * multipliers[second] - 1).real)


def _bordered(point: Point) -> np.ndarray:
    """The Jacobian with the tangent as its last row."""
    return np.vstack([jacobian_at_own_phase(point.evaluation), point.tangent])


def _determinant(matrix: np.ndarray, scale: float) -> float:
    """Determinant over `exp(scale)`, within the range of a number."""
    sign, size = np.linalg.slogdet(matrix)
    return sign * np.exp(np.clip(size - scale, -600.0, 600.0))


def branch_met(problem: ContinuationProblem, found: Bifurcation) -> str | None:
    """Kind of the bifurcation, of another branch, at which a branch that began there has come back."""
    second = np.linalg.svd(jacobian_at_own_phase(found.point.evaluation))[1][-1]
    if found.kind not in CROSSED or second > SINGULAR:
        return None
    if _is_doubled(problem, found.point):
        return "flip"
    # Where it meets orbits of more symmetry it folds and goes on with the mirror images of its orbits.
    return "branching" if found.kind == "fold" else None


def _is_doubled(problem: ContinuationProblem, point: Point) -> bool:
    """Whether an orbit is one of half the period, run through twice."""
    z = point.evaluation.samples.displacement[:, 0]
    half, odd = divmod(z.size - 1, 2)
    if odd or (problem.revolutions or 2) % 2:
        return False
    halves = 2 if problem.revolutions is None else 1
    turns = float(problem.turn) / 2 + np.pi * np.arange(halves)
    apart = [np.abs(z[half:] - np.exp(1j * turn) * z[: half + 1]).max() for turn in turns]
    symmetric = np.abs(np.exp(1j * problem.order * turns) - 1) < SAME  # the scene stays as it is
    return bool(np.min(apart, where=symmetric, initial=np.inf) < SAME * np.ptp(np.abs(z)))


def touches(evaluation: Evaluation) -> dict[int, tuple[int, float]]:
    """How often each contact is touched, and its extremum of clearance in time nearest to zero [m].

    Contacts that always act are left out.
    """
    found = {}
    for k in range(evaluation.clearance.shape[-1]):
        if np.isfinite(evaluation.clearance[..., k]).all():
            extrema = _extrema(evaluation, k)
            inside = extrema < 0
            count = int(np.sum(inside != np.roll(inside, 1))) // 2
            found[k] = count, float(extrema[np.argmin(np.abs(extrema))])
    return found


def least_clearance(evaluation: Evaluation) -> Float[np.ndarray, " k"]:
    """Least clearance of every contact [m], -inf of one that always acts."""
    clearance = np.asarray(evaluation.clearance)
    finite = [k for k in range(clearance.shape[-1]) if np.isfinite(clearance[..., k]).all()]
    found = np.full(clearance.shape[-1], -np.inf)
    for k in finite:
        found[k] = min(_extrema(evaluation, k).min(), clearance[..., k].min())
    return found


def _extrema(evaluation: Evaluation, k: int) -> Float[np.ndarray, " e"]:
    """Extrema of a clearance [m] in order of time, by cubics between samples."""
    parts = evaluation.clearance, evaluation.clearance_rate
    clearance, rate = (np.asarray(part[..., k]) for part in parts)
    step = float(evaluation.period) / (len(clearance) - 1)
    return _extrema_of(clearance, step * rate)[0]


def nearest_extremum(
    clearance: Float[np.ndarray, "T i"],
    rate: Float[np.ndarray, "T i"],
    clearance_slope: Float[np.ndarray, "T i b"],
    rate_slope: Float[np.ndarray, "T i b"],
) -> tuple[float, Float[np.ndarray, " b"]]:
    """The extremum of a clearance nearest to zero [m] and its derivatives, from those of the samples.

    Rates are per step. The instant of an extremum may move without changing it, to first order.
    """
    values, numbers, at = _extrema_of(clearance, rate)
    nearest = int(np.argmin(np.abs(values)))
    image, sample = divmod(int(numbers[nearest]), len(clearance) - 1)
    u = at[nearest]
    ends = slice(sample, sample + 2)
    before, after = clearance_slope[ends, image]
    rate_before, rate_after = rate_slope[ends, image]
    ease = u * u * (3 - 2 * u)
    slope = (1 - ease) * before + ease * after
    slope += u * (1 - u) ** 2 * rate_before - u * u * (1 - u) * rate_after
    return float(values[nearest]), slope


def _extrema_of(
    clearance: Float[np.ndarray, "T i"], rate: Float[np.ndarray, "T i"]
) -> tuple[Float[np.ndarray, " e"], Int[np.ndarray, " e"], Float[np.ndarray, " e"]]:
    """Extrema of a clearance [m], the number of the span between samples of each, and its place in there.

    Rates are per step; spans are counted image by image.
    """
    clearance, rate = clearance.T, rate.T
    c0, c1 = clearance[:, :-1].ravel(), clearance[:, 1:].ravel()
    r0, r1 = rate[:, :-1].ravel(), rate[:, 1:].ravel()
    numbers = np.flatnonzero((r0 * r1 < 0) | (r0 == 0))
    if not numbers.size:
        return c0[:1], np.zeros(1, int), np.zeros(1)
    c0, c1, r0, r1 = (part[numbers] for part in (c0, c1, r0, r1))
    square, cube = 3 * (c1 - c0) - 2 * r0 - r1, 2 * (c0 - c1) + r0 + r1
    at = r0 / np.where(r0 == r1, 1.0, r0 - r1)
    for _ in range(4):
        slope, bend = r0 + at * (2 * square + 3 * cube * at), 2 * square + 6 * cube * at
        at = np.clip(at - slope / np.where(bend == 0, np.inf, bend), 0.0, 1.0)
    return c0 + at * (r0 + at * (square + at * cube)), numbers, at
