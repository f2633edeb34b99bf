"""March: a motion at constant speed, advanced revolution by revolution."""

import dataclasses
from typing import Any, cast

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Bool, Complex, Float

from ..core.lanes import per_lane
from ..core.outcome import Outcome
from ..core.quantities import Scalar, known
from ..effects.law import Now
from ..effects.places import of_first_order
from ..equations.clocks import clock_of, counted_by, since, turns_of
from ..equations.constant_frame import in_constant_axes
from ..equations.lent import with_lent_films
from ..equations.pencil import check_moves
from ..equations.rigid_motions import check_held, unheld
from ..equations.speed_tables import check_tables
from ..equations.start import AbstractStart, states_of
from ..equations.stationary_frame import RUN_UP, Motion, check_no_states
from ..equations.system import System, assemble, has_massless, structure
from ..scene import Scene
from ..solvers.basis import Count, Dense, ModalBasis, Rotation, SlotBasis, SlotRotation
from ..solvers.exponential import Exponential, revolution, revolution_of_lanes
from ..solvers.form import AbstractForm, PhysicalForm
from ..solvers.located import LocatedStep
from ..solvers.ports import PortForm, take_lanes
from ..solvers.remainder import RemainderMap
from ..solvers.step import Step
from ..spins.constant import ConstantSpeed
from .base import AbstractMarch, Plan, Window, bounded, contact_forces
from .solved import solved_revolution


class March(AbstractMarch):
    """Motion of one scene, advanced by whole revolutions.

    The angle restarts at zero with every revolution, so the phase of the unbalance is exact however
    long the run. A scene with contact and without unbalance may advance by another `span` of angle.
    """

    plan: Plan
    system: System
    stations: Float[Array, " s"]
    form: AbstractForm
    step: Step | LocatedStep | None
    # Propagator over `span` without contact, where there is contact or a remainder:
    free: Rotation | SlotRotation | Dense | RemainderMap | None
    span: Scalar  # angle that counts as a revolution [rad]

    @classmethod
    def build(
        cls,
        scene: Scene,
        plan: Plan,
        rate: Scalar,
        stations: Float[Array, " s"],
        basis: ModalBasis | SlotBasis | None = None,
        period: float | str | None = None,
    ) -> "March":
        """Assemble a scene for a plan; `rate` is that of `revolution_rate` by the period."""
        system = dataclasses.replace(assemble(scene, plan.together), massless=plan.massless)
        system = counted_by(system, scene, period)
        return cls.of(system, plan, rate, stations, basis=basis)

    @classmethod
    def of(
        cls,
        system: System,
        plan: Plan,
        rate: Scalar,
        stations: Float[Array, " s"],
        span: ArrayLike = 2 * jnp.pi,
        basis: ModalBasis | SlotBasis | None = None,
    ) -> "March":
        """The march of an assembled system, see `build`."""
        span = jnp.asarray(span)
        lent = system
        if isinstance(plan.solver, Exponential):
            system = in_constant_axes(system)
            lent = with_lent_films(system)
        else:
            check_no_states(system, "A motion by whole revolutions", RUN_UP)
        motion = Motion(lent, rate, loads=not isinstance(plan.solver, Exponential))
        rows = [jax.vmap(system.line.row)(stations)]
        if plan.slopes:
            rows.append(jax.vmap(system.line.slope_row)(stations))
        if plan.coordinates:
            rows.append(jnp.eye(system.n))
        if plan.contacts and motion.rows is not None:
            rows.append(motion.rows)
        rows = jnp.concatenate(rows)
        if not isinstance(plan.solver, Exponential):
            return cls(plan, system, stations, PhysicalForm(motion, rows), None, None, span)
        form = plan.solver.form(lent, motion, rows, basis, stations.size)
        step = plan.solver.stepper(form, plan.steps, span)
        free = None
        # It only tells whether there was contact, or what steps amplify, so it needs no derivative.
        still, length = jax.lax.stop_gradient((form.basis, span))
        if system.remainder and step is not None:
            settings = *jax.lax.stop_gradient((lent, rate)), plan.solver, still
            free = RemainderMap.of(*settings, plan.steps, length)
            weights = lambda step: step.tableau.weights
            step = eqx.tree_at(weights, step, jnp.where(free.amplified, jnp.nan, weights(step)))
        elif step is not None:
            free = eqx.tree_at(lambda f: f.basis, form, still).free_propagator(length)
        return cls(plan, system, stations, form, step, free, span)

    def begin(self, start: AbstractStart, at: Scalar) -> Array:
        """State of the form at the start."""
        q, velocity = start.state(self.system, at)
        states = states_of(start, self.system) if self.state_count else None
        turns = turns_of(start, self.system) if self.system.others else None
        return self._encoded(q, velocity, states, turns)

    @property
    def state_count(self) -> int:
        """States of laws, which follow the numbers of the rotor in a state."""
        return self.system.state_count

    @property
    def beside(self) -> int:
        """States of laws, and then turns of the other shafts with unbalance, in a state."""
        return self.state_count + len(self.system.others)

    @property
    def contact_stiffness_ratio(self) -> Float[Array, "k 2"]:
        """See `Tableau.contact_stiffness_ratio`; zero where `Exponential` steps no contact."""
        return jnp.zeros((0, 2)) if self.step is None else self.step.contact_stiffness_ratio

    @property
    def amplified(self) -> Bool[Array, ""]:
        """See `RemainderMap`; False without a remainder."""
        return self.free.amplified if isinstance(self.free, RemainderMap) else jnp.zeros((), bool)

    def encode(self, *parts: Array) -> Array:
        """State at a whole revolution of the parts that `decode` returns."""
        q, velocity, *others = parts
        turns = others.pop() if self.system.others else None
        states = None
        if self.state_count:
            states = others[-1] if others else self.system.begin()
        return self._encoded(q, velocity, states, turns)

    def _encoded(self, q: Array, velocity: Array, states: Any, turns: Any) -> Array:
        form = self.form if turns is None else since(self.form, turns)
        own = form.encode(q, velocity)
        beside = [part for part in (states, turns) if part is not None]
        return jnp.concatenate([own, *beside]) if beside else own

    def decode(self, y: Array) -> tuple[Array, ...]:
        """Coordinates [m] and velocities [m/s] of a state at a whole revolution.

        Where there is more, angles and speeds of balls follow, of which there are none, states of laws,
        and then turns of other shafts where these have an unbalance.
        """
        if not self.beside:
            return self.form.decode(y)
        w, x, turns = self._split(y)
        moving = *since(self.form, turns).decode(w), x[:0], x[:0], x
        return (*moving, turns) if turns.size else moving

    def _split(self, y: Array) -> list[Array]:
        """Numbers of the rotor, states of laws, and turns of other shafts."""
        return jnp.split(y, [y.size - self.beside, y.size - len(self.system.others)])

    @property
    def eigenvectors(self) -> Array | np.ndarray:
        """Those of the linear equations in modal coordinates, by which the basis is judged."""
        assert isinstance(self.form, PortForm)
        return self.form.basis.vectors

    def skip(self, y: Array, windows: Count) -> tuple[Array, Outcome]:
        if self.step is None and isinstance(self.form, PortForm):  # linear: no steps
            w, clocks = y[: y.size - self.beside], self.form.clocks
            w = self.form.advance_free(w, windows)
            if clocks is not None:
                w = jnp.concatenate([w, clocks.after(y[-len(clocks.rates) :], windows)])
            return w, Outcome.good()
        return self.step_through(y, windows)

    def advance(self, y: Array) -> tuple[Array, Outcome]:
        """State after a revolution, and its outcome."""
        end, _, ok = self._step(y, sample=False)
        return end, ok

    def observe(self, y: Array) -> tuple[Array, Window, Outcome]:
        """One revolution: state at its end, its motion and its outcome."""
        y, samples, ok = self.sample(y)
        if not self.state_count:
            return y, self.named(samples), ok
        readings, states = samples
        window = self.named(readings, forceless=True)
        if self.plan.contacts and self.system.members:
            window = dataclasses.replace(window, contact_force=self.forces(readings, states))
        return y, dataclasses.replace(window, states=states), ok

    @property
    def lanes_as_one(self) -> bool:
        return self.plan.batch and self.step is not None

    def rows(self, y, *, observed):
        plan, form, step = self.plan, self.form, self.step
        assert isinstance(form, PortForm) and step is not None
        fused = isinstance(plan.solver, Exponential) and plan.solver.fused
        stations = form.stations if observed else None
        done = revolution_of_lanes(step, stations, y, plan.steps, fused=fused)
        ends = y, done.end, True, done.unresolved
        if done.samples is None:
            outcome = per_lane(lambda march, ends: march._outcome(*ends), self, ends)
            return done.end, None, outcome
        samples = done.samples.reshape(plan.steps + 1, 2, 2, -1, y.shape[-1])
        reads = bool(plan.contacts and self.system.members and take_lanes(self.system.ports))

        def named(march: March, moved: Any) -> tuple[Window, Outcome]:
            samples, ends = moved
            return march.named(samples, forceless=reads), march._outcome(*ends)

        window, outcome = per_lane(named, self, (samples, ends))
        if reads:
            window = dataclasses.replace(window, contact_force=self.forces(samples))
        return done.end, window, outcome

    def sample(self, y: Array) -> tuple[Array, Any, Outcome]:
        """One revolution: state at its end, readings (T, 2, 2, r) at its `steps + 1` samples, outcome.

        Where laws have states, the samples are the readings and these states.
        """
        if self.step is None and isinstance(self.form, PortForm):
            return self._sample_free(self.form, y)
        return self._step(y, sample=True)

    def _sample_free(self, form: PortForm, y: Array):
        """One revolution of a linear scene, exact from sample to sample."""
        advance, grid = form.free_propagator(self.span / self.plan.steps), self._grid()
        turns, clocks = y[y.size - self.beside :], form.clocks
        y, form = y[: y.size - self.beside], since(form, turns)
        one = lambda y, theta: (advance(y), form.read(theta, y))
        y, samples = jax.lax.scan(one, y, grid[:-1])
        last = form.read(grid[-1], y)
        if clocks is not None:
            y = jnp.concatenate([y, clocks.after(turns)])
        done = self._outcome(y, y)
        return y, jnp.concatenate([samples, last[None]]), done

    def named(self, samples: Float[Array, "T 2 2 r"], *, forceless: bool = False) -> Window:
        """The readings of `sample` by name, with the forces of contacts by them unless `forceless`."""
        seen = samples[:, 0] + 1j * samples[:, 1]  # (T, displacement or velocity, rows)
        s = self.stations.size
        displacement, velocity = seen[:, 0], seen[:, 1]
        forces = None
        if self.plan.contacts and self.system.members and not forceless:
            forces = self.forces(samples)
        slope = displacement[:, s : 2 * s] if self.plan.slopes else None
        coordinates = None
        if self.plan.coordinates:
            own = slice(s + s * self.plan.slopes, s + s * self.plan.slopes + self.system.n)
            coordinates = displacement[:, own], velocity[:, own]
        step = 2 * jnp.pi * (1 / self.form.motion.rate) / (samples.shape[0] - 1)
        seen = displacement[:, :s], velocity[:, :s], slope, forces, coordinates
        return Window(*seen, step, self._sense)

    @property
    def _sense(self) -> Scalar:
        """Sign of the speed of the shaft whose turns are the revolutions."""
        counted, speed = self.system.counted, self.system.spin.speed
        return self.form.motion.s if counted is None else jnp.sign(counted.speed(speed))

    def forces(
        self, samples: Float[Array, "T 2 2 r ..."], states: Float[Array, "T x"] | None = None
    ) -> Complex[Array, "T k ..."]:
        """Forces of all contacts by the readings of `sample`, of lanes along a last axis as well [N]."""
        angle = self.form.motion.s * self._grid() if self.system.clocks else None
        now = Now(self.system.spin.speed, angle, states)
        return contact_forces(self.system, samples, now, cast(Any, Now)(None, 0, 0))

    def _grid(self) -> Float[Array, "T ..."]:
        return jnp.linspace(0.0, self.span, self.plan.steps + 1)

    def _step(self, y: Array, *, sample: bool) -> tuple[Array, Any, Outcome]:
        """One revolution, by plain steps, by located ones or by diffrax."""
        plan, form = self.plan, self.form
        if self.step is None:
            y1, samples, solved = solved_revolution(form, plan, self._grid(), y, sample=sample)
            return y1, samples, self._outcome(y, y1, solved)
        assert isinstance(form, PortForm)
        stations = form.stations if sample else None
        fused = isinstance(plan.solver, Exponential) and plan.solver.fused
        how = {"batch": plan.batch, "fused": fused}
        y1, samples, unresolved = revolution(self.step, y, plan.steps, stations, **how)
        if samples is not None and self.state_count:
            readings, states = jnp.split(samples, [samples.shape[1] - self.state_count], axis=1)
            samples = readings.reshape(plan.steps + 1, 2, 2, -1), states
        elif samples is not None:
            samples = samples.reshape(plan.steps + 1, 2, 2, -1)
        return y1, samples, self._outcome(y, y1, unresolved=unresolved)

    def _outcome(self, y: Array, y1: Array, solved: Any = True, unresolved: Any = 0) -> Outcome:
        """Outcome of a revolution from `y` to `y1`."""
        touched = jnp.zeros((), bool)
        if self.free is not None:  # a contact between samples shows in the state at the end
            begin, end = (one[: one.size - self.beside] for one in (y, y1))
            change = jnp.max(jnp.abs(end - self.free(begin)))
            info = jnp.finfo(y.dtype)  # with `tiny`, a state that has decayed to zero shows nothing
            touched = change > info.eps**0.5 * jnp.max(jnp.abs(end)) + info.tiny**0.5
        return Outcome(bounded(y1), jnp.asarray(solved), jnp.asarray(unresolved), touched)


def joined(revolutions: Array) -> Array:
    """(R, steps + 1, ..) -> (R steps + 1, ..): neighbouring revolutions share a sample."""
    flat = revolutions[:, :-1].reshape(-1, *revolutions.shape[2:])
    return jnp.concatenate([flat, revolutions[-1:, -1]])


def check_constant(scene: Scene, what: str, *, memory: bool = False) -> None:
    """Raise unless a scene is held and has a constant speed and mass at all coordinates, as `what` needs.

    The speed must be one for which tables of coefficients have values, and, unless they may have a
    `memory`, no law has states or counts turns.
    """
    check_constant_speed(scene, what)
    if not memory:
        check_no_states(structure(scene), what, "follow its motion by `jaxrotor.simulate`")
    check_tables(scene)
    check_mass(scene, what)
    check_held(scene, what, contact=True)


def check_weight(scene: Scene) -> None:
    """Raise if a rotor falls under its weight, since nothing holds it, in contact either."""
    if unheld(scene) and structure(scene).load.steady:
        check_held(scene, "A motion under weight", contact=True)


def check_constant_speed(scene: Scene, what: str) -> None:
    """Raise unless the speed of a scene is constant; `what` needs it."""
    if not isinstance(scene.spin, ConstantSpeed):
        raise ValueError(
            f"{what} is for constant speed, but the spin of the scene is a "
            f"{type(scene.spin).__name__}; give the `times` of the samples [s], or take "
            "`scene.at_speed(..)`."
        )


def check_mass(scene: Scene, what: str) -> None:
    """Raise unless all coordinates of a scene have mass; `what` needs it."""
    if has_massless(scene):
        check_moves(assemble(scene))  # raises where nothing has mass
        if owners := of_first_order(scene.effects):
            names = ", ".join(map(scene.name_of, owners))
            raise ValueError(
                f"{what} needs mass at every coordinate, but controllers ({names}) have none; follow its "
                "motion by `jaxrotor.simulate`."
            )
        raise ValueError(
            f"{what} needs mass at every coordinate, but a part of the rotor has none; put a Disc there, "
            "or use `jaxrotor.run_up`."
        )


def revolution_rate(scene: Scene, period: float | str | None) -> Scalar:
    """2 pi over the length of a revolution [rad/s]: `|Omega|`, or at zero speed by `period` [s].

    A period that is the name of a shaft is its turn.
    """
    speed = scene.spin.speed
    if isinstance(period, str):
        clock, period = clock_of(scene, period), None
        speed = speed if clock is None else clock.speed(speed)
    if not known(speed):
        if period is None:
            return jnp.abs(speed)
        rate = jnp.asarray(2 * jnp.pi / period)
        return eqx.error_if(rate, speed != 0, "`period` is for zero speed only.")
    value = float(speed)  # may be known while other parameters are traced
    if value == 0 and period is None:
        raise ValueError(
            "At zero speed a revolution has no length; give `period`, the seconds to count as one."
        )
    if value != 0 and period is not None:
        raise ValueError(f"`period` is for zero speed only, but the speed is {value:g} rad/s.")
    if period is not None and not period > 0:
        raise ValueError(f"`period [s]` must be positive, but is {period}.")
    return jnp.abs(speed) if period is None else jnp.asarray(2 * jnp.pi / period)
