"""Pace: how the lanes of a sweep are stepped, and by which start they begin."""

import dataclasses
import itertools
import math
from collections.abc import Mapping
from typing import Any

import diffrax as dfx
import equinox as eqx
import jax.numpy as jnp
import numpy as np

from ..effects.base import AbstractContact
from ..equations.start import AbstractStart, AtRest, Launch, shaft_of
from ..equations.system import assemble
from ..motion.integrated import Integrating
from ..motion.run_up import after, integration_of, with_balls
from ..motion.simulate import check_integrated, steps_revolutions
from ..motion.stepped import Stepping, check_steppable, steppable
from ..motion.windows import lane_stepping, window_of
from ..scene import Scene
from ..solvers.choice import checked_solver
from ..solvers.control import step_control
from ..solvers.exponential import Exponential
from ..spins.drive import Drive
from .axes import at_point
from .lanes import Context


STOPS = 8  # how often a drive with feedback may come to rest or break loose in a window
REVOLUTION_STEPS = 4096  # of an adaptive solver in a revolution
MOST_STEPS = 100_000  # of an adaptive solver in a window along times
MOST_CORNERS = 64  # of a grid, at which the highest speed is looked for


def start_of_lanes(
    scene: Scene, start: AbstractStart | None, over: Mapping[str, Any]
) -> AbstractStart:
    """The start of all lanes, by default at rest; with balls in it where a path varies these."""
    start = AtRest() if start is None else start
    if any(path.startswith("start.balls.") for path in over) or isinstance(start, Launch):
        return with_balls(scene, Launch.of(start))
    return start


def pace_of(
    scene: Scene, start: AbstractStart, axes, times, period, solver, controller, steps, most
) -> Stepping | Integrating | None:
    """How lanes are stepped along times or by revolutions; None: by exponential steps of revolutions."""
    system = assemble(scene)
    if times is None:
        if steps_revolutions(scene, system, solver, start):
            shaft_of(start, "A sweep by revolutions of this scene")
            return None
        if isinstance(solver, Exponential):
            check_steppable(scene, solver, system)
        check_integrated(solver)
        return _integrating(
            scene, start, solver, controller, most or REVOLUTION_STEPS, None, period
        )
    takes = steppable(scene, system) and not isinstance(start, Launch)
    if isinstance(solver, Exponential) or (solver is None and controller is None and takes):
        return _stepping(scene, start, axes, times, solver, controller, steps)
    most = most or MOST_STEPS
    found = _integrating(scene, start, solver, controller, most, times[1] - times[0], None)
    return dataclasses.replace(found, first=jnp.asarray(times[0]))


def windows_of(pace: Stepping | Integrating | None, times: np.ndarray) -> tuple[int, int, int]:
    """Windows before the first sample and after it, and the intervals of each."""
    if isinstance(pace, Integrating):
        size = window_of(times.size)
        return int(times[0] > 0), (times.size - 1) // size, size
    before = round(times[0] / (times[1] - times[0]))
    size = window_of(math.gcd(before, times.size - 1) + 1)
    return before // size, (times.size - 1) // size, size


def stepped_by(
    pace: Stepping | Integrating | None, solver: Any, controller: Any, most: int | None
) -> tuple[Exponential | dfx.AbstractSolver, dfx.AbstractStepSizeController | None, int]:
    """Solver, step control and most steps in a window by which lanes are stepped."""
    if isinstance(pace, Integrating):
        by = pace.integration
        return by.solver, by.controller, by.max_steps
    return checked_solver(pace.solver if pace else solver), controller, most or REVOLUTION_STEPS


def _integrating(
    scene: Scene, start: AbstractStart, solver, controller, most: int, interval, period
) -> Integrating:
    """Integration of all lanes by a diffrax solver."""
    options = {"adjoint": dfx.ForwardMode(), "max_steps": most, "max_stops": STOPS}
    begun = after(scene, Launch.of(start))
    integration = integration_of(begun, None, solver, controller, 1, options)
    integration = dataclasses.replace(integration, from_start=True)
    return Integrating(integration, None if interval is None else jnp.asarray(interval), period)


def _stepping(
    scene: Scene, start: AbstractStart, axes, times: np.ndarray, solver, controller, steps
) -> Stepping:
    """Steps of all lanes of a sweep over runs, fine enough at the corners of the grid."""
    if solver is None:
        solver = Exponential(order=2 if scene.of(AbstractContact) else 4)
    if controller is not None:
        raise ValueError("`controller` is for diffrax solvers, not Exponential().")
    check_steppable(scene, solver)
    interval = times[1] - times[0]
    before = times[0] / interval
    if abs(before - round(before)) > 1e-6 * max(before, 1.0):
        raise ValueError(
            f"The first of `times`, {times[0]:g} s, must be a whole number of intervals, of {interval:g} "
            "s, for Exponential()."
        )
    times = np.linspace(0.0, times[-1], times.size + round(before))
    shaft_of(start, "A sweep along `times` by Exponential()")
    inertia = isinstance(scene.spin, Drive) and scene.spin.polar is None
    pacing = {path: v for path, v in axes.items() if inertia or path.startswith("spin.")}
    corners = list(itertools.product(*({v.min(), v.max()} for v in pacing.values())))
    if len(corners) > MOST_CORNERS:
        raise ValueError(
            f"{len(pacing)} swept parameters decide the speed; sweep fewer, or give the Drive its `polar`."
        )
    scenes = [at_point(scene, start, dict(zip(pacing, one, strict=True)))[0] for one in corners]
    return lane_stepping([assemble(one) for one in scenes], times, solver, steps)


def finer(context: Context) -> Context:
    """The context with twice the steps, and a tenth of the tolerance of a solver that chooses its own."""
    plan, pace = context.plan, context.pace
    if isinstance(pace, Stepping):
        twice = dataclasses.replace(pace, substeps=2 * pace.substeps)
        return dataclasses.replace(context, pace=twice)
    control: Any = plan.controller
    if control is None and isinstance(plan.solver, dfx.AbstractSolver):
        control = step_control(plan.solver)
    if isinstance(control, dfx.ClipStepSizeController):
        inner = _tenth_of_tolerance(control.controller)
        control = eqx.tree_at(lambda control: control.controller, control, inner)
    else:
        control = _tenth_of_tolerance(control)
    if isinstance(pace, Integrating):
        substeps = 2 * pace.integration.substeps
        closer = dataclasses.replace(pace.integration, controller=control, substeps=substeps)
        return dataclasses.replace(context, pace=dataclasses.replace(pace, integration=closer))
    closer = dataclasses.replace(plan, steps=2 * plan.steps, controller=control)
    return dataclasses.replace(context, plan=closer)


def _tenth_of_tolerance(control: Any) -> Any:
    """Step control with a tenth of its tolerances, if it has some."""
    if not isinstance(control, dfx.PIDController):
        return control
    return dataclasses.replace(control, rtol=control.rtol / 10, atol=control.atol / 10)
