"""Searches over the speed of rotation, by SciPy, around a program that answers at one speed."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from scipy.optimize import brentq, minimize_scalar


def threshold(roots: Callable[[float], np.ndarray], within: Sequence[float]) -> np.ndarray:
    """Speed where the largest growth rate of the slowest roots crosses zero, and the whirl there."""

    def fastest(speed: float) -> complex:
        found = roots(speed)
        return complex(found[np.argmax(found.real)])

    speed: Any = brentq(lambda speed: fastest(speed).real, *within, xtol=1e-6)
    return np.array([speed, abs(fastest(speed).imag)])


def peak(radii: Callable[[float], np.ndarray], within: Sequence[float]) -> np.ndarray:
    """Speed and amplitude of the largest half axis, the sum of both `radii`, between two speeds."""
    half = lambda speed: -float(np.sum(radii(speed)))
    options: Any = {"xatol": 1e-5}
    found: Any = minimize_scalar(half, bounds=within, method="bounded", options=options)
    return np.array([found.x, -found.fun])
