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

from .. import plot
from ..core.outcome import failed
from ..effects import AbstractBodies, AbstractContact
from ..files.toml import study
from ..scene import Scene
from ..solvers import Exponential
from ..spins import ConstantSpeed
from ..sweeps.axes import check_lanes
from ..sweeps.observe import AbstractObservable, WhirlSpectrum, everything
from ..sweeps.store import PENDING, OtherSweepError
from ..sweeps.sweep import KEEP, SETTLE, sweep as run
from . import answer, options
from .axis_units import axis_units, stored
from .interrupt import INTERRUPTED
from .output import draft, draw, written_to
from .sweep_answer import errors, lanes_of, results, sweep_rows


_FILES = ("sweep.zarr", "bifurcation.png", "waterfall.png", "envelope.png", "map.png")
_RUN = ("duration", "samples", "steps_per_sample")  # of runs along times
_PARTIAL = "sweep-partial.zarr"  # name of the store until it is complete
_COUNTS = {"settle": SETTLE, "keep": KEEP, "steps_per_revolution": 256}  # of a scene without


class Order(enum.StrEnum):
    """Orders of the exponential integrator."""

    second = "2"
    fourth = "4"


class Precision(enum.StrEnum):
    """Precisions in which lanes are stepped."""

    single = "float32"
    double = "float64"


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
    options.count(
        "Revolutions before observation begins. [default: the scene's, or 1000]", least=0
    ),
]
Keep = Annotated[int | None, options.count("Revolutions observed. [default: the scene's, or 300]")]
RunTimes = Annotated[
    str | None,
    typer.Option(
        metavar="START:STOP:COUNT",
        help="Samples of a run at the scene's spin, as 0:2s:2001, in place of whole revolutions.",
    ),
]
ErrorSample = Annotated[
    int | None,
    options.count(
        "Number of lanes run a second time with twice the steps; 0: no error estimate. [default: 4 "
        "with contact, else 0]",
        least=0,
    ),
]
OrderOf = Annotated[
    Order | None,
    typer.Option(help="Order of the exponential integrator. [default: 2 where it can be taken]"),
]
PrecisionOf = Annotated[
    Precision | None,
    typer.Option(
        help="Precision of the steps; with float32 a few lanes are run again in float64, as by "
        "--error-sample. [default: float64]",
    ),
]
Spectrum = Annotated[
    bool,
    typer.Option(
        "--spectrum",
        help="Store the spectrum of the whirl speed; over spin.speed also draw a waterfall.",
    ),
]
Workers = Annotated[
    int | None,
    options.count(
        "Number of parts computed in parallel. [default: one per core, or one per GPU]",
        most=1024,
    ),
]
Cluster = Annotated[
    str | None,
    typer.Option(
        metavar="ADDRESS",
        help="Dask scheduler whose workers compute instead, or number of processes to start here, "
        "each of which takes some seconds to import and compile. [needs `pip install distributed`]",
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
    scene: options.SceneName,
    settings: options.Settings = None,
    over: Over = None,
    settle: Settle = None,
    keep: Keep = None,
    times: RunTimes = None,
    steps: options.Steps = None,
    nodes: options.Nodes = None,
    tolerance: options.Tolerance = 1e-3,
    error_sample: ErrorSample = None,
    order: OrderOf = None,
    precision: PrecisionOf = None,
    start_radius: options.Radius = None,
    start_rate: options.Rate = None,
    start_angle: options.Angle = None,
    at: options.At = None,
    period: options.Period = None,
    spectrum: Spectrum = False,
    workers: Workers = None,
    cluster: Cluster = None,
    out: Folder = None,
    overwrite: options.Overwrite = False,
    as_json: options.AsJson = False,
) -> None:
    """Sweep a scene over parameters: many long motions, their data and bifurcation diagram or map.

    With --times the motions are runs at the scene's spin, a run-up for example, with peak and envelope,
    which is drawn in DIR/envelope.png. A scene whose speed varies runs to its end without them.

    Writes DIR/sweep.zarr (open it with `xarray.open_zarr`) and a picture: over one parameter
    DIR/bifurcation.png, over two DIR/map.png, the kind of motion. Lanes are stored in blocks of up to
    128: the same command resumes an interrupted sweep. Swept parameters, start and duration are those
    of the scene's `[sweep]` table unless options replace them.

    ```
    jaxrotor sweep limiter-rotor
    jaxrotor sweep limiter-rotor --settle 3000 --out runs/long
    jaxrotor sweep limiter-rotor --over limiters.gap=5mm:9mm:32 --over start.radius=1mm,12mm --out runs/gap
    jaxrotor sweep limiter-rotor --over spin.speed=4000rpm:9000rpm:101 --spectrum --out runs/speeds
    jaxrotor sweep limiter-rotor --times 0:0.2s:801 --over "limiters.gap=5mm:9mm:61" --out runs/up
    jaxrotor sweep limiter-rotor --cluster tcp://10.0.0.1:8786 --out /shared/run
    ```
    """
    rotor, table = options.scene_with(scene, settings), study(scene)
    axes = _axes(rotor, table, over, settings)
    start = options.start_with(table, start_radius, start_rate, start_angle, list(axes))
    counts = _counts(table, settle, keep, options.count_or_auto(steps, "--steps"))
    instant = None
    if times is not None or not isinstance(rotor.spin, ConstantSpeed):
        given = {"--settle": settle, "--keep": keep, "--period": period}
        options.refuse_revolutions(given | {"--spectrum": spectrum or None})
        counts = {"steps_per_revolution": counts["steps_per_revolution"]}
        instant = options.instants(rotor, None, options.SAMPLES, times)
    asked: dict[str, Any] = {
        "times": instant,
        "observe": _observables(rotor, spectrum, counts["steps_per_revolution"], instant),
        "solver": None if order is None else Exponential(2 if order is Order.second else 4),
        "at": options.moving_station(rotor) if at is None else options.place(rotor, at),
        "period": options.revolution(rotor, period),
        "workers": workers,
        "cluster": int(cluster) if cluster and cluster.isdecimal() else cluster,
        "nodes": options.count_or_auto(nodes, "--nodes"),
        "tolerance": tolerance,
        "error_sample": error_sample,
        "precision": None if precision is None else precision.value,
    }
    if out is None:
        out = Path("runs", f"{Path(scene).name.removesuffix('.toml')}-sweep")
    compute = functools.partial(run, rotor, axes, start=start, **counts, **asked)
    units = axis_units(scene, rotor, *over or (), *settings or (), start_radius)
    dataset, seconds = _computed(compute, list(axes), out, overwrite, units)
    told = ("steps_per_revolution", *_RUN)
    counts |= {name: dataset.attrs[name] for name in told if name in dataset.attrs}
    good = dataset["radius_max"].values[~failed(dataset["status"])]
    answer.note_large(float(good.max(initial=0.0)), float(rotor.shaft.length))
    written = written_to(out, _FILES)
    found = {**counts, **lanes_of(dataset), **errors(dataset), "seconds": seconds}
    rows = sweep_rows(dataset, axes, found, rotor, units)
    facts = {"scene": scene, **found, "written": written, "results": results(dataset, list(axes))}
    answer.give(as_json, facts, rows + answer.written(written))


def _computed(
    compute: Callable[..., xr.Dataset],
    swept: list[str],
    out: Path,
    overwrite: bool,
    units: dict[str, Any],
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
            _draw(dataset, swept, folder, units)
            told = xr.Dataset(attrs=dataset.attrs | stored(units))  # for `explore`
            told.to_zarr(partial, mode="a", zarr_format=2, consolidated=True)
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
        raise typer.Exit(INTERRUPTED) from None


def _axes(
    scene: Scene, table: dict[str, Any], over: list[str] | None, settings: list[str] | None
) -> dict[str, np.ndarray]:
    """Swept values by path: those of `--over`, else of the scene file; `--set` must not set any."""
    axes = options.swept_axes(scene, over) or table.get("over", {})
    if not axes:
        raise ValueError(
            "The scene names no parameters to sweep; add --over, as in "
            "--over spin.speed=600rpm:6000rpm:61."
        )
    check_lanes(axes)
    for path in options.assignments("--set", settings, ""):
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


def _observables(
    scene: Scene, spectrum: bool, steps: Any, times: Any
) -> tuple[AbstractObservable, ...]:
    """All observables of a scene, with the whirl spectrum if it is asked for."""
    contacts, balls = (bool(scene.of(kind)) for kind in (AbstractContact, AbstractBodies))
    drawn = {"balls": balls, "shafts": bool(scene.shafts)}
    found = everything(contacts, along_times=times is not None, **drawn)
    if spectrum:
        one = WhirlSpectrum()
        if steps != "auto" and steps % one.samples:
            raise ValueError(
                f"--spectrum needs --steps to be a multiple of {one.samples}, but it is {steps}."
            )
        found += (one,)
    return found


def _draw(dataset: xr.Dataset, swept: list[str], folder: Path, units: dict[str, Any]) -> None:
    paint = functools.partial(draw, units=units)
    if len(swept) == 2:  # by kind, or by the peak of runs without limiters
        name = None if "index" in dataset or "duty" in dataset else "peak"
        paint(folder / "map.png", lambda ax: plot.sweep_map(dataset, name, ax), 120, 90)
    if len(swept) != 1:
        return
    if "envelope" in dataset:
        if min(dataset.sizes[swept[0]], dataset.sizes["window"]) > 1:
            paint(folder / "envelope.png", lambda ax: plot.envelope(dataset, ax), 170, 90)
        return
    diagram = functools.partial(plot.bifurcation, dataset)
    paint(folder / "bifurcation.png", diagram, 170, 110, rows=2)
    if "spectrum" in dataset and swept == ["spin.speed"]:
        paint(folder / "waterfall.png", lambda ax: plot.waterfall(dataset, ax), 120, 85)
