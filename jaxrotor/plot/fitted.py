"""Fitted: a record with the prediction of the fitted scene, and what is left."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes

from . import colours, page
from .labels import length, parameter


def fitted(
    result: Any, axes: Any = None, *, record: int = 0, channel: int = 0
) -> tuple[Axes, Axes]:
    """Measured points with the prediction as a line above, residuals below with twice the noise as a band.

    A motion in time is drawn by its x and y, or by what the probe reads; a response or a spectrum by its
    amplitude. Of an orbit the path is drawn, and the residuals stand beside it.

    Args:
        result: result of `jaxrotor.fit`.
        axes: two Axes; a new figure if None.
        record: index of the record.
        channel: index of the channel in the record.

    Returns:
        The Axes of record and prediction, and those of the residuals.

    Raises:
        ValueError: the result has no such record or channel, or `axes` are not two.
    """
    shown, left, noise = _chosen(result, record, channel)
    measured = np.asarray(shown.measured)[:, channel]
    predicted = measured + left
    plane = shown.kind == "plane" and np.iscomplexobj(measured)
    first, second = page.pair(axes, 170, 80, beside=True) if plane else page.pair(axes, 170, 110)
    turns, label = parameter(shown.name, shown.unit)
    across = turns * np.asarray(shown.abscissa)
    factor, unit = length(float(np.abs(measured).max()))
    if plane:
        closed = factor * np.append(predicted, predicted[:1])
        dots = factor * measured
        first.plot(closed.real, closed.imag, color=colours.BLUE, linewidth=1.0, label="fitted")
        first.plot(dots.real, dots.imag, ".", color=colours.DARK, markersize=3, label="measured")
        first.set(xlabel=f"x displacement [{unit}]", ylabel=f"y displacement [{unit}]")
        first.set_aspect("equal", "datalim")
        second.set_xlabel(label)
    else:
        _draw(first, across, factor * measured, factor * predicted, shown)
        first.set_ylabel(f"{'amplitude' if shown.kind == 'amplitude' else 'displacement'} [{unit}]")
    page.legend(first, 4)
    scale, small = length(float(np.abs(left).max()))
    second.axhspan(-2 * scale * noise, 2 * scale * noise, color="0.92", label="twice the noise")
    for name, part, colour in _parts(left, "x", "y", shown):
        second.plot(across, scale * part, ".", color=colour, markersize=3, label=name)
    second.set_ylabel(f"residual [{small}]")
    second.set_xlabel(label)
    page.legend(second, 3)
    return first, second


def _chosen(result: Any, record: int, channel: int) -> tuple[Any, np.ndarray, float]:
    """The record, the residuals of one channel and the noise; raise where there are none."""
    count = len(result.records)
    if not 0 <= record < count:
        raise ValueError(f"`record` must be 0 to {count - 1}, but is {record}.")
    left = np.asarray(result.residuals[record])
    if not 0 <= channel < left.shape[1]:
        raise ValueError(f"`channel` must be 0 to {left.shape[1] - 1}, but is {channel}.")
    return result.records[record], left[:, channel], float(result.noise[record])


def _parts(values: Any, x: str, y: str, record: Any) -> list[tuple[str, np.ndarray, str]]:
    """Names, values and colours of the real parts of a record."""
    if not np.iscomplexobj(values):
        return [("residual", values, colours.BLUE)]
    if record.kind == "amplitude":
        x, y = "real part", "imaginary part"
    return [(x, values.real, colours.BLUE), (y, values.imag, colours.ORANGE)]


def _draw(
    ax: Axes, across: np.ndarray, measured: np.ndarray, predicted: np.ndarray, record: Any
) -> None:
    """Measured points and the predicted line, of every real part or of the amplitude."""
    if record.kind == "amplitude" or not np.iscomplexobj(measured):
        size = np.abs if record.kind == "amplitude" else np.real
        dots, line = _parts(size(measured), "", "", record), _parts(size(predicted), "", "", record)
    else:
        dots, line = _parts(measured, "x", "y", record), _parts(predicted, "x", "y", record)
    several = len(dots) > 1
    for (name, points, colour), (_, drawn, _) in zip(dots, line, strict=True):
        said = f"{name} " if several else ""
        dark = colour if several else colours.DARK
        ax.plot(across, drawn, color=colour, linewidth=1.0, label=f"{said}fitted")
        ax.plot(across, points, ".", color=dark, markersize=3, label=f"{said}measured")
