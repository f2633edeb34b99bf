"""Continuation: a branch of orbits, followed around its folds by pseudo-arclength.

    residual(u) = 0,   t . (u - u_k - h t) = 0,   u = (x, s)

`t` is the tangent in the last point `u_k`, `s` the place of the parameter in its range.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from ..core.checks import check_counts
from ..core.progress import progress as bar
from ..solvers.exponential import Exponential
from .bifurcations import Bifurcation, bifurcations, is_doubled
from .branch import Branch, branch_of
from .corrector import Corrector, Point, StepError, tangent
from .orbit import PeriodicOrbit
from .predictor import LEAST, SHARP, Predictor
from .problem import PhaseCondition, problem_of


END = 1e-12  # of the range: a point nearer to an end is at it
CLOSED = "the branch closes: it is back at the orbit that was given"
HALVED = "it meets the branch of orbits of half the period, at their flip at"


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

        residual(x, p) = 0   by pseudo-arclength

    On the way folds, flips (period doublings), Neimark-Sacker points, crossings of branches and grazing
    of contacts are detected and located. Where contact begins a branch has a kink, which it passes in
    small steps. See `Branch.doubled` for the branch that begins at a flip.

    Args:
        orbit: result of `periodic`; its steps are kept, and its turn if the scene has no unbalance.
        path: path of the parameter, such as "limiters.stiffness"; where it stands for several values
            they must be equal, and stay so.
        between: range of the parameter, in SI, which must hold the orbit's own value. A range of
            positive values over more than a decade is measured by its logarithm.
        direction: how the branch leaves the orbit: with the parameter "up", "down", or "both" ways.
        step: length of the first step, in units of the range or of the size of the state, whichever
            changes more.
        max_step: greatest length of a step, which is the distance of neighbours.
        max_points: greatest number of points in each direction.
        solver: as in `periodic`.
        tolerance: largest residual of a period, in units of the size of the state.
        max_iterations: of Newton's method at a point; where it does not converge, the step is halved.
        locate: whether to look for bifurcations; each takes about ten orbits.
        progress: whether to show a progress bar; by default on a terminal.

    Returns:
        A `Branch`, whose `reasons` say why it ends. It is not differentiable; its orbits, computed again
        by `periodic`, are.

    Raises:
        ValueError: if an argument is out of its range, the rotor does not rotate, the range has no scene
            of the same layout at its ends, the parameter has several values, or it breaks the symmetry of
            an orbit without unbalance.
        RuntimeError: if the corrector does not converge at the orbit itself.

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
    problem, first = problem_of(orbit, path, between, solver)
    corrector = Corrector(problem, tolerance, max_iterations)
    start = _first_point(corrector, first, path)
    tracer = _Tracer(corrector, Predictor(corrector, max_step), step, max_points, locate)
    signs = {"both": (1, -1), "up": (1,), "down": (-1,)}[direction]
    with bar(progress, len(signs) * max_points, f"continuing in {path}", "points") as tick:
        halves = {}
        for sign in signs:
            halves[sign] = tracer.half_branch(start, sign, tick)
            if halves[sign].reason == CLOSED:
                break
    alone = _HalfBranch([start], [], "the orbit that was given", [])
    if direction == "down":
        down = halves[-1]
        reasons = alone.reason, down.reason
        return branch_of(corrector, down.points, down.found, down.lost, reasons)
    return _joined(corrector, halves.get(-1, alone), halves.get(1, alone))


def _joined(corrector: Corrector, down: "_HalfBranch", up: "_HalfBranch") -> Branch:
    """One branch of the two halves that begin at the same orbit."""
    back = len(down.points) - 1
    turned = [
        (back - 1 - after, one._replace(fraction=1 - one.fraction)) for after, one in down.found
    ]
    found = turned[::-1] + [(back + after, one) for after, one in up.found]
    lost = [(back - 1 - after, kind) for after, kind in down.lost]
    lost = lost[::-1] + [(back + after, kind) for after, kind in up.lost]
    points = down.points[:0:-1] + up.points
    return branch_of(corrector, points, found, lost, (down.reason, up.reason))


class _HalfBranch(NamedTuple):
    """The points of a branch from an orbit in one direction, and its bifurcations."""

    points: list[Point]
    found: list[tuple[int, Bifurcation]]  # after which point
    reason: str  # why it ends
    lost: list[tuple[int, str]]  # kinds that were detected but not located, after which point


class _Tracer(NamedTuple):
    """Follows a branch point by point and looks for bifurcations on the way."""

    corrector: Corrector
    predictor: Predictor
    step: float
    max_points: int
    locate: bool

    def half_branch(self, start: Point, sign: int, tick: Any) -> _HalfBranch:
        """The branch from a point, first with the parameter up (`sign` 1) or down (-1)."""
        forward = np.append(np.zeros(start.u.size - 1), float(sign))
        start = start._replace(tangent=tangent(start.evaluation, forward))
        half, h = _HalfBranch([start], [], "", []), self.step
        while len(half.points) <= self.max_points:
            last = half.points[-1]
            if abs(last.u[-1] - (last.tangent[-1] > 0)) < END:
                return half._replace(reason=f"{self._at(last)} is the end of the range")
            try:
                point, h, ended = self.predictor.next(last, h)
            except StepError as error:
                reason = f"no progress from {self._at(last)}, by steps down to {LEAST:g}: {error}"
                return half._replace(reason=reason)
            after = len(half.points) - 1
            found, lost = bifurcations(self.corrector, last, point) if self.locate else ([], [])
            half.lost.extend((after, kind) for kind in lost)
            for one in found:
                meets = one.kind in ("fold", "branching")
                if meets and is_doubled(self.corrector.problem, one.point):
                    half.points.append(one.point)
                    return half._replace(reason=f"{HALVED} {self._at(one.point)}")
                half.found.append((after, one))
            half.points.append(point)
            tick(1)
            if not ended and _closes(start, last, point):
                return half._replace(reason=CLOSED)
        return half._replace(
            reason=f"`max_points` = {self.max_points} are taken, to {self._at(half.points[-1])}"
        )

    def _at(self, point: Point) -> str:
        problem = self.corrector.problem
        return f"{problem.path} = {float(problem.value(point.u[-1])):.9g}"


def _closes(start: Point, last: Point, point: Point) -> bool:
    """Whether the start is between two neighbours."""
    chord = point.u - last.u
    length = np.linalg.norm(chord)
    fraction = (start.u - last.u) @ chord / length**2
    off = np.linalg.norm(start.u - last.u - fraction * chord)
    along = start.tangent @ chord > SHARP * length
    return bool(0 < fraction <= 1 and off < 0.1 * length and along)


def _first_point(corrector: Corrector, first: np.ndarray, path: str) -> Point:
    """The point of the orbit itself."""
    m = first.size - (2 if corrector.problem.revolutions is None else 1)
    direction = corrector.evaluate(first, PhaseCondition(first[:m], np.zeros(m))).direction
    normal = np.append(np.zeros(first.size - 1), 1.0)
    try:
        return corrector.point(first, normal, PhaseCondition(first[:m], direction), normal)
    except StepError as error:
        raise RuntimeError(
            f"The orbit cannot be continued in `{path}`: {error}; compute it by `periodic` with the steps "
            "and the `solver` that it is to be continued with."
        ) from None
