"""Elastic line of a long stepped shaft in few coordinates: its slowest modes and static deflections.

    q = W a,   W = (rigid motions, modes of the shaft alone, residual deflections by forces and couples)

The deflections are those by a unit force at each station where effects act, and by a unit couple where
these act on the slope, less their part in the modes. So what effects do at rest is exact, and what they
do at a frequency w of whirl is exact but for the inertia of the modes left out. The coordinates are
orthogonal in the strain energy: `W' E W = 1` but for rigid motions. Source: Rubin (1975), residual
attachment modes; Craig, Kurdila, Fundamentals of Structural Dynamics (2006), section 17.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..core import linalg
from ..core.quantities import Scalar
from .line import AbstractSpectralLine, AbstractWorkLine, PerLength


MODES = 40  # of the shaft alone; docs/choosing.md has the error
# Of the length: of the pair of forces that stands for a couple, which sets its scale
COUPLE_ARM = 0.1
# Flexibility of a combination of loads, relative to the greatest, that counts as zero
FLOOR = 1e-12


class CondensedLine(AbstractWorkLine):
    """`z(x) = row(x) W a`: Galerkin's equations, the work of all forces on the columns of `W`.

    Derivatives take as given the forces that bend the shaft into `W`, not `W` itself: its functions follow
    where sections and stations move.
    """

    line: AbstractSpectralLine
    shapes: Float[Array, "n r"]  # W
    rigid: int = eqx.field(static=True)  # number of rigid motions, which come first
    anisotropy: Scalar | None

    @classmethod
    def of(
        cls,
        line: AbstractSpectralLine,
        inertia: Float[Array, "n n"],
        forces: list[Array],
        couples: list[Array],
    ) -> "CondensedLine":
        """The line with loads at some stations, whose shaft alone has a quadratic form of inertia."""
        rows = [jax.vmap(line.row)(jnp.stack(forces))] if forces else []
        if couples:
            slopes = jax.vmap(line.slope_row)(jnp.stack(couples))
            rows.append(COUPLE_ARM * line.breaks[-1] * slopes)
        loads = jnp.concatenate(rows).T
        flexibility, motions = line.flexibility, line.rigid_motions
        if motions is not None:
            # Forces less those of rigid acceleration deflect a free shaft, whatever supports it.
            root = linalg.cholesky(motions.T @ inertia @ motions)
            motions = linalg.solve_triangular(root, motions.T, lower=True).T
            flexibility = flexibility - motions @ (motions.T @ inertia @ flexibility)
            flexibility = flexibility - (flexibility @ inertia @ motions) @ motions.T
        by_mass, by_loads = _bending(*jax.lax.stop_gradient((flexibility, inertia, loads)))
        shapes, rigid = flexibility @ (inertia @ by_mass + loads @ by_loads), 0
        if motions is not None:
            rigid = motions.shape[1]
            first = jax.lax.stop_gradient(shapes[:, 0] @ inertia @ shapes[:, 0])  # 1 / w^2
            shapes = jnp.concatenate([motions * jnp.sqrt(first), shapes], axis=1)
        return cls(line=line, shapes=shapes, rigid=rigid, anisotropy=line.anisotropy)

    @property
    def breaks(self) -> Float[Array, " breaks"]:
        return self.line.breaks

    def energy(self, bending: bool) -> Float[Array, "r r"]:
        energy = self._condensed(self.line.energy(bending))
        return energy if bending else _orthonormal(self.rigid, energy)

    def form(self, at: Scalar, derivative: int) -> Float[Array, " r"]:
        return self.line.form(at, derivative) @ self.shapes

    def along(self, per_length: PerLength, derivative: int) -> Float[Array, "r r"]:
        return self._condensed(self.line.work_along(per_length, derivative))

    def load_along(self, per_length: PerLength) -> Float[Array, " r"]:
        return self.line.work_of_load(per_length) @ self.shapes

    def _condensed(self, form: Float[Array, "n n"]) -> Float[Array, "r r"]:
        return self.shapes.T @ form @ self.shapes


def _bending(
    flexibility: Float[Array, "n n"], inertia: Float[Array, "n n"], loads: Float[Array, "n s"]
) -> tuple[Float[Array, "n r"], Float[Array, "s r"]]:
    """`a` and `b` of the generalized forces `M a + loads b` that bend the shaft into columns of `W`."""
    count = loads.shape[1]
    root = linalg.cholesky(inertia)
    squares, vectors = linalg.eigh(root.T @ flexibility @ root)  # 1 / w^2, ascending
    squares, vectors = (part[..., : -MODES - 2 * count - 1 : -1] for part in (squares, vectors))
    modes = flexibility @ (root @ vectors) / jnp.sqrt(squares)  # of unit strain energy
    forces = modes / squares  # `M forces` bends the shaft into them
    found, spare = slice(MODES), slice(MODES + count, None)
    deflections = flexibility @ loads
    shares = forces[:, found].T @ (inertia @ deflections)
    deflections = deflections - modes[:, found] @ shares
    own = loads.T @ deflections
    # Loads of which a combination has no deflection of its own leave their places to faster modes.
    least = jnp.sqrt(FLOOR * jnp.max(jnp.diagonal(own)))
    across = least * forces[:, spare].T @ (inertia @ deflections)
    energy = jnp.block([[(own + own.T) / 2, across.T], [across, least**2 * jnp.eye(count)]])
    sizes, ways = (part[..., -count:] for part in linalg.eigh(energy))
    of_loads, of_modes = jnp.split(ways / jnp.sqrt(sizes), 2)
    rest = least * forces[:, spare] @ of_modes - forces[:, found] @ (shares @ of_loads)
    by_mass = jnp.concatenate([forces[:, found], rest], axis=1)
    return by_mass, jnp.pad(of_loads, [(0, 0), (MODES, 0)])


@eqx.filter_custom_jvp
def _orthonormal(rigid, energy):
    """`W' E W`, which is one but for rigid motions, where it is zero; its derivative is that of `E`."""
    return jnp.diag(jnp.asarray(np.arange(energy.shape[0]) >= rigid, energy.dtype))


@_orthonormal.def_jvp
def _orthonormal_jvp(primals, tangents):
    return _orthonormal(*primals), tangents[1]
