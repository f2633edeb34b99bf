"""Forms: the coordinates in which a solver steps a motion."""

import abc
from collections.abc import Callable

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Complex, Float

from ..core.plane import plane
from ..core.quantities import Scalar
from ..equations.stationary_frame import Motion


class AbstractForm(eqx.Module):
    """Coordinates `y` of a motion, its vector field in them, and the stations read from them.

    A station is read by a row of the elastic line; `rows` (s, n) are fixed when a form is built.
    """

    motion: eqx.AbstractVar[Motion]

    @property
    @abc.abstractmethod
    def field(self) -> Callable[..., Array]:
        """`dy/dtheta` as a diffrax vector field, all real."""

    @abc.abstractmethod
    def encode(self, q: Complex[Array, " n"], velocity: Complex[Array, " n"]) -> Array:
        """State at `theta = 0` from coordinates [m] and their velocities [m/s]."""

    @abc.abstractmethod
    def decode(self, y: Array) -> tuple[Complex[Array, " n"], Complex[Array, " n"]]:
        """Coordinates [m] and velocities [m/s] of a state at `theta = 0` (or any whole revolution)."""

    @abc.abstractmethod
    def read(self, theta: Scalar, y: Array) -> Float[Array, "2 2 s"]:
        """(x, y) by (displacement [m], velocity [m/s]) by station."""


class PhysicalForm(AbstractForm):
    """Coordinates and their rates by angle, (2, 2, n), for any diffrax solver."""

    motion: Motion
    rows: Float[Array, "s n"]

    @property
    def field(self):
        return self.motion

    def encode(self, q, velocity):
        state = jnp.stack([q, velocity / self.motion.rate])
        return plane(state, axis=1)

    def decode(self, y):
        state = y[:, 0] + 1j * y[:, 1]
        return state[0], self.motion.rate * state[1]

    def read(self, theta, y):
        del theta
        seen = y @ self.rows.T  # (q or q', x or y, s)
        return jnp.stack([seen[0], self.motion.rate * seen[1]], axis=1)
