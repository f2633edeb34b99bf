"""Virtual work of the loads on a shaft, on given virtual displacements."""

from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..core.quantities import Scalar
from .line import AbstractLine, PerLength, gauss_points


class VirtualLine(AbstractLine):
    """Work of loads on `r` virtual displacements `shapes(x)`, for motions in the coordinates of `line`.

    In place of the equations of motion, effects then give the resultant of their forces
    (`shapes = 1, x`), Galerkin's equations (`shapes = row`) or a reaction (`Influence`). Stresses of the
    shaft count in Galerkin's equations only: they do no work on rigid motions nor, by Betti's theorem,
    on influence lines.
    """

    line: AbstractLine
    shapes: Callable[[Scalar], Float[Array, " r"]]
    slopes: Callable[[Scalar], Float[Array, " r"]]
    anisotropy: Scalar | None = None
    strained: bool = eqx.field(default=False, static=True)  # whether stresses of the shaft do work

    @classmethod
    def resultant(cls, line: AbstractLine, about: Scalar | float = 0.0) -> "VirtualLine":
        """Resultant force, and moment about the station `about` [m]."""
        shapes = lambda x: jnp.stack([jnp.ones_like(x), x - about])
        slopes = lambda x: jnp.stack([jnp.zeros_like(x), jnp.ones_like(x)])
        return cls(line=line, shapes=shapes, slopes=slopes)

    @classmethod
    def galerkin(cls, line: AbstractLine) -> "VirtualLine":
        """Galerkin's equations: work on the shapes of the coordinates."""
        return cls(
            line=line,
            shapes=line.row,
            slopes=line.slope_row,
            anisotropy=line.anisotropy,
            strained=True,
        )

    def restoring(self, bending: bool) -> Float[Array, "r n"]:
        return self.energy(bending)

    def energy(self, bending: bool) -> Float[Array, "r n"]:
        if self.strained:
            return self.line.energy(bending)
        return 0 * jnp.outer(self.column(jnp.zeros(())), self.row(jnp.zeros(())))

    def form(self, at: Scalar, derivative: int) -> Float[Array, " n"]:
        return self.line.form(at, derivative)

    def term(self, at: Scalar, derivative: int) -> Float[Array, " r"]:
        return self.slopes(at) if derivative else self.shapes(at)

    def along(self, per_length: PerLength, derivative: int) -> Float[Array, "r n"]:
        x, weights = self._quadrature(per_length)
        terms = jax.vmap(lambda at: self.term(at, derivative))(x)
        forms = jax.vmap(lambda at: self.form(at, derivative))(x)
        return jnp.einsum("x,xr,xn->rn", weights, terms, forms)

    def load_along(self, per_length: PerLength) -> Float[Array, " r"]:
        x, weights = self._quadrature(per_length)
        return weights @ jax.vmap(self.shapes)(x)

    @property
    def breaks(self) -> Float[Array, " breaks"]:
        return self.line.breaks

    def _quadrature(self, per_length: PerLength) -> tuple[Array, Array]:
        x, weights = gauss_points(self.breaks)
        return x.ravel(), (jnp.reshape(per_length, (-1, 1)) * weights).ravel()
