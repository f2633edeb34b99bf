"""Spring that hardens or softens with the cube of the displacement."""

from typing import ClassVar

import jax.numpy as jnp

from ..core.quantities import Scalar, nonnegative, real
from .base import AbstractContact, AbstractLaw, Branch, Hardness, Plane


class CubicSpring(AbstractContact):
    """What a spring along `angle` adds to its linear stiffness.

        F = -k3 u^3 e^ia,   u = Re(z e^-ia)

    `stiffness` k3 hardens above zero, softens below. It acts at once, without clearance, and is smooth.
    With it a mass on a round shaft moves along `angle` by Duffing's equation, across it linearly.
    Source: Nayfeh, Mook (1979), Nonlinear Oscillations, section 4.1.
    """

    kind: ClassVar[str] = "cubic_spring"
    plural: ClassVar[str] = "cubic_springs"

    at: Scalar = nonnegative("at [m]")
    angle: Scalar = real("angle [rad]")
    stiffness: Scalar = real("stiffness [N/m^3]")

    def law(self) -> "CubicLaw":
        return CubicLaw(jnp.cos(self.angle), jnp.sin(self.angle), self.stiffness)


class CubicLaw(AbstractLaw):
    """The law of a `CubicSpring`, its direction worked out once."""

    cos: Scalar
    sin: Scalar
    stiffness: Scalar  # [N/m^3]

    def __call__(self, displacement: Plane, velocity: Plane, speed: Scalar) -> Plane:
        u = self.cos * displacement[0] + self.sin * displacement[1]
        return -self.stiffness * u**3 * jnp.stack([self.cos, self.sin])

    def torque(self, displacement: Plane, velocity: Plane, speed: Scalar) -> Scalar:
        return jnp.zeros(())

    def hardness(self) -> Hardness:
        """None at the centre; that elsewhere, `3 k3 u^2`, steps are to be short beside is not known."""
        zero = jnp.zeros_like(self.stiffness)
        return Hardness(zero, zero, jnp.stack([self.cos, self.sin]))

    @property
    def kinked(self) -> bool:
        return False

    def branch(self, displacement: Plane, velocity: Plane, speed: Scalar) -> Branch:
        return jnp.zeros(0)

    def along(self, branch: Branch, displacement: Plane, velocity: Plane, speed: Scalar) -> Plane:
        return self(displacement, velocity, speed)

    def margins(
        self, branch: Branch, displacement: Plane, velocity: Plane, speed: Scalar
    ) -> Branch:
        return jnp.zeros(0)

    def clearance(self, displacement: Plane) -> Scalar:
        return -jnp.inf * jnp.ones(())
