"""Mass unbalance."""

from typing import ClassVar

import jax.numpy as jnp

from ..blocks import Blocks, Load
from ..quantities import Scalar, nonnegative, real
from ..shafts.line import AbstractLine
from .base import AbstractLoad


class Unbalance(AbstractLoad):
    """Centre of mass off the axis: `F = m e (Omega^2 - i Omega.) exp(i (theta + phase))`.

    Source: Azarov, Gouskov, Panovko (2023), force (3) of eq. (1), for constant speed.
    """

    kind: ClassVar[str] = "unbalance"
    plural: ClassVar[str] = "unbalances"

    at: Scalar = nonnegative("at [m]")
    mass: Scalar = nonnegative("mass [kg]")
    eccentricity: Scalar = nonnegative("eccentricity [m]")
    phase: Scalar = real("phase [rad]", default=0.0)

    def load(self, line: AbstractLine, blocks: Blocks) -> Load:
        del blocks
        moment = self.mass * self.eccentricity * jnp.exp(1j * self.phase)
        return Load(unbalance=moment * line.column(self.at))
