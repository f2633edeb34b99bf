"""Roots and modes of a rotor about its straight line."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Complex, Float

from ..blocks import Blocks
from ..pencil import Frame, Pencil, eigenvalues, eigenvectors, frame, isotropic
from ..quantities import known
from ..scene import Scene
from ..system import System, assemble


ROUNDING = 1e-9  # of a root, that its real part may have where it should have none


class Modes(eqx.Module):
    """Natural motions `z(x, t) = shape(x) exp(lambda t) + conj(counter(x) exp(lambda t))`.

    `m` of them at `x` stations; in the rotating frame where `frame` says so.
    """

    values: Complex[Array, " m"]  # lambda [rad/s]
    shapes: Complex[Array, "m x"]  # largest component 1
    counter: Complex[Array, "m x"] | None  # None where every orbit is a circle
    stations: Float[Array, " x"]  # [m]
    frame: Frame = eqx.field(static=True)

    @property
    def forward(self) -> Float[Array, " m"]:
        """+1 for circular whirl with the spin, -1 against it, 0 for a straight line."""
        sense = jnp.sign(self.values.imag)
        if self.counter is None:
            return sense
        with_, against = (jnp.sum(jnp.abs(a) ** 2, axis=1) for a in (self.shapes, self.counter))
        return sense * (with_ - against) / (with_ + against)

    @property
    def damping_ratio(self) -> Float[Array, " m"]:
        """`-Re lambda / |lambda|`."""
        return -self.values.real / jnp.abs(self.values)

    @property
    def log_decrement(self) -> Float[Array, " m"]:
        """`-2 pi Re lambda / |Im lambda|`: logarithm of the amplitude lost in one turn."""
        return -2 * jnp.pi * self.values.real / jnp.abs(self.values.imag)


def roots(scene: Scene, count: int | None = None) -> Complex[Array, " m"]:
    """Complex eigenvalues: `det( lambda^2 M + lambda (C - i Omega G) + K - i Omega H ) = 0`.

    Of `x + i y`, so a positive imaginary part is forward whirl; real part negative is stable. A rotor
    that is not the same along every axis has conjugate pairs instead: in the fixed frame, or of
    motions in the axes of the shaft where only the shaft (or what turns with it) is unequal.
    Contact is absent: the straight rotor touches nothing.

    Args:
        scene: the rotor.
        count: how many of the slowest to return, by default all.

    Returns:
        Roots [rad/s] by rising magnitude; of a pair, forward first. Coordinates without mass have
        none (infinite ones where traced). Differentiable; equal roots by the mean of theirs.

    Source: Azarov, Gouskov, Panovko (2023), eq. (9) without contact; Brysin, Nikiforov (2019),
    eq. (2); Klochkov, eqs. (4)-(7).
    """
    values = _roots(scene)
    if known(values):
        values = values[jnp.isfinite(values)]
    return values[:count]


@eqx.filter_jit
def _roots(scene: Scene) -> Complex[Array, " m"]:
    values = natural_roots(assemble(scene))
    return values[slowest_first(values)]


@eqx.filter_jit
def modes(scene: Scene, count: int | None = None, points: int = 101) -> Modes:
    """Roots with their mode shapes at `points` stations along the shaft; see `roots`.

    The shapes are not differentiable (jax has no derivative of eigenvectors).
    """
    system = assemble(scene)
    if system.blocks.hysteretic is None:
        values, vectors = eigenvectors(Pencil.of(system))
        values = _less_rounding(values, system.blocks)
    else:
        faster, slower = (eigenvectors(Pencil.of(system, whirl)) for whirl in (1, -1))
        values, vectors = _by_whirl(system.spin.speed, faster, slower)
    order = slowest_first(values)[:count]
    stations = scene.shaft.seen(points)
    rows = jax.vmap(system.line.row)(stations)
    halves = vectors[order].reshape(-1, vectors.shape[1] // system.n, system.n)
    seen = halves @ rows.T  # (m, 1 or 2, x)
    flat = seen.reshape(seen.shape[0], -1)
    largest = jnp.take_along_axis(flat, jnp.argmax(jnp.abs(flat), axis=1, keepdims=True), axis=1)
    seen = seen / largest[:, None]
    counter = None if isotropic(system.blocks) else seen[:, 1]
    return Modes(values[order], seen[:, 0], counter, stations, frame(system.blocks))


def natural_roots(system: System) -> Complex[Array, " m"]:
    """All eigenvalues [rad/s] of a system, in no order, infinite where there is no mass."""
    if system.blocks.hysteretic is None:
        return _less_rounding(eigenvalues(Pencil.of(system)), system.blocks)
    pairs = [(values, values) for w in (1, -1) for values in [eigenvalues(Pencil.of(system, w))]]
    return _by_whirl(system.spin.speed, *pairs)[0]


def _by_whirl(speed, faster, slower):
    """Of two sets of roots, those that whirl faster and those that whirl slower than the shaft.

    The sign of the loss hardly moves a frequency, so both sets have one order by frequency.
    """
    faster, slower = (
        tuple(part[jnp.argsort(values.imag)] for part in (values, vectors))
        for values, vectors in (faster, slower)
    )
    chosen = faster[0].imag > speed
    pick = lambda a, b: jnp.where(chosen.reshape(-1, *[1] * (a.ndim - 1)), a, b)
    return tuple(pick(a, b) for a, b in zip(faster, slower, strict=True))


def _less_rounding(values: Complex[Array, " m"], blocks: Blocks) -> Complex[Array, " m"]:
    """A rotor without loss and drive whirls for ever: what rounding adds to fast modes is dropped."""
    drives = ("damping", "circulatory", "skew_stiffness", "fixed_damping")
    lasting = all(getattr(blocks, name) is None for name in drives)
    if frame(blocks) != "fixed" or not lasting:
        return values
    small = jnp.isfinite(values) & (jnp.abs(values.real) <= ROUNDING * jnp.abs(values))
    return jnp.where(small, 1j * values.imag, values)


def slowest_first(values: Complex[Array, " m"]) -> Array:
    """Order of roots by magnitude, of a pair forward first."""
    return jnp.argsort(jnp.abs(values) * (1 + 1e-9 * (values.imag < 0)))
