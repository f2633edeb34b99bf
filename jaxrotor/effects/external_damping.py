"""Damping by the surroundings, proportional to absolute velocity."""

from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp

from ..core.blocks import Blocks
from ..core.quantities import Scalar, nonnegative, number_or_nan, real, with_values
from ..shafts.line import AbstractLine
from .base import AbstractLinear


class ExternalDamping(AbstractLinear):
    """Shaft in a medium: `p = -d (z. + a exp(2 i angle) z.*)` per length, with `d` in N s/m^2.

    `anisotropy` a: `d (1 + a)` along the axis at `angle` and `d (1 - a)` across it, fixed in space;
    None, or a value known to be zero, is the same along every axis.
    Source: Azarov, Gouskov, Panovko (2023), eq. (5);
    `eta_e = d l^4 / (2 sqrt(M l^3 E I))`.
    """

    kind: ClassVar[str] = "external_damping"
    plural: ClassVar[str] = "external_dampings"

    per_length: Scalar = nonnegative("per_length [N s/m^2]")
    anisotropy: Scalar = real("anisotropy [1]", default=None)
    angle: Scalar = real("angle [rad]", default=0.0)
    isotropic: bool = eqx.field(init=False, static=True)  # as far as is known

    def __post_init__(self):
        self.isotropic = number_or_nan(self.anisotropy) == 0

    def refreshed(self) -> "ExternalDamping":
        """The same, noted anew whether it is isotropic: for a change of values."""
        return with_values(self, isotropic=number_or_nan(self.anisotropy) == 0)

    def blocks(self, line: AbstractLine) -> Blocks:
        damping, unequal = line.forces_along(self.per_length), None
        if not self.isotropic:
            unequal = self.anisotropy * jnp.exp(2j * self.angle) * damping
        return Blocks(damping=damping, fixed_damping=unequal)


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
