"""Run-up: motion of a scene at any spin, such as run-up, coast-down or a drive of limited power."""

import dataclasses
from typing import Any, Literal, NamedTuple

import diffrax as dfx
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from ..core.compiled import compiled
from ..core.pilot import Pilot, refined
from ..core.progress import waiting
from ..core.quantities import known
from ..effects.base import AbstractBodies, AbstractCoaxial, AbstractContact
from ..equations.rotating_frame import massless_of
from ..equations.speed_tables import check_tables, has_tables
from ..equations.start import AbstractStart, Balls, Continued, Launch, check_states
from ..equations.system import System, assemble, state_names
from ..scene import Scene
from ..solvers.choice import checked_solver, solver_name
from ..solvers.control import tuned
from ..solvers.exponential import Exponential
from ..spins.drive import Drive
from .choice import ASKED, default_solver, steps_along
from .history import TimeHistory, named_states
from .pieces import appearing, in_pieces
from .rebounds import Rebounds
from .stepped import Stepping, stepping_of, without_steps
from .transient import Integrated, Integration, controller_for, integrate


MOST_STEPS = 1_000_000  # of a run, by default
DOUBLINGS = 8  # of the steps that "auto" tries


def run_up(
    scene: Scene,
    times: Any,
    *,
    start: AbstractStart | None = None,
    at: float | Any | None = None,
    solver: dfx.AbstractSolver | Exponential | None = None,
    controller: dfx.AbstractStepSizeController | None = None,
    substeps: int | Literal["auto"] | None = None,
    tolerance: float = 1e-3,
    adjoint: dfx.AbstractAdjoint | None = None,
    max_steps: int = MOST_STEPS,
    max_stops: int = 64,
    progress: bool | None = None,
) -> TimeHistory:
    """Motion at any spin, `ConstantSpeed`, `SpeedProfile` or `Drive`, in time.

        M q.. + (C - i Omega G) q. + (K - i Omega H) q = (Omega^2 - i Omega.) u exp(i theta) + ..

    `Exponential` takes the linear part exactly at one of a few speeds and the rest by its stages, also
    balls and a drive that the rotor holds back, for which order 4 is best: on a flexible shaft its error
    falls with the power 1.5 of the step then (limiter rotor), so let "auto" choose `substeps`. It needs
    mass at every coordinate, and takes no unequal axes that turn, no drive under which the rotor may come
    to rest, and no balls that touch.
    Without contact and at constant speed it is exact at any times where values are known and no undamped
    mode is in resonance; `substeps` are then not used.
    Diffrax solvers take every scene and integrate in the axes of the shaft, where the response to
    unbalance varies slowly; a drive with feedback from the rotor and balls are part of the equations.
    Coordinates without mass are eliminated: damped ones follow equations of first order, others
    algebraic ones. A rotation known in closed form is not integrated unless a diffrax solver is given.

    Args:
        scene: rotor with any spin.
        times: ascending times of the samples [s]; every run begins at 0, also one that continues another.
        start: a starting state of the shaft, `Launch(..)` for balls and angle too, or `motion.end`.
        at: station(s) [m] to observe, by default as in `simulate`.
        solver: `Exponential(..)` or any diffrax solver; by default as in a sweep: exponential steps of
            order 4, with contact 2, where they can be taken, else Dopri8 for one or two coordinates with
            mass and Kvaerno5 for more; see "One motion, three marches" in the documentation.
        controller: step control of a diffrax solver, by default rtol 1e-7 and atol 1e-10 of m and rad.
        substeps: steps from sample to sample of a solver without an error estimate; of `Exponential` by
            default as many as follow the unbalance at the highest speed, of a drive at that which it would
            have alone, or 256 a revolution with contact.
            "auto" doubles them until two successive motions agree within `tolerance` at all samples; so
            they are chosen where no solver is named and there is contact, balls or such a drive.
        tolerance: relative tolerance of "auto".
        adjoint: diffrax adjoint for derivatives, forward mode by default.
        max_steps: steps an adaptive solver may take.
        max_stops: how often a drive with feedback may come to rest or break loose.
        progress: whether to report progress after two seconds; by default only on a terminal.

    Returns:
        A `TimeHistory`. If a run fails while values are traced, it is not finite.

    Raises:
        ValueError: if an argument is not as described, the solver cannot integrate the spin, or the
            motion of coordinates without mass is not determined.
        RuntimeError: if the motion does not stay finite, the solver does not meet its tolerance, or a stop
            was touched that is too stiff for the steps; not while values are traced.

    Sources: Filimonikhin, Goncharov (2011); course project of `turbine-run-up`.
    """
    times, launch = _checked_times(times), Launch.of(start)
    if appearing(scene):
        how = dict(at=at, solver=solver, controller=controller, substeps=substeps)
        how |= dict(tolerance=tolerance, adjoint=adjoint, max_steps=max_steps)
        how |= dict(max_stops=max_stops, progress=progress)
        return in_pieces(run_up, scene, times, launch, how)
    asked, (scene, stations) = scene, scene.to_simulate(at)
    begun = after(scene, launch)
    if controller is None and adjoint is None:
        begun = without_steps(begun, times, launch, solver)
    check_tables_along(begun, times)
    system = assemble(begun)
    why = ASKED if solver is not None else "by default"
    if solver is None and controller is None and adjoint is None:
        solver, why = steps_along(begun, system, times)
        rough = bool(system.ports) or system.coupled
        if solver is not None and substeps is None and rough and _given(begun, launch):
            substeps = "auto"
    launch = with_balls(scene, launch)
    pilots: tuple[Pilot, ...] = ()
    if isinstance(solver, Exponential):
        if controller is not None or adjoint is not None:
            raise ValueError(
                "`controller` and `adjoint` are for diffrax solvers, not Exponential()."
            )
        count = None if substeps == "auto" else substeps
        stepping = stepping_of(begun, times, solver, count, system, launch)
        if substeps == "auto":
            stepping, pilot = _refined(begun, system, times, launch, stations, stepping, tolerance)
            pilots = (pilot,)
        elif _given(begun, launch):
            stepping = stepping.with_steps(stepping.steps)
        plan: Integration | Stepping = stepping
    else:
        if substeps == "auto":
            raise ValueError(
                '`substeps` "auto" are for Exponential(); a diffrax solver has a `controller`.'
            )
        options = {"adjoint": adjoint, "max_steps": max_steps, "max_stops": max_stops}
        from_start = known(times) and float(times[0]) == 0
        plan = integration_of(
            begun, solver, controller, substeps or 1, options, system, from_start=from_start
        )
    times = jnp.asarray(times, float)
    with waiting(progress, "run-up"):
        motion = _motion(begun, system, times, launch, stations, plan)
        failed = known(motion.run.good) and not bool(motion.run.good)
    if isinstance(plan, Stepping):
        stops = _rebounds(begun, system, motion.run)
        times_as_many = lambda more: f"{more:.2g} times as many `substeps`"
        measured = any(pilot.converged for pilot in pilots)
        stops.check(plan.solver, times_as_many, measured=measured)
    if failed:
        check_tables(begun, motion.run.turning.speed)
        launch.shaft.state(system, stations[0])  # raises if the start is the cause
        raise RuntimeError(
            "The motion did not stay finite, or the solver could not meet its tolerance: take a larger "
            "`max_steps` or more `substeps`, check whether the drive runs away (`Drive(odd=True)` "
            "brakes at any sign of the speed), or take more `max_stops` if it stops often."
            + walls(begun)
        )
    if isinstance(scene.spin, Drive) and known(motion.run.turning.speed):
        scene.spin.check_drag(motion.run.turning.speed)
    name = solver_name(plan.solver)
    return _result(asked, times, stations, motion, (name, f"{name} {why}"), pilots)


def walls(scene: Scene) -> str:
    """A sentence on bearings that have no force at their wall and beyond, for a motion that ended."""
    walled = [one for one in scene.of(AbstractContact) if one.walled]
    if not walled:
        return ""
    names = ", ".join(map(scene.name_of, walled))
    return f" At the wall of a bearing ({names}) there is no force: see if the shaft came there."


def integration_of(
    scene: Scene,
    solver: Any,
    controller: Any,
    substeps: int,
    options: dict[str, Any],
    system: System | None = None,
    *,
    from_start: bool,
) -> Integration:
    """Settings of the integration by a diffrax solver, by default one for the scene.

    `from_start` tells that the first sample is the start, so that no step leads to it. `system` are the
    equations of the scene, where they are at hand.
    """
    spin = scene.spin
    drives = isinstance(spin, Drive) and spin.polar is None
    if system is None and (drives or not scene.shaft.has_mass):
        system = assemble(scene)
    chosen: Any = checked_solver(default_solver(scene, system) if solver is None else solver)
    controller = controller or controller_for(chosen, scene)
    plan = Integration(
        solver=tuned(chosen),
        controller=controller,
        adjoint=options["adjoint"] or dfx.ForwardMode(),
        substeps=substeps,
        max_steps=options["max_steps"],
        max_stops=options["max_stops"],
        free=isinstance(spin, Drive) and (solver is not None or not spin.given),
        from_start=controller is None and from_start,
        massless=massless_of(scene, system),
    )
    if controller is None and isinstance(spin, Drive) and spin.can_stop:
        raise ValueError(
            "A drive that can come to rest needs steps that end there; give a solver with an error "
            "estimate, such as diffrax.Tsit5()."
        )
    if isinstance(spin, Drive) and spin.polar is None and system is not None:
        spin.inertia(system.blocks.polar)  # raises unless it is positive
    return plan


def _given(scene: Scene, launch: Launch) -> bool:
    """Whether all values of a scene and its start are known."""
    return all(known(leaf) for leaf in jax.tree.leaves((scene, launch)))


def _refined(
    scene: Scene,
    system: System,
    times: Any,
    launch: Launch,
    stations: Array,
    stepping: Stepping,
    tolerance: float,
) -> tuple[Stepping, Pilot]:
    """Settings with as many steps as the motion at the samples needs, and the pilot that found them."""
    if not _given(scene, launch):
        raise ValueError(
            '`substeps` "auto" are chosen by values, so not inside jax.jit or jax.grad; choose them '
            "before."
        )
    first = stepping.steps

    def displacement(substeps: int) -> np.ndarray | None:
        finer = stepping.with_steps(substeps)
        run = _motion(scene, system, jnp.asarray(times, float), launch, stations, finer).run
        long = _rebounds(scene, system, run).too_long(stepping.solver)
        return np.asarray(run.seen.displacement) if bool(run.good) and not long else None

    ladder = [first * 2**k for k in range(DOUBLINGS)]
    pilot = refined("steps a piece of the run", displacement, ladder, tolerance)
    return stepping.with_steps(pilot.setting), pilot


def _rebounds(scene: Scene, system: System, run: Integrated) -> Rebounds:
    """Rebounds of a run by exponential steps."""
    own = run.touched, run.contact_stiffness_ratio, run.seen.contact_force
    return Rebounds(scene, system.members, *own)


def _checked_times(times: Any) -> Any:
    """Times as an array, if known; raises unless they ascend from 0 or later."""
    if not known(times):
        return times
    values = np.atleast_1d(np.asarray(times, float))
    if values.ndim > 1 or values.size < 2 or values[0] < 0 or not np.all(np.diff(values) > 0):
        raise ValueError(
            f"`times [s]` must be two or more ascending times from 0 on, but is {times!r}."
        )
    return values


def check_tables_along(scene: Scene, times: Any) -> None:
    """Raise unless tables of a scene have values at the speeds that are known before a run.

    Of a drive that is the first one.
    """
    if not has_tables(scene):
        return
    if isinstance(scene.spin, Drive) or not known(times):
        check_tables(scene)
    else:
        check_tables(scene, scene.spin.turning(jnp.append(0.0, times)).speed)


def after(scene: Scene, launch: Launch) -> Scene:
    """The scene with the spin that it has from the time of a launch on."""
    spin, phases = scene.spin.after(launch.time, launch.speed), {}
    for shaft in scene.of(AbstractCoaxial):
        if shaft.speed is not None:  # of what does not turn by the angle of the first shaft
            begun = 0.0 if shaft.phase is None else shaft.phase
            phases[f"{scene.name_of(shaft)}.phase"] = begun + shaft.speed * launch.time
    scene = scene.put(phases) if phases else scene
    return scene if spin is scene.spin else eqx.tree_at(lambda scene: scene.spin, scene, spin)


def with_balls(scene: Scene, launch: Launch) -> Launch:
    """The launch with balls for every race; raises unless it has as many, and states, as the scene."""
    if launch.states is not None:
        check_states(launch.states, len(state_names(scene)))
    counts = [bodies.places for bodies in scene.of(AbstractBodies)]
    if not counts and launch.balls is None:
        return launch
    if launch.balls is None:
        spread = [2 * jnp.pi * jnp.arange(count) / count for count in counts]
        balls = tuple(Balls(angle, jnp.zeros_like(angle)) for angle in spread)
    else:
        own = lambda part: jnp.asarray(
            part, float
        )  # of no weak type, of which jax compiles another program
        balls = tuple(Balls(own(b.angle), own(b.rate)) for b in launch.balls)
    shapes = [ball.angle.shape for ball in balls]
    if shapes != [(count,) for count in counts]:
        raise ValueError(
            f"`balls` must have an entry for every race, of {counts} angles, but has {shapes}."
        )
    return dataclasses.replace(launch, balls=balls)


class _Motion(NamedTuple):
    """Results of the compiled program of a run, and the state at its end."""

    run: Integrated
    balls: tuple[Balls, ...]
    end: dict[str, Any]


@compiled
def _motion(
    scene: Scene,
    system: System,
    times: Array,
    launch: Launch,
    stations: Array,
    plan: Integration | Stepping,
) -> _Motion:
    """Motion of a run in one program; what follows the integration would take longer than it outside."""
    run = integrate(scene, system, times, launch, stations, plan)
    driven = isinstance(scene.spin, Drive) and scene.spin.driven_back(run.turning.speed)
    if driven is not False:
        seen = jax.tree.map(lambda leaf: jnp.where(driven, jnp.nan, leaf), run.seen)
        run = run._replace(seen=seen)
    balls: tuple[Balls, ...] = ()
    if run.instants is not None:
        rates = run.instants.bodies_speed - run.turning.speed[:, None]
        pairs = zip(by_race(scene, run.instants.bodies), by_race(scene, rates), strict=True)
        balls = tuple(Balls(*pair) for pair in pairs)
    last: Any = jax.tree.map(lambda leaf: leaf[-1], (run.turning, balls))
    end, balls_at_end = last
    stops = isinstance(scene.spin, Drive) and scene.spin.stops
    state = {
        "shaft": Continued(run.seen.coordinates[-1], run.seen.rates[-1]),
        "angle": end.angle,
        "balls": balls_at_end,
        "speed": end.speed,
        "time": launch.time + times[-1],
        "stopped": jnp.isfinite(run.stopped) & stops,
        "states": run.instants.states[-1]
        if run.instants is not None and system.state_count
        else None,
    }
    return _Motion(run, balls, state)


def _result(scene, times, stations, motion: _Motion, named: tuple[str, str], pilots) -> TimeHistory:
    angle, speed, acceleration = motion.run.turning
    return TimeHistory(
        time=times,
        angle=angle,
        speed=speed,
        acceleration=acceleration,
        **motion.run.seen._asdict(),
        balls=motion.balls,
        states=named_states(scene, motion.run.instants),
        stations=stations,
        stopped=motion.run.stopped,
        end=Launch(**motion.end),
        unresolved=motion.run.unresolved,
        scene=scene,
        solver=named[0],
        method=named[1],
        steps_per_revolution=None,
        pilots=pilots,
        integrated=motion.run.instants,
    )


def by_race(scene: Scene, values: Array) -> list[Array]:
    """Values of all bodies, along the last axis, split by their races."""
    races = scene.of(AbstractBodies)
    ends = np.cumsum([race.places for race in races])
    return jnp.split(values, ends[:-1], axis=-1) if races else []
