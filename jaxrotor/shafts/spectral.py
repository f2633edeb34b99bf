"""Deflection of a beam by its Green's function and by polynomials on the spans between stations.

    z(x) = Int G(x, s) p(s) ds,   p = load per length

With Hermite's cubics `N` of the displacements and slopes at the ends of spans, and with `xi` and `sigma`
from 0 to 1 where x and s are in the same span, of width `w`,

    G(x, s) = N(x) G_ends N(s)^T + w^3 / EI Sum_k (2 k + 1) B_k(xi) B_k(sigma),   B_k'' = P_k(2 xi - 1)

The sum over k = 2, 3, .. is the kernel of a span clamped at both ends. It is taken as far as the bubble
`B_k` is among the polynomials of the span. So the integral equation holds at the ends of spans, where
effects act, and Galerkin's equations hold within: a damper anywhere takes energy out of every mode, and
the error falls exponentially with the number of nodes per span.
"""

from collections.abc import Callable

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..core.quantities import Scalar
from .greens import AbstractKernel, HeldKernel
from .line import AbstractSpectralLine, Held, PerLength
from .polynomials import (
    bubble_flexibility,
    cubics,
    hermite_and_bubbles,
    in_hermite_and_bubbles,
    interpolants,
    node_of_ends,
    nodes_in_spans,
    numbered,
    products,
)
from .unsheared import AbstractUnshearedLine


class SpectralLine(AbstractSpectralLine, AbstractUnshearedLine):
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
    def sloped(self) -> Float[Array, " slopes"]:
        return self.ends[1:-1]

    def energy(self, bending: bool) -> Float[Array, "n n"]:
        del bending
        return self._integral(self._rigidity, 2)

    def energy_in(self, share: Float[Array, " spans"]) -> Float[Array, "n n"]:
        return self._integral(share * self._rigidity, 2)

    @eqx.filter_jit
    def form(self, at: Scalar, derivative: int) -> Float[Array, " n"]:
        span = jnp.sum(self.ends[1:-1] < at)
        local = (at - self.ends[span]) / self._widths[span]
        shapes = (
            hermite_and_bubbles(max(self.degrees) + 2, local, derivative)
            @ jnp.asarray(self._in_bubbles)[span]
        )
        form = shapes * self._scales[span] / self._widths[span] ** derivative
        return self._placed(form, jnp.asarray(self._places)[span])

    @eqx.filter_jit
    def work_along(self, per_length: PerLength, derivative: int) -> Float[Array, "n n"]:
        return self._integral(per_length, derivative)

    def work_of_load(self, per_length: PerLength) -> Float[Array, " n"]:
        means = self._interpolants[:, 0] * self._scales  # as the mean of P_k is 0 but for P_0
        return self._placed((self._widths * per_length)[:, None] * means, self._places)

    # --- energy

    @eqx.filter_jit
    def deflection(self, force: Array) -> Array:
        deflection, kernel, motions = self.flexibility @ force, self.kernel, self.rigid_motions
        if motions is not None:
            assert isinstance(kernel, HeldKernel)
            coordinates = np.searchsorted(self._unconstrained, self._free_nodes)
            work = kernel.compliance * motions.T @ force
            deflection = deflection.at[coordinates].set(work)
        return deflection

    @property
    def rigid_motions(self) -> Float[Array, "n r"] | None:
        if not self.free:
            return None
        kernel = self.kernel
        assert isinstance(kernel, HeldKernel)
        motion = lambda number: kernel.rigid_motion(number, self.nodes, self.ends[1:-1])
        motions = [motion(number)[self._unconstrained] for number in range(len(self.free))]
        return jnp.stack(motions, axis=1)

    @property
    def flexibility(self) -> Float[Array, "n n"]:
        """`N G N^T + bubbles`: coordinates due to a unit generalized force on each of them.

        `G` is the Green's function between the ends of spans, `N` Hermite's cubics at the nodes.
        """
        n, most = self._cubics_at_nodes, max(self.degrees)
        bubbles = np.zeros((len(self.degrees), most + 1, most + 1))
        for k, (degree, left, right) in enumerate(self._orders):
            own = bubble_flexibility(degree, degree + left + right)
            bubbles[k, : degree + 1, : degree + 1] = own
        within = (self._widths**3 / self._rigidity)[:, None, None] * bubbles
        clamped = self._assembled(jnp.pad(within, [(0, 0), (0, 2), (0, 2)]))
        return n @ self._flexibility_of_ends @ n.T + clamped

    @property
    def _flexibility_of_ends(self) -> Float[Array, "e2 e2"]:
        """Displacements and scaled slopes at the ends of spans due to unit generalized forces there."""
        x, s, length = self.ends[:, None], self.ends, self.ends[-1]
        scaled = lambda slope, couple: (
            length ** (slope + couple) * self.kernel.response(x, s, slope, couple)
        )
        return jnp.block(
            [[scaled(slope, couple) for couple in (False, True)] for slope in (False, True)]
        )

    @property
    def _cubics_at_nodes(self) -> Float[Array, "n e2"]:
        """Coordinates of the cubics of unit displacements, then of unit scaled slopes, at the ends."""
        spans, most = len(self.degrees), max(self.degrees)
        shapes = np.zeros((spans, most + 1, 4))
        first = np.arange(spans)[:, None]
        of_span = np.concatenate([first, first + spans + 1, first + 1, first + spans + 2], axis=1)
        for k, degree in enumerate(self.degrees):
            count = degree + (k == spans - 1)  # a node that two spans share belongs to the second
            shapes[k, :count] = cubics(degree)[:count]
        slopes = self._widths / self.ends[-1]
        scale = jnp.stack([jnp.ones_like(slopes), slopes] * 2, axis=1)
        n, places = self._unconstrained.size, self._places
        found = jnp.zeros((n + 1, 2 * (spans + 1)))
        found = found.at[places[:, : most + 1, None], of_span[:, None]].add(shapes * scale[:, None])
        return found.at[places[:, -1], of_span[:, -1]].add(1.0)[:n]

    @eqx.filter_jit
    def _integral(self, per_length: PerLength, derivative: int) -> Float[Array, "n n"]:
        """`Int per_length row row' ds` of the rows of a derivative of the deflection."""
        coefficients = self._interpolants
        gram = products(coefficients.shape[1] - 1, derivative)
        forms = np.einsum("pki,kl,plj->pij", coefficients, gram, coefficients)
        densities = per_length * self._widths ** (1 - 2 * derivative)
        scales = self._scales
        return self._assembled(
            densities[:, None, None] * forms * scales[:, :, None] * scales[:, None]
        )

    @property
    def _rigidity(self) -> Float[Array, " spans"]:
        """Bending stiffness of every span [N m^2]."""
        return self.kernel.rigidity((self.ends[:-1] + self.ends[1:]) / 2)

    # --- coordinates

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
        """Coordinates of the values at the nodes of every span, then of the slopes at its two ends."""
        spans = len(self.degrees)
        slopes = np.full((spans, 2), -1)  # that between span k and the next is the right one of k
        slopes[:-1, 1] = slopes[1:, 0] = sum(self.degrees) + 1 + np.arange(spans - 1)
        every = np.concatenate([nodes_in_spans(self.degrees), slopes], axis=1)
        return numbered(every, self._unconstrained)

    @property
    def _interpolants(self) -> np.ndarray:
        """Legendre coefficients of the interpolants of every span: (span, coefficient, interpolant)."""
        return self._of_spans(interpolants)

    @property
    def _in_bubbles(self) -> np.ndarray:
        """Interpolants of every span as sums of cubics and bubbles: (span, part, interpolant)."""
        return self._of_spans(in_hermite_and_bubbles)

    def _of_spans(self, of: Callable[[int, bool, bool], np.ndarray]) -> np.ndarray:
        """Columns of every span; zero where a span has fewer nodes than others, or no slope at an end."""
        most = max(self.degrees)
        found = np.zeros((len(self.degrees), most + 3, most + 3))
        for k, (degree, left, right) in enumerate(self._orders):
            given = [*range(degree + 1), *[most + 1] * left, *[most + 2] * right]
            columns = of(degree, left, right)
            found[k, : len(columns), given] = columns.T
        return found

    @property
    def _scales(self) -> Float[Array, "spans shapes"]:
        """Factor of every interpolant: one for displacements, the width of the span for slopes."""
        slopes = self._widths / self.ends[-1]
        return jnp.stack([jnp.ones_like(slopes)] * (max(self.degrees) + 1) + [slopes] * 2, axis=1)
