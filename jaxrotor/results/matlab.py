"""MATLAB: data sets as files of MATLAB's version 5, which Octave and SciPy read, too."""

import re
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from .export import plain_attributes


_LONGEST = 63  # letters of a name
_RESERVED = (  # words of the language
    *("break", "case", "catch", "classdef", "continue", "else", "elseif", "end", "for", "function"),
    *(
        "global",
        "if",
        "otherwise",
        "parfor",
        "persistent",
        "return",
        "spmd",
        "switch",
        "try",
        "while",
    ),
)


def write(data: Any, path: Path) -> None:
    """Write a data set: an array for each variable, and two structs that describe them.

    `variables` has a struct with `name`, `dimensions`, `units`, `long_name`, .. for each array, under its
    name, and `attributes` has those of the data set, such as the scene. A column is a series.
    """
    from scipy.io import savemat

    names = _valid(data.variables, taken=("variables", "attributes"))
    about = {
        names[name]: {"name": str(name), "dimensions": _plain(list(map(str, one.dims)))}
        | _struct(plain_attributes(one.attrs))
        for name, one in data.variables.items()
    }
    arrays = {names[name]: _plain(one.values) for name, one in data.variables.items()}
    content = {**arrays, "variables": about, "attributes": _struct(plain_attributes(data.attrs))}
    savemat(path, content, long_field_names=True, oned_as="column")


def _struct(attributes: Mapping[Any, Any]) -> dict[str, Any]:
    """Attributes as fields of a struct."""
    names = _valid(attributes)
    return {names[name]: _plain(value) for name, value in attributes.items()}


def _plain(value: Any) -> Any:
    """Texts as cells, and all else as it is."""
    array = np.asarray(value)
    if array.ndim and array.dtype.kind not in "biufc":
        return np.array([str(one) for one in array.ravel()], object).reshape(array.shape)
    return value


def _valid(names: Iterable[Any], taken: Iterable[str] = ()) -> dict[Any, str]:
    """Names that MATLAB accepts, all different."""
    found: dict[Any, str] = {}
    for name in names:
        plain = re.sub(r"[^0-9a-zA-Z_]", "_", str(name))
        if not plain[:1].isalpha() or plain in _RESERVED:
            plain = f"x_{plain}"
        used = {*found.values(), *taken}
        found[name] = next(one for one in _numbered(plain) if one not in used)
    return found


def _numbered(name: str) -> Iterator[str]:
    """A name, cut to the letters that MATLAB tells apart, and with numbers behind it."""
    yield name[:_LONGEST]
    number = 1
    while True:
        number += 1
        ending = f"_{number}"
        yield name[: _LONGEST - len(ending)] + ending
