"""Collocation of the integral equation of a beam on Legendre-Gauss-Lobatto spans.

    z(x_i) = Sum_j [ Int G(x_i, s) l_j(s) ds ] p_j,   p = load per length, l_j = Lagrange polynomials

The kernel times the interpolant is a polynomial on either side of `s = x_i`, so Gauss quadrature
split there is exact, and the error falls exponentially with the number of nodes a span.
"""

import functools

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from numpy.polynomial import legendre

from ..quantities import Scalar
from .greens import CantileverKernel
from .line import AbstractLine


class SpectralLine(AbstractLine):
    """Displacements at Legendre-Gauss-Lobatto nodes of consecutive spans, the clamp left out."""

    kernel: CantileverKernel
    ends: Float[Array, " ends"]
    degree: int = eqx.field(static=True)

    @property
    def nodes(self) -> Float[Array, " n"]:
        """Stations of the coordinates [m]."""
        inner = jnp.asarray(lobatto(self.degree))[1:]  # (degree,)
        start, width = self.ends[:-1, None], jnp.diff(self.ends)[:, None]
        return (start + width * inner).ravel()

    @property
    def stiffness(self) -> Float[Array, "n n"]:
        return jnp.eye(self.nodes.size)

    def row(self, at: Scalar) -> Float[Array, " n"]:
        local, inside, _ = self._locate(at)
        return self._gather(inside[:, None] * interpolation(self.degree, local))

    def slope_row(self, at: Scalar) -> Float[Array, " n"]:
        local, inside, width = self._locate(at)
        slopes = interpolation(self.degree, local, 1) / width[:, None]
        return self._gather(inside[:, None] * slopes)

    def column(self, at: Scalar) -> Float[Array, " n"]:
        return self.kernel.deflection(self.nodes, at)

    def couple_column(self, at: Scalar) -> Float[Array, " n"]:
        return self.kernel.deflection_by_couple(self.nodes, at)

    def forces_along(self) -> Float[Array, "n n"]:
        s, weight, local, _ = self._quadrature()
        kernel = weight * self.kernel.deflection(self._targets(), s)
        return self._integrate(kernel, interpolation(self.degree, local))

    def couples_along(self) -> Float[Array, "n n"]:
        s, weight, local, width = self._quadrature()
        kernel = weight * self.kernel.deflection_by_couple(self._targets(), s)
        slopes = interpolation(self.degree, local, 1) / width[:, None, None, None]
        return self._integrate(kernel, slopes)

    def load_along(self) -> Float[Array, " n"]:
        s, weight, _, _ = self._quadrature()
        return jnp.sum(weight * self.kernel.deflection(self._targets(), s), axis=(1, 2, 3))

    def _targets(self) -> Array:
        return self.nodes[:, None, None, None]

    def _locate(self, at: Scalar) -> tuple[Array, Array, Array]:
        """Local coordinate of a station in every span, and which span holds it."""
        span = jnp.searchsorted(self.ends[1:-1], at)
        width = jnp.diff(self.ends)
        inside = jnp.arange(width.size) == span
        return (at - self.ends[:-1]) / width, inside, width

    def _quadrature(self) -> tuple[Array, Array, Array, Array]:
        """Gauss points (n, spans, 2 sides of the kink, g), exact for the kernel times l_j."""
        points, weights = np.polynomial.legendre.leggauss(self.degree // 2 + 3)
        start, stop = self.ends[:-1], self.ends[1:]
        kink = jnp.clip(self.nodes[:, None], start, stop)  # (n, spans)
        low = jnp.stack([jnp.broadcast_to(start, kink.shape), kink], axis=-1)
        high = jnp.stack([kink, jnp.broadcast_to(stop, kink.shape)], axis=-1)
        half = (high - low)[..., None] / 2
        s = low[..., None] + half * (1 + jnp.asarray(points))
        width = stop - start
        local = (s - start[:, None, None]) / width[:, None, None]
        return s, half * jnp.asarray(weights), local, width

    def _integrate(self, kernel: Array, shapes: Array) -> Float[Array, "n n"]:
        return self._gather(jnp.einsum("ipkg,ipkgj->ipj", kernel, shapes))

    def _gather(self, by_span: Array) -> Array:
        """(..., spans, degree + 1) -> (..., n): neighbours share a node, the clamp is dropped."""
        own = by_span[..., 1:]
        shared = jnp.pad(by_span[..., 1:, 0], [(0, 0)] * (own.ndim - 2) + [(0, 1)])
        return own.at[..., -1].add(shared).reshape(*own.shape[:-2], -1)


def lobatto(degree: int) -> np.ndarray:
    """Legendre-Gauss-Lobatto nodes on [0, 1], `degree + 1` of them, ascending."""
    inner = np.sort(legendre.Legendre.basis(degree).deriv().roots().real)
    return (np.concatenate([[-1.0], inner, [1.0]]) + 1) / 2


@functools.cache
def _to_legendre(degree: int) -> np.ndarray:
    """Legendre coefficients of the Lagrange polynomials of the Lobatto nodes, by columns."""
    return np.linalg.inv(legendre.legvander(2 * lobatto(degree) - 1, degree))


def interpolation(degree: int, local: Array, derivative: int = 0) -> Array:
    """Lagrange polynomials (or derivatives) of the Lobatto nodes at `local` in [0, 1]: (..., degree+1)."""
    t = 2 * jnp.asarray(local) - 1
    values, slopes = [jnp.ones_like(t), t], [jnp.zeros_like(t), jnp.ones_like(t)]
    for k in range(1, degree):
        values.append(((2 * k + 1) * t * values[k] - k * values[k - 1]) / (k + 1))
        slopes.append(slopes[k - 1] + (2 * k + 1) * values[k])
    basis = slopes if derivative else values
    scale = 2.0 if derivative else 1.0
    return scale * jnp.stack(basis[: degree + 1], axis=-1) @ _to_legendre(degree)
