"""Pilot runs: a setting is refined until two successive results agree."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np


class Pilot(NamedTuple):
    """A setting chosen by a pilot run, with the change of the result from the setting before it."""

    what: str
    setting: int
    difference: float  # relative, of the last two results, or from the exact one
    tolerance: float  # requested largest difference
    converged: bool  # False: no two results agreed, and accuracy is unknown
    measure: str = "change"  # that of `difference`

    def __str__(self) -> str:
        if self.converged:
            return f"{self.setting} {self.what} ({self.measure} {self.difference:.1e})"
        reason = f"{self.measure} {self.difference:.1e} above the tolerance {self.tolerance:g}"
        return f"{self.setting} {self.what} (not converged: {reason})"


def refined(
    what: str,
    answer: Callable[[int], np.ndarray | None],
    settings: Sequence[int],
    tolerance: float | int,
) -> Pilot:
    """First setting whose result agrees with that of the setting before it, else the last setting.

    Args:
        what: name of the setting, in the plural.
        answer: function from a setting to an array of fixed shape, or None if it cannot be computed.
        settings: ascending settings to try.
        tolerance: largest difference of two results, relative to the largest entry of the finer one.

    Returns:
        The setting, with the difference found and whether the results agreed.

    Raises:
        ValueError: If `tolerance` is not positive.
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
