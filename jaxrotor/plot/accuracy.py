"""Accuracy: error against run time, steps or nodes."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr
from jaxtyping import Float
from matplotlib.axes import Axes

from . import colours, page


_AXES = {
    "steps": "steps [1]",
    "tolerance": "relative tolerance [1]",
    "nodes": "nodes, or cells [1]",
}
_MARKERS = "osD^vPX<>"
_FLOOR = 3.0  # an order is fitted to errors above so many times the error of the reference


def work_precision(
    dataset: xr.Dataset, ax: Axes | None = None, *, methods: Sequence[str] = ()
) -> Axes:
    """Relative error against run time, one line per method, its settings loose to tight.

    Settings that failed are left out and counted in the figure. The dashed line is the uncertainty of
    the reference.

    Args:
        dataset: result of `jaxrotor.accuracy`.
        ax: Axes to draw in; a new figure if None.
        methods: names of the methods of several studies, so that each has one style in all pictures; by
            default those of this study.

    Returns:
        The Axes, relative error [1] over run time [s].
    """
    ax = page.single(ax, 150, 105)
    for style, line in _lines(dataset, methods):
        ax.plot(line["run_time"].values, _errors(line), label=line["method"].values[0], **style)
    lanes = int(dataset.attrs["lanes"])
    return _finish(dataset, ax, f"time of a run{'' if lanes == 1 else f' of {lanes} lanes'} [s]", 3)


def convergence(dataset: xr.Dataset, ax: Axes | None = None, *, axis: str | None = None) -> Axes:
    """Relative error against steps, nodes or tolerance, each method with its order.

    The order is the slope of the line, fitted where the error is well above that of the reference.
    Spectral nodes, whose error decreases exponentially, have none.

    Args:
        dataset: result of `jaxrotor.accuracy`.
        ax: Axes to draw in; a new figure if None.
        axis: "steps", "nodes" or "tolerance", by default that of the first method.

    Returns:
        The Axes, relative error [1] over the axis.

    Raises:
        ValueError: no method of the study has this axis.
    """
    axis = str(dataset["axis"].values[0]) if axis is None else axis
    found = [(style, line) for style, line in _lines(dataset) if line["axis"].values[0] == axis]
    if axis not in _AXES or not found:
        known = ", ".join(dict.fromkeys(str(one) for one in dataset["axis"].values))
        raise ValueError(f"`axis` must be one of the study's ({known}), but is {axis!r}.")
    ax = page.single(ax, 150, 105)
    for style, line in found:
        x, y = line[axis].values, _errors(line)
        order = None if line["rule"].values[0] == "spectral" else slope(x, y, _floor(dataset))
        name = str(line["method"].values[0])
        label = name if order is None else f"{name}: order {abs(order):.1f}"
        ax.plot(x, y, label=label, **style)
    if axis == "tolerance":
        ax.invert_xaxis()
    _finish(dataset, ax, _AXES[axis], 2)
    if axis != "tolerance":  # every count is named as a plain number
        counts = np.unique(np.concatenate([line[axis].values for _, line in found]))
        ax.set_xticks(counts, labels=[f"{count:g}" for count in counts])
        ax.set_xticks([], minor=True)
    return ax


def slope(x: Float[np.ndarray, " N"], error: np.ndarray, floor: float | int) -> float | None:
    """Slope of log error over log x by least squares, fitted to errors well above `floor`."""
    use = np.isfinite(error) & (error > _FLOOR * floor) & (error < 1)
    if use.sum() < 2:
        return None
    return float(np.polyfit(np.log(x[use]), np.log(error[use]), 1)[0])


def _lines(
    dataset: xr.Dataset, methods: Sequence[str] = ()
) -> list[tuple[dict[str, Any], xr.Dataset]]:
    """Line style and runs of every method; styles follow the order of `methods`, then of the runs."""
    own = dict.fromkeys(dataset["method"].values.tolist())
    found = []
    for number, name in enumerate(dict.fromkeys((*methods, *own))):
        if name in own:
            style = {
                "color": colours.cycled(number),
                "marker": _MARKERS[number % len(_MARKERS)],
                "linestyle": ("-", "--", ":")[number // len(colours.CYCLE) % 3],
                "linewidth": 1.2,
                "markersize": 3.5,
            }
            runs = np.flatnonzero(dataset["method"].values == name)
            found.append((style, dataset.isel(run=runs)))
    return found


def _errors(line: xr.Dataset) -> np.ndarray:
    """Relative errors, NaN for failed runs, at least the machine epsilon for the logarithm."""
    error = np.where(line["status"].values == 0, line["relative_error"].values, np.nan)
    return np.maximum(error, np.finfo(float).eps)


def _floor(dataset: xr.Dataset) -> float:
    """Relative uncertainty of the reference."""
    value = abs(complex(dataset.attrs["reference"], dataset.attrs.get("reference_imag", 0.0)))
    return float(dataset.attrs["reference_uncertainty"]) / value if value else 0.0


def _finish(dataset: xr.Dataset, ax: Axes, label: str, columns: int) -> Axes:
    """Scales, labels, the uncertainty of the reference, and the number of settings that failed."""
    ax.set(xscale="log", yscale="log")
    floor = _floor(dataset)
    low, high = ax.get_ylim()
    small: Any = {"fontsize": page.TEXT - 1, "color": "0.35"}
    if low / 10 < floor < high:
        ax.axhline(floor, color="0.5", linewidth=0.8, linestyle="--", zorder=0.5)
        place: Any = {"xytext": (0, 2), "textcoords": "offset points", "ha": "right"}
        place |= {"xycoords": ("axes fraction", "data"), "zorder": 0.6} | small
        place["bbox"] = {"color": "white", "pad": 0.5}
        ax.annotate("uncertainty of the reference", (0.99, floor), **place)
    failed = int((dataset["status"].values != 0).sum())
    if failed:
        text = f"{failed} of {dataset.sizes['run']} settings failed or were left out"
        ax.annotate(text, (0.01, 0.02), xycoords="axes fraction", **small)
    ax.grid(which="major", color="0.9", linewidth=0.5)
    ax.set_axisbelow(True)
    name = dataset["value"].attrs["long_name"]
    return page.finish(ax, label, f"relative error of the\n{name} [1]", columns=columns)
