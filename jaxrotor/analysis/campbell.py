"""Campbell diagram: roots against the speed of rotation, each branch followed; critical speeds."""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float
from scipy.optimize import linear_sum_assignment

from ..pencil import Frame, Pencil, frame, isotropic, root_changes
from ..quantities import known
from ..scene import Scene
from ..system import assemble
from .modal import natural_roots, slowest_first


class Campbell(eqx.Module):
    """Branches of roots over `w` speeds, `m` of them, slowest first at the first speed."""

    speeds: Float[Array, " w"]  # [rad/s]
    values: Complex[Array, "w m"]  # lambda [rad/s]
    frame: Frame = eqx.field(static=True)
    circular: bool = eqx.field(static=True)  # whether whirl is, so that a frequency has a direction

    @property
    def frequencies(self) -> Float[Array, "w m"]:
        """Whirl frequency [rad/s], positive forward; of unequal axes, either sign of a pair."""
        return self.values.imag

    @property
    def growth(self) -> Float[Array, "w m"]:
        """Growth rate [1/s], negative stable."""
        return self.values.real


class CriticalSpeeds(NamedTuple):
    """Speeds of rotation [rad/s] that equal the frequency of a forward or a backward whirl."""

    forward: Float[Array, " f"]
    backward: Float[Array, " b"]


def campbell(scene: Scene, speeds, count: int = 8) -> Campbell:
    """Roots `lambda(Omega)` as continuous branches: they keep their identity where they cross.

    From speed to speed each root is sought where its derivative `d lambda / d Omega` says. So lines
    cross where modes do not feel each other, and bend away where they do, as long as the speeds
    are finer than the bend.

    Args:
        scene: the rotor; its own speed does not matter.
        speeds: [rad/s], ascending, two or more.
        count: how many branches to keep, the slowest at the first speed. Of unequal axes, one of
            each conjugate pair, but both where they part into real roots.

    Returns:
        Branches; not differentiable, `roots` is.

    Source: Brysin, Nikiforov (2019), Figs. 3, 4.
    """
    speeds = np.asarray(speeds, float)
    if speeds.ndim != 1 or speeds.size < 2 or not np.all(np.diff(speeds) > 0):
        raise ValueError(f"`speeds` must be two or more in ascending order, but is {speeds}.")
    blocks = jax.eval_shape(assemble, scene).blocks
    values, slopes = (np.asarray(a) for a in _values_and_slopes(scene, jnp.asarray(speeds), count))
    branches = np.empty(values.shape, complex)
    branches[0], slope = values[0], slopes[0]
    for k, step in enumerate(np.diff(speeds)):
        ahead = branches[k] + step * slope
        back = values[k + 1] - step * slopes[k + 1]
        cost = np.abs(ahead[:, None] - values[k + 1]) + np.abs(branches[k][:, None] - back)
        order = linear_sum_assignment(cost)[1]
        branches[k + 1], slope = values[k + 1, order], slopes[k + 1, order]
    if not isotropic(blocks):
        branches = _less_conjugates(branches)
    axes = frame(blocks)
    return Campbell(jnp.asarray(speeds), jnp.asarray(branches[:, :count]), axes, isotropic(blocks))


@eqx.filter_jit
def _values_and_slopes(scene: Scene, speeds: Float[Array, " w"], count: int):
    """The slowest roots at every speed, some more than `count` of (pairs of) them, and derivatives."""
    system = assemble(scene)

    def one(speed):
        values = natural_roots(system.at_speed(speed))
        # No mass, no motion: a root beyond all others.
        values = jnp.where(jnp.isfinite(values), values, 1e3 * jnp.max(_finite(jnp.abs(values))))
        values = values[slowest_first(values)[: 4 * count + 8]]
        pencil = lambda speed: Pencil.of(system.at_speed(speed))
        own, change = jax.jvp(pencil, (speed,), (jnp.ones_like(speed),))
        slopes = root_changes(values, own, change)
        return values, jnp.where(jnp.isfinite(slopes), slopes, 0.0)

    # One speed after the other: see `sweep._build_lanes` on batched linear algebra.
    return jax.lax.map(one, speeds)


def _finite(values: Array) -> Array:
    return jnp.where(jnp.isfinite(values), values, 0.0)


def _less_conjugates(branches: Any) -> np.ndarray:
    """Of branches that stay conjugate one, that of positive frequency."""
    kept: list[np.ndarray] = []
    for branch in branches[:, np.argsort(branches.imag.mean(axis=0) < 0, kind="stable")].T:
        close = 1e-9 * np.abs(branch)
        if not any((np.abs(branch.conj() - other) <= close).all() for other in kept):
            kept.append(branch)
    kept.sort(key=lambda branch: abs(branch[0]))
    return np.stack(kept, axis=1)


def critical_speeds(scene: Scene, count: int | None = None) -> CriticalSpeeds:
    """Undamped synchronous whirl: `det( K - Omega^2 (M - G) ) = 0` forward, `M + G` backward.

    Solved for `Omega^2` at once, not by scanning. On unequal supports a whirl is elliptic and counts
    by the larger of its parts; for an unequal shaft they are the speeds where it stands bent.

    Args:
        scene: the rotor; its own speed, damping and hysteresis do not matter.
        count: how many of each to return, by default all.

    Returns:
        Speeds [rad/s], ascending; those that do not exist are left out (infinite where traced).

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
    blocks = system.blocks
    zero = jnp.zeros(system.line.stiffness.shape, complex)
    part = lambda block: zero if block is None else block + 0j
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


def _synchronous_of(stiffness: Array, inertia: Array) -> Float[Array, " c"]:
    """Every real `Omega > 0` with `det(K - Omega^2 M) = 0`, else infinite."""
    shift = Pencil(inertia, inertia, stiffness).rate ** 2
    inverses = jnp.linalg.eigvals(jnp.linalg.solve(stiffness + shift * inertia, inertia))
    there = jnp.abs(inverses) * shift > 1e-10
    squares = 1 / jnp.where(there, inverses, 1.0) - shift
    real = there & (squares.real > 0) & (jnp.abs(squares.imag) < 1e-6 * jnp.abs(squares))
    return jnp.where(real, jnp.sqrt(jnp.where(real, squares.real, 1.0)), jnp.inf)
