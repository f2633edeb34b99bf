"""Stiffness or damping in the plane: coefficients of 2 by 2 matrices, tables of them, their parts."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from ..core.quantities import Number, is_table, known, number_or_nan
from .law import AbstractSmoothLaw, Hardness, Now, Plane


LETTERS = {"stiffness": "k", "damping": "c"}
AXES = ("xx", "xy", "yx", "yy")
COEFFICIENTS = tuple(letter + axes for letter in LETTERS.values() for axes in AXES)
_UNITS = {"k": "N/m", "c": "N s/m"}


class Parts(NamedTuple):
    """Parts of `F = -(mean + i cross) z - deviator z*`; None means absent."""

    mean: Any
    cross: Any
    deviator: Any

    @classmethod
    def of_matrix(cls, xx: Any, xy: Any, yx: Any, yy: Any) -> "Parts":
        """Parts of [[xx, xy], [yx, yy]]; None for xy and yx: they are absent, for yy: it is xx."""
        cross = deviator = None
        if xy is not None:
            cross, deviator = (yx - xy) / 2, 0.5j * (xy + yx)
        if yy is None:
            return cls(xx, cross, deviator)
        unequal = (xx - yy) / 2 + 0j
        return cls((xx + yy) / 2, cross, unequal if deviator is None else unequal + deviator)

    @property
    def matrix(self) -> tuple[Any, Any, Any, Any]:
        """The coefficients xx, xy, yx and yy; absent parts are zero."""
        mean, cross, deviator = (0.0 if part is None else part for part in self)
        along, across = jnp.real(deviator), jnp.imag(deviator)
        return mean + along, across - cross, across + cross, mean - along


class DeviatorLaw(AbstractSmoothLaw):
    """`F = -k z* - c z.*`, the part of a bearing's force that is unequal along axes fixed in space."""

    stiffness: Plane | None  # [Re, Im] of k [N/m]
    damping: Plane | None  # [Re, Im] of c [N s/m]

    @property
    def elementwise(self) -> bool:
        return True

    def __call__(self, displacement: Plane, velocity: Plane, now: Now) -> Plane:
        force = jnp.zeros_like(displacement)
        for part, (x, y) in ((self.stiffness, displacement), (self.damping, velocity)):
            if part is not None:
                force -= jnp.stack([part[0] * x + part[1] * y, part[1] * x - part[0] * y])
        return force

    def torque(self, force: Plane, displacement: Plane, velocity: Plane, now: Now) -> Number:
        return jnp.zeros(())

    def hardness(self) -> Hardness:
        """Zero, as it does not rebound: the length of the steps is not limited by it."""
        return Hardness(jnp.zeros(()), jnp.zeros(()), jnp.zeros(2), jnp.zeros(()))


def vanishing(xx: Any, xy: Any, yx: Any, yy: Any) -> tuple[bool, bool]:
    """Whether cross part and deviator of a matrix are known to be zero; None as in `Parts.of_matrix`."""
    own = [_numbers_or_nan(value) for value in (xx, xy, yx, yy)]
    equal = yy is None or _equal(own[0], own[3])
    return _equal(own[1], own[2]), equal and _equal(own[1], -own[2])


def is_zero(value: Any) -> bool:
    """Whether a number is known to be zero."""
    return value is not None and number_or_nan(value) == 0


def check_whole(given: Mapping[str, Any]) -> None:
    """Raise if a matrix of `given` coefficients, by their names, lacks one that nothing implies.

    `kxx` alone means `kyy = kxx`. All others are asked for, as zero is a statement.
    """
    for letter, unit in _UNITS.items():
        own = {axes: given.get(letter + axes) is not None for axes in AXES}
        first = next((axes for axes, there in own.items() if there), None)
        wanted, also = None, ""
        if first is not None and not own["xx"]:
            wanted, also = "xx", "0 if there is none along x"
        elif own["xy"] != own["yx"]:
            wanted, first = ("yx", "xy") if own["xy"] else ("xy", "yx")
            also = (
                f"0 if there is none, and -{letter}{first} in a bearing that is the same all round"
            )
        if wanted is not None:
            raise ValueError(
                f"`{letter}{first} [{unit}]` is given without `{letter}{wanted} [{unit}]`; give that too: "
                f"{also}."
            )


def check_tables(tables: Mapping[str, Any], speeds: Any, frequencies: Any, rotating: bool) -> None:
    """Raise unless every table has a value at each of the nodes, and these have a table."""
    given = {"speeds": speeds, "frequencies": frequencies}
    given = {name: nodes for name, nodes in given.items() if nodes is not None}
    if not given:
        for name, table in tables.items():
            if table.ndim == 1:
                raise ValueError(
                    f"`{name}` is a table of {table.size} numbers; give their `speeds [rad/s]`, or "
                    "one number."
                )
            raise ValueError(
                f"`{name}` is a table of {table.shape[0]} by {table.shape[1]} numbers; give their "
                "`speeds [rad/s]` and `frequencies [rad/s]`, or one number; a matrix [[xx, xy], [yx, "
                "yy]] is `stiffness` or `damping`."
            )
        return
    named = " and ".join(f"`{name} [rad/s]`" for name in given)
    if not tables:
        raise ValueError(
            f"{named} are the nodes of tables, but no coefficient is a table; give kxx, .. or cyy as "
            "a list, or leave them out."
        )
    shape = tuple(nodes.size for nodes in given.values())
    for name, table in tables.items():
        if table.shape == shape:
            continue
        if len(given) == 2:
            raise ValueError(
                f"`{name}` must have {shape[0]} rows, one for each of the `speeds [rad/s]`, of "
                f"{shape[1]} values, one for each of the `frequencies [rad/s]`, or be one number, but "
                f"has shape {table.shape}."
            )
        has = table.size if table.ndim == 1 else f"shape {table.shape}"
        raise ValueError(
            f"`{name}` must have a value at each of the {shape[0]} {named}, but has {has}."
        )
    if rotating:
        raise ValueError(
            f"Tables over {named} are for a support that does not turn; leave out `rotating`, or give "
            "numbers."
        )


def _numbers_or_nan(value: Any) -> Any:
    """A known coefficient or table as floats, and NaN for anything else, as `number_or_nan`."""
    if not (is_table(value) and known(value)):
        return number_or_nan(value)
    try:
        return np.asarray(value, float)
    except (TypeError, ValueError):  # an error that the check of its field reports
        return np.nan


def _equal(one: Any, other: Any) -> bool:
    """Whether two coefficients are equal at every speed."""
    fits = not (np.ndim(one) and np.ndim(other)) or np.shape(one) == np.shape(other)
    return fits and bool(np.all(one - other == 0))
