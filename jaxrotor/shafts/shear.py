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
    interpolants,
    legendre_polynomials,
    node_of_ends,
    nodes_in_spans,
    numbered,
)


class ShearLine(AbstractSpectralLine):
    """`q = (z at the nodes, l psi at the nodes)`, without the displacements and slopes that are held."""

    ends: Float[Array, " ends"]  # ends of the spans [m]
    bending: Float[Array, "#spans"]  # EI [N m^2]
    shear: Float[Array, "#spans"]  # kGA [N]
    degrees: tuple[int, ...] = eqx.field(static=True)  # degree of the polynomials on each span
    held: Held = eqx.field(static=True)
    anisotropy: Scalar | None

    def restoring(self, bending: bool) -> Float[Array, "n n"]:
        if bending:
            return self.deflection(self.energy(bending))
        unit = jnp.eye(self._unconstrained.size)
        rigid = self.rigid_motions
        if rigid is None:
            return unit
        return unit - rigid @ linalg.solve(rigid.T @ rigid, rigid.T)

    def energy(self, bending: bool) -> Float[Array, "n n"]:
        curvature = self._at_gauss(1, 1) / self.ends[-1]
        bent = self._integral(self.bending, curvature)
        if bending:
            return bent
        return bent + self._integral(self.shear, self._angle)

    def energy_in(self, share: Float[Array, " spans"]) -> Float[Array, "n n"]:
        bent = self._integral(share * self.bending, self._at_gauss(1, 1) / self.ends[-1])
        return bent + self._integral(share * self.shear, self._angle)

    @property
    def _angle(self) -> Array:
        """Shear angle at the Gauss points of every span."""
        return self._at_gauss(0, 1) - self._at_gauss(1, 0) / self.ends[-1]

    @eqx.filter_jit
    def form(self, at: Scalar, derivative: int) -> Float[Array, " n"]:
        span = jnp.sum(self.ends[1:-1] < at)
        local = (at - self.ends[span]) / self._widths[span]
        basis = legendre_polynomials(max(self.degrees), local)
        places = np.split(self._places, 2, axis=1)[derivative]
        values = basis @ jnp.asarray(self._interpolants)[span]
        form = self._placed(values, jnp.asarray(places)[span])
        return form / self.ends[-1] if derivative else form

    @eqx.filter_jit
    def work_along(self, per_length: PerLength, derivative: int) -> Float[Array, "n n"]:
        forms = self._at_gauss(1, 0) / self.ends[-1] if derivative else self._at_gauss(0, 0)
        return self._integral(per_length, forms)

    def work_of_load(self, per_length: PerLength) -> Float[Array, " n"]:
        local = jnp.einsum("pg,pgi->pi", self._weights(per_length), self._at_gauss(0, 0))
        return self._placed(local, self._places)

    # --- energy

    @eqx.filter_jit
    def deflection(self, force: Array) -> Array:
        return linalg.solve(self._supported_energy, force)

    @property
    def flexibility(self) -> Float[Array, "n n"]:
        return linalg.inv(self._supported_energy)

    @property
    def _supported_energy(self) -> Float[Array, "n n"]:
        """`energy` with a soft spring on each rigid motion."""
        energy = self.energy(bending=False)
        if (rigid := self.rigid_motions) is not None:
            energy = energy + self.bending[0] / self.ends[-1] ** 3 * rigid @ rigid.T
        return energy

    def _weights(self, per_length: PerLength) -> Float[Array, "spans g"]:
        """Weights of an integral at the Gauss points."""
        return jnp.asarray(per_length)[..., None] * self._widths[:, None] * self._gauss[1] / 2

    def _integral(self, per_length: PerLength, forms: Array) -> Float[Array, "n n"]:
        """`Int per_length form^T form dx` of a linear form at the Gauss points: (spans, g, function)."""
        local = jnp.einsum("pg,pgi,pgj->pij", self._weights(per_length), forms, forms)
        return self._assembled(local)

    @property
    def rigid_motions(self) -> Float[Array, "n r"] | None:
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
        count = sum(self.degrees) + 1
        places = node_of_ends(self.degrees)
        held = np.array(self.held, bool).T  # displacement, slope
        return np.delete(np.arange(2 * count), [*places[held[0]], *count + places[held[1]]])

    @property
    def _gauss(self) -> tuple[np.ndarray, np.ndarray]:
        """Gauss points on [-1, 1] and weights, the same for every span."""
        return np.polynomial.legendre.leggauss(max(self.degrees) + 1)

    def _at_gauss(self, which: int, derivative: int) -> Float[Array, "spans g f"]:
        """Functions of a span for `z` (0) or `l psi` (1), or derivatives, at its Gauss points."""
        order = max(self.degrees)
        differentiated = legendre.legder(np.eye(order + 1), derivative) * 2.0**derivative
        basis = legendre.legval(self._gauss[0], differentiated)  # (k, g)
        forms = np.einsum("kg,pkj->pgj", basis, self._interpolants)
        both = [forms, 0 * forms] if which == 0 else [0 * forms, forms]
        return jnp.concatenate(both, axis=2) / self._widths[:, None, None] ** derivative

    @property
    def _interpolants(self) -> np.ndarray:
        """Legendre coefficients of the interpolants of every span: (span, k, node)."""
        most = max(self.degrees) + 1
        found = np.zeros((len(self.degrees), most, most))
        for k, degree in enumerate(self.degrees):
            found[k, : degree + 1, : degree + 1] = interpolants(degree)
        return found

    @property
    def _places(self) -> np.ndarray:
        """Coordinates of the displacements, then of the slopes, at the nodes of every span."""
        displaced = nodes_in_spans(self.degrees)
        count = sum(self.degrees) + 1
        sloped = np.where(displaced < 0, -1, displaced + count)
        return numbered(np.concatenate([displaced, sloped], axis=1), self._unconstrained)
