"""Campbell diagram: roots as continuous branches over the speed of rotation."""

from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float

from ..core.checks import in_order
from ..core.compiled import compiled_quickly
from ..core.parallel import in_threads
from ..core.quantities import Scalar, known
from ..equations.pencil import Frame, frame, is_rounding, isotropic
from ..equations.system import System
from ..scene import Scene
from ..spins.base import sense_of
from .linearized import check_linear
from .modal import (
    STRAIGHT,
    energy_shares,
    kinetic_energy,
    moving_roots,
    sense_of_whirl,
    slowest_first,
)
from .operating_line import OperatingLine, check_shaft
from .resolved import resolved
from .whirl_tables import OverWhirl, whirl_roots


CHOICE = 0.2  # largest error of a sure match, relative to that of the next best match
# Fraction of an interval below which lines that pass each other are not refined
NARROWEST = 2.0**-12
# Damping ratio above which a speed is not counted as critical: amplification is about 1 / (2 D) = 2.5.
OVERDAMPED = 0.2
MIDPOINTS = 128  # largest number of speeds inserted between two given ones


class Campbell(eqx.Module):
    """Roots `lambda(Omega)` on `m` branches over `w` speeds, slowest first at the first speed."""

    speeds: Float[Array, " w"]  # [rad/s]
    values: Complex[Array, "w m"]  # lambda [rad/s]
    frame: Frame = eqx.field(static=True)
    # Whether orbits are circles, so frequencies have a sign
    circular: bool = eqx.field(static=True)
    senses: Float[Array, "w m"] | None = None  # forward less backward share of kinetic energy
    line: OperatingLine | None = None  # of a machine of several shafts

    @property
    def frequencies(self) -> Float[Array, "w m"]:
        """Whirl frequency [rad/s], positive from x to y; of either sign where axes are unequal."""
        return self.values.imag

    @property
    def forward(self) -> Float[Array, "w m"] | None:
        """+1 for whirl with the spin, -1 against it, 0 for none; None in axes that turn with the shaft.

        Where axes are unequal the sense is that of the part with more kinetic energy, see `Modes.forward`,
        and 0 where orbits are nearly straight lines.
        """
        if self.circular:
            return sense_of_whirl(self.values, _turning(self.speeds)[:, None])
        if self.senses is None:
            return None
        return jnp.where(jnp.abs(self.senses) < STRAIGHT, 0.0, jnp.sign(self.senses))

    @property
    def growth(self) -> Float[Array, "w m"]:
        """Growth rate [1/s]; a branch is stable where it is negative."""
        return self.values.real

    def turning(self, by: str | None = None) -> Float[Array, " w"]:
        """Speeds of a shaft [rad/s], by its name where there are several; None: of the first one."""
        shafts = () if self.line is None else self.line.shafts
        check_shaft(by, shafts)
        if self.line is None or by is None:
            return self.speeds
        return self.line.at(self.speeds)[:, self.line.shafts.index(by)]

    def crossings(self, order: float | int = 1, by: str | None = None) -> "Crossings":
        """Crossings of the branches with the line `|Im lambda| = order |Omega|`.

        At order 1 and with little damping they are the critical speeds. `critical_speeds` gives those of
        the undamped rotor; damping shifts them, and above `OVERDAMPED` they hardly amplify.

        Args:
            order: oscillations per revolution.
            by: name of the shaft whose speed is Omega and whose sense is forward, where there are
                several, by default the first one.

        Returns:
            `Crossings` by linear interpolation between the speeds of the diagram.
        """
        speeds: Any = np.asarray(self.speeds)
        values: Any = np.asarray(self.values)
        own = np.asarray(self.turning(by))
        above = np.abs(values.imag) - order * np.abs(own)[:, None]
        k, branch = np.nonzero((above[:-1] < 0) != (above[1:] < 0))
        ways = np.zeros(values.shape) if self.forward is None else np.asarray(self.forward)
        if self.circular and by is not None:
            ways = np.sign(values.imag) * np.sign(own)[:, None]
        if self.circular:  # a branch that changes its whirl direction is not oscillating in between
            whole = ways[k, branch] == ways[k + 1, branch]
            k, branch = k[whole], branch[whole]
        part = above[k, branch] / (above[k, branch] - above[k + 1, branch])
        at = speeds[k] + part * (speeds[k + 1] - speeds[k])
        roots = values[k, branch] + part * (values[k + 1, branch] - values[k, branch])
        ways = ways[k, branch]
        whirls = ~is_rounding(roots.imag, roots)
        ascending = np.flatnonzero(whirls)[np.argsort((k + part)[whirls])]
        at, roots, ways = at[ascending], roots[ascending], ways[ascending]
        return Crossings(at, np.abs(roots.imag), -roots.real / np.abs(roots), ways)


class Crossings(NamedTuple):
    """Crossings of branches with a line of given order, in the order of the diagram's speeds."""

    speeds: Float[np.ndarray, " c"]  # [rad/s]
    frequencies: Float[np.ndarray, " c"]  # [rad/s]
    damping_ratio: Float[np.ndarray, " c"]
    forward: Float[np.ndarray, " c"]  # +1 with the spin, -1 against it, 0 for neither or unknown


def campbell(scene: Scene, speeds, count: int = 8) -> Campbell:
    """Roots `lambda(Omega)` as continuous branches that keep their identity where they cross.

    From speed to speed each root is predicted by its derivative `d lambda / d Omega`. So lines of
    uncoupled modes cross, and those of coupled modes veer. Where the match is ambiguous, on coarse speeds
    or where lines pass each other, speeds are inserted between; lines that veer within less than
    `NARROWEST` of an interval are taken to cross.

    Args:
        scene: the rotor; its own speed does not matter.
        speeds: [rad/s], two or more, ascending or descending; those of a reversed rotor are negative.
        count: number of branches to keep, the slowest at the first speed; nodes that are "auto" are as
            many as these need. Where axes are unequal one of each conjugate pair is kept, but both where
            a pair splits into real roots.

    Returns:
        `Campbell` diagram. Neither differentiable nor traceable; use `roots` for that.

    Raises:
        ValueError: the speeds are not two or more in order, or the scene is traced.

    Source: Brysin, Nikiforov (2019), Figs. 3, 4.
    """
    speeds = np.asarray(speeds, float)
    if speeds.ndim != 1 or speeds.size < 2 or not in_order(speeds):
        raise ValueError(
            f"`speeds` must be two or more in ascending or descending order, but is {speeds}."
        )
    check_linear(scene, speeds)
    scene = resolved(scene, count)
    system = OverWhirl.of(scene)
    blocks = system.blocks
    if not all(map(known, jax.tree.leaves(system))):
        raise ValueError(
            "`campbell` follows branches by their values, so it cannot run inside jax.jit, jax.vmap or "
            "jax.grad; call it outside, or use `roots`."
        )

    energy = None
    if isinstance(system, System) and frame(blocks) == "fixed" and not isotropic(blocks):
        energy = _kinetic_energy(scene, system)

    def sample(speed):
        found = _values_and_slopes(system, energy, jnp.asarray(speed), count)
        return _Sample(speed, *map(np.asarray, found))

    wanted = slice(count if isotropic(blocks) else 2 * count)
    followed = [sample(speeds[0])]  # which compiles
    for one in in_threads(sample, speeds[1:]):
        followed.append(_follow(followed[-1], one, wanted, sample))
    branches = np.stack([one.values for one in followed])
    every = np.arange(branches.shape[1])
    kept = (every if isotropic(blocks) else _less_conjugates(branches))[:count]
    senses = None
    if energy is not None:
        senses = jnp.asarray(np.stack([one.senses for one in followed])[:, kept])
        senses = senses * sense_of(_turning(speeds))[:, None]
    values = jnp.asarray(branches[:, kept])
    line = OperatingLine.of(scene, None)
    return Campbell(jnp.asarray(speeds), values, frame(blocks), isotropic(blocks), senses, line)


def _turning(speeds: Any) -> Float[Array, " w"]:
    """Speeds of a diagram, with the sense of the others in place of a zero."""
    speeds = jnp.asarray(speeds)
    return jnp.where(speeds == 0, jnp.sum(speeds), speeds)


class _Sample(NamedTuple):
    """Roots (m,) at one speed [rad/s], their derivatives, and the senses of their whirl from x to y."""

    speed: float
    values: np.ndarray
    slopes: np.ndarray
    senses: np.ndarray

    def same(self, step: float) -> np.ndarray:
        """Pairs of roots (m, m) that are equal and stay so over a step, so they are interchangeable."""
        here, there = self.values, self.values + step * self.slopes
        apart = np.abs(here[:, None] - here) + np.abs(there[:, None] - there)
        return is_rounding(apart, here)


def _follow(left: _Sample, right: _Sample, wanted: slice, sample: Callable) -> _Sample:
    """`right` in the order of `left`, with samples inserted between until every match is sure."""
    ahead, looked, narrow = [right], 0, NARROWEST * abs(right.speed - left.speed)
    while ahead:
        matched, sure = _matched(left, ahead[-1])
        if sure[wanted].all() or abs(matched.speed - left.speed) <= narrow or looked == MIDPOINTS:
            left = matched
            ahead.pop()
        else:
            ahead.append(sample((left.speed + ahead[-1].speed) / 2))
            looked += 1
    return left


def _matched(left: _Sample, right: _Sample) -> tuple[_Sample, np.ndarray]:
    """`right` in the order of `left`, and for each root (m,) whether its match is sure.

    A match is sure if no other is nearly as good and the root passes no other root: over a long step
    lines that cross cannot be distinguished from lines that veer.
    """
    from scipy.optimize import linear_sum_assignment  # half a second

    step = right.speed - left.speed
    ahead, back = left.values + step * left.slopes, right.values - step * right.slopes
    cost = np.abs(ahead[:, None] - right.values) + np.abs(left.values[:, None] - back)
    # The square root of the cost favours one long jump over a chain of short ones. Such a jump is real:
    # of the slowest roots that are kept, one may have lost its partner to those left out.
    order = linear_sum_assignment(np.sqrt(cost))[1]
    cost, right = cost[:, order], _Sample(right.speed, *(part[order] for part in right[1:]))
    twins = right.same(step)
    others = np.where(left.same(step) | twins, np.inf, cost)
    sure = np.diagonal(cost) <= CHOICE * np.minimum(others.min(axis=0), others.min(axis=1))
    before, after = (one.values[:, None] - one.values for one in (left, right))
    sure &= np.all(np.real(np.conj(before) * after) >= 0, axis=1)
    # Where lines meet, both slopes are the mean of the two; the secant from the last speed replaces it.
    slopes = np.where(twins.sum(axis=1) > 1, (right.values - left.values) / step, right.slopes)
    return right._replace(slopes=slopes), sure


@compiled_quickly
def _kinetic_energy(scene: Scene, system: System) -> Float[Array, "n n"]:
    return kinetic_energy(scene, system)


@compiled_quickly
def _values_and_slopes(system: System | OverWhirl, energy: Array | None, speed: Scalar, count: int):
    """The slowest roots, somewhat more than `count` (pairs), their derivatives, and senses from x to y.

    The senses are zero unless the matrix of the kinetic energy is given.
    """
    number = 2 * (count if isotropic(system.blocks) else 2 * count) + 8
    if isinstance(system, OverWhirl):
        own = lambda speed: whirl_roots(system.scene.at_speed(speed))
        values, slopes = jax.jvp(own, (speed,), (jnp.ones_like(speed),))
        vectors = None
    else:
        values, slopes, vectors = moving_roots(system, speed, number)
    senses = jnp.zeros(values.size)
    if energy is not None and vectors is not None:
        shares = energy_shares(energy, vectors.reshape(-1, 2, system.n))
        senses = sense_of_whirl(values, jnp.zeros(())) * (shares[:, 0] - shares[:, 1])
    # Massless coordinates have infinite roots; they are placed beyond all others.
    values = jnp.where(jnp.isfinite(values), values, 1e3 * jnp.max(_finite(jnp.abs(values))))
    chosen = slowest_first(values)[:number]
    return values[chosen], _finite(slopes[chosen]), senses[chosen]


def _finite(values: Array) -> Array:
    return jnp.where(jnp.isfinite(values), values, 0.0)


def _less_conjugates(branches: Any) -> np.ndarray:
    """Indices of the branches without those conjugate to another everywhere; positive frequency stays."""
    kept: list[int] = []
    for k in np.argsort(branches.imag.mean(axis=0) < 0, kind="stable").tolist():
        branch = branches[:, k]
        if not any(is_rounding(branch.conj() - branches[:, one], branch).all() for one in kept):
            kept.append(k)
    return np.array(sorted(kept, key=lambda k: abs(branches[0, k])), int)
