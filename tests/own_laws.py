"""Contacts of one's own, with states and with angles, for tests of laws."""

from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp

from jaxrotor.core.quantities import Scalar, nonnegative, real
from jaxrotor.effects.base import AbstractContact
from jaxrotor.effects.law import AbstractLaw, AbstractSmoothLaw, Hardness


class WornRim(AbstractContact):
    """Stop along x that a rim wears: `F = -k (x - g - w)`, `w. = -c F (Omega R + y.)`."""

    kind: ClassVar[str] = "worn_rim"
    plural: ClassVar[str] = "worn_rims"

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
    """Law of a `WornRim`."""

    states: ClassVar[tuple[str, ...]] = ("depth [m]",)

    stop: WornRim

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


class AbstractFreeLaw(AbstractSmoothLaw):
    """Law without a torque and without a stiffness that would limit the steps."""

    def torque(self, force, displacement, velocity, now):
        return jnp.zeros(())

    def hardness(self):
        zero = jnp.zeros(())
        return Hardness(zero, zero, jnp.zeros(2), zero)


class TurningForce(AbstractContact):
    """Force that turns with a cage: `F = f exp(i r theta)`."""

    kind: ClassVar[str] = "turning_force"
    plural: ClassVar[str] = "turning_forces"

    at: Scalar = nonnegative("at [m]")
    force: Scalar = nonnegative("force [N]")
    ratio: Scalar = real("ratio [1]")
    angle: Scalar = real("angle [rad]", default=0.0)
    on: str | None = eqx.field(default=None, static=True)
    repeats: bool = eqx.field(default=False, static=True)  # whether its law states its period

    def law(self):
        return TurningLaw(self.force, self.ratio, self.angle, self.repeats)


class TurningLaw(AbstractFreeLaw):
    """Law of a `TurningForce`."""

    clock: ClassVar = "turns"

    force: Scalar
    ratio: Scalar
    phase: Scalar
    repeats: bool = eqx.field(static=True)

    @property
    def elementwise(self):
        return True

    @property
    def period(self):
        return 2 * jnp.pi / jnp.abs(self.ratio) if self.repeats else None

    def __call__(self, displacement, velocity, now):
        angle = self.ratio * now.angle + self.phase
        return self.force * jnp.stack([jnp.cos(angle), jnp.sin(angle)])


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


class ShaftLaw(AbstractFreeLaw):
    """Law of a `ShaftForce`."""

    clock: ClassVar = "revolution"

    moment: Scalar

    def __call__(self, displacement, velocity, now):
        size = self.moment * now.speed**2
        return size * jnp.stack([jnp.cos(now.angle), jnp.sin(now.angle)])


class Counter(AbstractContact):
    """No force; states that grow by a rate and by twice of it."""

    kind: ClassVar[str] = "counter"
    plural: ClassVar[str] = "counters"

    at: Scalar = nonnegative("at [m]")
    rate: Scalar = nonnegative("rate [rad/s]")
    angle: Scalar = real("angle [rad]", default=0.0)
    on: str | None = eqx.field(default=None, static=True)

    def law(self):
        return CounterLaw(self.rate)


class CounterLaw(AbstractFreeLaw):
    """Law of a `Counter`."""

    states: ClassVar[tuple[str, ...]] = ("once [rad]", "twice [rad]")

    rate: Scalar

    def __call__(self, displacement, velocity, now):
        return jnp.zeros(2)

    def rates(self, force, displacement, velocity, now):
        return self.rate * jnp.array([1.0, 2.0])


class OtherCounter(AbstractContact):
    """The same as another kind, whose law has another structure."""

    kind: ClassVar[str] = "other_counter"
    plural: ClassVar[str] = "other_counters"

    at: Scalar = nonnegative("at [m]")
    rate: Scalar = nonnegative("rate [rad/s]")
    angle: Scalar = real("angle [rad]", default=0.0)
    on: str | None = eqx.field(default=None, static=True)

    def law(self):
        return OtherLaw(CounterLaw(self.rate))


class OtherLaw(AbstractFreeLaw):
    """Law of an `OtherCounter`."""

    states: ClassVar[tuple[str, ...]] = CounterLaw.states

    inner: CounterLaw

    def __call__(self, displacement, velocity, now):
        return self.inner(displacement, velocity, now)

    def rates(self, force, displacement, velocity, now):
        return self.inner.rates(force, displacement, velocity, now)


class Forgetful(AbstractContact):
    """Contact whose law has a state and no rates."""

    kind: ClassVar[str] = "forgetful"
    plural: ClassVar[str] = "forgetfuls"

    at: Scalar = nonnegative("at [m]")
    rate: Scalar = nonnegative("rate [rad/s]")
    angle: Scalar = real("angle [rad]", default=0.0)
    on: str | None = eqx.field(default=None, static=True)

    def law(self):
        return ForgetfulLaw(CounterLaw(self.rate))


class ForgetfulLaw(AbstractFreeLaw):
    """Law of a `Forgetful`."""

    states: ClassVar[tuple[str, ...]] = ("once [rad]",)

    inner: CounterLaw

    def __call__(self, displacement, velocity, now):
        return self.inner(displacement, velocity, now)


class TurningStop(AbstractContact):
    """Stop that turns with the shaft: `F = -k (u - g) exp(i theta)`, `u = Re(z exp(-i theta)) > g`."""

    kind: ClassVar[str] = "turning_stop"
    plural: ClassVar[str] = "turning_stops"

    at: Scalar = nonnegative("at [m]")
    gap: Scalar = nonnegative("gap [m]")
    stiffness: Scalar = nonnegative("stiffness [N/m]")
    angle: Scalar = real("angle [rad]", default=0.0)
    on: str | None = eqx.field(default=None, static=True)

    def law(self):
        return TurningStopLaw(self.gap, self.stiffness)


class TurningStopLaw(AbstractLaw):
    """Law of a `TurningStop`."""

    clock: ClassVar = "revolution"

    gap: Scalar
    stiffness: Scalar

    @property
    def elementwise(self):
        return True

    @property
    def kinked(self):
        return True

    def _depth(self, displacement, now):
        cos, sin = jnp.cos(now.angle), jnp.sin(now.angle)
        return cos * displacement[0] + sin * displacement[1] - self.gap

    def __call__(self, displacement, velocity, now):
        return self.along(self.branch(displacement, velocity, now), displacement, velocity, now)

    def torque(self, force, displacement, velocity, now):
        return jnp.zeros(())

    def hardness(self):
        zero = jnp.zeros_like(self.stiffness)
        return Hardness(self.stiffness, zero, jnp.zeros(2), zero)

    def branch(self, displacement, velocity, now):
        return jnp.stack([jnp.where(self._depth(displacement, now) > 0, 1.0, 0.0)])

    def along(self, branch, displacement, velocity, now):
        force = -self.stiffness * branch[0] * self._depth(displacement, now)
        return force * jnp.stack([jnp.cos(now.angle), jnp.sin(now.angle)])

    def margins(self, branch, displacement, velocity, now):
        return jnp.stack([(2 * branch[0] - 1) * self._depth(displacement, now)])

    def clearance(self, displacement):
        return self.gap - jnp.sqrt(displacement[0] ** 2 + displacement[1] ** 2)


class LimitedDrive(AbstractContact):
    """Force along the motion that a filter limits: `F = (a - s) z.`, `lag s. = |z|^2 b - s`."""

    kind: ClassVar[str] = "limited_drive"
    plural: ClassVar[str] = "limited_drives"

    at: Scalar = nonnegative("at [m]")
    gain: Scalar = nonnegative("gain [N s/m]")
    limit: Scalar = nonnegative("limit [N s/m^3]")
    lag: Scalar = nonnegative("lag [s]")
    angle: Scalar = real("angle [rad]", default=0.0)
    on: str | None = eqx.field(default=None, static=True)

    def law(self):
        return LimitedLaw(self)


class LimitedLaw(AbstractFreeLaw):
    """Law of a `LimitedDrive`."""

    states: ClassVar[tuple[str, ...]] = ("seen [N s/m]",)

    drive: LimitedDrive

    @property
    def elementwise(self):
        return True

    def __call__(self, displacement, velocity, now):
        return (self.drive.gain - now.state[0]) * velocity

    def rates(self, force, displacement, velocity, now):
        size = displacement[0] ** 2 + displacement[1] ** 2
        return ((self.drive.limit * size - now.state[0]) / self.drive.lag)[None]
