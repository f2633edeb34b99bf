"""Collocation of the integral equation of a beam on spans of Legendre-Gauss-Lobatto nodes.

    z(x_i) = Sum_j [ Int G(x_i, s) h_j(s) ds ] p_j,   p = load per length, h_j = interpolants

The kernel times the interpolant is a polynomial on either side of `s = x_i`, so Gauss quadrature
split there is exact, and the error falls exponentially with the number of nodes a span.
"""

import functools
from collections.abc import Callable

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from numpy.polynomial import legendre

from ..quantities import Scalar
from .greens import CantileverKernel
from .line import AbstractLine


class SpectralLine(AbstractLine):
    """`q = (z at the nodes, l z' at the inner ends)`: Lobatto nodes of spans, the clamp left out.

    Where two spans meet the interpolant keeps the slope, scaled by the length `l` of the shaft, as
    an unknown collocated by `dG/dx`: a disc there would otherwise see the slope of one side only,
    and a high mode could grow.
    """

    kernel: CantileverKernel
    ends: Float[Array, " ends"]
    degree: int = eqx.field(static=True)

    @property
    def nodes(self) -> Float[Array, " nodes"]:
        """Stations of the displacements [m]."""
        inner = jnp.asarray(lobatto(self.degree))[1:]  # (degree,)
        return (self.ends[:-1, None] + self._widths[:, None] * inner).ravel()

    @property
    def stiffness(self) -> Float[Array, "n n"]:
        return jnp.eye(self.nodes.size + self._inner.size)

    def row(self, at: Scalar) -> Float[Array, " n"]:
        local, inside = self._locate(at)
        return self._gather(inside[:, None] * self._shapes(local[:, None])[:, 0])

    def slope_row(self, at: Scalar) -> Float[Array, " n"]:
        local, inside = self._locate(at)
        return self._gather(inside[:, None] * self._slopes(local[:, None])[:, 0])

    def column(self, at: Scalar) -> Float[Array, " n"]:
        return self._collocate(self._by_force, lambda kernel, x: kernel(x, at))

    def couple_column(self, at: Scalar) -> Float[Array, " n"]:
        return self._collocate(self._by_couple, lambda kernel, x: kernel(x, at))

    def forces_along(self) -> Float[Array, "n n"]:
        return self._collocate(self._by_force, functools.partial(self._integrate, self._shapes))

    def couples_along(self) -> Float[Array, "n n"]:
        return self._collocate(self._by_couple, functools.partial(self._integrate, self._slopes))

    def load_along(self) -> Float[Array, " n"]:
        return self._collocate(self._by_force, self._total)

    # --- equations

    @property
    def _by_force(self) -> tuple[Callable, Callable]:
        return self.kernel.deflection, self.kernel.slope

    @property
    def _by_couple(self) -> tuple[Callable, Callable]:
        return self.kernel.deflection_by_couple, self.kernel.slope_by_couple

    def _collocate(self, kernels: tuple[Callable, Callable], evaluate: Callable) -> Array:
        """Equations of displacement at the nodes, then of scaled slope at the inner ends."""
        displacement, slope = kernels
        equations = evaluate(displacement, self.nodes)
        if not self._inner.size:
            return equations
        slopes = self.ends[-1] * evaluate(slope, self._inner)
        return jnp.concatenate([equations, slopes])

    def _integrate(self, shapes: Callable, kernel: Callable, x: Array) -> Float[Array, "i n"]:
        """`Int kernel(x_i, s) h_j(s) ds`."""
        s, weight, local = self._quadrature(x)
        values = weight * kernel(x[:, None, None], s)
        return self._gather(jnp.einsum("ipg,ipgj->ipj", values, shapes(local)))

    def _total(self, kernel: Callable, x: Array) -> Float[Array, " i"]:
        """`Int kernel(x_i, s) ds`."""
        s, weight, _ = self._quadrature(x)
        return jnp.sum(weight * kernel(x[:, None, None], s), axis=(1, 2))

    def _quadrature(self, x: Array) -> tuple[Array, Array, Array]:
        """Gauss points (x, spans, g) on both sides of `s = x_i`, exact for the kernel times h_j."""
        points, weights = np.polynomial.legendre.leggauss(self.degree // 2 + 4)
        start, stop = self.ends[:-1], self.ends[1:]
        kink = jnp.clip(x[:, None], start, stop)
        low = jnp.stack([jnp.broadcast_to(start, kink.shape), kink], axis=-1)
        high = jnp.stack([kink, jnp.broadcast_to(stop, kink.shape)], axis=-1)
        half = (high - low)[..., None] / 2
        s = (low[..., None] + half * (1 + jnp.asarray(points))).reshape(*kink.shape, -1)
        weight = (half * jnp.asarray(weights)).reshape(*kink.shape, -1)
        return s, weight, (s - start[:, None]) / self._widths[:, None]

    # --- interpolants

    @property
    def _inner(self) -> Float[Array, " inner"]:
        """Ends where two spans meet [m]."""
        return self.ends[1:-1]

    @property
    def _widths(self) -> Float[Array, " spans"]:
        return jnp.diff(self.ends)

    def _locate(self, at: Scalar) -> tuple[Array, Array]:
        """Local coordinate of a station in every span, and which span holds it."""
        inside = jnp.arange(self._widths.size) == jnp.searchsorted(self._inner, at)
        return (at - self.ends[:-1]) / self._widths, inside

    def _shapes(self, local: Array, derivative: int = 0) -> Float[Array, "*x spans g shapes"]:
        """Interpolants of every span: by its displacements, then by its slopes at either end."""
        count = self._widths.size
        coefficients = np.stack(
            [_to_legendre(self.degree, k > 0, k < count - 1) for k in range(count)]
        )
        basis = legendre_polynomials(self.degree + 2, local, derivative)
        shapes = jnp.einsum("...pgd,pdj->...pgj", basis, coefficients)
        scale = (self._widths / self.ends[-1])[:, None, None]
        by_slopes = shapes[..., self.degree + 1 :] * scale
        return jnp.concatenate([shapes[..., : self.degree + 1], by_slopes], axis=-1)

    def _slopes(self, local: Array) -> Float[Array, "*x spans g shapes"]:
        return self._shapes(local, 1) / self._widths[:, None, None]

    def _gather(self, by_span: Array) -> Array:
        """(.., spans, degree + 3) -> (.., n): neighbours share ends, the clamp is dropped."""
        own, left, right = by_span[..., 1:-2], by_span[..., -2], by_span[..., -1]
        shared = jnp.pad(by_span[..., 1:, 0], [(0, 0)] * (own.ndim - 2) + [(0, 1)])
        displacements = own.at[..., -1].add(shared).reshape(*own.shape[:-2], -1)
        return jnp.concatenate([displacements, right[..., :-1] + left[..., 1:]], axis=-1)


def lobatto(degree: int) -> np.ndarray:
    """Legendre-Gauss-Lobatto nodes on [0, 1], `degree + 1` of them, ascending."""
    inner = np.sort(legendre.Legendre.basis(degree).deriv().roots().real)
    return (np.concatenate([[-1.0], inner, [1.0]]) + 1) / 2


@functools.cache
def _to_legendre(degree: int, left: bool, right: bool) -> np.ndarray:
    """Legendre coefficients of the interpolants of the Lobatto nodes and the slopes at either end.

    Columns are values, then both slopes (by the coordinate in [0, 1]); a slope that is not kept is
    a column of zeros, and the polynomials have a degree less.
    """
    kept = [*range(degree + 1), *[degree + 1] * left, *[degree + 2] * right]
    values = legendre.legvander(2 * lobatto(degree) - 1, degree + 2)
    slopes = 2 * np.stack(
        [legendre.legval([-1, 1], legendre.legder(e)) for e in np.eye(degree + 3)]
    )
    conditions = np.concatenate([values, slopes.T])[kept, : len(kept)]
    coefficients = np.zeros((degree + 3, degree + 3))
    coefficients[: len(kept), kept] = np.linalg.inv(conditions)
    return coefficients


def legendre_polynomials(degree: int, local: Array, derivative: int = 0) -> Array:
    """`P_k(2 local - 1)`, or its first derivative by `local`, k = 0..degree: (.., degree + 1)."""
    t = 2 * jnp.asarray(local) - 1
    values, slopes = [jnp.ones_like(t), t], [jnp.zeros_like(t), jnp.ones_like(t)]
    for k in range(1, degree):
        values.append(((2 * k + 1) * t * values[k] - k * values[k - 1]) / (k + 1))
        slopes.append(slopes[k - 1] + (2 * k + 1) * values[k])
    return 2.0 * jnp.stack(slopes, axis=-1) if derivative else jnp.stack(values, axis=-1)
