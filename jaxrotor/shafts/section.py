"""Round sections of a shaft, solid or hollow, and steps from one to the next."""

from collections.abc import Sequence
from typing import Any

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..core.quantities import Scalar, known, nonnegative, positive, with_values
from ..core.representation import AbstractPart
from .materials import Material


Numbers = Any  # of one section, or an array of those of several


class Section(eqx.Module):
    """Round section with outer diameter `D` and inner diameter `d` (None: solid), of a material.

    Several sections in one have numbers with a leading axis, see `stacked`.
    """

    diameter: Numbers
    inner_diameter: Numbers | None
    material: Material

    @property
    def _ratio(self) -> Numbers:
        return 0.0 if self.inner_diameter is None else self.inner_diameter / self.diameter

    @property
    def area(self) -> Numbers:
        """`A = pi (D^2 - d^2) / 4` [m^2]."""
        return jnp.pi * self.diameter**2 / 4 * (1 - self._ratio**2)

    @property
    def second_moment(self) -> Numbers:
        """`I = pi (D^4 - d^4) / 64` [m^4]."""
        return jnp.pi * self.diameter**4 / 64 * (1 - self._ratio**4)

    @property
    def rigidity(self) -> Numbers:
        """Bending stiffness `EI` [N m^2]."""
        return self.material.youngs_modulus * self.second_moment

    @property
    def mass_per_length(self) -> Numbers:
        """`rho A` [kg/m]."""
        return self.material.density * self.area

    @property
    def rotary_inertia(self) -> Numbers:
        """`rho I` [kg m], diametral moment of inertia per length."""
        return self.material.density * self.second_moment

    @property
    def slowness(self) -> Numbers:
        """`(rho A / EI)^(1/4)` [s^(1/2)/m]: the wave number over the square root of the frequency."""
        return (self.mass_per_length / self.rigidity) ** 0.25

    @property
    def shear_stiffness(self) -> Numbers:
        """Shear stiffness `k G A` [N] with the shear coefficient of a hollow circle.

        `k = 6 (1 + r^2)^2 (1 + nu) / [(7 + 6 nu)(1 + r^2)^2 + (20 + 12 nu) r^2]`, `r = d / D`,
        `nu = E / 2G - 1`. Source: Cowper (1966).
        """
        shear = self.material.shear_modulus
        nu = self.material.youngs_modulus / (2 * shear) - 1
        square = self._ratio**2
        above = 6 * (1 + square) ** 2 * (1 + nu)
        below = (7 + 6 * nu) * (1 + square) ** 2 + (20 + 12 * nu) * square
        return above / below * shear * self.area

    def check(self, shear: bool) -> None:
        """Raise if the bore is not below the diameter, or if `shear` lacks a shear modulus."""
        inner, outer = self.inner_diameter, self.diameter
        if inner is not None and known(inner) and known(outer) and float(inner) >= float(outer):
            raise ValueError(
                f"`inner_diameter [m]` must be below the diameter, {float(outer):g}, but is "
                f"{float(inner):g}."
            )
        if shear and self.material.shear_modulus is None:
            raise ValueError(
                "A shaft with `shear` needs the `shear_modulus [Pa]` of its material, but it is absent."
            )


def stacked(sections: Sequence[Section], shear: bool) -> Section:
    """Sections as one whose numbers have a leading axis; the shear modulus only with `shear`.

    A material that all sections share stays as it is.
    """
    inner = [section.inner_diameter for section in sections]
    if any(one is not None for one in inner):
        inner = column([jnp.zeros(()) if one is None else one for one in inner])
    else:
        inner = None
    materials = [section.material for section in sections]
    material = materials[0]
    if any(one is not material for one in materials):
        names = ("youngs_modulus", "density", *["shear_modulus"] * shear)
        numbers = {name: column([getattr(one, name) for one in materials]) for name in names}
        material = with_values(material, **numbers)
    return Section(column([section.diameter for section in sections]), inner, material)


@eqx.filter_jit  # traced once a program, which may have hundreds of numbers
def column(values: list[Scalar]) -> Float[Array, " values"]:
    """Numbers as an array."""
    return jnp.stack(values)


class Step(AbstractPart):
    """Another section, from the station `at` to the next step or the end of the shaft."""

    at: Scalar = positive("at [m]")
    diameter: Scalar = positive("diameter [m]")
    inner_diameter: Scalar = nonnegative("inner_diameter [m]", default=None)
    material: Material | None = None  # None: that of the shaft

    def section(self, material: Material) -> Section:
        """The section, of its own material or else of the given one."""
        return Section(
            self.diameter, self.inner_diameter, material if self.material is None else self.material
        )
