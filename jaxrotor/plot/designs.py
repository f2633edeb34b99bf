"""Designs: the way of a tuning, and a record with the prediction of the fitted scene."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes

from . import colours, page
from .labels import length, parameter, words


def tuning(result: Any, axes: Any = None) -> tuple[Axes, Axes]:
    """Loss above and parameters below, against steps; all starts in grey, the best one in colour.

    Positive losses that span two decades are drawn on a logarithmic axis. Several parameters are each
    scaled from 0 to 1 over their range, which is in the legend. A dot marks the best step; a cross marks
    the end of a start whose loss became infinite or NaN.

    Args:
        result: result of `jaxrotor.tune`.
        axes: two Axes, upper and lower; a new figure if None.

    Returns:
        The upper Axes, loss, and the lower, parameters.
    """
    first, second = page.pair(axes, 170, 110)
    loss, values, taken = result.history.loss, result.history.values, result.start
    steps = np.arange(loss.shape[1])
    best = int(np.nanargmin(np.abs(loss[taken] - float(result.loss))))
    others = [start for start in range(len(loss)) if start != taken]
    for start in [*others, taken]:
        style = (colours.BLUE, 1.2) if start == taken else ("0.75", 0.7)
        first.plot(steps, loss[start], color=style[0], linewidth=style[1])
        if "not finite" in result.reasons[start]:
            last = np.flatnonzero(np.isfinite(loss[start]))[-1:]
            first.plot(last, loss[start][last], "x", color=colours.RED, markersize=4)
    first.plot(best, loss[taken][best], "o", color=colours.BLUE, markersize=4)
    if np.nanmin(loss) > 0 and np.nanmax(loss) > 100 * np.nanmin(loss):
        first.set_yscale("log")
    several = len(values) > 1
    label = ""
    for number, (path, rows) in enumerate(values.items()):
        colour = colours.cycled(number)
        factor, label = parameter(words(path), result.scene.unit(path))
        shown = factor * rows
        if several:
            low, high = np.nanmin(shown), np.nanmax(shown)
            shown = (shown - low) / (high - low if high > low else 1.0)
            label = f"{label} {low:.4g} to {high:.4g}"
        for start in others:
            second.plot(steps, shown[start], color=colour, linewidth=0.5, alpha=0.35)
        second.plot(steps, shown[taken], color=colour, linewidth=1.2, label=label)
        second.plot(best, shown[taken][best], "o", color=colour, markersize=4)
    for ax in (first, second):
        ax.margins(x=0.02)
    page.finish(first, y="loss")
    named = ("share of the range [1]", 2) if several else (label, 0)
    return first, page.finish(second, "steps [1]", named[0], columns=named[1])


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
    count = len(result.records)
    if not 0 <= record < count:
        raise ValueError(f"`record` must be 0 to {count - 1}, but is {record}.")
    residuals = np.asarray(result.residuals[record])
    if not 0 <= channel < residuals.shape[1]:
        raise ValueError(f"`channel` must be 0 to {residuals.shape[1] - 1}, but is {channel}.")
    shown, left, noise = result.records[record], residuals[:, channel], float(result.noise[record])
    measured = np.asarray(shown.measured)[:, channel]
    plane, sizes = shown.kind == "plane" and np.iscomplexobj(measured), shown.kind == "amplitude"
    first, second = page.pair(axes, 170, 80, beside=True) if plane else page.pair(axes, 170, 110)
    turns, label = parameter(shown.name, shown.unit)
    across = turns * np.asarray(shown.abscissa)
    factor, unit = length(measured)
    dots, line = factor * measured, factor * (measured + left)
    if plane:
        page.path(first, np.append(line, line[:1]), colours.BLUE, "fitted", width=1.0)
        style: Any = {"color": colours.DARK, "markersize": 3, "label": "measured"}
        first.plot(dots.real, dots.imag, ".", **style)
        first.set_aspect("equal", "datalim")
        page.finish(first, f"x displacement [{unit}]", f"y displacement [{unit}]", columns=4)
    else:
        if sizes:
            dots, line = np.abs(dots), np.abs(line)
        elif not np.iscomplexobj(dots):
            line = np.real(line)
        for (name, points, colour), (_, drawn, _) in zip(_parts(dots), _parts(line), strict=True):
            page.curve(first, across, drawn, colour, f"{name} fitted".lstrip(), 1.0)
            dark, label_of = (colour if name else colours.DARK), f"{name} measured".lstrip()
            first.plot(across, points, ".", color=dark, markersize=3, label=label_of)
        what = "amplitude" if sizes else "displacement"
        page.finish(first, y=f"{what} [{unit}]", columns=4)
    scale, small = length(left)
    second.axhspan(-2 * scale * noise, 2 * scale * noise, color="0.92", label="twice the noise")
    names = ("real part", "imaginary part") if sizes else ("x", "y")
    for name, part, colour in _parts(left, *names, "residual"):
        second.plot(across, scale * part, ".", color=colour, markersize=3, label=name)
    return first, page.finish(second, label, f"residual [{small}]", columns=3)


def _parts(
    values: Any, x: str = "x", y: str = "y", whole: str = ""
) -> list[tuple[str, np.ndarray, str]]:
    """Name, values and colour of both parts of a complex signal, or of a real one."""
    if not np.iscomplexobj(values):
        return [(whole, values, colours.BLUE)]
    return [(x, values.real, colours.BLUE), (y, values.imag, colours.ORANGE)]
