"""Switching: the branch that begins at a flip, or where an orbit loses its symmetry.

    guess = u* + h v,   J v = 0,   v . t = 0,   v . (u - guess) = 0

At the bifurcation `u*` the Jacobian `J` has two null vectors, as that of twice the period has at a flip:
the tangent `t` of the old branch and `v`, the eigenvector of the multiplier -1, or 1. The plane across
`v` misses the old branch near `u*`.

Source: Kuznetsov (2004), Elements of Applied Bifurcation Theory, section 10.2.3; Allgower, Georg (2003),
Introduction to Numerical Continuation Methods, chapter 8.
"""

import dataclasses
import math

import numpy as np

from ..core.checks import check_counts
from ..core.progress import progress as bar
from .bifurcations import CROSSED, bifurcations
from .branch import Branch, BranchPoint, branch_of, check_point
from .continuation import search_along
from .corrector import Corrector, Point, StepError, Unknowns, jacobian_at_own_phase, tangent
from .predictor import ASIDE, LEAST, Predictor
from .problem import ContinuationProblem, PhaseCondition
from .tracer import Tracer, check_travel


SWITCHED = {"flip": "twice the period", "branching": "less symmetry"}


def switch(
    branch: Branch,
    point: BranchPoint,
    *,
    opposite: bool = False,
    step: float = 0.01,
    max_step: float = 0.05,
    max_points: int = 400,
    locate: bool = True,
    progress: bool | None = None,
) -> Branch:
    """The branch that begins at a bifurcation of another one, followed like that in the same parameter.

        x = x* + h v,   M v = -v at a flip,   M v = v where the orbit loses its symmetry

    At a flip it has orbits of twice the period, at a branching those without the symmetry, or of the
    branch that crosses. It may be switched again, and a loop over flips follows a cascade.

    Args:
        branch: result of `continue_` or `switch`; its range, steps, solver and tolerance are kept.
        point: one of its flips or branchings, as `branch.of("flip")[0]`.
        opposite: whether to leave by `-v`. Where symmetry is lost, these orbits are the mirror images of
            the others; at a flip they are the same, begun a period later.
        step: distance of the first orbit along `v`, in units of the size of the state, and length of the
            first step from there. It is halved until an orbit is found that is not of the old branch.
        max_step: greatest length of a step, which is the distance of neighbours.
        max_points: greatest number of points after the bifurcation.
        locate: whether to look for bifurcations; each takes about ten orbits.
        progress: whether to show a progress bar; by default on a terminal.

    Returns:
        A `Branch` whose first orbit is that of the bifurcation, at a flip run through twice. It ends
        where it meets the old branch again.

    Raises:
        ValueError: if an argument is out of its range, `point` is of another kind, where no other branch
            of orbits begins, or it is not of this branch.
        RuntimeError: if no orbit of the other branch is found near the point.
    """
    check_counts(max_points=max_points)
    check_travel("up", step, max_step)
    check_point(branch, point, tuple(SWITCHED), "where other orbits begin")
    corrector, start = _start(branch, point, opposite)
    first, distance = _first(corrector, start, step, branch, point)
    search = search_along(corrector, locate)
    predictor = Predictor(corrector, max_step)
    tracer = Tracer(corrector.problem, predictor, distance, max_points, search)
    with bar(progress, max_points, f"continuing in {branch.path}", "points") as tick:
        half = tracer.half_branch(first, int(np.sign(first.tangent[-1]) or 1), tick)
    # At the bifurcation itself the tests of folds and crossings are zero.
    near, lost = bifurcations(corrector, start, first) if locate else ([], [])
    found = [(0, one) for one in near if one.kind not in CROSSED]
    found += [(after + 1, one) for after, one in half.found]
    left = [(0, kind) for kind in lost if kind not in CROSSED]
    left += [(after + 1, kind) for after, kind in half.lost]
    begins = f"the {point.kind} at {branch.path} = {point.value:.9g}, where orbits of "
    reasons = f"{begins}{SWITCHED[point.kind]} begin", half.reason
    return branch_of(corrector, [start, *half.points], found, left, reasons)


def _start(branch: Branch, point: BranchPoint, opposite: bool) -> tuple[Corrector, Point]:
    """The problem of the other branch, and its orbit at the bifurcation, whose tangent is `v`."""
    problem, u = branch.curve, point.unknowns
    if point.kind == "flip":
        problem = _with_twice_the_period(problem)
    corrector = Corrector(problem, branch.tolerance, branch.max_iterations)
    evaluation = corrector.evaluate(u, problem.any_phase(u))
    plane = np.linalg.svd(jacobian_at_own_phase(evaluation))[2][-2:]
    old = plane @ _slope(branch, point)
    across = np.array([-old[1], old[0]]) @ plane / np.linalg.norm(old)
    # The same sign whatever the signs of singular vectors: the largest number is positive.
    sign = np.sign(across[np.argmax(np.abs(across))]) * (-1 if opposite else 1)
    return corrector, Point(u, sign * across, evaluation, 0)


def _slope(branch: Branch, point: BranchPoint) -> Unknowns:
    """The direction of a branch at one of its bifurcations."""
    after = int(point.place)
    before, ahead = point.unknowns - branch.unknowns[after], branch.unknowns[after + 1 :][:1]
    ahead = ahead[0] - point.unknowns if len(ahead) else before
    if point.kind == "flip":
        return tangent(jacobian_at_own_phase(branch.look(point)), before)
    # Where branches cross the Jacobian does not tell them apart: by the parabola through the neighbours.
    lengths = np.linalg.norm(before), np.linalg.norm(ahead)
    if min(lengths) < LEAST:
        return before if lengths[0] > lengths[1] else ahead
    return before * lengths[1] / lengths[0] + ahead * lengths[0] / lengths[1]


def _first(
    corrector: Corrector, start: Point, step: float, branch: Branch, point: BranchPoint
) -> tuple[Point, float]:
    """The first orbit beside the old branch, and its distance along `v`.

    It is taken where that at twice the distance confirms it, both being on a smooth curve through the
    bifurcation, and where it is not an orbit of the old branch.
    """
    m, h, further = start.evaluation.direction.size, step, None
    condition = PhaseCondition(start.u[:m], start.evaluation.direction)
    while h > LEAST:
        try:
            guess = start.u + h * start.tangent
            found = corrector.point(guess, start.tangent, condition, start.tangent)
            fits = _fits(start.u, found.u, further, h)
            if fits and (point.kind != "flip" or _is_new(branch, found.u, h)):
                return found, h
            further = found.u
        except StepError:
            further = None
        h /= 2
    raise RuntimeError(
        f"No orbit of {SWITCHED[point.kind]} was found beside the {point.kind} at "
        f"{corrector.problem.at(point.unknowns)}, at distances from {step:g} down to {LEAST:g} of the "
        "state; continue the branch with more steps a revolution, or a smaller `tolerance`."
    )


def _fits(start: Unknowns, found: Unknowns, further: Unknowns | None, h: float) -> bool:
    """Whether an orbit at a distance `h`, in the range, is about halfway to that at twice the distance."""
    if further is None or not 0 <= found[-1] <= 1:
        return False
    return bool(np.linalg.norm(found - (start + further) / 2) < ASIDE * h)


def _is_new(branch: Branch, u: Unknowns, h: float) -> bool:
    """Whether an orbit of twice the period is none of the old one, which would miss it by `-2 h v`."""
    evaluation = branch.corrector.evaluate(u, branch.curve.any_phase(u))
    return bool(np.linalg.norm(evaluation.residual) > h)


def _with_twice_the_period(problem: ContinuationProblem) -> ContinuationProblem:
    steps = 2 * problem.plan.steps
    plan = dataclasses.replace(problem.plan, steps=steps, max_steps=steps)
    if problem.revolutions is not None:
        plan = plan if problem.beats else problem.plan  # which is of one revolution
        return dataclasses.replace(problem, plan=plan, revolutions=2 * problem.revolutions)
    images = 1 if problem.images == 1 else problem.images // math.gcd(problem.images, 2)
    turn = 2 * problem.turn
    return dataclasses.replace(problem, plan=plan, span=2 * problem.span, turn=turn, images=images)
