"""Rigid constraints of a shaft."""

from typing import Literal

import equinox as eqx

from ..core.quantities import Scalar, nonnegative
from ..core.representation import AbstractPart


class Constraint(AbstractPart):
    """Rigid constraint at a station: of the displacement (pin), the slope (guide) or both (clamp)."""

    at: Scalar = nonnegative("at [m]")
    holds: Literal["pin", "guide", "clamp"] = eqx.field(default="pin", static=True)

    def __check_init__(self):
        if self.holds not in ("pin", "guide", "clamp"):
            raise ValueError(f"`holds` must be 'pin', 'guide' or 'clamp', but is {self.holds!r}.")

    @property
    def displacement(self) -> bool:
        """Whether the displacement is held."""
        return self.holds != "guide"

    @property
    def slope(self) -> bool:
        """Whether the slope is held."""
        return self.holds != "pin"


Motion = tuple[Scalar | float, Scalar | float]  # a and b of a rigid motion `a + b x`


def motions_left(constraints: tuple[Constraint, ...]) -> list[Motion]:
    """Rigid motions of a shaft that constraints allow: displacement, and tilt about 0 or a pin."""
    pins = [one.at for one in constraints if one.displacement]
    motions: list[Motion] = [] if pins else [(1.0, 0.0)]
    if len(pins) < 2 and not any(one.slope for one in constraints):
        motions.append((-pins[0] if pins else 0.0, 1.0))
    return motions
