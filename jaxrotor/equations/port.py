"""Port: one station where nonlinear laws act, see docs/concepts/ports.md."""

import abc
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, cast

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..core.extremes import larger
from ..core.lanes import computed_once
from ..core.quantities import Scalar
from ..effects.law import AbstractLaw, Beside, Branch, Clock, Now, States


Branches = tuple[Float[Array, "_ _ ..."], ...]  # (k, c) of every stack of k laws of equal structure


class Port(eqx.Module):
    """One station where nonlinear laws act: reads `row . q`, adds `column F` to the equations.

    One that laws of another port read as their sensor has no laws itself, so no force.
    """

    row: Float[Array, " n"]
    column: Float[Array, " n"]
    at: Scalar  # [m]
    laws: tuple[AbstractLaw, ...]  # laws of equal structure stacked along a leading axis
    # Stiffness and damping that the linear equations bear in place of the laws, see `with_lent_films`:
    lent: Float[Array, "2"] | None = None
    on: str | None = eqx.field(static=True, default=None)  # name of a casing; None: the ground
    # Places of the states of its laws, stack by stack, among those of a system:
    places: tuple[int, ...] = eqx.field(static=True, default=())
    # Number of the port whose motion its laws are given as that of their sensor; None: they have none:
    reads: int | None = eqx.field(static=True, default=None)
    clock: Clock | None = None  # of the shaft of its laws, where that is not the first one
    beside: Clock | None = None  # of the shaft on which they stand; None: they stand on none

    def own(self, now: Now) -> Now:
        """Rotation as its laws are given it, by that of the first shaft."""
        own = now if self.clock is None else self.clock.of(now)
        if self.beside is None:
            return own
        there = self.beside.of(now)
        return own._replace(beside=Beside(there.speed, there.angle))

    def begin(self) -> States:
        """States of all laws at the start of a motion, stack by stack."""
        begin = lambda law: _as_states(law, "begin", law.begin())
        parts = [jax.vmap(begin)(stack) for stack in self.laws if stack.states]
        return jnp.concatenate([jnp.zeros(0), *(part.ravel() for part in parts)])

    def forces(self, displacement: Array, velocity: Array, now: Now) -> Float[Array, "k 2 ..."]:
        """Force of every law at this port [N], in the order of `System.members`.

        `now` has the angle with all turns, and the states of all laws of the port.
        """
        if not self.laws:
            return jnp.zeros((0, *jnp.shape(displacement)))
        call = lambda law, now: law(displacement, velocity, now)
        return jnp.concatenate([_mapped(call)(*stack) for stack in self._stacks(now)])

    def rates(
        self,
        forces: Float[Array, "k 2 ..."],
        displacement: Array,
        velocity: Array,
        now: Now,
        branches: Branches | None = None,
    ) -> States:
        """Rates of the states of all laws per second, stack by stack, by their forces [N].

        They follow given `branches`, also beyond their ends; None: those of the motion.
        """
        call = lambda law, now, force, *branch: _as_states(
            law,
            "rates",
            law.rates(force, displacement, velocity, now._replace(branch=_only(branch))),
        )
        parts = zip(self._stacks(now), self._of_stacks(forces), strict=True)
        found = [jnp.zeros((0, *forces.shape[2:]))]
        for number, ((stack, own), force) in enumerate(parts):
            if stack.states:
                along = () if branches is None else (branches[number],)
                rates = _mapped(call)(stack, own, force, *along)
                found.append(rates.reshape(-1, *rates.shape[2:]))
        return jnp.concatenate(found)

    def _stacks(self, now: Now) -> Iterator[tuple[AbstractLaw, Now]]:
        """Every stack of laws with an angle by their clock, and their own states."""
        start = 0
        for stack in self.laws:
            angle, state = now.angle if stack.clock else None, None
            if angle is not None and stack.clock == "revolution":
                angle = jnp.mod(angle, 2 * jnp.pi)
            if now.state is not None and stack.states:
                stop = start + count_of(stack) * len(stack.states)
                own, start = now.state[start:stop], stop
                state = own.reshape(-1, len(stack.states), *own.shape[1:])
            yield stack, now._replace(angle=angle, state=state, branch=None)

    def _of_stacks(self, each: Float[Array, "k ..."]) -> Iterator[Array]:
        """Parts of an array of all laws, stack by stack."""
        start = 0
        for stack in self.laws:
            stop = start + count_of(stack)
            yield each[start:stop]
            start = stop

    def added(
        self, forces: Float[Array, "k 2 ..."], displacement: Array, velocity: Array
    ) -> Float[Array, "2 ..."]:
        """Force of all laws together, beside what they lend to the linear equations [N]."""
        if len(forces) == 1 and forces.ndim > 2:
            # A law that is alone: 366 in place of 67 ns a lane-step of a mass and a stop
            forces = computed_once(forces)
        total = forces.sum(0)
        if self.lent is None:
            return total
        return total + self.lent[0] * displacement + self.lent[1] * velocity

    def branches(self, displacement: Array, velocity: Array, now: Now) -> Branches:
        """Branch of every law in a motion."""
        call = lambda law, now: law.branch(displacement, velocity, now)
        found = (_mapped(call)(*stack) for stack in self._stacks(now))
        return tuple(_in_lanes(values, displacement) for values in found)

    def along(
        self, branches: Branches, displacement: Array, velocity: Array, now: Now
    ) -> Float[Array, "k 2 ..."]:
        """Force of every law by the formula of a given branch, also beyond its ends [N]."""
        if not self.laws:
            return jnp.zeros((0, *jnp.shape(displacement)))
        call = lambda law, now, branch: law.along(branch, displacement, velocity, now)
        stacks = zip(self._stacks(now), branches, strict=True)
        return jnp.concatenate([_mapped(call)(*stack, branch) for stack, branch in stacks])

    def margins(
        self, branches: Branches, displacement: Array, velocity: Array, now: Now
    ) -> Branches:
        """Margin of every condition of every law: how far it is from changing."""
        call = lambda law, now, branch: law.margins(branch, displacement, velocity, now)
        stacks = zip(self._stacks(now), branches, strict=True)
        found = (_mapped(call)(*stack, branch) for stack, branch in stacks)
        return tuple(_in_lanes(values, displacement) for values in found)

    def hardness(self) -> Float[Array, "2"]:
        """Stiffness [N/m] and damping [N s/m] of all laws together, each in its hardest direction."""
        if not self.laws:
            return jnp.zeros(2)
        share, each = self._shares()
        return jnp.max(share @ each, axis=0)

    def hardnesses(self) -> Float[Array, "k 2"]:
        """The same outward along every law, of that law and of those that act before it."""
        if not self.laws:
            return jnp.zeros((0, 2))
        (share, each), gaps = self._shares(), self.clearances(jnp.zeros(2))
        return (share * (gaps[:, None] <= gaps)).T @ each

    def _shares(self) -> tuple[Float[Array, "k k"], Float[Array, "k 2"]]:
        """Share of law i in a motion outward along law j; stiffness and damping of each law."""
        stacks = [jax.vmap(lambda law: law.hardness()[:3])(stack) for stack in self.laws]
        stiffness, damping, out = (jnp.concatenate(part) for part in zip(*stacks, strict=True))
        round_about = jnp.all(out == 0, axis=1)  # a law without a direction has all of it
        share = jnp.where(round_about[:, None], 1.0, larger(out @ out.T, 0.0) ** 2)
        return share, jnp.stack([stiffness, damping], axis=1)

    def clearances(self, displacement: Array) -> Float[Array, " k"]:
        """Distance of every law until it acts [m]."""
        if not self.laws:
            return jnp.zeros(0)
        stacks = [jax.vmap(lambda law: law.clearance(displacement))(one) for one in self.laws]
        return jnp.concatenate(stacks)

    def torque(
        self, forces: Float[Array, "k 2 ..."], displacement: Array, velocity: Array, now: Now
    ) -> Float[Array, "..."]:
        """Torque about the axis of all laws, by their forces [N m]."""
        call = lambda law, now, force: law.torque(force, displacement, velocity, now)
        stacks = zip(self._stacks(now), self._of_stacks(forces), strict=True)
        torques = [jnp.sum(_mapped(call)(*stack, force), axis=0) for stack, force in stacks]
        return sum(torques, start=jnp.zeros(()))


def _mapped(call: Callable) -> Callable:
    """`call(law, now, ..)` for every law of a stack, each with its own states."""

    def every(stack: AbstractLaw, now: Now, *given: Array) -> Array:
        own = cast(Any, Now)(None, None, 0)  # laws of a stack share speed, angle and sensor
        return jax.vmap(call, in_axes=(0, own, *[0] * len(given)))(stack, now, *given)

    return every


def _only(parts: tuple[Branch, ...]) -> Branch | None:
    """The one entry of a tuple; None of an empty one."""
    return parts[0] if parts else None


def _in_lanes(values: Float[Array, "k c ..."], displacement: Array) -> Float[Array, "k c ..."]:
    """Values of the conditions of laws, with the lanes of a displacement where a law leaves them out."""
    lanes = displacement.shape[1:]
    if values.ndim == 2:
        values = values.reshape(*values.shape, *(1,) * len(lanes))
    return jnp.broadcast_to(values, (*values.shape[:2], *lanes))


def _as_states(law: AbstractLaw, name: str, values: Any) -> States:
    """Values that a method of a law returned; raises unless there is one for each of its states."""
    values = jnp.asarray(values, float)
    if values.shape[:1] != (len(law.states),):
        raise ValueError(
            f"`{name}` of {type(law).__name__} must return a number for each of its {len(law.states)} "
            f"`states`, but returned the shape {values.shape}."
        )
    return values


def count_of(stack: AbstractLaw) -> int:
    """Number of laws in a stack."""
    return jax.tree.leaves(stack)[0].shape[0]


class AbstractPortLaw(eqx.Module):
    """Forces of every law of a port, and rates of their states."""

    @abc.abstractmethod
    def __call__(
        self, number: int, port: Port, place: Array, velocity: Array, now: Now
    ) -> Float[Array, "k 2 ..."]:
        """Forces [N], by the number of the port, displacement and velocity there."""

    @abc.abstractmethod
    def rates(self, number: int, port: Port, forces: Array, *motion: Any) -> States:
        """Rates of the states, by the forces, displacement, velocity and `now`."""


class ActualLaw(AbstractPortLaw):
    """Forces and rates along the branches of the motion itself."""

    def __call__(
        self, number: int, port: Port, place: Array, velocity: Array, now: Now
    ) -> Float[Array, "k 2 ..."]:
        del number
        return port.forces(place, velocity, now)

    def rates(self, number: int, port: Port, forces: Array, *motion: Any) -> States:
        del number
        return port.rates(forces, *motion)


Law = AbstractPortLaw
actual = ActualLaw()


def of_each(
    ports: Sequence[Port], now: Now, displacement: Sequence[Array] | Array, velocity: Any
) -> Iterator[Now]:
    """Each port's own of `now`: states of its own laws, and the motion at their sensor.

    Displacement and velocity are those of all ports, along a first axis.
    """
    for port in ports:
        state = now.state[np.array(port.places, int)] if now.state is not None else None
        read = port.reads
        seen = None if read is None else (displacement[read], velocity[read])
        yield port.own(now)._replace(state=state, sensor=seen)


def of_all(ports: Sequence[Port], each: Iterable[Array]) -> States:
    """States of a system, or their rates, by those of each port."""
    parts = list(each)
    if not parts:
        return jnp.zeros(0)
    places = np.concatenate([np.array(port.places, int) for port in ports])
    return jnp.concatenate(parts)[np.argsort(places)]


def rates_of_states(
    ports: Sequence[Port], displacement: Array, velocity: Array, now: Now
) -> States:
    """Rates of the states of a system, from displacement and velocity at all ports, (p, 2) each."""
    own = of_each(ports, now, displacement, velocity)
    motions = zip(ports, displacement, velocity, own, strict=True)
    return of_all(ports, [port.rates(port.forces(d, v, n), d, v, n) for port, d, v, n in motions])


def port_forces(
    ports: tuple[Port, ...],
    displacement: Array,
    velocity: Array,
    now: Now,
    law: Law = actual,
) -> Float[Array, "2 p ..."]:
    """Total force at every port from displacement and velocity there, all (2, p), or (2, p, lanes)."""
    return forces_and_rates(ports, displacement, velocity, now, law)[0]


def forces_and_rates(
    ports: tuple[Port, ...],
    displacement: Array,
    velocity: Array,
    now: Now,
    law: Law = actual,
) -> tuple[Float[Array, "2 p ..."], States | None]:
    """The same, and the rates of the states of all laws per second; None where no states are given."""
    motions = [jnp.swapaxes(x, 0, 1) for x in (displacement, velocity)]
    every = list(zip(ports, *motions, of_each(ports, now, *motions), strict=True))
    forces = [law(number, *motion) for number, motion in enumerate(every)]
    pairs = list(zip(every, forces, strict=True))
    total = jnp.stack([port.added(f, d, v) for (port, d, v, _), f in pairs], axis=1)
    if now.state is None:
        return total, None
    rates = [law.rates(k, port, f, *motion) for k, ((port, *motion), f) in enumerate(pairs)]
    return total, of_all(ports, rates)
