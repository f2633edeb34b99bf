"""Shapes: a few vectors, not modes, of which a rotor's deviation from its steady response is made up."""

import math

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float, Inexact

from ..core import linalg
from ..core.compiled import compiled_quickly
from ..core.extremes import larger
from ..core.quantities import Scalar
from ..equations.pencil import Pencil, isotropic
from ..equations.system import System


GROWTH = 1 / (2 * math.pi)  # rate at which test forces grow, over that of rotation: e a revolution
BEYOND = 2.0  # highest frequency over that of rotation and of the rotor on its hardest stop
RESPONSES = 12  # frequencies of the forces whose responses make the shapes
TRIED = 48  # frequencies at which the error is taken
ROUNDING = 1e-14  # importance of a shape, relative to the first, below which it is rounding


class Shapes(eqx.Module):
    """`q = right a`, `a = (left M right)^-1 left M q`, with `left M right = 1` but for its derivative.

    The equations of the amplitudes are then `left P(l) right`, without an inverse of the inertia.
    """

    right: Float[Array, "n k"]
    left: Float[Array, "k n"]
    inertia: Float[Array, "n n"]

    @classmethod
    def of(cls, system: System, rate: Scalar, rows: Float[Array, "s n"], count: int) -> "Shapes":
        """The shapes that matter most where ports are driven, and ports and stations are seen.

            X = [Re, Im] of P(l_j)^-1 columns,   Y = [Re, Im] of P(l_j)^-T rows^T,   Y^T M X = U S V^T
            right = X V S^(-1/2),   left = S^(-1/2) U^T Y^T

        The forces at the ports grow by e in a revolution, `l_j = (1 / 2 pi + i w_j) rate`, so that no
        response is unbounded; for their frequencies see `_roots`. Shapes are not differentiated: what they
        change is of second order in their error.

        Args:
            system: a rotor with ports, and with mass at all coordinates.
            rate: 2 pi over the length of a revolution [rad/s].
            rows: stations that are seen besides the ports.
            count: number of shapes.

        Returns:
            `Shapes`, the most important first; zeros in place of those beyond the rank of the responses.

        Source: Willcox, Peraire (2002), AIAA J. 40, 2323, balanced proper orthogonal decomposition.
        """
        inertia = system.blocks.inertia
        assert inertia is not None
        system, rate, rows = jax.lax.stop_gradient((system, rate, rows))
        pencil, roots = Pencil.of(system).along_axes, _roots(system, rate, RESPONSES)
        columns, seen = _columns(system), jnp.concatenate([_rows(system), rows])
        right = _responses(pencil, roots, columns)
        transposed: Pencil = jax.tree.map(jnp.transpose, pencil)
        left = _responses(transposed, roots, seen.T)
        energy = left.T @ jax.lax.stop_gradient(inertia) @ right
        u, sizes, v = linalg.svd(energy, full_matrices=False)
        there = sizes > ROUNDING * sizes[0]
        scale = jnp.where(there, 1 / jnp.sqrt(jnp.where(there, sizes, 1.0)), 0.0)
        found = right @ (v.T * scale), (u * scale).T @ left.T
        return cls(found[0][:, :count], found[1][:count], inertia)

    def within(self, a: Inexact[Array, "m m"]) -> tuple[Array, Array, Array]:
        """First-order equations of the amplitudes by those of the rotor; matrices from and to them."""
        momentum = self.left @ self.inertia
        absent = jnp.diag(1.0 * jnp.all(self.left == 0, axis=1))
        amplitudes = linalg.solve(momentum @ self.right + absent, momentum)
        same = jnp.eye(a.shape[0] // self.right.shape[0])
        into = jnp.kron(same, self.right).astype(a.dtype)
        back = jnp.kron(same, amplitudes).astype(a.dtype)
        return back @ a @ into, into, back


@compiled_quickly
def shape_errors(
    system: System, rate: Scalar, stations: Float[Array, " s"], most: int
) -> Float[Array, " most"]:
    """Errors by 1 .. `most` shapes: of motions of ports and stations, by that which a stop hinders.

        error = max_j |(H_k - H) (H + 1 / L)^-1|,   H = rows P(l_j)^-1 columns,   L = k + l_j c

    `H` is the compliance of the rotor, `L` the stiffness of the hardest stop at each port, and
    `(H + 1 / L)^-1` the force by which a stop answers a motion that the rotor would have without it.
    Responses to the start and to the unbalance are not in this error. It is not a number where a law
    states no stiffness, as that of a `CubicSpring`, and infinite where no force moves a port.
    """
    rows = jax.vmap(system.line.row)(stations)
    shapes = Shapes.of(system, rate, rows, most)
    pencil, roots = Pencil.of(system).along_axes, _roots(system, rate, TRIED)
    axes = np.eye(pencil.inertia.shape[0] // system.n)
    columns, at_ports = jnp.kron(axes, _columns(system)), jnp.kron(axes, _rows(system))
    seen = jnp.concatenate([at_ports, jnp.kron(axes, rows)])
    right, left = jnp.kron(axes, shapes.right), jnp.kron(axes, shapes.left)
    hardness = jnp.stack([port.hardness() for port in system.ports])
    alive = jnp.any(shapes.left != 0, axis=1)

    def errors(root: Array) -> Array:
        exact = pencil.at(root)
        compliance = linalg.solve(exact, columns)
        soft = jnp.kron(axes, jnp.diag(1 / (hardness[:, 0] + root * hardness[:, 1])))
        pressed = linalg.inv(at_ports @ compliance + soft)

        def error(count: Array) -> Array:
            there = jnp.tile(alive & (jnp.arange(most) < count), len(axes))
            small = jnp.where(there[:, None] & there, left @ exact @ right, jnp.eye(len(left)))
            forced = jnp.where(there[:, None], left @ columns, 0.0)
            found = right @ linalg.solve(small, forced)
            error = jnp.max(jnp.abs(seen @ (found - compliance) @ pressed))
            return jnp.where(jnp.any(alive), error, jnp.inf)

        return jax.vmap(error)(jnp.arange(1, most + 1))

    return jnp.max(jax.lax.map(errors, roots), axis=0)


def _columns(system: System) -> Float[Array, "n p"]:
    return jnp.stack([port.column for port in system.ports], axis=1)


def _rows(system: System) -> Float[Array, "p n"]:
    return jnp.stack([port.row for port in system.ports])


def _roots(system: System, rate: Scalar, count: int) -> Complex[Array, " c"]:
    """Complex frequencies of forces, up to `BEYOND` times the rate and the rotor's frequency on its stops.

    A force at a port finds the mass `1 / (row M^-1 column)` there. Real equations respond alike to a
    frequency and its negative.
    """
    light = jnp.sum(_rows(system).T * linalg.solve(system.blocks.inertia, _columns(system)), 0)
    stiff = jnp.stack([port.hardness()[0] for port in system.ports])
    top = BEYOND * larger(jnp.sqrt(jnp.max(stiff * light)), rate)
    if isotropic(system.blocks):
        return GROWTH * rate + 1j * jnp.linspace(-top, top, count)
    return GROWTH * rate + 1j * jnp.linspace(0.0, top, count // 2)


def _responses(
    pencil: Pencil, roots: Complex[Array, " c"], forces: Float[Array, "n f"]
) -> Float[Array, "n r"]:
    """Real and imaginary parts of the responses along all axes to forces along each."""
    axes = np.eye(pencil.inertia.shape[0] // len(forces))
    found = jax.lax.map(lambda root: linalg.solve(pencil.at(root), jnp.kron(axes, forces)), roots)
    along = found.reshape(len(roots), len(axes), len(forces), -1)
    parts = jnp.moveaxis(jnp.stack([along.real, along.imag]), 3, 0)
    return parts.reshape(len(forces), -1)
