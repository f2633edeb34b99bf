"""Kinematics in the axes of the shaft: the state that is integrated, and the motion at an instant."""

from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Complex, Float

from ..core.lanes import computed_once
from ..core.plane import directions
from ..core.quantities import Number
from ..effects.law import Now
from ..spins.base import Turning


class RotatingState(eqx.Module):
    """State of all moving parts, `q = r exp(i theta)`; a part that the scene lacks has no entries.

    Rates are divided by a reference rate, so that all entries are of one size.
    """

    r: Float[Array, "2 n"]  # [x, y] of the coordinates in the axes of the shaft
    r_rate: Float[Array, "2 n"]
    angle: Float[Array, " d"]  # theta [rad], d = 1 where the spin is free
    speed: Float[Array, " d"]  # Omega over the reference rate
    bodies: Float[Array, " b"]  # angles relative to the shaft, psi = phi - theta [rad]
    bodies_rate: Float[Array, " b"]
    states: Float[Array, " s"]  # of laws, in their own units


class Kinematics(NamedTuple):
    """Positions, velocities and accelerations of all moving parts, in the axes of the shaft.

    Arrays may have lanes last.
    """

    turning: Turning
    r: Complex[Array, "n ..."]
    drift: Complex[Array, "n ..."]  # r. [1/s], velocity relative to the axes
    absolute: Complex[Array, "n ..."]  # q.. exp(-i theta) [1/s^2]; 0 for coordinates without mass
    bodies: Float[Array, "b ..."]  # psi [rad]
    bodies_speed: Float[Array, "b ..."]  # phi. [rad/s]
    bodies_acceleration: Float[Array, "b ..."]  # phi.. [rad/s^2]
    states: Float[Array, "s ..."]  # of laws, in their own units
    time: Number | None = None  # [s]; None: at rest

    @property
    def velocity(self) -> Complex[Array, "n ..."]:
        """`q. exp(-i theta)` [1/s]."""
        return self.drift + 1j * self.turning.speed * self.r

    @property
    def turn(self) -> Complex[Array, "..."]:
        """`exp(i theta)`."""
        return computed_once(directions(self.turning.angle))

    @property
    def back(self) -> Complex[Array, "..."]:
        """`exp(-i theta)`, by which a vector in fixed axes is given in those of the shaft."""
        return jnp.conj(self.turn)

    @property
    def of_laws(self) -> Now:
        """Rotation and states, as laws are given them."""
        angle, speed, acceleration = self.turning
        return Now(speed, angle, self.states, acceleration=acceleration, time=self.time)
