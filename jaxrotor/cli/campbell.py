"""Commands `campbell` and `critical`: whirl frequencies against speed, and critical speeds."""

import math
from collections.abc import Mapping, Sized
from functools import partial
from typing import Annotated, Any

import jax.numpy as jnp
import numpy as np
import typer

from .. import plot
from ..analysis import Campbell, campbell as branches_of, critical_speeds
from ..analysis.critical import critical_if_any
from ..analysis.modal import KINDS, kind_of_whirl
from ..analysis.operating_line import OperatingLine
from ..analysis.resolved import resolved
from ..analysis.static_instability import static_instability
from ..core.attributes import variable
from ..effects.film import AbstractFluid
from ..equations.pencil import is_rounding
from ..equations.rigid_motions import unheld
from ..equations.speed_tables import speed_range
from ..plot.units import SPEEDS
from ..scene import Scene
from . import answer, options
from .axis_units import axis_units
from .linear import growth_at, linear_at_speed, linear_over_speeds
from .output import files_in, labelled


_FILES = ("campbell.zarr", "campbell.png")
IN_TABLES = "the speeds of all tables; extend them to search farther"
IN_FILMS = "the speeds of the static positions; raise `spin.speed` to search farther"
_NODES = 101  # static positions in films, between which coefficients are interpolated


def campbell(
    scene: options.SceneName,
    settings: options.Settings = None,
    low: options.Low = None,
    high: options.High = None,
    points: options.Points = 61,
    count: Annotated[int, options.count("Number of branches, slowest first.")] = 8,
    mirrored: Annotated[
        bool, typer.Option("--mirrored", help="Draw backward whirl at negative speeds.")
    ] = False,
    twice: Annotated[
        bool, typer.Option("--twice", help="Draw the line of twice per revolution, too.")
    ] = False,
    out: options.Out = None,
    overwrite: options.Overwrite = False,
    as_json: options.AsJson = False,
) -> None:
    """Campbell diagram: whirl frequencies and growth rates against speed, without contact.

    A branch beyond --count that is damped less than all those shown is named below the table. In films,
    seals, rolling and magnetic bearings the roots are those about the static position at each speed.
    With --out, DIR/campbell.zarr and DIR/campbell.png.

    jaxrotor campbell limiter-rotor --to 9000rpm --out run
    """
    whole = options.scene_with(scene, settings)
    rotor, speeds = linear_over_speeds(whole, low, high, points)
    rotor = resolved(rotor, count)
    units = axis_units(scene, rotor, high, low, *settings or ())
    with files_in(out, _FILES, overwrite, units) as files:
        result = branches_of(rotor, speeds, count)
        if out is not None:
            files.data(_dataset(result, rotor))
            ends = float(speeds.min()), float(speeds.max())
            undamped = (
                None if rotor.shafts else critical_if_any(rotor, *ends)
            )  # rings are of all shafts
            marks: dict[str, Any] = {"critical": undamped}
            marks |= {"operating": options.operating_speed(rotor), "mirrored": mirrored}
            marks |= {"orders": (1, 2) if twice else (1,)}
            diagram = partial(plot.campbell, result, **marks)
            files.picture("campbell.png", diagram, 170, 120, rows=2)
    values: Any = np.asarray(result.values).T  # (m, w)
    frequency, growth = np.where(is_rounding(values.imag, values), 0.0, values.imag), values.real
    largest = growth_at(rotor, speeds)  # of all branches
    directions = [
        way if one.any() else "no whirl"
        for way, one in zip(_directions(result), frequency, strict=True)
    ]
    branches = list(zip(directions, np.abs(frequency), growth, strict=True))
    facts = {
        "scene": scene,
        "frame": result.frame,
        "speeds": speeds,
        "branches": [{"direction": d, "frequency": f, "growth": g} for d, f, g in branches],
        "largest_growth": largest,
        "written": files.written,
    }
    shown = [0, (points - 1) // 2, points - 1]
    unit = units["speed"]
    turns = SPEEDS[unit]
    heads = ("branch", *(f"at {turns * speeds[k]:.5g} {unit}" for k in shown), "growth up to [1/s]")
    rows = [
        (direction, *(f"{turns * f:.6g}" for f in line[shown]), f"{rates.max():.4g}")
        for direction, line, rates in branches
    ]
    where = " in the axes of the shaft" if result.frame == "rotating" else ""
    notes, top = [], int(np.argmax(np.nan_to_num(largest, nan=-np.inf)))
    if largest[top] > growth.max() + 1e-6 * np.abs(growth).max():
        undamped = abs(largest[top]) <= 1e-9 * np.abs(values).max()
        rate = "that nothing damps" if undamped else f"with growth up to {largest[top]:.4g} 1/s"
        at = f"{rate}, at {turns * speeds[top]:.5g} {unit}"
        notes = [("left out", f"faster whirl {at}; --count shows more branches")]
    table, title = answer.Table(rows, heads, range(1, 5)), f"Whirl frequencies{where} [{unit}]"
    answer.give(as_json, facts, title, table, notes + files.rows)


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
    scene: options.SceneName,
    settings: options.Settings = None,
    count: Annotated[int, options.count("Number of each kind, slowest first.")] = 4,
    by: options.By = None,
    as_json: options.AsJson = False,
) -> None:
    """Critical speeds: speeds of rotation that equal a whirl frequency of the undamped rotor.

    An orbit is the sum of a forward and a backward circle. Whirl is named after the one with at least 60 %
    of the kinetic energy, and is mixed if neither has: its orbits are nearly straight lines. The last
    column is the share of stations along the shaft that whirl forward. In rolling bearings the stiffness
    is that about the static position, in films and seals that at each speed up to 2.5 times the scene's.
    Of several shafts they are by the unbalance of one of them, and forward as that turns; the speeds of
    all shafts are beside.

    ```
    jaxrotor critical limiter-rotor --count 3
    jaxrotor critical dual-rotor --by hp
    ```
    """
    rotor = options.scene_with(scene, settings)
    in_films = bool(rotor.of(AbstractFluid))
    if in_films:
        rotor, _ = linear_over_speeds(rotor, None, None, _NODES)
    else:
        rotor = linear_at_speed(rotor)
    found = critical_speeds(rotor, count, by=by)
    unstable, free = static_instability(rotor), unheld(rotor)
    columns = (np.asarray(a).tolist() for a in (found.speeds, found.forward_share, found.senses))
    described = [
        {
            "speed": speed,
            "rpm": options.rpm(speed),
            "hz": speed / (2 * math.pi),
            "forward_share": share,
            "senses": senses,
        }
        for speed, share, senses in zip(*columns, strict=True)
    ]
    operating = [] if found.operating is None else np.asarray(found.operating).tolist()
    for one, speeds in zip(described, operating, strict=False):
        one["shaft_speeds"] = dict(zip(rotor.shafts, speeds, strict=True))
    pairs = list(zip(found.kinds, described, strict=True))
    kinds = {kind: [one for k, one in pairs if k == kind] for kind in KINDS}
    noted = {"free": free or None, "statically_unstable": unstable or None}
    facts = {"scene": scene, **noted, "stations": np.asarray(found.stations), **kinds}
    rows = [
        (
            kind,
            f"{one['speed']:.9g}",
            f"{one['rpm']:.7g}",
            f"{one['hz']:.7g}",
            f"{100 * one['forward_share']:.4g} %",
            f"{100 * np.mean(np.greater(one['senses'], 0)):.3g} %",
        )
        for kind, one in pairs
    ]
    heads = ("whirl", "undamped [rad/s]", "[rpm]", "[Hz]", "forward energy", "forward stations")
    if rotor.shafts:  # circles, whose shares are 0 or 100 %
        heads = (*heads[:4], *(f"{name} [rad/s]" for name in rotor.shafts))
        turning = [[f"{x:.9g}" for x in one["shaft_speeds"].values()] for _, one in pairs]
        rows = [(*row[:4], *own) for row, own in zip(rows, turning, strict=True)]
    end = end_of_search(rotor, kinds, count, IN_FILMS if in_films else IN_TABLES)
    notes: dict[str, Any] = {
        "held": free and f"free: {free}",
        "statically unstable": unstable,
        "critical": end,
    }
    notes["by"] = rotor.shafts and f"unbalance of {by or rotor.shafts[0]}"
    facts |= {"by": by or rotor.shafts[0]} if rotor.shafts else {}
    numbers = range(1, len(heads))
    answer.give(as_json, facts, answer.Table(rows, heads, numbers), answer.filled(notes))


def end_of_search(
    rotor: Scene, found: Mapping[str, Sized], count: int, why: str = IN_TABLES
) -> str:
    """A clause that says where tables over speed end the search for `count` critical speeds, else ""."""
    span = speed_range(rotor, rotor.spin.sense)
    if span is None or all(len(own) >= count for kind, own in found.items() if kind != "mixed"):
        return ""
    low, high = (float(rotor.spin.sense * end) for end in span)
    others = "no others" if any(map(len, found.values())) else "none"
    between = f"{low:g} to {high:g} rad/s ({options.rpm(low):.6g} to {options.rpm(high):.6g} rpm)"
    return f"{others} from {between}, {why}"


def speeds_of_shafts(rotor: Scene) -> dict[str, dict[str, float]]:
    """Speed of every shaft [rad/s] by its name, under `shaft_speeds`; nothing of a rotor of one shaft."""
    line = OperatingLine.of(rotor, None)
    if line is None:
        return {}
    (speeds,) = np.asarray(line.at(jnp.atleast_1d(rotor.spin.speed))).tolist()
    return {"shaft_speeds": dict(zip(rotor.shafts, speeds, strict=True))}


def described_critical(rotor: Scene, count: int, by: str | None = None) -> dict[str, list[float]]:
    """Critical speeds [rad/s] by their kind of whirl, of several shafts those by the unbalance of one."""
    found = critical_speeds(rotor, count, by=by)
    return {kind: np.asarray(getattr(found, kind)).tolist() for kind in KINDS}


def _dataset(result: Campbell, rotor: Scene) -> Any:
    dims, whirl = ("speed", "branch"), "whirl frequency; on equal supports positive from x to y"
    columns = {
        "frequency": variable(dims, result.frequencies, "rad/s", whirl),
        "growth": variable(dims, result.growth, "1/s", "growth rate"),
    }
    if result.senses is not None:
        share = "forward less backward share of kinetic energy"
        columns["sense"] = variable(dims, result.senses, "1", share)
    speeds = {"speed": variable("speed", result.speeds, "rad/s", "spin speed")}
    data = labelled(columns, speeds, "jaxrotor Campbell diagram", rotor)
    return data.assign_attrs(frame=result.frame)
