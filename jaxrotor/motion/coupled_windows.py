"""Coupled march: a motion with balls, or with a drive that feels the rotor, window by window."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..core.outcome import Outcome
from ..core.quantities import Scalar
from ..equations.constant_frame import linear_matrix
from ..equations.start import AbstractStart, Continued, Launch
from ..equations.system import assemble
from ..scene import Scene
from ..solvers.basis import Count, modal
from ..solvers.coupled_step import CoupledStep
from ..solvers.located_coupled import LocatedCoupledStep
from .base import AbstractMarch, Bodies, Plan, Window, bounded
from .coupled import CoupledRotor
from .history import imbalance_of
from .run_up import after, with_balls
from .stepped import Stepping


class CoupledMarch(AbstractMarch):
    """Motion of one scene along evenly spaced samples, advanced by whole windows of them.

    The last entry of a state counts the windows.
    """

    plan: Plan
    scene: Scene
    rotor: CoupledRotor
    step: CoupledStep | LocatedCoupledStep
    reading: Float[Array, "4 m2"]  # [Re, Im] of displacement and velocity of the station
    length: Scalar  # from sample to sample [s]
    substeps: int = eqx.field(static=True)  # there
    before: int = eqx.field(static=True)  # intervals before the first sample

    @classmethod
    def build(
        cls,
        scene: Scene,
        plan: Plan,
        stepping: Stepping,
        start: AbstractStart,
        station: Float[Array, "1"],
    ) -> "CoupledMarch":
        """Assemble a scene, as it is at a start, for a plan and its steps, with one station to read."""
        launch = Launch.of(start)
        scene = after(scene, launch)
        system = assemble(scene, plan.together)
        (centre,), rate = stepping.centres(system)
        basis = None
        if plan.solver.basis != "dense":
            basis = modal(linear_matrix(system.at_speed(centre), rate))
        rotor = CoupledRotor.build(scene, system, stepping, launch.angle, basis)
        length = stepping.breaks[1] - stepping.breaks[0]
        step = rotor.step(plan.solver, length / stepping.substeps)
        row = system.line.row(station[0])[None]
        axes = rotor.rotor.axes
        seen = axes.output(jnp.concatenate([row, 0 * row]), jnp.concatenate([0 * row, row]))
        parts = plan, scene, rotor, step, rotor.rotor.read(seen)
        return cls(*parts, length, stepping.substeps, stepping.before)

    def begin(self, start: AbstractStart, at: Scalar) -> Array:
        launch = with_balls(self.scene, Launch.of(start))
        return jnp.append(self.rotor.begin(launch, at), 0.0)

    def encode(self, *parts: Array) -> Array:
        """State at angle zero of coordinates, their velocities, angles and speeds of the balls."""
        q, velocity, angles, speeds = parts
        y = self.rotor.begin(Launch(Continued(q, velocity)), jnp.zeros(()))
        rates = speeds - self.rotor.system.spin.speed
        return jnp.concatenate([y, angles, rates, jnp.zeros(1)])

    def decode(self, y: Array) -> tuple[Array, ...]:
        """Coordinates [m], their velocities [m/s], angles of the balls [rad] and their speeds [rad/s]."""
        q, velocity, rest = self.rotor.motion(self.step, y[:-1])
        time = self._times(y[-1])[0]
        speed = self.rotor.forces.turning(time, rest).speed
        return q, velocity, rest.bodies, rest.bodies_rate + speed

    @property
    def eigenvectors(self) -> Array | np.ndarray:
        """Those of the linear equations, by which the basis is judged."""
        return self.rotor.rotor.basis.vectors

    @property
    def contact_stiffness_ratio(self) -> Float[Array, "2"]:
        """See `VaryingStep.contact_stiffness_ratio`."""
        return self.step.contact_stiffness_ratio

    def skip(self, y: Array, windows: Count) -> tuple[Array, Outcome]:
        """State at the first sample, and outcome; there is one window before it, of its own length."""
        del windows
        end, found, _ = self._stepped(y[:-1], jnp.arange(self.before) * self.length)
        return jnp.append(end, 0.0), self._outcome(end, *found)

    def advance(self, y: Array) -> tuple[Array, Outcome]:
        end, _, ok = self.observe(y)  # what is not read is not computed
        return end, ok

    def observe(self, y: Array) -> tuple[Array, Window, Outcome]:
        number, times = y[-1], self._times(y[-1])
        end, found, states = self._stepped(y[:-1], times[:-1])
        states = jnp.concatenate([states, end[None]])
        count = states.shape[1] - self.step.rest_size
        w, rest = states[:, :count], jax.vmap(self.step.rest)(states[:, count:])
        turning = jax.vmap(self.rotor.forces.turning)(times, rest)
        seen = jnp.moveaxis((w @ self.reading.T).reshape(-1, 2, 2), 1, -1)
        z = seen[..., 0] + 1j * seen[..., 1]  # (T, displacement or velocity)
        system, forces = self.rotor.system, None
        if self.plan.contacts and system.ports:
            ports = (w @ self.step.reading.T).reshape(len(states), 2, 2, -1)
            ports = jnp.moveaxis(ports, 1, -1)  # (T, d or v, p, xy)
            both = jax.vmap(system.contact_forces)(ports[:, 0], ports[:, 1], turning.speed)
            forces = both[..., 0] + 1j * both[..., 1]
        bodies = None
        if system.races:
            imbalance = imbalance_of(self.scene, rest.bodies)
            bodies = Bodies(rest.bodies, rest.bodies_rate, imbalance)
        window = Window(
            z[:, :1],
            z[:, 1:],
            None,
            forces,
            None,
            self.length,
            jnp.sign(turning.speed[-1]),
            times,
            turning.speed,
            bodies,
        )
        return jnp.append(end, number + 1), window, self._outcome(end, *found)

    def _times(self, number: Scalar) -> Float[Array, " T"]:
        """Times of the samples of a window, by its number [s]."""
        size = self.plan.steps
        return (self.before + number * size + jnp.arange(size + 1)) * self.length

    def _stepped(self, y: Array, times: Array) -> tuple[Array, tuple[Array, Array], Array]:
        """State after the intervals that begin at some times, and all states before each.

        In between, whether a contact was loaded, and how many steps are not resolved.
        """

        def one(carry, time):
            y, touched, unresolved = carry
            end, loaded, more = self.step.several(time, self.substeps, y, batch=True)
            return (end, touched | loaded, unresolved + more), y

        first = y, jnp.zeros((), bool), jnp.zeros((), int)
        (y, *found), states = jax.lax.scan(one, first, times)
        return y, tuple(found), states

    def _outcome(self, y: Array, touched: Array, unresolved: Array) -> Outcome:
        return Outcome(bounded(y), jnp.ones((), bool), unresolved, touched)
