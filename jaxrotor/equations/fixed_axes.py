"""Fixed axes: the linear equations without loads, as they are at one speed, and what other speeds add.

    Y' = A(Omega_c) Y + (Omega - Omega_c) [columns][rows] Y + ..,   ' = d/dtau,  tau = rate t

`Y = (q, q')` is complex where all axes are equal; where bearings make them unequal it is real,
`Y = (x, y, x', y')` with `q = x + i y`.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Complex, Float, Inexact

from ..core import linalg
from ..core.blocks import Blocks
from ..core.quantities import Scalar
from .constant_frame import linear_matrix
from .pencil import frame
from .system import System


class FixedAxes(eqx.Module):
    """First-order equations of a system at its speed, in time `tau = rate t`."""

    matrix: Inexact[Array, "m m"]
    rate: Scalar  # [rad/s]

    @classmethod
    def of(cls, system: System, rate: Scalar) -> "FixedAxes":
        """The equations of a system whose axes do not turn; loads are left out."""
        assert frame(system.blocks) == "fixed", "unequal axes that turn are periodic in fixed ones"
        return cls(linear_matrix(system, rate), rate)

    @property
    def equal(self) -> bool:
        """Whether all axes are equal, so that one complex coordinate serves both."""
        return jnp.iscomplexobj(self.matrix)

    def state(self, q: Complex[Array, " n"], velocity: Complex[Array, " n"]) -> Array:
        """State of coordinates and their rates per second."""
        parts = q, velocity / self.rate
        if self.equal:
            return jnp.concatenate(parts)
        return jnp.concatenate([side for part in parts for side in (part.real, part.imag)])

    def coordinates(self, state: Array) -> tuple[Complex[Array, " n"], Complex[Array, " n"]]:
        """Coordinates of a state, and their rates per second."""
        if self.equal:
            q, drift = jnp.split(state, 2)
        else:
            x, y, dx, dy = jnp.split(state, 4)
            q, drift = x + 1j * y, dx + 1j * dy
        return q, self.rate * drift

    def output(self, position: Inexact[Array, "s n"], velocity: Inexact[Array, "s n"]) -> Array:
        """Output matrix of `position q + velocity q.`, (s, m), or [Re, Im] of it (2s, m)."""
        rows = jnp.concatenate([position, self.rate * velocity], axis=1)
        if self.equal:
            return rows
        blocks = [[part.real, -part.imag] for part in jnp.split(rows, 2, axis=1)]
        turned = [[part.imag, part.real] for part in jnp.split(rows, 2, axis=1)]
        return jnp.block([sum(blocks, []), sum(turned, [])])

    def input(self, acceleration: Inexact[Array, "n c"]) -> Array:
        """Input matrix of numbers that cause these accelerations, (m, c), or of [Re, Im] of them."""
        force = acceleration / self.rate**2
        if self.equal:
            return jnp.concatenate([jnp.zeros_like(force), force])
        both = jnp.block([[force.real, -force.imag], [force.imag, force.real]])
        return jnp.concatenate([jnp.zeros_like(both), both])


class SpeedTerms(eqx.Module):
    """Acceleration that `k` signals cause, `columns (Omega - Omega_c) signals`.

        signals = L [(i H - S) q + i G q.]

    Signals are read and applied in the `k` slowest modes without damping; `k = n` is exact.
    """

    position: Complex[Array, "k n"]
    velocity: Complex[Array, "k n"]
    columns: Float[Array, "n k"]

    @classmethod
    def of(cls, system: System, most: int) -> "SpeedTerms | None":
        """The terms of a system in at most so many modes; None where nothing depends on the speed."""
        blocks = system.blocks
        if not depends_on_speed(blocks):
            return None
        inverse, zero = linalg.inv(blocks.inertia), jnp.zeros((system.n, system.n))
        part = lambda block: zero if block is None else inverse @ block
        position = 1j * part(blocks.circulatory) - part(blocks.skew_circulatory)
        velocity = 1j * part(blocks.gyroscopic)
        if most >= system.n:
            return cls(position, velocity, jnp.eye(system.n))
        modes, left = _slowest(inverse @ blocks.stiffness, most)
        onto = modes @ left
        return cls(left @ position @ onto, left @ velocity @ onto, modes)


def depends_on_speed(blocks: Blocks) -> bool:
    """Whether the linear equations depend on the speed of rotation."""
    parts = blocks.gyroscopic, blocks.circulatory, blocks.skew_circulatory
    return any(part is not None for part in parts)


def _slowest(stiffness: Float[Array, "n n"], count: int) -> tuple[Array, Array]:
    """The slowest modes `(n, count)` of `q.. + stiffness q = 0`, and the rows `(count, n)` that read them.

    They are a choice, not a result, and are not differentiated.
    """
    values, vectors = linalg.eig(jax.lax.stop_gradient(stiffness))
    order = jnp.argsort(values.real)
    values, vectors = values[order], vectors[:, order]
    # Of equal frequencies rounding can make a complex pair, whose real and imaginary parts serve.
    real = jnp.where(values.imag < 0, vectors.imag, vectors.real)
    return real[:, :count], linalg.inv(real)[:count]
