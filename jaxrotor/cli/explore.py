"""Command `explore`: interactive view of a sweep."""

from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from .axis_units import units_of
from .export import Store, opened, stores
from .options import Overwrite
from .output import draft_of


def explore(
    data: Store,
    at: Annotated[
        float | None,
        typer.Option(help="Value on the axis of the diagram to show at first."),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Picture to write instead of opening a window."),
    ] = None,
    html: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Page to write, which a browser shows without network."),
    ] = None,
    motions: Annotated[
        int | None,
        typer.Option(
            help="Most motions in the page, each computed like a lane of the sweep. [default: 48]"
        ),
    ] = None,
    overwrite: Overwrite = False,
) -> None:
    """Explore a sweep: click a point of its bifurcation diagram to see its orbit and spectrum.

    The left and right arrow keys select the neighbours. Motions are recomputed; the first takes some
    seconds. With --html it is a page to keep and send, also of a map over two parameters; it needs
    `pip install plotly`.

    ```
    jaxrotor sweep limiter-rotor --out runs/long
    jaxrotor explore runs/long
    jaxrotor explore runs/long --at 0.5 --out half.png
    jaxrotor explore runs/long --html long.html
    ```
    """
    if html is not None:
        if at is not None or out is not None:
            raise ValueError("--html writes a page of all lanes; leave out --at and --out.")
        from ..plot.clickable import MOTIONS, write_page

        most = MOTIONS if motions is None else motions
        lanes = opened(stores(data))
        with draft_of(html, overwrite) as draft, units_of(lanes.attrs):
            write_page(draft, lanes, motions=most)
        return
    if motions is not None:
        raise ValueError("--motions is for a page; add --html FILE, or leave it out.")
    from ..plot.explore import explore as window

    lanes = opened(stores(data))
    with units_of(lanes.attrs):
        explorer = window(lanes)
        if at is not None:
            if not np.isfinite(at):
                raise ValueError(
                    f"--at must be a number on the axis of the diagram, but is {at:g}."
                )
            explorer.show(explorer.near(explorer.lower, at, 0.0))
        if out is None:
            explorer.wait()
            return
        with draft_of(out, overwrite) as draft:
            try:
                explorer.figure.savefig(draft, dpi=150)
            except ValueError as error:
                raise ValueError(f"--out {out}: {error}.") from None
