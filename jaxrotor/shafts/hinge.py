"""Hinge: a jump of slope in a flexible line, whose nodes have the same slope on both sides.

    K q - K t phi = loads,   M = t'K q - (t'K t) phi

`phi` is the jump, `M` the bending moment there, `K` the stiffness of the intact line. Of the deflection
`t` by a jump of one, which is straight on both sides, nodes have the mean of both slopes at the hinge.
So next to it, half a jump of slope is strained away on each side, which is all there is of `K t`. As
Lobatto nodes leave little of that out, the error falls with the third power of their number.
"""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from ..core.quantities import Scalar
from .cased import CasedLine
from .line import AbstractLine, AbstractSpectralLine


class Hinge(NamedTuple):
    """Row of the moment `t'K q`, term of a unit jump of slope in the equations, and stiffness `t'K t`."""

    row: Float[Array, " n"]  # [N m]
    column: Float[Array, " r"]
    stiffness: Scalar  # [N m]


def hinge(line: AbstractLine, at: Scalar) -> Hinge:
    """The hinge of a line at a station where spans meet."""
    if isinstance(line, CasedLine):
        row, column, stiffness = hinge(line.line, at)
        beside = (0, len(line.names))
        return Hinge(jnp.pad(row, beside), jnp.pad(column, beside), stiffness)
    if not isinstance(line, AbstractSpectralLine):
        raise ValueError(
            "A hinge bends a flexible shaft with spans, but this shaft has none; take a FlexibleShaft "
            'with rule="spectral", or give the `loss` of stiffness at the station.'
        )
    middles = (line.ends[1:] + line.ends[:-1]) / 2
    turned = line.ends[-1] ** 2 * line.slope_row(at)  # coordinates of a slope of one at the node
    row = line.energy_in(jnp.where(middles < at, -0.5, 0.5)) @ turned
    stiffness = turned @ line.energy_in(jnp.full_like(middles, 0.25)) @ turned
    return Hinge(row, line.deflection(row), stiffness)
