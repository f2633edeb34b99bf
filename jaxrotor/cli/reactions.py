"""Command `reactions`: reactions of bearings in a run-up or in the steady state."""

import math
from functools import partial
from typing import Annotated, Any

import numpy as np
import typer

from .. import plot
from ..analysis import steady_state
from ..effects import AbstractBodies, AbstractContact
from ..equations.start import Continued
from ..motion.reactions import Reactions, reactions as reactions_of
from ..motion.run_up import run_up as run
from ..results.dataset import dataset
from ..results.provenance import assumed
from ..scene import Scene
from ..spins.constant import ConstantSpeed
from . import answer, options
from .axis_units import axis_units
from .output import Files, files_in


_FILES = ("reactions.zarr", "reactions.png", "vectors.png", "hodograph.png")


def reactions(
    scene: options.SceneName,
    settings: options.Settings = None,
    row: options.Row = None,
    layout: options.Layout = None,
    duration: options.Duration = None,
    samples: options.Samples = options.SAMPLES,
    times: options.Times = None,
    rotating: Annotated[
        bool, typer.Option("--rotating", help="Draw vectors and paths in the shaft's axes.")
    ] = False,
    out: options.Out = None,
    overwrite: options.Overwrite = False,
    as_json: options.AsJson = False,
) -> None:
    """Reactions of bearings and stops: at rest, and first, last and largest dynamic part.

    At constant speed and without --duration or --times the motion is one revolution of the steady state,
    otherwise a run from rest. With --out, DIR/reactions.zarr and three pictures: reactions.png of the
    magnitudes in time, vectors.png of the vectors when they are largest, hodograph.png of the paths of
    their tips.

    ```
    jaxrotor reactions turbine-run-up --out run
    jaxrotor reactions two-discs --set spin.speed=3000rpm
    ```
    """
    rotor = options.scene_of(scene, settings, row, layout)
    units = axis_units(scene, rotor, *settings or ())
    with files_in(out, _FILES, overwrite, units) as files:
        found = reactions_of(_motion(rotor, duration, samples, times))
        if not found.names:
            raise ValueError(
                "The scene has no supports, constraints or contacts, so it has no reactions; add one."
            )
        if out is not None:
            files.data(dataset(found))
            _draw(found, files, rotating)
    bearings = _bearings(found)
    rows = [
        (
            rotor.where(one["name"]) if unit == "N" else "",
            *(f"{one[part][key]:.6g}" for key in ("static", "first", "last", "most")),
            f"{one[part]['time']:.5g}",
            unit,
        )
        for one in bearings
        for part, unit in (("force", "N"), ("moment", "N m"))
        if one[part] is not None
    ]
    heads = ("bearing", "at rest", "first", "last", "largest", "at [s]", "")
    facts = {"scene": scene, **assumed(rotor), "bearings": bearings, "written": files.written}
    table, notes = answer.Table(rows, heads, range(1, 6)), answer.assumed(rotor.assumption)
    answer.give(as_json, facts, table, notes + files.rows)


def _motion(rotor: Scene, duration: str | None, samples: int, times: str | None):
    """One revolution of the steady state, or a run from rest."""
    steady = isinstance(rotor.spin, ConstantSpeed) and duration is None and times is None
    if not steady or rotor.of(AbstractBodies):
        return run(rotor, options.instants(rotor, duration, samples, times))
    if contacts := sorted({effect.plural for effect in rotor.of(AbstractContact)}):
        raise ValueError(
            f"The steady state is that of a linear rotor, but the scene has {', '.join(contacts)}; "
            "leave them out of the file, or add a --duration such as 2s for a run from rest."
        )
    speed = abs(float(rotor.spin.speed))
    period = 2 * math.pi / speed if speed else 1.0  # at rest any time will do
    return run(rotor, np.linspace(0.0, period, samples), start=Continued(*steady_state(rotor)))


def _bearings(found: Reactions) -> list[dict[str, Any]]:
    """Magnitudes [N], [N m] of the reactions of every bearing: static, and dynamic part in time."""
    time = np.asarray(found.time)
    force, moment, static, static_moment = (
        np.asarray(a) for a in (found.force, found.moment, found.static, found.static_moment)
    )

    def part(values: np.ndarray, rest: complex) -> dict[str, float]:
        dynamic = np.abs(values - rest)
        top = int(np.argmax(dynamic))
        ends = {"static": abs(rest), "first": dynamic[0], "last": dynamic[-1]}
        return ends | {"most": dynamic[top], "time": time[top]}

    return [
        {
            "name": name,
            "force": part(force[:, i], static[i]),
            "moment": part(moment[:, i], static_moment[i]) if moment[:, i].any() else None,
        }
        for i, name in enumerate(found.names)
    ]


def _draw(found: Reactions, files: Files, rotating: bool) -> None:
    largest = np.abs(np.asarray(found.force)).max(axis=1)
    time = float(found.time[int(np.argmax(largest))])
    vectors = lambda ax: plot.reaction_vectors(found, time, ax, rotating=rotating)
    paths = lambda ax: plot.hodograph(found, ax, rotating=rotating)
    files.picture("reactions.png", partial(plot.reactions, found), 170, 80)
    files.picture("vectors.png", vectors, 85, 85)
    files.picture("hodograph.png", paths, 85, 85)
