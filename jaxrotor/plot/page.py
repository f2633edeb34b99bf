"""Page: figures at their printed width, from 85 mm (a column) to 170 mm (a page), and what all have."""

import os
from collections.abc import Callable
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from jaxtyping import Float
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colorbar import Colorbar
from matplotlib.colors import ListedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ..scene import Scene


TEXT = 8.0  # pt: axis and tick labels, legends
RASTER = 20_000  # points above which a curve is rasterized, so that a PDF stays small

_MM = 1 / 25.4
_LABELS = 48.0  # pt: labels beside Axes
_DPI = 200.0  # resolution of rasterized parts
TICKS: Any = {"labelsize": TEXT, "width": 0.6, "length": 2.5}
STYLE: Any = {  # text and lines of a picture file [pt]
    "font.size": 8.0,
    "axes.labelsize": 8.0,
    "xtick.labelsize": 8.0,
    "ytick.labelsize": 8.0,
    "axes.linewidth": 0.6,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "xtick.major.size": 2.5,
    "ytick.major.size": 2.5,
}


# === figures


def inches(width: float | int, height: float | int) -> tuple[float, float]:
    """Size of a figure in inches, from mm."""
    return width * _MM, height * _MM


def single(ax: Axes | None, width: int, height: int) -> Axes:
    """`ax`, or the Axes of a new figure [mm]; given Axes keep their own sizes."""
    return _new(1, 1, width, height)[0] if ax is None else ax


def pair(axes: Any, width: int, height: int, *, beside: bool = False) -> tuple[Axes, Axes]:
    """The two Axes given, or those of a new figure [mm]: one above the other, or `beside` it."""
    if axes is None:
        axes = _new(*((1, 2) if beside else (2, 1)), width, height)
    first, second = _given(axes, 2, "two Axes")
    return first, second


def grid(axes: Any, count: int, width: int, height: int) -> tuple[Axes, ...]:
    """The `count` Axes given, or those of a new figure, at most three in a row, each of a size [mm]."""
    if axes is None:
        columns = min(count, 3)
        rows = -(-count // columns)
        axes = _first(_new(rows, columns, width * columns, height * rows, shared=False), count)
    return _given(axes, count, f"{count} Axes, one for each station")


def solid(axes: Any, count: int) -> tuple[Axes, ...]:
    """The `count` 3-D Axes given, or those of a new figure."""
    if axes is None:
        columns = min(count, 2)
        rows = -(-count // columns)
        figure = plt.figure(figsize=inches(85 * columns, 65 * rows), dpi=_DPI)
        places = {"left": 0.0, "right": 0.97, "bottom": 0.06, "top": 0.91, "wspace": 0.0}
        kind = {"projection": "3d"}
        every = figure.subplots(
            rows, columns, squeeze=False, subplot_kw=kind, gridspec_kw=places
        ).flat
        axes = _first(list(every), count)
    given = tuple(np.ravel(np.asarray(axes, dtype=object)))
    kinds = [ax.name for ax in given]
    if kinds != ["3d"] * count:
        raise ValueError(
            f'`axes` must be {count} 3-D Axes (`projection="3d"`), but are {len(given)}: '
            f"{', '.join(kinds)}."
        )
    for ax in given:
        ax.set_box_aspect((2.0, 1.0, 1.0), zoom=1.25)
        ax.tick_params(labelsize=TEXT, pad=-2.0)
        for axis in (ax.xaxis, ax.yaxis, ax.zaxis):
            axis.label.set_size(TEXT)
            axis.labelpad = -7.0
    return given


def _given(axes: Any, count: int, wanted: str) -> tuple[Axes, ...]:
    """The Axes given, of which there must be `count`."""
    given = tuple(np.ravel(np.asarray(axes, dtype=object)))
    if len(given) != count:
        raise ValueError(f"`axes` must be {wanted}, but are {len(given)}.")
    return given


def _first(every: list[Axes], count: int) -> list[Axes]:
    """The first `count` Axes of a figure; the others are removed."""
    for ax in every[count:]:
        ax.remove()
    return every[:count]


def _new(rows: int, columns: int, width: int, height: int, *, shared: bool = True) -> list[Axes]:
    figure, axes = plt.subplots(
        rows,
        columns,
        sharex="col" if shared else False,
        squeeze=False,
        figsize=inches(width, height),
        dpi=_DPI,
        layout="constrained",
    )
    for ax in axes.flat:
        ax.tick_params(**TICKS)
        ax.tick_params(which="minor", labelsize=TEXT)
        ax.spines[:].set_linewidth(0.6)
        for axis in (ax.xaxis, ax.yaxis):
            axis.label.set_size(TEXT)
            axis.get_offset_text().set_size(TEXT)
    figure.align_ylabels()
    return list(axes.flat)


def write(
    path: str | os.PathLike[str],
    draw: Callable[[Any], Any],
    width: float | int,
    height: float | int,
    rows: int = 1,
) -> None:
    """Write a picture of `draw(axes)` to a file, without a window and without pyplot.

    Args:
        path: file name; its ending determines the format, as in `Figure.savefig`.
        draw: function that draws in the Axes of a new figure, an array of them if `rows` exceeds 1.
        width: width [mm].
        height: height [mm].
        rows: number of Axes, one above the other.
    """
    with rc_context(STYLE):
        figure = Figure(figsize=inches(width, height), dpi=_DPI, layout="constrained")
        draw(figure.subplots(rows, sharex=True))
        figure.align_ylabels()
        figure.savefig(path)


# === lines


def curve(
    ax: Axes, x: Any, y: Any, colour: Any, label: Any = None, width: float = 1.2, **style: Any
) -> None:
    """Draw a line of a width [pt]; one of many points is rasterized."""
    many = np.size(y) > RASTER
    ax.plot(x, y, color=colour, label=label, linewidth=width, rasterized=many, **style)


def path(ax: Axes, z: Any, colour: Any, label: str | None = None, **style: Any) -> None:
    """Draw a path `z = x + i y` in a plane, as `curve` does."""
    curve(ax, np.real(z), np.imag(z), colour, label, **style)


def zero(ax: Axes) -> None:
    """Draw a thin line at zero, behind the data."""
    ax.axhline(0.0, color="0.6", linewidth=0.6, zorder=0.5)


def once(ax: Axes, label: str) -> str:
    """A label, or "_", which the legend leaves out, if Axes have something of this label already."""
    return "_" if label in ax.get_legend_handles_labels()[1] else label


def ends_of_cells(values: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n+1"]:
    """Where the cells about two or more ordered values meet, halfway between them, and the outer ends."""
    half = np.diff(values) / 2
    first, last = values[0] - half[0], values[-1] + half[-1]
    return np.concatenate([[first], values[:-1] + half, [last]])


# === texts


def finish(
    ax: Axes,
    x: str | None = None,
    y: str | None = None,
    *,
    columns: int = 0,
    scene: Scene | None = None,
) -> Axes:
    """Write axis labels, a legend of at most so many columns and a scene's assumption; returns `ax`."""
    if x is not None:
        ax.set_xlabel(x)
    if y is not None:
        ax.set_ylabel(y)
    if columns:
        legend(ax, columns)
    if scene is not None:
        assumption(ax, scene)
    return ax


def legend(ax: Axes, columns: int) -> None:
    """Draw a legend above the Axes, outside the data, with markers large enough to show their colours.

    Axes without named artists get no legend, and narrow ones fewer columns.
    """
    names = ax.get_legend_handles_labels()[1]
    if not names:
        return
    drawn = ax.legend(
        loc="lower left",
        bbox_to_anchor=(0.0, 1.0),
        ncols=_columns(ax, names, columns),
        fontsize=TEXT,
        frameon=False,
        borderaxespad=0.0,
        handlelength=1.8,
        handletextpad=0.4,
        columnspacing=1.2,
    )
    for handle in drawn.legend_handles:
        if isinstance(handle, Line2D) and handle.get_linestyle() == "None":
            handle.set_markersize(8.0)


def width_of(ax: Axes) -> float:
    """Width [pt] between the labels of Axes and the edge of their part of the figure, about."""
    figure: Any = ax.figure
    share = ax.get_position().width / 0.775  # of the default width of Axes in a figure
    return min(share, 1.0) * figure.bbox.width * 72 / figure.dpi - _LABELS


def _columns(ax: Axes, names: list[str], most: int) -> int:
    """Number of columns of a legend that fit, at most `most`; the first ones have one entry more."""
    widths = [0.5 * TEXT * len(name) + 3.4 * TEXT for name in names]
    for columns in range(min(most, len(names)), 1, -1):
        parts = np.array_split(widths, columns)
        if sum(max(part) for part in parts) <= width_of(ax):
            return columns
    return 1


def shade(
    ax: Axes, x: Any, y: Any, values: Any, label: str, extend: str | None = None, **style: Any
) -> None:
    """Draw values over two axes as colours with a colour bar, grey where they are unknown (NaN)."""
    style = {"cmap": "viridis", "shading": "nearest"} | style
    mesh = ax.pcolormesh(x, y, values, rasterized=True, **style)
    ax.set_facecolor("0.8")
    colour_bar(ax, mesh, label, extend=extend)


def shade_classes(ax: Axes, x: Any, y: Any, numbers: Any, shades: list[str]) -> None:
    """Draw whole numbers over two axes, each by the colour that the list has at its place."""
    scale: Any = {"cmap": ListedColormap(shades), "norm": Normalize(-0.5, len(shades) - 0.5)}
    ax.pcolormesh(x, y, numbers, shading="nearest", rasterized=True, **scale)


def colour_bar(ax: Axes, drawn: ScalarMappable, label: str, **options: Any) -> Colorbar:
    """Bar beside the Axes with the scale of what is drawn in colours; `options` are matplotlib's."""
    bar = ax.figure.colorbar(drawn, ax=ax, pad=0.02, **options)
    bar.set_label(label, size=TEXT)
    bar.ax.tick_params(**TICKS)
    return bar


def note(ax: Axes, text: str, right: bool = False) -> None:
    """Write a short text into a lower corner of the Axes, the left one by default."""
    place: Any = {"transform": ax.transAxes, "fontsize": TEXT, "ha": "right" if right else "left"}
    ax.text(0.97 if right else 0.03, 0.03, text, **place)


def assumption(ax: Axes, scene: Scene) -> None:
    """Write the assumption of a scene, if it has one, in grey along the right side."""
    if scene.assumption:
        place: Any = {"xycoords": "axes fraction", "textcoords": "offset points"}
        style: Any = {"rotation": 270, "va": "center", "fontsize": TEXT - 1, "color": "0.4"}
        ax.annotate(scene.assumption, (1.0, 0.5), (3.0, 0.0), ha="left", **place, **style)
