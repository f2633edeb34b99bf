"""Continuation: a branch of orbits, around its folds, by steps of its own length.

    missed(u) = 0,   t . (u - u_k - h t) = 0,   u = (x, s)

`t` is the tangent in the last point `u_k`, `s` the share of the parameter's range.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from ..core.checks import check_counts
from ..core.progress import progress as bar
from ..solvers.exponential import Exponential
from .bifurcations import Found, bifurcations, halved
from .branch import Branch, branch_of
from .corrector import Corrector, LostError, Point, tangent
from .curve import Gauge, curve_of
from .periodic import PeriodicOrbit


END = 1e-12  # of the range: as near as an orbit at its end is to it
LEAST = 1e-7  # step, of a state or of the range
SHARP = 0.9  # cosine of the angle between tangents of neighbours that is taken for a smooth turn
ASIDE = 0.3  # of a step: what the corrector may add to it
KINK = 1e-3  # step below which a tangent may turn by more: where a contact begins
FAR = 10  # of such a step: what is further is not the other side of a kink
EASY, HARD = 2, 5  # iterations of the corrector after which steps grow, or shrink


def continue_(
    orbit: PeriodicOrbit,
    path: str,
    between: Sequence[float],
    *,
    direction: str = "both",
    step: float = 0.01,
    max_step: float = 0.05,
    max_points: int = 400,
    solver: Exponential | None = None,
    tolerance: float = 1e-10,
    max_iterations: int = 8,
    locate: bool = True,
    progress: bool | None = None,
) -> Branch:
    """The orbits near an orbit as one parameter of its scene changes, through folds, stable or not.

        missed(x, p) = 0   by pseudo-arclength

    On the way folds, flips (period doublings), Neimark-Sacker points, crossings of branches and grazing
    of contacts are detected and located. Where contact begins a branch has a kink, which it passes in
    small steps. See `Branch.doubled` for the branch that begins at a flip.

    Args:
        orbit: of `periodic`; its steps and, if it has no unbalance, its turn are kept.
        path: of the parameter, "limiters.stiffness"; several of one kind must be equal and stay so.
        between: range of the parameter, in SI, with the orbit's own value in it. A range of positive
            values over more than a decade is measured by its logarithm.
        direction: from the orbit "up" or "down" to begin with, or "both".
        step: first step, of the range or the size of the state, whichever changes more.
        max_step: longest; how far apart neighbours may be.
        max_points: in each direction.
        solver: as in `periodic`.
        tolerance: of what a period misses, of the size of the state.
        max_iterations: of Newton's method at a point; where they do not do, the step is halved.
        locate: whether to look for bifurcations; each takes some ten orbits.
        progress: whether to show a progress bar; by default on a terminal.

    Returns:
        A `Branch`; `reasons` say why it ends. Not differentiable; its orbits, found again by `periodic`,
        are.

    Source: Allgower, Georg (2003), Introduction to Numerical Continuation Methods, chapters 2, 6.
    """
    check_counts(max_points=max_points, max_iterations=max_iterations)
    if direction not in ("both", "up", "down"):
        raise ValueError(f"`direction` must be 'both', 'up' or 'down', but is {direction!r}.")
    if not LEAST < step <= max_step:
        raise ValueError(
            f"`step` must be above {LEAST:g} and at most `max_step`, but they are {step!r} and "
            f"{max_step!r}."
        )
    curve, first = curve_of(orbit, path, between, solver)
    corrector = Corrector(curve, tolerance, max_iterations)
    start = _start(corrector, first, path)
    trip = _Trip(corrector, step, max_step, max_points, locate)
    ways = {"both": (1, -1), "up": (1,), "down": (-1,)}[direction]
    with bar(progress, len(ways) * max_points, f"continuing in {path}", "points") as tick:
        trails = {}
        for way in ways:
            trails[way] = trip.go(start, way, tick)
            if trails[way].reason == CLOSED:
                break
    alone = "the orbit that was given"
    if direction == "down":
        way = trails[-1]
        return branch_of(corrector, way.points, way.found, way.lost, (alone, way.reason))
    up, down = (trails.get(way, _Trail([start], [], alone, [])) for way in (1, -1))
    back = len(down.points) - 1
    found = [(back - 1 - after, one._replace(share=1 - one.share)) for after, one in down.found]
    found = found[::-1] + [(back + after, one) for after, one in up.found]
    points = down.points[:0:-1] + up.points
    lost = [(back - 1 - after, kind) for after, kind in down.lost]
    lost = lost[::-1] + [(back + after, kind) for after, kind in up.lost]
    return branch_of(corrector, points, found, lost, (down.reason, up.reason))


CLOSED = "the branch closes: it is back at the orbit that was given"
HALVED = "orbits of half the period, on both sides of their flip, are met at"


class _Trail(NamedTuple):
    """Points of a branch on one way, what was found after which of them, and why it ends."""

    points: list[Point]
    found: list[tuple[int, Found]]
    reason: str
    lost: list[tuple[int, str]]  # kinds that were detected, not located


class _Trip(NamedTuple):
    """How a branch is followed."""

    corrector: Corrector
    step: float
    max_step: float
    max_points: int
    locate: bool

    def go(self, start: Point, way: int, tick: Any) -> _Trail:
        """From a point on, first with `way` the parameter up or down."""
        onward = np.append(np.zeros(start.u.size - 1), float(way))
        start = start._replace(tangent=tangent(start.look, onward))
        trail, h = _Trail([start], [], "", []), self.step
        while len(trail.points) <= self.max_points:
            last = trail.points[-1]
            if abs(last.u[-1] - (last.tangent[-1] > 0)) < END:
                return trail._replace(reason=f"{self._at(last)} is the end of the range")
            try:
                point, h, ended = self._next(last, h)
            except LostError as error:
                return trail._replace(reason=self._lost(last, error))
            after = len(trail.points) - 1
            found, lost = bifurcations(self.corrector, last, point) if self.locate else ([], [])
            trail.lost.extend((after, kind) for kind in lost)
            for one in found:
                if one.kind in ("fold", "branching") and halved(self.corrector.curve, one.point):
                    trail.points.append(one.point)
                    return trail._replace(reason=f"{HALVED} {self._at(one.point)}")
                trail.found.append((after, one))
            trail.points.append(point)
            tick(1)
            if not ended and _closes(start, last, point):
                return trail._replace(reason=CLOSED)
        return trail._replace(
            reason=f"`max_points` = {self.max_points} are taken, to {self._at(trail.points[-1])}"
        )

    def _next(self, last: Point, h: float) -> tuple[Point, float, bool]:
        """The next point, the step to try after it, and whether it ends the range."""
        gauge = last.gauge(self.corrector.curve)
        while True:
            guess = last.u + h * last.tangent
            try:
                point, ended = self._reached(last, guess, gauge)
                _check_way(last, point, guess, h, ended)
            except LostError:
                h /= 2
                if h < LEAST:
                    raise
                continue
            h *= 1.5 if point.iterations <= EASY else 0.5 if point.iterations >= HARD else 1.0
            return point, min(h, self.max_step * self._largest(point)), ended

    def _reached(self, last: Point, guess: np.ndarray, gauge: Gauge) -> tuple[Point, bool]:
        """The point near a guess, or the end of the range before it."""
        if 0 <= guess[-1] <= 1:
            point = self.corrector.point(guess, last.tangent, gauge, last.tangent)
            if 0 <= point.u[-1] <= 1:
                return point, False
            guess = point.u
        return self._end(last, guess, gauge), True

    def _largest(self, point: Point) -> float:
        """Of the state and the range."""
        return max(1.0, float(np.linalg.norm(point.u[: point.look.direction.size])))

    def _end(self, last: Point, guess: np.ndarray, gauge: Gauge) -> Point:
        """The point at the end of the range, before a guess beyond it."""
        bound = 1.0 if guess[-1] > 1 else 0.0
        ahead = guess[-1] - last.u[-1]
        share = (bound - last.u[-1]) / ahead if ahead else 1.0
        row = np.append(np.zeros(guess.size - 1), 1.0)
        at = last.u + share * (guess - last.u)
        at[-1] = bound
        return self.corrector.point(at, row, gauge, last.tangent)

    def _at(self, point: Point) -> str:
        curve = self.corrector.curve
        return f"{curve.path} = {float(curve.value(point.u[-1])):.9g}"

    def _lost(self, last: Point, error: LostError) -> str:
        return f"no progress from {self._at(last)}, by steps down to {LEAST:g}: {error}"


def _check_way(last: Point, point: Point, guess: np.ndarray, h: float, ended: bool) -> None:
    """Refuse what may be on another branch; small steps may pass a kink."""
    small = h < KINK
    if not small and last.tangent @ point.tangent < SHARP:
        raise LostError("the branch turns too sharply")
    far = np.linalg.norm(point.u - last.u) > (FAR if small else 2) * h
    aside = not ended and not small and np.linalg.norm(point.u - guess) > ASIDE * h
    if far or aside:
        raise LostError("the corrector leads elsewhere")


def _closes(start: Point, last: Point, point: Point) -> bool:
    """Whether the start is between two neighbours."""
    chord = point.u - last.u
    length = np.linalg.norm(chord)
    share = (start.u - last.u) @ chord / length**2
    off = np.linalg.norm(start.u - last.u - share * chord)
    return bool(0 < share <= 1 and off < 0.1 * length and start.tangent @ chord > SHARP * length)


def _start(corrector: Corrector, first: np.ndarray, path: str) -> Point:
    """The point of the orbit itself."""
    m = first.size - (2 if corrector.curve.revolutions is None else 1)
    direction = corrector.look(first, Gauge(first[:m], np.zeros(m))).direction
    row = np.append(np.zeros(first.size - 1), 1.0)
    try:
        return corrector.point(first, row, Gauge(first[:m], direction), row)
    except LostError as error:
        raise RuntimeError(
            f"The orbit cannot be continued in `{path}`: {error}; find it by `periodic` with the steps "
            "and the `solver` that it is to be continued with."
        ) from None
