"""Modal damping: a damping ratio for each of the first modes."""

from typing import ClassVar

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..core import linalg
from ..core.blocks import Blocks
from ..core.quantities import Scalar, Series, series
from ..shafts.line import AbstractLine
from .base import AbstractDamping


ALIKE = 1e-9  # relative difference of eigenvalues that count as equal


class ModalDamping(AbstractDamping):
    """`C = M Phi diag(2 zeta omega) Phi' M`, with `K Phi = M Phi diag(omega^2)` and `Phi' M Phi = 1`.

    `ratios` are `zeta_k` of the modes of the rotor at rest without damping, by rising natural frequency.
    Each serves both planes, and is that of `roots` at rest if nothing else damps. Higher modes and motions
    without elastic resistance, get no damping. `M` is the inertia of the whole rotor, and `K` the
    stiffness of shaft and supports, of unequal axes the mean one, without cross-coupling. Derivatives end
    where modes of different ratios have the same frequency.
    Source: Wilson, Penzien, Evaluation of orthogonal damping matrices (1972).
    """

    kind: ClassVar[str] = "modal_damping"
    plural: ClassVar[str] = "modal_dampings"
    undamped: ClassVar[bool] = True

    ratios: Series = series("ratios [1]", least=1, nonnegative=True)

    def damping(self, line: AbstractLine, blocks: Blocks, motion: Blocks) -> Blocks:
        del line
        inertia, stiffness = motion.inertia, motion.stiffness
        if inertia is None or stiffness is None or blocks.inertia is None:
            return Blocks()
        if self.ratios.size > inertia.shape[0]:
            raise ValueError(
                f"`ratios [1]` are for the first {self.ratios.size} modes, but the rotor has only "
                f"{inertia.shape[0]}; give fewer."
            )
        shift = _shift(inertia, stiffness)
        flexibility = linalg.solve(stiffness + shift * inertia, inertia)
        return Blocks(damping=blocks.inertia @ _rates(flexibility, shift, self.ratios))


def _shift(inertia: Float[Array, "n n"], stiffness: Float[Array, "n n"]) -> Scalar:
    """About the square of the first frequency, which makes `K + shift M` regular."""
    stiff = jnp.max(jnp.abs(stiffness), axis=1, keepdims=True)
    held = stiff > 0
    size = linalg.norm(jnp.where(held, inertia / jnp.where(held, stiff, 1.0), 0.0))
    return jax.lax.stop_gradient(jnp.where(size > 0, 0.7 / jnp.where(size > 0, size, 1.0), 1.0))


@jax.custom_jvp
def _rates(
    flexibility: Float[Array, "n n"], shift: Scalar, ratios: Float[Array, " k"]
) -> Float[Array, "n n"]:
    """`Sum 2 zeta omega x y`: rows `y` read the speed of a mode, columns `x` are its shape.

    They are the eigenvectors of `B = (K + shift M)^-1 M` with the largest eigenvalues
    `nu = 1 / (omega^2 + shift)`.
    """
    values, shapes = _modes(flexibility)
    rates = _of_modes(values, shift, ratios)[0]
    return ((shapes * rates) @ linalg.inv(shapes)).real


def _modes(flexibility: Float[Array, "n n"]) -> tuple[Array, Array]:
    """Eigenvalues `nu`, falling, and eigenvectors as columns."""
    values, shapes = linalg.eig(flexibility)
    order = jnp.argsort(-values.real)
    return values.real[order], shapes[:, order]


def _of_modes(values: Array, shift: Scalar, ratios: Array) -> tuple[Array, Array, Array]:
    """`2 zeta omega` of all modes, its derivative by `nu`, and `2 omega` of those with a ratio."""
    first = values[: ratios.size]
    there = first > jnp.finfo(first.dtype).eps  # else without mass
    first = jnp.where(there, first, 1.0)
    square = jnp.where(there, 1 / first - shift, 0.0)
    moving = square > ALIKE * shift
    omega = jnp.sqrt(jnp.where(moving, square, 1.0))
    slope = jnp.where(moving, -ratios / (omega * first**2), 0.0)
    omega = jnp.where(moving, omega, 0.0)
    beyond = (0, values.size - ratios.size)
    return jnp.pad(2 * ratios * omega, beyond), jnp.pad(slope, beyond), 2 * omega


@_rates.defjvp
def _rates_jvp(primals, tangents):
    """`d f(B) = X (D o (Y dB X)) Y` with divided differences `D` of f (Daleckii, Krein)."""
    (flexibility, shift, ratios), (change, _, more) = primals, tangents
    values, shapes = _modes(flexibility)
    rates, slopes, twice = _of_modes(values, shift, ratios)
    rows = linalg.inv(shapes)
    apart = values[:, None] - values
    same = jnp.abs(apart) <= ALIKE * jnp.abs(values)
    divided = (rates[:, None] - rates) / jnp.where(same, 1.0, apart)
    divided = jnp.where(same, (slopes[:, None] + slopes) / 2, divided)
    moved = shapes @ (divided * (rows @ change @ shapes)) @ rows
    k = ratios.size
    moved = moved + (shapes[:, :k] * (twice * more)) @ rows[:k]
    return ((shapes * rates) @ rows).real, moved.real
