"""Command `run-up`: motion while the speed changes."""

import math
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from ..equations.start import Launch
from ..files.toml import study
from ..motion.history import TimeHistory
from ..motion.run_up import run_up as run
from ..results.dataset import dataset
from ..results.provenance import assumed
from ..solvers import Exponential
from ..spins import ConstantSpeed
from . import answer
from .axis_units import axis_units, written_in
from .contacts import contact_rows, forces_of
from .options import (
    SAMPLES,
    STILL,
    Angle,
    AsJson,
    At,
    Duration,
    Layout,
    Overwrite,
    Radius,
    Rate,
    Row,
    Samples,
    SceneName,
    Settings,
    Times,
    count_or_auto,
    instants,
    moving_station,
    optional,
    scene_of,
    start_with,
)
from .output import draft_or_none, draw, write_dataset, written_to
from .solver import NAMED, Solver, chosen


_FILES = ("run-up.zarr", "run-up.png", "passage.png", "speed.png", "balls.png", "film.gif")
_FEWEST = 8  # samples of a revolution in a picture


def run_up(
    scene: SceneName,
    settings: Settings = None,
    row: Row = None,
    layout: Layout = None,
    duration: Duration = None,
    samples: Samples = SAMPLES,
    times: Times = None,
    start_radius: Radius = None,
    start_rate: Rate = None,
    start_angle: Angle = None,
    at: At = None,
    solver: Annotated[
        Solver | None,
        typer.Option(
            help=f"{NAMED} [default: exponential4 of a flexible shaft without contact, dopri8 of another "
            "shaft, else kvaerno5]"
        ),
    ] = None,
    substeps: Annotated[
        str | None,
        typer.Option(
            metavar="COUNT",
            help='Steps from sample to sample of an exponential solver, or "auto": chosen by a pilot run.',
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Folder for run-up.zarr and pictures."),
    ] = None,
    film: Annotated[bool, typer.Option("--film", help="Write film.gif too, with --out.")] = False,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """Simulate a run-up or any other change of speed: peak, speeds, contact and balls.

    How the speed changes is said in the scene file, by its table [spin]: model = "profile" with times and
    speeds, or model = "drive" with a torque. At a constant speed this is a run from rest.
    With --out, DIR/run-up.zarr, pictures of amplitude in time and over speed (passage.png), of speed, and
    of balls if there are any. Without
    --at the motion is that of the first station of a contact or an effect that can move; if none
    can, as on a rigid shaft in two pins, pictures of the amplitude are left out.

    ```
    jaxrotor run-up turbine-run-up --out run
    jaxrotor run-up turbine-run-up --set "spin.torque=1500 N m" --times "0:2s:501"
    jaxrotor run-up limiter-rotor --duration 0.1s --samples 801 --solver exponential2 --substeps 4
    ```
    """
    rotor, table = scene_of(scene, settings, row, layout), study(scene)
    instant = instants(rotor, duration, samples, times)
    start = Launch(start_with(table, start_radius, start_rate, start_angle))
    if film and out is None:
        raise ValueError("--film needs a folder to write into; add --out.")
    station, moves = optional(at, "m", "--at"), moving_station(rotor)
    station = moves if station is None else station
    steps: dict[str, Any] = {"solver": chosen(solver)}
    if substeps is not None:
        steps["substeps"] = count_or_auto(substeps, "--substeps")
        if not isinstance(steps["solver"], Exponential):
            raise ValueError(
                f"--substeps {substeps} needs an exponential solver; add --solver exponential2, or leave "
                "it out."
            )
    units = axis_units(scene, rotor, *settings or (), start_radius)
    with draft_or_none(out, _FILES, overwrite) as folder:
        motion = run(rotor, instant, start=start, at=station, **steps)
        if folder is not None:
            write_dataset(dataset(motion), folder / "run-up.zarr", units)
            _note_few_samples(np.asarray(motion.angle))
            _draw(motion, folder, film, moves is not None, units)
    summary = _summary(motion, moves is not None)
    answer.note_large(float(summary["peak"]["radius"]), float(rotor.shaft.length))
    written = written_to(out, _FILES)
    if as_json:
        answer.print_json({"scene": scene, **assumed(rotor), **summary, "written": written})
        return
    typer.echo(f"{motion}")
    answer.print_table(
        [
            *_rows(summary, motion, units),
            *_constant(motion),
            *answer.assumed(rotor.assumption),
            *answer.written(written),
        ]
    )


def _rows(
    summary: dict[str, Any], motion: TimeHistory, units: dict[str, Any]
) -> list[tuple[str, str]]:
    peak, (first, last) = summary["peak"], summary["speed"]
    turns, rate = written_in(units, "rad/s", first, motion.scene)
    factor, unit = written_in(units, "m", peak["radius"], motion.scene)
    at = f"{factor * peak['radius']:.6g} {unit} at {peak['time']:.6g} s"
    at = f"{at} and {turns * peak['speed']:.6g} {rate}"
    rows = [
        ("speed", f"{turns * first:.6g} to {turns * last:.6g} {rate}"),
        ("peak", at if summary["moves"] else STILL),
    ]
    if summary["stopped"] is not None:
        rows.append(("stopped", f"at {summary['stopped']:.6g} s"))
    rows += contact_rows(motion)
    if summary["imbalance"] is not None:
        first, last = (1e3 * value for value in summary["imbalance"])
        rows.append(("imbalance", f"{first:.5g} to {last:.5g} g m"))
    return rows


def _constant(motion: TimeHistory) -> list[tuple[str, str]]:
    """Row that says how to let the speed change, where it does not."""
    if not isinstance(motion.scene.spin, ConstantSpeed):
        return []
    how = 'for a run-up give [spin] in the scene file model = "profile", times and speeds'
    return [("note", f"the speed is constant; {how}")]


def _draw(
    motion: TimeHistory, folder: Path, film: bool, moves: bool, units: dict[str, Any]
) -> None:
    from .. import plot

    paint = partial(draw, units=units)
    if moves:
        paint(folder / "run-up.png", lambda axes: plot.run_up(motion, axes=axes), 170, 100, rows=2)
        if np.ptp(np.asarray(motion.speed)) > 0:
            paint(folder / "passage.png", lambda ax: plot.passage(motion, ax=ax), 170, 75)
    paint(folder / "speed.png", lambda axes: plot.speed(motion, axes), 170, 100, rows=2)
    if motion.balls:
        paint(folder / "balls.png", lambda axes: plot.balls(motion, axes), 170, 110, rows=2)
    if film and (moves or motion.balls):
        plot.animate(motion, folder / "film.gif")


def _note_few_samples(angle: np.ndarray) -> None:
    """Print a note on stderr if pictures show patterns that are not in the motion."""
    turns = float(np.max(np.abs(np.diff(angle)))) / (2 * np.pi)
    if turns * _FEWEST > 1:
        needed = math.ceil(round(2 * _FEWEST * turns * (len(angle) - 1), 6)) + 1
        typer.echo(
            f"Note: the fastest revolution has only {1 / turns:.2g} samples, so pictures show patterns "
            f"that are not in the motion; take {needed} samples.",
            err=True,
        )


def _summary(motion: TimeHistory, moves: bool) -> dict[str, Any]:
    """Peak, speeds and contacts at the first station, from the samples."""
    radius, speed = np.abs(np.asarray(motion.displacement)[:, 0]), np.asarray(motion.speed)
    top, stopped = int(np.argmax(radius)), float(motion.stopped)
    left = np.abs(np.asarray(motion.imbalance)) if motion.balls else None
    return {
        "moves": moves,
        "station": motion.stations[0],
        "duration": float(motion.time[-1] - motion.time[0]),
        "speed": (speed[0], speed[-1]),
        "revolutions": float(motion.angle[-1] - motion.angle[0]) / (2 * np.pi),
        "peak": {"radius": radius[top], "time": motion.time[top], "speed": speed[top]},
        "stopped": stopped if np.isfinite(stopped) else None,
        "contacts": [{"duty": np.mean(f > 0), "peak_force": f.max()} for f in forces_of(motion)],
        "imbalance": None if left is None else (left[0], left[-1]),
    }
