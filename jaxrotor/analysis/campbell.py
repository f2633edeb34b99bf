"""Campbell diagram: roots against the speed of rotation, each branch followed."""

from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float

from ..core.compiled import compiled_quickly
from ..core.quantities import Scalar, known
from ..equations.pencil import Frame, frame, is_rounding, isotropic
from ..equations.system import System, assemble
from ..scene import Scene
from .modal import moving_roots, sense_of_whirl, slowest_first


CHOICE = 0.2  # how far off a root may be, relative to the next best, to be told for sure
NARROWEST = 2.0**-12  # of an interval, down to which lines that pass each other are looked at
# Damping ratio above which a speed is not critical: it amplifies less than 2.5 times, so no peak is left.
OVERDAMPED = 0.2
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

    def crossings(self, order: float | int = 1) -> "Crossings":
        """Where the frequency of a branch is `order` times the speed, by linear interpolation.

        Of `order` 1 and little damping these are the critical speeds; `critical_speeds` has those of
        the rotor without damping, which damping moves and, past `OVERDAMPED`, hides.
        """
        speeds: Any = np.asarray(self.speeds)
        values: Any = np.asarray(self.values)
        above = np.abs(values.imag) - order * np.abs(speeds)[:, None]
        k, branch = np.nonzero((above[:-1] < 0) != (above[1:] < 0))
        if self.circular:  # a branch that turns round has no frequency on the way
            ways = np.asarray(self.forward)
            whole = ways[k, branch] == ways[k + 1, branch]
            k, branch = k[whole], branch[whole]
        part = above[k, branch] / (above[k, branch] - above[k + 1, branch])
        at = speeds[k] + part * (speeds[k + 1] - speeds[k])
        roots = values[k, branch] + part * (values[k + 1, branch] - values[k, branch])
        ways = np.asarray(self.forward)[k, branch] if self.circular else np.zeros(k.size)
        whirls = ~is_rounding(roots.imag, roots)
        at, roots, ways = (one[whirls][np.argsort(at[whirls])] for one in (at, roots, ways))
        return Crossings(at, np.abs(roots.imag), -roots.real / np.abs(roots), ways)


class Crossings(NamedTuple):
    """Where branches cross a line of so many oscillations a revolution, in the order of speeds."""

    speeds: Float[np.ndarray, " c"]  # [rad/s]
    frequencies: Float[np.ndarray, " c"]  # [rad/s]
    damping_ratio: Float[np.ndarray, " c"]
    forward: Float[np.ndarray, " c"]  # +1 with the spin, -1 against it, 0 of unequal axes


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
    system = assemble(scene)
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
    from scipy.optimize import linear_sum_assignment  # half a second

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


@compiled_quickly
def _values_and_slopes(system: System, speed: Scalar, count: int):
    """The slowest roots, some more than `count` of (pairs of) them, and their derivatives."""
    values, slopes = moving_roots(system, speed)
    # No mass, no motion: a root beyond all others.
    values = jnp.where(jnp.isfinite(values), values, 1e3 * jnp.max(_finite(jnp.abs(values))))
    chosen = slowest_first(values)[: 4 * count + 8]
    return values[chosen], _finite(slopes[chosen])


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
