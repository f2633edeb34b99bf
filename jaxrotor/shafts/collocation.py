"""Collocation of the integral equation of a beam at Legendre-Gauss-Lobatto nodes of spans.

    z(x_i) = Sum_j [ Int G(x_i, s) h_j(s) ds ] p_j,   p = load per length, h_j = interpolants

The kernel times the interpolant is a polynomial on either side of `s = x_i`. Gauss quadrature that is
split there is therefore exact, and the error falls exponentially with the number of nodes per span.
"""

import functools
from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from numpy.polynomial import legendre

from ..core.extremes import bounded
from ..core.quantities import Scalar
from .greens import AbstractKernel, HeldKernel
from .line import AbstractLine, PerLength, strain_energy


# Whether displacement and slope are held, for every end of the spans.
Held = tuple[tuple[bool, bool], ...]


class SpectralLine(AbstractLine):
    """`q = (z at the nodes, l z' where spans meet)`, without the displacements and slopes that are held.

    Where two spans meet, the slope, scaled by the length `l` of the shaft, is an unknown of its own,
    collocated by `dG/dx`. Otherwise a disc there would use the slope of one side only, and a high mode
    could grow. A shaft that can move without bending has auxiliary constraints (see `HeldKernel`) at
    its ends. The coordinate at such an end is the rigid motion, and its equation states that the
    auxiliary constraint has no reaction.
    """

    kernel: AbstractKernel
    ends: Float[Array, " ends"]  # ends of the spans [m]
    degrees: tuple[int, ...] = eqx.field(static=True)  # degree of the interpolant on each span
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
        stiffness = elastic(self.kernel, self.nodes, self._inner, self._free_nodes)
        return stiffness[np.ix_(self._unconstrained, self._unconstrained)]

    @property
    def bending_stiffness(self) -> Float[Array, "n n"]:
        return self.stiffness

    @property
    def strain_energy(self) -> Float[Array, "n n"]:
        return self.bending_energy

    @property
    def bending_energy(self) -> Float[Array, "n n"]:
        return strain_energy(self, self.kernel.rigidity)

    @eqx.filter_jit
    def row(self, at: Scalar) -> Float[Array, " n"]:
        return self._form(self._shapes, at)

    @eqx.filter_jit
    def slope_row(self, at: Scalar) -> Float[Array, " n"]:
        return self._form(self._slopes, at)

    @eqx.filter_jit
    def column(self, at: Scalar) -> Float[Array, " n"]:
        return self._collocate(False, lambda kernel, x: kernel(x, at))

    @eqx.filter_jit
    def couple_column(self, at: Scalar) -> Float[Array, " n"]:
        return self._collocate(True, lambda kernel, x: kernel(x, at))

    @eqx.filter_jit
    def forces_along(self, per_length: PerLength) -> Float[Array, "n n"]:
        return self._collocate(False, functools.partial(self._integrate, self._shapes, per_length))

    @eqx.filter_jit
    def couples_along(self, per_length: PerLength) -> Float[Array, "n n"]:
        return self._collocate(True, functools.partial(self._integrate, self._slopes, per_length))

    @eqx.filter_jit
    def load_along(self, per_length: PerLength) -> Float[Array, " n"]:
        return self._collocate(False, functools.partial(self._total, per_length))

    # --- equations

    def _collocate(self, couple: bool, evaluate: Callable) -> Array:
        """Equations of the coordinates due to a load, see `collocated`."""
        places = self.ends[-1], self.nodes, self._inner, self._free_nodes
        return collocated(self.kernel, *places, couple, evaluate)[self._unconstrained]

    def _integrate(self, shapes: Callable, per_length: PerLength, kernel: Callable, x: Array):
        """`Int kernel(x_i, s) per_length(s) h_j(s) ds`: (i, coordinates)."""
        s, weight, local = self._quadrature(x)
        values = weight * kernel(x[:, None, None], s) * by_span(per_length)
        interpolants, places = shapes(local)
        integrals = jnp.einsum("ipg,ipgj->ipj", values, interpolants)
        return jnp.einsum("ipj,pjn->in", integrals, places)[:, self._unconstrained]

    def _total(self, per_length: PerLength, kernel: Callable, x: Array) -> Float[Array, " i"]:
        """`Int kernel(x_i, s) per_length(s) ds`."""
        s, weight, _ = self._quadrature(x)
        values = weight * kernel(x[:, None, None], s) * by_span(per_length)
        return jnp.sum(values, axis=(1, 2))

    def _quadrature(self, x: Array) -> tuple[Array, Array, Array]:
        """Gauss points, weights and local coordinates (x, spans, g), exact for the kernel times h_j."""
        points, weights = np.polynomial.legendre.leggauss(max(self.degrees) // 2 + 4)
        start, stop = self.ends[:-1], self.ends[1:]
        kink = bounded(x[:, None], start, stop)
        low = jnp.stack([jnp.broadcast_to(start, kink.shape), kink], axis=-1)
        high = jnp.stack([kink, jnp.broadcast_to(stop, kink.shape)], axis=-1)
        half = (high - low)[..., None] / 2
        s = (low[..., None] + half * (1 + jnp.asarray(points))).reshape(*kink.shape, -1)
        weight = (half * jnp.asarray(weights)).reshape(*kink.shape, -1)
        return s, weight, (s - start[:, None]) / self._widths[:, None]

    # --- coordinates

    @property
    def _inner(self) -> Float[Array, " inner"]:
        """Ends where two spans meet [m]."""
        return self.ends[1:-1]

    @property
    def _widths(self) -> Float[Array, " spans"]:
        return jnp.diff(self.ends)

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
            if slope and 0 < end < self.ends.size - 1:
                held.append(count + end - 1)
        return np.delete(np.arange(count + self._inner.size), held)

    def _form(self, shapes: Callable, at: Scalar) -> Float[Array, " n"]:
        """Displacement or slope at a station as a linear form of the coordinates."""
        inside = jnp.arange(self._widths.size) == jnp.searchsorted(self._inner, at)
        local = (at - self.ends[:-1]) / self._widths
        interpolants, places = shapes(local[:, None])
        return jnp.einsum("pj,pjn->n", inside[:, None] * interpolants[:, 0], places)[
            self._unconstrained
        ]

    def _shapes(self, local: Array, derivative: int = 0) -> tuple[Array, np.ndarray]:
        """Interpolants (.., spans, g, shapes) of every span, and the coordinate that each multiplies.

        The shapes of a span belong to its displacements, then to the slopes at its two ends. Where spans
        differ in degree, those with fewer nodes have zeros in place of the missing shapes.
        """
        spans, degree = len(self.degrees), max(self.degrees)
        coefficients = np.stack(
            [_to_legendre(n, degree, k > 0, k < spans - 1) for k, n in enumerate(self.degrees)]
        )
        basis = legendre_polynomials(degree + 2, local, derivative)
        shapes = jnp.einsum("...pgd,pdj->...pgj", basis, coefficients)
        scale = jnp.ones((spans, 1, degree + 3))
        scale = scale.at[..., degree + 1 :].set((self._widths / self.ends[-1])[:, None, None])
        count = sum(self.degrees) + 1
        places = np.zeros((spans, degree + 3, count + spans - 1))
        places[:, : degree + 1] = neighbours(self.degrees, places.shape[2])
        for k in range(spans - 1):  # the slope between span k and the next
            places[k, -1, count + k] = places[k + 1, -2, count + k] = 1
        return scale * shapes, places

    def _slopes(self, local: Array) -> tuple[Array, np.ndarray]:
        slopes, places = self._shapes(local, 1)
        return slopes / self._widths[:, None, None], places


def elastic(
    kernel: AbstractKernel, nodes: Array, sloped: Array, free: list[int]
) -> Float[Array, "m m"]:
    """Stiffness of the equations of displacements at `nodes` and scaled slopes at `sloped` [m].

    It is one but for rigid motions, whose coordinates are the displacements of the nodes `free`.
    """
    stiffness = jnp.eye(nodes.size + sloped.size)
    if isinstance(kernel, HeldKernel):
        for number, node in enumerate(free):
            rigid = kernel.rigid(number, nodes)
            tilted = kernel.length * kernel.rigid_slope(number, sloped)
            stiffness = stiffness.at[:, node].add(-jnp.concatenate([rigid, tilted]))
        stiffness = stiffness.at[np.array(free, int)].set(0.0)
    return stiffness


def collocated(
    kernel: AbstractKernel,
    length: Scalar,
    nodes: Array,
    sloped: Array,
    free: list[int],
    couple: bool,
    evaluate: Callable,
) -> Array:
    """Equations of the displacements at `nodes`, then of the scaled slopes at `sloped`, due to a load.

    `evaluate(G, x)` is the load's sum or integral of a kernel `G(x, s)`; `couple`: of couples, not forces.
    The equation of a node `free` is the balance of its rigid motion.
    """
    displaced = kernel.deflection_by_couple if couple else kernel.deflection
    slope = kernel.slope_by_couple if couple else kernel.slope
    equations = evaluate(displaced, nodes)
    if sloped.size:
        slopes = length * evaluate(slope, sloped)
        equations = jnp.concatenate([equations, slopes])
    if isinstance(kernel, HeldKernel):
        moved = kernel.rigid_slope if couple else kernel.rigid
        for number, node in enumerate(free):
            work = lambda x, s, number=number: moved(number, s) + jnp.zeros_like(x)
            row = kernel.compliance * evaluate(work, nodes[:1])[0]
            equations = equations.at[node].set(row)
    return equations


def node_of_ends(degrees: tuple[int, ...]) -> np.ndarray:
    """Index of the node at every end of the spans: (ends,)."""
    return np.concatenate([[0], np.cumsum(degrees)])


def spread(degrees: tuple[int, ...], ends: Float[Array, " ends"]) -> Float[Array, " nodes"]:
    """Lobatto nodes of all spans [m]; neighbouring spans share the node at their common end."""
    inner = np.zeros(
        (len(degrees), max(degrees))
    )  # zero beyond a degree: NaN would spoil derivatives
    for k, degree in enumerate(degrees):
        inner[k, :degree] = lobatto(degree)[1:]
    beyond = ends[:-1, None] + jnp.diff(ends)[:, None] * inner
    # If all spans have the same degree, all nodes are used and nothing is gathered.
    own = np.flatnonzero(inner)
    return jnp.append(ends[0], beyond if own.size == inner.size else beyond.ravel()[own])


def neighbours(degrees: tuple[int, ...], count: int) -> np.ndarray:
    """Incidence of the nodes of every span, 0 or 1: (span, node of the span, node of the shaft)."""
    places = np.zeros((len(degrees), max(degrees) + 1, count))
    for k, (first, degree) in enumerate(zip(node_of_ends(degrees)[:-1], degrees, strict=True)):
        places[k, range(degree + 1), range(first, first + degree + 1)] = 1
    return places


def by_span(per_length: PerLength) -> Array:
    """A density, uniform or per span, broadcast against (x, spans, g)."""
    return jnp.asarray(per_length)[..., None]


def lobatto(degree: int) -> np.ndarray:
    """The `degree + 1` Legendre-Gauss-Lobatto nodes on [0, 1], ascending."""
    inner = np.sort(legendre.Legendre.basis(degree).deriv().roots().real)
    return (np.concatenate([[-1.0], inner, [1.0]]) + 1) / 2


@functools.cache
def _to_legendre(degree: int, most: int, left: bool, right: bool) -> np.ndarray:
    """Legendre coefficients of the interpolants of values at Lobatto nodes and slopes at the ends.

    The columns belong to `most + 1` values, then to both slopes (by the coordinate in [0, 1]). Columns
    of values beyond the degree, and of a slope that is no unknown (`left`, `right`), are zero.
    """
    used = [*range(degree + 1), *[degree + 1] * left, *[degree + 2] * right]
    values = legendre.legvander(2 * lobatto(degree) - 1, degree + 2)
    slopes = 2 * np.stack(
        [legendre.legval([-1, 1], legendre.legder(e)) for e in np.eye(degree + 3)]
    )
    conditions = np.concatenate([values, slopes.T])[used, : len(used)]
    columns = [k if k <= degree else k + most - degree for k in used]
    coefficients = np.zeros((most + 3, most + 3))
    coefficients[: len(used), columns] = np.linalg.inv(conditions)
    return coefficients


def legendre_polynomials(degree: int, local: Array, derivative: int = 0) -> Array:
    """`P_k(2 local - 1)` for k = 0..degree, or the first derivative by `local`: (.., degree + 1)."""
    t = 2 * jnp.asarray(local) - 1
    one = jnp.ones_like(t)

    def up(carry, k):  # a loop, as unrolled it would dominate the time to compile a scene
        (before, now), (slope_before, slope) = carry
        value = ((2 * k + 1) * t * now - k * before) / (k + 1)
        steeper = slope_before + (2 * k + 1) * now
        return ((now, value), (slope, steeper)), (value, steeper)

    begin = (one, t), (0 * one, one)
    _, found = jax.lax.scan(up, begin, jnp.arange(1, degree, dtype=t.dtype))
    first, rest = jnp.stack(begin[1 if derivative else 0]), found[1 if derivative else 0]
    found = jnp.moveaxis(jnp.concatenate([first, rest]), 0, -1)
    return 2.0 * found if derivative else found
