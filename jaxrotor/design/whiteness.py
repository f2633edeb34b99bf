"""Whiteness: whether residuals scatter from sample to sample as noise does."""

import numpy as np


ROUNDED = (
    1e-2  # mean square of residuals over that of the noise, below which they are rounding errors
)
NONE = 1e-9  # variance of a correlation over that of as many samples, below which there is none


def correlations(
    left: np.ndarray, slopes: np.ndarray, shapes: list[tuple[int, ...]]
) -> tuple[np.ndarray, np.ndarray]:
    """`r^T A r / r^T r` of successive residuals in every record, and its distance from white noise.

    With `Q` of `J = Q R` the residuals are `(1 - Q Q^T)` times the noise, and mean and variance of the
    ratio are those of Durbin, Watson (1950), Biometrika 37, 409, for this `A`: halves beside the
    diagonal. Both are zero where a record is met to rounding.

    Args:
        left: residuals `r` of all records in units of their noise, (m,).
        slopes: their derivatives `J` by the parameters, (m, n).
        shapes: samples and channels of every record.

    Returns:
        The correlation of every record, and its distance from the mean in standard deviations.
    """
    basis, total = np.linalg.qr(slopes)[0], np.sum(left**2)
    freedom = left.size - slopes.shape[1]
    found, first = [], 0
    for times, channels in shapes:
        rows = slice(first, first + times * channels)
        first = rows.stop
        power = np.sum(left[rows] ** 2)
        own, part = (_beside(one[rows], channels) for one in (left, basis))
        inner = basis[rows].T @ part
        mean = -np.trace(inner) / freedom
        squares = (times - 1) * channels / 2 - 2 * np.sum(part**2) + np.sum(inner * inner.T)
        variance = 2 * (squares - freedom * mean**2) / (freedom * (freedom + 2))
        if power < ROUNDED * times * channels or variance < NONE / freedom:
            found.append((0.0, 0.0))
            continue
        along = left[rows] @ own
        found.append((along / power, (along / total - mean) / np.sqrt(variance)))
    correlated, strange = np.array(found).T
    return correlated, strange


def _beside(rows: np.ndarray, channels: int) -> np.ndarray:
    """Half the sum of the neighbours of every number in time, (T c,) or (T c, k)."""
    table = rows.reshape(-1, channels, *rows.shape[1:])
    out = np.zeros_like(table)
    out[1:] += table[:-1] / 2
    out[:-1] += table[1:] / 2
    return out.reshape(rows.shape)
