"""Counted: laws by "turns" whose angle is a state of their own, where no period brings all forces back."""

import dataclasses

import jax.numpy as jnp

from ..core.quantities import Number
from ..effects.law import AbstractLaw, Branch, Hardness, Now, Plane, States
from .port import Port, count_of
from .system import System


class Counted(AbstractLaw):
    """A law by "turns" that has the angle of its shaft as its first state: `theta. = Omega`."""

    law: AbstractLaw

    @property
    def states(self) -> tuple[str, ...]:
        return "angle [rad]", *self.law.states

    @property
    def elementwise(self) -> bool:
        return self.law.takes_lanes

    @property
    def kinked(self) -> bool:
        return self.law.kinked

    def begin(self) -> States:
        return jnp.concatenate([jnp.zeros(1), self.law.begin()])

    def __call__(self, displacement: Plane, velocity: Plane, now: Now) -> Plane:
        return self.law(displacement, velocity, _within(now))

    def rates(self, force: Plane, displacement: Plane, velocity: Plane, now: Now) -> States:
        assert now.state is not None
        turning = now.speed + 0 * now.state[:1]
        if not self.law.states:
            return turning
        own = self.law.rates(force, displacement, velocity, _within(now))
        return jnp.concatenate([turning, own])

    def torque(self, force: Plane, displacement: Plane, velocity: Plane, now: Now) -> Number:
        return self.law.torque(force, displacement, velocity, _within(now))

    def hardness(self) -> Hardness:
        return self.law.hardness()

    def branch(self, displacement: Plane, velocity: Plane, now: Now) -> Branch:
        return self.law.branch(displacement, velocity, _within(now))

    def along(self, branch: Branch, displacement: Plane, velocity: Plane, now: Now) -> Plane:
        return self.law.along(branch, displacement, velocity, _within(now))

    def margins(self, branch: Branch, displacement: Plane, velocity: Plane, now: Now) -> Branch:
        return self.law.margins(branch, displacement, velocity, _within(now))

    def clearance(self, displacement: Plane) -> Number:
        return self.law.clearance(displacement)


def _within(now: Now) -> Now:
    """The angle that was counted, and the states of the law inside."""
    assert now.state is not None
    own = now.state[1:]
    return now._replace(angle=now.state[0], state=own if len(own) else None)


def counted(system: System) -> System:
    """The system whose laws by "turns" count them, by states behind those that all laws have."""
    total, ports = system.state_count, []
    for port in system.ports:
        laws, places, left = [], [], list(port.places)
        for stack in port.laws:
            turns, own = stack.clock == "turns", len(stack.states)
            for _ in range(count_of(stack)):
                places += [*[total] * turns, *left[:own]]
                left, total = left[own:], total + turns
            laws.append(Counted(stack) if turns else stack)
        ports.append(_with(port, laws, places))
    return dataclasses.replace(system, ports=tuple(ports))


def _with(port: Port, laws: list[AbstractLaw], places: list[int]) -> Port:
    return dataclasses.replace(port, laws=tuple(laws), places=tuple(places))
