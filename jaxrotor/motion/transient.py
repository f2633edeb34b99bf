"""Integration in time at a speed that varies, also of a drive that comes to rest."""

from collections.abc import Callable
from typing import Any, Literal, NamedTuple, cast

import diffrax as dfx
import equinox as eqx
import jax
import jax.numpy as jnp
import optimistix as optx
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Complex, Float

from ..core.compiled import compiled
from ..core.extremes import larger
from ..core.plane import direction, plane
from ..core.quantities import Scalar
from ..effects.base import AbstractBetween, AbstractBodies
from ..effects.law import Now
from ..equations.coupled import AuxiliaryState
from ..equations.kinematics import Kinematics, RotatingState, Turning
from ..equations.massless_coordinates import Known
from ..equations.rotating_frame import Transient
from ..equations.start import Launch
from ..equations.system import System
from ..scene import Scene
from ..solvers.control import step_control
from ..spins.drive import Drive
from .stepped import Stepping
from .stepped_rotor import stepped


def controller_for(solver, scene: Scene, **options) -> dfx.AbstractStepSizeController | None:
    """Adaptive steps that end at jumps of the acceleration and resolve impacts between bodies.

    Bodies move freely without error between impacts, so an error estimate alone could miss an impact.
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


class Integration(eqx.Module):
    """Settings of the integration of a run."""

    solver: dfx.AbstractSolver
    controller: dfx.AbstractStepSizeController | None
    adjoint: dfx.AbstractAdjoint
    substeps: int = eqx.field(static=True)
    max_steps: int = eqx.field(static=True)
    max_stops: int = eqx.field(static=True)
    free: bool = eqx.field(static=True)  # whether the spin is integrated too
    from_start: bool = eqx.field(static=True)  # whether fixed steps begin with the first sample
    massless: Known | Literal["unknown"] | None = eqx.field(static=True)  # see `massless_of`

    def solve(
        self,
        field: Transient,
        begin: Scalar,
        y: RotatingState,
        times: Array,
        margin: Callable[[Scalar, RotatingState], Scalar] | None = None,
    ):
        """States at `times`, whether the solver succeeded, and time and state at the end.

        The run ends earlier where the `margin` of an instant falls to zero.
        """
        # One array: of several, the sums over the stages of a step take half as long again.
        start, state_of = ravel_pytree(y)
        event = None
        if margin is not None:
            at = lambda t, y, args, **_: margin(t, state_of(y))
            event = dfx.Event(at, optx.Newton(1e-12, 1e-12), direction=False)
        controller, max_steps = self.controller, self.max_steps
        if controller is None:
            grid = times if self.from_start else jnp.append(begin, times)
            share = jnp.arange(self.substeps) / self.substeps
            grid = jnp.append((grid[:-1, None] + jnp.diff(grid)[:, None] * share).ravel(), grid[-1])
            controller, max_steps = dfx.StepTo(ts=grid), grid.size - 1
        last = dfx.SubSaveAt(t1=True)
        solution = dfx.diffeqsolve(
            # A closure, since diffrax warns of complex leaves in a vector field.
            dfx.ODETerm(lambda t, y, args: ravel_pytree(field(cast(Any, t), state_of(y)))[0]),
            self.solver,
            begin,
            larger(times[-1], begin),
            None,
            start,
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
        return jax.vmap(state_of)(path), good, ended[-1], state_of(end[-1])


class StationMotion(NamedTuple):
    """Motion of the stations and of all coordinates in fixed axes, and contact forces."""

    displacement: Complex[Array, "T s"]  # [m]
    velocity: Complex[Array, "T s"]  # [m/s]
    slope: Complex[Array, "T s"]
    contact_force: Complex[Array, "T k"] | None  # [N]
    coordinates: Complex[Array, "T n"]
    rates: Complex[Array, "T n"]  # of them


class Integrated(NamedTuple):
    """A run: motion at the times, its success, and what tells whether steps of fixed size were enough."""

    turning: Turning
    instants: Kinematics | None  # None where nothing was stepped, see `TimeHistory.instants`
    stopped: Scalar  # time of the last stop [s]
    good: Array
    seen: StationMotion
    touched: Array
    unresolved: Array  # number of steps whose changes of contact were not located
    contact_stiffness_ratio: Float[Array, "k 2"]


@compiled
def integrate(
    scene: Scene,
    system: System,
    times: Array,
    launch: Launch,
    stations: Array,
    plan: "Integration | Stepping",
) -> Integrated:
    """Kinematics at the times, success, and motion of the stations."""
    if isinstance(plan, Stepping):
        return _step(scene, system, times, launch, stations, plan)
    field = Transient.of(scene, None, launch.angle, plan.massless, system)
    system = field.system
    y = first_state(field, launch, stations[0], free=plan.free)
    part = integrate_part(field, plan, jnp.zeros(()), y, launch.stopped, times)
    instants = part.instants(field, times)
    seen = motion_of_stations(system, instants, stations)
    no = (
        jnp.zeros((), bool),
        jnp.zeros((), int),
        jnp.zeros((0, 2)),
    )  # an error estimate tells where steps are too long
    good = part.good & _finite(instants)
    return Integrated(instants.turning, instants, part.stopped, good, seen, *no)


class Part(NamedTuple):
    """Part of an integrated run: states at its times, and all that the next part begins with."""

    path: RotatingState
    senses: Float[Array, " T"] | None  # of rotation; None: the rotor cannot stop
    good: Array
    stopped: Scalar  # time of the last stop [s], infinite while it rotates
    end: RotatingState
    stays: Array  # whether it came to rest for good

    def instants(self, field: Transient, times: Array) -> Kinematics:
        """Motion of all moving parts at the times."""
        if self.senses is None:
            found = jax.vmap(field.instant)(times, self.path)
        else:
            held = lambda time, y, sense: field.hold(sense == 0, sense).instant(time, y)
            found = jax.vmap(held)(times, self.path, self.senses)
        if field.system.tabled is None:
            return found
        covered = jax.vmap(field.system.covers)(found.turning.speed)[:, None]
        return found._replace(r=jnp.where(covered, found.r, jnp.nan))


def integrate_part(
    field: Transient, plan: Integration, begin: Scalar, y: RotatingState, stays: Array, times: Array
) -> Part:
    """The run from the state at `begin` on, which `stays` at rest, over `times`."""
    never, stays = jnp.asarray(jnp.inf), jnp.asarray(stays)
    spin = field.system.spin
    if not (plan.free or field.system.n or y.bodies.size or y.states.size):  # nothing moves
        path = jax.tree.map(lambda leaf: jnp.zeros((times.size, *leaf.shape)), y)
        return Part(path, None, jnp.asarray(True), never, y, stays)
    if plan.free and isinstance(spin, Drive) and spin.can_stop:
        return _run_to_rest(field, plan, begin, y, stays, times)
    path, good, _, end = plan.solve(field, begin, y, times)
    return Part(path, None, good, never, end, stays)


def _step(
    scene: Scene, system: System, times: Array, launch: Launch, stations: Array, plan: Stepping
) -> Integrated:
    """A run by exponential steps."""
    field = Transient.of(scene, None, launch.angle, system=system)
    system, never = field.system, jnp.asarray(jnp.inf)
    path = stepped(scene, system, plan, launch, stations[0])
    steps = path.touched, path.unresolved, path.contact_stiffness_ratio
    if plan.exact:  # accelerations would take longer than the motion, and few ask for them
        seen = _seen(system, path.q, path.velocity, Now(path.turning.speed), stations)
        return Integrated(path.turning, None, never, _finite(seen), seen, *steps)

    def instant(time: Scalar, now: Turning, q: Array, velocity: Array, others: AuxiliaryState):
        """Motion in the axes of the shaft."""
        back, rate = direction(-now.angle), field.rate
        parts = plane(back * q), plane(back * (velocity - 1j * now.speed * q)) / rate
        rates = others.angle, others.speed / rate, others.bodies, others.bodies_rate / rate
        return field.instant(time, RotatingState(*parts, *rates, others.states))

    instants = jax.vmap(instant)(times, path.turning, path.q, path.velocity, path.others)
    seen = motion_of_stations(system, instants, stations)
    good = _finite(instants)
    return Integrated(instants.turning, instants, never, good, seen, *steps)


def first_state(field: Transient, launch: Launch, station: Scalar, *, free: bool) -> RotatingState:
    """State of the equations at the start; `free` where the spin is integrated too."""
    system, rate = field.system, field.rate
    speed = system.spin.speed
    q, velocity = launch.shaft.state(system, station)
    turn = jnp.exp(-1j * launch.angle)
    others = AuxiliaryState.of(launch, system, free=free)
    return RotatingState(
        plane(turn * q),
        plane(turn * (velocity - 1j * speed * q)) / rate,
        others.angle,
        others.speed / rate,
        others.bodies,
        others.bodies_rate / rate,
        others.states,
    )


class _Stage(NamedTuple):
    """A run up to the instant at which its spin came to rest or broke loose."""

    time: Scalar
    y: RotatingState
    path: RotatingState  # at the samples
    senses: Float[Array, " T"]  # of rotation at the samples: 1, -1, or 0 at rest
    sense: Scalar
    stays: Array  # whether it came to rest for good
    stopped: Scalar  # time of the last stop [s], infinite while it rotates
    good: Array


def _run_to_rest(
    field: Transient, plan: Integration, begin: Scalar, y: RotatingState, stays: Array, times: Array
) -> Part:
    """A run whose spin comes to rest and then stays, reverses or breaks loose again.

    Dry friction holds a rotor while the torque of all other moments does not exceed it. Without feedback
    that torque is constant at rest and of one sign afterwards, so there are at most two stages.
    """
    spin: Any = field.system.spin
    dry = jnp.zeros(()) if spin.coulomb is None else jnp.asarray(spin.coulomb)

    def loosened(time: Scalar, y: RotatingState) -> tuple[Scalar, Scalar]:
        """Sense in which a rotor at rest starts to rotate, 0 if it stays, and margin of friction."""
        torque = field.breakaway_torque(time, y)
        margin = dry - jnp.abs(torque)
        return jnp.where(margin >= 0, 0.0, jnp.sign(torque)), margin

    def stage(at: _Stage, _) -> tuple[_Stage, None]:
        rotates = jnp.asarray(at.sense != 0)

        def margin(t: Scalar, y: RotatingState) -> Scalar:
            held = loosened(t, y)[1] if spin.feedback and spin.coulomb is not None else 1.0
            left = jnp.where(rotates, at.sense * y.speed[0], jnp.where(at.stays, 1.0, held))
            return jnp.where(t <= at.time, 1.0, left)

        path, fine, last, end = plan.solve(
            field.hold(~rotates, at.sense),
            at.time,
            at.y,
            larger(times, at.time),
            margin,
        )
        ended = last < times[-1]  # the stage, before the run
        halts = ended & rotates
        end = eqx.tree_at(lambda y: y.speed, end, jnp.where(halts, 0.0, end.speed))
        stays = at.stays | (halts & spin.stops)
        sense = jnp.where(stays, 0.0, loosened(last, end)[0])
        # A rotor that breaks loose must rotate even if its margin rounds to zero.
        sense = jnp.where(ended & ~rotates, jnp.sign(field.breakaway_torque(last, end)), sense)
        sense = jnp.where(ended, sense, at.sense)
        stopped = jnp.where(ended, jnp.where(sense == 0, last, jnp.inf), at.stopped)
        later = (times > at.time) | (at.time <= begin)
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
        jnp.where(sense == 0, begin, jnp.inf),
        jnp.asarray(True),
    )
    count = plan.max_stops + 1 if spin.feedback else 2
    done, _ = jax.lax.scan(stage, first, None, length=count)
    good = done.good & (done.time >= times[-1])
    return Part(done.path, done.senses, good, done.stopped, done.y, done.stays)


def _finite(motion: Kinematics | StationMotion) -> Array:
    """Whether all of a motion is finite."""
    return jnp.all(jnp.array([jnp.all(jnp.isfinite(leaf)) for leaf in jax.tree.leaves(motion)]))


def motion_of_stations(system: System, instants: Kinematics, stations: Array) -> StationMotion:
    """Motion of the stations and of all coordinates, and contact forces, in fixed axes."""
    turn = jnp.exp(1j * instants.turning.angle)[:, None]
    velocity = turn * jax.vmap(lambda now: now.velocity)(instants)
    return _seen(system, turn * instants.r, velocity, instants.of_laws, stations)


def _seen(
    system: System,
    q: Complex[Array, "T n"],
    velocity: Complex[Array, "T n"],
    now: Now,
    stations: Array,
) -> StationMotion:
    """Motion of the stations and forces of the contacts, by the coordinates and their rates."""
    rows, slopes = (jax.vmap(row)(stations) for row in (system.line.row, system.line.slope_row))
    forces = None
    if system.ports:
        ports = jnp.stack([port.row for port in system.ports])
        forces = jax.vmap(system.contact_forces)(
            plane(q @ ports.T, axis=-1), plane(velocity @ ports.T, axis=-1), now
        )
        forces = forces[..., 0] + 1j * forces[..., 1]
    return StationMotion(q @ rows.T, velocity @ rows.T, q @ slopes.T, forces, q, velocity)
