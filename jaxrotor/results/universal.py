"""Universal files (UNV): data sets as functions at nodes, for programs of vibration measurement."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from .export import column, place_text, text_of


_PLACES = ("axis", "station", "limiter", "ball", "bearing", "branch", "extremum", "state")
_ENTITIES = ("limiter", "ball", "bearing")
_DIRECTIONS = {"x": 1, "y": 2}
_TURNED = {"x": 5, "y": -4}  # of slopes and moments, about y and -x
_ABSCISSAE = {  # by their units: code, factor and name of the unit in the file, and code of the function
    "s": (17, 1.0, "s", 1),  # a time response
    "rad/s": (19, 30 / np.pi, "rpm", 0),
    "1/revolution": (20, 1.0, "order", 12),  # a spectrum
}
_ORDINATES = {  # by their units: code, exponents of length and force
    "m": (8, 1, 0),
    "m/s": (11, 1, 0),
    "m/s^2": (12, 1, 0),
    "N": (9, 0, 1),
    "N m": (9, 1, 1),
}
_UNEVEN = (
    1e-3  # distance from equal spacing, over its step, above which every point has its abscissa
)


class Function(NamedTuple):
    """Series with what a universal file says of it."""

    x: np.ndarray
    values: np.ndarray
    kind: int  # code of the function
    abscissa: tuple[int, str, str]  # code, name, unit
    ordinate: tuple[int, int, int, str, str]  # code, exponents of length and force, name, unit
    titles: Sequence[str]
    entity: str  # what has no node, such as "limiter 0"
    node: int
    direction: int


def write(data: Any, path: Path) -> None:
    """Write every variable of a data set along its abscissa as functions, in data sets 58 (binary).

    Coordinates beside the abscissa, such as the angle of rotation over time, are functions, too, and
    single values, such as that of a lane, the third line of every title. Before them are the units (164)
    and the stations as nodes along z (15). The abscissa is time, the speed in rpm, the order or the swept
    parameter.
    Source: University of Cincinnati, Universal File Formats.
    """
    stations = np.atleast_1d(
        data["station"] if "station" in data else data.attrs.get("station", [])
    )
    functions = list(_functions(data))
    if not functions:
        raise ValueError("The data have no series of two or more numbers, which a .unv file needs.")
    si = [f"{1:10d}{'SI':20s}{1:10d}", 3 * f"{1.0:25.16e}", f"{273.15:25.16e}"]
    nodes = [
        f"{number:10d}{0:10d}{0:10d}{0:10d}{0.0:13.5e}{0.0:13.5e}{at:13.5e}"
        for number, at in enumerate(stations.astype(float), 1)
    ]
    with path.open("wb") as file:
        file.write(_set("   164", [line.replace("e", "D") for line in si]))
        if nodes:
            file.write(_set("    15", nodes))
        for one in functions:
            file.write(_of_function(one))


def _set(head: str, lines: Sequence[str], content: bytes = b"") -> bytes:
    """A data set, of lines and then perhaps of bytes."""
    text = "\n".join(["    -1", head, *lines, ""])
    return text.encode("ascii", "replace") + content + b"    -1\n"


def _of_function(one: Function) -> bytes:
    """Data set 58 of a function in binary form; points equally spaced have no abscissa of their own."""
    equal = np.linspace(one.x[0], one.x[-1], one.x.size)
    even = bool(np.abs(one.x - equal).max() < _UNEVEN * abs(equal[1] - equal[0]))
    parts = [one.values]
    if np.iscomplexobj(one.values):
        parts = [np.real(one.values), np.imag(one.values)]
    content = np.stack(parts if even else [one.x, *parts], axis=1).astype("<f8").tobytes()
    start, step = (one.x[0], equal[1] - equal[0]) if even else (0.0, 0.0)
    code, name, unit = one.abscissa
    axis = lambda code, length, force, name, unit: (
        f"{code:10d}{length:5d}{force:5d}{0:5d} {name[:20]:20s} {unit[:20]:20s}"
    )
    lines = [f"{title[:80] or 'NONE':80s}" for title in one.titles]
    lines += [
        f"{one.kind:5d}{0:10d}{0:5d}{0:10d} {one.entity[:10]:10s}{one.node:10d}{one.direction:4d}"
        f" {'NONE':10s}{0:10d}{0:4d}",
        f"{2 + 2 * len(parts):10d}{one.x.size:10d}{even:10d}{start:13.5e}{step:13.5e}{0.0:13.5e}",
        axis(code, 0, 0, name, unit),
        axis(*one.ordinate),
        *[axis(0, 0, 0, "NONE", "NONE")] * 2,
    ]
    size = f"{len(lines):12d}{len(content):12d}"
    return _set(f"    58b{1:6d}{2:6d}{size}{0:6d}{0:6d}{0:12d}{0:12d}", lines, content)


def _functions(data: Any) -> Iterator[Function]:
    """Functions of all variables, one for each place along the dimensions that are no abscissa."""
    beside = {name: one for name, one in data.coords.items() if name not in data.dims}
    for name, array in {**data.data_vars, **beside}.items():
        along = [dim for dim in array.dims if dim not in _PLACES]
        if not along or array.dtype.kind not in "fc":
            continue
        x, kind, abscissa = _abscissa(data, str(along[-1]))
        others = [dim for dim in array.dims if dim != along[-1]]
        rows = array.transpose(*others, along[-1]).values
        for index in np.ndindex(rows.shape[:-1]):
            place = dict(zip(others, index, strict=True))
            good = np.isfinite(rows[index]) & np.isfinite(x)
            if good.sum() > 1:
                about = _about(data, str(name), array, place)
                yield Function(x[good], rows[index][good], kind, abscissa, *about)


def _abscissa(data: Any, dim: str) -> tuple[np.ndarray, int, tuple[int, str, str]]:
    """Values along a dimension, code of functions of it, and its own code, name and unit."""
    values = data[dim].values
    if values.dtype.kind not in "iuf":
        values = np.arange(values.size)
    given = str(data[dim].attrs.get("units", "1"))
    code, factor, unit, kind = _ABSCISSAE.get(given, (1, 1.0, given, 0))
    return factor * values.astype(float), kind, (code, dim, unit)


def _about(data: Any, name: str, array: Any, place: Mapping[Any, int]) -> tuple[Any, ...]:
    """Ordinate, titles, entity, node and direction of a function."""
    unit = str(array.attrs.get("units", "1"))
    titles = [column(name, array, place, data), str(array.attrs.get("long_name", name))]
    values = [f"{key} = {text_of(one)}" for key, one in data.coords.items() if not one.dims]
    titles += [", ".join(sorted(values))]
    titles += [str(data.attrs.get("title", "")), ""]
    owner = next((dim for dim in place if dim in _ENTITIES), None)
    entity = "NONE" if owner is None else place_text(str(owner), place[owner], data)
    node = place.get("station", 0 if "station" in data.attrs else -1) + 1
    axis = str(data["axis"].values[place["axis"]]) if "axis" in place else ""
    direction = (_TURNED if unit in ("rad", "N m") else _DIRECTIONS).get(axis, 0)
    ordinate = (*_ORDINATES.get(unit, (1, 0, 0)), name, unit)
    return ordinate, titles, entity.removeprefix("of "), node, direction
