"""Influence lines: what a constraint of a shaft takes of a load anywhere on it."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..core.quantities import Scalar
from .constraint import Constraint
from .greens import CantileverKernel


class Influence(eqx.Module):
    """Influence lines `phi_k(x)`: constraint k moves by one, the others hold.

        phi(x) = a + b x + Sum_j G(x, s_j) r_j,   Sum r_j = Sum s_j r_j + .. = 0

    By Betti's theorem the reaction of the constraint to loads is minus their work on its line.
    `kernel` is None for a rigid shaft.
    """

    kernel: CantileverKernel | None
    stations: Float[Array, " r"]
    length: Scalar
    turns: tuple[bool, ...] = eqx.field(static=True)  # slope held, or displacement
    owners: tuple[int, ...] = eqx.field(static=True)  # which constraint each belongs to

    @classmethod
    def of(
        cls, kernel: CantileverKernel | None, constraints: tuple[Constraint, ...], length: Scalar
    ) -> "Influence | None":
        """Lines of all that constraints hold, displacement before slope; None without any."""
        held = [
            (i, one.at, slope)
            for i, one in enumerate(constraints)
            for slope, there in ((False, one.displacement), (True, one.slope))
            if there
        ]
        if not held:
            return None
        owners, stations, turns = zip(*held, strict=True)
        return cls(kernel, jnp.stack(stations), length, turns, owners)

    def shapes(self, x: Scalar) -> Float[Array, " r"]:
        """`phi_k(x)` [1] of held displacements, [m] of held slopes."""
        return self._forms(x, False) @ self._coefficients

    def slopes(self, x: Scalar) -> Float[Array, " r"]:
        """Slope of the lines at `x` [1/m], [1]."""
        return self._forms(x, True) @ self._coefficients

    @property
    def _coefficients(self) -> Float[Array, "r2 r"]:
        count = len(self.turns)
        held = jnp.stack(
            [self._forms(at, turn) for at, turn in zip(self.stations, self.turns, strict=True)]
        )
        # Least squares: where constraints leave a rigid motion free, any of it may be added.
        if self.kernel is None:
            return jnp.linalg.pinv(held)
        balance = jnp.concatenate([jnp.zeros((2, 2)), held[:, :2].T], axis=1)
        equations = jnp.concatenate([held, balance])
        return jnp.linalg.pinv(equations)[:, :count]

    def _forms(self, x: Scalar, slope: bool) -> Float[Array, " r2"]:
        """Of unit coefficients: rigid motions, then unit reactions."""
        zero, one = jnp.zeros_like(x), jnp.ones_like(x)
        rigid = [zero, one / self.length] if slope else [one, x / self.length]
        if self.kernel is None:
            return jnp.stack(rigid)
        kernel = self.kernel
        by_force, by_couple = (
            (kernel.slope, kernel.slope_by_couple)
            if slope
            else (kernel.deflection, kernel.deflection_by_couple)
        )
        size = kernel.bending[0] * self.length**3  # of deflection by a unit force
        parts = [
            by_couple(x, at) if turn else by_force(x, at)
            for at, turn in zip(self.stations, self.turns, strict=True)
        ]
        return jnp.stack([*rigid, *(part / size for part in parts)])
