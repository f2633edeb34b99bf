"""Massless coordinates: their motion follows at every instant from that of the coordinates with mass."""

from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Complex, Float

from ..core import linalg
from ..core.blocks import Blocks
from ..core.elimination import eliminated
from ..core.quantities import Scalar


Residual = Callable[[Complex[Array, " n"]], Complex[Array, " n"]]
Mask = Bool[Array, " n"] | Bool[np.ndarray, " n"]
# Masks of the damped and of the undamped massless coordinates, where all masses are known.
Known = tuple[tuple[bool, ...], tuple[bool, ...]]


class Massless(NamedTuple):
    """Constant masks of the massless coordinates of a scene, and whether a contact acts on one of them."""

    damped: tuple[bool, ...]
    undamped: tuple[bool, ...]
    pressed: bool


class MasslessCoordinates(eqx.Module):
    """Coordinates `s` without inertia: `(C r. + K r)_s = loads_s`, in the axes of the shaft.

    Where dampers or gyroscopic moments act, this equation gives the velocity `r._s` (first order). Where
    none do, it gives the displacement `r_s` itself (algebraic), and the velocity is the time derivative of
    that. Either mask is None where no coordinate is of its kind.

    The order of an equation changes where a mass or a damping becomes zero, so there are no derivatives
    by a mass or a damping that is zero. A coordinate is without mass where its row and its column of
    the inertia are exactly zero; `has_massless` raises on other motions without inertia.
    """

    damped: Mask | None
    undamped: Mask | None

    @classmethod
    def known(cls, masks: Known) -> "MasslessCoordinates":
        """Massless coordinates by constant masks; a kind that is absent leaves no trace in a program."""
        return cls(*(np.array(mask) if any(mask) else None for mask in masks))

    @classmethod
    def of(cls, blocks: Blocks, n: int) -> "MasslessCoordinates":
        """Massless coordinates of the equations of motion of `n` coordinates."""
        massless = ~_acts_on(n, blocks.inertia)
        damped = massless & _acts_on(
            n,
            blocks.damping,
            blocks.gyroscopic,
            blocks.skew_damping,
            blocks.fixed_damping,
            blocks.rotating_damping,
        )
        return cls(damped, massless & ~damped)

    @property
    def either(self) -> Mask:
        """Massless coordinates of both kinds."""
        if self.damped is None or self.undamped is None:
            mask = self.undamped if self.damped is None else self.damped
            assert mask is not None
            return mask
        return self.damped | self.undamped

    def inverse(self, inertia: Float[Array, "n n"]) -> Float[Array, "n n"]:
        """Inverse of the inertia of the coordinates with mass, zero elsewhere."""
        unit = jnp.diag(1.0 * self.either)
        return linalg.inv(inertia + unit) - unit

    def displacement(self, r: Complex[Array, " n"], residual: Residual) -> Complex[Array, " n"]:
        """`r` with its undamped massless part such that `residual(r)` vanishes there."""
        if self.undamped is None:
            return r
        return r + _solution(lambda change: residual(r + change), self.undamped)

    def velocity(self, drift: Complex[Array, " n"], residual: Residual) -> Complex[Array, " n"]:
        """`r.` with its damped massless part such that `residual(r.)` vanishes there."""
        if self.damped is None:
            return drift
        return drift + _solution(lambda change: residual(drift + change), self.damped)

    def condition(self, displaced: Residual, moving: Residual) -> Scalar:
        """Condition number of the equations; large where they do not determine the motion."""
        pairs = ((displaced, self.undamped), (moving, self.damped))
        parts = [_equations(residual, where) for residual, where in pairs if where is not None]
        return jnp.max(jnp.stack([linalg.cond(matrix) for matrix, _ in parts]))


def _acts_on(n: int, *blocks: Array | None) -> Bool[Array, " n"]:
    """Coordinates with a nonzero entry in at least one of the blocks."""
    found = jnp.zeros(n, bool)
    for block in blocks:
        if block is not None:
            found = found | jnp.any(block != 0, axis=0) | jnp.any(block != 0, axis=1)
    return found


def _solution(residual: Residual, where: Mask) -> Complex[Array, " n"]:
    """`x`, zero except at `where`, such that a residual that is real-linear in `x` vanishes there."""
    matrix, offset = _equations(residual, where)
    x = eliminated(matrix, -offset)
    return jnp.where(where, x[: where.size] + 1j * x[where.size :], 0.0)


def _equations(residual: Residual, where: Mask) -> tuple[Array, Array]:
    """Matrix and offset of the equations for `[Re x, Im x]`, each row scaled to its largest entry."""
    n, both = where.size, jnp.concatenate([where, where])

    def parts(x: Float[Array, " m"]) -> Float[Array, " m"]:
        x = jnp.where(both, x, 0.0)
        left = residual(x[:n] + 1j * x[n:])
        return jnp.where(both, jnp.concatenate([left.real, left.imag]), 0.0)

    offset = parts(jnp.zeros(2 * n))
    matrix = jax.vmap(parts, out_axes=1)(jnp.eye(2 * n)) - offset[:, None]
    matrix = matrix + jnp.diag(1.0 * ~both)
    size = jax.lax.stop_gradient(jnp.max(jnp.abs(matrix), axis=1, keepdims=True))
    scale = 1 / jnp.where(size > 0, size, 1.0)
    return scale * matrix, scale[:, 0] * offset


class Condensed(eqx.Module):
    """`Y' = A Y + B f`, `(q, q') = T Y + F f` of `M q'' + C q' + K q = b f` with massless coordinates.

    `Y` holds the displacements of the coordinates with mass and of the damped massless ones, and the
    velocities of those with mass. The other displacements and velocities follow from `Y` and from the
    forces `f` at once. Velocities of undamped coordinates do not contain what `f'` adds to them.
    """

    matrix: Float[Array, "k k"]
    drive: Float[Array, "k p"] | None
    lift: Float[Array, "m2 k"]
    feed: Float[Array, "m2 p"] | None  # None: no force acts on a massless coordinate
    kept: tuple[int, ...] = eqx.field(static=True)  # entries of (q, q') that make up `Y`

    @classmethod
    def of(
        cls,
        pencil: tuple[Float[Array, "m m"], Float[Array, "m m"], Float[Array, "m m"]],
        columns: Float[Array, "m p"] | None,
        massless: Massless,
    ) -> "Condensed":
        """Condensed equations of `M`, `C`, `K` and `b`, with two real unknowns a coordinate."""
        (inertia, damping, stiffness), m = pencil, pencil[0].shape[0]
        masks = [np.tile(mask, 2) for mask in (massless.damped, massless.undamped)]
        damped, undamped = (np.flatnonzero(mask) for mask in masks)
        heavy, held = np.flatnonzero(~(masks[0] | masks[1])), np.flatnonzero(~masks[1])
        forces = jnp.zeros((m, 0)) if columns is None else columns
        part = lambda block, rows, of: block[rows[:, None], of]
        solve = lambda matrix, right: linalg.solve(matrix, right) if len(matrix) else right
        size, p = held.size + heavy.size, forces.shape[1]
        # q = T Y + F f
        one = jnp.zeros((m, size + p)).at[held, np.arange(held.size)].set(1.0)
        if undamped.size:
            right = -stiffness[undamped] @ one
            right = right.at[:, size:].add(forces[undamped])
            one = one.at[undamped].set(solve(part(stiffness, undamped, undamped), right))
        elastic = -stiffness @ one
        elastic = elastic.at[:, size:].add(forces)  # b f - K q
        # q' of the coordinates that are held in Y
        two = jnp.zeros((m, size + p)).at[heavy, held.size + np.arange(heavy.size)].set(1.0)
        if damped.size:
            right = elastic[damped] - damping[damped] @ two
            two = two.at[damped].set(solve(part(damping, damped, damped), right))
        if undamped.size:
            right = -part(stiffness, undamped, held) @ two[held]
            two = two.at[undamped].set(solve(part(stiffness, undamped, undamped), right))
        three = solve(part(inertia, heavy, heavy), (elastic - damping @ two)[heavy])
        rates = jnp.concatenate([two[held], three])
        whole = jnp.concatenate([one, two])
        kept = (*map(int, held), *(m + int(i) for i in heavy))
        return cls(
            rates[:, :size],
            None if columns is None else rates[:, size:],
            whole[:, :size],
            whole[:, size:] if massless.pressed and columns is not None else None,
            kept,
        )
