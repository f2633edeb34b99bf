"""Continuation: a branch of orbits, followed around its folds by pseudo-arclength.

    residual(u) = 0,   t . (u - u_k - h t) = 0,   u = (x, s)

`t` is the tangent in the last point `u_k`, `s` the place of the parameter in its range.
"""

from collections.abc import Callable, Sequence

import numpy as np

from ..core.checks import check_counts
from ..core.progress import progress as bar
from ..solvers.exponential import Exponential
from .bifurcations import bifurcations, branch_met
from .branch import Branch, branch_of
from .corrector import Corrector, Point, StepError
from .orbit import PeriodicOrbit
from .predictor import Predictor
from .problem import PhaseCondition, problem_of
from .torus import Torus
from .torus_branch import TorusBranch, branch_of_tori
from .tracer import Found, Tracer, check_travel


MET = {  # why a branch ends at another one
    "flip": "it meets the branch of orbits of half the period, at their flip at",
    "branching": "it meets a branch of orbits of more symmetry, at their branching at",
}


def continue_(
    orbit: PeriodicOrbit | Torus,
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
) -> Branch | TorusBranch:
    """The orbits near an orbit as one parameter of its scene changes, through folds, stable or not.

        residual(x, p) = 0   by pseudo-arclength

    On the way folds, flips (period doublings), Neimark-Sacker points, crossings of branches and grazing
    of contacts are detected and located. Where contact begins a branch has a kink, which it passes in
    small steps. See `switch` for the branches that begin at flips and crossings.

    Args:
        orbit: result of `periodic`; its steps are kept, and its turn if the scene has no unbalance. Of a
            result of `torus` the harmonics are kept, and folds are located; it takes no `solver`.
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
        A `Branch`, or `TorusBranch`, whose `reasons` say why it ends. It is not differentiable; its
        orbits, computed again by `periodic` or `torus`, are.

    Raises:
        ValueError: if an argument is out of its range, the rotor does not rotate, the range has no scene
            of the same layout at its ends, the parameter has several values, or it breaks the symmetry of
            an orbit without unbalance.
        RuntimeError: if the corrector does not converge at the orbit itself.

    Source: Allgower, Georg (2003), Introduction to Numerical Continuation Methods, chapters 2, 6.
    """
    check_counts(max_points=max_points, max_iterations=max_iterations)
    check_travel(direction, step, max_step)
    if isinstance(orbit, Torus):
        if solver is not None:
            raise ValueError(
                f"A torus has harmonics and takes no steps, so it has no `solver`, but it is {solver!r}."
            )
        travel = direction, step, max_step, max_points
        return branch_of_tori(orbit, path, between, travel, tolerance, max_iterations, progress)
    problem, first = problem_of(orbit, {path: between}, solver)
    corrector = Corrector(problem, tolerance, max_iterations)
    start = _first_point(corrector, first, path)

    search = search_along(corrector, locate)
    tracer = Tracer(problem, Predictor(corrector, max_step), step, max_points, search)
    with bar(progress, tracer.longest(direction), f"continuing in {path}", "points") as tick:
        return branch_of(corrector, *tracer.both(start, direction, tick))


def search_along(corrector: Corrector, locate: bool) -> Callable[[Point, Point], Found]:
    """Search for bifurcations between two points, if it is wanted, and for the end of a branch there."""
    problem = corrector.problem

    def search(last: Point, point: Point) -> Found:
        found, lost = bifurcations(corrector, last, point) if locate else ([], [])
        for number, one in enumerate(found):
            met = branch_met(problem, one)
            if met is not None:
                others = [other for other in found[:number] if other.kind != "branching"]
                left = [kind for kind in lost if kind != "branching"]
                return Found(others, left, one.point, f"{MET[met]} {problem.at(one.point.u)}")
        return Found(found, lost)

    return search


def _first_point(corrector: Corrector, first: np.ndarray, path: str) -> Point:
    """The point of the orbit itself."""
    direction = corrector.evaluate(first, corrector.problem.any_phase(first)).direction
    normal = np.append(np.zeros(first.size - 1), 1.0)
    try:
        return corrector.point(
            first, normal, PhaseCondition(first[: direction.size], direction), normal
        )
    except StepError as error:
        raise RuntimeError(
            f"The orbit cannot be continued in `{path}`: {error}; compute it by `periodic` with the steps "
            "and the `solver` that it is to be continued with."
        ) from None
