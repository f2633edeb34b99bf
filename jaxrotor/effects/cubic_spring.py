"""Cubic spring, whose force is proportional to the cube of the displacement."""

from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp

from ..core.quantities import Number, Scalar, nonnegative, real
from .base import AbstractContact
from .law import AbstractSmoothLaw, Hardness, Now, Plane


class CubicSpring(AbstractContact):
    """Cubic part of the force of a spring along `angle`.

        F = -k3 u^3 e^ia,   u = Re(z e^-ia)

    A positive `stiffness` k3 hardens the spring, a negative one softens it. The force is smooth and acts
    without clearance. A mass on a round shaft then moves along `angle` by Duffing's equation, and
    linearly across it.
    Source: Nayfeh, Mook (1979), Nonlinear Oscillations, section 4.1.
    """

    kind: ClassVar[str] = "cubic_spring"
    plural: ClassVar[str] = "cubic_springs"

    at: Scalar = nonnegative("at [m]")
    angle: Scalar = real("angle [rad]")
    stiffness: Scalar = real("stiffness [N/m^3]")
    on: str | None = eqx.field(default=None, static=True)  # name of a casing; None: the ground

    def law(self) -> "CubicLaw":
        return CubicLaw(jnp.cos(self.angle), jnp.sin(self.angle), self.stiffness)


class CubicLaw(AbstractSmoothLaw):
    """Law of a `CubicSpring`, with the direction computed once."""

    cos: Scalar
    sin: Scalar
    stiffness: Scalar  # [N/m^3]

    @property
    def elementwise(self) -> bool:
        return True

    def __call__(self, displacement: Plane, velocity: Plane, now: Now) -> Plane:
        u = self.cos * displacement[0] + self.sin * displacement[1]
        return -self.stiffness * u**3 * jnp.stack([self.cos, self.sin])

    def torque(self, force: Plane, displacement: Plane, velocity: Plane, now: Now) -> Number:
        return jnp.zeros(())

    def hardness(self) -> Hardness:
        """Zero, as at the centre; elsewhere it is `3 k3 u^2`, which does not limit the steps."""
        zero = jnp.zeros_like(self.stiffness)
        return Hardness(zero, zero, jnp.stack([self.cos, self.sin]), zero)
