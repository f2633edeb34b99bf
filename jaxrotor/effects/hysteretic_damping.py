"""Hysteresis of the shaft's material: loss that does not depend on frequency."""

from typing import ClassVar

from ..core.blocks import Blocks
from ..core.quantities import Scalar, nonnegative
from ..shafts.line import AbstractLine
from .base import AbstractLinear


class HystereticDamping(AbstractLinear):
    """Complex stiffness `K (1 + i eta_s)` of a harmonic motion, `eta` the loss factor.

    `eta_s = +eta` for a whirl faster than the shaft turns, which it damps, and `-eta` for a slower
    or a backward one: forward whirl below the speed of rotation grows. Frequency domain only.
    Source: Brysin, Nikiforov (2019), eq. (1); `eta = d / pi` of a logarithmic decrement `d`.
    """

    kind: ClassVar[str] = "hysteretic_damping"
    plural: ClassVar[str] = "hysteretic_dampings"

    loss_factor: Scalar = nonnegative("loss_factor [1]")

    def blocks(self, line: AbstractLine) -> Blocks:
        return Blocks(hysteretic=self.loss_factor * line.stiffness)
