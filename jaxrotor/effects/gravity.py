"""Weight of a rotor with a horizontal or inclined axis."""

from typing import ClassVar

import jax.numpy as jnp

from ..core.blocks import Blocks, Load
from ..core.quantities import Scalar, nonnegative, real
from ..shafts.line import AbstractLine
from .base import AbstractLoad


class Gravity(AbstractLoad):
    """Weight `F = m g exp(i angle)` of every mass; by default it acts downwards, along -y.

    Source: Azarov, Gouskov, Panovko (2023), force (2) of eq. (1), where weight acts along -x.
    """

    kind: ClassVar[str] = "gravity"
    plural: ClassVar[str] = "gravities"

    acceleration: Scalar = nonnegative("acceleration [m/s^2]", default=9.80665)
    angle: Scalar = real("angle [rad]", default=-jnp.pi / 2)

    def load(self, line: AbstractLine, blocks: Blocks) -> Load:
        del line
        gravity = self.acceleration * jnp.exp(1j * self.angle)
        weight = None if blocks.weight is None else gravity * blocks.weight
        turning = blocks.weight_twice
        twice = None if turning is None else jnp.conj(gravity) * turning
        return Load(constant=weight, gravity=gravity, twice=twice)
