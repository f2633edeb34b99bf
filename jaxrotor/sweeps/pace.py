"""Pace: how the lanes of a sweep are stepped, and by which start they begin."""

import dataclasses
import itertools
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, cast

import diffrax as dfx
import equinox as eqx
import jax.numpy as jnp
import numpy as np

from ..core.quantities import with_values
from ..effects.base import AbstractBodies
from ..equations.rotating_frame import massless_of
from ..equations.start import AbstractStart, Launch, checked_start, is_whole
from ..equations.system import assemble, structure
from ..motion.choice import (
    check_integrated,
    check_steppable,
    steps_along,
    steps_of_default,
    system_of_march,
)
from ..motion.integrated import IntegratedPace
from ..motion.run_up import after, integration_of, with_balls
from ..motion.simulate import REVOLUTION_STEPS
from ..motion.stepped import Stepping
from ..motion.transient import Integration, controller_for
from ..motion.windows import lane_stepping, window_of
from ..scene import Scene
from ..solvers.choice import checked_solver
from ..solvers.control import step_control
from ..solvers.exponential import Exponential
from ..spins.drive import Drive
from .axes import at_point
from .lanes import Context


STOPS = 8  # how often a drive with feedback may come to rest or break loose in a window
WINDOW_STEPS = 100_000  # of an adaptive solver in a window along times
MOST_CORNERS = 64  # of a grid, at which the highest speed is looked for


def start_of_lanes(
    scene: Scene, start: AbstractStart | None, paths: Iterable[str]
) -> AbstractStart:
    """The start of all lanes, by default at rest; with balls in it where a path varies these."""
    start = checked_start(start, scene)
    varied = [path for path in paths if path.startswith("start.")]
    if not any(path.startswith("start.balls.") for path in varied):
        return with_balls(scene, start) if isinstance(start, Launch) else start
    if not scene.of(AbstractBodies):
        raise ValueError(f"`{varied[0]}` varies a ball, but the scene has none; add BallBalancer.")
    for name in ("radius", "rate", "angle"):
        if not isinstance(start, Launch) and f"start.{name}" in varied:
            raise ValueError(
                f"Beside a path of balls, `start.{name}` must be written `start.shaft.{name}`, and the "
                "start as Launch(Whirl(..))."
            )
    return with_balls(scene, Launch.of(start))


def pace_of(
    scene: Scene,
    start: AbstractStart,
    columns: Mapping[str, np.ndarray],
    pacing: tuple[np.ndarray | None, Any],
    solver: Any,
    controller: Any,
    counts: tuple[Any, int | None],
) -> Stepping | IntegratedPace | None:
    """How lanes are stepped along times or by revolutions; None: by exponential steps of revolutions.

    Args:
        scene: the scene, of which lanes differ in the swept values.
        start: the start of all lanes.
        columns: swept values by path.
        pacing: times of the samples and the period of a revolution, either may be None.
        solver: the one asked for, or None.
        controller: the one asked for, or None.
        counts: steps a revolution, and most steps of an adaptive solver in a window.
    """
    (times, period), (steps, most), system = pacing, counts, assemble(scene)
    named = isinstance(solver, Exponential)
    if times is None:
        varied = any(f"start.{name}" in columns for name in ("angle", "speed", "time"))
        turned = not is_whole(start) or (isinstance(start, Launch) and varied)
        if named and turned:
            raise ValueError(
                "Exponential() steps lanes that begin at angle zero and at the time of the start, by "
                "whole revolutions without balls, but the start is another or is swept over them; leave "
                "`solver` out, or give `times`."
            )
        if not turned and _marches_all(by_revolutions(scene), start, columns, solver):
            return None
    elif named or (solver is controller is None and steps_along(scene, system, times)[0]):
        return _stepping(scene, start, columns, times, solver, controller, steps)
    if named:
        check_steppable(scene, solver, system, revolutions=True)
    if controller is None:
        check_integrated(solver)
    scenes = extremes(scene, start, columns)
    integration = _integration(scenes, start, solver, controller, most or WINDOW_STEPS)
    if times is None:
        return IntegratedPace(integration, None, period)
    interval, first = jnp.asarray(times[1] - times[0]), jnp.asarray(times[0])
    return IntegratedPace(integration, interval, None, first)


def by_revolutions(scene: Scene) -> Scene:
    """A scene as a `March` takes it: unbalance of other shafts has a steady response, and is no force."""
    return with_values(scene, in_time=False) if scene.in_time else scene


def check_carried(carry: str | None, pace: Any, period: float | str | None, scene: Scene) -> None:
    """Raise unless states can be carried on from lane to lane, and revolutions are those of a shaft."""
    if pace is not None and isinstance(period, str) and period != scene.name:
        raise ValueError(
            f"Revolutions of {period!r} are for lanes by exponential steps; leave `period` out, or give "
            "`times`."
        )
    if carry is not None and pace is not None and "turns" in structure(scene).clocks:
        raise ValueError(
            "`carry` continues each lane at angle zero, but forces of the scene count turns "
            f"({assemble(scene).laws_with(lambda law: law.clock == 'turns')}); leave `carry` out."
        )


def _marches_all(scene: Scene, start: AbstractStart, columns, solver) -> bool:
    """Whether a `March` takes all lanes, which then have the same coordinates without mass."""
    taken, _ = system_of_march(scene, assemble(scene), solver)
    if taken is None or not (taken.massless or taken.remainder):
        return taken is not None
    scenes = extremes(scene, start, columns)
    others = [system_of_march(one, assemble(one), solver)[0] for one in scenes]
    return all(one is not None and one.massless == taken.massless for one in others)


def extremes(scene: Scene, start: AbstractStart, columns: Mapping[str, np.ndarray]) -> list[Scene]:
    """The scene, and with each swept number at its least, at its largest and at zero."""
    scenes = [scene]
    for path, values in columns.items():
        if not path.startswith("start."):
            for value in {values.min(), values.max(), *values[values == 0]}:
                scenes.append(at_point(scene, start, {path: value})[0])
    return scenes


def checked_times(times: Any, given: Mapping[str, Any], steps: Any) -> np.ndarray:
    """The times of a run; raises unless they are evenly spaced, and alone decide what is observed."""
    if steps == "auto":
        raise ValueError(
            'Steps "auto" are for whole revolutions; along `times` give `steps_per_revolution`, and '
            "`error_sample` to see what error they leave."
        )
    for name, value in given.items():
        if value is not None:
            raise ValueError(
                f"`{name}` is for whole revolutions, but `times` are given; take one of both."
            )
    values = np.atleast_1d(np.asarray(times, float))
    lengths = np.diff(values)
    if (
        values.ndim > 1
        or values.size < 2
        or values[0] < 0
        or not lengths.min() > 0
        or np.ptp(lengths) > 1e-9 * values[-1]
    ):
        raise ValueError(
            f"`times [s]` of a sweep must be two or more evenly spaced times from 0 on, but are {times!r}."
        )
    return np.linspace(values[0], values[-1], values.size)


def windows_of(times: np.ndarray) -> tuple[int, int, int]:
    """Windows before the first sample, none or one, and after it; and the intervals of each of these."""
    size = window_of(times.size)
    return int(times[0] > 0), (times.size - 1) // size, size


def stepped_by(
    pace: Stepping | IntegratedPace | None, solver: Any, controller: Any, most: int | None
) -> tuple[Exponential | dfx.AbstractSolver, dfx.AbstractStepSizeController | None, int]:
    """Solver, step control and most steps in a window by which lanes are stepped."""
    if isinstance(pace, IntegratedPace):
        by = pace.integration
        return by.solver, by.controller, by.max_steps
    return checked_solver(pace.solver if pace else solver), controller, most or REVOLUTION_STEPS


def _integration(
    scenes: Sequence[Scene], start: AbstractStart, solver: Any, controller: Any, most: int
) -> Integration:
    """Integration of all lanes by a diffrax solver, with steps short enough for all scenes."""
    options = {"adjoint": dfx.ForwardMode(), "max_steps": most, "max_stops": STOPS}
    begun = [after(scene, Launch.of(start)) for scene in scenes]
    found = integration_of(begun[0], solver, controller, 1, options, from_start=True)
    if any(massless_of(one) != found.massless for one in begun[1:]):
        found = dataclasses.replace(found, massless="unknown")
    if controller is None:
        found = dataclasses.replace(found, controller=_control_of_all(found.solver, begun))
    return found


def _control_of_all(solver: Any, scenes: Sequence[Scene]) -> Any:
    """Step control by the shortest impact of any scene; jumps are step ends where all have the same."""
    controls: list[Any] = [controller_for(solver, scene) for scene in scenes]
    plain: list[Any] = [getattr(one, "controller", one) for one in controls]
    if any(getattr(one, "dtmax", None) is not None for one in plain):
        shortest = min(float(one.dtmax) for one in plain)
        plain[0] = dataclasses.replace(plain[0], dtmax=jnp.asarray(shortest))
    jumps, *others = cast(Any, [one.spin.kinks for one in scenes])
    if jumps is None or not all(np.array_equal(jumps, other) for other in others):
        return plain[0]
    return dfx.ClipStepSizeController(plain[0], jump_ts=jumps)


def _stepping(
    scene: Scene, start: AbstractStart, columns, times: np.ndarray, solver, controller, steps
) -> Stepping:
    """Steps of all lanes of a sweep over runs, fine enough at the corners of the grid."""
    if solver is None:
        solver = steps_of_default(structure(scene))
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
    inertia = isinstance(scene.spin, Drive) and scene.spin.polar is None
    paths = "spin.", "start.speed", "start.time"
    pacing = {path: v for path, v in columns.items() if inertia or path.startswith(paths)}
    # The speed over a profile need not be monotone in the time at which a lane begins.
    every = {
        path: set(v) if path == "start.time" else {v.min(), v.max()} for path, v in pacing.items()
    }
    corners = list(itertools.product(*every.values()))
    if len(corners) > MOST_CORNERS:
        raise ValueError(
            f"{len(pacing)} swept parameters decide the speed; sweep fewer, or give the Drive its `polar`."
        )
    points = [dict(zip(pacing, one, strict=True)) for one in corners]
    ends = [at_point(scene, start, one) for one in points]
    scenes = [after(scene, Launch.of(start)) for scene, start in ends]
    balls = [np.abs(v).max() for path, v in columns.items() if path.startswith("start.balls")]
    begun = Launch.of(start).balls or ()
    balls += [np.abs(np.asarray(one.rate)).max() for one in begun]
    systems = [assemble(one) for one in scenes]
    found = lane_stepping(systems, times, solver, steps, float(max(balls, default=0.0)))
    return dataclasses.replace(found, before=round(before))


def finer(context: Context) -> Context:
    """The context with twice the steps, in all coordinates and in the precision of jax.

    A solver that chooses its steps gets a tenth of its tolerance.
    """
    plan, pace = context.plan, context.pace
    context = dataclasses.replace(context, in_single=False)
    if isinstance(plan.solver, Exponential):
        every = dataclasses.replace(plan.solver, shapes=None)
        plan = eqx.tree_at(lambda plan: plan.solver, plan, every)
        context = dataclasses.replace(context, plan=plan)
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
    if isinstance(pace, IntegratedPace):
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
