"""Command `simulate`: one motion in time."""

import enum
from pathlib import Path
from typing import Annotated, Any

import diffrax as dfx
import numpy as np
import typer

from ..files.toml import study
from ..motion.history import TimeHistory
from ..motion.simulate import simulate as run
from ..results.dataset import dataset
from ..solvers import Exponential
from . import answer
from .options import (
    MOST,
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
    Tolerance,
    count_or_auto,
    optional,
    scene_with,
    start_with,
)
from .output import draft, draw, write_dataset, written_to


_FILES = ("response.zarr", "orbit.png", "history.png")


class Solver(enum.StrEnum):
    """Names of solvers: those of this package, and those of diffrax in lower case."""

    exponential2 = "exponential2"
    exponential4 = "exponential4"
    kvaerno3 = "kvaerno3"
    kvaerno4 = "kvaerno4"
    kvaerno5 = "kvaerno5"
    kencarp3 = "kencarp3"
    kencarp4 = "kencarp4"
    kencarp5 = "kencarp5"
    tsit5 = "tsit5"
    dopri5 = "dopri5"
    dopri8 = "dopri8"


_SOLVERS = {
    Solver.exponential2: lambda: Exponential(2),
    Solver.exponential4: lambda: Exponential(4),
    Solver.kvaerno3: dfx.Kvaerno3,
    Solver.kvaerno4: dfx.Kvaerno4,
    Solver.kvaerno5: dfx.Kvaerno5,
    Solver.kencarp3: dfx.KenCarp3,
    Solver.kencarp4: dfx.KenCarp4,
    Solver.kencarp5: dfx.KenCarp5,
    Solver.tsit5: dfx.Tsit5,
    Solver.dopri5: dfx.Dopri5,
    Solver.dopri8: dfx.Dopri8,
}


def simulate(
    scene: SceneName,
    settings: Settings = None,
    revolutions: Annotated[int, typer.Option(min=1, max=MOST, help="Duration of the run.")] = 100,
    keep: Annotated[
        int | None,
        typer.Option(min=1, max=MOST, help="Revolutions observed, at the end. [default: all]"),
    ] = None,
    steps: Steps = None,
    nodes: Nodes = None,
    tolerance: Tolerance = 1e-3,
    solver: Annotated[
        Solver, typer.Option(help="Exponential of order 2 or 4, or a diffrax solver.")
    ] = Solver.exponential2,
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

    jaxrotor simulate limiter-rotor --revolutions 500 --keep 50 --out run
    jaxrotor simulate limiter-rotor --start-radius 12mm --start-rate=-441rad/s --steps 1024
    jaxrotor simulate limiter-rotor --set unbalance.eccentricity=0.5mm --solver kvaerno5
    """
    rotor, table = scene_with(scene, settings), study(scene)
    options: dict[str, Any] = {
        "solver": _SOLVERS[solver](),
        "start": start_with(table, start_radius, start_rate, start_angle),
        "keep": keep,
        "nodes": count_or_auto(nodes, "--nodes"),
        "tolerance": tolerance,
        "at": optional(at, "m", "--at"),
        "period": optional(period, "s", "--period"),
    }
    samples = count_or_auto(steps, "--steps") or table.get("steps_per_revolution", 256)
    if out is None:
        response = run(rotor, revolutions, samples, **options)
    else:
        with draft(out, _FILES, overwrite) as folder:
            response = run(rotor, revolutions, samples, **options)
            write_dataset(dataset(response), folder / "response.zarr")
            _draw(response, folder)
    summary = _summary(response)
    answer.note_large(float(summary["radius_max"]), float(rotor.shaft.length))
    written = written_to(out, _FILES)
    if as_json:
        answer.print_json({"scene": scene, **summary, "written": written})
        return
    index = summary["index"]
    rows = [
        ("radius", f"{summary['radius_min']:.6g} to {summary['radius_max']:.6g} m"),
        ("precession index", "undefined: at rest" if np.isnan(index) else f"{index:.6g}"),
    ]
    rows += [
        (f"contact {i}", f"{contact['duty']:.2%} of the time, up to {contact['peak_force']:.5g} N")
        for i, contact in enumerate(summary["contacts"])
    ]
    rows += answer.written(written)
    typer.echo(f"{response}")
    answer.print_table(rows)


def _draw(response: TimeHistory, folder: Path) -> None:
    from .. import plot

    def history(axes):
        plot.history(response, ax=axes[0])
        plot.whirl_history(response, ax=axes[1])
        axes[0].set_xlabel("")

    draw(folder / "orbit.png", lambda ax: plot.orbit(response, ax=ax), 85, 85)
    draw(folder / "history.png", history, 170, 110, rows=2)


def _summary(response: TimeHistory) -> dict[str, Any]:
    """Radius, whirl and contacts at the first station, without the sample at the start."""
    z, velocity = (np.asarray(a)[1:, 0] for a in (response.displacement, response.velocity))  # (T,)
    radius, speed = np.abs(z), float(response.scene.spin.speed)
    moving = bool((radius > 0).all()) and speed != 0
    whirl = np.mean(np.imag(np.conj(z) * velocity) / radius**2) / speed if moving else np.nan
    force = response.contact_force
    contacts = [] if force is None else np.abs(np.asarray(force)[1:]).T  # (k, T)
    return {
        "speed": speed,
        "station": response.stations[0],
        "radius_min": radius.min(),
        "radius_max": radius.max(),
        "index": float(whirl),
        "contacts": [{"duty": np.mean(f > 0), "peak_force": f.max()} for f in contacts],
    }
