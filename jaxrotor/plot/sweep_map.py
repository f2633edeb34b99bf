"""Sweep map: kind of motion, or a number, over two swept parameters."""

from typing import Any

import numpy as np
import xarray as xr
from jaxtyping import Bool, Float, Int
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import ListedColormap, LogNorm, Normalize
from matplotlib.transforms import offset_copy

from ..core.outcome import STATUS, failed
from ..core.tables import RPM
from ..files.toml import loads
from . import colours, page
from .labels import coordinate, parameter, swept, words
from .units import speed_unit


LOST = "no result"
_MOST = 8  # classes that a variable with whole numbers may have; more have a colour bar
_FAR = 0.1  # of the length of the shaft: a lane that went farther has run away
_DECADES = 3  # positive values that span more are drawn on a logarithmic scale
_RAISED = 26.0  # pt: the legend above an axis in rpm
_KINDS = {  # name -> colour, in the order of the legend
    "no contact": "#E4E4E4",
    "rub, forward whirl": colours.FORWARD,
    "rub, backward whirl": colours.BACKWARD,
    "rub, undefined": colours.UNDEFINED,
    "rub": colours.ORANGE,
    "forward whirl": colours.FORWARD,
    "backward whirl": colours.BACKWARD,
    "undefined": colours.UNDEFINED,
    "steps too long": colours.DARK,
    "ran away": colours.MAGENTA,
    LOST: "white",
}


def sweep_map(
    dataset: xr.Dataset,
    name: str | None = None,
    ax: Axes | None = None,
    *,
    norm: Normalize | None = None,
) -> Axes:
    """Kind of motion of every lane of a sweep over two parameters, or one of its numbers, as colour.

    Without a `name` colours tell the kind, decided for each lane by the first that holds:

    * "no result": its `status` says that it failed; hatched;
    * "steps too long": contact was too stiff for the step, so more steps are needed;
    * "ran away": `radius_max` exceeds a tenth of the shaft's length, where small deflections, which all
      equations assume, no longer hold;
    * "no contact": no limiter was under load in the kept revolutions (`duty` of all is 0);
    * "rub, forward whirl", "rub, backward whirl": the orbit turns about the centre with or against the
      spin, by the sign of its `winding`, or of its precession `index` where there is no winding;
    * "rub, undefined": no net whirl (0), or a passage through the centre (NaN).

    `index` is the same mean as `winding`, but by rates, which grow where an orbit comes near the centre.
    A run along times has neither, so its kinds are "no contact" and "rub"; a scene without limiters has no
    `duty`, so its kinds are "forward whirl", "backward whirl" and "undefined", as in `bifurcation`.

    Args:
        dataset: result of a sweep over two parameters; the first is drawn to the right.
        name: variable with one number a lane, as "radius_max" or "peak", or one a limiter ("duty"), of
            which the largest is drawn; by default the kind of motion. Failed lanes are hatched. Whole
            numbers of at most eight values, as "attractor" of `jaxrotor.attractors` and "status", are
            classes: each has a colour and a name in the legend.
        ax: Axes to draw in; a new figure if None.
        norm: scale of the colours of a variable, in the unit drawn, such as
            `matplotlib.colors.LogNorm()`. By default linear, about zero if there are both signs, and
            logarithmic if all values are positive and span more than three decades.

    Returns:
        The Axes, both parameters; a speed in rad/s has an axis in rpm, too.

    Raises:
        ValueError: the dataset is not over two swept parameters of two or more values each, or has no
            such variable, or not one number a lane, or none of `duty`, `winding` and `index`.
    """
    dims = _two(dataset)
    dataset = dataset.sortby(list(dims))
    (x, x_label), (y, y_label) = (coordinate(dataset, dim) for dim in dims)
    lost = failed(dataset["status"].transpose(*dims)).T
    ax = page.single(ax, 120, 90)
    style: Any = {"shading": "nearest", "rasterized": True}
    found = _kinds(dataset, dims) if name is None else _classes(dataset, dims, name, lost)
    if found is not None:
        codes, classes = found
        scale: Any = {"cmap": ListedColormap([shade for _, shade in classes])}
        ax.pcolormesh(x, y, codes, norm=Normalize(-0.5, len(classes) - 0.5), **scale, **style)
        for number, (kind, shade) in enumerate(classes):
            if kind != LOST and (codes == number).any():
                ax.fill([], [], color=shade, label=kind)
        lost = codes == [kind for kind, _ in classes].index(LOST)
    else:
        assert name is not None
        about, drawn = dataset[name].attrs, _numbers(dataset, dims, name)
        factor, label = parameter(about.get("long_name", name), str(about.get("units", "1")))
        drawn = np.where(lost, np.nan, factor * drawn)
        chosen, shades = _scale(drawn)
        mesh = ax.pcolormesh(x, y, drawn, cmap=shades, norm=norm or chosen, **style)
        ax.set_facecolor("0.8")
        page.colour_bar(ax, mesh, label)
        if (np.isnan(drawn) & ~lost).any():
            ax.fill([], [], color="0.8", label="undefined")
    if lost.any():
        _hatch(ax, x, y, lost)
    ax.set_xlabel(x_label)
    ax.set_ylabel(y_label)
    page.legend(ax, columns=3)
    told = ax.get_legend()
    if _also_in_rpm(ax, dims) and told is not None:
        figure: Any = ax.figure  # a part of a figure serves, too
        above = offset_copy(ax.transAxes, figure, y=_RAISED, units="points")
        told.set_bbox_to_anchor((0.0, 1.0), above)
    return ax


def _two(dataset: xr.Dataset) -> tuple[str, str]:
    """The two swept parameters of a data set."""
    dims = swept(dataset, "status")
    numeric = all(dataset[dim].dtype.kind in "fiu" for dim in dims)
    if len(dims) != 2 or not numeric or min(dataset.sizes[dim] for dim in dims) < 2:
        named = ", ".join(f"'{dim}' ({dataset.sizes[dim]})" for dim in dims) or "none"
        raise ValueError(
            "A sweep map takes two swept parameters of two or more values each, but the dataset has "
            f"{named}; select others with `.sel` or `.isel`."
        )
    return dims[0], dims[1]


def _hatch(ax: Axes, x: np.ndarray, y: np.ndarray, lost: Bool[np.ndarray, "y x"]) -> None:
    """Hatch the whole cells of lanes without a result."""
    x, y = page.ends_of_cells(x), page.ends_of_cells(y)
    cells = [
        [(x[i], y[j]), (x[i + 1], y[j]), (x[i + 1], y[j + 1]), (x[i], y[j + 1])]
        for j, i in np.argwhere(lost)
    ]
    style: Any = {"edgecolor": colours.DARK, "hatch": "//////"}
    ax.add_collection(PolyCollection(cells, facecolor="none", linewidth=0.0, **style))
    ax.fill([], [], facecolor="white", label=LOST, **style)


def _classes(
    dataset: xr.Dataset, dims: tuple[str, str], name: str, lost: Bool[np.ndarray, "y x"]
) -> tuple[Int[np.ndarray, "y x"], list[tuple[str, str]]] | None:
    """Class of every lane, and name and colour of each, of a variable with few whole numbers."""
    values = _numbers(dataset, dims, name)
    if dataset[name].dtype.kind not in "iub":
        return None
    if name == "status":  # tells itself why there is no result
        lost = np.zeros_like(lost)
    elif name == "attractor":
        lost = lost | (values < 0)
    present = np.unique(values[~lost])
    if len(present) > _MOST:
        return None
    about, chosen = dataset[name].attrs, colours.shades(len(present))
    if name == "attractor":
        feature = words(about["features"][0])
        names = [f"{feature} {about['means'][int(value)][0]:.3g}" for value in present]
    elif "flag_meanings" in about:
        meanings = [about["flag_meanings"].split()[int(value)] for value in present]
        names = list(map(words, meanings))
        if name == "motion":
            chosen = [colours.MOTIONS[meaning] for meaning in meanings]
    else:
        names = [f"{words(name)} {value:g}" for value in present]
    codes = np.where(lost, len(present), np.searchsorted(present, values))
    return codes, list(zip([*names, LOST], [*chosen, "white"], strict=True))


def _kinds(
    dataset: xr.Dataset, dims: tuple[str, str]
) -> tuple[Int[np.ndarray, "y x"], list[tuple[str, str]]]:
    """Number in `_KINDS` of every lane, the first parameter along columns, and the kinds."""
    whirl = next((name for name in ("winding", "index") if name in dataset), None)
    if "duty" not in dataset and whirl is None:
        raise ValueError(
            "The kind of motion needs `duty`, `winding` or `index`, but the dataset has none of them; "
            f"name the variable to draw, of {', '.join(map(str, dataset.data_vars))}."
        )
    status = dataset["status"].transpose(*dims).values.T
    conditions: dict[str, Bool[np.ndarray, "y x"]] = {
        LOST: failed(status),
        "steps too long": status == STATUS.index("steps_too_long_for_a_stop"),
    }
    if "radius_max" in dataset and "scene" in dataset.attrs:
        conditions["ran away"] = _numbers(dataset, dims, "radius_max") > _FAR * _length(dataset)
    rub = "rub" if "duty" in dataset else ""
    if rub:
        conditions["no contact"] = _numbers(dataset, dims, "duty") == 0
    if whirl is not None:
        rub = rub and f"{rub}, "
        turns = _numbers(dataset, dims, whirl)
        conditions |= {f"{rub}forward whirl": turns > 0, f"{rub}backward whirl": turns < 0}
        rub += "undefined"
    names = list(_KINDS)
    numbers = [names.index(kind) for kind in conditions]
    return np.select(list(conditions.values()), numbers, names.index(rub)), list(_KINDS.items())


def _length(dataset: xr.Dataset) -> float:
    """Length of the shaft [m]; of several that are swept the largest."""
    if "shaft.length" in dataset.coords:
        return float(dataset["shaft.length"].max())
    return float(loads(dataset.attrs["scene"]).shaft.length)


def coloured_kinds(
    dataset: xr.Dataset, dims: tuple[str, str]
) -> list[tuple[str, str, Bool[np.ndarray, "x y"]]]:
    """Name, colour and lanes of each kind of motion that occurs."""
    codes, classes = _kinds(dataset, dims)
    rows = [
        (kind, shade, np.equal(codes.T, number)) for number, (kind, shade) in enumerate(classes)
    ]
    return [row for row in rows if row[2].any()]


def _numbers(dataset: xr.Dataset, dims: tuple[str, str], name: str) -> Float[np.ndarray, "y x"]:
    """A variable with one number a lane, of limiters the largest, the first parameter along columns."""
    own = set(swept(dataset, name)) - set(dims)
    array = dataset[name].max("limiter") if own == {"limiter"} else dataset[name]
    if set(array.dims) != set(dims):
        raise ValueError(
            f"A sweep map draws one number a lane, but `{name}` is over "
            f"{', '.join(map(repr, dataset[name].dims))}; reduce it first, or name another variable."
        )
    return array.transpose(*dims).values.astype(float).T


def _scale(values: np.ndarray) -> tuple[Normalize, Any]:
    """Scale of colours, and the colours: about zero, logarithmic or linear."""
    known = values[np.isfinite(values)]
    low, high = (known.min(), known.max()) if known.size else (0.0, 1.0)
    if low < 0 < high:
        top = max(-low, high)
        return Normalize(-top, top), "RdBu"  # backward is red, forward blue
    if low > 0 and high > 10.0**_DECADES * low:
        return LogNorm(low, high), "viridis"
    return Normalize(low, high), "viridis"


def _also_in_rpm(ax: Axes, dims: tuple[str, str]) -> bool:
    """Draw a second axis of a spin speed in rad/s, in revolutions per minute; whether it lies above."""
    if "spin.speed" not in dims or speed_unit()[1] != "rad/s":  # else another unit is chosen
        return False
    both = (lambda speed: speed * RPM, lambda rpm: rpm / RPM)
    above = dims[0] == "spin.speed"
    if above:
        other = ax.secondary_xaxis("top", functions=both)
        other.set_xlabel("spin speed [rpm]", size=page.TEXT)
    else:
        other = ax.secondary_yaxis("right", functions=both)
        other.set_ylabel("spin speed [rpm]", size=page.TEXT)
    other.tick_params(labelsize=page.TEXT, width=0.6, length=2.5)
    return above
