"""Influence lines: the reaction of a constraint of a shaft to a load at any station."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..core import linalg
from ..core.quantities import Scalar
from .constraint import Constraint
from .greens import CantileverKernel


class Influence(eqx.Module):
    """Influence lines `phi_k(x)`: deflection where constraint k moves by one and the others hold.

        phi(x) = a + b x + Sum_j G(x, s_j) r_j,   Sum r_j = Sum s_j r_j + .. = 0

    By Betti's theorem the reaction of a constraint to loads is minus the work of the loads on its line.
    `kernel` is None for a rigid shaft.
    """

    kernel: CantileverKernel | None
    stations: Float[Array, " r"]
    length: Scalar
    holds_slope: tuple[bool, ...] = eqx.field(static=True)  # else it holds the displacement
    owners: tuple[int, ...] = eqx.field(static=True)  # index of the constraint of each line

    @classmethod
    def of(
        cls, kernel: CantileverKernel | None, constraints: tuple[Constraint, ...], length: Scalar
    ) -> "Influence | None":
        """Lines of all displacements and slopes that are held, in this order; None if there are none."""
        held = [
            (i, one.at, slope)
            for i, one in enumerate(constraints)
            for slope, there in ((False, one.displacement), (True, one.slope))
            if there
        ]
        if not held:
            return None
        owners, stations, holds_slope = zip(*held, strict=True)
        return cls(kernel, jnp.stack(stations), length, holds_slope, owners)

    def shapes(self, x: Scalar) -> Float[Array, " r"]:
        """`phi_k(x)` [1] of held displacements, [m] of held slopes."""
        return self._forms(x, False) @ self._coefficients

    def slopes(self, x: Scalar) -> Float[Array, " r"]:
        """Slope of the lines at `x` [1/m], [1]."""
        return self._forms(x, True) @ self._coefficients

    @property
    def _coefficients(self) -> Float[Array, "r2 r"]:
        count = len(self.holds_slope)
        held = jnp.stack(
            [
                self._forms(at, slope)
                for at, slope in zip(self.stations, self.holds_slope, strict=True)
            ]
        )
        # Least squares, as any rigid motion that the constraints leave free may be added.
        if self.kernel is None:
            return linalg.pinv(held)
        balance = jnp.concatenate([jnp.zeros((2, 2)), held[:, :2].T], axis=1)
        equations = jnp.concatenate([held, balance])
        return linalg.pinv(equations)[:, :count]

    def _forms(self, x: Scalar, slope: bool) -> Float[Array, " r2"]:
        """Deflection or slope at `x` due to unit rigid motions, then unit reactions."""
        zero, one = jnp.zeros_like(x), jnp.ones_like(x)
        rigid = [zero, one / self.length] if slope else [one, x / self.length]
        if self.kernel is None:
            return jnp.stack(rigid)
        size = self.kernel.bending[0] * self.length**3  # deflection due to a unit force, in scale
        reactions = [
            self.kernel.response(x, at, slope, couple) / size
            for at, couple in zip(self.stations, self.holds_slope, strict=True)
        ]
        return jnp.stack([*rigid, *reactions])
