"""Coaxial shaft: a second shaft around, inside or beside the first one, at a speed of its own."""

from typing import ClassVar

import equinox as eqx

from ..core.blocks import Blocks
from ..core.quantities import Scalar, real
from ..shafts.cased import from_own_end
from ..shafts.line import AbstractLine, AbstractShaft
from .base import AbstractCoaxial


class CoaxialShaft(AbstractCoaxial):
    """Shaft on the axis of the first one, `Omega_k = ratio Omega + speed`; its angle begins at `phase`.

    `Omega` is the speed of the first shaft of the scene. A negative `ratio` is counter-rotation, `ratio=0`
    with a `speed` a shaft that turns whatever the first one does. `start` is the station of its left end
    on the common axis, along which all parts of the scene are placed; `body` has stations of its own, from
    0 on.

        Scene({"lp": FlexibleShaft(..), "hp": CoaxialShaft(FlexibleShaft(..), ratio=1.3, start=0.3)},
              Disc(at=("hp", 0.45), ..), Support(at=("hp", 0.68), on="lp", ..), spin=..)

    Source: Friswell, Penny, Garvey, Lees, Dynamics of Rotating Machines (2010), section 6.6.
    """

    kind: ClassVar[str] = "coaxial_shaft"
    plural: ClassVar[str] = "coaxial_shafts"

    body: AbstractShaft
    ratio: Scalar = real("ratio [1]", default=1.0)
    speed: Scalar = real("speed [rad/s]", default=None)
    start: Scalar = real("start [m]", default=0.0)
    phase: Scalar = real("phase [rad]", default=None)
    name: str = eqx.field(static=True, default="")  # given by the scene

    def __check_init__(self):
        if not isinstance(self.body, AbstractShaft):
            raise ValueError(
                "`body` of a CoaxialShaft must be a shaft, such as a FlexibleShaft, but is "
                f"{self.body!r:.80}."
            )

    def blocks(self, line: AbstractLine) -> Blocks:
        return self.body.blocks(from_own_end(line))
