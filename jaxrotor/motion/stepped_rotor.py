"""Stepped rotor: a rotor, and all that moves with it, along times by exponential steps."""

import dataclasses
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Bool, Complex, Float, Int

from ..core.blocks import unbalance_factor
from ..core.plane import direction
from ..core.quantities import Number, Scalar
from ..equations.coupled import INSIDE, AuxiliaryState, CoupledForces, Instant
from ..equations.fixed_axes import FixedAxes, SpeedTerms
from ..equations.start import Launch
from ..equations.system import System
from ..scene import Scene
from ..solvers.basis import Basis
from ..solvers.forcing import AlongTimes, Coupled, KnownRotation, Sizes
from ..solvers.rotor import RotorAtSpeed
from ..solvers.step import AbstractForcing, Step, StepData
from ..spins.base import AbstractSpin, Turning
from .exact import exact_motion
from .speeds import decomposed_at, turning
from .stepped import Stepping


class Schedule(eqx.Module):
    """Rotation known in time, and the loads that follow from it."""

    spin: AbstractSpin
    polar: Number | None  # moment of inertia [kg m^2]
    centre: Number  # speed of decomposition [rad/s]
    angle: Number  # of rotation at time 0 [rad]
    clocks: bool = eqx.field(static=True)  # whether laws ask for the angle
    unbalanced: bool = eqx.field(static=True)
    weighs: bool = eqx.field(static=True)

    def starts(self, time: Scalar, length: Scalar, count: int) -> StepData:
        """Data of `count` equal steps in a `length` of time that begins at `time` [s]."""
        share, spin = jnp.arange(2 * count + 1) / (2 * count), self.spin
        now = spin.turning(time + length * share, self.polar)
        acceleration = now.acceleration
        if spin.kinks is not None:  # at an end it is that of this side of a jump
            inside = INSIDE / (2 * count)
            share = share.at[0].add(inside).at[-1].add(-inside)
            acceleration = spin.turning(time + length * share, self.polar).acceleration
        nodes = jnp.arange(count)[:, None] * 2 + np.arange(3)
        angle, speed = self.angle + now.angle, now.speed[nodes]
        rotation = KnownRotation(None, speed, speed - self.centre)
        if self.clocks:
            read = time + length * share
            others = acceleration[nodes], read[nodes]
            rotation = KnownRotation(angle[nodes], speed, speed - self.centre, *others)
        values = [jnp.zeros((count, 0))]
        if self.unbalanced:
            g = unbalance_factor(now.speed, acceleration) * direction(angle)
            values.append(jnp.stack([g.real, g.imag], axis=-1)[nodes].reshape(count, 6))
        if self.weighs:
            values.append(jnp.ones((count, 1)))
        load = jnp.concatenate(values, axis=-1)
        return StepData(rotation, load if self.unbalanced or self.weighs else None)


def starts(schedule: Schedule | None, time: Scalar, length: Scalar, count: int) -> Any:
    """Starts of `count` equal steps in a `length` of time that begins at `time` [s]."""
    if schedule is None:
        return time + jnp.arange(count) * (length / count)
    return schedule.starts(time, length, count)


class SteppedRotor(eqx.Module):
    """A rotor in the coordinates of its steps.

    A state is that of the rotor in its basis, then the numbers of its `AuxiliaryState`.
    """

    system: System
    rotor: RotorAtSpeed
    forces: CoupledForces | None  # None: nothing moves with the rotor
    centre: Scalar  # speed of decomposition [rad/s]
    angle: Scalar  # of rotation at time 0 [rad]

    @classmethod
    def build(
        cls,
        scene: Scene,
        system: System,
        stepping: Stepping,
        angle: Scalar,
        at: tuple[Scalar, Basis | None],
    ) -> "SteppedRotor":
        """The rotor of a scene, turned by `angle` at time 0, `at` a speed of decomposition.

        Its basis there is dense unless one is given.
        """
        (centre, basis), (_, rate) = at, stepping.centres(system)
        terms = SpeedTerms.of(system, stepping.modes) if stepping.modes else None
        if not system.coupled:
            rotor = RotorAtSpeed.build(decomposed_at(system, centre), rate, terms, basis)
            return cls(system, rotor, None, centre, angle)
        forces, stations = CoupledForces.of(scene, system, terms, centre, jnp.asarray(angle))
        rotor = RotorAtSpeed.build(decomposed_at(system, centre), rate, terms, basis, stations)
        return cls(system, rotor, forces, centre, angle)

    @property
    def forcing(self) -> AbstractForcing:
        """Forces on the rotor and what is coupled to it."""
        if self.forces is None:
            return AlongTimes(self.system.ports)
        return Coupled.of(self.forces, self.rotor.axes.rate, weighs=self.rotor.weight is not None)

    @property
    def sizes(self) -> Sizes:
        """Numbers of what moves with the rotor, in a state."""
        return Sizes(0, 0, 0) if self.forces is None else Sizes.of(self.forces)

    def plain(self, order: int, length: Scalar) -> Step:
        """A step of a length of time [s], which is not split."""
        return self.rotor.step(order, self.rotor.axes.rate * length, self.forcing)

    @property
    def schedule(self) -> "Schedule | None":
        """Rotation and loads known in time; None where something moves with the rotor."""
        if self.forces is not None:
            return None
        system, rotor = self.system, self.rotor
        loads = rotor.unbalance is not None, rotor.weight is not None
        known = system.spin, system.blocks.polar, self.centre, self.angle
        return Schedule(*known, bool(system.clocks), *loads)

    def encode(
        self, q: Complex[Array, " n"], velocity: Complex[Array, " n"], others: AuxiliaryState
    ) -> Float[Array, " y"]:
        """State of coordinates [m], their velocities [m/s] and what moves with the rotor."""
        w = self.rotor.encode(self.rotor.axes.state(q, velocity))
        return w if self.forces is None else jnp.concatenate([w, ravel_pytree(others)[0]])

    def begin(self, launch: Launch, at: Scalar) -> Float[Array, " y"]:
        """State at a start, which has balls where the scene has some; `at` [m] is the observed station."""
        free = self.forces is not None and self.forces.free
        others = AuxiliaryState.of(launch, self.system, free=free)
        return self.encode(*launch.shaft.state(self.system, at), others)

    def decode(
        self, y: Float[Array, " y"]
    ) -> tuple[Complex[Array, " n"], Complex[Array, " n"], AuxiliaryState]:
        """Coordinates [m], their velocities [m/s] and what moves with the rotor, of a state."""
        w, others = self.parts(y)
        return *self.rotor.axes.coordinates(self.rotor.decode(w)), others

    def parts(self, y: Float[Array, " y"]) -> tuple[Float[Array, " m2"], AuxiliaryState]:
        """State of the rotor in its basis, and what moves with it."""
        w, x = jnp.split(y, [y.size - self.sizes.total])
        return w, self.sizes.named(x)

    def turning(self, time: Scalar, others: AuxiliaryState) -> Turning:
        """Rotation at a time [s]; of a free spin without its acceleration."""
        if self.forces is not None:
            return self.forces.turning(Instant.at(jnp.asarray(time)), others)
        now = turning(self.system, jnp.asarray(time))
        return now._replace(angle=self.angle + now.angle)


class Path(eqx.Module):
    """Motion at the samples, in fixed axes."""

    q: Complex[Array, "T n"]
    velocity: Complex[Array, "T n"]  # [1/s] of them
    others: AuxiliaryState
    turning: Turning  # of a free spin without its acceleration
    touched: Bool[Array, ""]  # whether a contact was loaded
    unresolved: Int[Array, ""]  # steps whose changes of contact were not located
    contact_stiffness_ratio: Float[Array, "k 2"]


def stepped(
    scene: Scene, system: System, stepping: Stepping, launch: Launch, station: Scalar
) -> Path:
    """Motion of a scene from a start; `station` [m] is the observed one.

    Without contact and at constant speed it is exact, and nothing is stepped.
    """
    centres, rate = stepping.centres(system)
    times, samples = stepping.breaks, stepping.samples
    if stepping.exact:
        basis: Any = jax.tree.map(lambda leaf: leaf[0], stepping.bases)
        begin = launch.shaft.state(system, station)
        motion = exact_motion(system, basis, rate, times, begin, launch.angle, even=stepping.even)
        q, velocity = (part[samples] for part in motion)
        now = turning(system, times[samples])
        now = now._replace(angle=launch.angle + now.angle)
        none = AuxiliaryState.of(launch, system, free=False)
        return Path(
            q, velocity, none, now, jnp.zeros((), bool), jnp.zeros((), int), jnp.zeros((0, 2))
        )
    lengths, take = jnp.diff(times), lambda tree, k: jax.tree.map(lambda leaf: leaf[k], tree)
    build = lambda at: SteppedRotor.build(scene, system, stepping, launch.angle, at)
    solver, count = stepping.solver, stepping.substeps * stepping.parts
    every = centres, stepping.bases
    longest = jnp.max(lengths) / count
    if stepping.speeds == 1:
        rotor = build(take(every, 0))
        plain = rotor.plain(solver.order, longest)
        rotor_at, step_at = lambda _: rotor, lambda _: plain
        first, into, out = rotor.begin(launch, station), lambda _, y: y, lambda _, y: y
        coordinates = rotor.decode
    else:
        rotors = jax.lax.map(lambda at: build(at).rotor, every)
        # A coupled rotor has one speed; the ports, which all speeds share, are given to a step later.
        rotor_at = lambda k: SteppedRotor(system, take(rotors, k), None, centres[k], launch.angle)
        step_at = lambda k: rotor_at(k).plain(solver.order, longest)
        if stepping.even:
            bare, size = AlongTimes(()), rate * longest
            steps = jax.lax.map(lambda one: one.step(solver.order, size, bare), rotors)
            step_at = lambda k: dataclasses.replace(
                take(steps, k), forcing=AlongTimes(system.ports)
            )
        into, out = lambda own, y: own.rotor.encode(y), lambda own, y: own.rotor.decode(y)
        axes = FixedAxes(take(rotors, 0).axes.matrix, rate)
        first = axes.state(*launch.shaft.state(system, station))
        none = AuxiliaryState.of(Launch(), system, free=False)
        coordinates = lambda state: (*axes.coordinates(state), none)

    def piece(carry, part):
        state, touched, unresolved = carry
        time, length = part
        number = 0
        if stepping.speeds > 1:
            speed = turning(system, time + length / 2).speed
            number = jnp.argmin(jnp.abs(centres - speed))
        own, each = rotor_at(number), length / stepping.parts
        step = step_at(number) if stepping.even else own.plain(solver.order, length / count)
        step = solver.located_of(own.rotor, step)

        def several(part, carry):
            y, touched, unresolved = carry
            begins = starts(own.schedule, time + part * each, each, stepping.substeps)
            y, loaded, more = step.several(begins, y)
            return y, touched | loaded, unresolved + more

        carry = into(own, state), touched, unresolved
        if isinstance(stepping.parts, int):
            carry = several(0, carry)
        else:
            carry = jax.lax.fori_loop(0, stepping.parts, several, carry)
        state = out(own, carry[0])
        return (state, *carry[1:]), state

    begun = first, jnp.zeros((), bool), jnp.zeros((), int)
    (_, touched, unresolved), states = jax.lax.scan(piece, begun, (times[:-1], lengths))
    states = jnp.concatenate([first[None], states])[samples]
    q, velocity, others = jax.vmap(coordinates)(states)
    now = jax.vmap(rotor_at(0).turning)(times[samples], others)
    ratio = step_at(stepping.speeds // 2).contact_stiffness_ratio
    return Path(q, velocity, others, now, touched, unresolved, ratio)
