"""Export: results for other programs, as tables (CSV, Parquet), NetCDF, MATLAB and universal files."""

import importlib.util
import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..files.draft import replacing


_NEEDS = {
    ".csv": (),
    ".parquet": ("pyarrow",),
    ".nc": ("h5netcdf", "h5py"),
    ".mat": (),
    ".unv": (),
}
_PLACES = {"station": "at {} m", "bearing": "of {}"}  # other dimensions: "of ball 1"


def table(result: Any) -> Any:
    """A result as a `pandas.DataFrame`: a row a sample, a lane or a speed, units in names of columns.

    The table of a motion has `time [s]`, `angle [rad]`, `displacement x at 0.7 m [m]`, and so on: all
    that `jr.dataset` has along time, every vector by its x and y. The table of a sweep has the swept
    values, the numbers of every lane, and its status in words. A series within one lane is a table by
    itself: `lane[["section"]]` has a row a revolution, `lane[["spectrum"]]` a row a frequency, and
    `lane[["orbit"]]` a row a sample. Data that a command has written over a speed or over the parameters
    of a map have a row for each of their points: `speed [rad/s]`, `amplitude at 0.7 m [m]`.

    Args:
        result: what `simulate`, `run_up`, `reactions`, `sweep` or `dataset` return, or a part of it, or
            the data set of a command.

    Returns:
        The table.

    Raises:
        ValueError: if the data are single numbers, which make no rows.
    """
    import pandas as pd

    data = along_turns(data_of(result))
    if "time" not in data.dims:
        return pd.DataFrame(_points(data))
    columns: dict[str, Any] = {}
    names = ["time", *(name for name in data.coords if name != "time"), *data.data_vars]
    for name in names:
        array = data[name]
        if "time" in array.dims and np.issubdtype(array.dtype, np.number):
            columns |= _columns(str(name), array.transpose("time", ...), data)
    return pd.DataFrame(columns)


def export(result: Any, path: str | os.PathLike[str]) -> None:
    """Write a result to `.csv`, `.parquet`, `.nc`, `.mat` or `.unv`, whole or not at all.

    A file there is replaced. The table is that of `jr.table`. NetCDF holds any data set, also that of a
    sweep, with units, scene and versions as attributes: `xarray.open_dataset(path, engine="h5netcdf")`
    reads it, and any program that knows NetCDF 4. So does a file of MATLAB, where
    `variables.displacement.units` is the unit of `displacement`, and dots in names are `_`.

    A universal file has every series as a function (data set 58) of time, speed in rpm, order or a swept
    parameter, at the number of its station from 1 and along x (1) or y (2); slopes and moments turn about
    y (5) or -x (-4). Start and spacing of equal steps have six digits there. Points without a value are
    left out. Parquet needs `pip install pyarrow`, NetCDF `pip install h5netcdf h5py`.

    Args:
        result: what `simulate`, `run_up`, `reactions` and `sweep` return, or any `xarray.Dataset`.
        path: the file; its ending gives the format.

    Raises:
        ValueError: if the ending is none of these, a package that the format needs is not installed, or
            the file cannot be written.
    """
    target = Path(path)
    if target.suffix not in _NEEDS:
        raise ValueError(f"A file to export to ends in {', '.join(_NEEDS)}, but is {target.name}.")
    for needed in _NEEDS[target.suffix]:
        if importlib.util.find_spec(needed) is None:
            raise ValueError(
                f"Writing {target.suffix} needs the package {needed}, which is not installed; add it by "
                f"`pip install {' '.join(_NEEDS[target.suffix])}`, or write .csv."
            )
    with replacing(target) as draft:
        _write(result, draft)


def _write(result: Any, draft: Path) -> None:
    """Write a result in the format that the ending of the file names."""
    from . import matlab, universal

    match draft.suffix:
        case ".csv":
            table(result).to_csv(draft, index=False)
        case ".parquet":
            table(result).to_parquet(draft, index=False)
        case ".mat":
            matlab.write(data_of(result), draft)
        case ".unv":
            universal.write(along_turns(data_of(result)), draft)
        case _:
            _storable(data_of(result)).to_netcdf(draft, engine="h5netcdf")


def data_of(result: Any) -> Any:
    """The data set of a result, which may be one already."""
    import xarray as xr

    from .dataset import dataset

    return result if isinstance(result, xr.Dataset) else dataset(result)


def along_turns(data: Any) -> Any:
    """The data with the samples of all revolutions of an orbit along `turns`, at the end of each step."""
    if not {"revolution", "sample"} <= set(data.dims):
        return data
    samples = data.sizes["sample"]
    turns = (1 + np.arange(data.sizes["revolution"] * samples)) / samples
    about = {"units": "1", "long_name": "revolutions observed"}
    sampled = [name for name, array in data.data_vars.items() if "sample" in array.dims]
    stacked = data[sampled].stack(turns=("revolution", "sample"), create_index=False)
    return data.drop_vars(sampled).merge(stacked.assign_coords(turns=("turns", turns, about)))


def _points(data: Any) -> dict[str, Any]:
    """Columns of data over a speed, over parameters or over lanes, of which one may be selected."""
    sweep, dims = "status" in data, _swept(data)
    if not dims:
        data, dims = data.expand_dims("only"), ("only",)
    shape = tuple(data.sizes[dim] for dim in dims)
    columns: dict[str, Any] = {}
    for name, array in data.coords.items():
        if not array.dims and ("." in str(name) or name == "branch"):
            columns[_head(str(name), array)] = np.broadcast_to(array.values, shape).ravel()
    index = dict(zip(dims, np.indices(shape), strict=True))
    for name, array in data.coords.items():
        if array.dims and set(array.dims) <= set(dims) and (name in dims or not sweep):
            values = array.values[tuple(index[dim] for dim in array.dims)]
            columns[_head(str(name), array)] = values.ravel()
    if sweep:
        words = str(data["status"].attrs["flag_meanings"]).split()
        columns["status"] = [words[number] for number in data["status"].values.ravel()]
    for name, array in data.data_vars.items():
        rest = set(array.dims) - set(dims)
        if name != "status" and set(dims) <= set(array.dims) and (not sweep or rest <= {"limiter"}):
            rows = array.stack(point=dims, create_index=False).transpose("point", ...)
            columns |= _columns(str(name), rows, data)
    return columns


def _swept(data: Any) -> tuple[Any, ...]:
    """Dimensions whose points are rows: those of the lanes, else those with numbers, else the first."""
    if "status" in data:
        return data["status"].dims
    numbers = {
        dim: np.issubdtype(data[dim].dtype, np.number) for dim in data.dims if dim in data.coords
    }
    found = (
        tuple(dim for dim in numbers if numbers[dim] and dim not in _PLACES) or tuple(data.dims)[:1]
    )
    if not found:
        raise ValueError(
            "A table has rows, but the data are single numbers; write them to a .nc file."
        )
    return found


def _head(name: str, array: Any) -> str:
    """Head of a column: a name, with the unit of the array where it has one."""
    unit = array.attrs.get("units", "1")
    return name if unit == "1" else f"{name} [{unit}]"


def _columns(name: str, array: Any, data: Any) -> dict[str, Any]:
    """Columns of a variable: one for every place along its dimensions but the first."""
    columns = {}
    for index in np.ndindex(array.shape[1:]):
        place = dict(zip(array.dims[1:], index, strict=True))
        columns[column(name, array, place, data)] = np.asarray(array.values[(slice(None), *index)])
    return columns


def text_of(value: Any) -> str:
    """A single value of a data set with its unit."""
    if value.dtype.kind not in "fiu":
        return str(value.item())
    unit = value.attrs.get("units", "1")
    return f"{value.item():.9g}" + (f" {unit}" if unit != "1" else "")


def column(name: str, array: Any, place: Mapping[Any, int], data: Any) -> str:
    """Head of the column of a variable at a place: "displacement x at 0.7 m [m]"."""
    places = [place_text(str(dim), i, data) for dim, i in place.items()]
    return _head(" ".join([name, *sorted(places, key=lambda one: one not in ("x", "y"))]), array)


def place_text(dim: str, i: int, data: Any) -> str:
    """A place along a dimension in words: "x", "at 0.7 m", "of ball 1"."""
    label = data[dim].values[i] if dim in data.coords else i
    if dim == "axis":
        return str(label)
    text = f"{label:.9g}" if isinstance(label, float) else str(label)
    return _PLACES[dim].format(text) if dim in _PLACES else f"of {dim} {text}"


def _storable(data: Any) -> Any:
    """The data with attributes that a NetCDF file can hold, without the encoding of another format."""
    data = data.drop_encoding()
    data.attrs = plain_attributes(data.attrs)
    for array in data.variables.values():
        array.attrs = plain_attributes(array.attrs)
        # Readers decode flags only where their values have the type of the variable.
        if "flag_values" in array.attrs and array.dtype.kind in "iu":
            array.attrs["flag_values"] = array.attrs["flag_values"].astype(array.dtype)
    return data


def plain_attributes(attrs: Mapping[Any, Any]) -> dict[str, Any]:
    """Attributes with texts, numbers and lists of numbers as they are, and all else as JSON."""

    def plain(value: Any) -> Any:
        if isinstance(value, str | np.ndarray | np.number):
            return value
        if value is None or isinstance(value, bool):
            return json.dumps(value)
        if isinstance(value, int | float):
            return value
        if isinstance(value, list | tuple) and np.asarray(value).dtype.kind in "if":
            return np.asarray(value)
        return json.dumps(value, default=str)

    return {str(name): plain(value) for name, value in attrs.items()}
