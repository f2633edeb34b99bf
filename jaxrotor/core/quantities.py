"""Physical quantities: every number of a scene is a checked, differentiable leaf.

A field is declared once, `gap: Scalar = positive("gap [m]")`. That line gives its type, its unit, its
check, the error message, and a leaf that jax can differentiate. A table of numbers is one leaf too:
`times: Series = series("times [s]")`. A number that may be a table, over nodes that another field has,
is `kxx: Tabled = real("kxx [N/m]", table=True)`.
"""

import dataclasses
import functools
import math
import re
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, TypeAlias

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Float


if TYPE_CHECKING:  # a field accepts a plain number and stores an array
    Scalar: TypeAlias = Array | float
    Number: TypeAlias = Array | float
    Series: TypeAlias = Any  # a field accepts any list of numbers and stores an array
    Tabled: TypeAlias = Any
else:
    Scalar = Float[Array, ""]
    Number = Float[Array, "..."]  # of one motion, or of lanes
    Series = Float[Array, "_"]
    Tabled = Scalar | Series | Float[Array, "_ _"]

COUNTED = {1: "one", 2: "two"}  # words of the smallest counts of a list


class Taken(NamedTuple):
    """Value of an absent quantity, where another quantity of the same module implies it."""

    source: str  # name of the other quantity
    formula: str  # as people read it
    value: Callable[[Any], Any] = lambda other: other


_LABEL = re.compile(r"(?P<name>[^\[]+?) \[(?P<unit>[^\]]*)\]")


def positive(label: str, **options: Any) -> Any:
    """Field for a positive number.

    Args:
        label: name and unit, "gap [m]".
        options: `default`, the value of the field if it is not given; None: the field may be absent.
            `taken`, what is then taken for it, a `Taken`.

    Returns:
        The field of an `equinox.Module`.
    """
    checked = functools.partial(check, holds=lambda x: x > 0, rule="must be positive")
    return _quantity(label, checked, **options)


def nonnegative(label: str, **options: Any) -> Any:
    """Field for a number that is zero or positive, such as a strength, where zero means no effect.

    Args:
        label: name and unit, "stiffness [N/m]".
        options: as of `positive`.

    Returns:
        The field of an `equinox.Module`.
    """
    checked = functools.partial(check, holds=lambda x: x >= 0, rule="must not be negative")
    return _quantity(label, checked, **options)


def at_least(label: str, least: float, **options: Any) -> Any:
    """Field for a number that is not below `least`.

    Args:
        label: name and unit, "exponent [1]".
        least: smallest allowed number.
        options: as of `positive`.

    Returns:
        The field of an `equinox.Module`.
    """
    rule = f"must not be below {least:g}"
    return _quantity(
        label, functools.partial(check, holds=lambda x: x >= least, rule=rule), **options
    )


def real(label: str, **options: Any) -> Any:
    """Field for any finite number.

    Args:
        label: name and unit, "angle [rad]".
        options: as of `positive`, and `table`, whether a list of numbers is accepted too.

    Returns:
        The field of an `equinox.Module`.
    """
    checked = functools.partial(check, holds=lambda x: x == x, rule="must be a finite number")
    return _quantity(label, checked, **options)


def series(
    label: str,
    *,
    ascending: bool = False,
    nonnegative: bool = False,
    least: Literal[1, 2] = 2,
    **options: Any,
) -> Any:
    """Field for a list of finite numbers.

    Args:
        label: name and unit, "times [s]".
        ascending: whether each number must be above the one before it.
        nonnegative: whether each number must be zero or positive.
        least: smallest allowed count of them.
        options: as of `positive`.

    Returns:
        The field of an `equinox.Module`.
    """
    rules = {"ascending": ascending, "nonnegative": nonnegative, "least": least}
    checked = functools.partial(_check_series, **rules)
    return _quantity(label, checked, many=least, **options)


def _quantity(
    label: str,
    checked: Callable[[Any, str], Any],
    default: Any = dataclasses.MISSING,
    many: int = 0,  # smallest count of a list of numbers, 0 for a single number
    matrix: bool = False,
    table: bool = False,
    taken: Taken | None = None,
) -> Any:
    match = _LABEL.fullmatch(label)
    if match is None:
        raise ValueError(f"The label of a quantity must be 'name [unit]', but is '{label}'.")

    def convert(value: Any) -> Array | None:
        if value is None and default is None:
            return None
        if table and is_table(value):
            return _check_series(
                value, label, ascending=False, nonnegative=False, least=2, rows=True
            )
        return checked(value, label)

    options = {} if default is dataclasses.MISSING else {"default": default}
    metadata = {"unit": match["unit"], "optional": default is None, "many": many}
    metadata |= {"matrix": matrix, "table": table, "taken": taken}
    return eqx.field(converter=convert, metadata=metadata, **options)


def check(value: Any, label: str, holds: Callable[[Any], Any], rule: str) -> Scalar:
    """`value` as a scalar array; raises if it is invalid, for a traced value when the program runs."""
    if isinstance(value, str | bool | complex) or value is None:
        raise ValueError(f"`{label}` must be a number, but is {value!r}.")
    if isinstance(value, Tracer):
        array = jnp.asarray(value, float)
        _check_shape(array, label)
        bad = ~(holds(array) & jnp.isfinite(array))
        return eqx.error_if(array, bad, f"`{label}` {rule} and finite.")
    try:
        # numpy, as inside jit a jax array would be traced; in the precision of the leaf
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


def _check_series(
    value: Any, label: str, ascending: bool, nonnegative: bool, least: int, rows: bool = False
) -> Array:
    """`value` as an array, one-dimensional or, if allowed, of `rows`; raises as `check` does."""
    wanted = f"`{label}` must be a list of {COUNTED[least]} or more finite numbers"
    wanted += " or of rows of as many each" * rows
    traced = not all(map(known, value if isinstance(value, list | tuple) else [value]))
    try:
        if isinstance(value, str | bool) or value is None:
            raise TypeError
        if not traced and np.asarray(value).dtype.kind not in "iufbO":  # texts, complex, dates
            raise TypeError
        array = jnp.asarray(value, float) if traced else np.asarray(value, float)
    except (TypeError, ValueError, OverflowError):
        raise ValueError(f"{wanted}, but is {value!r:.200}.") from None
    if array.ndim not in (1, 1 + rows) or min(array.shape) < least:
        raise ValueError(f"{wanted}, but has shape {array.shape}.")
    order = f"`{label}` must be ascending, each above the one before"
    falls = array[1:] <= array[:-1]
    sign = f"`{label}` must not be negative"
    if traced:
        array = eqx.error_if(array, ~jnp.isfinite(array), f"{wanted}.")
        if nonnegative:
            array = eqx.error_if(array, array < 0, f"{sign}.")
        return eqx.error_if(array, falls, f"{order}.") if ascending else array
    if not np.isfinite(array).all():
        raise ValueError(f"{wanted}, but is {array.tolist()!r:.200}.")
    if nonnegative and (array < 0).any():
        raise ValueError(f"{sign}, but one is {array.min():g}.")
    if ascending and falls.any():
        i = int(np.argmax(falls))
        raise ValueError(f"{order}, but has {array[i]:g} and then {array[i + 1]:g}.")
    return jnp.asarray(array, float)


def as_tuple(value: Any) -> Any:
    """A list converted to a tuple, anything else unchanged: the converter of a field of several parts."""
    return tuple(value) if isinstance(value, list) else value


def number_or_nan(value: Any) -> float:
    """A known number as a float, 0 for None, and NaN for a traced value or anything else."""
    try:
        return 0.0 if value is None else float(value) if known(value) else math.nan
    except (TypeError, ValueError):  # an error that the check of its field reports
        return math.nan


def with_values(module: Any, **values: Any) -> Any:
    """Copy of a module with other values of fields, static ones too, without checks."""
    copy = object.__new__(type(module))
    vars(copy).update(vars(module), **values)
    return copy


def unit_of(field: dataclasses.Field) -> str | None:
    """Unit of a quantity field; None for a field that is not a quantity."""
    return field.metadata.get("unit")


def is_series(field: dataclasses.Field) -> bool:
    """Whether a quantity field holds several numbers."""
    return least_count(field) > 0


def least_count(field: dataclasses.Field) -> int:
    """Smallest allowed count of the numbers of a quantity field that holds several; 0 for a single one."""
    return field.metadata.get("many", 0)


def takes_matrix(field: dataclasses.Field) -> bool:
    """Whether a quantity field accepts a 2 by 2 matrix, which its class splits into coefficients."""
    return field.metadata.get("matrix", False)


def takes_table(field: dataclasses.Field) -> bool:
    """Whether a quantity field accepts a list of numbers in place of one."""
    return field.metadata.get("table", False)


def taken_for(module: Any, name: str) -> Taken | None:
    """Value implied for a quantity that is not given; None: it is given, or nothing implies it."""
    taken = module.__dataclass_fields__[name].metadata.get("taken")
    if taken is None or getattr(module, name) is not None:
        return None
    return None if getattr(module, taken.source) is None else taken


def value_of(module: Any, name: str) -> Any:
    """Value of a quantity, given or taken; None where it is absent."""
    taken = taken_for(module, name)
    return getattr(module, name) if taken is None else taken.value(getattr(module, taken.source))


def is_table(value: Any) -> bool:
    """Whether a value of a quantity is a list or an array of numbers rather than one number."""
    return isinstance(value, list | tuple) or (not isinstance(value, str) and np.ndim(value) > 0)


def known(value: Any) -> bool:
    """Whether the value of a leaf is known now, i.e. jax is not tracing it."""
    return not isinstance(value, Tracer)


def on_host(array: Any) -> Any:
    """The array as one of numpy where its values are known, so that operations on it compile nothing."""
    return np.asarray(array) if known(array) else array


def quantity_units(module: eqx.Module) -> dict[str, str]:
    """Unit of every quantity field of a module, by its name."""
    units = {field.name: unit_of(field) for field in dataclasses.fields(module)}
    return {name: unit for name, unit in units.items() if unit is not None}
