"""Rayleigh damping: in proportion to mass and stiffness, as finite-element codes have it."""

from typing import ClassVar

from ..core.blocks import Blocks
from ..core.quantities import Scalar, nonnegative
from ..shafts.line import AbstractLine
from .base import AbstractDamping


class RayleighDamping(AbstractDamping):
    """`C = alpha M + beta K`, `alpha = mass`, `beta = stiffness`, in fixed axes: it does not turn.

    `M` is the inertia of everything with mass, such as shaft and discs, with their rotary inertia. `K` is
    the elastic stiffness of the shaft, the mean one if its axes are unequal; bearings have damping of
    their own. On rigid bearings the mode of natural frequency `omega` has the damping ratio
    `alpha / (2 omega) + beta omega / 2`. Unlike `InternalDamping` it adds no circulatory term and drives
    no whirl.
    Source: Clough, Penzien, Dynamics of Structures (1993), section 12-5: Rayleigh damping.
    """

    kind: ClassVar[str] = "rayleigh_damping"
    plural: ClassVar[str] = "rayleigh_dampings"
    strains: ClassVar[bool] = True

    mass: Scalar = nonnegative("mass [1/s]", default=0.0)
    stiffness: Scalar = nonnegative("stiffness [s]", default=0.0)

    def damping(self, line: AbstractLine, blocks: Blocks, motion: Blocks) -> Blocks:
        del motion
        damping = self.stiffness * line.stiffness
        if blocks.inertia is not None:
            damping = damping + self.mass * blocks.inertia
        return Blocks(damping=damping)
