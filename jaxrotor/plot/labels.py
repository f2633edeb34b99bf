"""Labels: axis labels with units, and descriptions of roots."""

import re
from typing import Any

import numpy as np
import xarray as xr
from jaxtyping import Shaped

from ..equations.pencil import is_rounding
from ..results.provenance import ensemble_of
from .units import length_unit, speed_unit


def swept(dataset: xr.Dataset, variable: str, own: tuple[str, ...] = ()) -> list[str]:
    """Swept dimensions of `variable`: all but its `own`."""
    if variable not in dataset:
        raise ValueError(
            f"The dataset has no `{variable}`; run the sweep with an observable that yields "
            f"`{variable}` in its `observe=`."
        )
    return [str(dim) for dim in dataset[variable].dims if dim not in own]


def only_swept(dataset: xr.Dataset, variable: str, own: tuple[str, ...] = ()) -> str:
    """The one swept dimension of `variable`."""
    dims = swept(dataset, variable, own)
    if len(dims) != 1:
        named = ", ".join(f"'{dim}'" for dim in dims) or "none"
        todo = "keep one of them; select the others with `.sel` or `.isel`"
        raise ValueError(
            f"This plot takes one swept dimension, but `{variable}` has {named}; "
            f"{todo if dims else 'select a range, not a single value'}."
        )
    return dims[0]


def ensemble(dataset: xr.Dataset, variable: str, own: tuple[str, ...] = ()) -> tuple[str, ...]:
    """Dimensions that distinguish lanes of equal parameters (starts, branch); none if all are such."""
    dims = swept(dataset, variable, own)
    found = ensemble_of(dims)
    return found if len(found) < len(dims) else ()


def coordinate(dataset: xr.Dataset, dim: str) -> tuple[Shaped[np.ndarray, " N"], str]:
    """Values of a swept parameter in the unit drawn, and its axis label "name [unit]"."""
    array = dataset[dim]
    name = str(array.attrs.get("long_name", words(dim)))
    factor, label = parameter(name, str(array.attrs.get("units", "1")), array.values)
    return array.values if factor == 1 else array.values * factor, label


def spin(name: str, speeds: Any) -> str:
    """Axis label "name [unit]" of speeds of rotation, which says where the rotor turns backward."""
    ahead, back = np.max(speeds, initial=0.0) > 0, np.min(speeds, initial=0.0) < 0
    sense = (", negative sense", ", both senses")[int(ahead)] if back else ""
    return f"{name} [{speed_unit()[1]}]{sense}"


def parameter(name: str, unit: str, values: Any = 0.0) -> tuple[float, str]:
    """Factor from SI to the unit drawn, and axis label "name [unit]" of a parameter with some values."""
    factor = 1.0
    if name == "spin speed":
        return speed_unit()[0], spin(name, values)
    if unit == "m":
        factor, unit = length_unit("mm")
    elif unit == "rad/s":
        factor, unit = speed_unit()
    unit = re.sub(r"\^(-?\d+)", r"$^{\1}$", unit)  # exponents as in kg/m^3
    return factor, f"{name} [{unit}]"


def length(values: Any) -> tuple[float, str]:
    """Factor from m to the unit drawn, and that unit, for displacements `x`, or `z = x + i y`."""
    largest = np.nanmax(np.abs(values), initial=0.0)
    return length_unit("\N{MICRO SIGN}m" if largest < 1e-4 else "mm")


def words(path: str) -> str:
    """A path as words: `spin.speed` is "spin speed"."""
    return re.sub(r"[._]", " ", path)


def number(value: float) -> str:
    """Text of a speed, with four digits, whole from 10 000 on."""
    return f"{value:.4g}" if abs(value) < 1e4 else f"{value:.0f}"


def root(value: complex) -> str:
    """Description of a root, such as "77 rad/s, decay 5.04 /s"."""
    turns, unit = speed_unit()
    whirl = f"{number(turns * abs(value.imag))} {unit}" if whirls(value) else "no whirl"
    if is_rounding(value.real, value):
        return f"{whirl}, undamped"
    return f"{whirl}, {'growth' if value.real > 0 else 'decay'} {abs(value.real):.3g} /s"


def whirls(value: complex) -> bool:
    """Whether the imaginary part of a root exceeds rounding."""
    return not is_rounding(value.imag, value)
