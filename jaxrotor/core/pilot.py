"""Pilot: a short run whose settings are refined until two successive answers agree."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np


class Pilot(NamedTuple):
    """A setting found by a pilot, and how far its answer was from that of the one before."""

    what: str
    setting: int
    difference: float  # relative, of the last two answers
    tolerance: float  # asked for
    converged: bool  # False: no two answers agreed, and nothing is promised

    def __str__(self) -> str:
        if self.converged:
            return f"{self.setting} {self.what} (change {self.difference:.1e})"
        missed = f"change {self.difference:.1e} above the tolerance {self.tolerance:g}"
        return f"{self.setting} {self.what} (not converged: {missed})"


def refined(
    what: str,
    answer: Callable[[int], np.ndarray | None],
    settings: Sequence[int],
    tolerance: float | int,
) -> Pilot:
    """The first of rising settings whose answer agrees with that of the one before, else the last.

    Args:
        what: name of the setting.
        answer: array for a setting, all of one shape, or None where it cannot be computed.
        settings: rising.
        tolerance: largest difference of two answers over the largest entry of the finer.
    """
    if not tolerance > 0:
        raise ValueError(f"`tolerance` must be positive, but is {tolerance!r}.")
    coarse, difference = None, np.inf
    for setting in settings:
        fine = answer(setting)
        if fine is not None and coarse is not None:
            scale = np.max(np.abs(fine), initial=0.0)
            difference = float(np.max(np.abs(fine - coarse), initial=0.0) / (scale or 1.0))
            if difference <= tolerance:
                return Pilot(what, setting, difference, float(tolerance), True)
        coarse = fine
    return Pilot(what, settings[-1], difference, float(tolerance), False)
