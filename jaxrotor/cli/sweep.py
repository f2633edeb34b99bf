"""Command `sweep`: long-run motion over a grid of parameters."""

import contextlib
import enum
import functools
import shutil
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
import xarray as xr

from ..core.outcome import STATUS, failed
from ..effects import AbstractContact
from ..files.toml import study
from ..scene import Scene
from ..solvers import Exponential
from ..sweeps.axes import check_lanes
from ..sweeps.observe import AbstractObservable, WhirlSpectrum, everything
from ..sweeps.store import PENDING, OtherSweepError
from ..sweeps.sweep import sweep as run
from . import answer
from .options import (
    MOST,
    Angle,
    AsJson,
    At,
    Nodes,
    Overwrite,
    Period,
    Radius,
    Rate,
    SceneName,
    Settings,
    Steps,
    Tolerance,
    assignments,
    count_or_auto,
    optional,
    rpm,
    scene_with,
    start_with,
    swept_axes,
)
from .output import draft, draw, written_to


_FILES = ("sweep.zarr", "bifurcation.png", "waterfall.png", "map.png")
_PARTIAL = "sweep-partial.zarr"  # name of the store until it is complete
_COUNTS = {"settle": 1000, "keep": 300, "steps_per_revolution": 256}  # defaults of a scene without


class Order(enum.StrEnum):
    """Orders of the exponential integrator."""

    second = "2"
    fourth = "4"


Over = Annotated[
    list[str] | None,
    typer.Option(
        metavar="PATH=START:STOP:COUNT",
        help="Parameter to sweep, also `PATH=VALUE,VALUE,...`; may be repeated, then all "
        "combinations are run. [default: the scene's]",
    ),
]
Settle = Annotated[
    int | None,
    typer.Option(
        min=0,
        max=MOST,
        help="Revolutions before observation begins. [default: the scene's, or 1000]",
    ),
]
Keep = Annotated[
    int | None,
    typer.Option(min=1, max=MOST, help="Revolutions observed. [default: the scene's, or 300]"),
]
ErrorSample = Annotated[
    int,
    typer.Option(
        min=0,
        max=MOST,
        help="Number of lanes run a second time with twice the steps; 0: no error estimate.",
    ),
]
OrderOf = Annotated[Order, typer.Option(help="Order of the exponential integrator.")]
Spectrum = Annotated[
    bool,
    typer.Option(
        "--spectrum",
        help="Store the spectrum of the whirl speed; over spin.speed also draw a waterfall.",
    ),
]
Workers = Annotated[
    int | None,
    typer.Option(
        min=1,
        max=1024,
        help="Number of parts computed in parallel. [default: one per core, or one per GPU]",
    ),
]
Cluster = Annotated[
    str | None,
    typer.Option(
        metavar="ADDRESS",
        help="Dask scheduler whose workers compute instead, or number of processes to start here, "
        "each of which takes some seconds to import and compile. [needs jaxrotor\\[cluster]]",
    ),
]
Folder = Annotated[
    Path | None,
    typer.Option(
        metavar="DIR",
        help="Folder for sweep.zarr and its pictures. [default: runs/SCENE-sweep]",
    ),
]


def sweep(
    scene: SceneName,
    settings: Settings = None,
    over: Over = None,
    settle: Settle = None,
    keep: Keep = None,
    steps: Steps = None,
    nodes: Nodes = None,
    tolerance: Tolerance = 1e-3,
    error_sample: ErrorSample = 0,
    order: OrderOf = Order.second,
    start_radius: Radius = None,
    start_rate: Rate = None,
    start_angle: Angle = None,
    at: At = None,
    period: Period = None,
    spectrum: Spectrum = False,
    workers: Workers = None,
    cluster: Cluster = None,
    out: Folder = None,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """Sweep a scene over parameters: many long motions, their data and bifurcation diagram or map.

    Writes DIR/sweep.zarr (open it with `xarray.open_zarr`) and a picture: over one parameter
    DIR/bifurcation.png, over two DIR/map.png, the kind of motion. Lanes are stored in blocks of up to
    128: the same command resumes an interrupted sweep. Swept parameters, start and duration are those
    of the scene's `[sweep]` table unless options replace them.

    ```
    jaxrotor sweep limiter-rotor
    jaxrotor sweep limiter-rotor --settle 3000 --out runs/long
    jaxrotor sweep limiter-rotor --over "unbalance.eccentricity=0:1mm:32" --over start.radius=1mm,12mm
    jaxrotor sweep limiter-rotor --over spin.speed=4000rpm:9000rpm:101 --spectrum
    jaxrotor sweep limiter-rotor --cluster tcp://10.0.0.1:8786 --out /shared/run
    ```
    """
    rotor, table = scene_with(scene, settings), study(scene)
    axes = _axes(rotor, table, over, settings)
    start = start_with(table, start_radius, start_rate, start_angle, list(axes))
    counts = _counts(table, settle, keep, count_or_auto(steps, "--steps"))
    options: dict[str, Any] = {
        "observe": _observables(rotor, spectrum, counts["steps_per_revolution"]),
        "solver": Exponential(2 if order is Order.second else 4),
        "at": optional(at, "m", "--at"),
        "period": optional(period, "s", "--period"),
        "workers": workers,
        "cluster": int(cluster) if cluster and cluster.isdecimal() else cluster,
        "nodes": count_or_auto(nodes, "--nodes"),
        "tolerance": tolerance,
        "error_sample": error_sample,
    }
    if out is None:
        out = Path("runs", f"{Path(scene).name.removesuffix('.toml')}-sweep")
    compute = functools.partial(run, rotor, axes, start=start, **counts, **options)
    dataset, seconds = _computed(compute, list(axes), out, overwrite)
    counts["steps_per_revolution"] = dataset.attrs["steps_per_revolution"]
    good = dataset["radius_max"].values[~failed(dataset["status"])]
    answer.note_large(float(good.max(initial=0.0)), float(rotor.shaft.length))
    written = written_to(out, _FILES)
    if not as_json:
        _print(dataset, axes, counts, seconds, written)
        return
    found = {**counts, **_lanes(dataset), **_errors(dataset), "seconds": seconds}
    found |= {"written": written, "results": _results(dataset, list(axes))}
    answer.print_json({"scene": scene, **found})


def _computed(
    compute: Callable[..., xr.Dataset], swept: list[str], out: Path, overwrite: bool
) -> tuple[xr.Dataset, float]:
    """The data of a sweep, stored and drawn in a folder, and the time it took [s]."""
    partial = out / _PARTIAL
    with draft(out, _FILES, overwrite, unfinished=_PARTIAL) as folder:
        begun = time.perf_counter()
        with _interruption_reported(partial):
            try:
                dataset = compute(store=partial).load()
            except OtherSweepError as error:
                if not overwrite:
                    why = str(error).partition(";")[0]
                    raise ValueError(
                        f"{why}; add --overwrite to replace it, or choose another --out."
                    ) from None
                shutil.rmtree(partial)
                dataset = compute(store=partial).load()
            seconds = time.perf_counter() - begun
            _draw(dataset, swept, folder)
    partial.rename(out / "sweep.zarr")
    return dataset, seconds


@contextlib.contextmanager
def _interruption_reported(partial: Path) -> Iterator[None]:
    """Report the lanes that an interrupted run has stored."""
    try:
        yield
    except KeyboardInterrupt:
        if not partial.exists():
            raise
        done = xr.open_zarr(partial, chunks=None)["status"].values != PENDING
        typer.echo(
            f"Interrupted; {done.sum()} of {done.size} lanes are kept in {partial}; the same command "
            "continues from there.",
            err=True,
        )
        raise typer.Exit(130) from None


def _axes(
    scene: Scene, table: dict[str, Any], over: list[str] | None, settings: list[str] | None
) -> dict[str, np.ndarray]:
    """Swept values by path: those of `--over`, else of the scene file; `--set` must not set any."""
    axes = swept_axes(scene, over) or table.get("over", {})
    if not axes:
        raise ValueError(
            "The scene names no parameters to sweep; add --over, as in --over spin.speed=0:6000rpm:61."
        )
    check_lanes(axes)
    for path in assignments("--set", settings, ""):
        if path in axes:
            raise ValueError(
                f"--set {path} has no effect, as it is swept; sweep others with --over."
            )
    return axes


def _counts(table: dict[str, Any], *given: Any) -> dict[str, Any]:
    """Revolutions and steps: those given, else those of the scene's table, else the defaults."""
    return {
        name: table.get(name, default) if count is None else count
        for (name, default), count in zip(_COUNTS.items(), given, strict=True)
    }


def _observables(scene: Scene, spectrum: bool, steps: Any) -> tuple[AbstractObservable, ...]:
    """All observables of a scene, with the whirl spectrum if it is asked for."""
    found = everything(bool(scene.of(AbstractContact)))
    if spectrum:
        one = WhirlSpectrum()
        if steps != "auto" and steps % one.samples:
            raise ValueError(
                f"--spectrum needs --steps to be a multiple of {one.samples}, but it is {steps}."
            )
        found += (one,)
    return found


def _draw(dataset: xr.Dataset, swept: list[str], folder: Path) -> None:
    from .. import plot

    if len(swept) == 2:
        draw(folder / "map.png", lambda ax: plot.sweep_map(dataset, ax=ax), 120, 90)
    if len(swept) != 1:
        return
    size = min(max(250 / dataset.sizes[swept[0]], 1.0), 4.0)  # few lanes, large points

    def bifurcation(axes):
        plot.bifurcation(dataset, axes, size=size)

    draw(folder / "bifurcation.png", bifurcation, 170, 110, rows=2)
    if "spectrum" in dataset and swept == ["spin.speed"]:
        draw(folder / "waterfall.png", lambda ax: plot.waterfall(dataset, ax), 120, 85)


# === what is printed


def _range(path: str, values: np.ndarray, unit: str) -> str:
    """Description of a swept axis; a spin speed also in revolutions per minute."""
    low, high = values.min(), values.max()
    also = f" ({rpm(low):.6g} to {rpm(high):.6g} rpm)" if path == "spin.speed" else ""
    return f"{low:.6g} to {high:.6g} {unit}{also}, {values.size} values"


def _lanes(dataset: xr.Dataset) -> dict[str, Any]:
    """Number of lanes by whirl and status, and the range of the index over those that whirl."""
    index, status = dataset["index"].values, dataset["status"].values
    lost = failed(status)
    whirls = np.isfinite(index) & ~lost
    return {
        "lanes": index.size,
        "forward": np.sum(whirls & (index > 0)),
        "backward": np.sum(whirls & (index < 0)),
        "undefined": np.sum(~lost & ~(whirls & (index != 0))),
        "failed": np.sum(lost),
        "steps_too_long": np.sum(status == STATUS.index("steps_too_long_for_a_stop")),
        "index_min": index[whirls].min() if whirls.any() else None,
        "index_max": index[whirls].max() if whirls.any() else None,
    }


def _results(dataset: xr.Dataset, swept: list[str]) -> dict[str, Any]:
    """Swept values, and the variables with one number per lane."""
    coordinates = {
        path: {"units": dataset[path].attrs["units"], "values": dataset[path].values}
        for path in swept
    }
    single = {
        str(name): array.values
        for name, array in dataset.data_vars.items()
        if list(array.dims) == swept
    }
    return {"over": coordinates, **single}


def _errors(dataset: xr.Dataset) -> dict[str, Any]:
    """Changes of the numbers under twice the steps, where estimated, and the settings chosen."""
    named = {
        str(name): {
            "largest": array.attrs["error"],
            "median": array.attrs["error_median"],
            "units": array.attrs["units"],
        }
        for name, array in dataset.data_vars.items()
        if "error" in array.attrs
    }
    found: dict[str, Any] = {"errors": named} if "error_lane" in dataset.coords else {}
    return found | {key: value for key, value in dataset.attrs.items() if key == "chosen"}


def _print(
    dataset: xr.Dataset,
    axes: dict[str, np.ndarray],
    counts: dict[str, int],
    seconds: float,
    written: list[str],
) -> None:
    lanes = _lanes(dataset)
    rows = [(path, _range(path, v, dataset[path].attrs["units"])) for path, v in axes.items()]
    rows += [
        ("revolutions", f"{counts['settle']} to settle, {counts['keep']} observed"),
        ("solver", f"{dataset.attrs['solver']}, {counts['steps_per_revolution']} steps each"),
        ("lanes", f"{lanes['lanes']}"),
        ("forward whirl", f"{lanes['forward']}"),
        ("backward whirl", f"{lanes['backward']}"),
    ]
    rows += [(name, f"{lanes[name]}") for name in ("undefined", "failed") if lanes[name]]
    if lanes["steps_too_long"]:
        text = f"{lanes['steps_too_long']} lanes, contact too stiff for the step; increase --steps"
        rows.append(("steps too long", text))
    if lanes["index_min"] is not None:
        text = f"{lanes['index_min']:.6g} to {lanes['index_max']:.6g}"
        rows.append(("precession index", text))
    found = _errors(dataset)
    rows += [("chosen", found["chosen"])] if "chosen" in found else []
    for name, one in found.get("errors", {}).items():
        text = f"{one['median']:.1e} (median), {one['largest']:.1e} (largest) {one['units']}"
        rows.append((f"error of {name}", text))
    if "errors" in found:
        rows.append(("errors from", f"{dataset.sizes['error_lane']} lanes, with twice the steps"))
    rows.append(("time", f"{seconds:.1f} s"))
    rows += answer.written(written)
    answer.print_table(rows)
