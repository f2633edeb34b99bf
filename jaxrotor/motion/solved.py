"""Revolutions by diffrax, at constant speed."""

from typing import Any

import diffrax as dfx
from jaxtyping import Array, Float

from ..solvers.control import step_control, tuned
from ..solvers.form import AbstractForm
from .base import Plan


def solved_revolution(
    form: AbstractForm, plan: Plan, grid: Float[Array, " T"], y: Array, *, sample: bool
) -> tuple[Array, Any, Any]:
    """State after a revolution, readings at its samples if asked for, and whether it was solved."""
    read = lambda theta, y, args: form.read(theta, y)
    assert isinstance(plan.solver, dfx.AbstractSolver), "a linear scene is not stepped"
    solver = tuned(plan.solver)
    controller = plan.controller or step_control(plan.solver)
    if controller is None:  # a fixed grid: every step is a sample
        controller, max_steps, dt0 = dfx.StepTo(ts=grid), plan.steps, None
        path = dfx.SubSaveAt(t0=True, steps=True, fn=read)
    else:
        max_steps, dt0 = plan.max_steps, grid[1]
        path = dfx.SubSaveAt(ts=grid, fn=read)
    terms: Any = dfx.ODETerm(form.field)
    if _splits(solver):
        motion: Any = form.motion
        terms = dfx.MultiTerm(dfx.ODETerm(motion.contact), dfx.ODETerm(motion.linear))
    end = dfx.SubSaveAt(t1=True)
    solution = dfx.diffeqsolve(
        terms,
        solver,
        t0=0.0,
        t1=grid[-1],
        dt0=dt0,
        y0=y,
        saveat=dfx.SaveAt(subs=[end, path] if sample else [end]),
        stepsize_controller=controller,
        adjoint=plan.adjoint,
        max_steps=max_steps,
        throw=False,
    )
    saved: Any = solution.ys
    y1 = saved[0][-1]
    solved = solution.result == dfx.RESULTS.successful
    return y1, saved[1] if sample else None, solved


def _splits(solver: dfx.AbstractSolver) -> bool:
    """Whether a solver takes an explicit and an implicit part, as KenCarp4 does."""
    structure = solver.term_structure
    return getattr(structure, "__origin__", structure) is dfx.MultiTerm
