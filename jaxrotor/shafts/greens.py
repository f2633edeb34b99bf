"""Green's function of a beam: deflection under a unit force.

    EI w'''' = delta(x - s),   G(x, s) = Int_0^min(x,s) (x - u)(s - u)/EI du   (clamped-free)
             = [ <x - s>^3/6 - x^3/6 + x^2 s/2 ] / EI,   <a> = max(a, 0)

Every derivative is written out: automatic differentiation through `min` would give the wrong
slope on the diagonal. Source: Azarov, Gouskov, Panovko (2023), the kernel below eq. (9).
"""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array

from ..quantities import Scalar


class CantileverKernel(eqx.Module):
    """Clamped-free kernel; `x`, `s` in [0, length] broadcast; metres and newtons."""

    rigidity: Scalar  # EI [N m^2]

    def deflection(self, x: Array, s: Array | Scalar) -> Array:
        """`G(x, s)`: displacement at `x` by a unit force at `s` [m/N]."""
        return (_past(x, s) ** 3 / 6 - x**3 / 6 + x**2 * s / 2) / self.rigidity

    def slope(self, x: Array, s: Array | Scalar) -> Array:
        """`dG/dx`: slope at `x` by a unit force at `s` [1/N]."""
        return (_past(x, s) ** 2 / 2 - x**2 / 2 + x * s) / self.rigidity

    def deflection_by_couple(self, x: Array, s: Array | Scalar) -> Array:
        """`dG/ds`: displacement at `x` by a unit couple at `s` [1/N]."""
        return (x**2 / 2 - _past(x, s) ** 2 / 2) / self.rigidity

    def slope_by_couple(self, x: Array, s: Array | Scalar) -> Array:
        """`d2G/dx ds`: slope at `x` by a unit couple at `s` [1/(N m)]."""
        return (x - _past(x, s)) / self.rigidity


def _past(x: Array, s: Array | Scalar) -> Array:
    return jnp.where(x > s, x - s, 0.0)
