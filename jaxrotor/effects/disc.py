"""Rigid disc."""

from typing import ClassVar

import jax.numpy as jnp

from ..blocks import Blocks
from ..quantities import Scalar, check, nonnegative, real
from ..shafts.line import AbstractLine
from .base import AbstractLinear


class Disc(AbstractLinear):
    """Rigid disc: `F = -m z..`, `L = -I_d z'.. + i Omega I_p z'.` at its station.

    A polar inertia that is negative reverses the gyroscopic moment (see the scene
    `limiter-rotor-2023`). Source: Azarov, Gouskov, Panovko (2023), eq. (3), with I_p = 2 B.
    """

    kind: ClassVar[str] = "disc"
    plural: ClassVar[str] = "discs"

    at: Scalar = nonnegative("at [m]")
    mass: Scalar = nonnegative("mass [kg]")
    diametral: Scalar = nonnegative("diametral [kg m^2]", default=0.0)
    polar: Scalar = real("polar [kg m^2]", default=0.0)

    @classmethod
    def from_dimensions(cls, at, diameter, thickness, density=7850.0, bore=0.0) -> "Disc":
        """Homogeneous disc of outer `diameter`, `bore` and `thickness` [m], `density` [kg/m^3].

        `m = rho pi (D^2 - b^2) a / 4`, `I_p = m (D^2 + b^2) / 8`, `I_d = I_p / 2 + m a^2 / 12`.
        """
        for name, value in {"diameter": diameter, "thickness": thickness}.items():
            check(value, f"{name} [m]", lambda x: x > 0, "must be positive")
        check(bore, "bore [m]", lambda x: (x >= 0) & (x < diameter), "must be inside the disc")
        mass = density * jnp.pi * (diameter**2 - bore**2) * thickness / 4
        polar = mass * (diameter**2 + bore**2) / 8
        return cls(at, mass, polar / 2 + mass * thickness**2 / 12, polar)

    def blocks(self, line: AbstractLine) -> Blocks:
        force, couple = line.column(self.at), line.couple_column(self.at)
        turning = jnp.outer(couple, line.slope_row(self.at))
        return Blocks(
            inertia=self.mass * jnp.outer(force, line.row(self.at)) + self.diametral * turning,
            gyroscopic=self.polar * turning,
            weight=self.mass * force,
        )
