"""Deflection of a beam by its Green's function and by polynomials on the spans between stations.

    z(x) = Int G(x, s) p(s) ds,   p = load per length

Within a span of width `w`, with `xi` from 0 to 1, the kernel is a cubic `H` in the deflections and slopes
that the load causes at both ends, plus the kernel of a beam clamped there, which is a series:

    G(x, s) = H(x, s) + w^3 / EI Sum_k (2 k + 1) B_k(xi) B_k(sigma),   B_k'' = P_k(2 xi - 1),  k = 2, 3, ..

The series is taken as far as `B_k` is among the polynomials of the span. So the integral equation holds
at the ends of spans, where effects act, and Galerkin's equations hold within: a damper anywhere takes
energy out of every mode, and the error falls exponentially with the number of nodes per span.
"""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..core.quantities import Scalar
from .greens import AbstractKernel, HeldKernel, elastic
from .line import AbstractLine, PerLength
from .polynomials import (
    clamped,
    cubics,
    in_parts,
    interpolants,
    neighbours,
    node_of_ends,
    parts,
    products,
    spread,
)


# Whether displacement and slope are held, for every end of the spans.
Held = tuple[tuple[bool, bool], ...]


class SpectralLine(AbstractLine):
    """`q = (z at the nodes, l z' where spans meet)`, without the displacements and slopes that are held.

    Where two spans meet, the slope, scaled by the length `l` of the shaft, is a coordinate of its own. A
    shaft that can move without bending has auxiliary constraints (see `HeldKernel`) at its ends. The
    coordinate at such an end is the rigid motion, and its equation states that the auxiliary constraint
    has no reaction.
    """

    kernel: AbstractKernel
    ends: Float[Array, " ends"]  # ends of the spans [m]
    degrees: tuple[int, ...] = eqx.field(static=True)  # intervals between the nodes of each span
    held: Held = eqx.field(static=True)
    free: tuple[int, ...] = eqx.field(static=True)  # ends with an auxiliary constraint: 0 or -1
    anisotropy: Scalar | None

    @property
    def breaks(self) -> Float[Array, " ends"]:
        return self.ends

    @property
    def nodes(self) -> Float[Array, " nodes"]:
        """Stations of the displacements, including held ones [m]."""
        return spread(self.degrees, self.ends)

    @property
    def stiffness(self) -> Float[Array, "n n"]:
        stiffness = elastic(self.kernel, self.nodes, self.ends[1:-1], self._free_nodes)
        return stiffness[np.ix_(self._unconstrained, self._unconstrained)]

    @property
    def bending_stiffness(self) -> Float[Array, "n n"]:
        return self.stiffness

    @property
    def strain_energy(self) -> Float[Array, "n n"]:
        return self.bending_energy

    @property
    def bending_energy(self) -> Float[Array, "n n"]:
        return self._integral(self._rigidity, 2)

    @eqx.filter_jit
    def row(self, at: Scalar) -> Float[Array, " n"]:
        return self._form(at, 0)

    @eqx.filter_jit
    def slope_row(self, at: Scalar) -> Float[Array, " n"]:
        return self._form(at, 1)

    def column(self, at: Scalar) -> Float[Array, " n"]:
        return self._deflection(self.row(at))

    def couple_column(self, at: Scalar) -> Float[Array, " n"]:
        return self._deflection(self.slope_row(at))

    def forces_along(self, per_length: PerLength) -> Float[Array, "n n"]:
        return self._deflection(self._integral(per_length, 0))

    def couples_along(self, per_length: PerLength) -> Float[Array, "n n"]:
        return self._deflection(self._integral(per_length, 1))

    @eqx.filter_jit
    def load_along(self, per_length: PerLength) -> Float[Array, " n"]:
        means = self._interpolants[:, 0] * self._scales  # as the mean of P_k is 0 but for P_0
        loads = (self._widths * per_length)[:, None] * means
        return self._deflection(jnp.einsum("pi,pin->n", loads, self._places))

    # --- energy

    @eqx.filter_jit
    def _deflection(self, force: Array) -> Array:
        """Terms in the equations of generalized forces, which are `row(x) F` for a force `F` at `x`."""
        deflection, kernel = self._flexibility @ force, self.kernel
        if isinstance(kernel, HeldKernel):
            coordinates = np.searchsorted(self._unconstrained, self._free_nodes)
            for number, own in enumerate(coordinates):
                motion = kernel.rigid_motion(number, self.nodes, self.ends[1:-1])
                work = kernel.compliance * motion[self._unconstrained] @ force
                deflection = deflection.at[int(own)].set(work)
        return deflection

    @property
    def _flexibility(self) -> Float[Array, "n n"]:
        """Coordinates due to a unit generalized force on each of them."""
        x, s, length = self.ends[:, None], self.ends, self.ends[-1]
        kernel, spans = self.kernel, len(self.degrees)
        displaced = [kernel.deflection(x, s), length * kernel.deflection_by_couple(x, s)]
        tilted = [length * kernel.slope(x, s), length**2 * kernel.slope_by_couple(x, s)]
        of_ends = jnp.block([displaced, tilted])

        most = max(self.degrees)
        shares = np.zeros((spans, most + 1, 4))  # in the nodes of a span, of its ends
        alone = np.zeros((spans, most + 1, most + 1))  # with both ends clamped
        of_span = np.zeros((spans, 4, 2 * (spans + 1)))
        for k, (degree, left, right) in enumerate(self._orders):
            own = degree + (k == spans - 1)  # a shared node counts once
            shares[k, :own] = cubics(degree)[:own]
            alone[k, : degree + 1, : degree + 1] = clamped(degree, degree + left + right)
            of_span[k, range(4), [k, spans + 1 + k, k + 1, spans + 2 + k]] = 1
        scale = jnp.stack([jnp.ones_like(s[1:]), self._widths / length] * 2, axis=1)
        at_nodes = self._places[:, : most + 1]
        by_ends = jnp.einsum("pie,pe,pin,pem->nm", shares, scale, at_nodes, of_span)
        inner_slopes = np.einsum("pn,pm->nm", self._places[:, -1], of_span[:, -1])
        by_ends = by_ends + inner_slopes

        widths = self._widths**3 / self._rigidity
        return by_ends @ of_ends @ by_ends.T + jnp.einsum(
            "p,pij,pin,pjm->nm", widths, alone, at_nodes, at_nodes
        )

    @eqx.filter_jit
    def _integral(self, per_length: PerLength, derivative: int) -> Float[Array, "n n"]:
        """`Int per_length row row' ds` of the rows of a derivative of the deflection."""
        coefficients = self._interpolants
        gram = products(coefficients.shape[1] - 1, derivative)
        forms = np.einsum("pki,kl,plj->pij", coefficients, gram, coefficients)
        densities = per_length * self._widths ** (1 - 2 * derivative)
        scaled = self._scales[:, :, None] * self._places
        return jnp.einsum("p,pij,pin,pjm->nm", densities, forms, scaled, scaled)

    @property
    def _rigidity(self) -> Float[Array, " spans"]:
        """Bending stiffness of every span [N m^2]."""
        return self.kernel.rigidity((self.ends[:-1] + self.ends[1:]) / 2)

    # --- coordinates

    @property
    def _widths(self) -> Float[Array, " spans"]:
        return jnp.diff(self.ends)

    @property
    def _orders(self) -> list[tuple[int, bool, bool]]:
        """Degree of every span, and whether its polynomials have given slopes at the left and right end.

        A slope that is held is given, too: the polynomials have it zero.
        """
        last = len(self.degrees) - 1
        return [
            (degree, k > 0 or self.held[0][1], k < last or self.held[-1][1])
            for k, degree in enumerate(self.degrees)
        ]

    @property
    def _free_nodes(self) -> list[int]:
        """Indices of the nodes at the auxiliary constraints."""
        places = node_of_ends(self.degrees)
        return [int(places[end]) for end in self.free]

    @property
    def _unconstrained(self) -> np.ndarray:
        """Indices of the displacements and slopes that no constraint holds: the coordinates."""
        places, held = node_of_ends(self.degrees), []
        count = places[-1] + 1
        for end, (displacement, slope) in enumerate(self.held):
            if displacement:
                held.append(places[end])
            if slope and 0 < end < len(self.degrees):
                held.append(count + end - 1)
        return np.delete(np.arange(count + len(self.degrees) - 1), held)

    @property
    def _places(self) -> np.ndarray:
        """Incidence of the values at the nodes of a span, then of the slopes at its ends: (.., .., n)."""
        spans, most = len(self.degrees), max(self.degrees)
        count = sum(self.degrees) + 1
        places = np.zeros((spans, most + 3, count + spans - 1))
        places[:, : most + 1] = neighbours(self.degrees, places.shape[2])
        for k in range(spans - 1):  # the slope between span k and the next
            places[k, -1, count + k] = places[k + 1, -2, count + k] = 1
        return places[..., self._unconstrained]

    @property
    def _interpolants(self) -> np.ndarray:
        """Legendre coefficients of the interpolants of every span, zero where one has less than most."""
        most = max(self.degrees)
        found = np.zeros((len(self.degrees), most + 3, most + 3))
        for k, (degree, left, right) in enumerate(self._orders):
            own = interpolants(degree, left, right)
            found[k, : len(own), self._given(degree, left, right)] = own.T
        return found

    @property
    def _scales(self) -> Float[Array, "spans shapes"]:
        """Factor of every interpolant: one for displacements, the width of the span for slopes."""
        slopes = self._widths / self.ends[-1]
        return jnp.stack([jnp.ones_like(slopes)] * (max(self.degrees) + 1) + [slopes] * 2, axis=1)

    @property
    def _parts(self) -> np.ndarray:
        """Interpolants of every span as sums of cubics and others: (span, part, interpolant)."""
        most = max(self.degrees)
        found = np.zeros((len(self.degrees), most + 3, most + 3))
        for k, (degree, left, right) in enumerate(self._orders):
            own = in_parts(degree, left, right)
            found[k, : len(own), self._given(degree, left, right)] = own.T
        return found

    def _given(self, degree: int, left: bool, right: bool) -> list[int]:
        """Places of the interpolants of a span, whose last two belong to slopes, among `most + 3`."""
        most = max(self.degrees)
        return [*range(degree + 1), *[most + 1] * left, *[most + 2] * right]

    def _form(self, at: Scalar, derivative: int) -> Float[Array, " n"]:
        """Displacement or slope at a station as a linear form of the coordinates."""
        span = jnp.searchsorted(self.ends[1:-1], at)
        local = (at - self.ends[span]) / self._widths[span]
        shapes = parts(max(self.degrees) + 2, local, derivative) @ jnp.asarray(self._parts)[span]
        form = (shapes * self._scales[span]) @ jnp.asarray(self._places)[span]
        return form / self._widths[span] ** derivative
