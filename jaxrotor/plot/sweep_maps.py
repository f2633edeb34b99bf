"""Maps of sweeps: kind of motion, attractor or a number over two parameters, envelopes over one."""

from typing import Any

import numpy as np
import xarray as xr
from jaxtyping import Bool
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import LogNorm, Normalize
from matplotlib.transforms import offset_copy

from ..core.outcome import failed
from ..core.tables import RPM
from . import colours, page
from .labels import coordinate, length, only_swept, parameter, swept
from .lane_kinds import LOST, classes, kinds_of_map, numbers
from .units import speed_unit


_DECADES = 3  # positive values that span more are drawn on a logarithmic scale
_RAISED = 26.0  # pt: the legend above an axis in rpm


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
    * "rub, irregular": `regularity`, observed where there are several shafts, is not below 1e-3;
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
    found = kinds_of_map(dataset, dims) if name is None else classes(dataset, dims, name, lost)
    if found is not None:
        codes, kinds = found
        page.shade_classes(ax, x, y, codes, [shade for _, shade in kinds])
        for number, (kind, shade) in enumerate(kinds):
            if kind != LOST and (codes == number).any():
                ax.fill([], [], color=shade, label=kind)
        lost = codes == [kind for kind, _ in kinds].index(LOST)
    else:
        assert name is not None
        about, drawn = dataset[name].attrs, numbers(dataset, dims, name)
        factor, label = parameter(about.get("long_name", name), str(about.get("units", "1")))
        drawn = np.where(lost, np.nan, factor * drawn)
        chosen, shades = _scale(drawn)
        page.shade(ax, x, y, drawn, label, cmap=shades, norm=norm or chosen)
        if (np.isnan(drawn) & ~lost).any():
            ax.fill([], [], color="0.8", label="undefined")
    if lost.any():
        _hatch(ax, x, y, lost)
    page.finish(ax, x_label, y_label, columns=3)
    told = ax.get_legend()
    if _also_in_rpm(ax, dims) and told is not None:
        figure: Any = ax.figure  # a part of a figure serves, too
        above = offset_copy(ax.transAxes, figure, y=_RAISED, units="points")
        told.set_bbox_to_anchor((0.0, 1.0), above)
    return ax


def attractors(dataset: xr.Dataset, ax: Axes | None = None) -> Axes:
    """Basins of attraction: `sweep_map` of the `attractor` of every lane over two swept parameters.

    The legend names the mean of the first feature of each.

    Args:
        dataset: result of `jaxrotor.attractors` over two dimensions; the first is drawn to the right.
        ax: Axes to draw in; a new figure if None.

    Returns:
        The Axes, both parameters.

    Raises:
        ValueError: the dataset has no `attractor`, or not two swept dimensions.
    """
    if "attractor" not in dataset:
        raise ValueError(
            "The dataset has no `attractor`; call `jaxrotor.attractors(dataset)` first."
        )
    return sweep_map(dataset, "attractor", ax)


def envelope(dataset: xr.Dataset, ax: Axes | None = None) -> Axes:
    """Largest radius of every window of a run, over one swept parameter, as colours.

    Across is the speed where all lanes have the same and it rises or falls throughout, else the time.
    A window ends at the time or speed that the dataset has of it, and begins where the one before it
    ends. The first is as long as the second, but begins at zero if zero lies within. Lanes without a
    result are grey.

    Args:
        dataset: sweep along `times` over one parameter, with `envelope`.
        ax: Axes to draw in; a new figure if None.

    Returns:
        The Axes, the parameter over speed or time [s].

    Raises:
        ValueError: the dataset has no `envelope`, is not over one parameter, or has too little to draw.
    """
    dim = only_swept(dataset, "envelope", ("window",))
    dataset = dataset[["envelope", "speed", "status"]].sortby(dim)
    lost = failed(dataset["status"].values)[:, None]
    radius = np.where(lost, np.nan, dataset["envelope"].transpose(dim, "window").values)
    if min(radius.shape) < 2:
        raise ValueError(
            f"An envelope needs two lanes and two windows to draw, but has {radius.shape[0]} and "
            f"{radius.shape[1]}."
        )
    speed = dataset["speed"].transpose(dim, "window").values
    changes = np.diff(speed[0])
    if np.allclose(speed, speed[0]) and (np.all(changes > 0) or np.all(changes < 0)):
        turns, label = parameter("speed", "rad/s")
        across = turns * speed[0]
    else:
        across, label = dataset["window"].values, "time [s]"
    first = 2 * across[0] - across[1]
    if first * across[0] < -1e-9 * first**2:  # zero lies within by more than rounding
        first = 0.0
    values, name = coordinate(dataset, dim)
    factor, unit = length(radius)
    ax = page.single(ax, 170, 90)
    ends = np.append(first, across), page.ends_of_cells(values)
    page.shade(ax, *ends, factor * radius, f"largest radius [{unit}]", shading="flat")
    return page.finish(ax, label, name)


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
    other.tick_params(**page.TICKS)
    return above
