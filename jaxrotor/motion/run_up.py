"""Run-up: motion of a scene at any spin: run-up, coast-down, a drive of limited power, balls."""

import dataclasses
from typing import Any, Literal, NamedTuple, cast

import diffrax as dfx
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jaxtyping import Array, Bool, Complex, Float

from ..analysis import first_moments
from ..core.extremes import larger
from ..core.progress import waiting
from ..core.quantities import Scalar, known, real
from ..core.tables import notebook_table
from ..effects.base import AbstractBetween, AbstractBodies
from ..equations.massless_coordinates import Known
from ..equations.rotating_frame import Instant, Posture, Transient, massless_of
from ..equations.start import AbstractStart, AtRest, Continued
from ..equations.system import System, assemble, has_massless
from ..scene import Scene
from ..solvers.control import step_control, tuned
from ..solvers.exponential import Exponential
from ..spins.base import Drive
from .simulate import checked_solver, solver_name


class Balls(eqx.Module):
    """Bodies of one race, seen from the shaft."""

    angle: Float[Array, "*T b"]  # psi = phi - theta [rad]
    rate: Float[Array, "*T b"]  # [rad/s]


class Launch(eqx.Module):
    """State a run begins with.

    `balls` has an entry for every race; None spreads them evenly. `speed` other than None is what a
    `Drive` begins with, and what a `SpeedProfile` must have at its `time`; a `ConstantSpeed` jumps to
    its own. To go on with another profile, `dataclasses.replace(run.end, time=0.0)`.
    """

    shaft: AbstractStart = eqx.field(default_factory=AtRest)
    angle: Scalar = real("angle [rad]", default=0.0)
    balls: tuple[Balls, ...] | None = None
    speed: Scalar = real("speed [rad/s]", default=None)
    time: Scalar = real("time [s]", default=0.0)  # of a profile, at which the run begins
    stopped: Bool[Array, ""] = eqx.field(default=False, converter=jnp.asarray)  # for good


class RunUp(eqx.Module):
    """Motion of a scene at the times asked for, `T` of them, at `s` stations."""

    time: Float[Array, " T"]  # [s]
    angle: Float[Array, " T"]  # of rotation [rad]
    speed: Float[Array, " T"]  # of rotation [rad/s]
    acceleration: Float[Array, " T"]  # of rotation [rad/s^2]
    displacement: Complex[Array, "T s"]  # x + i y [m]
    velocity: Complex[Array, "T s"]  # [m/s]
    contact_force: Complex[Array, "T k"] | None  # on the shaft, by contact of the scene [N]
    balls: tuple[Balls, ...]
    stations: Float[Array, " s"]  # [m]
    stopped: Scalar  # when the rotor came to rest for good [s], infinite if never
    instants: Instant  # of everything, (T, ..)
    end: Launch  # to go on from
    scene: Scene
    solver: str = eqx.field(static=True)

    @property
    def imbalance(self) -> Complex[Array, " T"]:
        """Unbalance of the scene and of all balls, in the axes of the shaft [kg m]."""
        angles = [balls.angle for balls in self.balls]
        none = jnp.zeros((*self.time.shape, 0))
        return imbalance_of(self.scene, jnp.concatenate([none, *angles], axis=-1))

    def _repr_html_(self) -> str:
        sizes, rows = np.abs(self.displacement), []
        for at, size in zip(self.stations, sizes.T, strict=True):
            k = int(np.argmax(size))
            rows.append((at, size[k], self.time[k], self.speed[k]))
        heads = ("station [m]", "largest displacement [m]", "at time [s]", "at speed [rad/s]")
        return notebook_table(str(self), heads, rows)

    def __str__(self) -> str:
        first, last = float(self.speed[0]), float(self.speed[-1])
        turns = float(self.angle[-1] - self.angle[0]) / (2 * np.pi)
        return (
            f"RunUp from {first:g} to {last:g} rad/s in {float(self.time[-1] - self.time[0]):g} s and "
            f"{turns:.1f} revolutions, {self.time.size} samples, {self.solver}"
        )


def run_up(
    scene: Scene,
    times: Any,
    *,
    start: AbstractStart | Launch | None = None,
    at: float | Any | None = None,
    solver: dfx.AbstractSolver | Exponential | None = None,
    controller: dfx.AbstractStepSizeController | None = None,
    substeps: int = 1,
    adjoint: dfx.AbstractAdjoint | None = None,
    max_steps: int = 1_000_000,
    max_stops: int = 64,
    progress: bool | None = None,
) -> RunUp:
    """Motion at a speed that varies, whatever the spin: `ConstantSpeed`, `SpeedProfile`, `Drive`.

        M q.. + (C - i Omega G) q. + (K - i Omega H) q = (Omega^2 - i Omega.) u exp(i theta) + ..

    Integrated in the axes of the shaft, where the response to unbalance is slow. Axes may be unequal;
    balls and a drive that feels the rotor are solved with it. Coordinates without mass are eliminated:
    damped ones follow equations of first order, others algebraic ones. A rotation known in closed
    form is not integrated unless a solver is named.

    Args:
        scene: what moves.
        times: ascending [s], of the samples; the run begins at 0, also one that goes on.
        start: a starting state of the shaft, `Launch(..)` for balls and angle too, or `run.end`.
        at: station(s) [m] to observe, by default as `simulate`.
        solver: any diffrax solver; by default Dopri8 for a rigid or massless shaft, Kvaerno5 for a
            flexible one, whose high modes are stiff, and where coordinates have no mass.
        controller: step control, by default rtol 1e-7 and atol 1e-10 of m and rad.
        substeps: steps from sample to sample of a solver without an error estimate.
        adjoint: diffrax adjoint for derivatives, forward mode by default.
        max_steps: steps an adaptive solver may take.
        max_stops: how often a drive with feedback may come to rest or break loose.
        progress: whether to say after two seconds that it is under way; by default on a terminal.

    Returns:
        A `RunUp`. A run that fails raises; when traced, it is not finite.

    Sources: Filimonikhin, Goncharov (2011); course project of `turbine-run-up`.
    """
    times = _checked_times(times)
    launch = start if isinstance(start, Launch) else Launch(start or AtRest())
    counts = [bodies.places for bodies in scene.of(AbstractBodies)]
    spin = scene.spin.after(launch.time, launch.speed)
    begun = scene if spin is scene.spin else eqx.tree_at(lambda scene: scene.spin, scene, spin)
    drives = isinstance(spin, Drive) and spin.polar is None
    system = assemble(begun) if drives or not begun.shaft.has_mass else None
    chosen: Any = checked_solver(suited(begun, system) if solver is None else solver)
    if isinstance(chosen, Exponential):
        raise ValueError(
            "`solver` Exponential() is for constant speed; give a diffrax solver or none."
        )
    times, stations = jnp.asarray(times, float), scene.stations(at)
    controller = controller or control(chosen, begun)
    plan = Integration(
        solver=tuned(chosen),
        controller=controller,
        adjoint=dfx.ForwardMode() if adjoint is None else adjoint,
        substeps=substeps,
        max_steps=max_steps,
        max_stops=max_stops,
        free=isinstance(spin, Drive) and (solver is not None or not spin.given),
        from_start=controller is None and known(times) and float(times[0]) == 0,
        massless=massless_of(begun, system),
    )
    if controller is None and isinstance(spin, Drive) and spin.can_stop:
        raise ValueError(
            "A drive that can come to rest needs steps that end there; give a solver with an error "
            "estimate, such as diffrax.Tsit5()."
        )
    if isinstance(spin, Drive) and spin.polar is None and system is not None:
        spin.inertia(system.blocks.polar)  # refuses what cannot turn
    launch = _whole(launch, counts)
    with waiting(progress, "run-up"):
        motion = _motion(begun, times, launch, stations, plan)
        failed = known(motion.good) and not bool(motion.good)
    if failed:
        launch.shaft.state(assemble(begun), stations[0])  # says so if the start is what is wrong
        raise RuntimeError(
            "The motion did not stay finite, or the solver could not meet its tolerance: take a larger "
            "`max_steps` or more `substeps`, look whether the drive runs away (`Drive(odd=True)` "
            "brakes at any sign of the speed), or take more `max_stops` if it stops often."
        )
    return _result(scene, times, stations, motion, solver_name(chosen))


def suited(scene: Scene, system: System | None = None) -> dfx.AbstractSolver:
    """Implicit where a flexible shaft has high modes, or dampers act on coordinates without mass."""
    if has_massless(scene, system):
        return dfx.Kvaerno5()
    line = lambda scene: scene.line().stiffness
    size = eqx.filter_eval_shape(line, scene).shape[0] if system is None else system.n
    return dfx.Kvaerno5() if size > 2 else dfx.Dopri8()


def control(solver, scene: Scene, **options) -> dfx.AbstractStepSizeController | None:
    """Adaptive steps that step over no jump of the acceleration and no impact of bodies.

    Free bodies move without error, so nothing else would keep a step from leaping over an impact.
    """
    impacts = [
        between.duration(race.rolling * jnp.max(race.masses)) / 4
        for between in scene.of(AbstractBetween)
        for race in scene.of(AbstractBodies)
    ]
    longest = jnp.min(jnp.stack(impacts)) if impacts else None
    steps: Any = step_control(solver, dtmax=longest, **options)
    if steps is None or scene.spin.kinks is None:
        return steps
    return dfx.ClipStepSizeController(steps, jump_ts=scene.spin.kinks)


def _checked_times(times: Any) -> Any:
    if not known(times):
        return times
    values = np.atleast_1d(np.asarray(times, float))
    if values.ndim > 1 or values.size < 2 or values[0] < 0 or not np.all(np.diff(values) > 0):
        raise ValueError(
            f"`times [s]` must be two or more ascending times from 0 on, but is {times!r}."
        )
    return values


def _whole(launch: Launch, counts: list[int]) -> Launch:
    """A launch with an entry for every race."""
    if not counts and launch.balls is None:
        return launch
    if launch.balls is None:
        spread = [2 * jnp.pi * jnp.arange(count) / count for count in counts]
        balls = tuple(Balls(angle, jnp.zeros_like(angle)) for angle in spread)
    else:
        balls = tuple(Balls(*map(jnp.asarray, (b.angle, b.rate))) for b in launch.balls)
    shapes = [ball.angle.shape for ball in balls]
    if shapes != [(count,) for count in counts]:
        raise ValueError(
            f"`balls` must have an entry for every race, of {counts} angles, but has {shapes}."
        )
    return dataclasses.replace(launch, balls=balls)


class Integration(eqx.Module):
    """How a run is integrated."""

    solver: dfx.AbstractSolver
    controller: dfx.AbstractStepSizeController | None
    adjoint: dfx.AbstractAdjoint
    substeps: int = eqx.field(static=True)
    max_steps: int = eqx.field(static=True)
    max_stops: int = eqx.field(static=True)
    free: bool = eqx.field(static=True)  # whether the spin is integrated too
    from_start: bool = eqx.field(static=True)  # whether fixed steps begin with the first sample
    massless: Known | Literal["unknown"] | None = eqx.field(static=True)  # see `massless_of`

    def solve(self, field: Transient, begin: Scalar, y: Posture, times: Array, event=None):
        """States at `times`, whether all went well, and when and where the run ended."""
        controller, max_steps = self.controller, self.max_steps
        if controller is None:
            grid = times if self.from_start else jnp.append(begin, times)
            share = jnp.arange(self.substeps) / self.substeps
            grid = jnp.append((grid[:-1, None] + jnp.diff(grid)[:, None] * share).ravel(), grid[-1])
            controller, max_steps = dfx.StepTo(ts=grid), grid.size - 1
        last = dfx.SubSaveAt(t1=True)
        solution = dfx.diffeqsolve(
            # Closed over rather than given: diffrax warns of complex leaves.
            dfx.ODETerm(lambda t, y, args: field(cast(Any, t), y)),
            self.solver,
            begin,
            larger(times[-1], begin),
            None,
            y,
            saveat=dfx.SaveAt(subs=[dfx.SubSaveAt(ts=times), last]),
            stepsize_controller=controller,
            adjoint=self.adjoint,
            max_steps=max_steps,
            event=event,
            throw=False,
        )
        (path, end), (_, ended) = cast(Any, solution.ys), cast(Any, solution.ts)
        good = (solution.result == dfx.RESULTS.successful) | (
            solution.result == dfx.RESULTS.event_occurred
        )
        return path, good, ended[-1], jax.tree.map(lambda leaf: leaf[-1], end)


@eqx.filter_jit
def integrate(scene: Scene, times: Array, launch: Launch, stations: Array, plan: Integration):
    """Instants at the times, when the rotor stopped, whether all went well, motion of the stations."""
    field, senses = Transient.of(scene, None, launch.angle, plan.massless), None
    stopped = jnp.asarray(jnp.inf)
    system = field.system
    y = _posture(scene, system, launch, stations[0], field.rate, plan.free)
    if not plan.free and not system.n and not y.bodies.size:  # nothing to integrate
        path, good = jax.tree.map(lambda leaf: jnp.zeros((times.size, *leaf.shape)), y), True
    elif plan.free and isinstance(scene.spin, Drive) and scene.spin.can_stop:
        path, senses, good, stopped = _run_to_rest(field, plan, launch, y, times)
    else:
        path, good, _, _ = plan.solve(field, jnp.zeros(()), y, times)
    if senses is None:
        instants = jax.vmap(field.instant)(times, path)
    else:
        look = lambda time, y, sense: field.hold(sense == 0, sense).instant(time, y)
        instants = jax.vmap(look)(times, path, senses)
    return instants, stopped, good & _finite(instants), _seen(system, instants, stations)


def _posture(scene, system, launch: Launch, station: Scalar, rate: Scalar, free: bool) -> Posture:
    """State of the equations at the start."""
    speed = scene.spin.speed
    q, velocity = launch.shaft.state(system, station)
    turn = jnp.exp(-1j * launch.angle)
    plane = lambda z: jnp.stack([z.real, z.imag])
    join = lambda parts: jnp.concatenate([jnp.zeros(0), *parts])
    alone = lambda value: jnp.reshape(value, -1)[: int(free)]
    return Posture(
        plane(turn * q),
        plane(turn * (velocity - 1j * speed * q)) / rate,
        alone(launch.angle),
        alone(speed / rate),
        join(balls.angle for balls in launch.balls or ()),
        join(balls.rate for balls in launch.balls or ()) / rate,
    )


class _Stage(NamedTuple):
    """A run up to where its spin came to rest or broke loose."""

    time: Scalar
    y: Posture
    path: Posture  # at the samples
    senses: Float[Array, " T"]  # of rotation at the samples: 1, -1, or 0 at rest
    sense: Scalar
    stays: Array  # whether it came to rest for good
    stopped: Scalar  # when, infinite while it turns
    good: Array


def _run_to_rest(field: Transient, plan: Integration, launch: Launch, y: Posture, times: Array):
    """A run whose spin comes to rest, stays there, turns back or breaks loose again.

    Dry friction holds a rotor while the torque of all else is not above it. Without feedback that
    torque is constant at rest and one-signed after, so two stages are all there can be.
    """
    spin: Any = field.system.spin
    dry = jnp.zeros(()) if spin.coulomb is None else jnp.asarray(spin.coulomb)

    def loosened(time: Scalar, y: Posture) -> tuple[Scalar, Scalar]:
        """The sense in which a rotor at rest starts to turn, 0 if none, and what friction spares."""
        load = field.load(time, y)
        spared = dry - jnp.abs(load)
        return jnp.where(spared >= 0, 0.0, jnp.sign(load)), spared

    def stage(at: _Stage, _) -> tuple[_Stage, None]:
        turns = jnp.asarray(at.sense != 0)

        def margin(t, y, args, **_):
            held = loosened(t, y)[1] if spin.feedback and spin.coulomb is not None else 1.0
            left = jnp.where(turns, at.sense * y.speed[0], jnp.where(at.stays, 1.0, held))
            return jnp.where(t <= at.time, 1.0, left)

        path, fine, last, end = plan.solve(
            field.hold(~turns, at.sense),
            at.time,
            at.y,
            larger(times, at.time),
            dfx.Event(margin, optx.Newton(1e-12, 1e-12), direction=False),
        )
        there = last < times[-1]
        halts = there & turns
        end = eqx.tree_at(lambda y: y.speed, end, jnp.where(halts, 0.0, end.speed))
        stays = at.stays | (halts & spin.stops)
        sense = jnp.where(stays, 0.0, loosened(last, end)[0])
        # What broke loose turns, though its margin may be zero to rounding.
        sense = jnp.where(there & ~turns, jnp.sign(field.load(last, end)), sense)
        sense = jnp.where(there, sense, at.sense)
        stopped = jnp.where(there, jnp.where(sense == 0, last, jnp.inf), at.stopped)
        later = (times > at.time) | (at.time <= 0)
        pick = lambda a, b: jnp.where(jnp.reshape(later, (-1,) + (1,) * (a.ndim - 1)), a, b)
        return (
            _Stage(
                last,
                end,
                jax.tree.map(pick, path, at.path),
                pick(jnp.full(times.shape, at.sense), at.senses),
                sense,
                stays,
                stopped,
                at.good & fine,
            ),
            None,
        )

    begin, stays = jnp.zeros(()), jnp.asarray(launch.stopped)
    still = y.speed[0] == 0
    sense = jnp.where(still, loosened(begin, y)[0], jnp.sign(y.speed[0]))
    sense = jnp.where(stays, 0.0, sense)
    samples = jax.tree.map(lambda leaf: jnp.zeros((times.size, *leaf.shape)), y)
    first = _Stage(
        begin,
        y,
        samples,
        jnp.zeros(times.size),
        sense,
        stays,
        jnp.where(sense == 0, 0.0, jnp.inf),
        jnp.asarray(True),
    )
    count = plan.max_stops + 1 if spin.feedback else 2
    done, _ = jax.lax.scan(stage, first, None, length=count)
    return done.path, done.senses, done.good & (done.time >= times[-1]), done.stopped


def _finite(instants: Instant) -> Array:
    return jnp.all(jnp.array([jnp.all(jnp.isfinite(leaf)) for leaf in jax.tree.leaves(instants)]))


def _seen(system: System, instants: Instant, stations: Array):
    """Displacement, velocity and contact forces in fixed axes."""
    turn = jnp.exp(1j * instants.turning.angle)[:, None]
    rows = jax.vmap(system.line.row)(stations)
    velocity = jax.vmap(lambda now: now.velocity)(instants)
    forces = None
    if system.ports:
        ports = jnp.stack([port.row for port in system.ports])
        plane = lambda z: jnp.stack([z.real, z.imag], axis=-1)
        forces = jax.vmap(system.contact_forces)(
            plane(turn * instants.r @ ports.T),
            plane(turn * velocity @ ports.T),
            instants.turning.speed,
        )
        forces = forces[..., 0] + 1j * forces[..., 1]
    return turn * instants.r @ rows.T, turn * velocity @ rows.T, forces


class _Motion(NamedTuple):
    """What a run computes, and the state it ends with."""

    instants: Instant
    stopped: Scalar
    good: Array
    seen: tuple[Array, Array, Array | None]
    balls: tuple[Balls, ...]
    end: dict[str, Any]


@eqx.filter_jit
def _motion(scene: Scene, times: Array, launch: Launch, stations: Array, plan: Integration):
    """All of a run in one program: array by array outside, it would cost more than the integration."""
    instants, stopped, good, seen = integrate(scene, times, launch, stations, plan)
    rates = instants.bodies_speed - instants.turning.speed[:, None]
    pairs = zip(by_race(scene, instants.bodies), by_race(scene, rates), strict=True)
    balls = tuple(Balls(*pair) for pair in pairs)
    last: Any = jax.tree.map(lambda leaf: leaf[-1], (instants, balls))
    end, thrown = last
    stops = isinstance(scene.spin, Drive) and scene.spin.stops
    state = {
        "shaft": Continued(end.r * end.turn, end.velocity * end.turn),
        "angle": end.turning.angle,
        "balls": thrown,
        "speed": end.turning.speed,
        "time": launch.time + times[-1],
        "stopped": jnp.isfinite(stopped) & stops,
    }
    return _Motion(instants, stopped, good, seen, balls, state)


def _result(scene: Scene, times: Array, stations: Array, motion: _Motion, name: str) -> RunUp:
    turning = motion.instants.turning
    displacement, velocity, contact_force = motion.seen
    return RunUp(
        time=times,
        angle=turning.angle,
        speed=turning.speed,
        acceleration=turning.acceleration,
        displacement=displacement,
        velocity=velocity,
        contact_force=contact_force,
        balls=motion.balls,
        stations=stations,
        stopped=motion.stopped,
        instants=motion.instants,
        end=Launch(**motion.end),
        scene=scene,
        solver=name,
    )


def by_race(scene: Scene, values: Array) -> list[Array]:
    """Values of all bodies, along the last axis, parted by their races."""
    races = scene.of(AbstractBodies)
    ends = np.cumsum([race.places for race in races])
    return jnp.split(values, ends[:-1], axis=-1) if races else []


def imbalance_of(scene: Scene, bodies: Float[Array, "*T b"]) -> Complex[Array, "*T"]:
    """Unbalance of the scene and of all bodies at angles `psi` from the shaft, in its axes [kg m]."""
    moments = [race.masses * race.race_radius for race in scene.of(AbstractBodies)]
    of_bodies = jnp.exp(1j * bodies) @ jnp.concatenate([jnp.zeros(0), *moments])
    return first_moments(scene).unbalance + of_bodies
