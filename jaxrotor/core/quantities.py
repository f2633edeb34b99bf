"""Physical quantities: every number of a scene is a checked, differentiable leaf.

A field is declared once, `gap: Scalar = positive("gap [m]")`: that one line gives its type, its
unit, its check, the sentence a user reads when the check fails, and a leaf jax can differentiate.
A table is a `Series`, `times: Series = series("times [s]")`: one leaf of several numbers.
"""

import dataclasses
import functools
import math
import re
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypeAlias

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Float


if TYPE_CHECKING:  # a field takes a plain number and holds an array
    Scalar: TypeAlias = Array | float
    Series: TypeAlias = Any  # a field takes any list of numbers and holds an array
else:
    Scalar = Float[Array, ""]
    Series = Float[Array, "_"]

_LABEL = re.compile(r"(?P<name>[^\[]+?) \[(?P<unit>[^\]]*)\]")


def positive(label: str, **options: Any) -> Any:
    """A number above zero; `label` is "name [unit]"."""
    checked = functools.partial(check, holds=lambda x: x > 0, rule="must be positive")
    return _quantity(label, checked, **options)


def nonnegative(label: str, **options: Any) -> Any:
    """A number that is zero or more: a strength, where zero means no effect."""
    checked = functools.partial(check, holds=lambda x: x >= 0, rule="must not be negative")
    return _quantity(label, checked, **options)


def real(label: str, **options: Any) -> Any:
    """Any finite number."""
    checked = functools.partial(check, holds=lambda x: x == x, rule="must be a finite number")
    return _quantity(label, checked, **options)


def series(label: str, *, ascending: bool = False, **options: Any) -> Any:
    """Two or more finite numbers in a row, each above the one before if `ascending`."""
    checked = functools.partial(_check_series, ascending=ascending)
    return _quantity(label, checked, many=True, **options)


def _quantity(
    label: str,
    checked: Callable[[Any, str], Any],
    default: Any = dataclasses.MISSING,
    many: bool = False,
    matrix: bool = False,
) -> Any:
    match = _LABEL.fullmatch(label)
    if match is None:
        raise ValueError(f"A quantity is labelled 'name [unit]', but is '{label}'.")

    def convert(value: Any) -> Array | None:
        if value is None and default is None:
            return None
        return checked(value, label)

    options = {} if default is dataclasses.MISSING else {"default": default}
    metadata = {"unit": match["unit"], "optional": default is None, "many": many}
    metadata |= {"matrix": matrix}
    return eqx.field(converter=convert, metadata=metadata, **options)


def check(value: Any, label: str, holds: Callable[[Any], Any], rule: str) -> Scalar:
    """`value` as a scalar array, or one sentence: at once if its value is known, else when run."""
    if isinstance(value, str | bool | complex) or value is None:
        raise ValueError(f"`{label}` must be a number, but is {value!r}.")
    if isinstance(value, Tracer):
        array = jnp.asarray(value, float)
        _check_shape(array, label)
        bad = ~(holds(array) & jnp.isfinite(array))
        return eqx.error_if(array, bad, f"`{label}` {rule} and finite.")
    try:
        # numpy: inside jit a jax array would be traced; in the precision the leaf will have
        with np.errstate(over="ignore"):
            number = np.asarray(value, float).astype(jax.dtypes.canonicalize_dtype(float))
    except (TypeError, ValueError, OverflowError):
        raise ValueError(f"`{label}` must be a number, but is {value!r}.") from None
    _check_shape(number, label)
    if not np.isfinite(number):
        raise ValueError(f"`{label}` must be a finite number, but is {number:g}.")
    if not holds(number):
        raise ValueError(f"`{label}` {rule}, but is {number:g}.")
    fits = isinstance(value, Array) and value.dtype == number.dtype and not value.weak_type
    return value if fits else jnp.asarray(number)


def _check_shape(array: Array | np.ndarray, label: str) -> None:
    if array.ndim:
        raise ValueError(
            f"`{label}` must be a single number, but has shape {array.shape}; "
            "give many values to a sweep, or map over scenes with jax.vmap."
        )


def _check_series(value: Any, label: str, ascending: bool) -> Array:
    """`value` as a row of numbers, or one sentence: at once if known, else when run."""
    wanted = f"`{label}` must be a list of two or more finite numbers"
    traced = not all(map(known, value if isinstance(value, list | tuple) else [value]))
    try:
        if isinstance(value, str | bool) or value is None:
            raise TypeError
        array = jnp.asarray(value, float) if traced else np.asarray(value, float)
    except (TypeError, ValueError, OverflowError):
        raise ValueError(f"{wanted}, but is {value!r}.") from None
    if array.ndim != 1 or array.size < 2:
        raise ValueError(f"{wanted}, but has shape {array.shape}.")
    order = f"`{label}` must be ascending, each above the one before"
    falls = array[1:] <= array[:-1]
    if traced:
        array = eqx.error_if(array, ~jnp.isfinite(array), f"{wanted}.")
        return eqx.error_if(array, falls, f"{order}.") if ascending else array
    if not np.isfinite(array).all():
        raise ValueError(f"{wanted}, but is {array.tolist()}.")
    if ascending and falls.any():
        i = int(np.argmax(falls))
        raise ValueError(f"{order}, but has {array[i]:g} and then {array[i + 1]:g}.")
    return jnp.asarray(array, float)


def as_tuple(value: Any) -> Any:
    """A list as a tuple, anything else as it is: the converter of a field that holds several parts."""
    return tuple(value) if isinstance(value, list) else value


def number_or_nan(value: Any) -> float:
    """A value as a number, None as zero; not a number where it is traced, or no number at all."""
    try:
        return 0.0 if value is None else float(value) if known(value) else math.nan
    except (TypeError, ValueError):  # the check of its field refuses it
        return math.nan


def with_values(module: Any, **values: Any) -> Any:
    """The same module with other values of fields, static ones too: no checks."""
    copy = object.__new__(type(module))
    vars(copy).update(vars(module), **values)
    return copy


def unit_of(field: dataclasses.Field) -> str | None:
    """Unit a quantity field was declared with; None for a field that is no quantity."""
    return field.metadata.get("unit")


def is_series(field: dataclasses.Field) -> bool:
    """Whether a quantity field holds several numbers."""
    return field.metadata.get("many", False)


def takes_matrix(field: dataclasses.Field) -> bool:
    """Whether a quantity field may be given as a 2 by 2 matrix, which its class takes apart."""
    return field.metadata.get("matrix", False)


def known(value: Any) -> bool:
    """Whether a leaf's value can be read now (it is not being traced)."""
    return not isinstance(value, Tracer)


def quantity_units(module: eqx.Module) -> dict[str, str]:
    """Quantity fields of a module and their units."""
    units = {field.name: unit_of(field) for field in dataclasses.fields(module)}
    return {name: unit for name, unit in units.items() if unit is not None}
