"""Spectral elements of a Timoshenko beam, with separate displacement z and slope psi of the sections.

    2 U = Int [ EI psi'^2 + kGA (z' - psi)^2 ] dx,   z and psi continuous, polynomials on spans

The equations are in flexibility form: Galerkin's equations times the inverse of the stiffness, as those
of `SpectralLine`.

Every effect asks for rows and columns of its own; what computes them is compiled as a function, so that
it is traced once for all effects.
"""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from numpy.polynomial import legendre

from ..core import linalg
from ..core.quantities import Scalar
from .line import AbstractSpectralLine, Held, PerLength
from .polynomials import (
    incidence,
    interpolants,
    legendre_polynomials,
    node_of_ends,
)


class ShearLine(AbstractSpectralLine):
    """`q = (z at the nodes, l psi at the nodes)`, without the displacements and slopes that are held."""

    ends: Float[Array, " ends"]  # ends of the spans [m]
    bending: Float[Array, "#spans"]  # EI [N m^2]
    shear: Float[Array, "#spans"]  # kGA [N]
    degrees: tuple[int, ...] = eqx.field(static=True)  # degree of the polynomials on each span
    held: Held = eqx.field(static=True)
    anisotropy: Scalar | None

    @property
    def stiffness(self) -> Float[Array, "n n"]:
        unit = jnp.eye(self._unconstrained.size)
        rigid = self._rigid
        if rigid is None:
            return unit
        return unit - rigid @ linalg.solve(rigid.T @ rigid, rigid.T)

    @property
    def bending_stiffness(self) -> Float[Array, "n n"]:
        return self._deflection(self.bending_energy)

    @property
    def strain_energy(self) -> Float[Array, "n n"]:
        angle = self._at_gauss(0, 1) - self._at_gauss(1, 0) / self.ends[-1]
        return self.bending_energy + self._integral(self.shear, angle, angle)

    @property
    def bending_energy(self) -> Float[Array, "n n"]:
        curvature = self._at_gauss(1, 1) / self.ends[-1]
        return self._integral(self.bending, curvature, curvature)

    def row(self, at: Scalar) -> Float[Array, " n"]:
        return self._form(at, 0)

    def slope_row(self, at: Scalar) -> Float[Array, " n"]:
        return self._form(at, 1) / self.ends[-1]

    @eqx.filter_jit
    def forces_along(self, per_length: PerLength) -> Float[Array, "n n"]:
        z = self._at_gauss(0, 0)
        return self._deflection(self._integral(per_length, z, z))

    @eqx.filter_jit
    def couples_along(self, per_length: PerLength) -> Float[Array, "n n"]:
        psi = self._at_gauss(1, 0) / self.ends[-1]
        return self._deflection(self._integral(per_length, psi, psi))

    @eqx.filter_jit
    def load_along(self, per_length: PerLength) -> Float[Array, " n"]:
        unit = jnp.ones((self._widths.size, max(self.degrees) + 1, 1))
        return self._deflection(self._integral(per_length, self._at_gauss(0, 0), unit)[:, 0])

    # --- energy

    @eqx.filter_jit
    def _deflection(self, force: Array) -> Array:
        """Coordinates due to forces of Galerkin's equations, with a soft spring on each rigid motion."""
        energy = self.strain_energy
        if (rigid := self._rigid) is not None:
            energy = energy + self.bending[0] / self.ends[-1] ** 3 * rigid @ rigid.T
        return linalg.solve(energy, force)

    def _integral(self, per_length: PerLength, left: Array, right: Array) -> Float[Array, "n m"]:
        """`Int per_length left right dx` of linear forms at the Gauss points (spans, g, n)."""
        density = jnp.asarray(per_length)[..., None] * self._widths[:, None] * self._gauss[1] / 2
        return jnp.einsum("pg,pgn,pgm->nm", density, left, right)

    @property
    def _rigid(self) -> Float[Array, "n r"] | None:
        """Rigid motions that the constraints allow; None if there are none."""
        pins = [k for k, (displacement, _) in enumerate(self.held) if displacement]
        slopes = any(slope for _, slope in self.held)
        if len(pins) >= 2 or (pins and slopes):
            return None
        one, x = jnp.ones_like(self.nodes), self.nodes / self.ends[-1]
        centre = self.ends[pins[0]] / self.ends[-1] if pins else 0.5
        shift, tilt = jnp.concatenate([one, 0 * one]), jnp.concatenate([x - centre, one])
        motions = [shift] * (not pins) + [tilt] * (not slopes)
        return jnp.stack(motions, axis=1)[self._unconstrained]

    # --- coordinates

    @property
    def _unconstrained(self) -> np.ndarray:
        """Indices of the displacements and slopes that no constraint holds: the coordinates."""
        count = self.nodes.size
        places = node_of_ends(self.degrees)
        held = np.array(self.held, bool).T  # displacement, slope
        return np.delete(np.arange(2 * count), [*places[held[0]], *count + places[held[1]]])

    @property
    def _gauss(self) -> tuple[np.ndarray, np.ndarray]:
        """Gauss points on [-1, 1] and weights, the same for every span."""
        return np.polynomial.legendre.leggauss(max(self.degrees) + 1)

    def _at_gauss(self, which: int, derivative: int) -> Float[Array, "spans g n"]:
        """Linear forms of `z` (0) or `l psi` (1), or of its derivative, at the Gauss points of spans."""
        order = max(self.degrees)
        differentiated = legendre.legder(np.eye(order + 1), derivative) * 2.0**derivative
        basis = legendre.legval(self._gauss[0], differentiated)  # (k, g)
        forms = np.einsum("kg,pkj,pjn->pgn", basis, self._interpolants, self._places(which))
        return forms / self._widths[:, None, None] ** derivative

    @eqx.filter_jit
    def _form(self, at: Scalar, which: int) -> Float[Array, " n"]:
        span = jnp.searchsorted(self.ends[1:-1], at)
        local = (at - self.ends[span]) / self._widths[span]
        basis = legendre_polynomials(max(self.degrees), local)
        forms = self._interpolants @ self._places(which)  # (span, k, n)
        return basis @ jnp.asarray(forms)[span]

    @property
    def _interpolants(self) -> np.ndarray:
        """Legendre coefficients of the interpolants of every span: (span, k, node)."""
        most = max(self.degrees) + 1
        found = np.zeros((len(self.degrees), most, most))
        for k, degree in enumerate(self.degrees):
            found[k, : degree + 1, : degree + 1] = interpolants(degree)
        return found

    def _places(self, which: int) -> np.ndarray:
        """Incidence of the displacements (0) or slopes (1) of every span: (span, node, n)."""
        count = self.nodes.size
        places = incidence(self.degrees, 2 * count)
        return np.roll(places, which * count, axis=2)[..., self._unconstrained]
