"""Damping by the surroundings, proportional to absolute velocity."""

from typing import ClassVar

import jax.numpy as jnp

from ..blocks import Blocks
from ..quantities import Scalar, nonnegative
from ..shafts.line import AbstractLine
from .base import AbstractLinear


class ExternalDamping(AbstractLinear):
    """Shaft in a medium: `p = -d z.` per length, with `d` in N s/m^2.

    Source: Azarov, Gouskov, Panovko (2023), eq. (5); `eta_e = d l^4 / (2 sqrt(M l^3 E I))`.
    """

    kind: ClassVar[str] = "external_damping"
    plural: ClassVar[str] = "external_dampings"

    per_length: Scalar = nonnegative("per_length [N s/m^2]")

    def blocks(self, line: AbstractLine) -> Blocks:
        return Blocks(damping=self.per_length * line.forces_along())


class DiscDamping(AbstractLinear):
    """Disc in a medium: `F = -d_r z.`, `L = -d_t z'.` at its station.

    Source: Azarov, Gouskov, Panovko (2023), eqs. (1), (2); `eta_Dxi = d_r l^3 / (2 sqrt(M l^3 E I))`,
    `eta_Dtheta = d_t l / (2 sqrt(M l^3 E I))`.
    """

    kind: ClassVar[str] = "disc_damping"
    plural: ClassVar[str] = "disc_dampings"

    at: Scalar = nonnegative("at [m]")
    translational: Scalar = nonnegative("translational [N s/m]", default=0.0)
    angular: Scalar = nonnegative("angular [N m s]", default=0.0)

    def blocks(self, line: AbstractLine) -> Blocks:
        force = jnp.outer(line.column(self.at), line.row(self.at))
        couple = jnp.outer(line.couple_column(self.at), line.slope_row(self.at))
        return Blocks(damping=self.translational * force + self.angular * couple)
