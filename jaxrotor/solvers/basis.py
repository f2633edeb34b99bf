"""Bases: coordinates in which the linear part of a motion is advanced exactly."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float, Int

from ..core.quantities import Scalar
from .lanes import product
from .phi import phi_dense, phi_scalar


Count = int | Int[Array, ""]  # of revolutions; with a traced one, one program serves all counts

WORST_CONDITION = 1e5  # of the eigenvectors: beyond it, modal coordinates cost over 5 digits


class ModalBasis(eqx.Module):
    """`A = V diag(values) V^-1`: coordinates are amplitudes of the modes."""

    values: Complex[Array, " m"]
    vectors: Complex[Array, "m m"]
    inverse: Complex[Array, "m m"]

    @classmethod
    def build(cls, a: Complex[Array, "m m"]) -> "ModalBasis":
        return cls(*_modes(a))

    def matrix(self) -> Complex[Array, "m m"]:
        """`A` in this basis."""
        return jnp.diag(self.values)

    def flow(self, span: Scalar, b: Complex[Array, "m p"], count: int):
        """`exp(span A)` and `span phi_k(span A) b`, k = 1 .. count, in this basis."""
        first, *rest = phi_scalar(span * self.values, count)
        return first, [span * phi[:, None] * b for phi in rest]

    def apply(self, flow: Complex[Array, " m"], b: Complex[Array, "m p"]) -> Complex[Array, "m p"]:
        """`exp(span A) b`."""
        return flow[:, None] * b

    def output_after(
        self, output: Complex[Array, "s m"], flow: Complex[Array, " m"]
    ) -> Complex[Array, "s m"]:
        """`C exp(span A)`: outputs at the end of a span by the state at its start."""
        return output * flow

    def propagator(self, flow: Complex[Array, " m"]) -> "Rotation":
        """The flow as it acts on `[re, im]`."""
        return Rotation(flow.real, flow.imag)

    def advance_free(self, count: Count, w: Complex[Array, " m"]) -> Complex[Array, " m"]:
        """State after `count` revolutions without contact."""
        return jnp.exp(2 * jnp.pi * count * self.values) * w


@jax.custom_jvp
def _modes(a: Complex[Array, "m m"]) -> tuple[Array, Array, Array]:
    """Eigenvalues, eigenvectors, and their inverse."""
    values, vectors = jnp.linalg.eig(a)
    return values, vectors, jnp.linalg.inv(vectors)


@_modes.defjvp
def _modes_jvp(primals, tangents):
    """`dV = V F`, `F_ij = (V^-1 dA V)_ij / (lambda_j - lambda_i)`, with `F_ii = 0`.

    This fixes the scales of the eigenvectors to first order; results do not depend on them.
    """
    values, vectors, inverse = _modes(*primals)
    coupled = inverse @ tangents[0] @ vectors
    differences = values[None, :] - values[:, None]
    other = ~jnp.eye(values.size, dtype=bool)
    mixing = jnp.where(other, coupled / jnp.where(other, differences, 1.0), 0.0)
    changes = jnp.diagonal(coupled), vectors @ mixing, -mixing @ inverse
    return (values, vectors, inverse), changes


class DenseBasis(eqx.Module):
    """Coordinates are the state itself: no eigenvectors are needed or differentiated."""

    a: Complex[Array, "m m"]
    vectors: Complex[Array, "m m"]
    inverse: Complex[Array, "m m"]

    @classmethod
    def build(cls, a: Complex[Array, "m m"]) -> "DenseBasis":
        return cls(a, jnp.eye(a.shape[0]) + 0j, jnp.eye(a.shape[0]) + 0j)

    def matrix(self) -> Complex[Array, "m m"]:
        """`A` in this basis."""
        return self.a

    def flow(self, span: Scalar, b: Complex[Array, "m p"], count: int):
        """`exp(span A)` and `span phi_k(span A) b`, k = 1 .. count, in this basis."""
        return phi_dense(span * self.a, span * b, count)

    def apply(self, flow: Complex[Array, "m m"], b: Complex[Array, "m p"]) -> Complex[Array, "m p"]:
        """`exp(span A) b`."""
        return flow @ b

    def output_after(
        self, output: Complex[Array, "s m"], flow: Complex[Array, "m m"]
    ) -> Complex[Array, "s m"]:
        """`C exp(span A)`: outputs at the end of a span by the state at its start."""
        return output @ flow

    def propagator(self, flow: Complex[Array, "m m"]) -> "Dense":
        """The flow as it acts on `[re, im]`."""
        return Dense(as_real(flow))

    def advance_free(self, count: Count, w: Complex[Array, " m"]) -> Complex[Array, " m"]:
        """State after `count` revolutions without contact."""
        once, _ = phi_dense(2 * jnp.pi * self.a, jnp.zeros((self.a.shape[0], 0), complex), 0)
        if isinstance(count, int):
            return jnp.linalg.matrix_power(once, count) @ w

        def bit(state):  # binary powers, the lowest bit of the count first
            w, square, left = state
            return jnp.where(left % 2 == 1, square @ w, w), square @ square, left // 2

        return jax.lax.while_loop(lambda state: state[-1] > 0, bit, (w, once, count))[0]


class Rotation(eqx.Module):
    """Propagator of modal amplitudes `[re, im]`: one complex factor a mode."""

    real: Float[Array, " m"]
    imag: Float[Array, " m"]

    def __call__(self, w: Float[Array, "m2 ..."]) -> Float[Array, "m2 ..."]:
        a, b = jnp.split(w, 2)
        return jnp.concatenate([self.real * a - self.imag * b, self.real * b + self.imag * a])


class Dense(eqx.Module):
    """Propagator of a state `[re, im]`: a full matrix."""

    matrix: Float[Array, "m2 m2"]

    def __call__(self, w: Float[Array, "m2 ..."]) -> Float[Array, "m2 ..."]:
        return self.matrix @ w if w.ndim == 1 else product(self.matrix, w)


def well_conditioned(vectors: Array | np.ndarray) -> bool:
    """Whether the eigenvectors of all matrices, (.., m, m) and known, are far enough from merging."""
    return bool(np.all(np.linalg.cond(vectors) < WORST_CONDITION))


def as_real(z: Complex[Array, "a b"]) -> Float[Array, "a2 b2"]:
    """Real matrix that acts on `[re, im]` as a complex one does on `re + i im`."""
    return jnp.block([[z.real, -z.imag], [z.imag, z.real]])


def as_complex(y: Float[Array, " m2"]) -> Complex[Array, " m"]:
    """`re + i im`."""
    real, imag = jnp.split(y, 2)
    return jax.lax.complex(real, imag)
