"""Curves of bifurcations over two parameters, followed by pseudo-arclength.

    residual(u) = 0,   g(u) = 0,   t . (u - u_k - h t) = 0,   u = (x, s_1, s_2)

`g` is the equation of a bifurcation (`bordered.py`), `t` the tangent in the last point `u_k`.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from ..core.checks import check_counts
from ..core.progress import progress as bar
from .bifurcation_curve import BifurcationCurve, curve_of
from .bordered import AbstractCondition, Anchor, Trial, condition_of
from .branch import Branch, BranchPoint
from .codimension_two import PointOfCurve, points_between
from .corrector import StepError, Unknowns, newton, tangent
from .predictor import Predictor
from .problem import ContinuationProblem, problem_of
from .tracer import Found, Tracer, check_travel


CONTINUED = ("fold", "flip", "neimark-sacker", "grazing")
ENDS = ("1:1 resonance", "1:2 resonance")  # of a Neimark-Sacker curve: beyond, multipliers are real


def continue_curve(
    branch: Branch,
    point: BranchPoint,
    paths: Sequence[str],
    bounds: Sequence[Sequence[float]],
    *,
    direction: str = "both",
    step: float = 0.01,
    max_step: float = 0.05,
    max_points: int = 400,
    tolerance: float = 1e-10,
    max_iterations: int = 8,
    locate: bool = True,
    progress: bool | None = None,
) -> BifurcationCurve:
    """The curve of a bifurcation over two parameters, through turns in either.

        residual(x, p1, p2) = 0,   g(x, p1, p2) = 0   by pseudo-arclength

    `g = 0` is the condition of a fold, a flip, a Neimark-Sacker point or a grazing contact, as a bordered
    system. On the way points of codimension two are detected and located: cusps, 1:1, 1:2, 1:3 and 1:4
    resonances, and where two bifurcations coincide, such as "fold-flip" or "grazing-fold".

    Args:
        branch: result of `continue_`; its steps and solver are kept.
        point: one of its `points`: a fold, a flip, a Neimark-Sacker point or a grazing contact.
        paths: paths of the two parameters, such as ("limiters.friction", "limiters.stiffness"); that of
            the branch need not be one of them.
        bounds: range of each parameter, in SI, which must hold its value at the point. A range of
            positive values over more than a decade is measured by its logarithm.
        direction: how the curve leaves the point: with the first parameter "up", "down", or "both" ways.
        step: length of the first step, in units of the ranges or of the size of the state, whichever
            changes more.
        max_step: greatest length of a step, which is the distance of neighbours.
        max_points: greatest number of points in each direction.
        tolerance: largest residual, of a period in units of the size of the state, and of `g`.
        max_iterations: of Newton's method at a point; where it does not converge, the step is halved.
        locate: whether to look for points of codimension two; each takes about ten orbits.
        progress: whether to show a progress bar; by default on a terminal.

    Returns:
        A `BifurcationCurve`, whose `reasons` say why it ends. A Neimark-Sacker curve ends at 1:1 and 1:2
        resonances, where its multipliers become real. Derivatives by a third parameter are those of
        `BifurcationCurve.derivative`.

    Raises:
        ValueError: if an argument is out of its range, the paths are not two, a range has no scene of the
            same layout at its ends, a parameter has several values or breaks the symmetry of an orbit
            without unbalance, or `point` is of another kind.
        RuntimeError: if the corrector does not converge at the point itself.

    Source: Govaerts (2000), Numerical Methods for Bifurcations of Dynamical Equilibria, chapter 4.
    """
    check_counts(max_points=max_points, max_iterations=max_iterations)
    check_travel(direction, step, max_step)
    _check(branch, point, paths, bounds)
    ranges = dict(zip(paths, bounds, strict=True))
    solver: Any = branch.curve.plan.solver
    problem, first = problem_of(branch.orbit(point), ranges, solver, "bounds")
    condition = condition_of(point.kind, point.contact)
    corrector = CurveCorrector(problem, condition, tolerance, max_iterations)
    start = _first_point(corrector, first)
    exact = corrector._replace(polish=True)

    def search(last: PointOfCurve, after: PointOfCurve) -> Found:
        found, lost = points_between(exact, point.kind, last, after) if locate else ([], [])
        for number, one in enumerate(found):
            if point.kind == "neimark-sacker" and one.kind in ENDS:
                reason = f"{one.kind} at {problem.at(one.point.u)}"
                return Found(found[: number + 1], lost, one.point, reason)
        return Found(found, lost)

    names = "curve", "point"
    predictor = Predictor(corrector, max_step, parameters=2)
    tracer = Tracer(problem, predictor, step, max_points, search, names)
    with bar(progress, tracer.longest(direction), f"continuing a {point.kind}", "points") as tick:
        return curve_of(problem, condition, *tracer.both(start, direction, tick))


class CurveCorrector(NamedTuple):
    """Newton's method for `residual(u) = 0, g(u) = 0`, with the derivatives of every trial."""

    problem: ContinuationProblem
    condition: AbstractCondition
    tolerance: float
    max_iterations: int
    polish: bool = False  # whether a point found is evaluated once more, with its own null vectors

    def point(
        self, guess: Unknowns, normal: Unknowns, anchor: Anchor, forward: Unknowns
    ) -> PointOfCurve:
        """The point of the curve in the plane through a guess; its tangent points along `forward`."""
        last = anchor

        def evaluate(u: Unknowns) -> Trial:
            nonlocal last
            try:
                trial = self.condition.trial(self.problem, u, last)
            except np.linalg.LinAlgError:
                raise StepError("the equations of the bifurcation became singular") from None
            last = trial.anchor._replace(phase=anchor.phase)
            return trial

        u, trial, count = newton(evaluate, guess, normal, self.tolerance, self.max_iterations)
        if self.polish:
            trial = evaluate(u)
        return PointOfCurve(u, tangent(trial.jacobian_at_own_phase, forward), trial, count)


def _first_point(corrector: CurveCorrector, first: Unknowns) -> PointOfCurve:
    """The point of the curve at the bifurcation that was given."""
    problem, condition = corrector.problem, corrector.condition
    try:
        anchor = condition.anchor(condition.evaluation(problem, first), first)
        trial = condition.trial(problem, first, anchor)
        normal = tangent(
            trial.jacobian_at_own_phase, np.append(np.zeros(first.size - 2), [1.0, 0.0])
        )
        return corrector.point(first, normal, anchor, normal)
    except (StepError, np.linalg.LinAlgError) as error:
        raise RuntimeError(
            f"The {condition.kind} cannot be continued in {_named(problem)}: {error}; locate it by "
            "`continue_` with a smaller `tolerance`."
        ) from None


def _named(problem: ContinuationProblem) -> str:
    return " and ".join(f"`{one.path}`" for one in problem.parameters)


def _check(branch: Any, point: Any, paths: Any, bounds: Any) -> None:
    if not isinstance(branch, Branch):
        raise ValueError(
            f"`branch` must be a result of `jaxrotor.continue_`, but is a {type(branch).__name__}."
        )
    kind = point.kind if isinstance(point, BranchPoint) else type(point).__name__
    if kind not in CONTINUED:
        raise ValueError(
            f"`point` must be a fold, flip, neimark-sacker or grazing of `branch.points`, but is a {kind}."
        )
    if isinstance(paths, str) or len(paths) != 2 or paths[0] == paths[1]:
        raise ValueError(f"`paths` must be two different parameters, but is {paths!r}.")
    if len(bounds) != 2:
        raise ValueError(
            f"`bounds` must be a range (low, high) for each of the two parameters, but is {bounds!r}."
        )
