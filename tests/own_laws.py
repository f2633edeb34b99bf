"""Contacts of one's own: one with a state, one that turns with a cage, one that turns with the shaft."""

from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp

from jaxrotor.core.quantities import Scalar, nonnegative, real
from jaxrotor.effects.base import AbstractContact
from jaxrotor.effects.law import AbstractLaw, AbstractSmoothLaw, Hardness


class WornStop(AbstractContact):
    """Stop along x that a rim wears: `F = -k (x - g - w)`, `w. = -c F (Omega R + y.)`."""

    kind: ClassVar[str] = "worn_stop"
    plural: ClassVar[str] = "worn_stops"

    at: Scalar = nonnegative("at [m]")
    gap: Scalar = nonnegative("gap [m]")
    stiffness: Scalar = nonnegative("stiffness [N/m]")
    wear: Scalar = nonnegative("wear [1/N]")
    rim: Scalar = nonnegative("rim [m]")
    angle: Scalar = real("angle [rad]", default=0.0)
    on: str | None = eqx.field(default=None, static=True)

    def law(self):
        return WornLaw(self)


class WornLaw(AbstractLaw):
    """Law of a `WornStop`."""

    states: ClassVar[tuple[str, ...]] = ("depth [m]",)

    stop: WornStop

    @property
    def elementwise(self):
        return True

    @property
    def kinked(self):
        return True

    def _depth(self, displacement, now):
        return displacement[0] - self.stop.gap - now.state[0]

    def __call__(self, displacement, velocity, now):
        depth = self._depth(displacement, now)
        return self.along((jnp.where(depth > 0, 1.0, 0.0),), displacement, velocity, now)

    def rates(self, force, displacement, velocity, now):
        slip = now.speed * self.stop.rim + velocity[1]
        return jnp.stack([-self.stop.wear * force[0] * slip])

    def torque(self, force, displacement, velocity, now):
        return jnp.zeros(())

    def hardness(self):
        zero = jnp.zeros_like(self.stop.stiffness)
        return Hardness(self.stop.stiffness, zero, jnp.array([1.0, 0.0]), zero)

    def branch(self, displacement, velocity, now):
        return jnp.stack([jnp.where(self._depth(displacement, now) > 0, 1.0, 0.0)])

    def along(self, branch, displacement, velocity, now):
        force = -self.stop.stiffness * branch[0] * self._depth(displacement, now)
        return jnp.stack([force, jnp.zeros_like(force)])

    def margins(self, branch, displacement, velocity, now):
        return jnp.stack([(2 * branch[0] - 1) * self._depth(displacement, now)])

    def clearance(self, displacement):
        return self.stop.gap - displacement[0]


class CageForce(AbstractContact):
    """Force that turns with a cage: `F = f exp(i r theta)`."""

    kind: ClassVar[str] = "cage_force"
    plural: ClassVar[str] = "cage_forces"

    at: Scalar = nonnegative("at [m]")
    force: Scalar = nonnegative("force [N]")
    ratio: Scalar = real("ratio [1]")
    angle: Scalar = real("angle [rad]", default=0.0)
    on: str | None = eqx.field(default=None, static=True)

    def law(self):
        return CageLaw(self.force, self.ratio, self.angle)


class CageLaw(AbstractSmoothLaw):
    """Law of a `CageForce`."""

    clock: ClassVar = "cage"

    force: Scalar
    ratio: Scalar
    phase: Scalar

    @property
    def elementwise(self):
        return True

    def __call__(self, displacement, velocity, now):
        angle = self.ratio * now.angle + self.phase
        return self.force * jnp.stack([jnp.cos(angle), jnp.sin(angle)])

    def torque(self, force, displacement, velocity, now):
        return jnp.zeros(())

    def hardness(self):
        zero = jnp.zeros_like(self.force)
        return Hardness(zero, zero, jnp.zeros(2), zero)


class ShaftForce(AbstractContact):
    """Unbalance at constant speed, as a law: `F = m e Omega^2 exp(i theta)`; mapped over lanes."""

    kind: ClassVar[str] = "shaft_force"
    plural: ClassVar[str] = "shaft_forces"

    at: Scalar = nonnegative("at [m]")
    moment: Scalar = nonnegative("moment [kg m]")
    angle: Scalar = real("angle [rad]", default=0.0)
    on: str | None = eqx.field(default=None, static=True)

    def law(self):
        return ShaftLaw(self.moment)


class ShaftLaw(AbstractSmoothLaw):
    """Law of a `ShaftForce`."""

    clock: ClassVar = "shaft"

    moment: Scalar

    def __call__(self, displacement, velocity, now):
        size = self.moment * now.speed**2
        return size * jnp.stack([jnp.cos(now.angle), jnp.sin(now.angle)])

    def torque(self, force, displacement, velocity, now):
        return jnp.zeros(())

    def hardness(self):
        zero = jnp.zeros_like(self.moment)
        return Hardness(zero, zero, jnp.zeros(2), zero)
