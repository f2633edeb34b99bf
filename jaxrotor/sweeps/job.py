"""Job: the lanes of a sweep, run block by block into labelled data."""

import math
from collections.abc import Callable, Iterator, Mapping
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr

from ..core.attributes import about, flags
from ..core.caller import FewStepsWarning, warn
from ..core.outcome import FEWEST, STATUS, failed, rebound_steps, statuses, too_long
from ..effects.base import AbstractContact
from ..equations.start import numbers_of
from ..equations.system import state_names, structure
from ..files.toml import dumps
from ..motion.integrated import IntegratedPace
from ..motion.rebounds import counted, few_steps, in_revolutions, is_pilot_run
from ..motion.stepped import Stepping
from ..results.provenance import BRANCHES, TURN, as_json, assumed, versions
from ..solvers.choice import solver_name
from ..solvers.exponential import Exponential
from .grid import Block, Chunk
from .lanes import Context, Lanes, Stages, run_chunk, run_rows
from .observe import Variable


MOVED = 1e-9  # of its state, by which the start of a lane is moved to see whether it diverges
APART = 1e-4  # of a variable: two such lanes differ by more where they diverge
STEPS_IN_SINGLE = "float32 steps"  # precision of lanes stepped in float32 by jax in float64
NO_ERROR = (
    "status",
    "rebound_steps",
    "diverges",
    "extrema_missed",
    "unresolved",
    "reversal_watched",
)


class Job(NamedTuple):
    """The lanes of a sweep; a copy that is unpickled in another process compiles there."""

    context: Context
    axes: dict[str, np.ndarray]  # values by path; the path along which states are carried is first
    carry: str | None
    stages: Stages
    kick: float = 0.0  # angle by which the first ball is moved where a state is carried on [rad]

    @property
    def free(self) -> dict[str, int]:
        """Number of values of every path along which there are lanes."""
        return {path: len(values) for path, values in self.axes.items() if path != self.carry}

    @property
    def lanes(self) -> int:
        """Number of lanes."""
        return math.prod(self.free.values())

    @property
    def rows(self) -> int:
        """Number of points that a lane goes through."""
        return 1 if self.carry is None else 2 * len(self.axes[self.carry])

    @property
    def dims(self) -> dict[str, np.ndarray]:
        """Values by dimension of the data set."""
        if self.carry is None:
            return self.axes
        first, last = self.axes[self.carry][[0, -1]]
        ways = BRANCHES if first < last else BRANCHES[::-1]
        return {"branch": np.array(ways), **self.axes}

    def identity(self) -> dict[str, Any]:
        """Attributes that tell the sweep from any other, see `identity`."""
        kick = {"kick": self.kick} if self.kick else {}
        return identity(self.context) | {"carry": self.carry or "none"} | kick

    def run(
        self,
        chunk: Chunk,
        tick: Callable[[int], None],
        *,
        finer: Context,
        size: int,
        sample_size: int,
    ) -> xr.Dataset:
        """Data set of a block of lanes, or of lanes that are run again with finer steps.

        Programs are for `size` lanes, or for `sample_size` that are run again.
        """
        if isinstance(chunk, dict):
            return self._block(chunk, tick, size)
        return self._again(chunk, tick, finer, sample_size)

    def _block(self, block: Block, tick: Callable[[int], None], size: int) -> xr.Dataset:
        """Data set of a block of lanes, run in a program for `size` of them."""
        axes = {path: v[block.get(path, slice(None))] for path, v in self.axes.items()}
        points = points_of(axes, np.arange(math.prod(map(len, axes.values()))))
        if self.carry is None:
            lanes = run_chunk(self.context, self.stages, points, size, tick)
            return _dataset(self.context, axes, lanes)
        count = len(axes[self.carry])
        row = points.reshape(count, -1, points.shape[1]).swapaxes(0, 1)
        there_and_back = np.concatenate([row, row[:, ::-1]], axis=1)
        lanes = run_rows(self.context, self.stages, there_and_back, size, tick, self.kick)
        return _dataset(self.context, {**self.dims, **axes}, _by_branch(lanes, count))

    def _again(
        self, lanes: np.ndarray, tick: Callable[[int], None], finer: Context, size: int
    ) -> xr.Dataset:
        """Data set of some lanes, by their numbers, with the finer steps of another context.

        `diverges` says whether a lane ends elsewhere from a start that is moved by `MOVED` of it.
        """
        count, points = len(lanes), points_of(self.axes, lanes)
        moved = np.repeat([0.0, MOVED], count)
        results = run_chunk(
            finer, self.stages, np.tile(points, (2, 1)), 2 * size, tick, moved=moved
        )
        half = lambda own: _dataset(
            finer, {"error_lane": lanes}, jax.tree.map(lambda leaf: leaf[own], results)
        )
        found, other = half(slice(count)), half(slice(count, None))
        apart = _apart(found, other)
        return found.assign(diverges=("error_lane", apart))


def points_of(axes: Mapping[str, np.ndarray], lanes: np.ndarray) -> np.ndarray:
    """Values of lanes by their numbers, (lanes, paths); the last axis changes fastest."""
    places = np.unravel_index(lanes, [len(values) for values in axes.values()])
    columns = [v[place] for v, place in zip(axes.values(), places, strict=True)]
    return np.column_stack(columns)


def _by_branch(results: Lanes, values: int) -> Lanes:
    """Lanes by branch, value and row, from rows that go through the values and back again."""

    def by_branch(leaf: np.ndarray) -> np.ndarray:
        rest = leaf.shape[2:]
        there, back = leaf[:, :values], leaf[:, : values - 1 : -1]
        return np.stack([there, back]).swapaxes(1, 2).reshape(2 * values * len(leaf), *rest)

    return jax.tree.map(by_branch, results)


# === data of lanes


def errors_of(
    found: xr.Dataset, repeated: xr.Dataset
) -> tuple[xr.Dataset, dict[str, dict[str, float]]]:
    """Errors of some lanes, as the change by twice the steps.

    The first is a data set of the errors of every lane that was repeated; the second has the largest
    and the median error of every variable, which become its attributes. Lanes that diverge, as chaos
    does, have no part in these: two runs of them differ by more than their steps.
    """
    lanes = repeated["error_lane"].values
    status = found["status"]
    places = dict(zip(status.dims, np.unravel_index(lanes, status.shape), strict=True))
    these = {dim: xr.DataArray(place, dims="error_lane") for dim, place in places.items()}
    before = lambda name: found[name].isel(these).values  # reads no other lanes from a store
    good = ~failed(before("status")) & ~failed(repeated["status"].values)
    diverges = repeated["diverges"].values & good
    attrs = about("1", f"whether a start moved by {MOVED:g} of it ends elsewhere")
    errors: dict[str, Any] = {"diverges": ("error_lane", diverges.astype(np.int8), attrs)}
    summary = {}
    for name, array in _single(repeated):
        error = _distance(array.values.astype(float), before(name))
        error[~good] = np.nan
        long_name = f"change of {array.attrs['long_name']} by twice the steps"
        errors[f"{name}_error"] = (array.dims, error, about(array.attrs["units"], long_name))
        known = error[~diverges]
        known = known[np.isfinite(known)]
        if known.size:
            summary[name] = {"error": float(known.max()), "error_median": float(np.median(known))}
    return xr.Dataset(errors, {"error_lane": repeated["error_lane"]}), summary


def _single(dataset: xr.Dataset) -> Iterator[tuple[str, xr.DataArray]]:
    """Variables with one number a lane, a contact or a state of a law, that steps may change."""
    for name, array in dataset.data_vars.items():
        if array.dims[1:] in ((), ("limiter",), ("state",)) and name not in NO_ERROR:
            yield str(name), array


def _apart(found: xr.Dataset, other: xr.Dataset) -> np.ndarray:
    """Whether lanes from two neighbouring starts end apart, by any variable but times."""
    apart = np.zeros(found.sizes["error_lane"], bool)
    for name, array in _single(found):
        if array.attrs["units"] in ("s", "rad/s") or not np.issubdtype(array.dtype, np.floating):
            continue
        change = _distance(array.values, other[name].values)
        each = 0 if "state" in array.dims else None  # states have units of their own
        size = np.nanmax(np.abs(array.values), axis=each, initial=0.0)
        far = np.nan_to_num(change) > APART * size
        apart |= far.reshape(len(apart), -1).any(axis=1)
    return apart


@np.errstate(invalid="ignore")  # lanes that failed may be infinite in both
def _distance(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    return np.abs(one - other)


def check_rebounds(context: Context, found: xr.Dataset) -> None:
    """Warn of lanes with few steps a rebound from a stop, see `Rebounds`."""
    solver = context.plan.solver
    if "rebound_steps" not in found or not isinstance(solver, Exponential):
        return
    steps = found["rebound_steps"].values.reshape(found["status"].size, -1)
    steps = np.where(np.isnan(steps), np.inf, steps)
    few = (steps < FEWEST[solver.order, solver.located]).any(axis=1)
    if few.any() and not is_pilot_run():
        _, contact = np.unravel_index(np.argmin(steps), steps.shape)
        name = context.scene.name_of(context.scene.of(AbstractContact)[contact])
        cure = in_revolutions(context.plan.steps)
        if context.interval is not None:
            cure = lambda more: f"{more:.2g} times as many `steps_per_revolution`"
        stop = f"In {few.sum()} of {few.size} lanes steps are few: `{name}`"
        warn(few_steps(stop, float(steps.min()), solver, cure), FewStepsWarning)


def _dataset(context: Context, axes: Mapping[str, np.ndarray], results: Lanes) -> xr.Dataset:
    """Labelled results of lanes that fill a grid of these axes."""
    shape = tuple(len(values) for values in axes.values())
    reported = _reported(context, results)
    coords = coords_of(context, axes)
    variables: dict[str, Any] = {}
    for name, one in reported.items():
        attrs = about(one.units, one.long_name)
        if one.dims == (name,):
            coords[name] = (one.dims, one.values, attrs)
            continue
        values = np.asarray(one.values)
        values = values.reshape(shape + values.shape[1:])
        variables[name] = ((*axes, *one.dims), values, attrs)
    if any("axis" in one.dims for one in reported.values()):
        coords["axis"] = ("axis", ["x", "y"])
    if any("state" in one.dims for one in reported.values()):
        names = [f"{name} [{unit}]" for name, unit in state_names(context.scene).items()]
        coords["state"] = ("state", names)
    ratio = _ratio_of_touched(context, results, reported, bounced=True)
    if ratio.size:
        steps = np.full(ratio.shape[:2], np.nan)
        steps[:, list(_members(context))] = rebound_steps(ratio)
        steps = np.where(np.isfinite(steps), steps, np.nan)
        attrs = about("1", "steps of a rebound from each stop that was touched")
        steps = steps.reshape(*shape, -1)
        variables["rebound_steps"] = ((*axes, "limiter"), steps, attrs)
    status = _status(context, results, reported).reshape(shape)
    variables["status"] = (tuple(axes), status, flags("outcome of the lane", STATUS))
    if getattr(context.plan.solver, "located", False):
        attrs = about("1", "steps whose changes of contact were not located")
        variables["unresolved"] = (tuple(axes), results.outcome.unresolved.reshape(shape), attrs)
    return xr.Dataset(variables, coords, identity(context))


def _reported(context: Context, results: Lanes) -> dict[str, Variable]:
    """Variables of all observables by name, lanes in front."""
    reported: dict[str, Variable] = {}
    for one, carry, stored in zip(context.observe, results.carries, results.stored, strict=True):
        reported |= one.report(carry, stored, context.keep)
    return reported


def _status(context: Context, results: Lanes, reported: Mapping[str, Variable]) -> np.ndarray:
    """Number of the `STATUS` of every lane."""
    outcome = results.outcome
    undefined = np.zeros(len(outcome.ok), bool)
    for name in ("index", "whirl_rate"):
        if name in reported:
            undefined |= np.isnan(reported[name].values)
    overlong = np.zeros(len(outcome.ok), bool)
    if isinstance(context.plan.solver, Exponential):
        ratio = _ratio_of_touched(context, results, reported, bounced=False)
        overlong = too_long(ratio, context.plan.solver.order)
    return statuses(outcome, results.started, undefined, overlong)


def _ratio_of_touched(
    context: Context, results: Lanes, reported: Mapping[str, Variable], *, bounced: bool
) -> np.ndarray:
    """Contact stiffness ratios of the contacts that each lane has touched, see `counted`.

    With `bounced` the rows are those of the contacts of the scene alone, and there are none without stops.
    """
    ratio = np.asarray(results.contact_stiffness_ratio)
    ratio = np.where(np.asarray(results.outcome.touched)[:, None, None], ratio, 0.0)
    if not ratio.size:
        return ratio
    loads, members = None, _members(context)
    if "duty" in reported:
        duty = np.asarray(reported["duty"].values)
        loads = duty > 0, duty > 1 - 1e-9
    found = counted(context.scene, members, ratio, loads, bounced=bounced)
    if not bounced:
        return found
    stops = any(contact.rebounds for contact in context.scene.of(AbstractContact))
    return found[:, : stops * len(members)]


def _members(context: Context) -> tuple[int, ...]:
    """Number in the scene of the contact of each law, see `System.members`."""
    return structure(context.scene, context.plan.together).members


def coords_of(context: Context, axes: Mapping[str, np.ndarray]) -> dict[str, Any]:
    """Coordinates of the axes, (dimension, values, attributes), each with its unit."""
    own = {"branch": {}, "error_lane": {"long_name": "lane that was run again"}}
    units = lambda path: {"units": _unit(context, path)}
    coords, paths = {}, iter(context.paths)
    for dim, values in axes.items():
        if dim in own:
            coords[dim] = (dim, values, own[dim])
            continue
        if values.ndim > 1:  # of paths that vary together
            coords[dim] = (dim, np.arange(len(values)), {"long_name": "number of the lane"})
        for column in values.reshape(len(values), -1).T:
            path = next(paths)
            coords[path] = (dim, column, units(path))
    return coords


def _unit(context: Context, path: str) -> str:
    """Unit of a swept parameter."""
    if path.startswith("start."):
        return numbers_of(context.start)[path.removeprefix("start.")]
    return context.scene.unit(path)


def _pace(context: Context) -> dict[str, Any]:
    """Attributes of the revolutions or of the times that are observed, and of the steps."""
    pace, steps = context.pace, context.plan.steps
    if context.interval is None:
        period = "that of the spin" if context.period is None else context.period
        period = f"{TURN}{period}" if isinstance(context.period, str) else period
        return {
            "period": period,
            "settle": context.settle,
            "keep": context.keep,
            "steps_per_revolution": steps,
        }
    intervals = steps * context.keep
    stepped, duration = {}, context.interval * intervals
    if isinstance(pace, Stepping):
        stepped = {"steps_per_sample": pace.substeps}
        duration = float(pace.breaks[-1])
    elif isinstance(pace, IntegratedPace) and pace.first is not None:
        duration += float(pace.first)
    first = {"first_sample": duration - context.interval * intervals} if context.settle else {}
    return {
        "duration": duration,
        **first,
        "samples": intervals + 1,
        **stepped,
        "samples_per_window": steps,
    }


def identity(context: Context) -> dict[str, Any]:
    """Attributes that tell a sweep from any other: all its settings, numbers to their last digit."""
    plan = context.plan
    return {
        "title": "jaxrotor sweep over " + ", ".join(context.paths),
        "scene": dumps(context.scene),
        "start": as_json(context.start),
        "station": float(context.station),
        **({"observed_shaft": context.scene.observed} if context.scene.shafts else {}),
        **_pace(context),
        "solver": solver_name(plan.solver),
        "solver_settings": as_json(plan.solver),
        "observe": as_json(context.observe),
        "controller": as_json(plan.controller) if plan.controller else "default",
        "max_steps": plan.max_steps,
        "precision": STEPS_IN_SINGLE if context.in_single else str(jnp.zeros(()).dtype),
        **assumed(context.scene),
        "versions": versions(),
    }
