"""Command `simulate`: one motion in time."""

from functools import partial
from typing import Annotated, Any

import numpy as np
import typer

from .. import plot
from ..files.toml import study
from ..motion.history import TimeHistory
from ..motion.simulate import simulate as run
from ..results.dataset import dataset
from ..spins import ConstantSpeed
from . import answer, options
from .axis_units import axis_units, ends_in
from .contacts import contact_rows, contacts_of
from .output import files_in
from .solver import NAMED, Solver, chosen


REVOLUTIONS = 100  # by default
_FILES = ("response.zarr", "orbit.png", "history.png")


def simulate(
    scene: options.SceneName,
    settings: options.Settings = None,
    revolutions: Annotated[
        int | None, options.count("Revolutions at constant speed. [default: 100]")
    ] = None,
    keep: Annotated[
        int | None, options.count("Revolutions observed, at the end. [default: all]")
    ] = None,
    times: options.Times = None,
    steps: options.Steps = None,
    nodes: options.Nodes = None,
    tolerance: options.Tolerance = 1e-3,
    solver: Annotated[
        Solver | None,
        typer.Option(help=f"{NAMED} [default: exponential2 where it can be taken]"),
    ] = None,
    start_radius: options.Radius = None,
    start_rate: options.Rate = None,
    start_angle: options.Angle = None,
    at: options.At = None,
    period: options.Period = None,
    out: options.Out = None,
    overwrite: options.Overwrite = False,
    as_json: options.AsJson = False,
) -> None:
    """Simulate one motion in time: radius, whirl and contact; with --out, data and pictures.

    These are DIR/response.zarr, DIR/orbit.png and DIR/history.png. A scene of constant speed runs by whole
    revolutions. Any other runs to the end of its speed profile or near the steady speed of its drive,
    unless --times are given.

    ```
    jaxrotor simulate limiter-rotor --revolutions 500 --keep 50 --out run
    jaxrotor simulate limiter-rotor --start-radius 12mm --start-rate=-441rad/s --steps 1024
    jaxrotor simulate limiter-rotor --set unbalance.eccentricity=0.5mm --solver kvaerno5
    jaxrotor simulate turbine-run-up --times 0:20s:2001
    ```
    """
    rotor, table = options.scene_with(scene, settings), study(scene)
    moves = options.moving_station(rotor)
    asked: dict[str, Any] = {
        "solver": chosen(solver),
        "start": options.start_with(table, start_radius, start_rate, start_angle),
        "nodes": options.count_or_auto(nodes, "--nodes"),
        "tolerance": tolerance,
        "at": moves if at is None else options.place(rotor, at),
    }
    if times is None and isinstance(rotor.spin, ConstantSpeed):
        samples = options.count_or_auto(steps, "--steps") or table.get("steps_per_revolution", 256)
        asked |= {"revolutions": revolutions or REVOLUTIONS, "steps_per_revolution": samples}
        asked |= {"keep": keep, "period": options.revolution(rotor, period)}
    else:
        given = {"--revolutions": revolutions, "--keep": keep, "--steps": steps, "--period": period}
        options.refuse_revolutions(given)
        asked["times"] = options.instants(rotor, None, options.SAMPLES, times)
    units = axis_units(scene, rotor, *settings or (), start_radius)
    with files_in(out, _FILES, overwrite, units) as files:
        motion = run(rotor, **asked)
        if out is not None:
            files.data(dataset(motion))
            files.picture("orbit.png", lambda ax: plot.orbit(motion, ax=ax), 85, 85)
            files.picture("history.png", partial(_draw_history, motion), 170, 110, rows=2)
    found = _found(motion)
    index, radii = found["index"], (found["radius_min"], found["radius_max"])
    answer.note_large(float(radii[1]), float(rotor.shaft.length))
    rows = [
        ("radius", options.STILL if moves is None else ends_in(units, "m", radii, rotor)),
        ("precession index", "undefined: at rest" if np.isnan(index) else f"{index:.6g}"),
        *contact_rows(motion, skip=1),
        *files.rows,
    ]
    facts = {"scene": scene, **found, "written": files.written}
    answer.give(as_json, facts, f"{motion}", rows)


def _draw_history(motion: TimeHistory, axes: Any) -> None:
    """Draw radius and whirl in time, or radius and speed where the speed changes."""
    if motion.steps_per_revolution is None:
        plot.run_up(motion, axes=axes)
        return
    plot.history(motion, ax=axes[0])
    plot.whirl_history(motion, ax=axes[1])
    axes[0].set_xlabel("")


def _found(motion: TimeHistory) -> dict[str, Any]:
    """Radius, whirl and contacts at the first station, without the sample at the start."""
    z, velocity = (np.asarray(a)[1:, 0] for a in (motion.displacement, motion.velocity))  # (T,)
    radius, speed = np.abs(z), np.asarray(motion.speed)[1:]
    moving = bool((radius > 0).all() and (speed != 0).all())
    whirl = np.mean(np.imag(np.conj(z) * velocity) / radius**2 / speed) if moving else np.nan
    return {
        "speed": speed[-1],
        "station": motion.stations[0],
        "radius_min": radius.min(),
        "radius_max": radius.max(),
        "index": float(whirl),
        "contacts": contacts_of(motion, skip=1),
    }
