"""Printed form of the parts of a scene."""

import dataclasses
from typing import Any

import equinox as eqx
import numpy as np

from .quantities import known, unit_of


_MOST = 6  # numbers of a table to show


class AbstractPart(eqx.Module):
    """Part of a scene, whose `repr` shows its values with units: `Disc(at=0.5 m, mass=10 kg)`.

    Fields with their default value are left out. A traced value is shown as jax shows it.
    """

    def __repr__(self) -> str:
        shown = []
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            if field.init and not _is_default(value, field):
                shown.append(f"{field.name}={_field(value, unit_of(field))}")
        return f"{type(self).__name__}({', '.join(shown)})"


def number_text(value: Any) -> str:
    """Text of one number or several; the `str` or `repr` of anything else, such as a traced value."""
    if value is None or not known(value):
        return str(value)
    try:
        array = np.asarray(value, float)
    except (TypeError, ValueError):
        return repr(value)
    if array.ndim == 0:
        return f"{array:.6g}"
    texts = [f"{one:.6g}" for one in array.ravel()]
    if len(texts) > _MOST:
        texts = [*texts[: _MOST // 2], "..", texts[-1]]
    return f"[{', '.join(texts)}]" + ("" if array.ndim == 1 else f" of shape {array.shape}")


def _field(value: Any, unit: str | None) -> str:
    if unit is None:
        if isinstance(value, tuple):
            return f"[{', '.join(map(repr, value))}]"
        return repr(value)
    return number_text(value) + ("" if unit == "1" else f" {unit}")


def _is_default(value: Any, field: dataclasses.Field) -> bool:
    default = field.default
    if field.default_factory is not dataclasses.MISSING:
        default = field.default_factory()
    if default is dataclasses.MISSING:
        return False
    if value is None or default is None:
        return value is default
    if isinstance(default, bool):
        return known(value) and bool(value) == default
    if unit_of(field) is None:
        return repr(value) == repr(default)
    return known(value) and np.ndim(value) == 0 and number_text(value) == number_text(default)
