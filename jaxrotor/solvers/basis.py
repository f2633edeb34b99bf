"""Bases: coordinates in which the linear part of a motion is advanced exactly."""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Complex, Float, Inexact, Int

from ..core import linalg
from ..core.lanes import product
from ..core.quantities import Scalar
from .phi import balancing_units, phi_dense, phi_scalar
from .shapes import Shapes


Count = int | Int[Array, ""]  # of revolutions; with a traced one, one program serves all counts

WORST_CONDITION = 1e5  # of the eigenvectors: beyond it, modal coordinates cost over 5 digits
EQUILIBRATIONS = 4  # rounds of scaling rows and columns before the condition is taken


class ModalBasis(eqx.Module):
    """`A = V diag(values) V^-1`: coordinates are amplitudes of the modes."""

    values: Complex[Array, " m"]
    vectors: Complex[Array, "n2 m"]
    inverse: Complex[Array, "m n2"]

    @classmethod
    def build(cls, a: Complex[Array, "m m"]) -> "ModalBasis":
        return cls(*_modes(a))

    def matrix(self) -> Complex[Array, "m m"]:
        """`A` in this basis."""
        return jnp.diag(self.values)

    def flow(self, span: Scalar, b: Complex[Array, "m p"], count: int) -> tuple[Any, list[Array]]:
        """`exp(span A)` and `span phi_k(span A) b`, k = 1 .. count, in this basis."""
        first, *rest = phi_scalar(span * self.values, count)
        return first, [span * phi[:, None] * b for phi in rest]

    def apply(self, flow: Complex[Array, " m"], b: Complex[Array, "m p"]) -> Complex[Array, "m p"]:
        """`exp(span A) b`."""
        return flow[:, None] * b

    def twice(self, flow: Complex[Array, " m"]) -> Complex[Array, " m"]:
        """`exp(2 span A)`."""
        return flow**2

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
def _modes(a: Inexact[Array, "m m"]) -> tuple[Array, Array, Array]:
    """Eigenvalues, eigenvectors, and their inverse, by a matrix in balanced units.

    In raw units the inverse loses up to ten digits of what stiff supports carry.
    """
    units = balancing_units(a)
    values, vectors = linalg.eig(a * units / units[:, None])
    return values, vectors * units[:, None], linalg.inv(vectors) / units


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


class SlotBasis(eqx.Module):
    """Real modal coordinates of a real `A`: two of them, a slot, for every two eigenvalues.

    A slot is a conjugate pair, `Y = Re(v (a + i b))`, or two real eigenvalues, `Y = v1 a + v2 b`. How
    many there are of either is known only by the values, so shapes do not depend on it. The state has
    the first coordinates of all slots, then the second.
    """

    values: Complex[Array, "2 j"]  # of the first and of the second coordinate
    pairs: Bool[Array, " j"]
    vectors: Float[Array, "n4 m"]
    inverse: Float[Array, "m n4"]

    @classmethod
    def build(cls, a: Float[Array, "m m"]) -> "SlotBasis":
        values, vectors, _ = _modes(a)
        size = values.size // 2
        half = jnp.where(values.imag > 0, 0, jnp.where(values.imag < 0, 1, 2))
        order = jnp.argsort(half, stable=True)  # of a pair only the upper one is read
        upper, slot = jnp.sum(half == 0), jnp.arange(size)
        pairs = slot < upper
        first = order[jnp.where(pairs, slot, 2 * slot)]
        second = order[jnp.where(pairs, upper + slot, 2 * slot + 1)]
        one, other = vectors[:, first], vectors[:, second]
        real = jnp.concatenate([one.real, jnp.where(pairs, -one.imag, other.real)], axis=1)
        units = balancing_units(a)
        inverse = linalg.inv(real / units[:, None]) / units
        return cls(jnp.stack([values[first], values[second]]), pairs, real, inverse)

    def matrix(self) -> Float[Array, "m m"]:
        """`A` in this basis."""
        own = self._blocks(self.values)
        one, two, three, four = map(jnp.diag, (own.one, own.two, own.three, own.four))
        return jnp.block([[one, two], [three, four]])

    def flow(self, span: Scalar, b: Float[Array, "m p"], count: int) -> tuple[Any, list[Array]]:
        """`exp(span A)` and `span phi_k(span A) b`, k = 1 .. count, in this basis."""
        first, *rest = phi_scalar((span * self.values).ravel(), count)
        blocks = lambda phi: self._blocks(phi.reshape(2, -1))
        return blocks(first), [span * self.apply(blocks(phi), b) for phi in rest]

    def apply(self, flow: "SlotRotation", b: Float[Array, "m p"]) -> Float[Array, "m p"]:
        """`exp(span A) b`."""
        return flow(b)

    def twice(self, flow: "SlotRotation") -> "SlotRotation":
        """`exp(2 span A)`."""
        one, two, three, four = flow.one, flow.two, flow.three, flow.four
        cross, trace = two * three, one + four
        return SlotRotation(one**2 + cross, two * trace, three * trace, four**2 + cross)

    def output_after(
        self, output: Float[Array, "s m"], flow: "SlotRotation"
    ) -> Float[Array, "s m"]:
        """`C exp(span A)`: outputs at the end of a span by the state at its start."""
        a, b = jnp.split(output, 2, axis=1)
        ahead = a * flow.one + b * flow.three, a * flow.two + b * flow.four
        return jnp.concatenate(ahead, axis=1)

    def propagator(self, flow: "SlotRotation") -> "SlotRotation":
        """The flow as it acts on the state."""
        return flow

    def advance_free(self, count: Count, w: Float[Array, " m"]) -> Float[Array, " m"]:
        """State after `count` revolutions without contact."""
        return self._blocks(jnp.exp(2 * jnp.pi * count * self.values))(w)

    def _blocks(self, f: Complex[Array, "2 j"]) -> "SlotRotation":
        """A function of `A`, by its values at the eigenvalues, in every slot."""
        turn = jnp.where(self.pairs, f[0].imag, 0.0)
        return SlotRotation(f[0].real, -turn, turn, jnp.where(self.pairs, f[0], f[1]).real)


def modal(a: Inexact[Array, "m m"], shapes: Shapes | None = None) -> ModalBasis | SlotBasis:
    """Modal coordinates of a complex or a real matrix, or of what it is for a few shapes."""
    return _within((ModalBasis if jnp.iscomplexobj(a) else SlotBasis).build, a, shapes)


def dense(a: Inexact[Array, "m m"], shapes: Shapes | None = None) -> "DenseBasis":
    """The state itself, or the amplitudes of a few shapes, as coordinates."""
    return _within(DenseBasis.build, a, shapes)


def _within(build: Callable, a: Array, shapes: Shapes | None) -> Any:
    """A basis, with vectors (m, c) and their left inverse (c, m) where shapes make it smaller."""
    if shapes is None:
        return build(a)
    smaller, into, back = shapes.within(a)
    own = build(smaller)
    parts = into @ own.vectors, own.inverse @ back
    return eqx.tree_at(lambda basis: (basis.vectors, basis.inverse), own, parts)


class DenseBasis(eqx.Module):
    """Coordinates are the state itself: no eigenvectors are needed or differentiated."""

    a: Inexact[Array, "m m"]
    vectors: Inexact[Array, "n2 m"]
    inverse: Inexact[Array, "m n2"]

    @classmethod
    def build(cls, a: Inexact[Array, "m m"]) -> "DenseBasis":
        own = jnp.eye(a.shape[0], dtype=a.dtype)
        return cls(a, own, own)

    def matrix(self) -> Inexact[Array, "m m"]:
        """`A` in this basis."""
        return self.a

    def flow(self, span: Scalar, b: Inexact[Array, "m p"], count: int) -> tuple[Any, list[Array]]:
        """`exp(span A)` and `span phi_k(span A) b`, k = 1 .. count, in this basis."""
        return phi_dense(span * self.a, span * b, count)

    def apply(self, flow: Inexact[Array, "m m"], b: Inexact[Array, "m p"]) -> Inexact[Array, "m p"]:
        """`exp(span A) b`."""
        return flow @ b

    def twice(self, flow: Inexact[Array, "m m"]) -> Inexact[Array, "m m"]:
        """`exp(2 span A)`."""
        return flow @ flow

    def output_after(
        self, output: Inexact[Array, "s m"], flow: Inexact[Array, "m m"]
    ) -> Inexact[Array, "s m"]:
        """`C exp(span A)`: outputs at the end of a span by the state at its start."""
        return output @ flow

    def propagator(self, flow: Inexact[Array, "m m"]) -> "Dense":
        """The flow as it acts on `[re, im]`."""
        return Dense(as_real(flow))

    def advance_free(self, count: Count, w: Inexact[Array, " m"]) -> Inexact[Array, " m"]:
        """State after `count` revolutions without contact."""
        once, _ = phi_dense(2 * jnp.pi * self.a, jnp.zeros((self.a.shape[0], 0), self.a.dtype), 0)
        if isinstance(count, int):
            return linalg.matrix_power(once, count) @ w

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


class SlotRotation(eqx.Module):
    """Propagator of real modal coordinates: a 2 by 2 block a slot, that of a pair a rotation."""

    one: Float[Array, " j"]
    two: Float[Array, " j"]
    three: Float[Array, " j"]
    four: Float[Array, " j"]

    def __call__(self, w: Float[Array, "m ..."]) -> Float[Array, "m ..."]:
        one, two, three, four = (
            part if part.ndim == w.ndim else part[:, None]
            for part in (self.one, self.two, self.three, self.four)
        )
        a, b = jnp.split(w, 2)
        return jnp.concatenate([one * a + two * b, three * a + four * b])


class Dense(eqx.Module):
    """Propagator of a state `[re, im]`: a full matrix."""

    matrix: Float[Array, "m2 m2"]

    def __call__(self, w: Float[Array, "m2 ..."]) -> Float[Array, "m2 ..."]:
        return product(self.matrix, w)


def well_conditioned(vectors: Array | np.ndarray) -> bool:
    """Whether the eigenvectors of all matrices, (.., m, k) and known, are far enough from merging.

    `|V| |V^-1|` in Frobenius norms is at least the condition and much cheaper, so singular values are
    computed only where it exceeds the limit; and equal matrices, as of lanes at one speed, only once.
    """
    matrices = np.asarray(vectors).reshape(-1, *np.shape(vectors)[-2:])
    distinct = np.stack(list({one.tobytes(): one for one in matrices}.values()))
    scaled = _equilibrated(distinct)
    if not np.isfinite(scaled).all():
        return False
    try:
        with np.errstate(over="ignore"):  # of one that is singular but for rounding
            square = scaled.shape[-1] == scaled.shape[-2]  # few shapes have fewer columns
            inverse = np.linalg.inv(scaled) if square else np.linalg.pinv(scaled)
            bound = _frobenius(scaled) * _frobenius(inverse)
    except np.linalg.LinAlgError:  # one is singular
        return False
    return bool(np.all(condition(distinct[~(bound < WORST_CONDITION)]) < WORST_CONDITION))


def condition(vectors: Array | np.ndarray) -> np.ndarray:
    """Condition numbers of matrices, (.., m, m) and known, in units that make rows and columns alike.

    Displacements and velocities, slow and fast modes differ by orders of magnitude; that costs no digits.
    """
    scaled = _equilibrated(np.asarray(vectors))
    finite = np.asarray(np.isfinite(scaled).all(axis=(-1, -2)))
    found = np.linalg.cond(np.where(finite[..., None, None], scaled, 0.0))
    return np.where(finite, found, np.inf)


def _equilibrated(matrices: np.ndarray) -> np.ndarray:
    """Matrices with rows and columns scaled to be of like size."""
    for _ in range(EQUILIBRATIONS):
        for axis in (-1, -2):
            norm = np.linalg.norm(matrices, axis=axis, keepdims=True)
            matrices = matrices / np.where(norm > 0, norm, 1.0)
    return matrices


def _frobenius(matrices: np.ndarray) -> np.ndarray:
    """Frobenius norm of every matrix."""
    return np.linalg.norm(matrices, axis=(-1, -2))


def as_real(z: Inexact[Array, "..."]) -> Float[Array, "a2 b2"]:
    """Real matrix that acts on `[re, im]` as a complex one does on `re + i im`; a real one is kept."""
    if not jnp.iscomplexobj(z):
        return z
    return jnp.block([[z.real, -z.imag], [z.imag, z.real]])


def unpacked(basis: "Basis", y: Float[Array, " m2"]) -> Inexact[Array, " m"]:
    """`re + i im` of a state or of forces `[re, im]` in a complex basis; unchanged in a real one."""
    if not jnp.iscomplexobj(basis.vectors):
        return y
    real, imag = jnp.split(y, 2)
    return jax.lax.complex(real, imag)


def packed(w: Inexact[Array, " m"]) -> Float[Array, " m2"]:
    """`[re, im]` of complex numbers; real ones unchanged."""
    return jnp.concatenate([w.real, w.imag]) if jnp.iscomplexobj(w) else w


Basis = ModalBasis | SlotBasis | DenseBasis
