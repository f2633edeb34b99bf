"""Elastic support of a shaft: a bearing by its stiffness and damping."""

from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from ..blocks import Blocks
from ..quantities import Scalar, nonnegative, real
from ..shafts.line import AbstractLine
from .base import AbstractLinear


class Support(AbstractLinear):
    """Linear bearing, `F = -k (1 + i cross) z - k anisotropy exp(2 i angle) z* - (same of c) z.`.

    So the stiffness is `k (1 + anisotropy)` along the axis at `angle` and `k (1 - anisotropy)`
    across it; `cross` turns the force ahead of the displacement (negative drives forward whirl).
    `angular_stiffness` and `angular_damping` hold the slope: `L = -k_a z' - c_a z'.`.
    `rotating=True`: the element turns with the shaft, its axes and its damper too, which then is
    internal damping. None is absent. Source: Klochkov, eqs. (1), (6), (7); Friswell et al. (2010).
    """

    kind: ClassVar[str] = "support"
    plural: ClassVar[str] = "supports"

    at: Scalar = nonnegative("at [m]")
    stiffness: Scalar = nonnegative("stiffness [N/m]")
    damping: Scalar = nonnegative("damping [N s/m]", default=None)
    anisotropy: Scalar = real("anisotropy [1]", default=None)
    damping_anisotropy: Scalar = real("damping_anisotropy [1]", default=None)
    angle: Scalar = real("angle [rad]", default=0.0)
    cross: Scalar = real("cross [1]", default=None)
    damping_cross: Scalar = real("damping_cross [1]", default=None)
    angular_stiffness: Scalar = nonnegative("angular_stiffness [N m/rad]", default=None)
    angular_damping: Scalar = nonnegative("angular_damping [N m s/rad]", default=None)
    rotating: bool = eqx.field(default=False, static=True)

    def __check_init__(self):
        if self.damping is None and not (self.damping_anisotropy is self.damping_cross is None):
            raise ValueError(
                "`damping_anisotropy` and `damping_cross` are fractions of `damping [N s/m]`; give it."
            )

    @classmethod
    def from_matrices(cls, at, stiffness, damping=None, rotating=False) -> "Support":
        """Support of 2 by 2 matrices `[[xx, xy], [yx, yy]]` [N/m] and [N s/m]."""
        mean, *rest = _fractions(stiffness, "stiffness")
        deviator, cross = rest
        options = {"at": at, "stiffness": mean, "rotating": rotating}
        angle = np.angle(deviator) / 2
        options |= {"anisotropy": abs(deviator) or None, "angle": angle, "cross": cross or None}
        if damping is not None:
            mean, deviator, cross = _fractions(damping, "damping")
            along = deviator * np.exp(-2j * angle)
            if abs(along.imag) > 1e-12 * (1 + abs(along)):
                raise ValueError(
                    "The principal axes of stiffness and damping differ; give them as two supports "
                    "at one station."
                )
            options |= {
                "damping": mean,
                "damping_anisotropy": along.real or None,
                "damping_cross": cross or None,
            }
        return cls(**options)

    def blocks(self, line: AbstractLine) -> Blocks:
        force = jnp.outer(line.column(self.at), line.row(self.at))
        part = lambda size, share: None if share is None else size * share * force
        turned = jnp.exp(2j * self.angle)
        deviator = lambda size, share: None if share is None else size * share * turned * force
        damping = None if self.damping is None else self.damping * force
        stiffness = self.stiffness * force
        couple = jnp.outer(line.couple_column(self.at), line.slope_row(self.at))
        if self.angular_stiffness is not None:
            stiffness = stiffness + self.angular_stiffness * couple
        if self.angular_damping is not None:
            damping = (0.0 if damping is None else damping) + self.angular_damping * couple
        frame = "rotating" if self.rotating else "fixed"
        return Blocks(
            stiffness=stiffness,
            damping=damping,
            circulatory=damping if self.rotating else None,
            skew_stiffness=part(self.stiffness, self.cross),
            skew_damping=part(self.damping, self.damping_cross),
            **{
                f"{frame}_stiffness": deviator(self.stiffness, self.anisotropy),
                f"{frame}_damping": deviator(self.damping, self.damping_anisotropy),
            },
        )


def _fractions(matrix, name: str) -> tuple[float, complex, float]:
    """Mean, and complex deviator and skew part as fractions of it."""
    matrix = np.asarray(matrix, float)
    if matrix.shape != (2, 2) or not np.isfinite(matrix).all():
        raise ValueError(f"`{name}` must be a finite 2 by 2 matrix, but is {matrix.tolist()}.")
    (xx, xy), (yx, yy) = matrix
    mean = (xx + yy) / 2
    if mean <= 0:
        raise ValueError(f"The mean of `{name}` xx and yy must be positive, but is {mean:g}.")
    return mean, complex((xx - yy) / 2, (xy + yx) / 2) / mean, (yx - xy) / 2 / mean
