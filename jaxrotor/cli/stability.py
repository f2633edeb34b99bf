"""Command `stability`: stable regions of a rotor over one parameter or two."""

from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from ..analysis import StabilityMap, stability_boundary, stability_map
from ..core.attributes import about
from ..scene import Scene
from . import answer
from .axis_units import axis_units
from .options import AsJson, Out, Overwrite, SceneName, Settings, scene_with, swept_axes
from .output import draft_or_none, draw, labelled, write_dataset, written_to


_FILES = ("stability.zarr", "stability.png")


def stability(
    scene: SceneName,
    over: Annotated[
        list[str],
        typer.Option(
            metavar="PATH=START:STOP:COUNT",
            help="Parameter to vary: one for the values at which stability changes, two for a map.",
        ),
    ],
    settings: Settings = None,
    out: Out = None,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """Boundaries of stability along one parameter, or a stability map over two, without contact.

    With --out and two parameters, DIR/stability.zarr and DIR/stability.png.

    jaxrotor stability limiter-rotor --over spin.speed=0:9000rpm:61
    jaxrotor stability limiter-rotor --over spin.speed=0:9000rpm:61 --over disc.mass=1:4:41 --out run
    """
    rotor = scene_with(scene, settings)
    axes = swept_axes(rotor, over)
    if len(axes) == 1:
        if out is not None:
            raise ValueError("--out is for a map; give --over a second time, or leave --out out.")
        _along(scene, rotor, axes, as_json)
        return
    with draft_or_none(out, _FILES, overwrite) as folder:
        result = stability_map(rotor, axes)
        if folder is not None:
            data = labelled(_variables(result), "jaxrotor stability map", rotor)
            write_dataset(data, folder / "stability.zarr")
            _draw(result, folder, axis_units(scene, rotor, *over, *settings or ()))
    unknown = np.isnan(result.growth)
    unstable, unsure = float(np.mean(result.growth > 0)), float(np.mean(unknown))
    largest = float(np.max(result.growth, initial=-np.inf, where=~unknown))
    curves = [{"x": curve[:, 0], "y": curve[:, 1]} for curve in result.boundaries]
    written = written_to(out, _FILES)
    if as_json:
        shares = {"unstable_share": unstable, "unknown_share": unsure}
        found = {"over": list(axes), **shares, "boundaries": curves}
        answer.print_json({"scene": scene, **found, "written": written})
        return
    rows = [(path, f"{v[0]:.6g} to {v[-1]:.6g}, {len(v)} values") for path, v in axes.items()]
    rows += [
        ("unstable", f"{100 * unstable:.3g} % of the grid"),
        *([("unknown", f"{100 * unsure:.3g} % of the grid")] if unsure else []),
        ("boundaries", f"{len(curves)} curves, {sum(len(c['x']) for c in curves)} points"),
        ("largest growth", f"{largest:.6g} 1/s"),
    ]
    answer.print_table([*rows, *answer.written(written)])


def _along(scene: str, rotor: Scene, axes: dict[str, np.ndarray], as_json: bool) -> None:
    """Print the values of one parameter at which stability changes."""
    ((path, values),) = axes.items()
    found, unit = stability_boundary(rotor, path, values), rotor.unit(path)
    changes = [
        {"value": float(value), "becomes": "unstable" if lost else "stable"}
        for value, lost in zip(found.values, found.lost, strict=True)
    ]
    if as_json:
        answer.print_json({"scene": scene, "path": path, "unit": unit, "changes": changes})
        return
    rows = [(f"{one['value']:.10g}", one["becomes"]) for one in changes]
    if not rows:
        rows = [("none", f"no change from {values[0]:.6g} to {values[-1]:.6g}")]
    answer.print_table(rows, (f"{path} [{unit}]", "becomes"), numbers=[0])


def _variables(result: StabilityMap) -> tuple[dict[str, Any], dict[str, Any]]:
    points = [np.append(curve, [[np.nan, np.nan]], axis=0) for curve in result.boundaries]
    curves = np.concatenate(points) if points else np.zeros((0, 2))
    lines = "points of the boundaries, NaN between two curves, in the units of the parameters"
    coordinates = {
        path: (path, values, about(unit, path))
        for path, values, unit in zip(result.paths, (result.x, result.y), result.units, strict=True)
    }
    return (
        {
            "growth": (result.paths, result.growth, about("1/s", "largest growth rate")),
            "boundary": (("point", "parameter"), curves, {"long_name": lines}),
        },
        coordinates | {"parameter": list(result.paths)},
    )


def _draw(result: StabilityMap, folder: Path, units: dict[str, Any]) -> None:
    from .. import plot

    draw(folder / "stability.png", lambda ax: plot.stability_map(result, ax), 120, 85, units=units)
