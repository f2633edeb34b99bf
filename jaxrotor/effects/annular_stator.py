"""Annular stator: a viscoelastic ring around the rotor, with dry friction."""

from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp

from ..core.quantities import Number, Scalar, nonnegative, positive, real
from .coefficients import is_zero
from .law import Hardness, Now, Plane
from .rub import AbstractRub, AbstractRubLaw, Touch


class AnnularStator(AbstractRub):
    """Ring around the rim, with a radial `gap` to the centred rim.

        r = z - offset e^(i angle),   rho = |r|,   n = r / rho,   p = rho - gap
        N = k p + d p.   while p > 0 and N > 0 (a ring cannot pull)
        F = -N (1 + i f sgn V) n,   V = Omega R + Im(r. n*)   slip of the rim, R = rim_radius

    The rim stays round and the ring yields where it is touched. Its mount is rigid, or it stands `on` a
    `Casing` of its own mass and suspension, to which `z` is then relative. `on` another shaft around this
    one it turns with that, `V = Omega R - Omega_2 (R + gap) + Im(r. n*)`, and that shaft feels the torque
    `f N (R + gap) sgn V`. `offset` and `angle` place the
    centre of the ring. `blend` [m] and `slip` [m/s] smooth the force and the reversal of friction as in
    `Limiter`; a rim that rolls (V = 0) needs `slip`, since with the sharp law it changes between both
    directions of friction for ever. A ring without gap is in contact always. A ring differs from many
    `Limiter` round a circle, whose common force grows as the depth to the power 3/2.
    Source: Black (1968), J. Mech. Eng. Sci. 10, pp. 1-12, with the velocity of the rotor's centre in V.
    """

    kind: ClassVar[str] = "annular_stator"
    plural: ClassVar[str] = "annular_stators"

    at: Scalar = nonnegative("at [m]")
    gap: Scalar = nonnegative("gap [m]")
    stiffness: Scalar = nonnegative("stiffness [N/m]")
    damping: Scalar = nonnegative("damping [N s/m]", default=0.0)
    friction: Scalar = nonnegative("friction [1]", default=0.0)
    rim_radius: Scalar = nonnegative("rim_radius [m]", default=0.0)
    offset: Scalar = nonnegative("offset [m]", default=0.0)
    angle: Scalar = real("angle [rad]", default=0.0)
    blend: Scalar | None = positive("blend [m]", default=None)
    slip: Scalar | None = positive("slip [m/s]", default=None)
    on: str | None = eqx.field(default=None, static=True)  # name of a casing; None: the ground

    @property
    def eccentric(self) -> Scalar:
        return self.offset

    @property
    def reason_between(self) -> str | None:
        if is_zero(self.friction) or not is_zero(self.rim_radius) and is_zero(self.offset):
            return None
        return (
            "whose surfaces slip by the speeds of both; give `rim_radius [m]`, that of the inner shaft, "
            "without an `offset`, or leave `friction [1]` out"
        )

    def law(self) -> "ViscoelasticRing":
        x, y = self.offset * jnp.cos(self.angle), self.offset * jnp.sin(self.angle)
        return ViscoelasticRing(x=x, y=y, contact=self)


class ViscoelasticRing(AbstractRubLaw):
    """Law of an `AnnularStator`, with its centre computed once."""

    x: Scalar
    y: Scalar
    contact: AnnularStator

    @property
    def elementwise(self) -> bool:
        return True

    def touch(self, displacement: Plane, velocity: Plane, now: Now) -> Touch:
        ring = self.contact
        radius, cos, sin, _ = _polar(displacement[0] - self.x, displacement[1] - self.y)
        slipping = self.sliding(now) + cos * velocity[1] - sin * velocity[0]
        # The radius has a kink in the centre, which cubics along a step misread; its square has none.
        twice = 2 * jnp.where(ring.gap > 0, ring.gap, 1.0)
        nearness = (radius**2 - ring.gap**2) / twice
        closing = cos * velocity[0] + sin * velocity[1]
        return Touch(cos, sin, radius - ring.gap, closing, slipping, nearness)

    def hardness(self) -> Hardness:
        """The same in every direction, which a zero vector stands for."""
        ring = self.contact
        return Hardness(ring.stiffness, ring.damping, jnp.zeros(2), ring.friction)

    def clearance(self, displacement: Plane) -> Number:
        return self.contact.gap - _polar(displacement[0] - self.x, displacement[1] - self.y)[0]


@jax.custom_jvp
def _polar(x: Number, y: Number) -> tuple[Number, Number, Number, Number]:
    """Length of a vector, cosine and sine of its direction, and the inverse of the length.

    A length below all others added in the origin makes derivatives of every order finite there, and those
    of `length * cos` exact. One root and no division is all that a step has to wait for.
    """
    square = x**2 + y**2
    square = square + jnp.finfo(jnp.result_type(square)).tiny ** (2 / 3)
    inverse = jax.lax.rsqrt(square)
    return square * inverse, x * inverse, y * inverse, inverse


@_polar.defjvp
def _polar_derivative(at, along):
    found = _polar(*at)
    (_, cos, sin, inverse), (dx, dy) = found, along
    outward = cos * dx + sin * dy
    turned = (dx - cos * outward) * inverse, (dy - sin * outward) * inverse
    return found, (outward, *turned, -(inverse**2) * outward)
