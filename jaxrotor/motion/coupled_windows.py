"""Coupled march: a motion with balls, or with a drive that feels the rotor, window by window."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..core.quantities import Scalar
from ..equations.constant_frame import linear_matrix
from ..equations.coupled import Instant
from ..equations.start import AbstractStart, Continued, Launch
from ..equations.system import System, assemble
from ..scene import Scene
from ..solvers.basis import modal
from ..solvers.coupled_step import CoupledStep
from ..solvers.exponential import Exponential
from ..solvers.located_coupled import LocatedCoupledStep
from .base import Bodies, Plan
from .coupled import CoupledRotor
from .history import imbalance_of
from .run_up import after, with_balls
from .speeds import decomposed_at
from .stepped import Stepping
from .windows import AbstractWindowMarch


class CoupledMarch(AbstractWindowMarch):
    """Motion of a rotor with balls, or with a drive that it holds back."""

    plan: Plan
    scene: Scene
    system: System
    rotor: CoupledRotor
    step: CoupledStep | LocatedCoupledStep
    reading: Float[Array, "4 m2"]
    length: Scalar
    substeps: int = eqx.field(static=True)
    before: int = eqx.field(static=True)

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
        assert isinstance(plan.solver, Exponential)
        if plan.solver.basis != "dense":
            basis = modal(linear_matrix(decomposed_at(system, centre), rate))
        rotor = CoupledRotor.build(scene, system, stepping, launch.angle, basis)
        length = stepping.breaks[1] - stepping.breaks[0]
        step = rotor.step(plan.solver, length / stepping.substeps)
        return cls(
            plan=plan,
            scene=scene,
            system=system,
            rotor=rotor,
            step=step,
            reading=rotor.rotor.reading(system.line.row(station[0])),
            length=length,
            substeps=stepping.substeps,
            before=stepping.before,
        )

    def begin(self, start: AbstractStart, at: Scalar) -> Array:
        launch = with_balls(self.scene, Launch.of(start))
        return jnp.append(self.rotor.begin(self.system, launch, at), 0.0)

    def encode(self, *parts: Array) -> Array:
        """State of coordinates, their velocities, angles and speeds of the balls."""
        q, velocity, angles, speeds = parts
        launch = Launch(Continued(q, velocity), self.rotor.forces.begin)
        y = self.rotor.begin(self.system, launch, jnp.zeros(()))
        rates = speeds - self.system.spin.speed
        return jnp.concatenate([y, angles, rates, jnp.zeros(1)])

    def decode(self, y: Array) -> tuple[Array, ...]:
        """Coordinates [m], their velocities [m/s], angles of the balls [rad] and their speeds [rad/s]."""
        q, velocity, others = self.rotor.motion(self.step, y[:-1])
        now = Instant.at(self.times(y[-1])[0])
        speed = self.rotor.forces.turning(now, others).speed
        return q, velocity, others.bodies, others.bodies_rate + speed

    @property
    def eigenvectors(self) -> Array | np.ndarray:
        """Those of the linear equations, by which the basis is judged."""
        return self.rotor.rotor.basis.vectors

    def interval(self, time: Scalar, y: Array) -> tuple[Array, Array, Array]:
        return self.step.several(time, self.substeps, y, batch=True)

    def seen(self, times: Array, states: Array) -> tuple[Array, Array, Bodies | None]:
        count = states.shape[1] - self.step.sizes.total
        w, others = states[:, :count], jax.vmap(self.step.sizes.named)(states[:, count:])
        turning = lambda time, one: self.rotor.forces.turning(Instant.at(time), one)
        speed = jax.vmap(turning)(times, others).speed
        if not self.system.races:
            return w, speed, None
        imbalance = imbalance_of(self.scene, others.bodies)
        return w, speed, Bodies(others.bodies, others.bodies_rate, imbalance)
