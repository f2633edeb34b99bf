"""Roots and modes of a rotor about its straight line."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Complex, Float

from ..pencil import Pencil
from ..quantities import Scalar
from ..scene import Scene
from ..system import System, assemble


class Modes(eqx.Module):
    """Natural motions `z(x, t) = shape(x) exp(lambda t)`, `m` of them at `x` stations."""

    values: Complex[Array, " m"]  # lambda [rad/s]
    shapes: Complex[Array, "m x"]  # largest component 1
    stations: Float[Array, " x"]  # [m]


@eqx.filter_jit
def roots(scene: Scene, count: int | None = None) -> Complex[Array, " m"]:
    """Complex eigenvalues: `det( lambda^2 M + lambda (C - i Omega G) + K - i Omega H ) = 0`.

    Of `x + i y`, so a positive imaginary part is forward whirl; real part negative is stable.
    Contact is absent: the straight rotor touches nothing.

    Args:
        scene: the rotor.
        count: how many of the slowest to return, by default all `2 n`.

    Returns:
        Roots [rad/s] by rising magnitude; of a pair, forward first. Differentiable where simple.

    Source: Azarov, Gouskov, Panovko (2023), eq. (9) without contact.
    """
    values = _values(assemble(scene))
    return values[_order(values)][:count]


@eqx.filter_jit
def modes(scene: Scene, count: int | None = None, points: int = 101) -> Modes:
    """Roots with their mode shapes at `points` stations along the shaft; see `roots`.

    The shapes are not differentiable (jax has no derivative of eigenvectors).
    """
    system = assemble(scene)
    rate = reference_rate(system)
    inverses, vectors = jnp.linalg.eig(Pencil(system).inverse(rate))
    values = rate / inverses
    order = _order(values)[:count]
    stations = jnp.linspace(0.0, scene.shaft.length, points)
    rows = jax.vmap(system.line.row)(stations)
    shapes = vectors[: system.n, order].T @ rows.T
    largest = jnp.argmax(jnp.abs(shapes), axis=1, keepdims=True)
    return Modes(values[order], shapes / jnp.take_along_axis(shapes, largest, axis=1), stations)


def _values(system: System) -> Complex[Array, " n2"]:
    rate = reference_rate(system)
    return rate / jnp.linalg.eigvals(Pencil(system).inverse(rate))


def _order(values: Complex[Array, " m"]) -> Array:
    return jnp.argsort(jnp.abs(values) * (1 + 1e-9 * (values.imag < 0)))


def reference_rate(system: System) -> Scalar:
    """Near the first natural frequency [rad/s]: `Sum 1/omega^2 = tr(K^-1 M)`. Scales equations."""
    flexibility = jnp.linalg.solve(system.blocks.stiffness, system.blocks.inertia)
    return jax.lax.stop_gradient(1 / jnp.sqrt(jnp.trace(flexibility)))
