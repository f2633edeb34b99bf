"""Readings: what stations see of a state, and of the exact steady response beside it."""

from collections.abc import Callable
from typing import Any, cast

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..core.lanes import product
from ..core.quantities import Scalar
from ..equations.clocks import Clocks
from .tableau import phase_at


Phase = Callable[[], Float[Array, "c2 ..."]]  # cosine and sine of the angle of every clock


class Reading(eqx.Module):
    """`[Re, Im]` of displacement and velocity of stations: linear in `y`, plus the steady response.

    Parts of the steady response without a load are None. All fields may have lanes last.
    """

    matrix: Float[Array, "s4 m2"]
    still: Float[Array, " s4"] | None
    cos: Float[Array, " s4"] | None
    sin: Float[Array, " s4"] | None
    turn: Scalar | None = None  # s, where all of these are along axes that turn by s theta
    clocks: Clocks | None = None  # of the other shafts, with their parts of the steady response

    @property
    def rates(self) -> Any:
        """Rates of other clocks by the angle of revolution."""
        return () if self.clocks is None else self.clocks.rates

    def steady(self, phase: Float[Array, "c2 ..."]) -> Float[Array, "s4 ..."] | float:
        """Readings of the steady response, by cosine and sine of the angles of all clocks."""
        steady = 0.0 if self.still is None else self.still
        if self.cos is not None and self.sin is not None:
            steady = steady + phase[0] * self.cos + phase[1] * self.sin
        return steady if self.clocks is None else steady + self.clocks.at(phase[2:])

    def fixed(self, phase: Phase, seen: Float[Array, "s4 ..."]) -> Array:
        """Readings along fixed axes; `phase` is computed only where the axes turn."""
        if self.turn is None:
            return seen
        return _turned(*self._angle(phase), seen)

    def turned(self, phase: Phase, force: Float[Array, "p2 ..."]) -> Array:
        """A force given along fixed axes, along those of the readings."""
        if self.turn is None:
            return force
        cos, sin = self._angle(phase)
        return _turned(cos, -sin, force)

    def around(self, phase: Phase, matrix: Float[Array, "a2 b2 ..."]) -> Array:
        """A matrix between vectors given along the axes of the readings, as it acts along fixed axes."""
        if self.turn is None:
            return matrix
        columns = jnp.swapaxes(self.fixed(phase, matrix), 0, 1)
        return jnp.swapaxes(self.fixed(phase, columns), 0, 1)

    def _angle(self, phase: Phase) -> tuple[Array, Array]:
        """Cosine and sine of `s theta`, with `s` -1, 1 or, of a rotor at rest, 0."""
        cos, sin, *_ = phase()
        turn = cast(Array, self.turn)
        return 1 + turn**2 * (cos - 1), turn * sin

    def __call__(self, theta: Scalar, y: Array) -> Float[Array, " s4"]:
        phase = phase_at(theta, self.rates)
        return self.fixed(lambda: phase, self.matrix @ y + self.steady(phase))

    def of_lanes(self, phase: Float[Array, "c2 ..."], y: Float[Array, "m2 ..."]) -> Array:
        """Readings of one or all lanes, by cosine and sine of the angle of revolution."""
        return self.fixed(lambda: phase, product(self.matrix, y) + self.steady(phase))


def _turned(cos: Array, sin: Array, parts: Float[Array, "a2 ..."]) -> Float[Array, "a2 ..."]:
    """`[Re, Im]` of vectors, turned by an angle."""
    x, y = jnp.split(parts, 2)
    return jnp.concatenate([cos * x - sin * y, sin * x + cos * y])
