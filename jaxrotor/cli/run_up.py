"""Command `run-up`: motion while the speed changes."""

import math
from functools import partial
from typing import Annotated, Any

import numpy as np
import typer

from .. import plot
from ..equations.start import Launch
from ..files.toml import study
from ..motion.history import TimeHistory
from ..motion.run_up import run_up as run
from ..results.dataset import dataset
from ..results.provenance import assumed
from ..solvers import Exponential
from ..spins import ConstantSpeed
from . import answer, options
from .axis_units import axis_units, ends_in, written_in
from .contacts import contact_rows, contacts_of
from .output import Files, files_in
from .solver import NAMED, Solver, chosen


_FILES = ("run-up.zarr", "run-up.png", "passage.png", "speed.png", "balls.png", "film.gif")
_FEWEST = 8  # samples of a revolution in a picture


def run_up(
    scene: options.SceneName,
    settings: options.Settings = None,
    row: options.Row = None,
    layout: options.Layout = None,
    duration: options.Duration = None,
    samples: options.Samples = options.SAMPLES,
    times: options.Times = None,
    start_radius: options.Radius = None,
    start_rate: options.Rate = None,
    start_angle: options.Angle = None,
    at: options.At = None,
    solver: Annotated[
        Solver | None,
        typer.Option(
            help=f"{NAMED} [default: exponential4, with contact exponential2, where they can be taken, "
            "else dopri8 of one or two coordinates with mass and kvaerno5 of more]"
        ),
    ] = None,
    substeps: Annotated[
        str | None,
        typer.Option(
            metavar="COUNT",
            help='Steps from sample to sample of an exponential solver, or "auto": chosen by a pilot run.',
        ),
    ] = None,
    out: options.Out = None,
    film: Annotated[bool, typer.Option("--film", help="Write film.gif too, with --out.")] = False,
    overwrite: options.Overwrite = False,
    as_json: options.AsJson = False,
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
    rotor, table = options.scene_of(scene, settings, row, layout), study(scene)
    instant = options.instants(rotor, duration, samples, times)
    start = Launch(options.start_with(table, start_radius, start_rate, start_angle))
    if film and out is None:
        raise ValueError("--film needs a folder to write into; add --out.")
    station, moves = options.place(rotor, at), options.moving_station(rotor)
    station = moves if station is None else station
    steps: dict[str, Any] = {"solver": chosen(solver)}
    if substeps is not None:
        steps["substeps"] = options.count_or_auto(substeps, "--substeps")
        if not isinstance(steps["solver"], Exponential):
            raise ValueError(
                f"--substeps {substeps} needs an exponential solver; add --solver exponential2, or leave "
                "it out."
            )
    units = axis_units(scene, rotor, *settings or (), start_radius)
    with files_in(out, _FILES, overwrite, units) as files:
        motion = run(rotor, instant, start=start, at=station, **steps)
        if out is not None:
            files.data(dataset(motion))
            _note_few_samples(np.asarray(motion.angle))
            _draw(motion, files, film, moves is not None)
    found = _found(motion, moves is not None)
    answer.note_large(float(found["peak"]["radius"]), float(rotor.shaft.length))
    rows = [*_rows(found, motion, units), *answer.assumed(rotor.assumption), *files.rows]
    facts = {"scene": scene, **assumed(rotor), **found, "written": files.written}
    answer.give(as_json, facts, f"{motion}", rows)


def _rows(found: dict[str, Any], motion: TimeHistory, units: dict[str, Any]) -> answer.Rows:
    peak, scene = found["peak"], motion.scene
    turns, rate = written_in(units, "rad/s", peak["speed"], scene)
    factor, unit = written_in(units, "m", peak["radius"], scene)
    at = f"{factor * peak['radius']:.6g} {unit} at {peak['time']:.6g} s"
    at = f"{at} and {turns * peak['speed']:.6g} {rate}"
    rows = [
        ("speed", ends_in(units, "rad/s", found["speed"], scene)),
        ("peak", at if found["moves"] else options.STILL),
    ]
    if found["stopped"] is not None:
        rows.append(("stopped", f"at {found['stopped']:.6g} s"))
    rows += contact_rows(motion)
    if found["imbalance"] is not None:
        first, last = (1e3 * value for value in found["imbalance"])
        rows.append(("imbalance", f"{first:.5g} to {last:.5g} g m"))
    if isinstance(scene.spin, ConstantSpeed):
        how = 'for a run-up give [spin] in the scene file model = "profile", times and speeds'
        rows.append(("note", f"the speed is constant; {how}"))
    return rows


def _draw(motion: TimeHistory, files: Files, film: bool, moves: bool) -> None:
    if moves:
        files.picture("run-up.png", lambda axes: plot.run_up(motion, axes=axes), 170, 100, rows=2)
        if np.ptp(np.asarray(motion.speed)) > 0:
            files.picture("passage.png", lambda ax: plot.passage(motion, ax=ax), 170, 75)
    files.picture("speed.png", partial(plot.speed, motion), 170, 100, rows=2)
    if motion.balls:
        files.picture("balls.png", partial(plot.balls, motion), 170, 110, rows=2)
    if film and (moves or motion.balls):
        plot.animate(motion, files.draft / "film.gif")


def _note_few_samples(angle: np.ndarray) -> None:
    """Print a note on stderr if pictures show patterns that are not in the motion."""
    turns = float(np.max(np.abs(np.diff(angle)))) / (2 * np.pi)
    if turns * _FEWEST > 1:
        needed = math.ceil(round(2 * _FEWEST * turns * (len(angle) - 1), 6)) + 1
        answer.note(
            f"the fastest revolution has only {1 / turns:.2g} samples, so pictures show patterns "
            f"that are not in the motion; take {needed} samples."
        )


def _found(motion: TimeHistory, moves: bool) -> dict[str, Any]:
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
        "contacts": contacts_of(motion),
        "imbalance": None if left is None else (left[0], left[-1]),
    }
