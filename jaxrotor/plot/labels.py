"""Labels: the swept parameters of a dataset, in the unit they are drawn in."""

import re

import numpy as np
import xarray as xr
from jaxtyping import Shaped


_DRAWN = {"m": ("mm", 1e3)}  # SI unit -> unit on paper, factor


def swept(dataset: xr.Dataset, variable: str, own: tuple[str, ...] = ()) -> list[str]:
    """Dimensions of `variable` that were swept: all but its `own`."""
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


def coordinate(dataset: xr.Dataset, dim: str) -> tuple[Shaped[np.ndarray, " N"], str]:
    """Values of a swept parameter as drawn, and its axis label "name [unit]"."""
    array = dataset[dim]
    unit = str(array.attrs.get("units", "1"))
    unit, factor = _DRAWN.get(unit, (unit, None))
    values = array.values if factor is None else array.values * factor
    name = str(array.attrs.get("long_name", re.sub(r"[._]", " ", dim)))
    return values, f"{name} [{_raised(unit)}]"


def _raised(unit: str) -> str:
    """`kg/m^3` with its power raised."""
    return re.sub(r"\^(-?\d+)", r"$^{\1}$", unit)
