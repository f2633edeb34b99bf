"""Command `report`: one HTML file of the data and pictures of a run."""

from pathlib import Path
from typing import Annotated

import typer

from ..plot.report import IMAGES, report as write
from .axis_units import units_of
from .export import opened, stores
from .options import Overwrite
from .output import draft_of


def report(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder of a run, its --out.")],
    out: Annotated[
        Path | None, typer.Option(metavar="FILE", help="File to write. [default: DIR/report.html]")
    ] = None,
    title: Annotated[str, typer.Option(help="Heading. [default: that of the data]")] = "",
    overwrite: Overwrite = False,
) -> None:
    """Write one HTML file of a run: scene, pictures, numbers, accuracy, status, versions.

    It contains all data and pictures in DIR. The file is self-contained and suited to printing.

    ```
    jaxrotor simulate limiter-rotor --keep 50 --out runs/rub
    jaxrotor report runs/rub
    ```
    """
    target = folder / "report.html" if out is None else out
    if not folder.is_dir():
        raise ValueError(f"{folder} is not a folder; give the --out of a run.")
    data = [opened([store]) for store in stores(folder)]
    pictures = sorted(path for path in folder.iterdir() if path.suffix.lower() in IMAGES)
    if not data and not pictures:
        raise ValueError(f"{folder} has no data and no pictures of a run; give its --out.")
    units = units_of(data[0].attrs if data else {})
    with draft_of(target, overwrite) as draft, units:
        write(draft, *data, figures=pictures, title=title)
