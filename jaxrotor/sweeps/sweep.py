"""Sweep: many trajectories, streamed into observables."""

import dataclasses
import functools
import itertools
import math
import os
from collections.abc import Mapping, Sequence
from typing import Any, Literal

import diffrax as dfx
import jax
import numpy as np
import xarray as xr

from ..core.checks import check_counts
from ..core.outcome import failed
from ..core.pilot import Pilot
from ..core.progress import progress as bar
from ..effects.base import AbstractContact
from ..equations.start import AbstractStart, AtRest
from ..equations.system import assemble, port_groups
from ..motion.base import Plan
from ..motion.revolutions import check_constant, revolution_rate
from ..motion.simulate import chosen_steps, with_nodes
from ..results.provenance import chosen
from ..scene import Scene, check_fixed_nodes
from ..solvers.choice import checked_solver
from ..solvers.control import step_control
from ..solvers.exponential import Exponential
from .cluster import crew
from .grid import Block, Gathered, block_shape, blocks
from .job import Job, coords_of, errors_of, points_of, provenance
from .lanes import Context, Stages
from .observe import AbstractObservable, everything
from .store import PENDING, Store, StoreError


PILOT_LANES = 4  # by which "auto" steps are chosen
MOST_LANES = 1_000_000_000  # of one sweep: the lists of what is to do take memory


def sweep(
    scene: Scene,
    over: Mapping[str, Any],
    *,
    start: AbstractStart | None = None,
    settle: int = 1000,
    keep: int = 300,
    observe: Sequence[AbstractObservable] | None = None,
    steps_per_revolution: int | Literal["auto"] = 256,
    nodes: int | Literal["auto"] | None = None,
    tolerance: float | int = 1e-3,
    error_sample: int = 0,
    carry: str | None = None,
    store: str | os.PathLike[str] | None = None,
    solver: Exponential | dfx.AbstractSolver | None = None,
    controller: dfx.AbstractStepSizeController | None = None,
    at: float | Any | None = None,
    period: float | None = None,
    lanes_per_chunk: int | None = None,
    workers: int | None = None,
    cluster: Any | None = None,
    progress: bool | None = None,
    max_steps: int = 4096,
) -> xr.Dataset:
    """Long-run motion over a grid of parameters, `settle` revolutions unseen and `keep` observed.

    Args:
        scene: what moves, at constant speed.
        over: values by parameter path; `start.radius` and its like sweep the starting state. All
            combinations are run.
        start: starting state of every lane, by default `AtRest()`.
        settle: revolutions before anything is observed (0 or more).
        keep: revolutions observed.
        observe: observables, by default `observe.everything()`, with contact where there is any.
        steps_per_revolution: as in `simulate`; "auto" takes as many as the most demanding of
            `PILOT_LANES` lanes, of those that converge.
        nodes: as in `simulate`.
        tolerance: as in `simulate`.
        error_sample: lanes to run again with twice the steps (and a tenth of the tolerance of an
            adaptive solver), spread over all. Of every number a lane has, the largest and the median
            difference are its attributes `error` and `error_median`; all are in `<name>_error`, over
            `error_lane`, the lane's number.
        carry: path of `over` whose values, ascending, are taken one after the other, up and then down,
            every lane going on from the state it has, after a failure from that before it; the data set is
            over `branch` ("up", "down") too.
        store: folder that chunks of lanes are written to, in Zarr format, as soon as they are done. A
            sweep that was stopped goes on when it is called again; that of another sweep is refused.
        solver: as in `simulate`.
        controller: as in `simulate`.
        at: station [m] to observe, by default as in `simulate`.
        period: as in `simulate`.
        lanes_per_chunk: trajectories run as one program, by default 128 (16384 on an accelerator).
        workers: chunks run at once, by default one a core, or one a GPU, each on its own.
        cluster: Dask cluster whose workers run the chunks: its address, a `distributed.Client`, or how
            many processes to start here for this sweep. Workers that see the folder of `store` write
            there themselves; what is found without one comes here. Needs `jaxrotor[cluster]`, the same
            versions everywhere.
        progress: whether to show a progress bar; by default on a terminal.
        max_steps: as in `simulate`.

    Returns:
        Dataset over the swept paths, not differentiable. `status` says of every lane whether it
        succeeded; a failed lane is kept and flagged. Attributes hold the scene and all settings. That of a
        `store` is read from the folder where it is looked at.
    """
    if lanes_per_chunk is None:  # on a core, more no longer fit the cache
        lanes_per_chunk = 128 if jax.default_backend() == "cpu" else 16384
    check_counts(keep=keep, lanes_per_chunk=lanes_per_chunk)
    if steps_per_revolution != "auto":
        check_counts(steps_per_revolution=steps_per_revolution)
    check_counts(0, error_sample=error_sample, settle=settle)
    check_constant(scene, "`sweep`")
    if carry is not None:
        over = _carried_first(over, carry, error_sample)
    start = AtRest() if start is None else start
    scene, pilots = with_nodes(scene, nodes, tolerance)
    axes = _axes(scene, start, over, period)
    together = _port_groups(scene, axes)
    if steps_per_revolution == "auto":
        run = {"solver": solver, "controller": controller, "at": at, "period": period}
        run |= {"max_steps": max_steps}
        pilots += (_chosen_steps(scene, start, axes, settle + keep, tolerance, run),)
        steps_per_revolution = pilots[-1].setting
    contacts = bool(scene.of(AbstractContact))
    if observe is None:
        observe = everything(contacts)
    observe = tuple(observe) if isinstance(observe, Sequence) else (observe,)
    for one in observe:
        if not isinstance(one, AbstractObservable):
            raise ValueError(f"`observe` must hold observables such as Section(), but has {one!r}.")
        one.check(steps_per_revolution, len(scene.of(AbstractContact)))
    stations = scene.stations(at)
    if stations.size > 1:
        raise ValueError(f"A sweep observes one station, but `at` names {stations.size}.")
    if "spin.speed" not in axes:
        revolution_rate(scene, period)
    plan = Plan(
        checked_solver(solver),
        controller,
        dfx.ForwardMode(),
        max_steps,
        steps_per_revolution,
        slopes=False,
        coordinates=False,
        contacts=any(one.needs_contact for one in observe),
        together=together,
        batch=True,
    )
    context = Context(scene, start, tuple(axes), plan, stations[0], period, observe, settle, keep)
    job = Job(context, axes, carry, Stages.fresh())
    about = provenance(context) | chosen(pilots) | {"carry": carry or "none"}
    with crew(cluster, workers) as hands:
        sink, todo, size = _placed_in(store, job, about, lanes_per_chunk, hands.count)
        again = _spread_over(job.lanes, error_sample)
        if not todo and np.array_equal(sink.finished().get("error_lane", []), again):
            again = again[:0]  # known already
        seconds, few = _again(again, lanes_per_chunk, hands.count)
        total = (len(todo) * job.rows + len(seconds)) * (settle + keep)
        with bar(progress, total, f"{job.lanes} lanes", "lane-revolutions", size) as tick:
            hands.each(functools.partial(job.run, size=size), todo, tick, sink)
            found = sink.finished()
            if (found["status"] == PENDING).any():
                raise StoreError(
                    f"{store} was changed while the sweep ran, and lanes are missing; the same sweep goes "
                    "on from what is there."
                )
            if failed(found["status"]).all():
                start.state(assemble(scene), stations[0])  # says so if the start is what is wrong
            if seconds:
                finer = dataclasses.replace(context, plan=_finer(plan))
                repeat = functools.partial(job.repeat, finer=finer, size=few)
                parts = hands.each(repeat, seconds, tick)
                repeated: Any = xr.concat(parts, "error_lane", data_vars="all")
                sink.add(*errors_of(found, repeated))
    return sink.finished()


# === before the run


def _placed_in(
    store: Any, job: Job, about: dict[str, Any], most: int, workers: int
) -> tuple[Gathered | Store, list[Block], int]:
    """Where results go, which blocks are still to be computed, and how large they are."""
    free = job.free
    block = dict(zip(free, block_shape(list(free.values()), most, workers), strict=True))
    coords = coords_of(job.context, job.dims)
    place = (coords, about, block)
    sink = Gathered(*place) if store is None else Store(store, *place)
    shape = [sink.block[path] for path in free]
    return sink, sink.pending(blocks(free, shape)), math.prod(shape)


def _again(lanes: np.ndarray, most: int, workers: int) -> tuple[list[np.ndarray], int]:
    """Chunks of lanes to run again, and the size they are padded to."""
    if not lanes.size:
        return [], 0
    (size,) = block_shape([lanes.size], most, workers)
    return [lanes[i : i + size] for i in range(0, lanes.size, size)], size


def _carried_first(over: Mapping[str, Any], carry: str, error_sample: int) -> dict[str, Any]:
    """The swept paths, first the one along which states are carried."""
    if carry not in over:
        raise ValueError(
            f"`carry` must be one of the paths of `over`, {', '.join(over)}, but is {carry!r}."
        )
    if carry.startswith("start."):
        raise ValueError(f"`carry` keeps the state of a lane, so it cannot be {carry!r}.")
    values = np.atleast_1d(np.asarray(over[carry], float))
    if values.size < 2 or not np.all(np.diff(values) > 0):
        raise ValueError(
            f"`over['{carry}']`, along which states are carried, must be two or more ascending numbers, "
            f"but is {values.tolist()}."
        )
    if error_sample:
        raise ValueError(
            "`error_sample` runs single lanes again, which `carry` has not; repeat the sweep with twice "
            "the `steps_per_revolution`."
        )
    return {carry: over[carry], **over}


def _spread_over(lanes: int, count: int) -> np.ndarray:
    """Numbers of some lanes, the first and the last among them."""
    return np.unique(np.linspace(0, lanes - 1, min(count, lanes)).round().astype(int))


def _finer(plan: Plan) -> Plan:
    """Twice the steps, and a tenth of the tolerance of a solver that chooses its own."""
    control: Any = plan.controller
    if control is None and isinstance(plan.solver, dfx.AbstractSolver):
        control = step_control(plan.solver)
    if isinstance(control, dfx.PIDController):
        control = dataclasses.replace(control, rtol=control.rtol / 10, atol=control.atol / 10)
    return dataclasses.replace(plan, steps=2 * plan.steps, controller=control)


def _chosen_steps(
    scene: Scene, start: AbstractStart, axes: Mapping[str, np.ndarray], revolutions, tolerance, run
) -> Pilot:
    """The most steps of a few lanes, of those that converge where any does."""
    lanes = _spread_over(math.prod(map(len, axes.values())), PILOT_LANES)
    pilots, failures = [], []
    for point in points_of(axes, lanes):
        changed, begin = placed(scene, start, dict(zip(axes, point, strict=True)))
        try:
            pilots.append(chosen_steps(changed, revolutions, tolerance, start=begin, **run))
        except (RuntimeError, ValueError) as error:  # a lane that fails; the others go on
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


def _axes(
    scene: Scene, start: AbstractStart, over: Mapping[str, Any], period: float | None
) -> dict[str, np.ndarray]:
    """Values by path, the least and the largest of them tried on the scene; what is allowed is a range."""
    if not over:
        raise ValueError(
            "`over` must name at least one parameter, such as {'spin.speed': speeds}; one trajectory "
            "is a job for `simulate`."
        )
    axes = {}
    for path, values in over.items():
        values = np.atleast_1d(np.asarray(values, float))
        if values.ndim != 1 or not values.size:
            raise ValueError(f"`over['{path}']` must be a list of numbers, but is {over[path]!r}.")
        for value in {values.min(), values.max(), *values[values == 0]}:  # zero speed is special
            changed, _ = placed(scene, start, {path: value})
            if path == "spin.speed":
                revolution_rate(changed, period)
        axes[path] = values
    check_lanes(axes)
    return axes


def check_lanes(axes: Mapping[str, Sequence[float] | np.ndarray]) -> None:
    """Raise where a grid has more lanes than one sweep can hold."""
    lanes = math.prod(map(len, axes.values()))
    if lanes > MOST_LANES:
        raise ValueError(
            f"A sweep of {lanes:.3g} lanes is more than one can hold ({MOST_LANES:.0e}); cut it along an "
            "axis, a sweep and a store each."
        )


def placed(scene: Scene, start: AbstractStart, values: Mapping[str, Any]):
    """Scene and start with values by path; `start.` paths go to the start."""
    own = {path: value for path, value in values.items() if not path.startswith("start.")}
    for path in values.keys() - own.keys():
        name = path.removeprefix("start.")
        names = [f for f in start.__dataclass_fields__ if f in ("radius", "rate", "angle")]
        if name not in names:
            raise ValueError(
                f"The start, {type(start).__name__}, has no `{name}`; it has: {', '.join(names) or '-'}. "
                "A start=jaxrotor.Whirl(..) has radius, rate and angle."
            )
        kept = {n: getattr(start, n) for n in names}
        start = type(start)(**(kept | {name: values[path]}))
    return scene.replace(own), start


def _port_groups(scene: Scene, axes: Mapping[str, np.ndarray]) -> tuple[tuple[int, ...], ...]:
    """Contacts that share a port at every point of the grid, of which all lengths make a valid scene."""
    for path in axes:
        check_fixed_nodes(scene, path)
    lengths = {
        path: values
        for path, values in axes.items()
        if path.endswith(".at") or (path.startswith("shaft.") and scene.unit(path) == "m")
    }
    groups = set()
    for point in itertools.product(*lengths.values()):
        changed = scene.replace(dict(zip(lengths, point, strict=True)))
        if changed.spans != scene.spans:
            raise ValueError(
                "The sweep moves a station past another; sweep each order of stations apart."
            )
        groups.add(port_groups(changed))
    if len(groups) == 1:
        return groups.pop()
    return tuple((i,) for group in port_groups(scene) for i in group)
