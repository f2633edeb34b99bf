"""Sweep: many trajectories, streamed into observables."""

import dataclasses
import itertools
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Literal, NamedTuple

import diffrax as dfx
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr
from jaxtyping import Array, Float

from .chunks import chunk_size, cores, first_alone, progress as bar, segments, spread
from .dataset import assumed, chosen, versions
from .effects.base import AbstractContact
from .files import dumps
from .march import QUICKLY, March, Plan
from .observe import AbstractObservable, Turn, Variable, everything
from .outcome import STATUS, Outcome, statuses, too_long
from .pilot import Pilot
from .quantities import quantity_units
from .scene import Scene
from .simulate import (
    check_constant,
    check_counts,
    checked_solver,
    chosen_steps,
    revolution_rate,
    solver_name,
    with_nodes,
)
from .solvers.basis import well_conditioned
from .solvers.control import step_control
from .solvers.exponential import Exponential
from .solvers.ports import PortForm
from .start import AbstractStart, AtRest
from .system import assemble, port_groups


PILOT_LANES = 4  # by which "auto" steps are chosen


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
    solver: Exponential | dfx.AbstractSolver | None = None,
    controller: dfx.AbstractStepSizeController | None = None,
    at: float | Any | None = None,
    period: float | None = None,
    lanes_per_chunk: int | None = None,
    workers: int | None = None,
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
        solver: as in `simulate`.
        controller: as in `simulate`.
        at: station [m] to observe, by default as in `simulate`.
        period: as in `simulate`.
        lanes_per_chunk: trajectories run as one program, by default 128 (16384 on an accelerator).
        workers: chunks run at once, by default one a core (one on an accelerator).
        progress: whether to show a progress bar; by default on a terminal.
        max_steps: as in `simulate`.

    Returns:
        Dataset over the swept paths, not differentiable. `status` says of every lane whether it
        succeeded; a failed lane is kept and flagged. Attributes hold the scene and all settings.
    """
    if lanes_per_chunk is None:  # on a core, more no longer fit the cache
        lanes_per_chunk = 128 if jax.default_backend() == "cpu" else 16384
    check_counts(keep=keep, lanes_per_chunk=lanes_per_chunk)
    if steps_per_revolution != "auto":
        check_counts(steps_per_revolution=steps_per_revolution)
    if isinstance(error_sample, bool) or not isinstance(error_sample, int) or error_sample < 0:
        raise ValueError(
            f"`error_sample` must be a whole number of at least 0, but is {error_sample!r}."
        )
    if isinstance(settle, bool) or not isinstance(settle, int | np.integer) or settle < 0:
        raise ValueError(f"`settle` must be a whole number of at least 0, but is {settle!r}.")
    check_constant(scene, "`sweep`")
    start = AtRest() if start is None else start
    scene, pilots = with_nodes(scene, nodes, tolerance)
    axes = _axes(scene, start, over, period)
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
        together=_port_groups(scene, axes),
        batch=True,
    )
    points = _points(axes)
    again = _spread_over(len(points), error_sample)
    context = _Context(scene, start, tuple(axes), plan, stations[0], period, observe, settle, keep)
    finer = dataclasses.replace(context, plan=_finer(plan))
    workers = cores(workers)
    chunks, size = _chunked(points, lanes_per_chunk, workers)
    seconds, few = _chunked(points[again], lanes_per_chunk, workers)
    total = (len(chunks) + len(seconds)) * (settle + keep)
    with bar(progress, total, f"{len(points)} lanes") as tick:
        stages = tuple(map(first_alone, (_prepare, _skip, _keep)))
        run = lambda points, tick: _run_chunk(context, stages, points, size, tick)
        results = _joined(spread(run, chunks, workers, tick))
        run = lambda points, tick: _run_chunk(finer, stages, points, few, tick)
        repeated = _joined(spread(run, seconds, workers, tick)) if seconds else None
    if not results.outcome.ok.any():
        start.state(assemble(scene), stations[0])  # says so if the start is what is wrong
    found = _dataset(context, axes, results)
    found.attrs |= chosen(pilots)
    if repeated is not None:
        _add_errors(found, context, again, results, repeated)
    return found


class _Context(eqx.Module):
    """What all chunks of a sweep share."""

    scene: Scene
    start: AbstractStart
    paths: tuple[str, ...] = eqx.field(static=True)
    plan: Plan
    station: Float[Array, ""]
    period: float | None = eqx.field(static=True)
    observe: tuple[AbstractObservable, ...]
    settle: int = eqx.field(static=True)
    keep: int = eqx.field(static=True)


class _Lanes(NamedTuple):
    """What comes of lanes, all with the lanes in front."""

    carries: tuple  # of the observables
    stored: tuple  # by the observables of every kept revolution
    outcome: Outcome
    started: np.ndarray  # whether there is a state to start from
    bounce: np.ndarray  # (lanes, 2), see `March.bounce`


# === before the run


def _points(axes: Mapping[str, np.ndarray]) -> np.ndarray:
    """All combinations, (lanes, paths)."""
    return np.array(list(itertools.product(*axes.values()))).reshape(-1, len(axes))


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


def _chunked(points: np.ndarray, most: int, workers: int) -> tuple[list[np.ndarray], int]:
    """Chunks of lanes, and the size they are padded to."""
    if not len(points):
        return [], 0
    size = chunk_size(len(points), most, workers)
    return [points[i : i + size] for i in range(0, len(points), size)], size


def _chosen_steps(
    scene: Scene, start: AbstractStart, axes: Mapping[str, np.ndarray], revolutions, tolerance, run
) -> Pilot:
    """The most steps of a few lanes, of those that converge where any does."""
    points = _points(axes)
    pilots, failures = [], []
    for point in points[_spread_over(len(points), PILOT_LANES)]:
        changed, begin = _placed(scene, start, dict(zip(axes, point, strict=True)))
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
            changed, _ = _placed(scene, start, {path: value})
            if path == "spin.speed":
                revolution_rate(changed, period)
        axes[path] = values
    for changed in _rearranged(scene, axes):
        if changed.spans != scene.spans:
            raise ValueError(
                "The sweep moves a station past another; sweep each order of stations apart."
            )
    return axes


def _rearranged(scene: Scene, axes: Mapping[str, np.ndarray]) -> Iterator[Scene]:
    """The scene with every combination of the lengths that are swept, each a valid scene."""
    lengths = {
        path: values
        for path, values in axes.items()
        if path.endswith(".at") or path.startswith("shaft.")
    }
    for point in itertools.product(*lengths.values()):
        yield scene.replace(dict(zip(lengths, point, strict=True)))


def _placed(scene: Scene, start: AbstractStart, values: Mapping[str, Any]):
    """Scene and start with values by path; `start.` paths go to the start."""
    own = {path: value for path, value in values.items() if not path.startswith("start.")}
    for path in values.keys() - own.keys():
        name = path.removeprefix("start.")
        names = [f for f in start.__dataclass_fields__ if f in ("radius", "rate", "angle")]
        if name not in names:
            raise ValueError(
                f"The start, {type(start).__name__}, has no `{name}`; it has: {', '.join(names) or '-'}."
            )
        kept = {n: getattr(start, n) for n in names}
        start = type(start)(**(kept | {name: values[path]}))
    return scene.replace(own), start


def _port_groups(scene: Scene, axes: Mapping[str, np.ndarray]) -> tuple[tuple[int, ...], ...]:
    """Contacts that share a port at every point of the grid."""
    groups = {port_groups(changed) for changed in _rearranged(scene, axes)}
    if len(groups) == 1:
        return groups.pop()
    return tuple((i,) for group in port_groups(scene) for i in group)


# === a chunk of lanes


def _run_chunk(context: _Context, stages, points: np.ndarray, size: int, tick) -> _Lanes:
    """Observables of a chunk by its three `stages`."""
    prepare, skip, keep = stages
    lanes = len(points)
    padded = np.concatenate([points, np.repeat(points[-1:], size - lanes, axis=0)])
    shared, own, y, bounce = prepare(context, padded)
    started = np.isfinite(y).reshape(size, -1).all(axis=1)
    good = Outcome.good(size)
    for revolutions in segments(context.settle):
        y, ok = skip(shared, own, y, revolutions)
        good = good & ok
        tick(revolutions)
    contacts = sum(len(group) for group in context.plan.together)
    begin = tuple(one.start(contacts) for one in context.observe)
    # By way of numpy: weak types, which a program does not return, would have it compiled twice.
    lanes_of = lambda leaf: jax.device_put(np.broadcast_to(leaf, (size, *np.shape(leaf))))
    carry = jax.tree.map(lanes_of, begin)
    stored, number = [], 0
    for revolutions in segments(context.keep):
        (y, carry, ok), out = keep(
            context.observe, shared, own, y, carry, jnp.asarray(number), context.keep, revolutions
        )
        good = good & ok
        number += revolutions
        stored.append(jax.tree.map(lambda leaf: np.asarray(leaf)[:lanes], out))
        tick(revolutions)
    stored = jax.tree.map(lambda *parts: np.concatenate(parts, axis=1), *stored)
    mine = lambda tree: jax.tree.map(lambda leaf: np.asarray(leaf)[:lanes], tree)
    return _Lanes(mine(carry), stored, mine(good), started[:lanes], bounce[:lanes])


def _prepare(context: _Context, points: np.ndarray):
    """Marches of the lanes, split into what all share and what each has of its own; states, bounces.

    Lanes are prepared one after the other: linear algebra batched over lanes is where XLA on the
    CPU has been seen to wait for ever (jax 0.10.2, two cores). Values tell what is shared.
    """
    plan = context.plan
    if isinstance(plan.solver, Exponential) and plan.solver.basis == "auto":
        march, *begun = _build_lanes(context, _with_basis(plan, plan.solver, "modal"), points)
        if isinstance(march.form, PortForm) and not well_conditioned(march.form.basis.vectors):
            march, *begun = _build_lanes(context, _with_basis(plan, plan.solver, "dense"), points)
    else:
        march, *begun = _build_lanes(context, plan, points)
    arrays, constant = eqx.partition(march, eqx.is_array)
    equal = jax.tree.map(lambda leaf: bool((leaf == leaf[:1]).all()), arrays)
    shared = jax.tree.map(
        lambda leaf, same: jax.device_put(leaf[0]) if same else None, arrays, equal
    )
    own = jax.tree.map(lambda leaf, same: None if same else jax.device_put(leaf), arrays, equal)
    y, bounce = begun
    return eqx.combine(shared, constant), own, jax.device_put(y), bounce


def _with_basis(plan: Plan, solver: Exponential, basis: Literal["modal", "dense"]) -> Plan:
    return eqx.tree_at(lambda p: p.solver, plan, dataclasses.replace(solver, basis=basis))


def _build_lanes(
    context: _Context, plan: Plan, points: np.ndarray
) -> tuple[March, np.ndarray, np.ndarray]:
    cpu = jax.local_devices(backend="cpu")[0]
    parts = (context.scene, plan, context.start, context.station, context.period)
    with jax.default_device(cpu):  # small matrices, one lane after the other
        lanes, constant = _build_all(*parts, context.paths, jnp.asarray(points))
    return eqx.combine(jax.device_get(lanes), constant)


def _build_lane_by_lane(
    scene, plan, start, station, period, paths, points: Float[Array, "lanes d"]
):
    constant = []  # what is no array and the same for every lane: known once a lane is traced

    def one(point):
        built = _build(scene, plan, start, station, period, paths, point)
        arrays, rest = eqx.partition(built, eqx.is_array)
        constant.append(rest)
        return arrays

    return jax.lax.map(one, points), constant[0]


# Runs once for a chunk: to compile it well takes longer than all its runs.
_build_all = eqx.filter_jit(_build_lane_by_lane, **QUICKLY)


def _build(
    scene: Scene, plan: Plan, start: AbstractStart, station, period, paths, point
) -> tuple[March, Array, Float[Array, "2"]]:
    """A lane's march, its state at the start, and how hard its stops answer."""
    values = dict(zip(paths, point, strict=True))
    scene = scene.put({p: v for p, v in values.items() if not p.startswith("start.")})
    for path in values:
        if path.startswith("start."):
            name = path.removeprefix("start.")
            start = eqx.tree_at(lambda s, n=name: getattr(s, n), start, values[path])
    march = March.build(scene, plan, revolution_rate(scene, period), station[None])
    return march, march.begin(start, station), march.bounce


@eqx.filter_jit
def _skip(shared: March, own: March, y: Array, revolutions: int):
    return jax.vmap(lambda own, y: eqx.combine(own, shared).skip(y, revolutions))(own, y)


@eqx.filter_jit
def _keep(observe, shared: March, own: March, y, carry, number, count: int, revolutions: int):
    """Some kept revolutions from the `number`-th on, of `count` in all."""

    def lane(own: March, y, carry):
        def update(state, orbit):
            number, carries = state
            turn = Turn.of(orbit, number, count)
            pairs = [one.update(c, turn) for one, c in zip(observe, carries, strict=True)]
            return (number + 1, tuple(c for c, _ in pairs)), tuple(out for _, out in pairs)

        march = eqx.combine(own, shared)
        (y, (_, carry), ok), out = march.collect(y, (number, carry), update, revolutions)
        return (y, carry, ok), out

    return jax.vmap(lane)(own, y, carry)


# === after the run


def _joined(results: list[_Lanes]) -> _Lanes:
    """All lanes, from those of chunks."""
    return jax.tree.map(lambda *parts: np.concatenate(parts), *results)


def _reported(context: _Context, results: _Lanes) -> dict[str, Variable]:
    """Variables by name, lanes in front."""
    data: dict[str, Variable] = {}
    for one, last, out in zip(context.observe, results.carries, results.stored, strict=True):
        data |= one.report(last, out, context.keep)
    return data


def _add_errors(found: xr.Dataset, context: _Context, lanes, results: _Lanes, repeated: _Lanes):
    """What twice the steps change in the numbers of some lanes."""
    before, after = (_reported(context, one) for one in (results, repeated))
    good = results.outcome.ok[lanes] & repeated.outcome.ok
    for name, one in before.items():
        if one.dims not in ((), ("limiter",)) or name == "extrema_missed":
            continue
        off = np.abs(np.asarray(after[name].values) - np.asarray(one.values)[lanes])
        off[~good] = np.nan
        about = {"units": one.units, "long_name": f"change of {one.long_name} by twice the steps"}
        found[f"{name}_error"] = (("error_lane", *one.dims), off, about)
        known = off[np.isfinite(off)]
        if known.size:
            found[name].attrs["error"] = float(known.max())
            found[name].attrs["error_median"] = float(np.median(known))
    found.coords["error_lane"] = ("error_lane", lanes, {"long_name": "lane that was run again"})


def _dataset(context: _Context, axes: Mapping[str, np.ndarray], results: _Lanes) -> xr.Dataset:
    good = results.outcome
    shape = tuple(len(values) for values in axes.values())
    data = _reported(context, results)
    coords: dict[str, Any] = {
        path: (path, values, {"units": _unit(context, path)}) for path, values in axes.items()
    }
    undefined = np.zeros(len(good.ok), bool)
    for name in ("index", "whirl_rate"):
        if name in data:
            undefined |= np.isnan(data[name].values)
    overlong = np.zeros(len(good.ok), bool)
    if isinstance(context.plan.solver, Exponential):
        overlong = np.asarray(good.touched) & too_long(results.bounce, context.plan.solver.order)
    status = statuses(good, results.started, undefined, overlong)
    variables: dict[str, Any] = {}
    for name, one in data.items():
        attrs = {"units": one.units, "long_name": one.long_name}
        if one.dims == (name,):
            coords[name] = (one.dims, one.values, attrs)
            continue
        values = np.asarray(one.values)
        values = values.reshape(shape + values.shape[1:])
        variables[name] = ((*axes, *one.dims), values, attrs)
    if any("axis" in one.dims for one in data.values()):
        coords["axis"] = ("axis", ["x", "y"])
    variables["status"] = (
        tuple(axes),
        status.reshape(shape),
        {
            "long_name": "outcome of the lane",
            "flag_values": list(range(len(STATUS))),
            "flag_meanings": " ".join(STATUS),
        },
    )
    if getattr(context.plan.solver, "located", False):
        about = {"units": "1", "long_name": "steps whose changes of contact were not located"}
        variables["unresolved"] = (tuple(axes), good.unresolved.reshape(shape), about)
    return xr.Dataset(variables, coords, _provenance(context))


def _unit(context: _Context, path: str) -> str:
    if path.startswith("start."):
        return quantity_units(context.start)[path.removeprefix("start.")]
    return context.scene.unit(path)


def _provenance(context: _Context) -> dict[str, Any]:
    plan = context.plan
    return {
        "title": "jaxrotor sweep over " + ", ".join(context.paths),
        "scene": dumps(context.scene),
        "start": eqx.tree_pformat(context.start, short_arrays=False),
        "station": float(context.station),
        "settle": context.settle,
        "keep": context.keep,
        "steps_per_revolution": plan.steps,
        "solver": solver_name(plan.solver),
        "observe": ", ".join(eqx.tree_pformat(one) for one in context.observe),
        "controller": eqx.tree_pformat(plan.controller) if plan.controller else "default",
        "max_steps": plan.max_steps,
        "precision": str(jnp.zeros(()).dtype),
        **assumed(context.scene),
        "versions": versions(),
    }
