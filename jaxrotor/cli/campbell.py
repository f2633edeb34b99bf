"""Commands `campbell` and `critical`: whirl frequencies against speed, and critical speeds."""

import math
from collections.abc import Mapping, Sized
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from ..analysis import Campbell, CriticalSpeeds, campbell as branches_of, critical_speeds
from ..analysis.critical import critical_between
from ..analysis.modal import KINDS, kind_of_whirl
from ..analysis.nodes import resolved
from ..analysis.static_instability import static_instability
from ..core.attributes import about
from ..equations.pencil import is_rounding
from ..equations.rigid_motions import unheld
from ..equations.speed_tables import speed_range
from ..plot.units import SPEEDS
from ..scene import Scene
from . import answer
from .axis_units import axis_units
from .linear import growth_at
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
    operating_speed,
    rpm,
    scene_with,
    speeds_between,
)
from .output import draft_or_none, draw, labelled, write_dataset, written_to


_FILES = ("campbell.zarr", "campbell.png")


def campbell(
    scene: SceneName,
    settings: Settings = None,
    low: Low = None,
    high: High = None,
    points: Points = 61,
    count: Annotated[
        int, typer.Option(min=1, max=MOST, help="Number of branches, slowest first.")
    ] = 8,
    mirrored: Annotated[
        bool, typer.Option("--mirrored", help="Draw backward whirl at negative speeds.")
    ] = False,
    twice: Annotated[
        bool, typer.Option("--twice", help="Draw the line of twice per revolution, too.")
    ] = False,
    out: Out = None,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """Campbell diagram: whirl frequencies and growth rates against speed, without contact.

    A branch beyond --count that is damped less than all those shown is named below the table.
    With --out, DIR/campbell.zarr and DIR/campbell.png.

    jaxrotor campbell limiter-rotor --to 9000rpm --out run
    """
    rotor = resolved(scene_with(scene, settings), count)
    speeds = speeds_between(rotor, low, high, points)
    units = axis_units(scene, rotor, high, low, *settings or ())
    with draft_or_none(out, _FILES, overwrite) as folder:
        result = branches_of(rotor, speeds, count)
        if folder is not None:
            data = labelled(_variables(result), "jaxrotor Campbell diagram", rotor)
            write_dataset(data.assign_attrs(frame=result.frame), folder / "campbell.zarr", units)
            drawn = {"mirrored": mirrored, "orders": (1, 2) if twice else (1,)}
            _draw(result, rotor, drawn, folder, units)
    values: Any = np.asarray(result.values).T  # (m, w)
    frequency, growth = np.where(is_rounding(values.imag, values), 0.0, values.imag), values.real
    largest = growth_at(rotor, speeds)  # of all branches
    directions = [
        way if one.any() else "no whirl"
        for way, one in zip(_directions(result), frequency, strict=True)
    ]
    if as_json:
        rows = zip(directions, np.abs(frequency), growth, strict=True)
        found = {
            "frame": result.frame,
            "speeds": speeds,
            "branches": [{"direction": d, "frequency": f, "growth": g} for d, f, g in rows],
            "largest_growth": largest,
        }
        answer.print_json({"scene": scene, **found, "written": written_to(out, _FILES)})
        return
    shown = [0, (points - 1) // 2, points - 1]
    unit = units["speed"]
    turns = SPEEDS[unit]
    heads = ("branch", *(f"at {turns * speeds[k]:.5g} {unit}" for k in shown), "growth up to [1/s]")
    rows = [
        (direction, *(f"{turns * abs(f):.6g}" for f in line[shown]), f"{most:.4g}")
        for direction, line, most in zip(directions, frequency, growth.max(axis=1), strict=True)
    ]
    where = " in the axes of the shaft" if result.frame == "rotating" else ""
    typer.echo(f"Whirl frequencies{where} [{unit}]")
    answer.print_table(rows, heads, numbers=[1, 2, 3, 4])
    notes, top = [], int(np.argmax(np.nan_to_num(largest, nan=-np.inf)))
    if largest[top] > growth.max() + 1e-6 * np.abs(growth).max():
        at = f"up to {largest[top]:.4g} 1/s, at {turns * speeds[top]:.5g} {unit}"
        notes = [("left out", f"faster whirl with growth {at}; --count shows more branches")]
    answer.print_table([*notes, *answer.written(written_to(out, _FILES))])


def _directions(result: Campbell) -> list[str]:
    """Direction of every branch as to the spin; of circles over speeds of both senses in fixed axes."""
    senses = result.forward if result.circular else result.senses
    if senses is None:
        return ["whirl"] * result.values.shape[1]
    speeds = np.asarray(result.speeds)
    both = result.circular and speeds.min() < 0 < speeds.max()
    means = np.mean(np.asarray(senses) * (np.sign(speeds)[:, None] if both else 1.0), axis=0)
    named = {"forward": "from x to y", "backward": "from y to x"} if both else {}
    kinds = (
        np.where(means >= 0, "forward", "backward")
        if result.circular
        else map(kind_of_whirl, means)
    )
    return [named.get(str(kind), str(kind)) for kind in kinds]


def critical(
    scene: SceneName,
    settings: Settings = None,
    count: Annotated[
        int, typer.Option(min=1, max=MOST, help="Number of each kind, slowest first.")
    ] = 4,
    as_json: AsJson = False,
) -> None:
    """Critical speeds: speeds of rotation that equal a whirl frequency of the undamped rotor.

    An orbit is the sum of a forward and a backward circle. Whirl is named after the one with at least 60 %
    of the kinetic energy, and is mixed if neither has: its orbits are nearly straight lines. The last
    column is the share of stations along the shaft that whirl forward.

    jaxrotor critical limiter-rotor --count 3
    """
    rotor = resolved(scene_with(scene, settings), 2 * count)
    found, unstable, free = critical_speeds(rotor, count), static_instability(rotor), unheld(rotor)
    senses, stations = np.asarray(found.senses), np.asarray(found.stations)
    speeds, shares = np.asarray(found.speeds).tolist(), np.asarray(found.forward_share).tolist()
    described = [
        {
            "speed": speed,
            "rpm": rpm(speed),
            "hz": speed / (2 * math.pi),
            "forward_share": share,
            "senses": sense.tolist(),
        }
        for speed, share, sense in zip(speeds, shares, senses, strict=True)
    ]
    if as_json:
        pairs = list(zip(found.kinds, described, strict=True))
        kinds = {kind: [one for k, one in pairs if k == kind] for kind in KINDS}
        noted = {"free": free or None, "statically_unstable": unstable or None}
        answer.print_json({"scene": scene, **noted, "stations": stations, **kinds})
        return
    rows = [
        (
            kind,
            f"{one['speed']:.9g}",
            f"{one['rpm']:.7g}",
            f"{one['hz']:.7g}",
            f"{100 * one['forward_share']:.4g} %",
            f"{100 * np.mean(sense > 0):.3g} %",
        )
        for kind, one, sense in zip(found.kinds, described, senses, strict=True)
    ]
    heads = ("whirl", "undamped [rad/s]", "[rpm]", "[Hz]", "forward energy", "forward stations")
    if rows:
        answer.print_table(rows, heads, numbers=[1, 2, 3, 4, 5])
    end = end_of_search(rotor, {kind: getattr(found, kind) for kind in KINDS}, count)
    notes = {"held": free and f"free: {free}", "statically unstable": unstable, "critical": end}
    answer.print_table([(name, note) for name, note in notes.items() if note])


def end_of_search(rotor: Scene, found: Mapping[str, Sized], count: int) -> str:
    """A clause that says where tables over speed end the search for `count` critical speeds, else ""."""
    span = speed_range(rotor, rotor.spin.sense)
    if span is None or all(len(own) >= count for kind, own in found.items() if kind != "mixed"):
        return ""
    low, high = (float(rotor.spin.sense * end) for end in span)
    others = "no others" if any(map(len, found.values())) else "none"
    between = f"{low:g} to {high:g} rad/s ({rpm(low):.6g} to {rpm(high):.6g} rpm)"
    return f"{others} from {between}, the speeds of all tables; extend them to search farther"


def described_critical(rotor: Scene, count: int) -> dict[str, list[float]]:
    """Critical speeds [rad/s] by their kind of whirl."""
    found = critical_speeds(rotor, count)
    return {kind: np.asarray(getattr(found, kind)).tolist() for kind in KINDS}


def _variables(result: Campbell) -> tuple[dict[str, Any], dict[str, Any]]:
    dims = ("speed", "branch")
    frequency = about("rad/s", "whirl frequency; on equal supports positive from x to y")
    columns = {
        "frequency": (dims, np.asarray(result.frequencies), frequency),
        "growth": (dims, np.asarray(result.growth), about("1/s", "growth rate")),
    }
    if result.senses is not None:
        told = about("1", "forward less backward share of kinetic energy")
        columns["sense"] = dims, np.asarray(result.senses), told
    return (
        columns,
        {"speed": ("speed", np.asarray(result.speeds), about("rad/s", "spin speed"))},
    )


def _undamped(rotor: Scene, speeds: Any) -> CriticalSpeeds | None:
    """Critical speeds within the range of some speeds, None if the rotor has none."""
    try:
        return critical_between(rotor, float(np.min(speeds)), float(np.max(speeds)))
    except ValueError:
        return None


def _draw(
    result: Campbell, rotor: Scene, chosen: dict[str, Any], folder: Path, units: dict[str, Any]
) -> None:
    from .. import plot

    critical = _undamped(rotor, result.speeds)
    about = {"critical": critical, "operating": operating_speed(rotor)} | chosen

    def both(axes: Any) -> None:
        plot.campbell(result, axes, **about)

    draw(folder / "campbell.png", both, 170, 120, rows=2, units=units)
