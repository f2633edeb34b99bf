"""Job: the lanes of a sweep, run block by block into labelled data."""

import math
import sys
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr

from ..core.outcome import STATUS, failed, statuses, too_long
from ..core.quantities import quantity_units
from ..files.toml import dumps
from ..results.provenance import BRANCHES, assumed, versions
from ..solvers.choice import solver_name
from ..solvers.exponential import Exponential
from .grid import Block
from .lanes import Context, Lanes, Stages, run_chunk, run_rows
from .observe import Variable


NO_ERROR = ("status", "extrema_missed", "unresolved", "reversal_watched")


class Job(NamedTuple):
    """The lanes of a sweep; one that is pickled compiles where it is unpickled."""

    context: Context
    axes: dict[str, np.ndarray]  # values by path; one that states are carried along is first
    carry: str | None
    stages: Stages

    @property
    def free(self) -> dict[str, int]:
        """Number of values of every path that lanes are spread over."""
        return {path: len(values) for path, values in self.axes.items() if path != self.carry}

    @property
    def lanes(self) -> int:
        return math.prod(self.free.values())

    @property
    def rows(self) -> int:
        """Points that a lane goes through."""
        return 1 if self.carry is None else 2 * len(self.axes[self.carry])

    @property
    def dims(self) -> dict[str, np.ndarray]:
        """Values by dimension of the data set."""
        return self.axes if self.carry is None else {"branch": np.array(BRANCHES), **self.axes}

    def run(self, block: Block, tick: Callable[[int], None], *, size: int) -> xr.Dataset:
        """A block of lanes, in a program for `size` of them."""
        axes = {path: v[block.get(path, slice(None))] for path, v in self.axes.items()}
        points = points_of(axes, np.arange(math.prod(map(len, axes.values()))))
        if self.carry is None:
            return _dataset(
                self.context, axes, run_chunk(self.context, self.stages, points, size, tick)
            )
        count = len(axes[self.carry])
        row = points.reshape(count, -1, len(axes)).swapaxes(0, 1)
        there_and_back = np.concatenate([row, row[:, ::-1]], axis=1)
        lanes = run_rows(self.context, self.stages, there_and_back, size, tick)
        return _dataset(self.context, {**self.dims, **axes}, _by_branch(lanes, count))

    def repeat(
        self, lanes: np.ndarray, tick: Callable[[int], None], *, finer: Context, size: int
    ) -> xr.Dataset:
        """Some lanes again, by their numbers."""
        found = run_chunk(finer, self.stages, points_of(self.axes, lanes), size, tick)
        return _dataset(finer, {"error_lane": lanes}, found)


def points_of(axes: Mapping[str, np.ndarray], lanes: np.ndarray) -> np.ndarray:
    """Values of lanes by their numbers, (lanes, paths); the last path is the first to change."""
    places = np.unravel_index(lanes, [len(values) for values in axes.values()])
    return np.stack([v[place] for v, place in zip(axes.values(), places, strict=True)], axis=1)


def _by_branch(results: Lanes, values: int) -> Lanes:
    """Lanes by branch, value and row, from rows that go up through the values and down again."""

    def sorted_(leaf: np.ndarray) -> np.ndarray:
        rest = leaf.shape[2:]
        up, down = leaf[:, :values], leaf[:, : values - 1 : -1]
        return np.stack([up, down]).swapaxes(1, 2).reshape(-1, *rest)

    return jax.tree.map(sorted_, results)


def _reported(context: Context, results: Lanes) -> dict[str, Variable]:
    """Variables by name, lanes in front."""
    data: dict[str, Variable] = {}
    for one, last, out in zip(context.observe, results.carries, results.stored, strict=True):
        data |= one.report(last, out, context.keep)
    return data


def errors_of(
    found: xr.Dataset, repeated: xr.Dataset
) -> tuple[xr.Dataset, dict[str, dict[str, float]]]:
    """What twice the steps change in the numbers of some lanes, and what of it to say beside all."""
    lanes = repeated["error_lane"].values
    status = found["status"]
    places = dict(zip(status.dims, np.unravel_index(lanes, status.shape), strict=True))
    these = {dim: xr.DataArray(place, dims="error_lane") for dim, place in places.items()}
    of = lambda name: found[name].isel(these).values  # no more than these is read
    good = ~failed(of("status")) & ~failed(repeated["status"].values)
    variables, about = {}, {}
    for name, one in repeated.data_vars.items():
        if one.dims[1:] not in ((), ("limiter",)) or name in NO_ERROR:
            continue
        off = np.abs(one.values.astype(float) - of(name))
        off[~good] = np.nan
        long_name = f"change of {one.attrs['long_name']} by twice the steps"
        attrs = {"units": one.attrs["units"], "long_name": long_name}
        variables[f"{name}_error"] = (one.dims, off, attrs)
        known = off[np.isfinite(off)]
        if known.size:
            about[name] = {"error": float(known.max()), "error_median": float(np.median(known))}
    return xr.Dataset(variables, {"error_lane": repeated["error_lane"]}), about


def _dataset(context: Context, axes: Mapping[str, np.ndarray], results: Lanes) -> xr.Dataset:
    good = results.outcome
    shape = tuple(len(values) for values in axes.values())
    data = _reported(context, results)
    coords = coords_of(context, axes)
    undefined = np.zeros(len(good.ok), bool)
    for name in ("index", "whirl_rate"):
        if name in data:
            undefined |= np.isnan(data[name].values)
    overlong = np.zeros(len(good.ok), bool)
    if isinstance(context.plan.solver, Exponential):
        overlong = np.asarray(good.touched) & too_long(
            results.contact_stiffness_ratio, context.plan.solver.order
        )
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
    return xr.Dataset(variables, coords, provenance(context))


def coords_of(context: Context, axes: Mapping[str, np.ndarray]) -> dict[str, Any]:
    """Values of the dimensions, each with its unit."""
    about = {"branch": {}, "error_lane": {"long_name": "lane that was run again"}}
    units = lambda path: {"units": _unit(context, path)}
    return {
        dim: (dim, values, about[dim] if dim in about else units(dim))
        for dim, values in axes.items()
    }


def _unit(context: Context, path: str) -> str:
    if path.startswith("start."):
        return quantity_units(context.start)[path.removeprefix("start.")]
    return context.scene.unit(path)


def exactly(tree: Any) -> str:
    """A tree in words, numbers to their last digit, whatever the options of numpy."""
    with np.printoptions(
        floatmode="unique", threshold=sys.maxsize, suppress=False, formatter=None, sign="-"
    ):
        return eqx.tree_pformat(tree, short_arrays=False)


def provenance(context: Context) -> dict[str, Any]:
    """Attributes that tell a sweep from any other."""
    plan = context.plan
    return {
        "title": "jaxrotor sweep over " + ", ".join(context.paths),
        "scene": dumps(context.scene),
        "start": exactly(context.start),
        "station": float(context.station),
        "period": "that of the spin" if context.period is None else float(context.period),
        "settle": context.settle,
        "keep": context.keep,
        "steps_per_revolution": plan.steps,
        "solver": solver_name(plan.solver),
        **(
            {}
            if isinstance(plan.solver, Exponential)
            else {"solver_settings": exactly(plan.solver)}
        ),
        "observe": ", ".join(map(exactly, context.observe)),
        "controller": exactly(plan.controller) if plan.controller else "default",
        "max_steps": plan.max_steps,
        "precision": str(jnp.zeros(()).dtype),
        **assumed(context.scene),
        "versions": versions(),
    }
