"""Tracer: a branch, or a curve of bifurcations, followed point by point from one of its points."""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from .corrector import StepError
from .parameter_range import AbstractRanged
from .predictor import LEAST, SHARP, Predictor


END = 1e-12  # of the range: a point nearer to an end is at it
CLOSED = "the {0} closes: it is back at the {1} that was given"


class Found(NamedTuple):
    """Special points between two neighbours, those not located by their kinds, and where it ends."""

    found: Sequence[Any]  # each with its `fraction` of the way
    lost: Sequence[str]
    last: Any = None  # point at which the branch ends
    reason: str = ""


class HalfBranch(NamedTuple):
    """The points of a branch from an orbit in one direction, and its special points."""

    points: list[Any]
    found: list[tuple[int, Any]]  # after which point
    reason: str  # why it ends
    lost: list[tuple[int, str]]  # kinds that were detected but not located, after which point


class Tracer(NamedTuple):
    """Follows a branch point by point and looks for special points on the way."""

    problem: AbstractRanged
    predictor: Predictor
    step: float
    max_points: int
    search: Callable[[Any, Any], Found]  # between two neighbours
    names: tuple[str, str] = ("branch", "orbit")  # of what is followed, and of what it begins with

    def longest(self, direction: str) -> int:
        """Greatest number of points."""
        return self.max_points * len(_signs(direction))

    def both(
        self, start: Any, direction: str, tick: Any
    ) -> tuple[list[Any], list[tuple[int, Any]], list[tuple[int, str]], tuple[str, str]]:
        """Points in order, special points, those not located, and why it ends at either end."""
        halves = {}
        for sign in _signs(direction):
            halves[sign] = self.half_branch(start, sign, tick)
            if halves[sign].reason == CLOSED.format(*self.names):
                break
        alone = HalfBranch([start], [], f"the {self.names[1]} that was given", [])
        if direction == "down":
            down = halves[-1]
            return down.points, down.found, down.lost, (alone.reason, down.reason)
        return _joined(halves.get(-1, alone), halves.get(1, alone))

    def half_branch(self, start: Any, sign: int, tick: Any) -> HalfBranch:
        """The branch from a point, first with the first parameter up (`sign` 1) or down (-1)."""
        count = self.predictor.parameters
        way = np.sign(start.tangent[-count]) or 1.0
        start = start._replace(tangent=sign * way * start.tangent)
        half, h = HalfBranch([start], [], "", []), self.step
        while len(half.points) <= self.max_points:
            last = half.points[-1]
            if np.any(np.abs(last.u[-count:] - (last.tangent[-count:] > 0)) < END):
                return half._replace(reason=f"{self._end(last)} is the end of the range")
            try:
                point, h, ended = self.predictor.next(last, h)
            except StepError as error:
                at = self.problem.at(last.u)
                reason = f"no progress from {at}, by steps down to {LEAST:g}: {error}"
                return half._replace(reason=reason)
            after = len(half.points) - 1
            between = self.search(last, point)
            half.lost.extend((after, kind) for kind in between.lost)
            half.found.extend((after, one) for one in between.found)
            if between.last is not None:
                half.points.append(between.last)
                return half._replace(reason=between.reason)
            half.points.append(point)
            tick(1)
            if not ended and _closes(start, last, point):
                return half._replace(reason=CLOSED.format(*self.names))
        at = self.problem.at(half.points[-1].u)
        return half._replace(reason=f"`max_points` = {self.max_points} are taken, to {at}")

    def _end(self, point: Any) -> str:
        """The parameter at the end of its range, with its value."""
        count = self.predictor.parameters
        off = np.abs(point.u[-count:] - (point.tangent[-count:] > 0))
        return self.problem.at(point.u).split(", ")[int(np.argmin(off))]


def check_travel(direction: str, step: float, max_step: float) -> None:
    """Raise unless a direction is known and the lengths of steps are possible."""
    if direction not in ("both", "up", "down"):
        raise ValueError(f"`direction` must be 'both', 'up' or 'down', but is {direction!r}.")
    if not LEAST < step <= max_step:
        raise ValueError(
            f"`step` must be above {LEAST:g} and at most `max_step`, but they are {step!r} and "
            f"{max_step!r}."
        )


def _signs(direction: str) -> tuple[int, ...]:
    return {"both": (1, -1), "up": (1,), "down": (-1,)}[direction]


def _joined(
    down: HalfBranch, up: HalfBranch
) -> tuple[list[Any], list[tuple[int, Any]], list[tuple[int, str]], tuple[str, str]]:
    """One branch of the two halves that begin at the same point."""
    back = len(down.points) - 1
    turned = [
        (back - 1 - after, one._replace(fraction=1 - one.fraction)) for after, one in down.found
    ]
    found = turned[::-1] + [(back + after, one) for after, one in up.found]
    lost = [(back - 1 - after, kind) for after, kind in down.lost]
    lost = lost[::-1] + [(back + after, kind) for after, kind in up.lost]
    return down.points[:0:-1] + up.points, found, lost, (down.reason, up.reason)


def _closes(start: Any, last: Any, point: Any) -> bool:
    """Whether the start is between two neighbours."""
    chord = point.u - last.u
    length = np.linalg.norm(chord)
    fraction = (start.u - last.u) @ chord / length**2
    off = np.linalg.norm(start.u - last.u - fraction * chord)
    along = start.tangent @ chord > SHARP * length
    return bool(0 < fraction <= 1 and off < 0.1 * length and along)
