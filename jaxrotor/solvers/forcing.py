"""Forcings: actions on a rotor at constant speed, along times, and on one that is coupled to others."""

import functools
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..core.lanes import computed_once, per_lane, product
from ..core.quantities import Scalar
from ..effects.law import Now
from ..equations.coupled import AuxiliaryState, CoupledForces, Instant
from ..equations.kinematics import Turning
from ..equations.port import Law, Port
from .ports import PortField, forces_of_lanes, take_lanes
from .reading import Reading
from .step import AbstractForcing, At, StepData
from .tableau import phase_at, phase_rate


# A parabola at a share x of a step by its values at 0, 1/2 and 1: rows are the powers of x.
PARABOLA = np.array([[1.0, 0.0, 0.0], [-3.0, 4.0, -1.0], [2.0, -4.0, 2.0]])


class AtConstantSpeed(AbstractForcing):
    """Contact; `w` is the deviation from the steady response. A node is the phase, a start the angle.

    `x` are the states of laws.
    """

    field: PortField

    @property
    def reading(self) -> Reading:
        """Reading of the ports."""
        assert self.field.reading is not None
        return self.field.reading

    @property
    def ports(self) -> tuple[Port, ...]:
        return self.field.motion.ports

    @property
    def others(self) -> int:
        return sum(len(port.places) for port in self.ports)

    @property
    def through(self) -> Float[Array, "p4 p2"] | None:
        return self.field.through

    def data(self, start, times, span, part=None) -> StepData:
        begin = start if part is None else start + part.begin
        angles = jnp.stack([begin + time * span for time in times])
        return StepData(phase_at(angles, self.reading.rates, axis=1))

    def at(self, start, part) -> At:
        angle = jnp.asarray(start + part.begin)
        phase = phase_at(angle, self.reading.rates, axis=0)
        return At(phase, phase_rate(phase, self.reading.rates))

    def seen(self, node, own):
        return own + self.reading.steady(node)

    def forces(self, node, seen, x, law):
        phase, reading = lambda: node, self.reading
        states = x if self.others else None
        # Each use of a vector that is turned would turn it again: 275 in place of 149 ns a lane-step of a
        # rotor with a limiter and a coupling whose stiffness turns.
        turns = reading.turn is not None and seen.ndim > 1 and seen.shape[-1] > 1
        once = computed_once if turns else lambda part: part
        found = self.field.forces_of(phase, reading.fixed(phase, once(seen)), law, states)
        if states is None:
            return once(reading.turned(phase, found)), None
        force, rates = jnp.split(found, [2 * len(self.ports)])
        return once(reading.turned(phase, force)), rates / self.field.motion.rate

    def motion(self, node, seen, law):
        phase = lambda: node
        seen, through = self.reading.fixed(phase, seen), self.field.through_at(phase)
        if through is not None:
            seen = seen + product(through, self.field.forces_of(phase, seen, law))
        return _motion(seen)

    def of_laws(self, node, x):
        return self.field.motion.of_laws(lambda: node, x if self.others else None)


class KnownRotation(NamedTuple):
    """Rotation known in time, at the beginning, middle and end of a step."""

    angle: Float[Array, "3 ..."] | None  # theta [rad]; None: no law asks for it
    speed: Float[Array, "3 ..."]  # Omega [rad/s]
    change: Float[Array, "3 ..."]  # Omega - Omega_c
    acceleration: Float[Array, "3 ..."] | None = None  # [rad/s^2]; None: no law asks for the angle
    time: Float[Array, "3 ..."] | None = None  # [s], likewise


class AbstractWholeMotion(AbstractForcing):
    """Forcing of a `w` that is the whole motion, of a rotor whose ports have mass."""

    @property
    def through(self) -> None:
        return None

    def seen(self, node, own):
        del node
        return own

    def motion(self, node, seen, law):
        del node, law
        return _motion(seen)


class AlongTimes(AbstractWholeMotion):
    """Contact, the speed terms and loads, at a speed known in time.

    A start is a `StepData` with a `KnownRotation`. Within a step the angle, the speed and the loads are
    parabolas through their values at its beginning, middle and end.
    """

    ports: tuple[Port, ...]

    @property
    def others(self) -> int:
        return 0

    def data(self, start, times, span, part=None) -> StepData:
        del times
        if part is None:
            return start
        shares = (part.begin + span * jnp.array([0.0, 0.5, 1.0])) / part.whole
        weights = _powers(shares).T @ PARABOLA
        nodes = jax.tree.map(lambda values: weights @ values, start.nodes)
        load = start.load
        if load is not None:
            unbalance, rest = _parts_of_load(load)
            load = jnp.concatenate([(weights @ unbalance).ravel(), rest])
        return StepData(nodes, load)

    def at(self, start, part) -> At:
        x = jnp.asarray(part.begin / part.whole)
        weights = PARABOLA.T @ _powers(x)
        slopes = PARABOLA.T @ jnp.stack([0 * x, 1.0 + 0 * x, 2 * x]) / part.whole
        mean = lambda weights, values: sum(w * v for w, v in zip(weights, values, strict=True))
        node, rate = (
            jax.tree.map(functools.partial(mean, w), start.nodes) for w in (weights, slopes)
        )
        load = start.load
        if load is not None:
            unbalance, rest = _parts_of_load(load)
            load = jnp.concatenate([mean(weights, unbalance), rest])
        return At(node, rate, load)

    def forces(self, node, seen, x, law):
        both, p = seen.reshape(2, -1, *seen.shape[1:]), len(self.ports)
        parts = []
        if p:
            motion = both[:, : 2 * p].reshape(4 * p, *seen.shape[1:])
            found = forces_of_lanes(self.ports, self.of_laws(node, x), motion, law)
            parts.append(found.reshape(2, p, *seen.shape[1:]))
        if both.shape[1] > 2 * p:
            parts.append(node.change * both[:, 2 * p :])
        return jnp.concatenate(parts, axis=1).reshape(-1, *seen.shape[1:]), None

    def of_laws(self, node, x):
        del x
        return Now(node.speed, node.angle, acceleration=node.acceleration, time=node.time)


def _motion(seen: Float[Array, "p4 ..."]) -> tuple[Array, Array]:
    """Displacement and velocity of ports, (2, p, ..) each, by their readings along fixed axes."""
    d, v = jnp.moveaxis(seen.reshape(2, 2, -1, *seen.shape[1:]), 1, 0)
    return d, v


def _powers(x: Array) -> Float[Array, "3 ..."]:
    """`1, x, x^2`."""
    return jnp.stack([1.0 + 0 * x, x, x**2])


def _parts_of_load(load: Float[Array, "u ..."]) -> tuple[Float[Array, "3 g ..."], Array]:
    """[Re, Im] of the unbalance at the nodes of a step, if there is one, and 1 of a weight."""
    count = len(load) // 6 * 6
    return load[:count].reshape(3, count // 3, *load.shape[1:]), load[count:]


class Sizes(NamedTuple):
    """Numbers of the spin, the balls and the states of laws in a state, which are its last ones."""

    spin: int  # 1 where it is free, else 0
    bodies: int
    states: int

    @classmethod
    def of(cls, forces: CoupledForces) -> "Sizes":
        """Those of a scene."""
        system = forces.system
        bodies = sum(race.bodies.places for race in system.races)
        return cls(int(forces.free), bodies, system.state_count)

    @property
    def total(self) -> int:
        """All numbers, those of the rates included."""
        return 2 * (self.spin + self.bodies) + self.states

    def named(self, x: Float[Array, "x ..."]) -> AuxiliaryState:
        """The spin, the balls and the states of laws by their numbers."""
        d, b = self.spin, self.bodies
        return AuxiliaryState(*jnp.split(x, np.cumsum([d, d, b, b])))


class Coupled(AbstractWholeMotion):
    """Forces that depend on balls, on states of laws, or on a rotation that the rotor holds back.

    A start is a time [s].
    """

    coupled: CoupledForces
    rate: Scalar  # [rad/s]
    weighs: bool = eqx.field(static=True)
    sizes: Sizes = eqx.field(static=True)

    @classmethod
    def of(cls, forces: CoupledForces, rate: Scalar, *, weighs: bool) -> "Coupled":
        """The forcing of a rotor, `weighs` where weight acts on it."""
        return cls(forces, rate, weighs, Sizes.of(forces))

    @property
    def ports(self) -> tuple[Port, ...]:
        return self.coupled.system.ports

    @property
    def others(self) -> int:
        return self.sizes.total

    def data(self, start, times, span, part=None) -> StepData:
        length, begin = span / self.rate, start
        middle = start + (span if part is None else part.whole) / self.rate / 2
        if part is not None:
            begin = start + part.begin / self.rate
        nodes = jnp.stack([begin + time * length for time in times])
        load = jnp.ones((1, *nodes.shape[1:])) if self.weighs else None
        return StepData(Instant.of_step(nodes, middle), load)

    def at(self, start, part) -> At:
        time = jnp.asarray(start + part.begin / self.rate)
        now = Instant.of_step(time, start + part.whole / 2 / self.rate)
        load = jnp.ones((1, *time.shape)) if self.weighs else None
        rate = jnp.asarray(1 / self.rate) + 0 * time
        return At(now, Instant(rate, 0 * time), load)

    def forces(self, node, seen, x, law):
        sizes = self.sizes
        call = lambda parts, both: _found(parts[:2], both, sizes, parts[2])
        parts, both = (self.coupled, node, law), jnp.concatenate([seen, x])
        if both.ndim == 1 or take_lanes(self.ports):
            found = call(parts, both)
        else:
            found = per_lane(call, parts, both)
        inputs, rates = jnp.split(found, [len(found) - sizes.total])
        return inputs, rates / self.rate

    def of_laws(self, node, x):
        others = self.sizes.named(x)
        turning = self._turning(node, others)
        known = {"acceleration": turning.acceleration, "time": node.time}
        return Now(turning.speed, turning.angle, others.states, **known)

    def _turning(self, node: Instant, others: AuxiliaryState) -> Turning:
        """Rotation now, with rates by the time on this side of a jump."""
        if self.coupled.free or self.coupled.system.spin.kinks is None:
            return self.coupled.turning(node, others)
        # The rate of a speed at a jump of the acceleration is that of this side of it.
        time = jax.lax.stop_gradient(node.time)
        turning = self.coupled.turning(node._replace(time=time), others)
        speed = turning.speed + (node.time - time) * turning.acceleration
        angle = turning.angle + (node.time - time) * turning.speed
        return turning._replace(angle=angle, speed=speed)


@eqx.filter_jit  # traced once a program
def _found(
    parts: tuple[CoupledForces, Instant], seen: Float[Array, "z ..."], sizes: Sizes, law: Law
) -> Float[Array, "i ..."]:
    """`[Re, Im]` of the inputs, and the rates of the others per second, by readings and others."""
    forces, now = parts
    stage, x = jnp.split(seen, [len(seen) - sizes.total])
    real, imag = jnp.split(stage, 2)
    found, rates = forces(now, jax.lax.complex(real, imag), sizes.named(x), law)
    own = [part + 0 * x[:1] for part in jax.tree.leaves(rates)]  # in every lane
    return jnp.concatenate([found.real, found.imag, *own])
