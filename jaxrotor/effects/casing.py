"""Casing: a mass beside the shaft, such as a bearing housing, a pedestal or a foundation."""

from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp

from ..core.blocks import Blocks
from ..core.quantities import Scalar, positive
from ..shafts.cased import column_of, row_of
from ..shafts.line import AbstractLine
from .base import AbstractCasing, AbstractLinear


class Casing(AbstractLinear, AbstractCasing):
    """Rigid body beside the shaft, `m z.. = - Sum of the forces of its supports`, weight included.

    It moves along x and y and does not tilt or turn, so it has a mass and no moment of inertia. Its
    displacement is a coordinate of the rotor, after those of the shaft. `Support(at, .., on=name)` stands
    on it, one or several, and so may stops, rings and oil films. `Support(of=name, ..)` holds it, on the
    ground or on another casing.
    Source: Friswell, Penny, Garvey, Lees (2010), section 6.4: flexible foundations.
    """

    kind: ClassVar[str] = "casing"
    plural: ClassVar[str] = "casings"

    name: str = eqx.field(static=True)
    mass: Scalar = positive("mass [kg]")

    def __check_init__(self):
        if not isinstance(self.name, str) or not self.name.strip():
            raise ValueError(
                f"`name` of a casing must be a text, by which supports name it, but is {self.name!r}."
            )

    def blocks(self, line: AbstractLine) -> Blocks:
        column = column_of(line, self.name)
        inertia = self.mass * jnp.outer(column, row_of(line, self.name))
        return Blocks(inertia=inertia, weight=self.mass * column)
