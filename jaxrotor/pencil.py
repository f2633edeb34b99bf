"""Pencil: the linear part of a system as a quadratic of the growth rate."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Complex, Float

from .quantities import Scalar
from .system import System


class Pencil(eqx.Module):
    """`P(lambda) = lambda^2 M + lambda (C - i Omega G) + K - i Omega H` in complex coordinates.

    `M` is never inverted here: in collocation its eigenvalues are those of the flexibility, so the
    highest modes would cost the lowest their digits.
    """

    inertia: Float[Array, "n n"]
    damping: Complex[Array, "n n"]
    stiffness: Complex[Array, "n n"]

    def __init__(self, system: System):
        blocks, speed = system.blocks, system.spin.speed
        zero = jnp.zeros_like(system.line.stiffness)
        part = lambda block: zero if block is None else block
        self.inertia = part(blocks.inertia)
        self.damping = part(blocks.damping) - 1j * speed * part(blocks.gyroscopic)
        self.stiffness = part(blocks.stiffness) - 1j * speed * part(blocks.circulatory)

    def response(self, frequency: Scalar, force: Complex[Array, " n"]) -> Complex[Array, " n"]:
        """`q` of the steady motion `q exp(i frequency t)` under `force exp(i frequency t)`."""
        dynamic = self.stiffness + 1j * frequency * self.damping - frequency**2 * self.inertia
        return jnp.linalg.solve(dynamic, force)

    def inverse(self, rate: Scalar) -> Complex[Array, "n2 n2"]:
        """`A^-1` of `(q', q'') = A (q, q')` in the time `rate t`: eigenvalues are `rate / lambda`."""
        n = self.inertia.shape[0]
        upper = jnp.concatenate([rate * self.damping, rate**2 * self.inertia], axis=1)
        lower = jnp.concatenate([jnp.eye(n), jnp.zeros((n, n))], axis=1)
        return jnp.concatenate([-jnp.linalg.solve(self.stiffness, upper), lower])


def steady_response(system: System) -> tuple[Array | None, Array | None]:
    """`q = still + whirling exp(i Omega t)` of the system without contact; None without its load."""
    pencil, load, speed = Pencil(system), system.load, system.spin.speed
    still = whirling = None
    if load.constant is not None:
        still = pencil.response(jnp.zeros(()), load.constant)
    if load.unbalance is not None:
        whirling = pencil.response(speed, speed**2 * load.unbalance)
    return still, whirling
