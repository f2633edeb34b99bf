"""Coefficients over the frequency of whirl, as of seals: a nonlinear eigenvalue problem for the roots.

    det( lambda^2 M + lambda (C(w) - i Omega G) + K(w) - i Omega H ) = 0,   w = |Im lambda|

At a given w the roots are eigenvalues `lambda_j(w)`, and those of the rotor are the crossings
`|Im lambda_j(w)| = w`. They are sought on a grid of w, so none is left to the chance of a start.
"""

import dataclasses
from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Bool, Complex, Float

from ..core import linalg
from ..core.blocks import Blocks
from ..core.compiled import compiled_quickly
from ..core.quantities import Scalar, with_values
from ..core.roots import sign_change
from ..effects.base import AbstractOverSpeed
from ..equations.pencil import Pencil, eigenvalues, frame, is_rounding, isotropic, unequal_parts
from ..equations.speed_tables import (
    clock_of,
    has_tables,
    has_whirl_tables,
    speed_of,
    whirl_range,
    within_tables,
)
from ..equations.system import System, assemble
from ..scene import Scene
from ..spins import AbstractSpin


INTERVALS = 128  # of whirl frequency, in which crossings are sought
MORE = 16  # places for crossings beyond the number of eigenvalues
POLISHING = 3  # steps of Newton's method
SAME = 1e-6  # relative difference of a frequency and that of its coefficients, at a crossing


def synchronous(scene: Scene) -> Scene:
    """The scene with tables over whirl read at the speed: that is the frequency of synchronous whirl."""
    return _changed(scene, lambda support: with_values(support, synchronous=True))


def _at_whirl(scene: Scene, frequency: ArrayLike) -> Scene:
    """The scene with the coefficients of its supports at one frequency of whirl [rad/s]."""
    return _changed(scene, lambda support: support.at_whirl(frequency))


def _at_speed(scene: Scene, speed: ArrayLike) -> Scene:
    """The scene with tables over speed and whirl as tables over whirl at one speed [rad/s]."""
    read = lambda support: support.at_speed(speed_of(clock_of(scene, support), speed))
    return _changed(scene, read)


def _changed(scene: Scene, change: Callable) -> Scene:
    """The scene with those of its supports changed that have tables over whirl."""
    if not has_whirl_tables(scene):
        return scene
    tabled = lambda one: isinstance(one, AbstractOverSpeed) and one.nodes_over_whirl is not None
    effects = tuple(change(one) if tabled(one) else one for one in scene.effects)
    return with_values(scene, effects=effects)  # whose stations may be traced


class OverWhirl(eqx.Module):
    """Equations of a rotor whose coefficients depend on the frequency of whirl, in place of a `System`."""

    scene: Scene
    system: System  # with the coefficients at a place within the tables, see `_at_lowest`

    @classmethod
    def of(cls, scene: Scene) -> "OverWhirl | System":
        """The equations of a scene, as a `System` where nothing depends on the frequency of whirl."""
        if not has_whirl_tables(scene):
            return assemble(scene)
        return cls(scene, _at_lowest(scene))

    @property
    def blocks(self) -> Blocks:
        """Blocks of the same structure as those at any frequency."""
        return self.system.blocks

    @property
    def spin(self) -> AbstractSpin:
        """The law of rotation."""
        return self.system.spin

    @property
    def n(self) -> int:
        """Number of complex coordinates."""
        return self.system.n

    @property
    def at_rest(self) -> System:
        """A rotor at rest of the same scale."""
        return self.system.at_rest

    @property
    def tabled(self) -> Scene | None:
        """The scene, where coefficients depend on the speed, too."""
        return self.scene if has_tables(self.scene) else None

    def at_speed(self, speed: Scalar) -> "OverWhirl":
        """The same rotor at another speed."""
        return OverWhirl(self.scene.at_speed(speed), self.system.at_speed(speed))


@eqx.filter_jit  # traced once a program
def whirl_roots(scene: Scene) -> Complex[Array, " r"]:
    """All roots whose frequency is within the tables, unordered; unused places are infinite.

    Beyond tables that are held their coefficients are constant, and roots there are among these; beyond
    others roots are not found. Two crossings of one branch within an interval of the grid are missed, and
    the fastest of more than `MORE` crossings beyond the number of eigenvalues. Differentiable, by a last
    step of Newton's method.
    """
    system = _over_whirl(scene)
    held = jax.lax.stop_gradient(system)
    low, high, beyond = whirl_range(jax.lax.stop_gradient(scene))
    circular = isotropic(held.blocks)

    @jax.jit  # traced once a program
    def values(frequency: Scalar) -> Complex[Array, " m"]:
        found = eigenvalues(_pencil(held, frequency))
        return jnp.where(jnp.isfinite(found), found, 0.0)  # a root at zero is left out below

    grid = jnp.linspace(low, high, INTERVALS + 1)
    grids = jnp.stack([grid, -grid[::-1]] if circular else [grid])
    both = jax.lax.map(lambda grid: _crossings(values, grid), grids)
    found = [both.ravel()]
    ends = [(low, lambda roots: (low == 0) & is_rounding(roots.imag, roots))]
    if beyond:
        ends.append((high, lambda roots: jnp.abs(roots.imag) > high))
    for end, belongs in ends:
        roots = values(end)
        chosen = belongs(roots) & (circular | (roots.imag >= 0))
        found.append(jnp.where(chosen, roots, jnp.inf))
    every = jnp.concatenate(found)
    least = 1e-9 * jnp.max(jnp.where(jnp.isfinite(every), jnp.abs(every), 0.0))
    every = jnp.where(jnp.abs(every) > least, every, jnp.inf)
    every = every[jnp.argsort(jnp.abs(every))][: both.shape[1]]
    polished = lambda root: jax.lax.cond(
        jnp.isfinite(root), lambda root: _polished(system, root), lambda root: root, root
    )
    roots = jax.lax.map(polished, every)
    if circular:
        return roots
    twin = jnp.isfinite(roots) & ~is_rounding(roots.imag, roots)
    return jnp.concatenate([roots, jnp.where(twin, roots.conj(), jnp.inf)])


def grows_beyond(scene: Scene) -> Bool[Array, ""]:
    """Whether a whirl beyond tables that are not held grows with the coefficients at their end.

    Its own coefficients are not known, so neither is whether the rotor is stable.
    """
    low, high, held = whirl_range(scene)
    if held:
        return jnp.zeros((), bool)
    system = _over_whirl(scene)
    slow, fast = jax.lax.map(lambda end: eigenvalues(_pencil(system, end)), jnp.stack([low, high]))
    roots = jnp.concatenate([slow, fast])
    beyond = jnp.concatenate([jnp.abs(slow.imag) < low, jnp.abs(fast.imag) > high])
    roots = jnp.where(beyond & jnp.isfinite(roots), roots, -1.0)
    return jnp.any((roots.real > 0) & ~is_rounding(roots.real, jnp.abs(roots)))


@compiled_quickly
def _at_lowest(scene: Scene) -> System:
    """The equations at the lowest frequency; raise where axes turn, in which a whirl has another one.

    Tables over speed, too, are read at the speed of the scene or at the nearer end of the tables.
    """
    within = _at_speed(scene, within_tables(scene, scene.spin.speed))
    system = assemble(_at_whirl(within, whirl_range(scene)[0]))
    _check_axes_stand(system)
    return system


def _check_axes_stand(system: System) -> None:
    if frame(system.blocks) != "fixed":
        raise ValueError(
            "Coefficients over the frequency of whirl are for axes that stand still, but unequal axes of "
            f"{unequal_parts(system, 'rotating')} turn with the shaft; give numbers at one frequency, "
            "`support.at_whirl(frequency)`."
        )


def _over_whirl(scene: Scene) -> System:
    """Equations at the speed of the scene, whose `blocks_at` are those at a frequency of whirl."""
    own = lambda part: isinstance(part, AbstractOverSpeed) and part.nodes_over_speed
    at = lambda part: speed_of(clock_of(scene, part), scene.spin.speed)
    read = lambda part: part.at_speed(at(part)) if own(part) else part
    system = assemble(synchronous(with_values(scene, effects=tuple(map(read, scene.effects)))))
    _check_axes_stand(system)
    return system


def _pencil(system: System, frequency: Scalar) -> Pencil:
    """The pencil at a frequency of whirl, of the equations of `_over_whirl`."""
    return Pencil.of(dataclasses.replace(system, blocks=system.blocks_at(frequency))).along_axes


def _crossings(values: Callable, grid: Float[Array, " g"]) -> Complex[Array, " c"]:
    """Roots `lambda_j(|w|)` with `Im lambda_j = w` on a grid of w; unused places are infinite."""

    def above(w: Scalar) -> Float[Array, " m"]:
        return jnp.sort(values(jnp.abs(w)).imag) - w

    at_grid = jax.lax.map(above, grid)
    changes: Bool[Array, "i m"] = (at_grid[:-1] > 0) != (at_grid[1:] > 0)
    count = at_grid.shape[1]
    order = jnp.argsort(~changes.ravel())[: count + MORE]

    def frequency(place: Array) -> Scalar:
        k, j = place // count, place % count
        first, last = at_grid[k, j], at_grid[k + 1, j]
        return sign_change(lambda w: above(w)[j], grid[k], grid[k + 1], first, last, last > 0)

    def either(place: Array) -> tuple[Scalar, Complex[Array, " m"]]:
        none = lambda place: jnp.inf
        w = jax.lax.cond(changes.ravel()[place], frequency, none, place)
        roots = jax.lax.cond(
            jnp.isfinite(w), values, lambda w: jnp.full(count, jnp.inf + 0j), abs(w)
        )
        return w, roots

    found, roots = jax.lax.map(either, order)
    # Roots of one frequency are told apart by their real parts: rounding orders their frequencies.
    near = lambda at, w: jnp.abs(at - w) <= SAME * jnp.abs(w)
    earlier = jnp.tril(near(found, found[:, None]), -1).sum(1)
    here = jnp.where(near(roots.imag, found[:, None]), roots, jnp.inf)
    here = jnp.take_along_axis(here, jnp.argsort(here.real, axis=1), axis=1)
    return jnp.take_along_axis(here, jnp.minimum(earlier, count - 1)[:, None], axis=1)[:, 0]


def _polished(system: System, root: Complex[Array, ""]) -> Complex[Array, ""]:
    """The root by Newton's method for `y P(lambda, |Im lambda|) x = 0`, with null vectors of each step.

    The last step alone has derivatives by the scene.
    """

    def step(system: System, at: Float[Array, "2"]) -> Float[Array, "2"]:
        value, frequency = at[0] + 1j * at[1], jnp.abs(at[1])
        one = jnp.ones_like(frequency)
        near, change = jax.jvp(lambda w: _pencil(system, w), (frequency,), (one,))
        matrix = near.at(value)
        held, held_change = jax.lax.stop_gradient((near, change))
        u, _, v = linalg.svd(held.at(value))
        left, right = u[:, -1].conj(), v[-1].conj()
        parts = lambda matrix: jnp.stack(
            [(left @ matrix @ right).real, (left @ matrix @ right).imag]
        )
        along = 2 * value * held.inertia + held.damping
        across = 1j * along + jnp.sign(at[1]) * held_change.at(value)
        slope = jnp.stack([parts(along), parts(across)], axis=1)
        return at - linalg.solve(slope, parts(matrix))

    at, held = jnp.stack([root.real, root.imag]), jax.lax.stop_gradient(system)
    at = jax.lax.fori_loop(0, POLISHING, lambda _, at: step(held, at), at)
    at = step(system, jax.lax.stop_gradient(at))
    return at[0] + 1j * at[1]
