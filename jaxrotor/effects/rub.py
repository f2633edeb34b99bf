"""Rub: normal force and dry friction of a rim against a viscoelastic contact of any shape."""

import abc
from typing import ClassVar, NamedTuple

import equinox as eqx
import jax.numpy as jnp

from ..core.extremes import bounded, larger, smaller
from ..core.quantities import Number, Scalar
from .base import AbstractContact
from .law import AbstractLaw, Branch, Now, Plane


class AbstractRub(AbstractContact):
    """Contact that presses the rim by `N = k p + d p.` and rubs it by `friction N`.

    `blend` [m] and `slip` [m/s] are the widths over which the force sets in and friction reverses; None
    is the sharp law.
    """

    rebounds: ClassVar[bool] = True

    gap: eqx.AbstractVar[Scalar]  # [m]
    stiffness: eqx.AbstractVar[Scalar]  # k [N/m]
    damping: eqx.AbstractVar[Scalar]  # d [N s/m]
    friction: eqx.AbstractVar[Scalar]  # [1]
    rim_radius: eqx.AbstractVar[Scalar]  # [m]
    blend: eqx.AbstractVar[Scalar | None]  # [m]
    slip: eqx.AbstractVar[Scalar | None]  # [m/s]


class Touch(NamedTuple):
    """Motion of the rim relative to a contact."""

    cos: Scalar  # of the direction outward, to the contact
    sin: Scalar  # of the same
    depth: Scalar  # penetration p [m]
    rate: Scalar  # of the penetration [m/s]
    slip: Scalar  # of the rim along the contact [m/s]
    nearness: Scalar  # of the sign and at zero the slope of the depth, smooth outside [m]


class AbstractRubLaw(AbstractLaw):
    """`F = -N (1 + i f sgn V) n`, `N = k p + d p.` while `p > 0` and `N > 0`.

    Conditions of a branch: in contact, under pressure, and slipping forward (1/2 without slip).
    """

    contact: eqx.AbstractVar[AbstractRub]  # whose law it is

    def sliding(self, now: Now) -> Number:
        """`Omega R`, less `Omega_2 (R + gap)` of another shaft around it: slip of centred shafts [m/s]."""
        rim = self.contact.rim_radius
        own = now.speed * rim
        return own if now.beside is None else own - now.beside.speed * (rim + self.contact.gap)

    @abc.abstractmethod
    def touch(self, displacement: Plane, velocity: Plane, now: Now) -> Touch:
        """Motion of the rim relative to the contact."""

    def __call__(self, displacement: Plane, velocity: Plane, now: Now) -> Plane:
        touch = self.touch(displacement, velocity, now)
        return _directed(touch, *self._forces(touch))

    def torque(self, force: Plane, displacement: Plane, velocity: Plane, now: Now) -> Number:
        touch = self.touch(displacement, velocity, now)
        return self.contact.rim_radius * (touch.cos * force[1] - touch.sin * force[0])

    @property
    def kinked(self) -> bool:
        return self.contact.blend is None or self.contact.slip is None

    def branch(self, displacement: Plane, velocity: Plane, now: Now) -> Branch:
        touch = self.touch(displacement, velocity, now)
        # At touch-down the depth may be negative by rounding; what is about to press is under pressure.
        pressed = ~(self._pressure(larger(touch.depth, 0.0), touch.rate) < 0)
        return jnp.stack([touch.depth > 0, pressed, 0.5 + 0.5 * jnp.sign(touch.slip)])

    def along(self, branch: Branch, displacement: Plane, velocity: Plane, now: Now) -> Plane:
        touch = self.touch(displacement, velocity, now)
        contact, (inside, pressed, forward) = self.contact, branch
        if contact.blend is None:
            normal = inside * pressed * self._pressure(touch.depth, touch.rate)
        else:
            normal = self._normal(touch.depth, touch.rate)
        direction = 2 * forward - 1 if contact.slip is None else self._direction(touch.slip)
        return _directed(touch, normal, contact.friction * normal * direction)

    def margins(self, branch: Branch, displacement: Plane, velocity: Plane, now: Now) -> Branch:
        touch = self.touch(displacement, velocity, now)
        contact, (inside, pressed, _) = self.contact, branch > 0
        sharp, kink = contact.blend is None, (contact.friction > 0) & (contact.slip is None)
        # Outside only the depth can change sign; inside, the pressure and the direction of friction.
        matters = jnp.stack([sharp & ~inside, sharp & inside, kink & inside & pressed])
        pressure = self._pressure(touch.depth, touch.rate)
        margins = jnp.stack([touch.nearness, pressure, touch.slip])
        return jnp.where(matters, (2 * branch - 1) * margins, jnp.inf)

    def _forces(self, touch: Touch) -> tuple[Number, Number]:
        """Normal and tangential force [N]; the tangential one is positive against forward slip."""
        normal = self._normal(touch.depth, touch.rate)
        return normal, self.contact.friction * normal * self._direction(touch.slip)

    def _pressure(self, depth: Number, rate: Number) -> Number:
        """Normal force of the sharp law, where it acts [N]."""
        return self.contact.stiffness * depth + self.contact.damping * rate

    def _normal(self, depth: Number, rate: Number) -> Number:
        contact = self.contact
        inside = depth > 0
        depth = jnp.where(inside, depth, 0.0)
        if contact.blend is None:
            force = self._pressure(depth, rate)
            return jnp.where(inside & (force > 0), force, 0.0)
        u = smaller(depth / contact.blend, 1.0)
        elastic = contact.stiffness * (depth + contact.blend * (_onset(u) - u))
        viscous = contact.damping * rate * u**3 * (10 - 15 * u + 6 * u**2)
        force = larger(elastic + viscous, 0.0)
        reach = contact.stiffness * contact.blend
        # Without stiffness there is no release to smooth.
        v = smaller(force / jnp.where(reach > 0, reach, 1.0), 1.0)
        return jnp.where(reach > 0, force + reach * (_onset(v) - v), force)

    def _direction(self, slipping: Number) -> Number:
        if self.contact.slip is None:
            return jnp.sign(slipping)
        return smoothed_sign(slipping / self.contact.slip)


def _directed(touch: Touch, normal: Number, tangential: Number) -> Plane:
    """Force on the shaft as a vector (x, y) [N]."""
    return jnp.stack(
        [
            touch.sin * tangential - touch.cos * normal,
            -touch.cos * tangential - touch.sin * normal,
        ]
    )


def smoothed_sign(u: Number) -> Number:
    """Twice continuously differentiable transition from -1 at u = -1 to 1 at u = 1."""
    u = bounded(u, -1.0, 1.0)
    return u * (15 - 10 * u**2 + 3 * u**4) / 8


def _onset(u: Number) -> Number:
    """Twice continuously differentiable transition from 0 at u = 0 to the line u at u = 1."""
    return u**3 * (6 - 8 * u + 3 * u**2)
