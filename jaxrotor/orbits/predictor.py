"""Predictor: pseudo-arclength steps along the tangent, with control of their length.

    guess = u_k + h t,   corrected in the plane  t . (u - guess) = 0

`t` is the unit tangent in the last point `u_k`, `h` the length of the step.

Source: Allgower, Georg (2003), Introduction to Numerical Continuation Methods, chapters 2, 6.
"""

from typing import Any, NamedTuple

import numpy as np

from .corrector import StepError


LEAST = 1e-7  # shortest step, of a state or of the range
SHARP = 0.9  # cosine of the angle between tangents of neighbours on a smooth curve, at least
ASIDE = 0.3  # of a step: the most that the corrector may add to it
KINK = 1e-3  # steps shorter than this may turn the tangent by more, as where a contact begins
FAR = 10  # of such a step: a point further away is not the other side of a kink
EASY, HARD = 2, 5  # iterations of the corrector after which steps grow, or shrink


class Predictor(NamedTuple):
    """Steps `u_k + h t` that are corrected, checked, and halved until they succeed.

    Points are those of its corrector: a `Point` of a branch, or one of a curve of bifurcations.
    """

    corrector: Any  # with a method `point`, as `Corrector` has it
    max_step: float
    parameters: int = 1  # the last unknowns, each from 0 to 1

    def next(self, last: Any, h: float) -> tuple[Any, float, bool]:
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

    def _corrected(self, last: Any, guess: np.ndarray) -> tuple[Any, bool]:
        """The point near a guess, or the end of a range before it."""
        if self._within(guess):
            normal = last.tangent
            point = self.corrector.point(guess, normal, last.anchor, normal)
            if self._within(point.u):
                return point, False
            guess = point.u
        return self._end(last, guess), True

    def _within(self, u: np.ndarray) -> bool:
        places = u[-self.parameters :]
        return bool(np.all((places >= 0) & (places <= 1)))

    def _end(self, last: Any, guess: np.ndarray) -> Any:
        """The point at the end of the range that is reached first, before a guess beyond it."""
        places, ahead = guess[-self.parameters :], (guess - last.u)[-self.parameters :]
        bounds = np.clip(places, 0.0, 1.0)
        left = bounds - last.u[-self.parameters :]
        fractions = np.where(
            bounds == places,
            np.inf,
            np.divide(left, ahead, out=np.ones_like(left), where=ahead != 0),
        )
        first = int(np.argmin(fractions))
        normal = np.zeros(guess.size)
        number = guess.size - self.parameters + first
        normal[number] = 1.0
        at = last.u + fractions[first] * (guess - last.u)
        at[number] = bounds[first]
        point = self.corrector.point(at, normal, last.anchor, last.tangent)
        point.u[number] = bounds[first]  # to rounding
        if not self._within(point.u):
            raise StepError("another parameter leaves its range before")
        return point


def _scale(point: Any) -> float:
    """Scale for the length of a step: norm of the state, at least 1."""
    return max(1.0, float(np.linalg.norm(point.u[: point.evaluation.direction.size])))


def _check_neighbours(last: Any, point: Any, guess: np.ndarray, h: float, ended: bool) -> None:
    """Raise where the point may be on another branch; short steps may pass a kink."""
    short = h < KINK
    if not short and last.tangent @ point.tangent < SHARP:
        raise StepError("the branch turns too sharply")
    far = np.linalg.norm(point.u - last.u) > (FAR if short else 2) * h
    aside = not ended and not short and np.linalg.norm(point.u - guess) > ASIDE * h
    if far or aside:
        raise StepError("the corrector leads elsewhere")
