"""Parameter range: a parameter of a scene between two values, measured by a place from 0 to 1."""

import math
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float

from ..core.quantities import Scalar
from ..equations.speed_tables import check_tables
from ..equations.system import port_groups
from ..scene import Scene
from .symmetry import SAME


class ParameterRange(eqx.Module):
    """`p = low + (high - low) s`, or `p = low (high / low)^s` over more than a decade."""

    low: Scalar
    high: Scalar
    path: str = eqx.field(static=True)
    decades: bool = eqx.field(static=True)  # whether s runs along the logarithm

    def value(self, s: ArrayLike) -> Array:
        """Value of the parameter at `s`."""
        s = jnp.asarray(s)
        if self.decades:
            return self.low * (self.high / self.low) ** s
        return self.low + (self.high - self.low) * s

    def place(self, value: float) -> float:
        """The `s` of a value."""
        low, high = float(self.low), float(self.high)
        if self.decades:
            return math.log(value / low) / math.log(high / low)
        return (value - low) / (high - low)

    def rate(self, value: float) -> float:
        """`dp/ds` at a value."""
        low, high = float(self.low), float(self.high)
        return value * math.log(high / low) if self.decades else high - low


class AbstractRanged(eqx.Module):
    """A problem with parameters, whose places are its last unknowns."""

    parameters: eqx.AbstractVar[tuple[ParameterRange, ...]]

    def values(self, u: Array | np.ndarray) -> tuple[Array, ...]:
        """Values of the parameters at unknowns `u = (x, s)`."""
        places = u[-len(self.parameters) :]
        return tuple(one.value(s) for one, s in zip(self.parameters, places, strict=True))

    def rates(self, u: Float[np.ndarray, " b"]) -> tuple[float, ...]:
        """`dp/ds` of every parameter."""
        pairs = zip(self.parameters, self.values(u), strict=True)
        return tuple(one.rate(float(value)) for one, value in pairs)

    def at(self, u: Float[np.ndarray, " b"]) -> str:
        """The values of the parameters, for a message."""
        named = zip(self.parameters, self.values(u), strict=True)
        return ", ".join(f"{one.path} = {float(value):.9g}" for one, value in named)


def range_of(scene: Scene, path: str, between: Any, name: str) -> ParameterRange:
    """The range of a parameter; raise unless both ends make a scene of the same layout.

    `name` is the argument that has the ends.
    """
    value = own(scene, path)
    try:
        low, high = (float(one) for one in between)
    except (TypeError, ValueError):
        low = high = math.nan
    if not (math.isfinite(high - low) and low < high):
        raise ValueError(f"`{name}` must be two numbers, low and high, but is {between!r}.")
    if not low <= value <= high:
        raise ValueError(
            f"`{name}` must hold the orbit's own `{path}`, {value:g}, but is {low:g} to {high:g}."
        )
    if path == "spin.speed" and low * high <= 0:
        raise ValueError(f"`{name}` must keep the sense of rotation, but is {low:g} to {high:g}.")
    if path == "spin.speed":
        check_tables(scene, (low, high))
    for end in (low, high):
        other = scene.replace({path: end})
        if other.spans != scene.spans or port_groups(other) != port_groups(scene):
            raise ValueError(
                f"`{path}` moves a station past another, or separates stops at the same station, between "
                f"{low:g} and {high:g}; give a range that keeps their order."
            )
    decades = low > 0 and high > 10 * low
    return ParameterRange(jnp.asarray(low, float), jnp.asarray(high, float), path, decades)


def own(scene: Scene, path: str) -> float:
    """The scene's own value of a parameter."""
    values = np.ravel(scene.get(path))
    if values.size == 0 or np.ptp(values) > SAME * np.abs(values).max():
        raise ValueError(
            f"`{path}` has several values, {', '.join(f'{v:g}' for v in values)}; name one of them, as in "
            "`limiters.0.stiffness`."
        )
    return float(values[0])
