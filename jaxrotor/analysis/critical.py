"""Critical speeds: where the spin meets a whirl of the undamped rotor."""

from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Complex, Float

from ..pencil import Pencil, check_moves, frame, is_rounding, isotropic, root_changes
from ..quantities import Scalar, known
from ..scene import Scene
from ..system import System, assemble


class CriticalSpeeds(NamedTuple):
    """Speeds of rotation [rad/s] that equal the frequency of a forward or a backward whirl."""

    forward: Float[Array, " f"]
    backward: Float[Array, " b"]


class AxisSpeeds(NamedTuple):
    """Critical speeds [rad/s] of an unequal rotor along its axis and across it, each ascending."""

    along: Float[Array, " a"]
    across: Float[Array, " b"]


def critical_speeds(scene: Scene, count: int | None = None) -> CriticalSpeeds:
    """Undamped synchronous whirl: `det( K - Omega^2 (M - G) ) = 0` forward, `M + G` backward.

    Of axes that are equal or, on unequal supports, with the pair `(q, q*)`; there whirl is elliptic
    and counts by the larger of its parts. An unequal shaft has no backward ones: it is critical where
    it stands bent in its own axes, `det( K - Omega^2 (M - G) ) = 0` of the pair in these. Solved for
    `Omega^2` at once, not by scanning.

    Args:
        scene: the rotor; its own speed does not matter, nor do damping, hysteresis and cross-coupled
            stiffness (of supports that push across), which are left out.
        count: how many of each to return, by default all.

    Returns:
        Speeds [rad/s], ascending; those that do not exist are left out (infinite where traced).
        Differentiable; equal ones by the mean of theirs.

    Source: Brysin, Nikiforov (2019), eq. (3) with Lambda = omega; Klochkov, eqs. (16), (17).
    """
    speeds, forward = _synchronous(scene)
    found = []
    for chosen in (forward > 0, forward < 0):
        one = jnp.sort(jnp.where(chosen, speeds, jnp.inf))
        found.append((one[jnp.isfinite(one)] if known(one) else one)[:count])
    return CriticalSpeeds(*found)


@eqx.filter_jit
def _synchronous(scene: Scene) -> tuple[Float[Array, " c"], Float[Array, " c"]]:
    """Critical speeds (infinite for none) and how far they whirl forward, in no order."""
    system = assemble(scene)
    check_moves(system)
    blocks, zero, part = system.blocks, _zero(system), _filled(system)
    stiffness, inertia = part(blocks.stiffness), part(blocks.inertia)
    ahead, behind = (inertia + sense * part(blocks.gyroscopic) for sense in (-1, 1))
    if isotropic(blocks):
        one, other = _synchronous_of(stiffness, ahead), _synchronous_of(stiffness, behind)
        sense = jnp.ones_like(one)
        return jnp.concatenate([one, other]), jnp.concatenate([sense, -sense])
    axes = frame(blocks)
    if axes == "periodic":
        raise ValueError(
            "A shaft of two stiffnesses on supports of two stiffnesses has no critical speeds, but "
            "bands of them; look at `floquet_multipliers`."
        )
    unequal = part(getattr(blocks, f"{axes}_stiffness"))
    if axes == "rotating":  # seen from the shaft, both parts of a synchronous whirl stand still
        behind = ahead
    stiffness = jnp.block([[stiffness, unequal], [unequal.conj(), stiffness.conj()]])
    inertia = jnp.block([[ahead, zero], [zero, behind]])
    speeds = _synchronous_of(stiffness, inertia)
    if axes == "rotating":
        return speeds, jnp.ones_like(speeds)
    # Both parts of the orbit where `(K - Omega^2 M) q = 0`.
    last = lambda omega: jnp.linalg.svd(stiffness - omega**2 * inertia)[2][-1]
    vectors = jax.lax.map(last, jax.lax.stop_gradient(jnp.where(jnp.isfinite(speeds), speeds, 1.0)))
    with_, against = (jnp.sum(jnp.abs(v) ** 2, axis=1) for v in jnp.split(vectors, 2, axis=1))
    return speeds, jax.lax.stop_gradient(with_ - against)


def axis_speeds(scene: Scene) -> AxisSpeeds:
    """`det( K + U - Omega^2 (M - G) ) = 0` along the axis of angle 0, `det( K - U - .. ) = 0` across it.

    `U` is what makes stiffness unequal, in axes that turn with the shaft. The speeds are those of
    `critical_speeds`, but each keeps its axis where they cross, so they are smooth there.

    Args:
        scene: a rotor whose unequal parts turn with the shaft, their axes at angle 0; its own speed
            does not matter.

    Returns:
        Ascending speeds [rad/s] along and across, infinite for none; not a number where an axis is not
        at angle 0. Differentiable.

    Source: Klochkov, eqs. (16), (17).
    """
    speeds = _axis_speeds(scene)
    if known(speeds[0]) and jnp.any(jnp.isnan(speeds[0])):
        raise ValueError(
            "Critical speeds along and across are those of one pair of axes, but an unequal part of this "
            "rotor has its axis at another angle than 0."
        )
    return AxisSpeeds(*speeds)


@eqx.filter_jit
def _axis_speeds(scene: Scene) -> tuple[Float[Array, " a"], Float[Array, " b"]]:
    system = assemble(scene)
    check_moves(system)
    blocks = system.blocks
    if frame(blocks) != "rotating":
        raise ValueError(
            "Only axes that turn with the shaft part its critical speeds in two, but no part of this "
            "rotor alone does; look at `critical_speeds`."
        )
    part = _filled(system)
    inertia = part(blocks.inertia) - part(blocks.gyroscopic)
    unequal = part(blocks.rotating_stiffness)
    real = jnp.all(is_rounding(unequal.imag, jnp.max(jnp.abs(unequal))))
    speeds = (_synchronous_of(part(blocks.stiffness) + s * unequal, inertia) for s in (1, -1))
    along, across = (jnp.where(real, jnp.sort(one), jnp.nan) for one in speeds)
    return along, across


def _zero(system: System) -> Complex[Array, "n n"]:
    return jnp.zeros(system.line.stiffness.shape, complex)


def _filled(system: System) -> Callable[[Array | None], Array]:
    """Blocks as complex matrices, those that nothing draws as zeros."""
    zero = _zero(system)
    return lambda block: zero if block is None else block + 0j


def _synchronous_of(stiffness: Array, inertia: Array) -> Float[Array, " c"]:
    """Every real `Omega > 0` with `det(K - Omega^2 M) = 0`, else infinite.

    `Omega = 0` of a free shaft is none; rounding leaves about 1e-15 of the scale in its square.
    """
    squares, scale = _squares(stiffness, inertia), _scale(stiffness, inertia)
    real = jnp.isfinite(squares) & (squares.real > 1e-10 * scale)
    real = real & (jnp.abs(squares.imag) < 1e-6 * jnp.abs(squares))
    return jnp.where(real, jnp.sqrt(jnp.where(real, squares.real, 1.0)), jnp.inf)


def _scale(stiffness: Array, inertia: Array) -> Scalar:
    """Of the order of the square of the first critical speed."""
    return Pencil(inertia, inertia, stiffness).rate ** 2


@jax.custom_jvp
def _squares(stiffness: Array, inertia: Array) -> Complex[Array, " c"]:
    """Every `s` with `det(K - s M) = 0`, infinite for coordinates without inertia."""
    shift = _scale(stiffness, inertia)
    inverses = jnp.linalg.eigvals(jnp.linalg.solve(stiffness + shift * inertia, inertia))
    there = jnp.abs(inverses) * shift > 1e-10
    return jnp.where(there, 1 / jnp.where(there, inverses, 1.0) - shift, jnp.inf)


@_squares.defjvp
def _squares_jvp(primals, tangents):
    """Like the derivatives of roots; of two that are equal the mean."""
    values = _squares(*primals)
    linear = lambda stiffness, inertia: Pencil(jnp.zeros_like(inertia), -inertia, stiffness)
    return values, root_changes(values, linear(*primals), linear(*tangents))
