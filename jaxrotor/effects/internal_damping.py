"""Internal damping in the material of the shaft."""

from typing import ClassVar

from ..core.blocks import Blocks
from ..core.quantities import Scalar, nonnegative
from ..shafts.line import AbstractLine
from .base import AbstractLinear


class InternalDamping(AbstractLinear):
    """Voigt material: stress by the rate of strain in rotating axes, `K T (q. - i Omega q)`.

    `voigt_time` T is the viscous over the elastic modulus. The circulatory term drives forward whirl
    above the onset speed. Source: Azarov, Gouskov, Panovko (2023), eq. (5); `eta_i = T / (2 T*)`.
    """

    kind: ClassVar[str] = "internal_damping"
    plural: ClassVar[str] = "internal_dampings"
    along_shaft: ClassVar[bool] = True
    strains: ClassVar[bool] = True

    voigt_time: Scalar = nonnegative("voigt_time [s]")

    def blocks(self, line: AbstractLine) -> Blocks:
        viscous = self.voigt_time * line.stiffness
        unequal = line.rotating_stiffness
        return Blocks(
            damping=viscous,
            circulatory=viscous,
            rotating_damping=None if unequal is None else self.voigt_time * unequal,
        )
