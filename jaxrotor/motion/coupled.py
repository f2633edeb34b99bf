"""Coupled motion by exponential steps: of a rotor with balls, or with a drive that feels its forces."""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Bool, Complex, Float, Int

from ..core.plane import direction, plane
from ..core.quantities import Scalar
from ..equations.coupled import CoupledForces, Instant, SpinAndBalls
from ..equations.fixed_axes import SpeedTerms
from ..equations.kinematics import RotatingState
from ..equations.rotating_frame import Transient
from ..equations.start import Launch
from ..equations.system import System
from ..scene import Scene
from ..solvers.basis import Basis
from ..solvers.coupled_step import CoupledStep
from ..solvers.exponential import Exponential
from ..solvers.located_coupled import LocatedCoupledStep
from ..solvers.varying_speed import RotorAtSpeed
from .speeds import decomposed_at
from .stepped import Stepping


class CoupledRotor(eqx.Module):
    """A rotor and all that moves with it, in the coordinates of its steps.

    A state is that of the rotor in its basis, then the numbers of the `SpinAndBalls`.
    """

    rotor: RotorAtSpeed
    forces: CoupledForces

    @classmethod
    def build(
        cls, scene: Scene, system: System, stepping: Stepping, angle: Scalar, basis: Basis | None
    ) -> "CoupledRotor":
        """The rotor of a scene, turned by `angle` at time 0, in a dense basis unless one is given."""
        (centre,), rate = stepping.centres(system)
        terms = SpeedTerms.of(system, stepping.modes) if stepping.modes else None
        forces, stations = CoupledForces.of(scene, system, terms, centre, angle)
        rotor = RotorAtSpeed.build(decomposed_at(system, centre), rate, terms, basis, stations)
        return cls(rotor, forces)

    def step(self, solver: Exponential, length: Scalar) -> CoupledStep | LocatedCoupledStep:
        """A step of a length of time [s], located where the solver is so and a law has kinks."""
        h = self.rotor.axes.rate * length
        plain = CoupledStep.of(self.rotor, self.forces, solver.order, h)
        kinked = any(law.kinked for port in self.forces.system.ports for law in port.laws)
        return LocatedCoupledStep(plain, self.rotor) if solver.located and kinked else plain

    def begin(self, system: System, launch: Launch, at: Scalar) -> Float[Array, " y"]:
        """State at a start, which has balls where the scene has some; `at` [m] is the observed station."""
        q, velocity = launch.shaft.state(system, at)
        others = SpinAndBalls.of(launch, system.spin.speed, free=self.forces.free)
        w = self.rotor.encode(self.rotor.axes.state(q, velocity))
        return jnp.concatenate([w, ravel_pytree(others)[0]])

    def motion(
        self, step: CoupledStep | LocatedCoupledStep, y: Float[Array, " y"]
    ) -> tuple[Complex[Array, " n"], Complex[Array, " n"], SpinAndBalls]:
        """Coordinates [m], their velocities [m/s] and the others of a state."""
        count = y.size - step.sizes.total
        q, velocity = self.rotor.axes.coordinates(self.rotor.decode(y[:count]))
        return q, velocity, step.sizes.named(y[count:])


class CoupledPath(NamedTuple):
    """Motion at the samples."""

    states: RotatingState
    touched: Bool[Array, ""]
    unresolved: Int[Array, ""]
    contact_stiffness_ratio: Float[Array, "k 2"]


def coupled_path(
    scene: Scene, field: Transient, stepping: Stepping, launch: Launch, station: Scalar
) -> CoupledPath:
    """Motion of a scene from a start, step by step; `field` are its equations in the axes of the shaft."""
    system = field.system
    basis = None
    if stepping.bases is not None:
        basis = jax.tree.map(lambda leaf: leaf[0], stepping.bases)
    rotor = CoupledRotor.build(scene, system, stepping, launch.angle, basis)
    lengths = jnp.diff(stepping.breaks)
    step_of = lambda length: rotor.step(
        stepping.solver, length / (stepping.substeps * stepping.parts)
    )
    longest = step_of(jnp.max(lengths))

    def piece(carry, part):
        time, length = part
        step = longest if stepping.even else step_of(length)
        each = length / stepping.parts

        def several(count, carry):
            y, touched, unresolved = carry
            begin = time + count * each
            y, loaded, more = step.several(begin, stepping.substeps, y, batch=False)
            return y, touched | loaded, unresolved + more

        if isinstance(stepping.parts, int):
            carry = several(0, carry)
        else:
            carry = jax.lax.fori_loop(0, stepping.parts, several, carry)
        return carry, carry[0]

    first = rotor.begin(system, launch, station)
    begun = first, jnp.zeros((), bool), jnp.zeros((), int)
    (_, touched, unresolved), states = jax.lax.scan(piece, begun, (stepping.breaks[:-1], lengths))
    states = jnp.concatenate([first[None], states])[stepping.samples]
    times = stepping.breaks[stepping.samples]

    def rotating(time: Scalar, y: Float[Array, " y"]) -> RotatingState:
        """The state in the axes of the shaft."""
        q, velocity, others = rotor.motion(longest, y)
        angle, speed, _ = rotor.forces.turning(Instant.at(jnp.asarray(time)), others)
        back, rate = direction(-angle), field.rate
        drift = back * (velocity - 1j * speed * q)
        rates = plane(drift) / rate, others.angle, others.speed / rate
        return RotatingState(plane(back * q), *rates, others.bodies, others.bodies_rate / rate)

    states = jax.vmap(rotating)(times, states)
    return CoupledPath(states, touched, unresolved, longest.contact_stiffness_ratio)
