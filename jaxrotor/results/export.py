"""Export: results for other programs, as tables (CSV, Parquet) and as NetCDF."""

import importlib.util
import itertools
import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..files.draft import replacing


_NEEDS = {".csv": (), ".parquet": ("pyarrow",), ".nc": ("h5netcdf", "h5py")}
_NAMED = {"station": "at {} m", "bearing": "of {}"}  # of others their number


def table(result: Any) -> Any:
    """A result as a `pandas.DataFrame`: a row a sample or a row a lane, units in the names of columns.

    Of a motion `time [s]`, `angle [rad]`, `displacement x at 0.7 m [m]`, and so on: all that `jr.dataset`
    has of a time, every vector by its x and y. Of a sweep what was swept, the numbers of every lane, its
    status in words; series within a lane, such as its section, are in its data set alone.

    Args:
        result: what `simulate`, `run_up`, `reactions`, `sweep` or `dataset` return, or a part of it.
    """
    import pandas as pd

    data = data_of(result)
    if "time" not in data.dims and "status" in data:
        return pd.DataFrame(_lanes(data))
    if "time" not in data.dims:
        raise ValueError(
            "A table has a row a sample or a row a lane, but the data have neither `time` nor `status`; "
            "write them to a .nc file."
        )
    columns: dict[str, Any] = {}
    names = ["time", *(name for name in data.coords if name != "time"), *data.data_vars]
    for name in names:
        one = data[name]
        if "time" in one.dims and np.issubdtype(one.dtype, np.number):
            columns |= _columns(str(name), one.transpose("time", ...), data)
    return pd.DataFrame(columns)


def export(result: Any, path: str | os.PathLike[str]) -> None:
    """Write a result to `.csv`, `.parquet` or `.nc`, whole or not at all; a file there is replaced.

    A table is that of `jr.table`. NetCDF holds any data set, of a sweep too, with units, scene and
    versions as attributes: `xarray.open_dataset(path, engine="h5netcdf")` reads it, and any program
    that knows NetCDF 4. Parquet and NetCDF need packages of their own: `pip install 'jaxrotor[export]'`.

    Args:
        result: what `simulate`, `run_up`, `reactions` and `sweep` return, or any `xarray.Dataset`.
        path: the file; its ending says the format.
    """
    target = Path(path)
    if target.suffix not in _NEEDS:
        raise ValueError(f"A file to export to ends in {', '.join(_NEEDS)}, but is {target.name}.")
    for needed in _NEEDS[target.suffix]:
        if importlib.util.find_spec(needed) is None:
            raise ValueError(
                f"Writing {target.suffix} needs the package {needed}, which is not installed; add it by "
                "`pip install 'jaxrotor[export]'`, or write .csv."
            )
    with replacing(target) as draft:
        _write(result, draft)


def _write(result: Any, draft: Path) -> None:
    match draft.suffix:
        case ".csv":
            table(result).to_csv(draft, index=False)
        case ".parquet":
            table(result).to_parquet(draft, index=False)
        case _:
            _storable(data_of(result)).to_netcdf(draft, engine="h5netcdf")


def data_of(result: Any) -> Any:
    """The data set of a result, which may be one already."""
    import xarray as xr

    from .dataset import dataset

    return result if isinstance(result, xr.Dataset) else dataset(result)


def _lanes(data: Any) -> dict[str, Any]:
    """Columns of the lanes of a sweep, also of what one value was chosen of."""
    if not data["status"].dims:
        data = data.expand_dims("only")
    status = data["status"]
    swept = np.meshgrid(*(data[dim].values for dim in status.dims), indexing="ij")
    columns: dict[str, Any] = {}
    for name, one in data.coords.items():
        if ("." in str(name) or name == "branch") and name not in status.dims:
            columns[_head(str(name), one)] = np.broadcast_to(one.values, status.shape).ravel()
    for dim, values in zip(status.dims, swept, strict=True):
        if dim in data.coords:
            columns[_head(str(dim), data[dim])] = values.ravel()
    words = str(status.attrs["flag_meanings"]).split()
    columns["status"] = [words[number] for number in status.values.ravel()]
    for name, one in data.data_vars.items():
        rest = set(one.dims) - set(status.dims)
        if name != "status" and set(status.dims) <= set(one.dims) and rest <= {"limiter"}:
            lanes = one.stack(lane=status.dims, create_index=False).transpose("lane", ...)
            columns |= _columns(str(name), lanes, data)
    return columns


def _head(name: str, one: Any) -> str:
    unit = one.attrs.get("units", "1")
    return name if unit == "1" else f"{name} [{unit}]"


def _columns(name: str, one: Any, data: Any) -> dict[str, Any]:
    """Columns of a variable, by what names its other dimensions."""
    sizes = [range(size) for size in one.shape[1:]]
    found = {}
    for index in itertools.product(*sizes):
        places = [_place(str(dim), i, data) for dim, i in zip(one.dims[1:], index, strict=True)]
        parts = [name, *sorted(places, key=lambda place: place not in ("x", "y"))]
        found[_head(" ".join(parts), one)] = np.asarray(one.values[(slice(None), *index)])
    return found


def _place(dim: str, i: int, data: Any) -> str:
    label = data[dim].values[i] if dim in data.coords else i
    if dim == "axis":
        return str(label)
    text = f"{label:.9g}" if isinstance(label, float) else str(label)
    return _NAMED[dim].format(text) if dim in _NAMED else f"of {dim} {text}"


def _storable(data: Any) -> Any:
    """The data with attributes that a NetCDF file can hold, and as it is stored nowhere else."""
    data = data.drop_encoding()
    data.attrs = _plain(data.attrs)
    for one in data.variables.values():
        one.attrs = _plain(one.attrs)
        if (
            "flag_values" in one.attrs and one.dtype.kind in "iu"
        ):  # of the variable's own kind, or nobody decodes them
            one.attrs["flag_values"] = one.attrs["flag_values"].astype(one.dtype)
    return data


def _plain(attrs: Mapping[Any, Any]) -> dict[str, Any]:
    """Texts, numbers and lists of numbers as they are; all else as JSON."""

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
