"""External damping by the surrounding medium, proportional to absolute velocity."""

from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp

from ..core.blocks import Blocks
from ..core.quantities import Scalar, nonnegative, number_or_nan, real, with_values
from ..shafts.line import AbstractLine
from .base import AbstractLinear


class ExternalDamping(AbstractLinear):
    """Damping of a shaft in a medium: force per length `p = -d (z. + a exp(2 i angle) z.*)`.

    `per_length` is d [N s/m^2]. With the `anisotropy` a it is `d (1 + a)` along the fixed axis at `angle`
    and `d (1 - a)` across it; None, or a value that is known to be zero, means isotropic damping.
    Source: Azarov, Gouskov, Panovko (2023), eq. (5);
    `eta_e = d l^4 / (2 sqrt(M l^3 E I))`.
    """

    kind: ClassVar[str] = "external_damping"
    plural: ClassVar[str] = "external_dampings"
    along_shaft: ClassVar[bool] = True

    per_length: Scalar = nonnegative("per_length [N s/m^2]")
    anisotropy: Scalar = real("anisotropy [1]", default=None)
    angle: Scalar = real("angle [rad]", default=0.0)
    isotropic: bool = eqx.field(init=False, static=True)  # known to be so

    def __post_init__(self):
        super().__post_init__()
        self.isotropic = number_or_nan(self.anisotropy) == 0

    def refreshed(self) -> "ExternalDamping":
        """Copy whose flag `isotropic` is derived from its current values."""
        return with_values(self, isotropic=number_or_nan(self.anisotropy) == 0)

    def blocks(self, line: AbstractLine) -> Blocks:
        damping, unequal = line.forces_along(self.per_length), None
        if not self.isotropic:
            unequal = self.anisotropy * jnp.exp(2j * self.angle) * damping
        return Blocks(damping=damping, fixed_damping=unequal)


class DiscDamping(AbstractLinear):
    """Damping of a disc in a medium: `F = -d_r z.`, `L = -d_t z'.` at its station.

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
