"""Limiter: a viscoelastic stop with dry friction."""

from collections.abc import Iterable
from typing import Any, ClassVar

import jax.numpy as jnp

from ..core.extremes import bounded, larger, smaller
from ..core.quantities import Scalar, nonnegative, positive, real
from .base import AbstractContact, AbstractLaw, Branch, Hardness, Plane


class Limiter(AbstractContact):
    """Massless stop at `angle`, with a `gap` to the rim of the centred rotor.

        g = Re(z e^-ia) - gap,  N = k g + d g.  while g > 0 and N > 0 (a stop cannot pull)
        F = -N (1 + i f sgn V) e^ia,   V = Omega R + Im(z. e^-ia)   slip of the rim, R = rim_radius

    `blend` [m] smooths the onset of the force over this penetration, and the release over a force of
    `stiffness * blend`. `slip` [m/s] smooths the reversal of friction over this slip. The smoothed laws
    are twice continuously differentiable, exact outside the given width, and without force in the
    clearance; None is the published sharp law. A negative gap is a preload, which presses a centred
    rotor with `-k gap`.
    Source: Azarov, Gouskov, Panovko (2023), eq. (8), with the sign of V corrected.
    """

    kind: ClassVar[str] = "limiter"
    plural: ClassVar[str] = "limiters"

    at: Scalar = nonnegative("at [m]")
    angle: Scalar = real("angle [rad]")
    gap: Scalar = real("gap [m]")
    stiffness: Scalar = nonnegative("stiffness [N/m]")
    damping: Scalar = nonnegative("damping [N s/m]", default=0.0)
    friction: Scalar = nonnegative("friction [1]", default=0.0)
    rim_radius: Scalar = nonnegative("rim_radius [m]", default=0.0)
    blend: Scalar | None = positive("blend [m]", default=None)
    slip: Scalar | None = positive("slip [m/s]", default=None)

    @classmethod
    def at_angles(cls, angles: Iterable[Any], **parameters: Any) -> list["Limiter"]:
        """Equal stops at several angles: `Limiter.at_angles([0.0, 2.1], at=0.7, gap=3e-4, stiffness=1e7)`.

        Args:
            angles: angle of each stop [rad].
            parameters: fields that all stops share.

        Returns:
            The stops; a scene accepts the list as an effect.
        """
        return [cls(angle=angle, **parameters) for angle in angles]

    def law(self) -> "ViscoelasticStop":
        return ViscoelasticStop(jnp.cos(self.angle), jnp.sin(self.angle), self)


class ViscoelasticStop(AbstractLaw):
    """Law of a `Limiter`, with the direction computed once.

    Conditions of a branch: in contact, under pressure, and slipping forward (1/2 without slip).
    """

    cos: Scalar
    sin: Scalar
    limiter: Limiter

    def __call__(self, displacement: Plane, velocity: Plane, speed: Scalar) -> Plane:
        return self._directed(*self._forces(displacement, velocity, speed))

    def torque(self, displacement: Plane, velocity: Plane, speed: Scalar) -> Scalar:
        return -self.limiter.rim_radius * self._forces(displacement, velocity, speed)[1]

    def hardness(self) -> Hardness:
        stop = self.limiter
        outward = jnp.stack([self.cos, self.sin])
        return Hardness(stop.stiffness, stop.damping, outward, stop.friction)

    @property
    def kinked(self) -> bool:
        return self.limiter.blend is None or self.limiter.slip is None

    def branch(self, displacement: Plane, velocity: Plane, speed: Scalar) -> Branch:
        depth, closing, slipping = self._local(displacement, velocity, speed)
        pressed = self._pressure(depth, closing) > 0
        return jnp.stack([depth > 0, pressed, 0.5 + 0.5 * jnp.sign(slipping)])

    def along(self, branch: Branch, displacement: Plane, velocity: Plane, speed: Scalar) -> Plane:
        depth, closing, slipping = self._local(displacement, velocity, speed)
        stop, (inside, pressed, forward) = self.limiter, branch
        if stop.blend is None:
            normal = inside * pressed * self._pressure(depth, closing)
        else:
            normal = self._normal(depth, closing)
        direction = 2 * forward - 1 if stop.slip is None else self._direction(slipping)
        return self._directed(normal, stop.friction * normal * direction)

    def margins(
        self, branch: Branch, displacement: Plane, velocity: Plane, speed: Scalar
    ) -> Branch:
        depth, closing, slipping = self._local(displacement, velocity, speed)
        stop, (inside, pressed, _) = self.limiter, branch > 0
        sharp, kink = stop.blend is None, (stop.friction > 0) & (stop.slip is None)
        # Outside only the depth can change sign; inside, the pressure and the direction of friction.
        matters = jnp.stack([sharp & ~inside, sharp & inside, kink & inside & pressed])
        margins = jnp.stack([depth, self._pressure(depth, closing), slipping])
        return jnp.where(matters, (2 * branch - 1) * margins, jnp.inf)

    def clearance(self, displacement: Plane) -> Scalar:
        outward = self.cos * displacement[0] + self.sin * displacement[1]
        return self.limiter.gap - outward

    def _local(
        self, displacement: Plane, velocity: Plane, speed: Scalar
    ) -> tuple[Scalar, Scalar, Scalar]:
        """Penetration [m], its rate [m/s], and slip of the rim [m/s]."""
        stop = self.limiter
        outward = self.cos * displacement[0] + self.sin * displacement[1]
        closing = self.cos * velocity[0] + self.sin * velocity[1]
        slipping = speed * stop.rim_radius + self.cos * velocity[1] - self.sin * velocity[0]
        return outward - stop.gap, closing, slipping

    def _forces(self, displacement: Plane, velocity: Plane, speed: Scalar) -> tuple[Scalar, Scalar]:
        """Normal force of the stop, and friction opposite to the slip of the rim [N]."""
        depth, closing, slipping = self._local(displacement, velocity, speed)
        normal = self._normal(depth, closing)
        return normal, self.limiter.friction * normal * self._direction(slipping)

    def _directed(self, normal: Scalar, tangential: Scalar) -> Plane:
        """Force on the shaft as a vector (x, y) [N]."""
        return jnp.stack(
            [
                self.sin * tangential - self.cos * normal,
                -self.cos * tangential - self.sin * normal,
            ]
        )

    def _pressure(self, depth: Scalar, rate: Scalar) -> Scalar:
        """Normal force of the sharp law, where it acts [N]."""
        return self.limiter.stiffness * depth + self.limiter.damping * rate

    def _normal(self, depth: Scalar, rate: Scalar) -> Scalar:
        stop = self.limiter
        inside = depth > 0
        depth = jnp.where(inside, depth, 0.0)
        if stop.blend is None:
            force = self._pressure(depth, rate)
            return jnp.where(inside & (force > 0), force, 0.0)
        u = smaller(depth / stop.blend, 1.0)
        elastic = stop.stiffness * (depth + stop.blend * (_onset(u) - u))
        viscous = stop.damping * rate * u**3 * (10 - 15 * u + 6 * u**2)
        force = larger(elastic + viscous, 0.0)
        reach = stop.stiffness * stop.blend
        # Without stiffness there is no release to smooth.
        v = smaller(force / jnp.where(reach > 0, reach, 1.0), 1.0)
        return jnp.where(reach > 0, force + reach * (_onset(v) - v), force)

    def _direction(self, slipping: Scalar) -> Scalar:
        if self.limiter.slip is None:
            return jnp.sign(slipping)
        u = bounded(slipping / self.limiter.slip, -1.0, 1.0)
        return u * (15 - 10 * u**2 + 3 * u**4) / 8


def _onset(u: Scalar) -> Scalar:
    """Twice continuously differentiable transition from 0 at u = 0 to the line u at u = 1."""
    return u**3 * (6 - 8 * u + 3 * u**2)
