"""Command `accuracy`: error and cost of a number by every method."""

import enum
from functools import partial
from typing import Annotated, Any

import numpy as np
import typer
import xarray as xr

from .. import plot
from ..equations.rigid_motions import check_held
from ..equations.start import Launch
from ..files.toml import study
from ..work_precision import measures
from ..work_precision.accuracy import accuracy as run
from ..work_precision.methods import Method
from . import answer, options
from .axis_units import axis_units
from .output import files_in


_FILES = ("accuracy.zarr", "work-precision.png", "convergence.png")


class Quantity(enum.StrEnum):
    """Numbers whose accuracy is studied."""

    onset_speed = "onset-speed"
    root = "root"
    whirl_rate = "whirl-rate"
    precession = "index"
    peak_radius = "peak-radius"
    peak_force = "peak-force"
    duty = "duty"
    reaction = "reaction"
    final_speed = "final-speed"
    final_displacement = "final-displacement"
    final_imbalance = "final-imbalance"


_LONG = {  # quantities of a long motion, and their variables
    Quantity.whirl_rate: "whirl_rate",
    Quantity.precession: "index",
    Quantity.peak_radius: "radius_max",
    Quantity.peak_force: "peak_force",
    Quantity.duty: "duty",
}


def accuracy(
    scene: options.SceneName,
    settings: options.Settings = None,
    quantity: Annotated[
        Quantity, typer.Option(help="Number computed by every method.")
    ] = Quantity.onset_speed,
    method: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME",
            help="Use the methods whose name contains this, as in `--method Exponential`; may be "
            "repeated. [default: all that suit the quantity]",
        ),
    ] = None,
    number: Annotated[int, options.count("Index of the root; the slowest is 0.", least=0)] = 0,
    bearing: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="Bearing of the reaction, as named by `reactions`."),
    ] = None,
    settle: Annotated[int, options.count("Revolutions before observation begins.", least=0)] = 200,
    keep: Annotated[int, options.count("Revolutions observed.")] = 100,
    duration: options.Duration = None,
    samples: options.Samples = 101,
    times: options.Times = None,
    start_radius: options.Radius = None,
    start_rate: options.Rate = None,
    start_angle: options.Angle = None,
    at: options.At = None,
    lanes: Annotated[int, options.count("Number of equal long motions timed as one program.")] = 1,
    repeats: Annotated[
        int, options.count("Number of timed runs; the fastest counts.", most=1000)
    ] = 3,
    limit: Annotated[
        float,
        typer.Option(metavar="SECONDS", help="Leave out finer settings once a run took longer."),
    ] = 30.0,
    out: options.Out = None,
    overwrite: options.Overwrite = False,
    as_json: options.AsJson = False,
) -> None:
    """Accuracy against cost: error to a converged reference, compile time, run time and memory.

    With --out, DIR/accuracy.zarr, DIR/work-precision.png and DIR/convergence.png. A setting that fails
    is listed with its reason.

    ```
    jaxrotor accuracy limiter-rotor --quantity onset-speed --out run
    jaxrotor accuracy limiter-rotor --quantity whirl-rate --start-radius 12mm --start-rate=-441rad/s
    jaxrotor accuracy turbine-run-up --quantity reaction --bearing constraints.0 --duration 0.5s
    ```
    """
    rotor, table = options.scene_with(scene, settings), study(scene)
    start = options.start_with(table, start_radius, start_rate, start_angle)
    station = options.place(rotor, at)
    if quantity is Quantity.onset_speed:
        check_held(rotor, "The accuracy of an onset speed")
        measure = measures.OnsetSpeed()
    elif quantity is Quantity.root:
        measure = measures.Root(number)
    elif quantity in _LONG:
        measure = measures.LongRun(_LONG[quantity], start, settle, keep, station)  # type: ignore
    else:
        sampled = options.instants(rotor, duration, samples, times)
        measure = _of_run_up(quantity, sampled, bearing, Launch(start))
    methods = _named(measure.methods(), method)
    units = axis_units(scene, rotor, *settings or ())
    with files_in(out, _FILES, overwrite, units) as files:
        found = run(rotor, measure, methods, lanes=lanes, repeats=repeats, limit=limit)
        if out is not None:
            files.data(found)
            files.picture("work-precision.png", partial(plot.work_precision, found), 150, 105)
            files.picture("convergence.png", partial(plot.convergence, found), 150, 105)
    if as_json:
        answer.print_json({"scene": scene, **_summary(found), "written": files.written})
    else:
        _print(found, files.written)


def _of_run_up(quantity: Quantity, times: np.ndarray, bearing: str | None, start: Launch) -> Any:
    """Measure of a run-up sampled at `times` [s]."""
    if quantity is Quantity.reaction:
        if bearing is None:
            raise ValueError(
                "The bearing of the reaction is not given; add --bearing, as in --bearing constraints.0 "
                "(`jaxrotor reactions` lists them)."
            )
        return measures.Reaction(times, bearing, start=start)
    return measures.FinalState(times, quantity.value.removeprefix("final-"), start)  # type: ignore


def _named(methods: tuple[Method, ...], parts: list[str] | None) -> tuple[Method, ...]:
    """Methods whose name contains one of the parts."""
    if not parts:
        return methods
    for part in parts:
        if not any(part.lower() in one.name.lower() for one in methods):
            names = ", ".join(one.name for one in methods)
            raise ValueError(f"--method {part!r} is none of the methods; choose from: {names}.")
    return tuple(m for m in methods if any(part.lower() in m.name.lower() for part in parts))


def _summary(found: xr.Dataset) -> dict[str, Any]:
    names = ("method", "setting", *(str(name) for name in found.data_vars))
    reference = {k: v for k, v in found.attrs.items() if k.startswith("reference")}
    return reference | {name: found[name].values for name in names}


def _print(found: xr.Dataset, written: list[str]) -> None:
    heads = ("method", "setting", "value", "relative error", "compile", "run", "memory")
    rows, failed = [], []
    for i in range(found.sizes["run"]):
        one = {str(name): array.values[i] for name, array in found.variables.items()}
        if one["status"] != 0:
            failed.append((f"{one['method']}, {_short(one)}", str(one["reason"])))
            continue
        value = f"{one['value']:.9g}"
        if "value_imag" in one:
            value += f"{one['value_imag']:+.9g}j"
        rows.append(
            (
                str(one["method"]),
                _short(one),
                value,
                f"{one['relative_error']:.1e}",
                f"{one['compile_time']:.2f} s",
                f"{one['run_time']:.3g} s",
                "" if np.isnan(one["memory"]) else f"{one['memory'] / 1e6:.3g} MB",
            )
        )
    about = found.attrs
    value = complex(about["reference"], about.get("reference_imag", 0.0))
    text = f"{value.real:.12g}" + (f"{value.imag:+.12g}j" if value.imag else "")
    notes = {
        found["value"].attrs["long_name"]: f"{text} {found['value'].attrs['units']}",
        "uncertainty": f"{about['reference_uncertainty']:.1e}",
        "reference": about["reference_setting"],
        "failed": about["reference_reason"],
    }
    if about["lanes"] > 1:
        rate = f"up to {float(found['lane_rate'].max()):.4g} per second"
        notes["lanes"] = f"{about['lanes']}, {rate}"
    table = answer.Table(rows, heads, range(2, 7))
    answer.give(False, {}, table, failed, answer.filled(notes) + answer.written(written))


def _short(one: dict[str, Any]) -> str:
    """Setting that varies along a method."""
    axis = str(one["axis"])
    value = float(one[axis])
    return f"rtol {value:g}" if axis == "tolerance" else f"{value:g} {axis}"
