"""Roots and modes of a rotor about its straight position."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float

from ..core.compiled import compiled_quickly
from ..core.extremes import larger
from ..core.quantities import Scalar, known
from ..core.tables import RPM, notebook_table
from ..equations.parts import assemble_blocks
from ..equations.pencil import (
    ROUNDING,
    Frame,
    Pencil,
    eigenvalues,
    eigenvectors,
    frame,
    is_rounding,
    isotropic,
    moving_eigenvalues,
)
from ..equations.system import System, assemble
from ..scene import Scene
from ..shafts.cased import line_of
from ..shafts.virtual import VirtualLine
from ..spins.base import sense_of
from .linearized import check_linear
from .resolved import resolved
from .whirl_tables import OverWhirl, whirl_roots


KINDS = ("forward", "backward", "mixed")  # kinds of whirl
DRIFT = 1e-7  # root of a rigid motion that is zero within rounding, over the first frequency
# Sense of an ellipse with half axes 1 : 10; flatter ones are neither forward nor backward
STRAIGHT = 0.2


class Modes(eqx.Module):
    """Natural motions `z(x, t) = shape(x) exp(lambda t) + conj(counter(x) exp(lambda t))`.

    There are `m` modes at `x` stations, of several shafts at those of one after the other. `z` is in
    fixed axes, or, if `frame` is "rotating", in axes that turn with the shaft.
    """

    values: Complex[Array, " m"]  # lambda [rad/s]
    shapes: Complex[Array, "m x"]  # largest component 1
    counter: Complex[Array, "m x"] | None  # counter shape; None where every orbit is a circle
    shares: Float[Array, "m 2"]  # of shape and counter shape in `Int |z|^2 dm`; they sum to 1
    stations: Float[Array, " x"]  # [m]
    speed: Scalar  # Omega [rad/s]
    frame: Frame = eqx.field(static=True)
    # Name and number of stations of each shaft, in their order; none of a scene of one shaft
    shafts: tuple[tuple[str, int], ...] = eqx.field(static=True, default=())

    def _repr_html_(self) -> str:
        parts = (self.fixed_values, self.damping_ratio, self.forward)
        rows = [
            (k, value.real, value.imag, abs(value.imag) * RPM, ratio, kind_of_whirl(sense))
            for k, (value, ratio, sense) in enumerate(
                zip(*(part.tolist() for part in parts), strict=True), 1
            )
        ]
        heads = ("mode", "growth [1/s]", "frequency [rad/s]", "[rpm]", "damping ratio", "whirl")
        speed = float(self.speed)
        return notebook_table(f"Modes at {speed:.6g} rad/s ({speed * RPM:.6g} rpm)", heads, rows)

    @property
    def fixed_values(self) -> Complex[Array, " m"]:
        """`lambda` [rad/s] in fixed axes: growth rate and frequency of the larger part.

        The root `s + i w` in turning axes gives the frequency `Omega + w` by its shape and `Omega - w`
        by its counter shape. Where both are equally large, as on a straight line, the shape counts.
        """
        by_shape, by_counter = self._frequencies
        larger = by_shape
        if self.counter is not None:
            ahead, behind = self.shares.T
            larger = jnp.where(ahead >= (1 - 1e-6) * behind, by_shape, by_counter)
        return self.values.real + 1j * larger

    @property
    def senses(self) -> Float[Array, "m x"]:
        """Forward less backward share of the squared amplitudes at each station, in fixed axes.

        +1 is a circle passed with the spin (at rest: from x to y), -1 a circle passed against it, 0 a
        straight line or no whirl.
        """
        return self._sense(*self._sizes)

    @property
    def forward(self) -> Float[Array, " m"]:
        """Forward less backward share of the whole rotor, weighted by its inertia.

        Where `frame` is "fixed" these are shares of the kinetic energy.
        """
        return self._sense(*jnp.split(self.shares, 2, axis=1))[:, 0]

    @property
    def damping_ratio(self) -> Float[Array, " m"]:
        """`-Re lambda / |lambda|` in fixed axes."""
        return -self.values.real / jnp.abs(self.fixed_values)

    @property
    def log_decrement(self) -> Float[Array, " m"]:
        """`-2 pi Re lambda / |Im lambda|` in fixed axes: logarithmic decrement."""
        return -2 * jnp.pi * self.values.real / jnp.abs(self.fixed_values.imag)

    @property
    def _frequencies(self) -> tuple[Float[Array, " m"], Float[Array, " m"]]:
        """Frequencies [rad/s] of shape and counter shape in fixed axes."""
        turning = self.speed if self.frame == "rotating" else 0.0
        return turning + self.values.imag, turning - self.values.imag

    @property
    def _sizes(self) -> tuple[Float[Array, "m x"], Float[Array, "m x"]]:
        """Squared amplitudes of shape and counter shape."""
        own = jnp.abs(self.shapes) ** 2
        return own, jnp.zeros_like(own) if self.counter is None else jnp.abs(self.counter) ** 2

    def _sense(self, own: Array, other: Array) -> Array:
        ways = (
            sense_of_whirl(self.values.real + 1j * w, self.speed)[:, None]
            for w in self._frequencies
        )
        total = own + other
        moved = sum(way * part for way, part in zip(ways, (own, other), strict=True))
        return jnp.where(total > 0, moved / jnp.where(total > 0, total, 1.0), 0.0)


def kind_of_whirl(sense: float) -> str:
    """Kind of whirl for a value of `Modes.forward`: "mixed" where orbits are nearly straight lines."""
    return "mixed" if abs(sense) < STRAIGHT else "forward" if sense > 0 else "backward"


def sense_of_whirl(values: Complex[Array, "..."], speed: Scalar | Array) -> Float[Array, "..."]:
    """+1 where circular whirl is with the spin (at rest: from x to y), -1 against it, 0 for none.

    `values` are `lambda` [rad/s] in fixed axes.
    """
    way = jnp.where(is_rounding(values.imag, values), 0.0, jnp.sign(values.imag))
    return way * sense_of(speed)


def roots(scene: Scene, count: int | None = None) -> Complex[Array, " m"]:
    """Complex eigenvalues: `det( lambda^2 M + lambda (C - i Omega G) + K - i Omega H ) = 0`.

    They belong to `x + i y`: a positive imaginary part is whirl from x to y, which is forward where the
    speed is not negative, and a negative real part is stable. A rotor with unequal axes has conjugate
    pairs instead, in the fixed frame or, where only the shaft (or what turns with it) is unequal, in the
    axes of the shaft. Contact is left out: the straight rotor touches nothing. With coefficients over
    the frequency of whirl each root has those at its own `|Im lambda|`; their number may then be
    another, and all are sought, see docs/concepts/speed-tables.md.

    Args:
        scene: the rotor.
        count: number of the slowest roots to return, by default all. Nodes that are "auto" are as many as
            these need, unless the shaft is traced; all roots are those of the scene's own nodes.

    Returns:
        Roots [rad/s] by rising magnitude; of a pair, that from x to y first. Coordinates without mass have
        none (infinite ones where traced). For a rotor without loss and drive a real part within
        rounding (1e-9 of its root) is set to zero. Differentiable; the derivative of equal roots is the
        mean of theirs.

    Raises:
        ValueError: tables of coefficients have no values at the speed of the scene.

    Source: Azarov, Gouskov, Panovko (2023), eq. (9) without contact; Brysin, Nikiforov (2019),
    eq. (2); Klochkov, eqs. (4)-(7).
    """
    check_linear(scene)
    values = _roots(OverWhirl.of(resolved(scene, count)), count)
    if known(values):
        found = np.asarray(values)
        return jnp.asarray(found[np.isfinite(found)][:count])
    return values[:count]


@compiled_quickly
def _roots(system: System | OverWhirl, count: int | None) -> Complex[Array, " m"]:
    whirls = isinstance(system, OverWhirl)
    values = whirl_roots(system.scene) if whirls else natural_roots(system, count)
    return values[slowest_first(values)]


def modes(scene: Scene, count: int | None = None, points: int = 101) -> Modes:
    """Roots with their mode shapes at stations along the shaft; see `roots`.

    Args:
        scene: the rotor.
        count: number of the slowest modes to return, by default all; it decides nodes as in `roots`.
        points: number of stations on each shaft.

    Returns:
        `Modes`. Differentiable, shapes too, with their largest component held at 1; the shapes of equal
        roots are held constant, as any combination of them is a shape.

    Raises:
        ValueError: tables of coefficients have no values at the speed of the scene.
    """
    check_linear(scene)
    scene = resolved(scene, count)
    found = _modes(scene, assemble(scene), count, points)
    if not known(found.values):
        return found
    there = np.isfinite(found.values)
    if there.all():
        return found
    own = lambda modes: [
        part
        for part in (modes.values, modes.shapes, modes.counter, modes.shares)
        if part is not None
    ]
    return eqx.tree_at(own, found, [jnp.asarray(np.asarray(part)[there]) for part in own(found)])


@compiled_quickly
def _modes(scene: Scene, system: System, count: int | None, points: int) -> Modes:
    if system.blocks.hysteretic is None:
        values, vectors = eigenvectors(Pencil.of(system), count)
        values = less_rounding(values, system)
    else:
        faster, slower = (eigenvectors(Pencil.of(system, whirl)) for whirl in (1, -1))
        values, vectors = _by_whirl(system.spin.speed, faster, slower)
    order = slowest_first(values)[:count]
    seen_on = lambda one: one.shaft.seen(points) + (0.0 if one.start is None else one.start)
    each = [seen_on(one) for one in scene.placed()]
    lines = [line_of(system.line, name) for name in scene.shafts or (None,)]
    rows = [jax.vmap(line.row)(own) for line, own in zip(lines, each, strict=True)]
    shafts = tuple((name, own.size) for name, own in zip(scene.shafts, each, strict=False))
    stations, rows = map(jnp.concatenate, (each, rows))
    halves = vectors[order].reshape(-1, vectors.shape[1] // system.n, system.n)  # (m, 1 or 2, n)
    shares = inertia_shares(scene, system, halves)
    seen = halves @ rows.T  # (m, 1 or 2, x)
    flat = seen.reshape(seen.shape[0], -1)
    largest = jnp.take_along_axis(flat, jnp.argmax(jnp.abs(flat), axis=1, keepdims=True), axis=1)
    seen = seen / largest[:, None]
    counter = None if isotropic(system.blocks) else seen[:, 1]
    speed = jnp.asarray(system.spin.speed)
    axes = frame(system.blocks)
    return Modes(values[order], seen[:, 0], counter, shares, stations, speed, axes, shafts)


def inertia_shares(
    scene: Scene, system: System, halves: Complex[Array, "m h n"]
) -> Float[Array, "m 2"]:
    """Shares of shape and counter shape in `q' M q`, tilting included.

    In fixed axes they are shares of the kinetic energy. `halves` are the coordinates of both, or of
    the shape alone where every orbit is a circle.
    """
    if halves.shape[1] == 1:
        return jnp.stack([jnp.ones(len(halves)), jnp.zeros(len(halves))], axis=1)
    return energy_shares(kinetic_energy(scene, system), halves)


def kinetic_energy(scene: Scene, system: System) -> Float[Array, "n n"]:
    """`M` of the kinetic energy `q.* M q. / 2`: symmetric, unlike that of equations in deflections."""
    inertia: Any = assemble_blocks(scene, VirtualLine.galerkin(system.line)).inertia
    return inertia


def energy_shares(
    energy: Float[Array, "n n"], halves: Complex[Array, "m 2 n"]
) -> Float[Array, "m 2"]:
    """Shares of shape and counter shape in `q' M q`; equal ones where nothing with mass moves."""
    parts = jnp.einsum("mhi,ij,mhj->mh", halves.conj(), energy, halves).real
    total = jnp.sum(parts, axis=1, keepdims=True)
    return jnp.where(total > 0, parts / jnp.where(total > 0, total, 1.0), 0.5)


def natural_roots(system: System, count: int | None = None) -> Complex[Array, " m"]:
    """Eigenvalues [rad/s] of a system, unordered, infinite for coordinates without mass.

    All of them or, with a `count`, so many of the slowest and some others.
    """
    if system.blocks.hysteretic is None:
        return less_rounding(eigenvalues(Pencil.of(system), count), system)
    pairs = [(values, values) for w in (1, -1) for values in [eigenvalues(Pencil.of(system, w))]]
    return _by_whirl(system.spin.speed, *pairs)[0]


def moving_roots(
    system: System, speed: Scalar, count: int
) -> tuple[Complex[Array, " m"], Complex[Array, " m"], Complex[Array, "m m2"]]:
    """`natural_roots` at a speed, their derivatives by it, and vectors; see `moving_eigenvalues`."""

    def at_whirl(whirl: int, count: int):
        pencil = lambda speed: Pencil.of(system.at_speed(speed), whirl)
        here, change = jax.jvp(pencil, (speed,), (jnp.ones_like(speed),))
        return moving_eigenvalues(here, change, count)

    if system.blocks.hysteretic is None:
        values, slopes, vectors = at_whirl(0, count)
        values = less_rounding(values, system)
        return values, jnp.where(values == 0, 0.0, slopes) if system.free else slopes, vectors
    return _by_whirl(speed, *(at_whirl(whirl, 2 * system.n) for whirl in (1, -1)))


def _by_whirl(speed, faster, slower) -> Any:
    """The roots of `faster` that whirl faster than the shaft, and those of `slower` that whirl slower.

    The sign of the loss hardly changes a frequency, so both sets have the same order by frequency.
    """
    faster, slower = (
        tuple(part[jnp.argsort(parts[0].imag)] for part in parts) for parts in (faster, slower)
    )
    chosen = faster[0].imag > speed
    pick = lambda a, b: jnp.where(chosen.reshape(-1, *[1] * (a.ndim - 1)), a, b)
    return tuple(pick(a, b) for a, b in zip(faster, slower, strict=True))


def less_rounding(values: Complex[Array, " m"], system: System) -> Complex[Array, " m"]:
    """Roots with real parts within rounding set to zero, for a rotor without loss and drive.

    Those of rigid motions that nothing holds are zero. They are multiple roots, of half the digits.
    """
    blocks, sizes = system.blocks, jnp.abs(values)
    if system.free:
        least = DRIFT * Pencil.mean(system.at_rest).rate
        values = jnp.where(sizes <= least, 0.0, values)
        sizes = larger(sizes, least / ROUNDING)
    drives = ("damping", "circulatory", "skew_stiffness", "fixed_damping")
    lasting = all(getattr(blocks, name) is None for name in drives)
    if frame(blocks) != "fixed" or not lasting:
        return values
    small = jnp.isfinite(values) & is_rounding(values.real, sizes)
    return jnp.where(small, 1j * values.imag, values)


def slowest_first(values: Complex[Array, " m"]) -> Array:
    """Order of roots by magnitude; of a pair that from x to y comes first."""
    return jnp.argsort(jnp.abs(values) * (1 + ROUNDING * (values.imag < 0)))
