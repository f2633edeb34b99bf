"""Whiteness: whether residuals scatter from sample to sample as noise does."""

import numpy as np


def correlations(
    left: np.ndarray, slopes: np.ndarray, shapes: list[tuple[int, ...]]
) -> tuple[np.ndarray, np.ndarray]:
    """`r^T A r / r^T r` of successive residuals in every record, and its distance from white noise.

    With `Q` of `J = Q R` the residuals are `(1 - Q Q^T)` times the noise, and mean and variance are those
    of Durbin, Watson (1950), Biometrika 37, section 3, for this `A`: halves beside the diagonal.
    """
    basis, freedom = np.linalg.qr(slopes)[0], left.size - slopes.shape[1]
    found, distances, first = [], [], 0
    for times, channels in shapes:
        rows = slice(first, first + times * channels)
        first = rows.stop
        own, part = (_beside(one[rows], channels) for one in (left, basis))
        inner = basis[rows].T @ part
        mean = -np.trace(inner)
        squares = (times - 1) * channels / 2 - 2 * np.sum(part**2) + np.sum(inner * inner.T)
        total = np.sum(left**2)
        along = left[rows] @ own
        ratio = along / total if total else 0.0
        variance = 2 * (squares - mean**2 / freedom) / (freedom * (freedom + 2))
        off = ratio - mean / freedom
        power = np.sum(left[rows] ** 2)
        found.append(along / power if power else 0.0)
        distances.append(off / np.sqrt(variance) if variance > 1e-9 / freedom**2 else 0.0)
    return np.array(found), np.array(distances)


def _beside(rows: np.ndarray, channels: int) -> np.ndarray:
    """Half the sum of the neighbours of every number in time, (T c,) or (T c, k)."""
    table = rows.reshape(-1, channels, *rows.shape[1:])
    out = np.zeros_like(table)
    out[1:] += table[:-1] / 2
    out[:-1] += table[1:] / 2
    return out.reshape(rows.shape)
