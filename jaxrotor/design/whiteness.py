"""Whiteness: whether residuals scatter from sample to sample and channel to channel as noise does."""

import numpy as np


# Mean square of residuals over that of the noise, below which they are rounding errors
ROUNDED = 1e-2
LEAST = 1e-9  # variance of a correlation over that of as many samples, below which there is none


def correlations(
    left: np.ndarray, slopes: np.ndarray, shapes: list[tuple[int, ...]]
) -> tuple[np.ndarray, np.ndarray]:
    """`r^T A r / r^T r` of residuals that are neighbours in time, and in channels, and their z-scores.

    With `Q` of `J = Q R` the residuals are `(1 - Q Q^T)` times the noise, and mean and variance of the
    ratio are those of Durbin, Watson (1950), Biometrika 37, 409, for this `A`: halves that couple a
    number with the next and the former sample, or with the other channels of its own. Both are zero where
    a record is met to rounding, or has one channel.

    Args:
        left: residuals `r` of all records in units of their noise, (m,).
        slopes: their derivatives `J` by the parameters, (m, n).
        shapes: samples and channels of every record.

    Returns:
        Correlations and z-scores, (records, 2) each: in time, then between channels, which are also the
        real and imaginary parts of complex numbers. Means are taken off the z-scores alone.
    """
    basis, total = np.linalg.qr(slopes)[0], np.sum(left**2)
    freedom = left.size - slopes.shape[1]
    found, first = [], 0
    for times, channels in shapes:
        rows = slice(first, first + times * channels)
        first = rows.stop
        power = np.sum(left[rows] ** 2)
        kinds = (
            (_in_time, (times - 1) * channels / 2),
            (
                _in_channels,
                times * channels * (channels - 1) / 4,
            ),
        )
        for coupled, squared in kinds:
            own, part = (coupled(one[rows], channels) for one in (left, basis))
            inner = basis[rows].T @ part
            mean = -np.trace(inner) / freedom
            squares = squared - 2 * np.sum(part**2) + np.sum(inner * inner.T)
            variance = 2 * (squares - freedom * mean**2) / (freedom * (freedom + 2))
            if power < ROUNDED * times * channels or variance < LEAST / freedom:
                found.append((0.0, 0.0))
                continue
            along = left[rows] @ own
            found.append((along / power, (along / total - mean) / np.sqrt(variance)))
    table = np.array(found).reshape(-1, 2, 2)
    return table[:, :, 0], table[:, :, 1]


def _in_time(rows: np.ndarray, channels: int) -> np.ndarray:
    """Half the sum of the neighbours of every number in time, (T c,) or (T c, k)."""
    table = rows.reshape(len(rows) // channels, channels, *rows.shape[1:])
    out = np.zeros_like(table)
    out[1:] += table[:-1] / 2
    out[:-1] += table[1:] / 2
    return out.reshape(rows.shape)


def _in_channels(rows: np.ndarray, channels: int) -> np.ndarray:
    """Half the sum of the other channels at the time of every number, (T c,) or (T c, k)."""
    table = rows.reshape(len(rows) // channels, channels, *rows.shape[1:])
    return ((table.sum(axis=1, keepdims=True) - table) / 2).reshape(rows.shape)
