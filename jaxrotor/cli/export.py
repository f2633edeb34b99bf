"""Command `export`: data of a run for other programs."""

from pathlib import Path
from typing import Annotated, Any

import typer

from ..results.export import export as write
from ..sweeps.store import PENDING
from .options import Overwrite
from .output import draft_of


Store = Annotated[
    Path, typer.Argument(metavar="DATA", help="Data of a run: DIR/NAME.zarr, or DIR.")
]


def export(
    data: Store,
    file: Annotated[
        Path, typer.Argument(metavar="FILE", help="File to write: .csv, .parquet or .nc.")
    ],
    overwrite: Overwrite = False,
) -> None:
    """Write the data of a run as a table (CSV, Parquet) or as NetCDF.

    A table has one row per sample of a motion, per lane of a sweep, or per speed of a response or a
    Campbell diagram; column names include units.

    ```
    jaxrotor simulate limiter-rotor --keep 50 --out runs/rub
    jaxrotor export runs/rub orbit.csv
    jaxrotor sweep limiter-rotor --out runs/long
    jaxrotor export runs/long lanes.csv
    jaxrotor export runs/long/sweep.zarr long.nc
    ```
    """
    with draft_of(file, overwrite) as draft:
        write(opened(stores(data)), draft)


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
