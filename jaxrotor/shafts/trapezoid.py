"""Published collocation: the trapezoidal rule on equal cells, with displacements and slopes as unknowns.

It serves as the reference method of the 2023 paper and for comparison in the figures of accuracy. It is
of second order in the cell width where an end is free. With both ends pinned, guided or clamped the first
derivative of the integrand vanishes there, and with it the error of second order of frequencies.
Source: Azarov, Gouskov, Panovko (2023), eq. (9) and below.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..core.extremes import bounded
from ..core.quantities import Scalar
from .greens import AbstractKernel, HeldKernel
from .line import Held, PerLength, gauss_points
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

    def energy(self, bending: bool) -> Float[Array, "n n"]:
        """`Int EI z''^2 dx`."""
        del bending
        x, weights = (part.ravel() for part in gauss_points(self.breaks))
        bent = jax.vmap(jax.jacfwd(self.slope_row))(x)
        return jnp.einsum("x,xn,xm->nm", weights * self.kernel.rigidity(x), bent, bent)

    def form(self, at: Scalar, derivative: int) -> Float[Array, " n"]:
        """Cubic Hermite interpolation between the nodes."""
        m, width = self.cells, self.length / self.cells
        cell = bounded(jnp.ceil(at / width) - 1, 0, m - 1).astype(int)
        left, right = jnp.eye(m + 1)[cell], jnp.eye(m + 1)[cell + 1]
        value, slope, value_, slope_ = hermite(at / width - cell, derivative)
        slopes = width / self.length * (slope * left + slope_ * right)  # of the unknown l z'
        row = jnp.concatenate([value * left + value_ * right, slopes])[self._unconstrained]
        return row / width if derivative else row

    def term(self, at: Scalar, derivative: int) -> Float[Array, " n"]:
        """The equation of a node with an auxiliary constraint is the balance of its rigid motion."""
        kernel, couple = self.kernel, bool(derivative)
        displaced, tilted = (
            kernel.response(self.nodes, at, slope, couple) for slope in (False, True)
        )
        equations = jnp.concatenate([displaced, self.length * tilted])
        if isinstance(kernel, HeldKernel):
            for number, node in enumerate(self._free_nodes):
                work = kernel.compliance * kernel.rigid(number, at, couple)
                equations = equations.at[node].set(work)
        return equations[self._unconstrained]

    def along(self, per_length: PerLength, derivative: int) -> Float[Array, "n n"]:
        terms = self._terms(derivative) * per_length * self._weights()
        none = jnp.zeros_like(terms)
        both = [none, terms / self.length] if derivative else [terms, none]
        return jnp.concatenate(both, axis=1)[:, self._unconstrained]

    def load_along(self, per_length: PerLength) -> Float[Array, " n"]:
        return per_length * (self._terms(0) @ self._weights())

    def _terms(self, derivative: int) -> Float[Array, "n nodes"]:
        return jax.vmap(lambda at: self.term(at, derivative), out_axes=1)(self.nodes)

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
