"""Elastic support of a shaft: a bearing by its stiffness and damping."""

from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from ..blocks import Blocks
from ..quantities import Scalar, check, known, nonnegative, real
from ..shafts.line import AbstractLine
from .base import AbstractLinear


class Support(AbstractLinear):
    """Linear bearing, `F = -(k + i cross_stiffness) z - k anisotropy exp(2 i angle) z* - (same of c) z.`.

    So the stiffness is `k (1 + anisotropy)` along the axis at `angle` and `k (1 - anisotropy)`
    across it; of damping it is the same, along its own `damping_angle` (None: that of stiffness).
    `cross_stiffness` turns the force ahead of the displacement (negative drives forward whirl).
    `angular_stiffness` and `angular_damping` hold the slope: `L = -k_a z' - c_a z'.`.
    `rotating=True`: the element turns with the shaft, its axes and its damper too, which then is
    internal damping, `z. - i Omega z` for `z.`. None is absent; matrices: `from_matrices`.
    Source: Klochkov, eqs. (1), (6), (7); Friswell et al. (2010).
    """

    kind: ClassVar[str] = "support"
    plural: ClassVar[str] = "supports"

    at: Scalar = nonnegative("at [m]")
    stiffness: Scalar = nonnegative("stiffness [N/m]")
    damping: Scalar = nonnegative("damping [N s/m]", default=None)
    anisotropy: Scalar = real("anisotropy [1]", default=None)
    damping_anisotropy: Scalar = real("damping_anisotropy [1]", default=None)
    angle: Scalar = real("angle [rad]", default=0.0)
    damping_angle: Scalar = real("damping_angle [rad]", default=None)
    cross_stiffness: Scalar = real("cross_stiffness [N/m]", default=None)
    cross_damping: Scalar = real("cross_damping [N s/m]", default=None)
    angular_stiffness: Scalar = nonnegative("angular_stiffness [N m/rad]", default=None)
    angular_damping: Scalar = nonnegative("angular_damping [N m s/rad]", default=None)
    rotating: bool = eqx.field(default=False, static=True)

    def __check_init__(self):
        if self.damping is None and self.damping_anisotropy is not None:
            raise ValueError(
                "`damping_anisotropy [1]` is a fraction of `damping [N s/m]`; give it."
            )
        if self.damping_anisotropy is None and self.damping_angle is not None:
            raise ValueError(
                "`damping_angle [rad]` is that of `damping_anisotropy [1]`; give both or neither."
            )

    @classmethod
    def from_matrices(cls, at, stiffness, damping=None, rotating=False) -> "Support":
        """Support of any 2 by 2 matrices `[[xx, xy], [yx, yy]]` [N/m] and [N s/m], `xx + yy >= 0`.

        Where `xx = yy` and `xy = -yx` the axes of a matrix are not determined, so there it has no
        derivative by `xy + yx` (which comes out as zero).
        """
        mean, share, angle, cross = _parts(stiffness, "stiffness")
        options = {"stiffness": mean, "anisotropy": share, "angle": angle, "cross_stiffness": cross}
        if damping is not None:
            mean, share, angle, cross = _parts(damping, "damping")
            options |= {"damping": mean, "damping_anisotropy": share, "cross_damping": cross}
            options["damping_angle"] = None if share is None else angle
        return cls(at, **options, rotating=rotating)

    def blocks(self, line: AbstractLine) -> Blocks:
        force = jnp.outer(line.column(self.at), line.row(self.at))
        part = lambda size: None if size is None else size * force
        axis = self.angle if self.damping_angle is None else self.damping_angle
        damping, cross_damping = part(self.damping), part(self.cross_damping)
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
            skew_stiffness=part(self.cross_stiffness),
            skew_damping=cross_damping,
            skew_circulatory=cross_damping if self.rotating else None,
            **{
                f"{frame}_stiffness": part(_deviator(self.stiffness, self.anisotropy, self.angle)),
                f"{frame}_damping": part(_deviator(self.damping, self.damping_anisotropy, axis)),
            },
        )


def _deviator(mean, share, angle):
    return None if mean is None or share is None else mean * share * jnp.exp(2j * angle)


def _parts(matrix, name: str) -> tuple:
    """Mean, anisotropy, angle and cross term of a matrix; what is known to be zero is None."""
    values_known = all(map(known, jax.tree.leaves(matrix)))
    own = np if values_known else jnp
    matrix = own.asarray(matrix, float)
    if matrix.shape != (2, 2):
        raise ValueError(f"`{name}` must be a 2 by 2 matrix, but has shape {matrix.shape}.")
    (xx, xy), (yx, yy) = matrix
    mean, along, across, cross = (xx + yy) / 2, (xx - yy) / 2, (xy + yx) / 2, (yx - xy) / 2
    equal = (along == 0) & (across == 0)  # where a root and an angle have no derivative
    apart = own.where(equal, 1.0, along)
    size = own.where(equal, along, own.sqrt(apart**2 + across**2))
    held = lambda x: (mean > 0) | (x == 0)
    rule = "must be zero unless the mean of xx and yy is positive"
    size = check(size, f"anisotropic part of {name}", held, rule)
    share, angle = size / own.where(mean > 0, mean, 1.0), own.arctan2(across, apart) / 2
    if not values_known:
        return mean, share, angle, cross
    return mean, (None if equal else share), angle, cross or None
