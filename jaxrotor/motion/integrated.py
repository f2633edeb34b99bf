"""Integrated march: a motion at any spin that a diffrax solver integrates, window by window."""

import dataclasses
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..core.lanes import per_lane
from ..core.outcome import Outcome
from ..core.quantities import Scalar
from ..equations.kinematics import Kinematics, RotatingState
from ..equations.rotating_frame import Transient
from ..equations.start import AbstractStart, Continued, Launch
from ..scene import Scene
from ..solvers.basis import Count
from .base import AbstractMarch, Bodies, Plan, Window, bounded
from .history import imbalance_of
from .revolutions import revolution_rate
from .run_up import after, with_balls
from .transient import Integration, first_state, integrate_part, motion_of_stations


class IntegratedPace(eqx.Module):
    """How the windows of a motion are integrated, and how long they are."""

    integration: Integration
    interval: Scalar | None  # from sample to sample [s]; None: a share of a revolution
    period: float | str | None = eqx.field(static=True)  # of a revolution at zero speed [s]
    first: Scalar | None = None  # time of the first sample, before which there is one window [s]


class IntegratedMarch(AbstractMarch):
    """Motion of one scene in the axes of the shaft, with balls and a spin that may be free.

    A state holds the `RotatingState` of the equations, whether the rotor stays at rest, whether the
    motion has failed, and the number of windows before it, not counted the one that ends with the first
    sample.
    """

    plan: Plan
    scene: Scene
    field: Transient
    integration: Integration
    stations: Float[Array, " s"]
    interval: Scalar  # from sample to sample [s]
    speed: Scalar  # of rotation at the start [rad/s]
    first: Scalar | None  # time of the first sample [s]; None: 0

    @classmethod
    def build(
        cls,
        scene: Scene,
        plan: Plan,
        pace: IntegratedPace,
        start: AbstractStart,
        stations: Float[Array, " s"],
    ) -> "IntegratedMarch":
        """Assemble a scene for a plan, as it is at a start."""
        launch = Launch.of(start)
        scene = after(scene, launch)
        field = Transient.of(scene, None, launch.angle, pace.integration.massless)
        interval = pace.interval
        if interval is None:
            interval = 2 * jnp.pi / revolution_rate(scene, pace.period) / plan.steps
        speed = jnp.asarray(scene.spin.speed)
        return cls(plan, scene, field, pace.integration, stations, interval, speed, pace.first)

    def begin(self, start: AbstractStart, at: Scalar) -> Array:
        launch = with_balls(self.scene, Launch.of(start))
        y = first_state(self.field, launch, at, free=self.integration.free)
        return self._packed(
            y, jnp.asarray(launch.stopped), jnp.asarray(False), self._before_first()
        )

    def encode(self, *parts: Array) -> Array:
        """State at angle zero of the parts that `decode` returns."""
        q, velocity, angles, speeds, states = parts
        launch = Launch(Continued(q, velocity), self.field.begin)
        y = first_state(self.field, launch, self.stations[0], free=self.integration.free)
        rates = (speeds - self.speed) / self.field.rate
        named = lambda y: (y.bodies, y.bodies_rate, y.states)
        y = eqx.tree_at(named, y, (angles, rates, states))
        no = jnp.asarray(False)
        return self._packed(y, no, no, self._before_first())

    def decode(self, y: Array) -> tuple[Array, ...]:
        """Coordinates [m], velocities [m/s]; angles [rad] and speeds [rad/s] of balls, states of laws."""
        state, *_, number = self._unpacked(y)
        now = self.field.instant(self._time(number), state)
        coordinates = now.r * now.turn, now.velocity * now.turn
        return *coordinates, now.bodies, now.bodies_speed, now.states

    @property
    def contact_stiffness_ratio(self) -> Float[Array, "k 2"]:
        return jnp.zeros((0, 2))

    def skip(self, y: Array, windows: Count) -> tuple[Array, Outcome]:
        return self.step_through(y, windows)

    def advance(self, y: Array) -> tuple[Array, Outcome]:
        end, _, ok = self._integrated(y, 1)
        return end, ok

    def observe(self, y: Array) -> tuple[Array, Window, Outcome]:
        end, (times, instants), ok = self._integrated(y, self.plan.steps)
        seen = motion_of_stations(self.field.system, instants, self.stations)
        forces = seen.contact_force if self.plan.contacts else None
        speed = instants.turning.speed
        window = Window(
            seen.displacement,
            seen.velocity,
            seen.slope if self.plan.slopes else None,
            forces,
            None,
            self.interval,
            jnp.sign(speed[-1]),
            times,
            speed,
            self._bodies(instants),
            instants.states if self.field.system.state_count else None,
        )
        return end, window, ok

    @property
    def lanes_as_one(self) -> bool:
        return False

    def rows(self, y, *, observed):
        if observed:
            return per_lane(lambda march, y: march.observe(y), self, y)
        end, outcome = per_lane(lambda march, y: march.advance(y), self, y)
        return end, None, outcome

    def _integrated(
        self, y: Array, intervals: int
    ) -> tuple[Array, tuple[Array, Kinematics], Outcome]:
        """A window in so many intervals: state at its end, times and motion of its samples, outcome."""
        state, stays, failed, number = self._unpacked(y)
        begin, end = self._time(number), self._time(number + 1)
        times = begin + (end - begin) * jnp.linspace(0.0, 1.0, intervals + 1)
        # After a failure nothing is integrated, as a solver takes all its steps from a state that is NaN.
        state = jax.tree.map(lambda leaf: jnp.where(failed, 0.0, leaf), state)
        over = jnp.where(failed, begin, times)
        part = integrate_part(self.field, self.integration, begin, state, stays, over)
        good = Outcome.good()
        ok = Outcome(
            bounded(self._packed(part.end)), part.good & ~failed, good.unresolved, good.touched
        )
        instants = part.instants(self.field, over)
        if self.field.system.tabled is not None:
            finite = ok.finite & jnp.all(jnp.isfinite(instants.r))
            ok = dataclasses.replace(ok, finite=finite)
        instants = jax.tree.map(lambda leaf: jnp.where(ok.ok, leaf, jnp.nan), instants)
        return self._packed(part.end, part.stays, ~ok.ok, number + 1), (times, instants), ok

    def _before_first(self) -> Scalar:
        """Number of the window that begins at time 0."""
        return jnp.zeros(()) if self.first is None else jnp.where(self.first > 0, -1.0, 0.0)

    def _time(self, number: Scalar) -> Scalar:
        """Time at which a window begins [s]."""
        time = number * self.plan.steps * self.interval
        return time if self.first is None else jnp.where(number < 0, 0.0, self.first + time)

    def _bodies(self, instants: Kinematics) -> Bodies | None:
        if not self.field.system.races:
            return None
        rate = instants.bodies_speed - instants.turning.speed[:, None]
        return Bodies(instants.bodies, rate, imbalance_of(self.scene, instants.bodies))

    def _packed(self, y: RotatingState, *last: Any) -> Array:
        return jnp.concatenate(
            [jnp.ravel(leaf).astype(float) for leaf in (*jax.tree.leaves(y), *last)]
        )

    def _unpacked(self, y: Array) -> tuple[RotatingState, Array, Array, Array]:
        n, free = self.field.system.n, int(self.integration.free)
        bodies = sum(race.bodies.places for race in self.field.system.races)
        ends = np.cumsum([2 * n, 2 * n, free, free, bodies, bodies, self.field.system.state_count])
        r, rate, *others, last = jnp.split(y, ends)
        state = RotatingState(r.reshape(2, n), rate.reshape(2, n), *others)
        return state, last[0] > 0, last[1] > 0, last[2]
