"""Commands `campbell` and `critical`: whirl frequencies against speed, and where they meet it."""

import math
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from ..analysis import Campbell, campbell as branches_of, critical_speeds
from ..pencil import is_rounding
from ..scene import Scene
from . import answer
from .options import (
    MOST,
    AsJson,
    High,
    Low,
    Out,
    Overwrite,
    Points,
    SceneName,
    Settings,
    rpm,
    scene_with,
    speeds_between,
)
from .output import about, draft_or_none, draw, labelled, write_dataset, written_to


_FILES = ("campbell.zarr", "campbell.png")


def campbell(
    scene: SceneName,
    settings: Settings = None,
    low: Low = None,
    high: High = None,
    points: Points = 61,
    count: Annotated[int, typer.Option(min=1, max=MOST, help="Branches, the slowest first.")] = 4,
    mirrored: Annotated[
        bool, typer.Option("--mirrored", help="Draw backward whirl at negative speeds.")
    ] = False,
    out: Out = None,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """Campbell diagram: whirl frequencies and growth rates against speed, without contact.

    With --out, DIR/campbell.zarr and DIR/campbell.png.

    jaxrotor campbell limiter-rotor --to 9000rpm --out run
    """
    rotor = scene_with(scene, settings)
    speeds = speeds_between(rotor, low, high, points)
    with draft_or_none(out, _FILES, overwrite) as folder:
        result = branches_of(rotor, speeds, count)
        if folder is not None:
            data = labelled(_variables(result), "jaxrotor Campbell diagram", rotor)
            write_dataset(data.assign_attrs(frame=result.frame), folder / "campbell.zarr")
            _draw(result, mirrored, folder)
    values: Any = np.asarray(result.values).T  # (m, w)
    frequency, growth = np.where(is_rounding(values.imag, values), 0.0, values.imag), values.real
    directions = ["whirl"] * len(frequency)
    if result.forward is not None:
        senses = np.asarray(result.forward).mean(axis=0)
        directions = ["forward" if sense >= 0 else "backward" for sense in senses]
    if as_json:
        rows = zip(directions, np.abs(frequency), growth, strict=True)
        found = {
            "frame": result.frame,
            "speeds": speeds,
            "branches": [{"direction": d, "frequency": f, "growth": g} for d, f, g in rows],
        }
        answer.print_json({"scene": scene, **found, "written": written_to(out, _FILES)})
        return
    shown = [0, (points - 1) // 2, points - 1]
    heads = ("branch", *(f"at {speeds[k]:.5g} rad/s" for k in shown), "growth up to [1/s]")
    rows = [
        (direction, *(f"{abs(f):.6g}" for f in line[shown]), f"{largest:.4g}")
        for direction, line, largest in zip(directions, frequency, growth.max(axis=1), strict=True)
    ]
    where = " in the axes of the shaft" if result.frame == "rotating" else ""
    typer.echo(f"Whirl frequencies{where} [rad/s]")
    answer.print_table(rows, heads, numbers=[1, 2, 3, 4])
    answer.print_table(answer.written(written_to(out, _FILES)))


def critical(
    scene: SceneName,
    settings: Settings = None,
    count: Annotated[
        int, typer.Option(min=1, max=MOST, help="How many of each direction, the slowest first.")
    ] = 4,
    as_json: AsJson = False,
) -> None:
    """Critical speeds: where the spin meets a forward or a backward whirl, undamped.

    jaxrotor critical limiter-rotor --count 3
    """
    speeds = described_critical(scene_with(scene, settings), count)
    if as_json:
        described = {
            direction: [{"speed": s, "rpm": rpm(s), "hz": s / (2 * math.pi)} for s in values]
            for direction, values in speeds.items()
        }
        answer.print_json({"scene": scene, **described})
        return
    rows = [
        (direction, f"{speed:.9g}", f"{rpm(speed):.7g}", f"{speed / (2 * math.pi):.7g}")
        for direction, values in speeds.items()
        for speed in values
    ]
    answer.print_table(rows, ("whirl", "critical [rad/s]", "[rpm]", "[Hz]"), numbers=[1, 2, 3])


def described_critical(rotor: Scene, count: int) -> dict[str, list[float]]:
    """Critical speeds [rad/s] by the sense of their whirl."""
    found = critical_speeds(rotor, count)
    return {sense: np.asarray(getattr(found, sense)).tolist() for sense in ("forward", "backward")}


def _variables(result: Campbell) -> tuple[dict[str, Any], dict[str, Any]]:
    dims = ("speed", "branch")
    frequency = about("rad/s", "whirl frequency, positive from x to y")
    return (
        {
            "frequency": (dims, np.asarray(result.frequencies), frequency),
            "growth": (dims, np.asarray(result.growth), about("1/s", "growth rate")),
        },
        {"speed": ("speed", np.asarray(result.speeds), about("rad/s", "spin speed"))},
    )


def _draw(result: Campbell, mirrored: bool, folder: Path) -> None:
    from .. import plot

    def both(axes: Any) -> None:
        plot.campbell(result, axes, mirrored=mirrored)

    draw(folder / "campbell.png", both, 170, 120, rows=2)
