"""Green's functions of beams: deflection due to a unit force, for any sections and constraints.

    G(x, s) = Int_0^min(x,s) (x - u)(s - u) / EI(u) du       (clamped at 0, free)

All derivatives are coded explicitly, as automatic differentiation through `min` would give a wrong
slope at x = s. Source: Azarov, Gouskov, Panovko (2023), the kernel below eq. (9).
"""

import abc

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..core import linalg
from ..core.extremes import bounded
from ..core.quantities import Scalar


class AbstractKernel(eqx.Module):
    """Response of the line at `x` to unit loads at `s`; both are in [0, length] and broadcast."""

    @abc.abstractmethod
    def response(
        self, x: Array | Scalar, s: Array | Scalar, slope: bool = False, couple: bool = False
    ) -> Array:
        """`G(x, s)`: displacement, or slope, at `x` due to a unit force, or couple, at `s`."""

    @abc.abstractmethod
    def rigidity(self, x: Array | Scalar) -> Array:
        """Bending stiffness `EI` at `x` [N m^2]."""


class CantileverKernel(AbstractKernel):
    """Beam clamped at 0 and free at its end, piecewise uniform: a sum of polynomials over `sections`.

    With `shear`, a force adds `Int_0^min(x,s) du / kGA`, and slopes are those of the sections.
    """

    starts: Float[Array, " sections"]  # start of each section [m], the first at 0
    bending: Float[Array, " sections"]  # 1 / EI [1/(N m^2)]
    shear: Float[Array, " sections"] | None = None  # 1 / kGA [1/N]

    def response(self, x, s, slope=False, couple=False):
        to_x, to_s, d = self._reach(x, s)
        if slope and couple:
            bent = d
        elif slope or couple:
            bent = (to_s if slope else to_x) * d - d**2 / 2
        else:
            bent = to_x * to_s * d - (to_x + to_s) * d**2 / 2 + d**3 / 3
        sheared = 0.0 if self.shear is None or slope or couple else self.shear * d
        return (self.bending * bent + sheared).sum(-1)

    def rigidity(self, x):
        return 1 / self.bending[jnp.searchsorted(self.starts, x, side="right") - 1]

    def _reach(self, x, s) -> tuple[Array, Array, Array]:
        """Distances from the start of each section to `x`, to `s`, and to min(x, s) within the section."""
        x, s = jnp.broadcast_arrays(jnp.asarray(x), jnp.asarray(s))
        stops = jnp.append(self.starts[1:], jnp.inf)
        below = jnp.where(x > s, s, x)[..., None]
        inside = bounded(below, self.starts, stops)
        return x[..., None] - self.starts, s[..., None] - self.starts, inside - self.starts


class HeldKernel(AbstractKernel):
    """Kernel for any rigid constraints `c`, from the clamped-free kernel `G` by one Schur complement.

        G_held(x, s) = G(x, s) - [G(x, c), E(x)] W [G(c, s); E(s)],   W = [[G(c, c), E(c)], [E(c)', 0]]^-1

    `E = (1, x)` are the rigid motions; the constraints take the place of the clamp at 0. The last `free`
    constraints are auxiliary: a coordinate moves each of them, and its reaction must vanish. All
    quantities are in units of the length and of `compliance = l^3 / EI`.
    """

    beam: CantileverKernel
    length: Scalar
    stations: Float[Array, " c"]
    # Whether each holds the slope, else displacement
    slopes: tuple[bool, ...] = eqx.field(static=True)
    free: int = eqx.field(static=True)
    inverse: Float[Array, "c2 c2"]

    def __init__(self, beam, length, stations, slopes: tuple[bool, ...], free: int):
        self.beam, self.length, self.stations = beam, length, stations
        self.slopes, self.free = slopes, free
        rows = [
            self._influences(at, sloped) * (length if sloped else 1.0)
            for at, sloped in zip(stations, slopes, strict=True)
        ]
        corner = jnp.concatenate([jnp.stack(rows)[:, -2:].T, jnp.zeros((2, 2))], axis=1)
        self.inverse = linalg.inv(jnp.concatenate([jnp.stack(rows), corner]))

    @property
    def compliance(self) -> Scalar:
        """`l^3 / EI` [m/N] at the start of the shaft."""
        return self.length**3 * self.beam.bending[0]

    def response(self, x, s, slope=False, couple=False):
        left, right = self._influences(x, slope), self._influences(s, couple)
        reactions = jnp.einsum("...i,ij,...j->...", left, self.inverse, right)
        return self.beam.response(x, s, slope, couple) - self.compliance * reactions

    def rigidity(self, x):
        return self.beam.rigidity(x)

    def rigid(self, number: int, x: Array | Scalar, slope: bool = False) -> Array:
        """Displacement or slope at `x` due to a unit motion of the auxiliary constraint `number`."""
        offset, tilt = self.inverse[-2:, len(self.slopes) - self.free + number]
        tilt, x = tilt / self.length, jnp.asarray(x)
        return tilt + jnp.zeros_like(x) if slope else offset + tilt * x

    def rigid_motion(self, number: int, nodes: Array, sloped: Array) -> Array:
        """That motion as displacements of `nodes`, then slopes at `sloped` scaled by the length."""
        tilted = self.length * self.rigid(number, sloped, slope=True)
        return jnp.concatenate([self.rigid(number, nodes), tilted])

    def _influences(self, x, sloped: bool) -> Float[Array, "*x c2"]:
        """Displacement or slope at `x` due to unit reactions of the constraints and unit rigid motions.

        By reciprocity also the response at the constraints to a unit force or couple at `x`.
        """
        x = jnp.asarray(x)
        elastic = [
            self.beam.response(x, at, sloped, held)
            * (self.length if held else 1.0)
            / self.compliance
            for at, held in zip(self.stations, self.slopes, strict=True)
        ]
        one, zero = jnp.ones_like(x), jnp.zeros_like(x)
        rigid = [zero, one / self.length] if sloped else [one, x / self.length]
        return jnp.stack([*elastic, *rigid], axis=-1)
