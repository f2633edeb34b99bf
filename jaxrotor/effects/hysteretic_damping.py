"""Hysteretic damping in the material of the shaft: a loss that does not depend on frequency."""

from typing import ClassVar

from ..core.blocks import Blocks
from ..core.quantities import Scalar, nonnegative
from ..shafts.line import AbstractLine
from .base import AbstractLinear


class HystereticDamping(AbstractLinear):
    """Complex stiffness `K (1 + i eta_s)` for harmonic motions, with the loss factor `eta`.

    `eta_s = +eta` for a whirl faster than the shaft turns, which is damped. `eta_s = -eta` for a slower or
    backward whirl, so a forward whirl slower than the rotation grows. It is for the frequency domain only.
    Source: Brysin, Nikiforov (2019), eq. (1); `eta = d / pi` with the logarithmic decrement `d`.
    """

    kind: ClassVar[str] = "hysteretic_damping"
    plural: ClassVar[str] = "hysteretic_dampings"
    strains: ClassVar[bool] = True

    loss_factor: Scalar = nonnegative("loss_factor [1]")

    def blocks(self, line: AbstractLine) -> Blocks:
        return Blocks(hysteretic=self.loss_factor * line.stiffness)
