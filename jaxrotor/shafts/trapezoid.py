"""Published collocation: the trapezoidal rule on equal cells, with displacements and slopes as unknowns.

It is of second order in the cell width, and serves as the reference method of the 2023 paper and for
comparison in the figures of accuracy. Source: Azarov, Gouskov, Panovko (2023), eq. (9) and below.
"""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..core.extremes import bounded
from ..core.quantities import Scalar
from .greens import CantileverKernel
from .line import AbstractLine, PerLength, strain_energy


class TrapezoidLine(AbstractLine):
    """`q = (z_1 .. z_m, l z'_1 .. l z'_m)` at `x_i = i l / m`; slopes scaled by the length `l`."""

    kernel: CantileverKernel
    length: Scalar
    cells: int = eqx.field(static=True)
    anisotropy: Scalar | None

    @property
    def breaks(self) -> Float[Array, " breaks"]:
        return jnp.append(0.0, self.nodes)

    @property
    def nodes(self) -> Float[Array, " m"]:
        """Stations of the coordinates [m]."""
        return self.length * jnp.arange(1, self.cells + 1) / self.cells

    @property
    def stiffness(self) -> Float[Array, "n n"]:
        return jnp.eye(2 * self.cells)

    @property
    def bending_stiffness(self) -> Float[Array, "n n"]:
        return self.stiffness

    @property
    def strain_energy(self) -> Float[Array, "n n"]:
        return self.bending_energy

    @property
    def bending_energy(self) -> Float[Array, "n n"]:
        return strain_energy(self, self.kernel.rigidity)

    def row(self, at: Scalar) -> Float[Array, " n"]:
        return self._hermite(at)[0]

    def slope_row(self, at: Scalar) -> Float[Array, " n"]:
        return self._hermite(at)[1]

    def column(self, at: Scalar) -> Float[Array, " n"]:
        slope = self.length * self.kernel.slope(self.nodes, at)
        return jnp.concatenate([self.kernel.deflection(self.nodes, at), slope])

    def couple_column(self, at: Scalar) -> Float[Array, " n"]:
        slope = self.length * self.kernel.slope_by_couple(self.nodes, at)
        return jnp.concatenate([self.kernel.deflection_by_couple(self.nodes, at), slope])

    def forces_along(self, per_length: PerLength) -> Float[Array, "n n"]:
        columns = self._each(self.column) * per_length * self._weights()
        return jnp.concatenate([columns, jnp.zeros_like(columns)], axis=1)

    def couples_along(self, per_length: PerLength) -> Float[Array, "n n"]:
        columns = self._each(self.couple_column) * per_length * self._weights() / self.length
        return jnp.concatenate([jnp.zeros_like(columns), columns], axis=1)

    def load_along(self, per_length: PerLength) -> Float[Array, " n"]:
        return per_length * (self._each(self.column) @ self._weights())

    def _each(self, column) -> Float[Array, "n m"]:
        return eqx.filter_vmap(column, out_axes=1)(self.nodes)

    def _weights(self) -> Float[Array, " m"]:
        return (self.length / self.cells) * jnp.ones(self.cells).at[-1].set(0.5)

    def _hermite(self, at: Scalar) -> tuple[Array, Array]:
        """Rows of displacement and slope: cubic Hermite interpolation between the nodes."""
        m, width = self.cells, self.length / self.cells
        cell = bounded(jnp.ceil(at / width) - 1, 0, m - 1).astype(int)
        u = at / width - cell
        left, right = jnp.eye(m + 1)[cell], jnp.eye(m + 1)[cell + 1]  # the first entry is the clamp
        scaled = width / self.length  # factor of the unknown l z'

        def row(value, value_, slope, slope_):
            ends = value * left + value_ * right
            return jnp.concatenate([ends[1:], scaled * (slope * left + slope_ * right)[1:]])

        displacement = row(
            (1 + 2 * u) * (1 - u) ** 2,
            u**2 * (3 - 2 * u),
            u * (1 - u) ** 2,
            u**2 * (u - 1),
        )
        rise = 6 * u * (1 - u)
        slope = row(-rise, rise, (1 - u) * (1 - 3 * u), u * (3 * u - 2)) / width
        return displacement, slope
