"""Loose pedestal: a body that its foundation presses and bolts pull, with a play between them."""

from collections.abc import Callable
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from ..core.blocks import Blocks
from ..core.extremes import larger
from ..core.quantities import Number, Scalar, nonnegative, positive, real
from ..shafts.cased import column_of, row_of
from ..shafts.line import AbstractLine
from .base import AbstractCasing, AbstractContact, AbstractLinear, OwnPort
from .law import AbstractLaw, Branch, Hardness, Now, Plane


class LoosePedestal(AbstractLinear, AbstractCasing, AbstractContact):
    """Casing that may lift off its foundation, until bolts hold it back.

        N = k u + c u.              while u > 0 and N > 0,   u = Re(z e^(-i angle))
        B = k_b b + c_b b.          while b > 0 and B > 0,   b = -u - play
        F = (B - N) e^(i angle) - i (k v + c v.) e^(i angle),   v = Im(z e^(-i angle))

    `angle` points to the foundation, whose `stiffness` k and `damping` c also hold the pedestal across,
    where it is not loose. Nothing acts within the `play` of the bolts, of `bolt_stiffness` and
    `bolt_damping`. It is a `Casing` in all else: it has a `mass` with weight, and supports of the shaft
    stand `on` its name.

    The equations have the foundation as if it pressed always, for roots and as the linear part of motions;
    the law has the difference. So linear analyses are those of a pedestal that is pressed, and the
    contact force of a motion is that difference: zero while the foundation presses, and not the force on
    it. The time in contact is that off the foundation. A foundation takes up pressure with a jump of the
    force where `c u.` is not zero, and there located steps end.
    Source: Goldman, Muszynska (1991), Trans. ASME J. Vib. Acoust. 113, of a loose pedestal.
    """

    kind: ClassVar[str] = "loose_pedestal"
    plural: ClassVar[str] = "loose_pedestals"
    by_speed: ClassVar[bool] = True
    rebounds: ClassVar[bool] = True

    name: str = eqx.field(static=True)  # by which supports refer to it
    mass: Scalar = positive("mass [kg]")
    stiffness: Scalar = positive("stiffness [N/m]")  # of the foundation
    damping: Scalar = nonnegative("damping [N s/m]")
    bolt_stiffness: Scalar = nonnegative("bolt_stiffness [N/m]")
    bolt_damping: Scalar = nonnegative("bolt_damping [N s/m]", default=0.0)
    play: Scalar = nonnegative("play [m]", default=0.0)  # of the bolts
    angle: Scalar = real("angle [rad]", default=-np.pi / 2)  # to the foundation
    at: ClassVar[None] = None  # no station of the shaft
    on: ClassVar[None] = None  # the ground

    def blocks(self, line: AbstractLine) -> Blocks:
        column, row = column_of(line, self.name), row_of(line, self.name)
        across = jnp.outer(column, row)
        return Blocks(
            inertia=self.mass * across,
            damping=self.damping * across,
            stiffness=self.stiffness * across,
            weight=self.mass * column,
        )

    @property
    def own_port(self) -> Callable[[AbstractLine], OwnPort]:
        return lambda line: OwnPort(row_of(line, self.name), column_of(line, self.name), self.law())

    def law(self) -> "PedestalLaw":
        return PedestalLaw(jnp.cos(self.angle), jnp.sin(self.angle), self)


class PedestalLaw(AbstractLaw):
    """Law of a `LoosePedestal`, less that of a foundation that presses and pulls.

    Conditions: on the foundation, under its pressure, at the bolts, under their tension.
    """

    cos: Scalar
    sin: Scalar
    pedestal: LoosePedestal

    @property
    def elementwise(self) -> bool:
        return True

    @property
    def kinked(self) -> bool:
        return True

    def _sides(self, displacement: Plane, velocity: Plane) -> tuple[Number, ...]:
        """Depth and force of the foundation, of the bolts, with either sign."""
        own = self.pedestal
        u = self.cos * displacement[0] + self.sin * displacement[1]
        rate = self.cos * velocity[0] + self.sin * velocity[1]
        away = -u - own.play
        bolts = own.bolt_stiffness * away - own.bolt_damping * rate
        return u, own.stiffness * u + own.damping * rate, away, bolts

    def __call__(self, displacement: Plane, velocity: Plane, now: Now) -> Plane:
        return self.along(self.branch(displacement, velocity, now), displacement, velocity, now)

    def branch(self, displacement: Plane, velocity: Plane, now: Now) -> Branch:
        return jnp.stack(
            [jnp.where(side > 0, 1.0, 0.0) for side in self._sides(displacement, velocity)]
        )

    def along(self, branch: Branch, displacement: Plane, velocity: Plane, now: Now) -> Plane:
        down, pressed, up, pulled = branch
        _, pressure, _, tension = self._sides(displacement, velocity)
        force = up * pulled * tension + (1 - down * pressed) * pressure
        return jnp.stack([self.cos * force, self.sin * force])

    def margins(self, branch: Branch, displacement: Plane, velocity: Plane, now: Now) -> Branch:
        down, _, up, _ = branch > 0
        # Off a side only its depth can change sign, at it only its force.
        matters = jnp.stack([~down, down, ~up, up])
        sides = jnp.stack(self._sides(displacement, velocity))
        return jnp.where(matters, (2 * branch - 1) * sides, jnp.inf)

    def torque(self, force: Plane, displacement: Plane, velocity: Plane, now: Now) -> Number:
        return jnp.zeros(())

    def hardness(self) -> Hardness:
        own = self.pedestal
        stiff = larger(own.stiffness, own.bolt_stiffness)
        damping = larger(own.damping, own.bolt_damping)
        return Hardness(stiff, damping, jnp.stack([self.cos, self.sin]), jnp.zeros_like(stiff))

    def clearance(self, displacement: Plane) -> Number:
        return -jnp.inf * jnp.ones(())
