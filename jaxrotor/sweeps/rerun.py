"""Rerun: the settings by which the lanes of a data set are run again, and then followed."""

import dataclasses
import math
from typing import Any, NamedTuple

import diffrax as dfx
import jax.numpy as jnp
import numpy as np
import xarray as xr
from jaxtyping import Float

from ..effects.base import AbstractContact
from ..effects.layout import check_one_shaft
from ..equations.start import AbstractStart
from ..equations.stationary_frame import has_memory
from ..equations.system import assemble, structure
from ..files.toml import loads
from ..motion.base import Plan
from ..motion.revolutions import check_constant, revolution_rate
from ..orbits.memory import steps_for_states
from ..orbits.passes import Cycle, cycle_of, cycle_rate
from ..orbits.shooting import differentiable
from ..results.provenance import period_of, start_and_solver
from ..scene import Scene
from ..solvers.exponential import Exponential
from .axes import at_point, shared_ports
from .job import STEPS_IN_SINGLE
from .lanes import Context
from .pace import extremes


class Rerun(NamedTuple):
    """Settings of the lanes of a data set."""

    first: Context  # up to the end of the sweep
    context: Context  # of what is followed from there
    points: Float[np.ndarray, "l p"]
    turns: Float[np.ndarray, " l"]  # of the shaft in what counts as a revolution


def rerun(dataset: xr.Dataset, solver: Exponential, steps: int) -> Rerun:
    """Settings of the lanes, to be followed by so many `steps` of a `solver`.

    Laws with states, or by turns, take these steps from the start on, since sweeps integrate them.
    """
    attributes, status = dataset.attrs, dataset["status"]
    scene = loads(attributes["scene"])
    check_one_shaft(scene.shafts, "`classify`")
    check_constant(scene, "`classify`", memory=True)
    memory, followed = bool(structure(scene).laws_with(has_memory)), steps
    start, own = start_and_solver(attributes, solver if memory else None)
    coords = [str(name) for name in status.coords if "." in str(name)]
    columns = {path: status[path].broadcast_like(status).values.ravel() for path in coords}
    points = np.column_stack(list(columns.values()))
    cycle, turns = None, np.ones(len(points))
    period: Any = period_of(attributes)  # of one shaft no name of another
    if memory:
        cycle, turns = _cycle(scene, start, columns)
        ends = extremes(scene, start, columns)
        first = followed = max(_steps(one, cycle, period, steps) for one in ends)
    else:
        first = int(attributes["steps_per_revolution"])
    plan = _plan(scene, columns, own, first)
    settle = int(attributes["settle"]) + int(attributes["keep"])
    settle = math.ceil(settle / turns.min())  # passes
    lanes = scene, start, tuple(columns), plan, jnp.asarray(float(attributes["station"])), period
    in_single = attributes["precision"] == STEPS_IN_SINGLE
    context = Context(*lanes, (), settle, 0, in_single=in_single and not memory, cycle=cycle)
    return Rerun(context, _following(context, solver, followed), points, turns)


def _cycle(
    scene: Scene, start: AbstractStart, columns: dict[str, np.ndarray]
) -> tuple[Cycle | None, Float[np.ndarray, " l"]]:
    """Periods of laws that count turns, of one kind in all lanes, and revolutions in each; or none."""
    table = np.column_stack(list(columns.values()))
    if "turns" not in structure(scene).clocks:
        return None, np.ones(len(table))
    distinct, which = np.unique(table, axis=0, return_inverse=True)
    lanes = [at_point(scene, start, dict(zip(columns, row, strict=True)))[0] for row in distinct]
    cycles = [cycle_of(lane, assemble(lane), "`classify`", apart=True) for lane in lanes]
    if len({(one.passes, one.common) for one in cycles}) > 1:
        raise ValueError(
            "Lanes must have periods of one kind, but those of some repeat with passes of balls, and of "
            "others with revolutions or never; classify each kind by a sweep of its own."
        )
    each = np.array([one.revolutions for one in cycles], float)
    return cycles[0], each[which.ravel()]


def _steps(scene: Scene, cycle: Cycle | None, period: float | None, least: int) -> int:
    """Steps in a revolution, or a pass, that follow what states of laws do by themselves."""
    system = assemble(scene)
    rate = cycle_rate(system, cycle.passes) if cycle else revolution_rate(scene, period)
    return steps_for_states(system, least, 2 * np.pi / rate)


def _plan(scene: Scene, columns: dict[str, np.ndarray], solver: Exponential, steps: int) -> Plan:
    """The plan of the sweep, without what its observables read."""
    together = shared_ports(scene, {path: np.unique(values) for path, values in columns.items()})
    return Plan(
        solver,
        None,
        dfx.ForwardMode(),
        steps,
        steps,
        slopes=False,
        coordinates=False,
        contacts=False,
        together=together,
        batch=True,
    )


def _following(context: Context, solver: Exponential, steps: int) -> Context:
    """The context with steps whose derivatives include changes of contact."""
    solver = differentiable(solver, assemble(context.scene))
    several = len(context.scene.of(AbstractContact)) > 1  # of which some may never be touched
    plan = dataclasses.replace(
        context.plan, solver=solver, steps=steps, max_steps=steps, batch=False, contacts=several
    )
    return dataclasses.replace(context, plan=plan)
