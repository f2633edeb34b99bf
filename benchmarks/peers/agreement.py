"""Errors of answers: against converged ones, and those of ROSS's meshes extrapolated to none."""

import numpy as np


CRITICAL = 6  # critical speeds that are compared, which is how many ROSS returns
OSCILLATES = 1.0  # frequency above which a root is compared: ROSS leaves real ones out [rad/s]


def wanted(question: str, answer: list | float) -> list[np.ndarray]:
    """The values of an answer that are compared: an array for every speed, or a single one."""
    values = np.asarray(answer, float)
    if question in ("Campbell diagram", "modes", "roots"):
        roots = values @ [1, 1j]
        return [_oscillating(one) for one in (roots if roots.ndim == 2 else [roots])]
    return [values[:CRITICAL] if question == "critical speeds" else np.atleast_1d(values)]


def matched(question: str, answer: list | float, converged: list | float) -> list[np.ndarray]:
    """The values of an answer in the order of the converged ones; of roots and speeds the nearest."""
    right = wanted(question, converged)
    values = np.asarray(answer, float)
    if question in ("response", "threshold", "growth rate"):
        return wanted(question, answer)
    if question != "critical speeds":
        values = values @ [1, 1j]
    rows = values if values.ndim == 2 else [values]
    return [
        row[np.argmin(np.abs(row[:, None] - exact), axis=0)]
        for row, exact in zip(rows, right, strict=True)
    ]


def error(question: str, found: list[np.ndarray], converged: list | float) -> float:
    """Largest relative error of values in the order of the converged ones.

    It is relative to each root or speed, and of a response to the largest radius at any speed.
    """
    pairs = zip(found, wanted(question, converged), strict=True)
    scale = (lambda exact: exact.max()) if question == "response" else np.abs
    return float(max(np.max(np.abs(one - exact) / scale(exact)) for one, exact in pairs))


def extrapolated(coarse: list[np.ndarray], fine: list[np.ndarray]) -> list[np.ndarray]:
    """Values for elements of no length, `(4 f - c) / 3` from a mesh and one of half its length.

    Errors fall with the square of the length of the elements.
    """
    return [(4 * f - c) / 3 for c, f in zip(coarse, fine, strict=True)]


def _oscillating(roots: np.ndarray) -> np.ndarray:
    return roots[roots.imag > OSCILLATES]
