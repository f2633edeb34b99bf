"""Published collocation: the trapezoidal rule on equal cells, with displacements and slopes as unknowns.

It serves as the reference method of the 2023 paper and for comparison in the figures of accuracy. It is
of second order in the cell width where an end is free. With both ends pinned, guided or clamped the first
derivative of the integrand vanishes there, and with it the error of second order of frequencies.
Source: Azarov, Gouskov, Panovko (2023), eq. (9) and below.
"""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..core.extremes import bounded
from ..core.quantities import Scalar
from .greens import AbstractKernel, HeldKernel
from .line import Held, PerLength, strain_energy
from .polynomials import hermite
from .unsheared import AbstractUnshearedLine


class TrapezoidLine(AbstractUnshearedLine):
    """`q = (z_0 .. z_m, l z'_0 .. l z'_m)` at `x_i = i l / m`, without those that are held.

    Slopes are scaled by the length `l`. A shaft that can move without bending has auxiliary
    constraints at its ends, as in `SpectralLine`.
    """

    kernel: AbstractKernel
    length: Scalar
    cells: int = eqx.field(static=True)
    held: Held = eqx.field(static=True)  # of both ends
    free: tuple[int, ...] = eqx.field(static=True)  # ends with an auxiliary constraint: 0 or -1
    anisotropy: Scalar | None

    @property
    def breaks(self) -> Float[Array, " breaks"]:
        return self.nodes

    @property
    def nodes(self) -> Float[Array, " nodes"]:
        """Stations of the displacements and slopes, including held ones [m]."""
        return self.length * jnp.arange(self.cells + 1) / self.cells

    @property
    def sloped(self) -> Float[Array, " slopes"]:
        return self.nodes

    @property
    def bending_energy(self) -> Float[Array, "n n"]:
        return strain_energy(self, self.kernel.rigidity)

    def row(self, at: Scalar) -> Float[Array, " n"]:
        return self._hermite(at)[0][self._unconstrained]

    def slope_row(self, at: Scalar) -> Float[Array, " n"]:
        return self._hermite(at)[1][self._unconstrained]

    def column(self, at: Scalar) -> Float[Array, " n"]:
        return self._collocate(False, at)

    def couple_column(self, at: Scalar) -> Float[Array, " n"]:
        return self._collocate(True, at)

    def forces_along(self, per_length: PerLength) -> Float[Array, "n n"]:
        columns = self._each(self.column) * per_length * self._weights()
        both = jnp.concatenate([columns, jnp.zeros_like(columns)], axis=1)
        return both[:, self._unconstrained]

    def couples_along(self, per_length: PerLength) -> Float[Array, "n n"]:
        columns = self._each(self.couple_column) * per_length * self._weights() / self.length
        both = jnp.concatenate([jnp.zeros_like(columns), columns], axis=1)
        return both[:, self._unconstrained]

    def load_along(self, per_length: PerLength) -> Float[Array, " n"]:
        return per_length * (self._each(self.column) @ self._weights())

    def _collocate(self, couple: bool, at: Scalar) -> Float[Array, " n"]:
        """Equations of the coordinates due to a unit load at a station, a force or a couple.

        The equation of a node with an auxiliary constraint is the balance of its rigid motion.
        """
        kernel = self.kernel
        displaced, tilted = (
            kernel.response(self.nodes, at, slope, couple) for slope in (False, True)
        )
        equations = jnp.concatenate([displaced, self.length * tilted])
        if isinstance(kernel, HeldKernel):
            for number, node in enumerate(self._free_nodes):
                work = kernel.compliance * kernel.rigid(number, at, couple)
                equations = equations.at[node].set(work)
        return equations[self._unconstrained]

    def _each(self, column) -> Float[Array, "n nodes"]:
        return eqx.filter_vmap(column, out_axes=1)(self.nodes)

    def _weights(self) -> Float[Array, " nodes"]:
        ends = np.array([0, -1])
        return (self.length / self.cells) * jnp.ones(self.cells + 1).at[ends].set(0.5)

    @property
    def _free_nodes(self) -> list[int]:
        """Indices of the nodes at the auxiliary constraints."""
        return [range(self.cells + 1)[end] for end in self.free]

    @property
    def _unconstrained(self) -> np.ndarray:
        """Indices of the displacements and slopes that no constraint holds: the coordinates."""
        held = np.zeros((2, self.cells + 1), bool)  # displacement, slope
        held[:, [0, -1]] = np.array(self.held).T
        return np.flatnonzero(~held.ravel())

    def _hermite(self, at: Scalar) -> tuple[Array, Array]:
        """Rows of displacement and slope: cubic Hermite interpolation between the nodes."""
        m, width = self.cells, self.length / self.cells
        cell = bounded(jnp.ceil(at / width) - 1, 0, m - 1).astype(int)
        u = at / width - cell
        left, right = jnp.eye(m + 1)[cell], jnp.eye(m + 1)[cell + 1]
        scaled = width / self.length  # factor of the unknown l z'

        def row(value, slope, value_, slope_):
            ends = value * left + value_ * right
            return jnp.concatenate([ends, scaled * (slope * left + slope_ * right)])

        return row(*hermite(u, 0)), row(*hermite(u, 1)) / width
