"""Command `simulate`: one motion in time."""

from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from ..files.toml import study
from ..motion.history import TimeHistory
from ..motion.simulate import simulate as run
from ..results.dataset import dataset
from ..spins import ConstantSpeed
from . import answer
from .axis_units import axis_units, written_in
from .contacts import contact_rows, forces_of
from .options import (
    MOST,
    SAMPLES,
    STILL,
    Angle,
    AsJson,
    At,
    Nodes,
    Overwrite,
    Period,
    Radius,
    Rate,
    SceneName,
    Settings,
    Steps,
    Times,
    Tolerance,
    count_or_auto,
    instants,
    moving_station,
    optional,
    refuse_revolutions,
    scene_with,
    start_with,
)
from .output import draft_or_none, draw, write_dataset, written_to
from .solver import NAMED, Solver, chosen


REVOLUTIONS = 100  # by default
_FILES = ("response.zarr", "orbit.png", "history.png")


def simulate(
    scene: SceneName,
    settings: Settings = None,
    revolutions: Annotated[
        int | None,
        typer.Option(min=1, max=MOST, help="Revolutions at constant speed. [default: 100]"),
    ] = None,
    keep: Annotated[
        int | None,
        typer.Option(min=1, max=MOST, help="Revolutions observed, at the end. [default: all]"),
    ] = None,
    times: Times = None,
    steps: Steps = None,
    nodes: Nodes = None,
    tolerance: Tolerance = 1e-3,
    solver: Annotated[
        Solver | None,
        typer.Option(help=f"{NAMED} [default: exponential2 where it can be taken]"),
    ] = None,
    start_radius: Radius = None,
    start_rate: Rate = None,
    start_angle: Angle = None,
    at: At = None,
    period: Period = None,
    out: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Folder for response.zarr, orbit.png and history.png."),
    ] = None,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """Simulate one motion in time: radius, whirl and contact; with --out, data and pictures.

    A scene of constant speed runs by whole revolutions. Any other runs to the end of its speed profile or
    near the steady speed of its drive, unless --times are given.

    ```
    jaxrotor simulate limiter-rotor --revolutions 500 --keep 50 --out run
    jaxrotor simulate limiter-rotor --start-radius 12mm --start-rate=-441rad/s --steps 1024
    jaxrotor simulate limiter-rotor --set unbalance.eccentricity=0.5mm --solver kvaerno5
    jaxrotor simulate turbine-run-up --times 0:20s:2001
    ```
    """
    rotor, table = scene_with(scene, settings), study(scene)
    moves = moving_station(rotor)
    options: dict[str, Any] = {
        "solver": chosen(solver),
        "start": start_with(table, start_radius, start_rate, start_angle),
        "nodes": count_or_auto(nodes, "--nodes"),
        "tolerance": tolerance,
        "at": moves if at is None else optional(at, "m", "--at"),
    }
    if times is None and isinstance(rotor.spin, ConstantSpeed):
        samples = count_or_auto(steps, "--steps") or table.get("steps_per_revolution", 256)
        options |= {"revolutions": revolutions or REVOLUTIONS, "steps_per_revolution": samples}
        options |= {"keep": keep, "period": optional(period, "s", "--period")}
    else:
        given = {"--revolutions": revolutions, "--keep": keep, "--steps": steps, "--period": period}
        refuse_revolutions(given)
        options["times"] = instants(rotor, None, SAMPLES, times)
    units = axis_units(scene, rotor, *settings or (), start_radius)
    with draft_or_none(out, _FILES, overwrite) as folder:
        response = run(rotor, **options)
        if folder is not None:
            write_dataset(dataset(response), folder / "response.zarr", units)
            _draw(response, folder, units)
    summary = _summary(response)
    answer.note_large(float(summary["radius_max"]), float(rotor.shaft.length))
    written = written_to(out, _FILES)
    if as_json:
        answer.print_json({"scene": scene, **summary, "written": written})
        return
    index = summary["index"]
    least, most = summary["radius_min"], summary["radius_max"]
    factor, unit = written_in(units, "m", most, rotor)
    between = f"{factor * least:.6g} to {factor * most:.6g} {unit}"
    rows = [
        ("radius", STILL if moves is None else between),
        ("precession index", "undefined: at rest" if np.isnan(index) else f"{index:.6g}"),
    ]
    rows += contact_rows(response, skip=1)
    rows += answer.written(written)
    typer.echo(f"{response}")
    answer.print_table(rows)


def _draw(response: TimeHistory, folder: Path, units: dict[str, Any]) -> None:
    from .. import plot

    def history(axes):
        if response.steps_per_revolution is None:
            plot.run_up(response, axes=axes)
            return
        plot.history(response, ax=axes[0])
        plot.whirl_history(response, ax=axes[1])
        axes[0].set_xlabel("")

    draw(folder / "orbit.png", lambda ax: plot.orbit(response, ax=ax), 85, 85, units=units)
    draw(folder / "history.png", history, 170, 110, rows=2, units=units)


def _summary(response: TimeHistory) -> dict[str, Any]:
    """Radius, whirl and contacts at the first station, without the sample at the start."""
    z, velocity = (np.asarray(a)[1:, 0] for a in (response.displacement, response.velocity))  # (T,)
    radius, speed = np.abs(z), np.asarray(response.speed)[1:]
    moving = bool((radius > 0).all() and (speed != 0).all())
    whirl = np.mean(np.imag(np.conj(z) * velocity) / radius**2 / speed) if moving else np.nan
    return {
        "speed": speed[-1],
        "station": response.stations[0],
        "radius_min": radius.min(),
        "radius_max": radius.max(),
        "index": float(whirl),
        "contacts": [
            {"duty": np.mean(f > 0), "peak_force": f.max()} for f in forces_of(response, skip=1)
        ],
    }
