"""Command `export`: data of a run for other programs."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from ..core.outcome import STATUS
from ..files.units import quantity
from ..results.export import export as write, text_of
from ..sweeps.store import PENDING
from . import answer
from .options import Overwrite, assignments
from .output import draft_of


Store = Annotated[
    Path, typer.Argument(metavar="DATA", help="Data of a run: DIR/NAME.zarr, or DIR.")
]


def export(
    data: Store,
    file: Annotated[
        Path,
        typer.Argument(metavar="FILE", help="File to write: .csv, .parquet, .nc, .mat or .unv."),
    ],
    lane: Annotated[
        list[str] | None,
        typer.Option(
            metavar="PATH=VALUE",
            help="Lane of a sweep to write: the one nearest to this value; may be repeated.",
        ),
    ] = None,
    of: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME",
            help="Variable to write, as section, spectrum or orbit of a lane; may be repeated.",
        ),
    ] = None,
    overwrite: Overwrite = False,
) -> None:
    """Write the data of a run as a table (CSV, Parquet), as NetCDF, for MATLAB or as a universal file.

    A table has one row per sample of a motion, per lane of a sweep, or per speed of a response or a
    Campbell diagram; column names include units. A series of one lane of a sweep is a table, too: its
    section, and its orbit and whirl spectrum, which are computed again if the sweep did not keep them.

    ```
    jaxrotor simulate limiter-rotor --keep 50 --out runs/rub
    jaxrotor export runs/rub orbit.csv
    jaxrotor export runs/rub orbit.mat
    jaxrotor sweep limiter-rotor --out runs/long
    jaxrotor export runs/long lanes.csv
    jaxrotor export runs/long/sweep.zarr long.nc
    jaxrotor export runs/long lane.csv --lane unbalance.eccentricity=0.4mm --of orbit
    ```
    """
    found = opened(stores(data))
    if lane:
        found = _lane(found, lane, of or ())
    if of:
        if missing := [name for name in of if name not in found.data_vars]:
            names = ", ".join(map(str, found.data_vars))
            again = missing[0] in ("orbit", "spectrum") and "status" in found and not lane
            hint = "; --lane PATH=VALUE computes it again for one lane" * again
            raise ValueError(f"--of {missing[0]} is not in {data}, which has {names}{hint}.")
        found = found[list(of)]
    with draft_of(file, overwrite) as draft:
        write(found, draft)


def _lane(data: Any, given: Sequence[str], of: Sequence[str]) -> Any:
    """The lane of a sweep nearest to some values, or its orbit or spectrum if these are computed again."""
    if "status" not in data:
        raise ValueError(
            "--lane is for the data of a sweep, but these have no lanes; leave it out."
        )
    place = _place(data, given)
    number = int(np.ravel_multi_index(tuple(place.values()), data["status"].shape))
    lane = data.isel(place)
    values = {name: lane[name] for name in _swept(data)}
    told = [f"{name} = {text_of(one)}" for name, one in values.items()]
    told += [f"status {STATUS[int(lane['status'])]}"]
    answer.note(f"lane {number + 1} of {data['status'].size}: {', '.join(told)}.")
    again = [name for name in of if name in ("orbit", "spectrum") and name not in data]
    if not again:
        return lane
    if others := [name for name in of if name not in again]:
        raise ValueError(
            f"--of {again[0]} is computed again; write it without {', '.join(others)}."
        )
    from ..plot.lane_motions import check_lanes, motions_of

    check_lanes(data)
    motion = motions_of(data, np.array([number])).isel(lane=0, drop=True)[again]
    return motion.assign_attrs(data.attrs).assign_coords(values)


def _place(data: Any, given: Sequence[str]) -> dict[Any, int]:
    """Numbers along the dimensions of lanes of the values that are nearest to those given."""
    dims, place = data["status"].dims, {}
    swept = _swept(data)
    for path, text in assignments("--lane", given, "spin.speed=3000rpm").items():
        if path not in swept:
            raise ValueError(f"--lane {path} is not swept; swept are {', '.join(swept)}.")
        values = data[path].values
        if values.dtype.kind in "fiu":
            unit = str(data[path].attrs.get("units", "1"))
            off = np.abs(values - quantity(text, unit, f"--lane {path}"))
        else:
            off = values.astype(str) != text
            if off.all():
                raise ValueError(
                    f"--lane {path} must be one of {', '.join(values)}, but is {text!r}."
                )
        place[data[path].dims[0]] = int(off.argmin())
    for dim in dims:
        if dim not in place and data.sizes[dim] > 1:
            raise ValueError(f"--lane names no {dim}, which is swept, too; add --lane {dim}=VALUE.")
    return {dim: place.get(dim, 0) for dim in dims}


def _swept(data: Any) -> list[str]:
    """Names of the coordinates of lanes, in the order of their dimensions."""
    dims = data["status"].dims
    found = [str(name) for name, one in data.coords.items() if set(one.dims) & set(dims)]
    return sorted(found, key=lambda name: dims.index(data[name].dims[0]))


def stores(data: Path) -> list[Path]:
    """Stores of a run: the path itself if it is one, else those in the folder."""
    if data.suffix == ".zarr":
        return [data]
    return sorted(data.glob("*.zarr"))


def opened(found: list[Path]) -> Any:
    """The data of one store."""
    import xarray as xr

    if len(found) != 1:
        names = ", ".join(str(path) for path in found) or "none"
        raise ValueError(f"DATA must be one store, DIR/NAME.zarr, but there are: {names}.")
    try:
        data = xr.open_zarr(found[0], chunks=None)
    except (OSError, ValueError, KeyError):
        raise ValueError(
            f"{found[0]} does not contain the data of a run; give the folder of an --out."
        ) from None
    if "status" in data and (missing := int((data["status"] == PENDING).sum())):
        raise ValueError(
            f"{found[0]} is unfinished: {missing} of {data['status'].size} lanes are not computed; run "
            "the same `jaxrotor sweep` to complete it."
        )
    return data
