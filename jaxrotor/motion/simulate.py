"""Simulate: the motion of one scene in time."""

import contextlib
import dataclasses
from typing import Any, Literal

import diffrax as dfx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from ..analysis import chosen_nodes
from ..core.checks import check_counts
from ..core.compiled import compiled
from ..core.pilot import Pilot, refined
from ..core.progress import waiting
from ..core.quantities import Scalar, known
from ..equations.clocks import counted_by
from ..equations.pencil import unequal_parts
from ..equations.rigid_motions import check_held
from ..equations.speed_tables import check_tables
from ..equations.start import (
    AbstractStart,
    Continued,
    Launch,
    checked_start,
    shaft_of,
)
from ..equations.system import System, assemble, port_groups
from ..scene import Scene
from ..solvers.basis import Count
from ..solvers.choice import choose, solver_name, with_shapes
from ..solvers.exponential import Exponential
from .base import Plan
from .choice import ASKED, check_integrated, default_solver, system_of_march
from .history import TimeHistory
from .rebounds import Rebounds, in_revolutions, pilot_run
from .revolutions import March, check_constant_speed, check_weight, joined, revolution_rate
from .run_up import MOST_STEPS, run_up, walls


PILOT = 20  # revolutions at the end of a run, on which steps are chosen
LADDER = (64, 128, 256, 512, 1024, 2048, 4096)  # steps a revolution that are tried
REVOLUTION_STEPS = 4096  # of an adaptive solver in a revolution, by default
KEPT = ("displacement", "velocity", "slope", "contact_force", "coordinates")  # of every sample


def simulate(
    scene: Scene,
    revolutions: int | None = None,
    steps_per_revolution: int | Literal["auto"] = 256,
    *,
    times: Any | None = None,
    nodes: int | Literal["auto"] | None = None,
    tolerance: float | int = 1e-3,
    solver: Exponential | dfx.AbstractSolver | None = None,
    controller: dfx.AbstractStepSizeController | None = None,
    start: AbstractStart | None = None,
    keep: int | None = None,
    at: float | Any | None = None,
    period: float | str | None = None,
    adjoint: dfx.AbstractAdjoint | None = None,
    max_steps: int | None = None,
    progress: bool | None = None,
) -> TimeHistory:
    """Motion `M q.. + (C - i Omega G) q. + (K - i Omega H) q = loads + contacts + balls` in time.

    Any scene is simulated: at constant speed by whole revolutions, at any speed along `times`, where it
    is `run_up(scene, times)`. What is drawn decides how it is stepped. Exponential steps take whole
    revolutions of all rotors but those with balls, or with axes that turn beside others that stand still
    and are very unequal; these are integrated by the solver that `run_up` takes. By whole revolutions a
    contact may act on a part without mass if it has no friction, and no damping either where nothing
    damps that part.

    Args:
        scene: the rotor; by `revolutions` at constant speed.
        revolutions: length of the motion in revolutions.
        steps_per_revolution: samples a revolution; also the steps of `Exponential` and of
            diffrax solvers without an error estimate. A scene without contact is exact at any, unless some
            unequal axes turn and others do not. "auto" chooses them by a pilot run, see `chosen_steps`.
        times: ascending times of the samples [s], in place of revolutions.
        nodes: number of nodes of the shaft, by default its own; "auto" chooses it, see `chosen_nodes`.
        tolerance: relative tolerance of "auto": of the motion for steps, of the roots for nodes, of the
            response at a stop for the shapes of `Exponential(shapes="auto")`.
        solver: `Exponential()` or any diffrax solver, such as `diffrax.Kvaerno5()`; by default
            `Exponential()` where it can be taken, of order 4 without contact where unequal axes of both
            kinds need steps; along `times` as in `run_up`.
        controller: step control of an adaptive diffrax solver; by default rtol 1e-7 and
            atol 1e-10 m.
        start: starting state, by default `AtRest()`; `motion.end` continues another motion, and
            `Launch(..)` places balls.
        keep: number of revolutions at the end to keep, by default all.
        at: station(s) [m] to observe; by default that of the first contact, else of the first
            effect with a station, else the end of the shaft.
        period: length [s] of a "revolution" at zero speed, not allowed otherwise; or the name of a shaft
            of several, whose turns are then the revolutions; such a run goes on from another by steps
            along times, which are others than those of one run.
        adjoint: diffrax adjoint for derivatives: forward mode by default,
            `diffrax.RecursiveCheckpointAdjoint()` for reverse mode.
        max_steps: steps an adaptive solver may take, by default 4096 a revolution, or a million along
            `times` and where what remembers or turns is integrated.
        progress: whether to report progress after two seconds; by default only on a terminal.

    Returns:
        A `TimeHistory`. If a motion fails while values are traced, it is not finite; so is one by
        revolutions of parts without mass inside `jax.jit` or `jax.grad`, where `times` are to be given.

    Raises:
        ValueError: if an argument is not as described, or the scene is not: by revolutions a speed that
            varies, hysteretic damping, an undamped resonance.
        RuntimeError: if the motion does not stay finite, the solver does not meet its tolerance, or a
            stop was touched that is too stiff for the steps; not while values are traced.

    Source: Azarov, Gouskov, Panovko (2023), eq. (9); the solvers name theirs.
    """
    start = checked_start(start, scene)
    scene, pilots = with_nodes(scene, nodes, tolerance)
    run: dict[str, Any] = {"solver": solver, "controller": controller, "start": start, "at": at}
    if times is not None:
        for name, value in {"revolutions": revolutions, "keep": keep, "period": period}.items():
            if value is not None:
                raise ValueError(
                    f"`{name}` is for whole revolutions, but `times` are given; take one."
                )
        if steps_per_revolution == "auto":
            raise ValueError(
                'Steps "auto" are for whole revolutions; along `times` call `run_up(.., substeps="auto")`.'
            )
        run |= {"adjoint": adjoint, "max_steps": max_steps or MOST_STEPS, "progress": progress}
        found = run_up(scene, times, tolerance=tolerance, **run)
        return dataclasses.replace(found, pilots=pilots + found.pilots)
    if revolutions is None:
        raise ValueError("`simulate` needs `revolutions`, or the `times` of the samples [s].")
    keep = revolutions if keep is None else keep
    run |= {"period": period, "max_steps": max_steps or REVOLUTION_STEPS}
    steps_asked = steps_per_revolution
    if steps_per_revolution == "auto":
        check_counts(revolutions=revolutions)
        pilots += (chosen_steps(scene, revolutions, tolerance, **run),)
        steps_per_revolution = pilots[-1].setting
    check_counts(revolutions=revolutions, keep=keep, steps_per_revolution=steps_per_revolution)
    if keep > revolutions:
        raise ValueError(f"`keep` must not exceed `revolutions` = {revolutions}, but is {keep}.")
    check_constant_speed(scene, "Motion by `revolutions`")
    check_tables(scene)
    check_weight(scene)
    counts = revolutions, keep, steps_per_revolution
    run |= {"adjoint": adjoint, "progress": progress}
    run["measured"] = steps_asked == "auto" and pilots[-1].converged
    found = _by_revolutions(scene, counts, tolerance, **run)
    return dataclasses.replace(found, pilots=pilots + found.pilots)


def _by_revolutions(
    scene: Scene,
    counts: tuple[int, int, int],
    tolerance: float | int,
    *,
    solver,
    start,
    at,
    period,
    progress,
    measured: bool = False,
    **options,
) -> TimeHistory:
    """Motion by whole revolutions: their number, how many are kept, and the steps of each.

    `measured` says that a pilot has found the steps to be enough.
    """
    asked, (scene, stations) = scene, scene.to_simulate(at, in_time=False)
    groups = port_groups(scene)
    counted = counted_by(assemble(scene, groups), scene, period)
    system, why = system_of_march(scene, counted, solver, start)
    if system is None:
        options |= {"solver": solver, "start": start, "at": at, "progress": progress}
        found = _by_times(asked, counts, revolution_rate(scene, period), options)
        why = why if solver is None else ASKED
        return dataclasses.replace(found, method=f"{found.solver} {why}")
    revolutions, keep, steps = counts
    start, begin = _begun(system, start), Launch.of(start)
    rate = revolution_rate(scene, period)
    solver, pilots = with_shapes(solver, [system], [rate], stations, tolerance)
    plan = Plan(
        choose(solver, system, rate, start),
        options["controller"],
        _checked_adjoint(options["adjoint"], solver),
        options["max_steps"],
        steps,
        slopes=True,
        contacts=True,
        coordinates=True,
        together=groups,
    )
    skip = revolutions - keep
    # One program serves runs of any length, except in reverse mode.
    if skip and system.ports and isinstance(plan.adjoint, dfx.ForwardMode):
        skip = jnp.asarray(skip)
    with waiting(progress, "simulation"):
        run = _run(system, plan, start, rate, stations, skip, keep)
        end, motion, good, ratio, amplified = run
        failed = known(good.ok) and not bool(good.ok)
    if failed:
        check_not_amplified(system, amplified, steps)
        check_held(scene, "A motion by revolutions")
        start.state(system, stations[0])  # raises if the start is the cause
        raise RuntimeError(
            "The motion did not stay finite, or the solver could not meet its tolerance: take more "
            "`steps_per_revolution`, a larger `max_steps`, or look at `jaxrotor.roots` for growth."
            + walls(scene)
        )
    if isinstance(plan.solver, Exponential):
        stops = Rebounds(scene, system.members, good.touched, ratio, motion["contact_force"])
        stops.check(plan.solver, in_revolutions(steps), measured=measured)
    angle = 2 * jnp.pi * (revolutions - keep + jnp.arange(keep * steps + 1) / steps)
    coordinates, rates = motion.pop("coordinates")
    time, speed = angle / rate, jnp.broadcast_to(scene.spin.speed, angle.shape)
    return TimeHistory(
        time=time,
        angle=speed * time,
        speed=speed,
        acceleration=jnp.zeros_like(speed),
        **motion,
        coordinates=coordinates,
        rates=rates,
        balls=(),
        states={},
        stations=stations,
        stopped=jnp.asarray(jnp.inf),
        end=_end_of(system, begin, end, time[-1]),
        unresolved=good.unresolved,
        scene=asked,
        solver=solver_name(plan.solver),
        method=f"{solver_name(plan.solver)} {why}",
        steps_per_revolution=steps,
        pilots=pilots,
    )


def _begun(system: System, start: AbstractStart) -> AbstractStart:
    """A start at a whole revolution: that of the shaft alone, or with the angle and time of several."""
    shaft = shaft_of(start, "Motion by `revolutions`")
    several = system.others and isinstance(start, Launch)
    return dataclasses.replace(start, shaft=shaft) if several else shaft


def _end_of(system: System, begin: Launch, end: tuple[Array, ...], time: Scalar) -> Launch:
    """End of a motion; the angles of several shafts follow by that of the first one and the time."""
    if not system.others:
        return Launch(Continued(*end))
    angle = begin.angle + system.spin.speed * time
    return Launch(Continued(*end[:2]), angle=angle, time=begin.time + time)


def _by_times(
    scene: Scene, counts: tuple[int, int, int], rate: Scalar, options: dict[str, Any]
) -> TimeHistory:
    """Motion by whole revolutions along the times of their samples."""
    revolutions, keep, steps = counts
    check_integrated(options["solver"])
    if not scene.shafts:  # whose clocks are stepped along times
        options["solver"] = options["solver"] or default_solver(scene)
    count = jnp.arange(keep * steps + 1)
    times = 2 * jnp.pi / rate * (revolutions - keep + count / steps)
    most = options["max_steps"]  # the default is that of motions along times
    options["max_steps"] = MOST_STEPS if most == REVOLUTION_STEPS else most * revolutions
    found = run_up(scene, times, **options)
    return dataclasses.replace(found, steps_per_revolution=steps)


def _checked_adjoint(adjoint: dfx.AbstractAdjoint | None, solver: Any) -> dfx.AbstractAdjoint:
    """The adjoint, by default forward mode; raises if the solver has no derivative of that kind."""
    adjoint = dfx.ForwardMode() if adjoint is None else adjoint
    if getattr(solver, "located", False) and not isinstance(adjoint, dfx.ForwardMode):
        raise ValueError(
            f"Located steps have derivatives in forward mode alone, but `adjoint` is "
            f"{type(adjoint).__name__}; use jax.jvp or jax.jacfwd, or Exponential(located=False)."
        )
    return adjoint


def with_nodes(
    scene: Scene, nodes: int | Literal["auto"] | None, tolerance: float | int
) -> tuple[Scene, tuple[Pilot, ...]]:
    """The scene with the nodes asked for, and the pilot that chose them, if "auto"."""
    if nodes is None:
        return scene, ()
    if nodes != "auto":
        return scene.with_nodes(nodes), ()
    pilot = chosen_nodes(scene, tolerance)
    return scene.with_nodes(pilot.setting), (pilot,)


def chosen_steps(
    scene: Scene, revolutions: int, tolerance: float | int = 1e-3, **run: Any
) -> Pilot:
    """Steps a revolution at which half as many give the same end of a run.

    The run advances to its last 20 revolutions by the fewest steps that stay finite. From there it is
    repeated with twice the steps until two successive displacements agree at all samples; if none do,
    `converged` is False and the most steps are taken. Nothing is promised for longer runs: motions that
    diverge exponentially (chaos) may agree over so short a window.

    Args:
        scene: rotor at constant speed.
        revolutions: length of the run in revolutions.
        tolerance: largest difference of two displacements, over the largest displacement.
        **run: `solver`, `start` and other arguments of `simulate`.

    Returns:
        A `Pilot`, whose `setting` is the number of steps a revolution.

    Raises:
        ValueError: if the scene is traced, the solver is adaptive, or `tolerance` is not positive.
    """
    if not all(known(leaf) for leaf in jax.tree.leaves(scene)):
        raise ValueError(
            'Steps "auto" are chosen by values, so not inside jax.jit or jax.grad; choose them before, '
            "by `jaxrotor.chosen_steps`."
        )
    if isinstance(run.get("solver"), dfx.AbstractAdaptiveSolver):
        raise ValueError(
            f'Steps "auto" are for solvers of fixed steps; {solver_name(run["solver"])} chooses its own '
            "by its tolerance, so give the number of samples."
        )
    window = min(PILOT, revolutions)
    if revolutions > window:
        with pilot_run():
            run |= {"start": _end(scene, revolutions - window, run)}

    def displacement(steps: int) -> np.ndarray | None:
        try:
            with pilot_run():
                found = simulate(scene, window, steps, **run).displacement
        except RuntimeError:  # not finite, or a stop too stiff for the steps: too few steps
            return None
        return np.asarray(found)[:: steps // LADDER[0]]

    return refined("steps a revolution", displacement, LADDER, tolerance)


def _end(scene: Scene, revolutions: int, run: dict[str, Any]) -> Launch:
    """End of a run by the fewest steps that stay finite."""
    for steps in LADDER[:-1]:
        with contextlib.suppress(RuntimeError):
            return simulate(scene, revolutions, steps, keep=1, **run).end
    return simulate(scene, revolutions, LADDER[-1], keep=1, **run).end


@compiled
def _run(system: System, plan: Plan, start, rate, stations, skip: Count, keep: int):
    """State at the end, the kept motion, the outcome, the contact stiffness ratio, `amplified`."""
    march = March.of(system, plan, rate, stations)
    y, first = march.skip(march.begin(start, stations[0]), skip)
    update = lambda carry, samples, _: (carry, {name: getattr(samples, name) for name in KEPT})
    (y, _, good), revolutions = march.collect(y, None, update, keep)
    motion = jax.tree.map(joined, revolutions)
    return march.decode(y), motion, first & good, march.contact_stiffness_ratio, march.amplified


def check_not_amplified(system: System, amplified: Array, steps: int) -> None:
    """Raise if steps of this size make the unequal axes that stand still drive a motion."""
    if known(amplified) and bool(amplified):
        raise RuntimeError(
            f"By {steps} `steps_per_revolution` a motion grows that does not: the unequal axes of "
            f"{unequal_parts(system, 'fixed')}, beside others that turn with the shaft, are too stiff for "
            "them; take more steps, or a diffrax solver such as `solver=diffrax.Kvaerno5()`."
        )
