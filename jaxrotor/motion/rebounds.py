"""Rebounds: whether the stops that a motion has touched are resolved by its steps."""

import contextlib
import math
from collections.abc import Callable, Iterator
from contextvars import ContextVar
from typing import Any, NamedTuple

import numpy as np

from ..core.caller import FewStepsWarning, warn
from ..core.outcome import FEWEST, gains_energy, more_needed, rebound_steps
from ..core.quantities import known
from ..effects.base import AbstractContact
from ..scene import Scene
from ..solvers.exponential import Exponential


_IS_PILOT: ContextVar[bool] = ContextVar("_IS_PILOT", default=False)
Cure = Callable[[float], str]  # what to take where some times as many steps are needed


@contextlib.contextmanager
def pilot_run() -> Iterator[None]:
    """No warnings of few steps by motions that only lead to a result, or whose error is measured."""
    token = _IS_PILOT.set(True)
    try:
        yield
    finally:
        _IS_PILOT.reset(token)


def is_pilot_run() -> bool:
    """Whether a motion is one of `pilot_run`."""
    return _IS_PILOT.get()


class Rebounds(NamedTuple):
    """Stops of a scene, whether any was touched, and how long the steps are for each."""

    scene: Scene
    members: tuple[int, ...]  # number of the contact of each ratio, see `System.members`
    touched: Any  # whether any contact was
    ratio: Any  # (k, 2), see `Tableau.contact_stiffness_ratio`
    force: Any = None  # (T, contacts) at the samples [N]; None: not known

    def too_long(self, solver: Exponential) -> bool:
        """Whether a stop was touched whose rebounds gain energy."""
        ratio = self._ratio(bounced=False)
        return ratio is not None and gains_energy(self.touched, ratio, solver.order)

    def check(self, solver: Exponential, cure: Cure, *, measured: bool = False) -> None:
        """Raise if a touched stop is too stiff for the steps; warn if its rebounds take few of them.

        Nothing is checked while values are traced. There is no warning where the error was `measured`.
        """
        every = self._ratio(bounced=False)
        if every is not None and gains_energy(self.touched, every, solver.order):
            more = more_needed(every, solver.order)
            stiffest = int(np.argmax([more_needed(one[None], solver.order) for one in every]))
            member = [self.scene.of(AbstractContact)[i] for i in self.members[stiffest:][:1]]
            if member and member[0].hinged:
                raise RuntimeError(
                    f"The hinge of `{self.scene.name_of(member[0])}` moves modes of the shaft that are "
                    f"too fast for the steps: take {cure(more)}, fewer `shaft.nodes`, such as 3, or an "
                    "implicit solver where there is one."
                )
            raise RuntimeError(
                "A stop was touched that is too stiff for the steps, so that a rebound would gain energy: "
                f"take {cure(more)}, or a softer stop."
            )
        ratio = self._ratio(bounced=True)
        if measured or is_pilot_run() or ratio is None or not ratio.size:
            return
        steps = rebound_steps(ratio)
        if self.touched and steps.min() < FEWEST[solver.order, solver.located]:
            stop = self.scene.of(AbstractContact)[self.members[int(np.argmin(steps))]]
            told = few_steps(f"`{self.scene.name_of(stop)}`", float(steps.min()), solver, cure)
            warn(told, FewStepsWarning)

    def _ratio(self, *, bounced: bool) -> np.ndarray | None:
        """Ratios of what was touched, other rows zero; None where they are traced.

        With `bounced` these are stops alone that were not under load all the time. All count where no
        sample has a stop under load: it was touched between samples, or before those that are kept.
        """
        if not (known(self.touched) and known(self.ratio) and known(self.force)):
            return None
        loads = None
        if self.force is not None:
            loaded = np.asarray(self.force) != 0
            loads = loaded.any(axis=0), loaded.all(axis=0)
        return counted(self.scene, self.members, np.asarray(self.ratio), loads, bounced=bounced)


def counted(
    scene: Scene,
    members: tuple[int, ...],
    ratio: np.ndarray,
    loads: tuple[np.ndarray, np.ndarray] | None,
    *,
    bounced: bool,
) -> np.ndarray:
    """Ratios (.., k, 2) of what was touched, other rows zero, see `Rebounds`.

    `loads` say whether each contact of the scene was under load ever, and always, (.., contacts).
    """
    contacts = scene.of(AbstractContact)
    stops = np.array([contacts[i].rebounds for i in members], bool)
    counts = np.broadcast_to(stops | (not bounced), (*ratio.shape[:-2], len(members)))
    if loads is not None and members:
        ever, always = (np.asarray(load)[..., members] for load in loads)
        seen = (ever & stops).any(axis=-1, keepdims=True)
        counts = counts & (~seen | (ever & ~(always & bounced)))
    others = np.full((*ratio.shape[:-2], ratio.shape[-2] - len(members)), not bounced)
    return np.where(np.concatenate([counts, others], axis=-1)[..., None], ratio, 0.0)


def in_revolutions(steps: int) -> Cure:
    """The cure of steps that are so many a revolution."""
    return lambda more: (
        f"at least {math.ceil(more * steps)} `steps_per_revolution` instead of {steps}"
    )


def few_steps(stop: str, steps: float, solver: Exponential, cure: Cure) -> str:
    """The sentence on a stop with few steps a rebound, and what cures it."""
    fewest = FEWEST[solver.order, solver.located]
    more, located = fewest / steps, FEWEST[4, True] / steps
    step = "step" if f"{steps:.2g}" == "1" else "steps"
    other = ""
    if not solver.located:
        counted = f" with {cure(located)}" if located > 1 else ""
        other = f", or located steps, `solver=Exponential(4, located=True)`,{counted}"
    return (
        f"{stop} was touched with {steps:.2g} {step} a rebound, where {fewest} leave an error of about "
        f"1 %: take {cure(more)}{other.rstrip(',')}."
    )
