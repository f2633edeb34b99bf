"""Sweep: many trajectories, streamed into observables."""

import dataclasses
import functools
import math
import os
from collections.abc import Callable, Mapping, Sequence
from numbers import Real
from typing import Any, Literal

import diffrax as dfx
import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr

from ..core.checks import check_counts
from ..core.outcome import failed
from ..core.pilot import Pilot
from ..core.progress import progress as bar
from ..effects.base import AbstractBodies
from ..equations.massless_coordinates import Massless
from ..equations.rotating_frame import massless_in_steps
from ..equations.shared_nodes import with_shared_nodes
from ..equations.start import AbstractStart
from ..equations.system import assemble
from ..motion.base import Plan
from ..motion.pieces import check_always
from ..motion.revolutions import check_constant_speed, check_weight, revolution_rate
from ..motion.simulate import chosen_steps, with_nodes
from ..results.provenance import chosen
from ..scene import Scene
from ..solvers.choice import checked_solver, with_shapes
from ..solvers.exponential import Exponential
from .axes import (
    at_point,
    checked_axes,
    paths_of,
    shared_ports,
    values_by_path,
    with_carried_first,
)
from .cluster import executor
from .grid import Block, Gathered, block_shape, blocks
from .job import Job, check_rebounds, coords_of, errors_of, points_of
from .lanes import Context, Stages
from .observe import AbstractObservable, checked_observables
from .pace import (
    by_revolutions,
    check_carried,
    checked_times,
    finer,
    pace_of,
    start_of_lanes,
    stepped_by,
    windows_of,
)
from .store import PENDING, Store, StoreError


SETTLE, KEEP = 1000, 300  # revolutions, by default
PILOT_LANES = 4  # lanes by which "auto" steps are chosen


def sweep(
    scene: Scene,
    over: Mapping[str, Any],
    *,
    start: AbstractStart | None = None,
    settle: int | None = None,
    keep: int | None = None,
    times: Any | None = None,
    observe: Sequence[AbstractObservable] | None = None,
    steps_per_revolution: int | Literal["auto"] = 256,
    nodes: int | Literal["auto"] | None = None,
    tolerance: float | int = 1e-3,
    error_sample: int | None = None,
    carry: str | None = None,
    kick: float = 0.0,
    store: str | os.PathLike[str] | None = None,
    solver: Exponential | dfx.AbstractSolver | None = None,
    controller: dfx.AbstractStepSizeController | None = None,
    at: float | Any | None = None,
    period: float | str | None = None,
    lanes_per_chunk: int | None = None,
    workers: int | None = None,
    cluster: Any | None = None,
    progress: bool | None = None,
    max_steps: int | None = None,
    precision: str | None = None,
) -> xr.Dataset:
    """Motion over a grid of parameters, observed for `keep` revolutions after `settle` others.

    With `times` the lanes are motions along these times, at any speed, and are observed as a whole. As in
    `simulate`, what is drawn decides how lanes are stepped: exponential steps take all that they can, and
    any other scene is integrated, a window at a time.

    Args:
        scene: the rotor; without `times` at constant speed.
        over: values by parameter path; paths such as `start.radius` or `start.balls.0.angle` vary the
            starting state. All combinations are run. Paths that vary together are one entry,
            `{"lane": {"spin.speed": speeds, "unbalance.eccentricity": eccentricities}}`.
        start: starting state of every lane, by default `AtRest()`; `Launch(..)` places balls.
        settle: revolutions before anything is observed (0 or more), by default 1000.
        keep: revolutions observed, by default 300.
        times: evenly spaced times [s], several in a revolution, as motions are observed at these samples.
            What is before the first of them is not observed. The acceleration should jump at samples
            only; `settle`, `keep` and `carry` do not apply.
        observe: observables, by default `observe.everything()`, with contact where there is any.
        steps_per_revolution: as in `simulate`; "auto" takes as many as the most demanding of
            `PILOT_LANES` lanes, of those that converge. Of a run, steps a revolution at the highest speed.
        nodes: as in `simulate`.
        tolerance: as in `simulate`, and that of the shapes, see `solver`.
        error_sample: number of lanes, spread over all, to run again with twice the steps and in all
            coordinates, with a tenth of the tolerance of an adaptive solver; by default `PILOT_LANES`
            where exponential steps go through contact and no states are carried. The largest and the
            median change of every variable that has one number a lane are its attributes `error` and
            `error_median`; changes of single lanes are in `<name>_error`, over `error_lane`, their number.
            Lanes that `diverges` names, as chaotic ones, are left out of the attributes.
        carry: path of `over` whose values are taken one after the other, up and then down, or down and
            then up where they descend. Every lane continues from the state it has reached; after a
            failure, from the state before it. The data set is over `branch` ("up", "down") too.
        kick: angle [rad] by which the first ball is moved whenever a state is carried on. Balls that came
            to rest would leave a position that has become unstable by rounding alone.
        store: folder in Zarr format that every chunk of lanes is written to as soon as it is done. A
            sweep that was stopped continues when it is called again; a folder with another sweep is
            refused.
        solver: as in `simulate`. `Exponential(shapes="auto")` follows as many shapes as `PILOT_LANES`
            lanes need. Along `times` it is by default Exponential(..), where it can be taken: of order 2
            with contact, else, and where balls or a drive move with the rotor, of order 4.
        controller: as in `simulate`.
        at: station [m] to observe, by default as in `simulate`.
        period: as in `simulate`.
        lanes_per_chunk: trajectories run as one program, by default 128 (16384 on an accelerator).
        workers: chunks run at once, by default one a core, or one a GPU, each on its own.
        cluster: Dask cluster whose workers run the chunks: its address, a `distributed.Client`, or the
            number of processes to start here for this sweep. Workers that have access to the folder of
            `store` write there themselves; without a store, results are sent to this process. Needs
            `distributed`, with the same versions everywhere.
        progress: whether to show a progress bar; by default on a terminal.
        max_steps: steps an adaptive solver may take, by default 4096 a revolution, or 100 000 a window
            along `times` and where balls, drives or states of laws are integrated.
        precision: "float32" or "float64", in which lanes are stepped, by default that of jax. With
            "float32" equations, the coefficients of the steps and observables stay in float64, and
            `error_sample` is run in float64.

    Returns:
        Dataset over the swept paths, or over the name of paths that vary together, which are coordinates
        of it; not differentiable. `status` says of every lane whether it
        succeeded; a failed lane is kept and flagged. Attributes hold the scene and all settings. With a
        `store`, values are read from the folder when they are used.

    Raises:
        ValueError: if a setting or a swept value is not admissible, or the folder of `store` holds
            another sweep (`OtherSweepError`) or something else.
        RuntimeError: if the store cannot be written or was changed (`StoreError`), or the workers of a
            cluster are lost.
    """
    if lanes_per_chunk is None:  # on a core, more no longer fit the cache
        lanes_per_chunk = 128 if jax.default_backend() == "cpu" else 16384
    if steps_per_revolution != "auto":
        check_counts(steps_per_revolution=steps_per_revolution)
    given = {"settle": settle, "keep": keep, "carry": carry, "period": period}
    along = None if times is None else checked_times(times, given, steps_per_revolution)
    settle, keep = SETTLE if settle is None else settle, KEEP if keep is None else keep
    check_counts(keep=keep, lanes_per_chunk=lanes_per_chunk)
    check_counts(0, settle=settle, error_sample=error_sample or 0)
    if along is None:
        _check_scene(scene, over)
    _check_given(scene, carry, kick, precision)
    over = over if carry is None else with_carried_first(over, carry, error_sample or 0)
    station, scene = _station(scene, at), scene.to_simulate(at)[0]
    start = start_of_lanes(scene, start, paths_of(over))
    scene, pilots = with_nodes(scene, nodes, tolerance)
    axes = checked_axes(scene, start, over, period, revolve=along is None)
    columns = values_by_path(over, axes)
    scene = with_shared_nodes(scene, columns)
    pilot_lanes = functools.partial(_few_lanes, scene, start, axes, tuple(columns))
    steps = steps_per_revolution
    if steps == "auto":
        how = dict(solver=solver, controller=controller, at=at, period=period, max_steps=max_steps)
        pilots += (_chosen_steps(pilot_lanes(), settle + keep, tolerance, how),)
        steps = pilots[-1].setting
    pace = pace_of(scene, start, columns, (along, period), solver, controller, (steps, max_steps))
    check_carried(carry, pace, period, scene)
    if along is not None:
        settle, keep, steps = windows_of(along)
    elif "spin.speed" not in columns:
        revolution_rate(scene, period)
    scene = by_revolutions(scene) if pace is None else scene
    shaped = scene, solver, pilot_lanes, station, period, tolerance
    solver, massless, more = (solver, None, ()) if pace else _solver_of(*shaped)
    solver, controller, max_steps = stepped_by(pace, solver, controller, max_steps)
    observe = checked_observables(observe, scene, steps, along is not None)
    in_single = _in_single(precision, solver, pace)
    stepped = solver, controller, dfx.ForwardMode(), max_steps, steps
    plan = Plan(
        *stepped,
        slopes=False,
        coordinates=False,
        contacts=any(one.needs_contact for one in observe),
        together=shared_ports(scene, columns),
        batch=True,
        massless=massless,
    )
    lanes = scene, start, tuple(columns), plan, station, period, observe, settle, keep
    job = Job(Context(*lanes, pace, in_single), axes, carry, Stages.fresh(), kick)
    with executor(cluster, workers) as running:
        place = _place(store, job, chosen(pilots + more), lanes_per_chunk, running.count)
        return _run(job, place, error_sample, lanes_per_chunk, running, progress)


# === before the run


def _check_scene(scene: Scene, over: Mapping[str, Any]) -> None:
    """Raise unless the speed is constant, and the rotor held, if no swept support may hold it."""
    check_constant_speed(scene, "`sweep` without `times`")
    if not any(path.startswith("support") for path in paths_of(over)):
        check_weight(scene)


def _check_given(scene: Scene, carry: str | None, kick: float, precision: str | None) -> None:
    """Raise unless a kick and a precision are possible, and unbalance is there from the beginning."""
    _check_kick(carry, kick, scene)
    check_always(scene, "`sweep`", "run up to then, and sweep on from there, `start=motion.end`")
    _check_precision(precision)


def _check_kick(carry: str | None, kick: float, scene: Scene) -> None:
    """Raise unless there are balls that are carried on, for a kick to move."""
    if not isinstance(kick, Real) or not np.isfinite(kick):
        raise ValueError(f"`kick [rad]` must be a finite angle, but is {kick!r}.")
    if kick and (carry is None or not scene.of(AbstractBodies)):
        raise ValueError(
            f"`kick` moves a ball where `carry` takes its state on, but is {kick:g} without "
            f"{'`carry`' if carry is None else 'balls'}; leave it out."
        )


def _check_precision(precision: str | None) -> None:
    """Raise unless jax can compute with this precision."""
    if precision not in (None, "float32", "float64"):
        raise ValueError(f'`precision` must be "float32" or "float64", but is {precision!r}.')
    if precision == "float64" and jnp.zeros(()).dtype.name == "float32":
        raise ValueError(
            '`precision` is "float64", but jax computes in float32; set jax_enable_x64 first.'
        )


def _in_single(precision: str | None, solver: Any, pace: Any) -> bool:
    """Whether jax in double precision steps lanes in single precision; raises unless it can."""
    if precision in (None, jnp.zeros(()).dtype.name):
        return False
    if pace is not None or not isinstance(solver, Exponential) or solver.located:
        raise ValueError(
            '`precision` "float32" is for whole revolutions by Exponential() that is not `located`; leave '
            "it out."
        )
    return True


def _station(scene: Scene, at: Any) -> jax.Array:
    """The station to observe [m]."""
    stations = scene.stations(at)
    if stations.size > 1:
        raise ValueError(f"A sweep observes one station, but `at` names {stations.size}.")
    return stations[0]


def _few_lanes(
    scene: Scene, start: AbstractStart, axes: dict[str, np.ndarray], paths: tuple[str, ...]
) -> list[tuple[Scene, AbstractStart]]:
    """Scenes and starts of `PILOT_LANES` lanes, the first and the last among them."""
    few = _evenly_spread(math.prod(map(len, axes.values())), PILOT_LANES)
    points = points_of(axes, few)
    return [at_point(scene, start, dict(zip(paths, point, strict=True))) for point in points]


def _solver_of(
    scene: Scene,
    solver: Any,
    pilot_lanes: Callable[[], list[tuple[Scene, AbstractStart]]],
    station: jax.Array,
    period: float | str | None,
    tolerance: float | int,
) -> tuple[Any, Massless | None, tuple[Pilot, ...]]:
    """The solver of revolutions, with as many shapes as the most demanding of a few lanes needs.

    Beside it are the coordinates without mass, and the pilots.
    """
    system = assemble(scene)
    massless, solver = massless_in_steps(scene, system)[0], checked_solver(solver, system)
    if not isinstance(solver, Exponential) or solver.shapes is None:
        return solver, massless, ()
    scenes = [by_revolutions(scene) for scene, _ in pilot_lanes()]
    systems = [dataclasses.replace(assemble(scene), massless=massless) for scene in scenes]
    rates = [revolution_rate(scene, period) for scene in scenes]
    solver, pilots = with_shapes(solver, systems, rates, station[None], tolerance)
    return solver, massless, pilots


def _chosen_steps(
    lanes: Sequence[tuple[Scene, AbstractStart]], revolutions, tolerance, run
) -> Pilot:
    """The most steps of a few lanes, of those that converge where any does."""
    pilots, failures = [], []
    for scene, start in lanes:
        try:
            pilots.append(chosen_steps(scene, revolutions, tolerance, start=start, **run))
        except (RuntimeError, ValueError) as error:  # this lane fails; others may not
            failures.append(error)
    if not pilots:
        raise failures[-1]
    good = [pilot for pilot in pilots if pilot.converged]
    most = max(good or pilots, key=lambda pilot: pilot.setting)
    tried = len(pilots) + len(failures)
    if len(good) == tried:
        return most
    what = f"{most.what}, by {len(good)} of {tried} pilot lanes"
    worst = max(pilot.difference for pilot in pilots)
    return Pilot(what, most.setting, worst, most.tolerance, False)


def _evenly_spread(lanes: int, count: int) -> np.ndarray:
    """Numbers of so many lanes, the first and the last among them."""
    return np.unique(np.linspace(0, lanes - 1, min(count, lanes)).round().astype(int))


# === the run


def _place(
    store: Any, job: Job, pilots: dict[str, Any], most: int, workers: int
) -> tuple[Gathered | Store, list[Block], int]:
    """Where results go, which blocks are still to be computed, and the lanes of a block."""
    free = job.free
    block = dict(zip(free, block_shape(list(free.values()), most, workers), strict=True))
    settings = (coords_of(job.context, job.dims), job.identity() | pilots, block)
    sink = Gathered(*settings) if store is None else Store(store, *settings)
    shape = [sink.block[path] for path in free]
    return sink, sink.pending(blocks(free, shape)), math.prod(shape)


def _run(
    job: Job,
    place: tuple[Gathered | Store, list[Block], int],
    error_sample: int | None,
    most: int,
    running: Any,
    progress: bool | None,
) -> xr.Dataset:
    """Compute the blocks that are not in place yet, and errors from some lanes that are run again.

    Lanes are run again beside the first blocks, so that the programs of both compile at the same time.
    """
    (sink, todo, size), context = place, job.context
    if error_sample is None:
        stepped = isinstance(context.plan.solver, Exponential)
        checked = context.in_single or (stepped and bool(context.plan.together))
        error_sample = PILOT_LANES * (checked and job.carry is None)
    sample = _evenly_spread(job.lanes, error_sample)
    if not todo and np.array_equal(sink.finished().get("error_lane", []), sample):
        sample = sample[:0]  # their errors are known already
    again, sample_size = _chunks(sample, most, running.count)
    total = (len(todo) * job.rows + len(again)) * (context.settle + context.keep)
    sizes = {"size": size, "sample_size": sample_size}
    run = functools.partial(job.run, finer=finer(context), **sizes)
    with bar(progress, total, f"{job.lanes} lanes", "lane-revolutions", size) as tick:
        parts = running.each(run, [*todo[:1], *again, *todo[1:]], tick, sink)
        found = sink.finished()
        if isinstance(sink, Store) and (found["status"] == PENDING).any():
            raise StoreError(
                f"{sink.path} was changed while the sweep ran, and lanes are missing; the same sweep "
                "goes on from what is there."
            )
        if failed(found["status"]).all():  # raises if the start is what is wrong
            context.start.state(assemble(context.scene), context.station)
        if again:
            of_sample = [part for part in parts if part is not None]
            repeated: Any = xr.concat(of_sample, "error_lane", data_vars="all")
            sink.add(*errors_of(found, repeated))
    found = sink.finished()
    check_rebounds(context, found)
    return found


def _chunks(lanes: np.ndarray, most: int, workers: int) -> tuple[list[np.ndarray], int]:
    """Chunks of some lanes, and the size that each is padded to."""
    if not lanes.size:
        return [], 0
    (size,) = block_shape([lanes.size], most, workers)
    return [lanes[i : i + size] for i in range(0, lanes.size, size)], size
