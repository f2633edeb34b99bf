"""Shares: bounds of a probability by a count of independent trials."""

from typing import Any

import numpy as np
from scipy import stats


def share_of(count: Any, trials: Any, confidence: float) -> tuple[Any, Any, Any]:
    """`count / trials` and its exact bounds, broadcast; NaN without trials.

    Source: Clopper, Pearson (1934), Biometrika 26, 404-413.
    """
    tail = (1 - confidence) / 2
    low = np.where(count > 0, stats.beta.ppf(tail, count, trials - count + 1), 0.0)
    high = np.where(count < trials, stats.beta.ppf(1 - tail, count + 1, trials - count), 1.0)
    with np.errstate(invalid="ignore"):
        return count / trials, low, high


def check_confidence(confidence: float) -> None:
    """Raise unless a level of confidence is a probability between 0 and 1."""
    if not 0 < confidence < 1:
        raise ValueError(f"`confidence` must be between 0 and 1, but is {confidence}.")
