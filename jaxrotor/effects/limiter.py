"""Limiter: a viscoelastic stop with dry friction."""

from collections.abc import Iterable
from typing import Any, ClassVar

import equinox as eqx
import jax.numpy as jnp

from ..core.quantities import Number, Scalar, nonnegative, positive, real
from .coefficients import is_zero
from .law import Hardness, Now, Plane
from .rub import AbstractRub, AbstractRubLaw, Touch


class Limiter(AbstractRub):
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
    on: str | None = eqx.field(default=None, static=True)  # name of a casing; None: the ground

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

    @property
    def reason_between(self) -> str | None:
        if is_zero(self.friction):
            return None
        return (
            "but a stop along one direction turns with neither, so its friction is none of theirs; take "
            "an AnnularStator, or leave `friction [1]` out"
        )

    def law(self) -> "ViscoelasticStop":
        return ViscoelasticStop(cos=jnp.cos(self.angle), sin=jnp.sin(self.angle), contact=self)


class ViscoelasticStop(AbstractRubLaw):
    """Law of a `Limiter`, with the direction computed once."""

    cos: Scalar
    sin: Scalar
    contact: Limiter

    @property
    def elementwise(self) -> bool:
        return True

    def touch(self, displacement: Plane, velocity: Plane, now: Now) -> Touch:
        stop = self.contact
        outward = self.cos * displacement[0] + self.sin * displacement[1]
        closing = self.cos * velocity[0] + self.sin * velocity[1]
        slipping = self.sliding(now) + self.cos * velocity[1] - self.sin * velocity[0]
        depth = outward - stop.gap
        return Touch(self.cos, self.sin, depth, closing, slipping, depth)

    def hardness(self) -> Hardness:
        stop = self.contact
        outward = jnp.stack([self.cos, self.sin])
        return Hardness(stop.stiffness, stop.damping, outward, stop.friction)

    def clearance(self, displacement: Plane) -> Number:
        outward = self.cos * displacement[0] + self.sin * displacement[1]
        return self.contact.gap - outward
