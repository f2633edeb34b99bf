"""Predictor: pseudo-arclength steps along the tangent, with control of their length.

    guess = u_k + h t,   corrected in the plane  t . (u - guess) = 0

`t` is the unit tangent in the last point `u_k`, `h` the length of the step.

Source: Allgower, Georg (2003), Introduction to Numerical Continuation Methods, chapters 2, 6.
"""

from typing import NamedTuple

import numpy as np

from .corrector import Corrector, Point, StepError


LEAST = 1e-7  # shortest step, of a state or of the range
SHARP = 0.9  # cosine of the angle between tangents of neighbours on a smooth curve, at least
ASIDE = 0.3  # of a step: the most that the corrector may add to it
KINK = 1e-3  # steps shorter than this may turn the tangent by more, as where a contact begins
FAR = 10  # of such a step: a point further away is not the other side of a kink
EASY, HARD = 2, 5  # iterations of the corrector after which steps grow, or shrink


class Predictor(NamedTuple):
    """Steps `u_k + h t` that are corrected, checked, and halved until they succeed."""

    corrector: Corrector
    max_step: float

    def next(self, last: Point, h: float) -> tuple[Point, float, bool]:
        """The next point, the length of the step to try after it, and whether it ends the range."""
        while True:
            guess = last.u + h * last.tangent
            try:
                point, ended = self._corrected(last, guess)
                _check_neighbours(last, point, guess, h, ended)
            except StepError:
                h /= 2
                if h < LEAST:
                    raise
                continue
            h *= 1.5 if point.iterations <= EASY else 0.5 if point.iterations >= HARD else 1.0
            return point, min(h, self.max_step * _scale(point)), ended

    def _corrected(self, last: Point, guess: np.ndarray) -> tuple[Point, bool]:
        """The point near a guess, or the end of the range before it."""
        if 0 <= guess[-1] <= 1:
            normal = last.tangent
            point = self.corrector.point(guess, normal, last.phase_condition, normal)
            if 0 <= point.u[-1] <= 1:
                return point, False
            guess = point.u
        return self._end(last, guess), True

    def _end(self, last: Point, guess: np.ndarray) -> Point:
        """The point at the end of the range, before a guess beyond it."""
        bound = 1.0 if guess[-1] > 1 else 0.0
        ahead = guess[-1] - last.u[-1]
        fraction = (bound - last.u[-1]) / ahead if ahead else 1.0
        normal = np.append(np.zeros(guess.size - 1), 1.0)
        at = last.u + fraction * (guess - last.u)
        at[-1] = bound
        return self.corrector.point(at, normal, last.phase_condition, last.tangent)


def _scale(point: Point) -> float:
    """Scale for the length of a step: norm of the state, at least 1."""
    return max(1.0, float(np.linalg.norm(point.u[: point.evaluation.direction.size])))


def _check_neighbours(last: Point, point: Point, guess: np.ndarray, h: float, ended: bool) -> None:
    """Raise where the point may be on another branch; short steps may pass a kink."""
    short = h < KINK
    if not short and last.tangent @ point.tangent < SHARP:
        raise StepError("the branch turns too sharply")
    far = np.linalg.norm(point.u - last.u) > (FAR if short else 2) * h
    aside = not ended and not short and np.linalg.norm(point.u - guess) > ASIDE * h
    if far or aside:
        raise StepError("the corrector leads elsewhere")
