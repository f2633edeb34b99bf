"""Command `stability`: stable regions of a rotor over one parameter or two."""

from functools import partial
from typing import Annotated, Any

import numpy as np
import typer

from .. import plot
from ..analysis import StabilityMap, growth_rate, stability_boundary, stability_map
from ..core.attributes import variable
from ..scene import Scene
from . import answer, options
from .axis_units import axis_units, ends_in, written_in
from .output import files_in, labelled


_FILES = ("stability.zarr", "stability.png")


def stability(
    scene: options.SceneName,
    over: Annotated[
        list[str],
        typer.Option(
            metavar="PATH=START:STOP:COUNT",
            help="Parameter to vary: one for the values at which stability changes, two for a map.",
        ),
    ],
    settings: options.Settings = None,
    out: options.Out = None,
    overwrite: options.Overwrite = False,
    as_json: options.AsJson = False,
) -> None:
    """Boundaries of stability along one parameter, or a stability map over two, without contact.

    With --out and two parameters, DIR/stability.zarr and DIR/stability.png.

    ```
    jaxrotor stability limiter-rotor --over spin.speed=0:9000rpm:61
    jaxrotor stability limiter-rotor --over spin.speed=0:9000rpm:61 --over disc.mass=1:4:41 --out run
    ```
    """
    rotor = options.scene_with(scene, settings)
    axes, units = options.swept_axes(rotor, over), axis_units(scene, rotor, *over, *settings or ())
    if len(axes) == 1:
        if out is not None:
            raise ValueError("--out is for a map; give --over a second time, or leave --out out.")
        _along(scene, rotor, axes, units, as_json)
        return
    with files_in(out, _FILES, overwrite, units) as files:
        result = stability_map(rotor, axes)
        if out is not None:
            files.data(_dataset(result, rotor))
            files.picture("stability.png", partial(plot.stability_map, result), 120, 85)
    unknown = np.isnan(result.growth)
    unstable, unsure = float(np.mean(result.growth > 0)), float(np.mean(unknown))
    largest = float(np.max(result.growth, initial=-np.inf, where=~unknown))
    curves = [{"x": curve[:, 0], "y": curve[:, 1]} for curve in result.boundaries]
    facts = {"scene": scene, "over": list(axes), "unstable_share": unstable}
    facts |= {"unknown_share": unsure, "boundaries": curves, "written": files.written}
    rows = [
        (path, f"{ends_in(units, rotor.unit(path), v, rotor)}, {len(v)} values")
        for path, v in axes.items()
    ]
    shares = {
        "unstable": f"{100 * unstable:.3g} % of the grid",
        "unknown": f"{100 * unsure:.3g} % of the grid" if unsure else "",
        "boundaries": f"{len(curves)} curves, {sum(len(c['x']) for c in curves)} points",
        "largest growth": f"{largest:.6g} 1/s",
    }
    answer.give(as_json, facts, [*rows, *answer.filled(shares), *files.rows])


def _along(
    scene: str, rotor: Scene, axes: dict[str, np.ndarray], units: dict[str, Any], as_json: bool
) -> None:
    """Print the values of one parameter at which stability changes, or what the rotor is throughout."""
    ((path, values),) = axes.items()
    found, unit = stability_boundary(rotor, path, values), rotor.unit(path)
    changes = [
        {"value": float(value), "becomes": "unstable" if lost else "stable"}
        for value, lost in zip(found.values, found.lost, strict=True)
    ]
    throughout = None if changes else _throughout(rotor, path, values)
    facts = {"scene": scene, "path": path, "unit": unit, "changes": changes}
    facts["throughout"] = throughout
    factor, unit = written_in(units, unit, values, rotor)
    rows = [(f"{factor * one['value']:.10g}", one["becomes"]) for one in changes]
    if throughout is not None:
        ends = f"{factor * values[0]:.6g} to {factor * values[-1]:.6g}"
        rows = [(ends, f"{throughout} throughout")]
    heads = (f"{path} [{unit}]", "becomes" if changes else "")
    answer.give(as_json, facts, answer.Table(rows, heads, [0]))


def _throughout(rotor: Scene, path: str, values: np.ndarray) -> str:
    """State of a rotor whose stability does not change between values of a parameter."""
    ends = [float(growth_rate(rotor.replace({path: values[k]}))) for k in (0, -1)]
    if max(ends) > 0:
        return "unstable"
    return "neither damped nor unstable" if ends == [0.0, 0.0] else "stable"


def _dataset(result: StabilityMap, rotor: Scene) -> Any:
    points = [np.append(curve, [[np.nan, np.nan]], axis=0) for curve in result.boundaries]
    curves = np.concatenate(points) if points else np.zeros((0, 2))
    lines = "points of the boundaries, NaN between two curves, in the units of the parameters"
    columns = {
        "growth": variable(result.paths, result.growth, "1/s", "largest growth rate"),
        "boundary": (("point", "parameter"), curves, {"long_name": lines}),
    }
    axes = zip(result.paths, (result.x, result.y), result.units, strict=True)
    coordinates: dict[str, Any] = {path: variable(path, v, unit, path) for path, v, unit in axes}
    coordinates["parameter"] = list(result.paths)
    return labelled(columns, coordinates, "jaxrotor stability map", rotor)
