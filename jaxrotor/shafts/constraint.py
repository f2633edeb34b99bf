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
