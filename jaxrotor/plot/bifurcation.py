"""Bifurcation diagram: extrema of the displacement, and direction of whirl."""

from typing import Any

import numpy as np
import xarray as xr
from jaxtyping import Float
from matplotlib.axes import Axes

from ..core.outcome import FAILED, STATUS, failed
from . import colours, page
from .labels import coordinate, ensemble, only_swept, words
from .lane_kinds import groups_of_lanes
from .marks import draw_sideways
from .units import length_unit


_INK = 22_000  # of points, by their number and the square of their marker size [pt]
_SIZES = (1.5, 4.0)  # smallest and largest marker [pt]; a point is half as wide
_MARKERS = {"up": "^", "down": "v"}  # of the ways in which states are carried
_HEIGHTS = 1000  # at which points of a lane are told apart
_STRIP = 0.025  # height of the strip that marks contact, over that of the Axes
_CLOSE = 0.04  # distance, over the range, below which two texts become one


def bifurcation(
    dataset: xr.Dataset, axes: Any = None, *, section: bool = False, size: float | int | None = None
) -> tuple[Axes, Axes]:
    """Local extrema of the x displacement, and the precession index below, over one parameter.

    Colours are those of the kinds of motion if the data set has them (`jaxrotor.classify`), or of the
    attractors (`jaxrotor.attractors`). Otherwise they mark forward whirl (index > 0), backward whirl (< 0)
    and undefined whirl (NaN: at rest in the centre; 0: no net whirl). Several starts are drawn over each
    other, as are the branches up and down, which have different markers in the lower Axes. Lines are at
    the clearance of the stops, the gap on the side of x to which each faces, if the data set keeps its
    scene. Where lanes at some values touch a stop and those at others do not, a dark strip below the
    points marks the values with contact. A value without any point is shaded, with the status of its
    lanes.

    Args:
        dataset: result of a sweep over one parameter, and any starts or a `branch`, with `extrema` [m] and
            `index` [1].
        axes: two Axes, upper and lower; a new figure if None.
        section: draw x once per revolution (`section` [m]) instead of its extrema.
        size: marker size of the points [pt]; by default the larger, the fewer differ from each other.

    Returns:
        The upper Axes, displacement, and the lower, precession index [1].

    Raises:
        ValueError: a variable is missing, it is not over one swept parameter, or both are not over
            the same one.

    Source: Azarov, Gouskov, Panovko (2023), Fig. 3.
    """
    name, *own = (
        ("section", "revolution", "axis") if section else ("extrema", "revolution", "extremum")
    )
    others = ensemble(dataset, name, tuple(own))
    dim = only_swept(dataset, name, (*own, *others))
    if only_swept(dataset, "index", others) != dim:
        raise ValueError(
            f"`{name}` and `index` must be over the same swept dimension, but are over '{dim}' and "
            f"'{only_swept(dataset, 'index', others)}'."
        )
    lanes = (dim, *others)
    array = dataset[name].isel(axis=0) if section else dataset[name]
    index = dataset["index"].transpose(*lanes).values
    factor, unit = length_unit("mm")
    displacement = factor * array.transpose(*lanes, ...).values.reshape(index.size, -1)
    each, label = coordinate(dataset, dim)
    values = np.repeat(each, index.size // len(each))
    status = np.zeros(index.shape, int)
    if "status" in dataset:  # failed lanes are not drawn
        status = dataset["status"].transpose(*lanes).values
        displacement[failed(status).ravel()] = np.nan
    seen = np.isfinite(displacement)
    if size is None:
        size = float(np.clip(np.sqrt(_INK / max(_places(displacement), 1)), *_SIZES))

    upper, lower = page.pair(axes, 170, 110)
    ways = {".": np.ones(index.size, bool)}
    if "branch" in lanes:
        branch = np.indices(index.shape)[lanes.index("branch")].ravel()
        names = [str(name) for name in dataset["branch"].values]
        ways = {_MARKERS[name]: branch == k for k, name in enumerate(names)}
        for name in names:
            upper.plot([], [], _MARKERS[name], color=colours.DARK, label=f"below: {name}")
    for about, colour, chosen in groups_of_lanes(dataset, lanes):
        points = seen & chosen[:, None]
        x, y = np.broadcast_to(values[:, None], points.shape)[points], displacement[points]
        style: Any = {"linestyle": "none", "marker": ".", "markeredgewidth": 0.0, "color": colour}
        upper.plot(x, y, markersize=size, rasterized=x.size > page.RASTER, label=about, **style)
        for marker, belongs in ways.items():
            some, style["marker"] = chosen & belongs, marker
            lower.plot(values[some], index.ravel()[some], markersize=4.0, **style)
    largest = float(np.nanmax(np.abs(displacement), initial=0.0)) / factor
    _mark_contact(upper, dataset, dim, each)
    draw_sideways(upper, dataset, dim, each, (factor, unit), largest)
    empty = np.asarray(~seen.reshape(len(each), -1).any(axis=1))
    _say_why(upper, each, empty, status.reshape(len(each), -1))
    for ax in (upper, lower):
        ax.margins(x=0.01)
    page.zero(lower)
    about = dataset["index"].attrs
    if "error" in about:
        text = f"twice the steps: {about['error_median']:.0e} (median), "
        style = {"fontsize": page.TEXT - 1, "color": "0.35", "ha": "right"}
        text += f"{about['error']:.0e} (largest)"
        lower.annotate(text, (0.99, 0.04), xycoords="axes fraction", **style)
    what = "once a revolution" if section else "local extrema"
    page.finish(upper, y=f"x displacement,\n{what} [{unit}]", columns=3)
    page.finish(lower, label, "precession index\n" r"mean of $\dot\psi/\Omega$ [1]")
    return upper, lower


def _places(displacement: Float[np.ndarray, "N e"]) -> int:
    """Number of points that do not lie on each other: a periodic lane has few, however long it is kept."""
    lane, _ = known = np.nonzero(np.isfinite(displacement))
    if not lane.size:
        return 0
    heights = displacement[known]
    step = float(np.ptp(heights)) / _HEIGHTS or 1.0
    return len(np.unique(lane + 1j * np.rint((heights - heights.min()) / step)))


def _say_why(ax: Axes, values: np.ndarray, empty: np.ndarray, status: np.ndarray) -> None:
    """Shade the values without points, and write the status of their lanes; close texts are merged."""
    if not empty.any() or values.dtype.kind not in "fiu":
        return
    order, ends = _columns(values)
    places, why = values[order], status[order]
    close = _CLOSE * (places[-1] - places[0])
    texts: list[tuple[list[float], dict[str, None]]] = []  # places, and what is said of them
    reason = lambda code: words(STATUS[code]) if code in FAILED else "no points"
    last = -1
    for k in np.flatnonzero(empty[order]).tolist():
        ax.axvspan(ends[k], ends[k + 1], color="0.92", linewidth=0.0, zorder=0.2)
        place, said = float(places[k]), {reason(code): None for code in why[k].tolist()}
        same = texts and k == last + 1 and said == texts[-1][1]
        if same or (texts and place - texts[-1][0][-1] <= close):
            texts[-1][0].append(place)
            texts[-1][1].update(said)
        else:
            texts.append(([place], said))
        last = k
    for at, said in texts:
        style: Any = {"rotation": 90, "ha": "center", "va": "center", "fontsize": page.TEXT - 1}
        style["bbox"] = {"facecolor": "0.92", "edgecolor": "none", "pad": 0.5}
        where = ax.get_xaxis_transform()
        ax.text((at[0] + at[-1]) / 2, 0.5, ", ".join(said), transform=where, color="0.35", **style)


def _mark_contact(ax: Axes, dataset: xr.Dataset, dim: str, values: np.ndarray) -> None:
    """A strip along the lower edge at the values where a lane touches a stop, if there are others."""
    if "duty" not in dataset or values.dtype.kind not in "fiu":
        return
    others = [other for other in dataset["duty"].dims if other != dim]
    touching = dataset["duty"] > 0
    if "status" in dataset:
        touching &= ~dataset["status"].isin(FAILED)
    touches = touching.any(others).values
    if touches.all() or not touches.any():
        return
    order, ends = _columns(values)
    style: Any = {"color": colours.DARK, "linewidth": 0.0, "zorder": 3.0}
    for number, k in enumerate(np.flatnonzero(touches[order]).tolist()):
        label = "_" if number else "contact"
        ax.axvspan(ends[k], ends[k + 1], 0.0, _STRIP, label=label, **style)


def _columns(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The order of values on the axis, and the ends of the column of each of them in this order."""
    order = np.argsort(values)
    places = values[order]
    return order, np.concatenate([places[:1], (places[1:] + places[:-1]) / 2, places[-1:]])
