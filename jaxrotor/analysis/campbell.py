"""Campbell diagram: roots against the speed of rotation, each branch followed; critical speeds."""

from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float
from scipy.optimize import linear_sum_assignment

from ..pencil import Frame, Pencil, check_moves, frame, is_rounding, isotropic, root_changes
from ..quantities import Scalar, known
from ..scene import Scene
from ..system import System, assemble
from .modal import natural_roots, sense_of_whirl, slowest_first


CHOICE = 0.2  # how far off a root may be, relative to the next best, to be told for sure
NARROWEST = 2.0**-12  # of an interval, down to which lines that pass each other are looked at
MIDPOINTS = 128  # speeds looked at between two given ones, at most


class Campbell(eqx.Module):
    """Branches of roots over `w` speeds, `m` of them, slowest first at the first speed."""

    speeds: Float[Array, " w"]  # [rad/s]
    values: Complex[Array, "w m"]  # lambda [rad/s]
    frame: Frame = eqx.field(static=True)
    circular: bool = eqx.field(static=True)  # whether whirl is, so that a frequency has a direction

    @property
    def frequencies(self) -> Float[Array, "w m"]:
        """Whirl frequency [rad/s], positive from x to y; of unequal axes, either sign of a pair."""
        return self.values.imag

    @property
    def forward(self) -> Float[Array, "w m"] | None:
        """+1 for whirl with the spin, -1 against it, 0 for none; None of unequal axes.

        There the sense is that of the shape; see `Modes.forward`.
        """
        return sense_of_whirl(self.values, self.speeds[:, None]) if self.circular else None

    @property
    def growth(self) -> Float[Array, "w m"]:
        """Growth rate [1/s], negative stable."""
        return self.values.real


class CriticalSpeeds(NamedTuple):
    """Speeds of rotation [rad/s] that equal the frequency of a forward or a backward whirl."""

    forward: Float[Array, " f"]
    backward: Float[Array, " b"]


class AxisSpeeds(NamedTuple):
    """Critical speeds [rad/s] of an unequal rotor along its axis and across it, each ascending."""

    along: Float[Array, " a"]
    across: Float[Array, " b"]


def campbell(scene: Scene, speeds, count: int = 8) -> Campbell:
    """Roots `lambda(Omega)` as continuous branches: they keep their identity where they cross.

    From speed to speed each root is sought where its derivative `d lambda / d Omega` says. So lines
    cross where modes do not feel each other, and bend away where they do. Where that leaves a choice,
    which is on coarse speeds and where lines pass each other, speeds between are looked at: lines that
    bend away within less than `NARROWEST` of an interval are taken to cross.

    Args:
        scene: the rotor; its own speed does not matter.
        speeds: [rad/s], ascending, two or more.
        count: how many branches to keep, the slowest at the first speed. Of unequal axes, one of
            each conjugate pair, but both where they part into real roots.

    Returns:
        Branches; not differentiable and not to be traced, `roots` is.

    Source: Brysin, Nikiforov (2019), Figs. 3, 4.
    """
    speeds = np.asarray(speeds, float)
    if speeds.ndim != 1 or speeds.size < 2 or not np.all(np.diff(speeds) > 0):
        raise ValueError(f"`speeds` must be two or more in ascending order, but is {speeds}.")
    system = eqx.filter_jit(assemble)(scene)
    blocks = system.blocks
    if not all(map(known, jax.tree.leaves(system))):
        raise ValueError(
            "`campbell` follows branches by their values, so it cannot run inside jax.jit, jax.vmap or "
            "jax.grad; call it outside, or use `roots`."
        )

    def sample(speed):
        found = _values_and_slopes(system, jnp.asarray(speed), count)
        return _Sample(speed, *map(np.asarray, found))

    wanted = slice(count if isotropic(blocks) else 2 * count)
    followed = [sample(speeds[0])]
    for speed in speeds[1:]:
        followed.append(_follow(followed[-1], sample(speed), wanted, sample))
    branches = np.stack([one.values for one in followed])
    if not isotropic(blocks):
        branches = _less_conjugates(branches)
    axes = frame(blocks)
    return Campbell(jnp.asarray(speeds), jnp.asarray(branches[:, :count]), axes, isotropic(blocks))


class _Sample(NamedTuple):
    """Roots (m,) and their derivatives at one speed [rad/s]."""

    speed: float
    values: np.ndarray
    slopes: np.ndarray

    def same(self, step: float) -> np.ndarray:
        """Which roots (m, m) are equal and stay so over a step: either may be the other."""
        here, there = self.values, self.values + step * self.slopes
        apart = np.abs(here[:, None] - here) + np.abs(there[:, None] - there)
        return is_rounding(apart, here)


def _follow(left: _Sample, right: _Sample, wanted: slice, sample: Callable) -> _Sample:
    """`right` in the order of `left`, by way of as many samples between as leave no choice."""
    ahead, looked, narrow = [right], 0, NARROWEST * (right.speed - left.speed)
    while ahead:
        matched, sure = _matched(left, ahead[-1])
        if sure[wanted].all() or matched.speed - left.speed <= narrow or looked == MIDPOINTS:
            left = matched
            ahead.pop()
        else:
            ahead.append(sample((left.speed + ahead[-1].speed) / 2))
            looked += 1
    return left


def _matched(left: _Sample, right: _Sample) -> tuple[_Sample, np.ndarray]:
    """`right` in the order of `left`, and which roots (m,) have no other choice and pass none.

    From afar lines that cross look like those that bend away.
    """
    step = right.speed - left.speed
    ahead, back = left.values + step * left.slopes, right.values - step * right.slopes
    cost = np.abs(ahead[:, None] - right.values) + np.abs(left.values[:, None] - back)
    # Roots of its square: else, on a line, one long jump costs no more than a chain of short ones,
    # and where the slowest roots are cut from all there is always one that has lost its partner.
    order = linear_sum_assignment(np.sqrt(cost))[1]
    cost, right = cost[:, order], _Sample(right.speed, right.values[order], right.slopes[order])
    twins = right.same(step)
    others = np.where(left.same(step) | twins, np.inf, cost)
    sure = np.diagonal(cost) <= CHOICE * np.minimum(others.min(axis=0), others.min(axis=1))
    before, after = (one.values[:, None] - one.values for one in (left, right))
    sure &= np.all(np.real(np.conj(before) * after) >= 0, axis=1)
    # Where lines meet, the slope of each is the mean of both; it is told by where it came from.
    slopes = np.where(twins.sum(axis=1) > 1, (right.values - left.values) / step, right.slopes)
    return right._replace(slopes=slopes), sure


@eqx.filter_jit
def _values_and_slopes(system: System, speed: Scalar, count: int):
    """The slowest roots, some more than `count` of (pairs of) them, and their derivatives."""
    values = natural_roots(system.at_speed(speed))
    # No mass, no motion: a root beyond all others.
    values = jnp.where(jnp.isfinite(values), values, 1e3 * jnp.max(_finite(jnp.abs(values))))
    values = values[slowest_first(values)[: 4 * count + 8]]
    pencil = lambda speed: Pencil.of(system.at_speed(speed))
    own, change = jax.jvp(pencil, (speed,), (jnp.ones_like(speed),))
    slopes = root_changes(values, own, change)
    return values, jnp.where(jnp.isfinite(slopes), slopes, 0.0)


def _finite(values: Array) -> Array:
    return jnp.where(jnp.isfinite(values), values, 0.0)


def _less_conjugates(branches: Any) -> np.ndarray:
    """Of branches that stay conjugate one, that of positive frequency."""
    kept: list[np.ndarray] = []
    for branch in branches[:, np.argsort(branches.imag.mean(axis=0) < 0, kind="stable")].T:
        if not any(is_rounding(branch.conj() - other, branch).all() for other in kept):
            kept.append(branch)
    kept.sort(key=lambda branch: abs(branch[0]))
    return np.stack(kept, axis=1)


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
