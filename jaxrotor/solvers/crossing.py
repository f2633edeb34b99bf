"""Crossings: where in a step a margin first falls through zero, by Hermite cubics."""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from ..core.extremes import bounded, larger, largest, smaller
from ..core.quantities import Number, Scalar


class Crossing(eqx.Module):
    """Margins of all conditions at an instant, infinite where a condition is inactive, and their rates."""

    margin: Float[Array, "c ..."]
    rate: Float[Array, "c ..."]  # [1 / rad]


class Cubic(NamedTuple):
    """`c0 + c1 u + c2 u^2 + c3 u^3`: a margin over the share `u` of a span."""

    c0: Array
    c1: Array
    c2: Array
    c3: Array

    @classmethod
    def of(cls, begin: Crossing, end: Crossing, span: Number) -> "Cubic":
        """The cubic of the values and rates at both ends; constant where a condition is inactive."""
        active = jnp.isfinite(begin.margin) & jnp.isfinite(end.margin)
        m0, m1 = (jnp.where(active, one.margin, 1.0) for one in (begin, end))
        r0, r1 = (jnp.where(active, one.rate, 0.0) * span for one in (begin, end))
        return cls(m0, r0, 3 * (m1 - m0) - 2 * r0 - r1, 2 * (m0 - m1) + r0 + r1)

    def __call__(self, u: Array | float) -> Array:
        return self.c0 + u * (self.c1 + u * (self.c2 + u * self.c3))

    def slope(self, u: Array) -> Array:
        return self.c1 + u * (2 * self.c2 + u * 3 * self.c3)

    def extrema(self) -> tuple[Array, Array]:
        """Positions of the local maximum and minimum, clipped to 0..1; 0 where there are none."""
        square = self.c2**2 - 3 * self.c1 * self.c3
        exist = square > 0
        root = jnp.sqrt(jnp.where(exist, square, 1.0))
        q = self.c2 + jnp.where(self.c2 < 0, -root, root)  # without cancellation
        far, near = _ratio(-q, 3 * self.c3), _ratio(-self.c1, q)
        clip = lambda u: bounded(jnp.where(exist, u, 0.0), 0.0, 1.0)
        far_is_minimum = self.c2 < 0
        return (
            clip(jnp.where(far_is_minimum, near, far)),
            clip(jnp.where(far_is_minimum, far, near)),
        )


def _ratio(a: Array, b: Array) -> Array:
    return jnp.where(b == 0, 0.0, a / jnp.where(b == 0, 1.0, b))


def falls_through_zero(begin: Crossing, end: Crossing, span: Number) -> Bool[Array, "c ..."]:
    """Whether each margin descends through zero within the span."""
    cubic = jax.lax.stop_gradient(Cubic.of(begin, end, span))
    top, bottom = cubic.extrema()
    end_falls = (cubic(1.0) < 0) & (cubic(1.0) < larger(cubic.c0, cubic(top)))
    return end_falls | ((cubic(bottom) < 0) & (cubic(bottom) < cubic.c0))


def first_crossing(begin: Crossing, end: Crossing, span: Scalar) -> Scalar:
    """Share of the span at which a margin first descends through zero, 2 if none does.

    A cubic is monotone between 0, its extrema and 1. The first piece that falls through zero is bisected
    three times, and Newton's method follows. The derivative of the share is that of the exact root.
    """
    cubic = Cubic.of(begin, end, span)
    found = jax.lax.stop_gradient(cubic)
    low, high = found.extrema()
    low, high = smaller(low, high), larger(low, high)
    nodes = (jnp.zeros_like(low), low, high, jnp.ones_like(low))
    a, b = jnp.full_like(low, 2.0), jnp.full_like(low, 2.0)
    for left, right in ((nodes[2], nodes[3]), (nodes[1], nodes[2]), (nodes[0], nodes[1])):
        falls = (found(right) < 0) & (found(right) < found(left))
        a, b = jnp.where(falls, left, a), jnp.where(falls, right, b)
    crosses, start = a < 2, a
    for _ in range(3):
        middle = (a + b) / 2
        above = found(middle) > 0
        a, b = jnp.where(above, middle, a), jnp.where(above, b, middle)
    u = (a + b) / 2
    for _ in range(3):
        rate = found.slope(u)
        u = bounded(u - found(u) / jnp.where(rate < 0, rate, -jnp.inf), a, b)
    rate = found.slope(u)
    u = bounded(u - cubic(u) / jnp.where(rate < 0, rate, -jnp.inf), a, b)
    u = jnp.where(found(start) <= 0, start, u)  # a condition that began just now ends at once
    return -largest(-jnp.append(jnp.where(crosses, u, 2.0), 2.0))
