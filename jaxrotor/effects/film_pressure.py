"""Pressure of a finite oil film, which flows along the bearing and round the journal."""

import functools

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float

from ..core import linalg
from ..core.quantities import Scalar
from .law import Plane


NODES = 31  # round the journal, so that there are 16 Fourier coefficients
GAUSS = 32  # points of quadrature of either sign of the pressure
ANGLES = 2 * np.pi / NODES * np.arange(NODES)
NEWTON = 3  # steps to an end of the film, from the nodes beside it


def centred_share(slenderness: Scalar) -> Scalar:
    """`3 (1 - tanh(l) / l) / l^2`, load of a centred journal over that of its short film, `l = L / D`."""
    small = slenderness < 0.02  # where the difference cancels, its series is exact
    l2 = jnp.where(small, 1.0, slenderness) ** 2
    whole = 3 * (1 - jnp.tanh(jnp.sqrt(l2)) / jnp.sqrt(l2)) / l2
    return jnp.where(small, 1 - 0.4 * slenderness**2, whole)


@functools.partial(jax.jit, static_argnames="modes")  # traced once a program
def film_integrals(
    zeta: Plane, w: Plane, s2: Scalar, slenderness: Scalar, modes: int
) -> tuple[Plane, Plane]:
    """`Int p e^(i phi) dphi` over the whole film at `w`, and over the half under pressure at `w / |w|`.

        H = 1 - Re(zeta* e^(i phi)),   g = -Re(w* e^(i phi)),   b = (j - 1/2) pi,   k = (b D / L)^2
        (H^3 P_j')' - k H^3 P_j = 6 k g / b^4,   p = Sum_j P_j - (1 - Sum_j 6 / b^4) g / H^3

    `p` is the mean along the bearing: cosines along it separate Reynolds' equation, and of those above
    `modes` the flow round the journal is left out. `P_j H^2` solves an equation with coefficients linear
    in `H`. It is found by collocation in an angle that a Möbius map of the circle makes from `phi`: `H`
    has its zero and its pole equally far from the real axis there.

    Args:
        zeta: displacement of the journal over the clearance, of which the square is below 1.
        w: its velocity over the clearance, as seen from the frame that turns at half the speed [1/s].
        s2: `1 - |zeta|^2`.
        slenderness: length over diameter.
        modes: number of modes along the bearing.
    """
    b2 = (jnp.pi * (jnp.arange(modes) + 0.5)) ** 2
    shape = _Shape.of(zeta[0] + 1j * zeta[1], jnp.sqrt(s2))
    values = _modes(shape, b2 / slenderness**2, 6 / b2**2)
    film = _Film(shape, values, jnp.asarray(_transform()) @ values, 1 - jnp.sum(6 / b2**2))
    moves = w[0] ** 2 + w[1] ** 2 > 0
    speed = jnp.sqrt(jnp.where(moves, w[0] ** 2 + w[1] ** 2, 1.0))
    unit = jnp.where(moves, w / speed, jnp.array([1.0, 0.0]))
    begin, end = _ends(film, unit)
    points, weights = np.polynomial.legendre.leggauss(GAUSS)
    starts, lengths = jnp.stack([begin, end]), jnp.stack([end - begin, 2 * jnp.pi - end + begin])
    angles = starts[:, None] + lengths[:, None] * (1 + points) / 2
    gap, direction, stretch = shape.at(angles)
    measure = stretch / gap**2 * weights * lengths[:, None] / 2
    vectors = jnp.stack([direction.real, direction.imag])
    # Loads (arc, axis) of either sign for `w = 1` and `w = i`
    loads = jnp.einsum("iag,agw,ag->aiw", vectors, film.pressures(angles), measure)
    return loads.sum(0) @ w, loads[0] @ unit


class _Shape(eqx.Module):
    """Gap of the film over an angle `a`: `e^(i phi) = (e^(i a) + m) / (1 + m* e^(i a))`.

    With `r = zeta / (1 + s)` and `m = r / (1 + sqrt(1 - |r|^2))` it is `H = s (1 - c) / (1 + c)`, where
    `c = Re(r* e^(i a))`.
    """

    s: Scalar
    ratio: Complex[Array, ""]  # r
    root: Scalar  # d phi / da at c = 0
    moved: Complex[Array, ""]  # m

    @classmethod
    def of(cls, zeta: Complex[Array, ""], s: Scalar) -> "_Shape":
        ratio = zeta / (1 + s)
        root = jnp.sqrt(1 - ratio.real**2 - ratio.imag**2)
        return cls(s, ratio, root, ratio / (1 + root))

    def at(self, angles: Array) -> tuple[Array, Array, Array]:
        """`H`, `e^(i phi)` and `d phi / da`."""
        turn = jnp.exp(1j * angles)
        c = (jnp.conj(self.ratio) * turn).real
        direction = (turn + self.moved) / (1 + jnp.conj(self.moved) * turn)
        return self.s * (1 - c) / (1 + c), direction, self.root / (1 + c)


class _Film(eqx.Module):
    """Pressure round the journal by the coefficients of its modes."""

    shape: _Shape
    values: Float[Array, "nodes 2"]  # `H^2 Sum_j P_j` at equidistant angles for `w = 1` and `w = i`
    waves: Complex[Array, "h 2"]  # Fourier coefficients of it, twice those beside the mean
    rest: Scalar  # 1 - Sum_j 6 / b^4

    def pressures(self, angles: Array) -> Array:
        """`p H^2` at angles of the map for `w = 1` and `w = i`, along a last axis."""
        return _series(self.waves, angles) - self.rest * self.remainder(angles)

    def at_nodes(self) -> Array:
        """The same at the equidistant angles."""
        return self.values - self.rest * self.remainder(jnp.asarray(ANGLES))

    def remainder(self, angles: Array) -> Array:
        """`g / H` for `w = 1` and `w = i`, along a last axis."""
        gap, direction, _ = self.shape.at(angles)
        return _squeezed(direction) / gap[..., None]


def _modes(shape: _Shape, rates: Array, shares: Array) -> Float[Array, "nodes 2"]:
    """`H^2 Sum_j P_j` at equidistant angles for `w = 1` and `w = i`."""
    first, second = _derivatives()
    turn = np.exp(1j * ANGLES)
    c, slope = ((jnp.conj(shape.ratio) * part).real for part in (turn, 1j * turn))
    gap, direction, _ = shape.at(jnp.asarray(ANGLES))
    # H Y'' - H' Y' - (2 H'' + k H) Y = 6 k g / b^4 for Y = H^2 P, with H'' = 1 - H
    flow = (1 - c**2)[:, None] * second + (slope * (3 - c))[:, None] * first
    flow = shape.s / shape.root**2 * flow
    held = 2 + (rates[:, None] - 2) * gap  # (modes, nodes)
    matrix = flow - held[:, :, None] * np.eye(NODES)
    known = (rates * shares)[:, None, None] * _squeezed(direction)
    return linalg.solve(matrix, known).sum(0)


def _derivatives() -> tuple[np.ndarray, np.ndarray]:
    """Matrices of the first and second derivative of a Fourier series at equidistant angles."""
    count = np.arange(NODES)
    turn = np.exp(2j * np.pi / NODES * np.outer(count, count))
    orders = np.where(count > NODES // 2, count - NODES, count)
    of = lambda factor: (turn @ (factor[:, None] * turn.conj()) / NODES).real
    return of(1j * orders), of(-(orders**2.0))


def _transform() -> np.ndarray:
    """Matrix from values at the angles to Fourier coefficients, twice those beside the mean."""
    half = np.arange(NODES // 2 + 1)
    turn = np.exp(-2j * np.pi / NODES * np.outer(half, np.arange(NODES))) / NODES
    return np.where(half[:, None] > 0, 2.0, 1.0) * turn


def _squeezed(direction: Array) -> Array:
    """`g` for `w = 1` and `w = i`, along a last axis."""
    return -jnp.stack([direction.real, direction.imag], axis=-1)


def _series(waves: Complex[Array, "h 2"], angles: Array) -> Array:
    """`Re Sum_k waves_k e^(i k angle)`, along a last axis."""
    turn = jnp.exp(1j * angles)[..., None]
    total = waves[-1] * jnp.ones_like(turn)
    for k in range(NODES // 2 - 1, -1, -1):
        total = total * turn + waves[k]
    return total.real


def _ends(film: _Film, w: Plane) -> tuple[Float[Array, ""], Float[Array, ""]]:
    """Angles between which the pressure is positive, by Newton's method from the nodes beside them.

    The last step alone has their derivatives.
    """
    fixed, fixed_w = jax.lax.stop_gradient((film, w))
    spacing = 2 * np.pi / NODES
    values = fixed.at_nodes() @ fixed_w
    following = jnp.roll(values, -1)
    rises, falls = (values <= 0) & (following > 0), (values >= 0) & (following < 0)
    k = jnp.stack([jnp.argmax(rises), jnp.argmax(falls)])
    start = spacing * (k + values[k] / (values[k] - following[k]))

    def valued(angles: Array) -> tuple[Array, Array]:
        pressure = lambda angles: fixed.pressures(angles) @ fixed_w
        return jax.jvp(pressure, (angles,), (jnp.ones(2),))

    def step(_, angles: Array) -> Array:
        value, slope = valued(angles)
        return angles - value / slope

    angles = jax.lax.fori_loop(0, NEWTON, step, start)
    begin, end = angles - film.pressures(angles) @ w / valued(angles)[1]
    return begin, jnp.where(end < begin, end + 2 * jnp.pi, end)
