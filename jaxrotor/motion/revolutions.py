"""March: a motion made ready to step, revolution after revolution."""

import math
from collections.abc import Callable
from typing import Any

import diffrax as dfx
import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Bool, Float

from ..core.outcome import Outcome
from ..core.quantities import Scalar, known
from ..equations.pencil import check_moves
from ..equations.start import AbstractStart
from ..equations.stationary_frame import Motion
from ..equations.system import System, assemble, has_massless
from ..scene import Scene
from ..solvers.basis import Count, Dense, Rotation, SlotRotation
from ..solvers.control import step_control, tuned
from ..solvers.exponential import Exponential, ExponentialStep, revolution
from ..solvers.form import AbstractForm, PhysicalForm
from ..solvers.located import LocatedStep
from ..solvers.ports import PortForm
from ..spins.constant import ConstantSpeed
from .base import Plan, RevolutionSamples


SHORT = 20  # revolutions of which every one may be a checkpoint


class March(eqx.Module):
    """One scene's motion from revolution to revolution.

    Time restarts at zero with every revolution, so the phase of the unbalance is exact however
    long the run. A scene with contact and without unbalance may march by another `span` of angle.
    """

    system: System
    stations: Float[Array, " s"]
    form: AbstractForm
    plan: Plan
    step: ExponentialStep | LocatedStep | None
    free: (
        Rotation | SlotRotation | Dense | None
    )  # `span` of what is stepped, as it would be without contact
    span: Scalar  # [rad] of what counts as a revolution

    @classmethod
    def build(cls, scene: Scene, plan: Plan, rate: Scalar, stations: Float[Array, " s"]) -> "March":
        """Assemble a scene for a plan; `rate` is 2 pi over the length of a revolution."""
        return cls.of(assemble(scene, plan.together), plan, rate, stations)

    @classmethod
    def of(
        cls,
        system: System,
        plan: Plan,
        rate: Scalar,
        stations: Float[Array, " s"],
        span: ArrayLike = 2 * jnp.pi,
    ) -> "March":
        """The same of a system already assembled."""
        span = jnp.asarray(span)
        motion = Motion(system, rate)
        rows = [jax.vmap(system.line.row)(stations)]
        if plan.slopes:
            rows.append(jax.vmap(system.line.slope_row)(stations))
        if plan.coordinates:
            rows.append(jnp.eye(system.n))
        if plan.contacts and motion.rows is not None:
            rows.append(motion.rows)
        rows = jnp.concatenate(rows)
        if not isinstance(plan.solver, Exponential):
            return cls(system, stations, PhysicalForm(motion, rows), plan, None, None, span)
        form = plan.solver.form(system, motion, rows)
        step = plan.solver.stepper(form, plan.steps, span, batch=plan.batch)
        free = None if step is None else form.free_propagator(span)
        return cls(system, stations, form, plan, step, free, span)

    def begin(self, start: AbstractStart, at: Scalar) -> Array:
        """State of the form at the start."""
        return self.form.encode(*start.state(self.system, at))

    @property
    def contact_stiffness_ratio(self) -> Float[Array, "2"]:
        """Force with which a stop answers a unit of force held over one step, of the hardest port.

        `k d` and `c v`, with the stop's stiffness `k` and damping `c`, and the displacement `d` and
        velocity `v` that the unit of force gives the port in a step `h`. Of a mass `m` on the stop
        alone `k h^2 / (2 m)` and `c h / m`. Zero where nothing is stepped by `Exponential`.
        """
        if self.step is None:
            return jnp.zeros(2)
        form = self.form
        assert isinstance(form, PortForm) and form.contacts is not None
        goes, moves = self.step.tableau.answer(form.contacts.reading)
        ports = jnp.stack([port.hardness() for port in self.system.ports])  # (p, 2)
        found = ports * jnp.stack([goes, moves], axis=1)
        return found[jnp.argmax(found.sum(1))]

    def skip(self, y: Array, revolutions: Count) -> tuple[Array, Outcome]:
        """State after whole revolutions, and how they went.

        A traced number of revolutions serves any length by one program, in forward mode alone.
        """
        if self.step is None and isinstance(self.form, PortForm):  # linear: no stepping
            return self.form.advance_free(y, revolutions), Outcome.good()

        def turn(carry, _):
            y, good = carry
            end, _, ok = self._step(y, sample=False)
            return (end, good & ok), None

        begin = y, Outcome.good()
        if not isinstance(revolutions, int):
            return jax.lax.fori_loop(0, revolutions, lambda _, carry: turn(carry, None)[0], begin)
        if not revolutions:
            return begin
        return self._scan(turn, begin, revolutions)[0]

    def sample(self, y: Array) -> tuple[Array, Float[Array, "T 2 2 r"], Outcome]:
        """One revolution: state at its end, stations at its S + 1 samples, outcome."""
        if self.step is None and isinstance(self.form, PortForm):
            return self._sample_free(self.form, y)
        return self._step(y, sample=True)

    def _sample_free(self, form: PortForm, y: Array):
        """One revolution of a linear scene: exact hops from sample to sample."""
        advance, grid = form.free_propagator(self.span / self.plan.steps), self._grid()
        one = lambda y, theta: (advance(y), form.read(theta, y))
        y, samples = jax.lax.scan(one, y, grid[:-1])
        last = form.read(grid[-1], y)
        done = self._outcome(y, y)
        return y, jnp.concatenate([samples, last[None]]), done

    def collect(self, y: Array, carry: Any, update: Callable, revolutions: int) -> Any:
        """Carry through whole revolutions: `carry, out = update(carry, orbit)` at each."""

        def turn(state, _):
            y, carry, good = state
            y, samples, ok = self.sample(y)
            carry, out = update(carry, self.orbit(samples))
            return (y, carry, good & ok), out

        return self._scan(turn, (y, carry, Outcome.good()), revolutions)

    def orbit(self, samples: Float[Array, "T 2 2 r"]) -> "RevolutionSamples":
        """What the samples of a revolution say, by name."""
        seen = samples[:, 0] + 1j * samples[:, 1]  # (S + 1, displacement or velocity, rows)
        s = self.stations.size
        displacement, velocity = seen[:, 0], seen[:, 1]
        forces = None
        if self.plan.contacts and self.system.ports:
            p = len(self.system.ports)
            ports = jnp.moveaxis(samples[..., -p:], 1, -1)  # (S + 1, 2, p, xy)
            speed = jnp.broadcast_to(self.system.spin.speed, ports.shape[:1])
            vectors = jax.vmap(self.system.contact_forces)(ports[:, 0], ports[:, 1], speed)
            forces = vectors[..., 0] + 1j * vectors[..., 1]
        slope = displacement[:, s : 2 * s] if self.plan.slopes else None
        coordinates = None
        if self.plan.coordinates:
            own = slice(s + s * self.plan.slopes, s + s * self.plan.slopes + self.system.n)
            coordinates = displacement[:, own], velocity[:, own]
        return RevolutionSamples(
            displacement[:, :s],
            velocity[:, :s],
            slope,
            forces,
            coordinates,
            1 / self.form.motion.rate,
            self.form.motion.s,
        )

    def _grid(self) -> Float[Array, " T"]:
        return jnp.linspace(0.0, self.span, self.plan.steps + 1)

    def _scan(self, body: Callable, carry: Any, length: int) -> Any:
        """Revolutions; in reverse mode their memory grows as the root of their number."""
        repeat = lambda body, carry, length: jax.lax.scan(body, carry, None, length=length)
        if isinstance(self.plan.adjoint, dfx.ForwardMode):
            return repeat(body, carry, length)
        body = jax.checkpoint(body)
        if length < SHORT:
            return repeat(body, carry, length)
        segment = _segment(length)
        whole, rest = divmod(length, segment)
        several = jax.checkpoint(lambda carry, _: repeat(body, carry, segment))
        carry, turns = repeat(several, carry, whole)
        turns = jax.tree.map(lambda leaf: leaf.reshape(-1, *leaf.shape[2:]), turns)
        if not rest:
            return carry, turns
        carry, last = repeat(body, carry, rest)
        return carry, jax.tree.map(lambda *parts: jnp.concatenate(parts), turns, last)

    def _step(self, y: Array, *, sample: bool) -> tuple[Array, Any, Outcome]:
        """One revolution, by plain steps, by located ones or by diffrax."""
        if isinstance(self.step, LocatedStep):
            return self._locate(self.step, y, sample=sample)
        if self.step is None:
            return self._solve(y, sample=sample)
        plan, form = self.plan, self.form
        assert isinstance(form, PortForm)
        stations = form.stations if sample else None
        y1, samples = revolution(self.step, y, plan.steps, stations, batch=plan.batch)
        if samples is not None:
            samples = samples.reshape(plan.steps + 1, 2, 2, -1)
        return y1, samples, self._outcome(y, y1)

    def _locate(self, step: LocatedStep, y: Array, *, sample: bool) -> tuple[Array, Any, Outcome]:
        """One revolution by located steps."""
        grid = self._grid()

        def one(carry, theta):
            y, unresolved = carry
            y1, more = step.advance(theta, y)
            return (y1, unresolved + more), self.form.read(theta, y) if sample else None

        (y1, unresolved), samples = jax.lax.scan(one, (y, jnp.zeros((), int)), grid[:-1])
        if samples is not None:
            samples = jnp.concatenate([samples, self.form.read(grid[-1], y1)[None]])
        return y1, samples, self._outcome(y, y1, unresolved=unresolved)

    def _solve(self, y: Array, *, sample: bool) -> tuple[Array, Any, Outcome]:
        """One revolution by diffrax."""
        plan, grid = self.plan, self._grid()
        read = lambda theta, y, args: self.form.read(theta, y)
        assert isinstance(plan.solver, dfx.AbstractSolver), "a linear scene is not stepped"
        solver = tuned(plan.solver)
        controller = plan.controller or step_control(plan.solver)
        if controller is None:  # a fixed grid: every step is a sample
            controller, max_steps, dt0 = dfx.StepTo(ts=grid), plan.steps, None
            path = dfx.SubSaveAt(t0=True, steps=True, fn=read)
        else:
            max_steps, dt0 = plan.max_steps, grid[1]
            path = dfx.SubSaveAt(ts=grid, fn=read)
        terms: Any = dfx.ODETerm(self.form.field)
        if _splits(solver):
            motion: Any = self.form.motion
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
        return y1, saved[1] if sample else None, self._outcome(y, y1, solved)

    def _outcome(self, y: Array, y1: Array, solved: Any = True, unresolved: Any = 0) -> Outcome:
        """How a revolution from `y` to `y1` went."""
        touched = jnp.zeros((), bool)
        if self.free is not None:  # samples may miss a short touch, but not what it leaves behind
            left = jnp.max(jnp.abs(y1 - self.free(y)))
            about = jnp.finfo(y.dtype)  # of a state that has died out nothing can be said
            touched = left > about.eps**0.5 * jnp.max(jnp.abs(y1)) + about.tiny**0.5
        return Outcome(_bounded(y1), jnp.asarray(solved), jnp.asarray(unresolved), touched)


def _segment(length: int) -> int:
    """Revolutions from checkpoint to checkpoint: the divisor next to the root of their number.

    The root itself where none is near: what is left over is compiled a second time.
    """
    root = math.isqrt(length)
    near = [n for n in range(root // 2 + 1, 2 * root + 1) if length % n == 0]
    return min(near, key=lambda n: abs(n - root), default=root)


def _bounded(y: Array) -> Bool[Array, ""]:
    """Whether a state and its squares, which observables take, are finite."""
    return jnp.all(jnp.abs(y) < jnp.finfo(y.dtype).max ** 0.4)


def _splits(solver: dfx.AbstractSolver) -> bool:
    """Whether a solver takes an explicit and an implicit part (KenCarp4 and its like)."""
    structure = solver.term_structure
    return getattr(structure, "__origin__", structure) is dfx.MultiTerm


def joined(turns: Array) -> Array:
    """(revolutions, S + 1, ...) -> (revolutions S + 1, ...): neighbours share a sample."""
    flat = turns[:, :-1].reshape(-1, *turns.shape[2:])
    return jnp.concatenate([flat, turns[-1:, -1]])


def check_constant(scene: Scene, what: str) -> None:
    """Raise unless a scene has a constant speed, and mass at all its coordinates."""
    if not isinstance(scene.spin, ConstantSpeed):
        raise ValueError(
            f"{what} is for constant speed, but the spin of the scene is a "
            f"{type(scene.spin).__name__}; use `jaxrotor.run_up`, or `scene.at_speed(..)`."
        )
    if has_massless(scene):
        check_moves(assemble(scene))  # says so where nothing has mass
        raise ValueError(
            f"{what} needs mass at every coordinate, but a part of the rotor has none; put a Disc there, "
            "or use `jaxrotor.run_up`."
        )


def revolution_rate(scene: Scene, period: float | None) -> Scalar:
    """`|Omega|`, or at zero speed 2 pi over the period the user names."""
    speed = scene.spin.speed
    if not known(speed):
        if period is None:
            return jnp.abs(speed)
        rate = jnp.asarray(2 * jnp.pi / period)
        return eqx.error_if(rate, speed != 0, "`period` is for zero speed only.")
    value = float(speed)  # known, also while other parameters are traced
    if value == 0 and period is None:
        raise ValueError(
            "At zero speed a revolution has no length; give `period`, the seconds to count as one."
        )
    if value != 0 and period is not None:
        raise ValueError(f"`period` is for zero speed only, but the speed is {value:g} rad/s.")
    if period is not None and not period > 0:
        raise ValueError(f"`period [s]` must be positive, but is {period}.")
    return jnp.abs(speed) if period is None else jnp.asarray(2 * jnp.pi / period)
