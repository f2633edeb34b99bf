"""Clickable page: one HTML file with the diagram of a sweep and the motions behind its points."""

import base64
import gzip
import html
import json
import os
import re
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from jaxtyping import Float, Shaped

from ..core.checks import check_counts
from ..core.outcome import STATUS, failed
from ..files.draft import replacing
from ..files.toml import loads
from . import colours, report
from .labels import coordinate, ensemble, only_swept, parameter, swept, words
from .lane_kinds import Group, groups_of_lanes, groups_of_map
from .lane_motions import check_lanes, motion_of, motions_of, spread_lanes
from .marks import lines_of_stops, placing
from .units import length_unit


MOTIONS = 48  # motions of a page by default
HIGHEST = 10  # end of the frequency axis [cycles per revolution], as that of `whirl_spectrum`
SHOWN = 20  # the most revolutions of an orbit that are drawn, its last ones
SAMPLES = 128  # about the most points of an orbit that are drawn in a revolution
BINS = 1600  # heights at which points of a lane are told apart
FINE = 64  # levels in each of them
_NUMBERS = {  # shown beside a lane
    "index": "precession index",
    "winding": "winding",
    "radius_max": "largest radius",
    "radius_rms": "rms radius",
}
_TEMPLATE = Path(__file__).with_name("clickable.html")


def write_page(
    path: str | os.PathLike[str], dataset: xr.Dataset, *, motions: int = MOTIONS, title: str = ""
) -> None:
    """Write one HTML file with the diagram of a sweep, where a click shows the motion of a lane.

    Over one parameter, with any starts, the diagram is that of `bifurcation`; over two it is a map of the
    kinds of motion, as `sweep_map` draws it. It can be zoomed, and points tell their values. A click on a
    point shows orbit, whirl spectrum and Poincare section of its lane, or of the nearest lane whose motion
    is in the page. Beside them are the scene, settings, accuracy and versions. The file needs no network.

    Motions are taken from the data set if it was observed with `observe.Orbit` and
    `observe.WhirlSpectrum`; otherwise their lanes are run again, together. A chaotic lane that is run
    again follows another path on the same attractor. What a screen cannot resolve is left out: points of a
    lane that are nearer than 1/1600 of the height of the diagram, and orbits have 128 points a revolution,
    of the last 20 revolutions. Needs plotly (`pip install plotly`). An existing file is replaced.

    Args:
        path: the file, which ends in .html.
        dataset: data set of a sweep, with `extrema` and `index`, over one parameter and any starts; or
            with `duty`, `winding` or `index` over two parameters.
        motions: the most lanes whose motions are in the page, spread over the diagram; each takes as long
            as its lane has taken. With 0 there is the diagram alone.
        title: heading, by default that of the data set.

    Raises:
        ValueError: the path does not end in .html, `motions` is no whole number, plotly is not installed,
            the data set is none of `sweep` over one or two parameters, its states were carried from lane
            to lane, or its motions can be neither taken from it nor run again.
    """
    target = Path(path)
    if target.suffix != ".html":
        raise ValueError(f"The name of a page must end in .html, but is {target.name}.")
    check_counts(0, motions=motions)
    library = _library()
    check_lanes(dataset)
    factor, unit = length_unit("mm")
    starts = ensemble(dataset, "status")
    parameters = [dim for dim in swept(dataset, "status") if dim not in starts]
    dims = (*parameters, *starts)
    data = dataset.transpose(*dims, ...)
    if len(parameters) == 2 and not starts:
        data = data.sortby(parameters)
        both = parameters[0], parameters[1]
        drawn = {"kind": "map", **_groups(groups_of_map(data, both))}
    else:
        drawn = _diagram(data, starts, factor)
    shape = [data.sizes[dim] for dim in dims]
    parts = shape[: len(parameters)], shape[len(parameters) :]
    lanes = spread_lanes(*parts, motions, data["status"].values)
    content = {
        "lengthUnit": unit,
        "axes": [_axis(data, dim) for dim in dims],
        "starts": len(starts),
        "status": data["status"].values.ravel().tolist(),
        "statuses": [words(name) for name in STATUS],
        "failed": failed(data["status"].values).ravel().tolist(),
        "numbers": _numbers(data, dims),
        **drawn,
        **_motions(data, lanes, factor),
        "colours": {name: getattr(colours, name) for name in ("BLUE", "RED", "GREY", "DARK")},
    }
    texts = {
        "TITLE": html.escape(title or str(dataset.attrs.get("title", "")) or target.stem),
        "SCENE": report.scene_part(dataset.attrs["scene"]),
        "ABOUT": f"{report.numbers_part(dataset)}\n{report.versions_part([dataset])}",
        "DATA": _packed(json.dumps(content, separators=(",", ":"), allow_nan=False)),
        "LIBRARY": _packed(library),
    }
    text = re.sub("@@([A-Z]+)@@", lambda found: texts[found[1]], _TEMPLATE.read_text("utf-8"))
    with replacing(target) as draft:
        draft.write_text(text, "utf-8", newline="\n")


def _library() -> str:
    """The source of plotly.js."""
    try:
        from plotly.offline import get_plotlyjs
    except ImportError:
        raise ValueError(
            "A page that one can click is drawn by plotly, which is not installed; install it by "
            "`pip install plotly`."
        ) from None
    return get_plotlyjs()


def _packed(text: str) -> str:
    """A text in base64, compressed by gzip."""
    return base64.b64encode(gzip.compress(text.encode(), mtime=0)).decode("ascii")


# === diagram


def _axis(dataset: xr.Dataset, dim: str) -> dict[str, Any]:
    """Name, unit and values of a swept parameter in the unit drawn."""
    values, label = coordinate(dataset, dim)
    return {**_name_and_unit(label), "values": _digits(values, 8)}


def _name_and_unit(label: str) -> dict[str, str]:
    """Parts of a label "name [unit]", with its exponents in HTML."""
    name, _, unit = re.sub(r"\$\^\{(.*?)\}\$", r"<sup>\1</sup>", label).rpartition(" [")
    return {"name": name, "unit": "" if unit == "1]" else unit.removesuffix("]")}


def _numbers(dataset: xr.Dataset, dims: tuple[str, ...]) -> list[dict[str, Any]]:
    """Numbers of every lane that are told of it."""
    found = []
    for name, called in _NUMBERS.items():
        if name in dataset and dataset[name].dims == dims:
            factor, label = parameter(called, str(dataset[name].attrs["units"]))
            values = _digits(factor * dataset[name].values.ravel(), 5)
            found.append({**_name_and_unit(label), "key": name, "values": values})
    return found


def _groups(groups: list[Group]) -> dict[str, Any]:
    """Names and colours of groups of lanes, and the number of every lane's group, -1 of none."""
    number = np.full(groups[0][2].size, -1) if groups else np.zeros(0, int)
    for k, (_, _, chosen) in enumerate(groups):
        number[chosen.ravel()] = k
    named = [{"name": name, "colour": colour} for name, colour, _ in groups]
    return {"groups": named, "group": number.tolist()}


def _diagram(dataset: xr.Dataset, starts: tuple[str, ...], factor: float) -> dict[str, Any]:
    """Extrema of every lane with a result as whole levels of the height, and the precession index."""
    only_swept(dataset, "extrema", ("revolution", "extremum", *starts))
    dim = only_swept(dataset, "index", starts)
    status = dataset["status"].values.ravel()
    height = factor * dataset["extrema"].values.reshape(status.size, -1)
    height[failed(status)] = np.nan
    known = height[np.isfinite(height)]
    low, high = (known.min(), known.max()) if known.size else (0.0, 0.0)
    level = float(high - low) / (BINS * FINE) or 1.0
    points = [_told_apart((row[np.isfinite(row)] - low) / level) for row in height]
    return {
        "kind": "diagram",
        "low": float(low),
        "level": level,
        "points": points,
        **_groups(groups_of_lanes(dataset, (dim, *starts))),
    }


def _told_apart(levels: Float[np.ndarray, " e"]) -> list[int]:
    """Heights that a screen tells apart, ascending, as the first level and differences of neighbours."""
    whole = np.unique(np.rint(levels).astype(int))
    _, first = np.unique(whole // FINE, return_index=True)
    return np.diff(whole[first], prepend=0).tolist()


# === motions


def _motions(dataset: xr.Dataset, lanes: Shaped[np.ndarray, " l"], factor: float) -> dict[str, Any]:
    """Orbit, section, spectrum and stops of some lanes, lengths times a factor."""
    if not lanes.size:
        return {"motions": [], "frequency": []}
    try:
        found = motions_of(dataset, lanes)
    except ValueError as error:
        raise ValueError(f"{error} With no motions (`motions=0`) a page has the diagram.") from None
    frequency = np.asarray(found["frequency"].values)
    seen = frequency <= HIGHEST
    own = ("revolution", "axis")
    sections = found["orbit"].isel(sample=-1).transpose("lane", *own).values
    if "section" in dataset:
        stacked = dataset["section"].transpose(*dataset["status"].dims, *own).values
        sections = stacked.reshape(-1, *stacked.shape[-2:])[lanes]
    orbits = found["orbit"].transpose("lane", "revolution", "sample", "axis").values
    spectra = found["spectrum"].values[:, seen]
    radius = np.max(np.abs(orbits), where=np.isfinite(orbits), initial=0.0)
    stops = _stops(dataset, lanes, factor * float(radius), factor)
    every = max(orbits.shape[2] // SAMPLES, 1)
    motions = []
    for k in np.flatnonzero(np.isfinite(orbits).all(axis=(1, 2, 3))):
        path = factor * orbits[k, -SHOWN:]
        motion = {"lane": int(lanes[k]), "stops": stops[k], "section": _ints(factor * sections[k])}
        motion |= {"orbit": _ints(path.reshape(-1, 2)[::-1][::every][::-1])}
        motion |= {"marks": _ints(path[:, -1])}  # once a revolution
        motion["spectrum"] = _ints(spectra[k]) if np.isfinite(spectra[k]).all() else None
        motions.append(motion)
    return {"motions": motions, "frequency": _digits(frequency[seen], 6)}


def _ints(values: Float[np.ndarray, "..."]) -> dict[str, Any]:
    """Columns in whole units of 1/20000 of the largest number, each as its first and the differences."""
    unit = float(np.abs(values).max(initial=0.0)) / 20_000 or 1.0
    columns = np.rint(np.atleast_2d(values.T) / unit).astype(int)
    return {"unit": unit, "columns": np.diff(columns, prepend=0, axis=1).tolist()}


def _stops(
    dataset: xr.Dataset, lanes: Shaped[np.ndarray, " l"], radius: float, factor: float
) -> list[list[dict[str, Any]]]:
    """Lines of the stops at the station of every lane, as `orbit` draws them."""
    moved, found = placing(loads(dataset.attrs["scene"]), dataset), []
    for lane in lanes if moved else lanes[:1]:
        scene, how = motion_of(dataset, int(lane))
        found.append([])
        for name, line in lines_of_stops(scene, how["at"], radius, factor):
            points = {"x": _digits(np.real(line), 5), "y": _digits(np.imag(line), 5)}
            found[-1].append({"name": name, "colour": colours.ORANGE, **points})
    return found if moved else found * len(lanes)


def _digits(values: Any, count: int) -> list[float | None]:
    """Numbers with so many digits, None where they are undefined."""
    return [float(f"{x:.{count}g}") if np.isfinite(x) else None for x in np.ravel(values)]
