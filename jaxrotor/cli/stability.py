"""Command `stability`: stable regions of a rotor over one parameter or two."""

from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from ..analysis import StabilityMap, growth_rate, stability_boundary, stability_map
from ..core.attributes import about
from ..scene import Scene
from . import answer
from .axis_units import axis_units, written_in
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

    ```
    jaxrotor stability limiter-rotor --over spin.speed=0:9000rpm:61
    jaxrotor stability limiter-rotor --over spin.speed=0:9000rpm:61 --over disc.mass=1:4:41 --out run
    ```
    """
    rotor = scene_with(scene, settings)
    axes = swept_axes(rotor, over)
    if len(axes) == 1:
        if out is not None:
            raise ValueError("--out is for a map; give --over a second time, or leave --out out.")
        _along(scene, rotor, axes, axis_units(scene, rotor, *over, *settings or ()), as_json)
        return
    units = axis_units(scene, rotor, *over, *settings or ())
    with draft_or_none(out, _FILES, overwrite) as folder:
        result = stability_map(rotor, axes)
        if folder is not None:
            data = labelled(_variables(result), "jaxrotor stability map", rotor)
            write_dataset(data, folder / "stability.zarr", units)
            _draw(result, folder, units)
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
    rows = []
    for path, v in axes.items():
        factor, unit = written_in(units, rotor.unit(path), v, rotor)
        rows.append((path, f"{factor * v[0]:.6g} to {factor * v[-1]:.6g} {unit}, {len(v)} values"))
    rows += [
        ("unstable", f"{100 * unstable:.3g} % of the grid"),
        *([("unknown", f"{100 * unsure:.3g} % of the grid")] if unsure else []),
        ("boundaries", f"{len(curves)} curves, {sum(len(c['x']) for c in curves)} points"),
        ("largest growth", f"{largest:.6g} 1/s"),
    ]
    answer.print_table([*rows, *answer.written(written)])


def _along(
    scene: str,
    rotor: Scene,
    axes: dict[str, np.ndarray],
    units: dict[str, Any],
    as_json: bool,
) -> None:
    """Print the values of one parameter at which stability changes, or what the rotor is throughout."""
    ((path, values),) = axes.items()
    found, unit = stability_boundary(rotor, path, values), rotor.unit(path)
    changes = [
        {"value": float(value), "becomes": "unstable" if lost else "stable"}
        for value, lost in zip(found.values, found.lost, strict=True)
    ]
    throughout = None if changes else _throughout(rotor, path, values)
    if as_json:
        told = {"path": path, "unit": unit, "changes": changes, "throughout": throughout}
        answer.print_json({"scene": scene, **told})
        return
    factor, unit = written_in(units, unit, values, rotor)
    rows = [(f"{factor * one['value']:.10g}", one["becomes"]) for one in changes]
    if throughout is not None:
        ends = f"{factor * values[0]:.6g} to {factor * values[-1]:.6g}"
        rows = [(ends, f"{throughout} throughout")]
    answer.print_table(rows, (f"{path} [{unit}]", "becomes" if changes else ""), numbers=[0])


def _throughout(rotor: Scene, path: str, values: np.ndarray) -> str:
    """State of a rotor whose stability does not change between values of a parameter."""
    ends = [float(growth_rate(rotor.replace({path: values[k]}))) for k in (0, -1)]
    if max(ends) > 0:
        return "unstable"
    return "neither damped nor unstable" if ends == [0.0, 0.0] else "stable"


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
