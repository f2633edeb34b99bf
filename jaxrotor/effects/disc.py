"""Rigid disc: mass, moments of inertia, offset and tilt."""

from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp

from ..core.blocks import Blocks, Load
from ..core.quantities import Scalar, Taken, check, nonnegative, real, value_of
from ..shafts.line import AbstractLine
from .base import AbstractLinear, AbstractLoad


_THIN = Taken("polar", "abs(polar) / 2", lambda polar: jnp.abs(polar) / 2)


class Disc(AbstractLinear, AbstractLoad):
    """Rigid disc: `F = -m z..`, `L = -I_d z'.. + i Omega I_p z'.` at its station.

    A disc is thin unless `diametral` is given: `I_d = |I_p| / 2`. With neither it is a point mass.
    Offset and tilt of the disc are an unbalance, `(Omega^2 - i Omega.) exp(i theta)` times

        force   m e exp(i offset_angle)                            centre of mass `offset` e off the axis
        couple  (I_p - I_d) i sin(tilt) cos(tilt) exp(i tilt_axis)   right-handed tilt about an axis

    With `exact=False` they are of first order: `sin cos ~ tilt`, and the offset adds no moment of inertia
    about the axis. A negative `polar` reverses the gyroscopic moment (see the scene
    `limiter-rotor-2023`). Source: Azarov, Gouskov, Panovko (2023), eq. (3), with I_p = 2 B; for
    offset and tilt the Newton-Euler equations of a rigid rotor, eqs. (3), (9) of `turbine-run-up`.
    """

    kind: ClassVar[str] = "disc"
    plural: ClassVar[str] = "discs"

    at: Scalar = nonnegative("at [m]")
    mass: Scalar = nonnegative("mass [kg]")
    diametral: Scalar = nonnegative("diametral [kg m^2]", default=None, taken=_THIN)
    polar: Scalar = real("polar [kg m^2]", default=None)
    offset: Scalar = nonnegative("offset [m]", default=None)
    offset_angle: Scalar = real("offset_angle [rad]", default=0.0)
    tilt: Scalar = real("tilt [rad]", default=None)
    tilt_axis: Scalar = real("tilt_axis [rad]", default=0.0)
    exact: bool = eqx.field(default=True, static=True)

    def __check_init__(self):
        if self.polar is None and self.diametral is not None:
            raise ValueError(
                "`diametral [kg m^2]` is given without `polar [kg m^2]`; give that too: twice the "
                "diametral one of a thin disc, 0 if it has no gyroscopic moment."
            )
        if self.polar is None and self.tilt is not None:
            raise ValueError(
                "`tilt [rad]` belongs to a disc with moments of inertia; give `polar [kg m^2]` too."
            )

    @property
    def inertia(self) -> tuple[Scalar, Scalar] | None:
        """Diametral and polar moment of inertia [kg m^2]; None of a point mass."""
        return None if self.polar is None else (value_of(self, "diametral"), self.polar)

    @classmethod
    def from_dimensions(
        cls, at, diameter, thickness, density=7850.0, bore=0.0, **out_of_true
    ) -> "Disc":
        """Homogeneous disc of outer diameter D, bore b, thickness a and density rho.

        `m = rho pi (D^2 - b^2) a / 4`, `I_p = m (D^2 + b^2) / 8`, `I_d = I_p / 2 + m a^2 / 12`.

        Args:
            at: station [m].
            diameter: outer diameter D [m].
            thickness: thickness a [m].
            density: density rho [kg/m^3].
            bore: inner diameter b [m].
            out_of_true: offset and tilt, by the fields of the class.

        Raises:
            ValueError: If a dimension is not positive, or the bore not inside the disc.
        """
        for name, value in {"diameter": diameter, "thickness": thickness}.items():
            check(value, f"{name} [m]", lambda x: x > 0, "must be positive")
        check(bore, "bore [m]", lambda x: (x >= 0) & (x < diameter), "must be inside the disc")
        mass = density * jnp.pi * (diameter**2 - bore**2) * thickness / 4
        polar = mass * (diameter**2 + bore**2) / 8
        return cls(at, mass, polar / 2 + mass * thickness**2 / 12, polar, **out_of_true)

    @classmethod
    def thin(cls, at, mass, radius, **out_of_true) -> "Disc":
        """Thin homogeneous disc of radius R: `I_p = m R^2 / 2`, `I_d = m R^2 / 4`.

        Args:
            at: station [m].
            mass: mass m [kg].
            radius: radius R [m].
            out_of_true: offset and tilt, by the fields of the class.

        Raises:
            ValueError: If `radius` is not positive.
        """
        check(radius, "radius [m]", lambda x: x > 0, "must be positive")
        return cls(at, mass, mass * radius**2 / 4, mass * radius**2 / 2, **out_of_true)

    def blocks(self, line: AbstractLine) -> Blocks:
        force = line.column(self.at)
        mass = self.mass * jnp.outer(force, line.row(self.at))
        weight, polar = self.mass * force, self._about_axis
        if self.inertia is None:
            return Blocks(inertia=mass, weight=weight, polar=polar)
        diametral, own_polar = self.inertia
        rotary = jnp.outer(line.couple_column(self.at), line.slope_row(self.at))
        return Blocks(
            inertia=mass + diametral * rotary,
            gyroscopic=own_polar * rotary,
            weight=weight,
            polar=polar,
        )

    def load(self, line: AbstractLine, blocks: Blocks) -> Load:
        del blocks
        load = Load()
        if self.offset is not None:
            moment = self.mass * self.offset * jnp.exp(1j * self.offset_angle)
            load = load + Load(unbalance=moment * line.column(self.at))
        if self.tilt is not None and self.inertia is not None:
            diametral, polar = self.inertia
            skew = jnp.sin(self.tilt) * jnp.cos(self.tilt) if self.exact else self.tilt
            product = 1j * (polar - diametral) * skew * jnp.exp(1j * self.tilt_axis)
            load = load + Load(unbalance=product * line.couple_column(self.at))
        return load

    @property
    def _about_axis(self) -> Scalar | None:
        """Moment of inertia about the axis of rotation [kg m^2]."""
        polar = self.polar
        if self.exact and self.tilt is not None and self.inertia is not None:
            diametral, polar = self.inertia
            polar = polar * jnp.cos(self.tilt) ** 2 + diametral * jnp.sin(self.tilt) ** 2
        if self.exact and self.offset is not None:
            own = self.mass * self.offset**2
            polar = own if polar is None else polar + own
        return polar
