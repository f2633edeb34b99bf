"""Attributes: unit and long name of a labelled array, and the meaning of its flags."""

from collections.abc import Sequence
from typing import Any

import numpy as np


def about(units: str, long_name: str) -> dict[str, str]:
    """Attributes of a variable: its unit, and its name in words."""
    return {"units": units, "long_name": long_name}


def variable(dims: str | Sequence[str], values: Any, units: str, long_name: str) -> tuple:
    """A variable of `xarray` along dimensions, with its unit and its name in words."""
    return dims, np.asarray(values), about(units, long_name)


def flags(long_name: str, meanings: Sequence[str]) -> dict[str, Any]:
    """Attributes of a variable of whole numbers, each the place of its meaning in `meanings`.

    Source: CF conventions 1.11, section 3.5.
    """
    numbers = list(range(len(meanings)))
    return {"long_name": long_name, "flag_values": numbers, "flag_meanings": " ".join(meanings)}
