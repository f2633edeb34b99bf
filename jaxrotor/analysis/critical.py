"""Critical speeds: where the spin meets a whirl of the undamped rotor."""

import functools
from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Complex, Float

from ..core.compiled import compiled_quickly
from ..core.quantities import Scalar, known
from ..core.tables import RPM, notebook_table
from ..equations.pencil import (
    Pencil,
    check_axes,
    check_moves,
    frame,
    is_rounding,
    isotropic,
    root_changes,
)
from ..equations.system import System, assemble
from ..scene import Scene
from .modal import STRAIGHT, inertia_shares, kind_of_whirl


class CriticalSpeeds(eqx.Module):
    """Speeds of rotation that equal the frequency of a whirl, `c` of them, and how each whirls.

    The orbit of a whirl is `f exp(i Omega t) + b exp(-i Omega t)` at every station, a circle where the
    rotor is the same along every axis, else an ellipse. `forward_share` is the part `f' M f / (f' M f +
    b' M b)` of its kinetic energy. A whirl is called mixed where neither part has 60 % of it: there
    orbits are nearly straight lines.
    """

    speeds: Float[Array, " c"]  # [rad/s], ascending; infinite for none, where traced
    forward_share: Float[Array, " c"]  # from 0 to 1
    stations: Float[Array, " x"]  # [m]
    senses: Float[Array, "c x"]  # see `Modes.senses`: +1 forward circle, 0 line, -1 backward circle
    count: int | None = eqx.field(static=True)  # how many of each kind were asked for

    def _repr_html_(self) -> str:
        columns = self.speeds.tolist(), self.kinds, self.forward_share.tolist()
        rows = [
            (speed, speed * RPM, kind, share)
            for speed, kind, share in zip(*columns, strict=True)
            if np.isfinite(speed)
        ]
        heads = ("critical speed [rad/s]", "[rpm]", "whirl", "forward share of its energy")
        return notebook_table("Critical speeds of the undamped rotor", heads, rows)

    @property
    def forward(self) -> Float[Array, " f"]:
        """Those that whirl with the spin [rad/s], ascending."""
        return self._only(self._sense >= STRAIGHT)

    @property
    def backward(self) -> Float[Array, " b"]:
        """Those that whirl against the spin [rad/s], ascending."""
        return self._only(self._sense <= -STRAIGHT)

    @property
    def mixed(self) -> Float[Array, " m"]:
        """Those that do neither [rad/s], ascending."""
        return self._only(jnp.abs(self._sense) < STRAIGHT)

    @property
    def kinds(self) -> list[str]:
        """Of every speed: "forward", "backward" or "mixed"."""
        return [kind_of_whirl(sense) for sense in self._sense.tolist()]

    def where(self, chosen: Bool[np.ndarray, " c"]) -> "CriticalSpeeds":
        """Some of them, of known speeds."""
        own = lambda whirls: (whirls.speeds, whirls.forward_share, whirls.senses)
        return eqx.tree_at(own, self, tuple(part[chosen] for part in own(self)))

    @property
    def _sense(self) -> Float[Array, " c"]:
        return 2 * self.forward_share - 1

    def _only(self, chosen: Bool[Array, " c"]) -> Float[Array, " k"]:
        speeds = jnp.where(chosen, self.speeds, jnp.inf)
        if known(speeds):
            return speeds[np.isfinite(speeds)][: self.count]
        return jnp.sort(speeds)[: self.count]


class AxisSpeeds(NamedTuple):
    """Critical speeds [rad/s] of an unequal rotor along its axis and across it, each ascending."""

    along: Float[Array, " a"]
    across: Float[Array, " b"]


def critical_speeds(scene: Scene, count: int | None = None, points: int = 101) -> CriticalSpeeds:
    """Undamped synchronous whirl: `det( K - Omega^2 (M - G) ) = 0` forward, `M + G` backward.

    Of axes that are equal or, on unequal supports, with the pair `(q, q*)`; there whirl is elliptic
    and called by the kinetic energy of its parts. An unequal shaft has no backward ones: it is critical
    where it stands bent in its own axes, `det( K - Omega^2 (M - G) ) = 0` of the pair in these. Solved
    for `Omega^2` at once, not by scanning.

    Args:
        scene: the rotor; its own speed does not matter, nor do damping, hysteresis and cross-coupled
            stiffness (of supports that push across), which are left out.
        count: how many of each kind to return, by default all.
        points: how many stations along the shaft to tell the sense of the whirl at.

    Returns:
        Speeds [rad/s], ascending, and how they whirl; those that do not exist are left out (infinite
        where traced). Differentiable; equal ones by the mean of theirs. Shares and senses are held.

    Source: Brysin, Nikiforov (2019), eq. (3) with Lambda = omega; Klochkov, eqs. (16), (17).
    """
    found = _synchronous(scene, count, points)
    if not known(found.speeds):
        return found
    there = np.isfinite(found.speeds)
    kept, kinds = np.zeros(there.shape, bool), np.array(found.kinds, object)
    for kind in ("forward", "backward", "mixed"):
        kept[np.flatnonzero(there & (kinds == kind))[:count]] = True
    return found.where(kept)


@compiled_quickly
def _synchronous(scene: Scene, count: int | None, points: int) -> CriticalSpeeds:
    """Critical speeds, ascending, infinite for none."""
    system = assemble(scene)
    check_moves(system)
    stations = scene.shaft.seen(points)
    speeds, share, senses = _whirls(scene, system, stations)
    order = jnp.argsort(speeds)
    share, senses = jax.lax.stop_gradient((share, senses))
    return CriticalSpeeds(speeds[order], share[order], stations, senses[order], count)


def _whirls(scene: Scene, system: System, stations: Array) -> tuple[Array, Array, Array]:
    """Critical speeds, forward shares and senses, in no order."""
    blocks, zero, part = system.blocks, _zero(system), _filled(system)
    stiffness, inertia = part(blocks.stiffness), part(blocks.inertia)
    ahead, behind = (inertia + sense * part(blocks.gyroscopic) for sense in (-1, 1))
    if isotropic(blocks):
        one, other = (_synchronous_of(stiffness, sense)[0] for sense in (ahead, behind))
        share = jnp.repeat(jnp.array([1.0, 0.0]), one.size)
        senses = (2 * share - 1)[:, None] * jnp.ones(stations.size)
        return jnp.concatenate([one, other]), share, senses
    axes = frame(blocks)
    check_axes(
        system,
        "There are no critical speeds, but bands of them,",
        "look at `jaxrotor.floquet_multipliers`",
    )
    unequal = part(getattr(blocks, f"{axes}_stiffness"))
    if axes == "rotating":  # seen from the shaft, both parts of a synchronous whirl stand still
        behind = ahead
    stiffness = jnp.block([[stiffness, unequal], [unequal.conj(), stiffness.conj()]])
    inertia = jnp.block([[ahead, zero], [zero, behind]])
    speeds, vectors = _synchronous_of(stiffness, inertia, vectors=axes == "fixed")
    if axes == "rotating":
        return speeds, jnp.ones(speeds.size), jnp.ones((speeds.size, stations.size))
    assert vectors is not None
    halves = vectors.reshape(-1, 2, system.n)  # of `exp(i Omega t)`, conjugate of `exp(-i Omega t)`
    share = inertia_shares(scene, system, halves)[:, 0]
    ahead, behind = jnp.moveaxis(jnp.abs(halves @ jax.vmap(system.line.row)(stations).T) ** 2, 1, 0)
    total = ahead + behind
    senses = jnp.where(total > 0, (ahead - behind) / jnp.where(total > 0, total, 1.0), 0.0)
    return speeds, share, senses


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


@compiled_quickly
def _axis_speeds(scene: Scene) -> tuple[Float[Array, " a"], Float[Array, " b"]]:
    system = assemble(scene)
    check_moves(system)
    blocks = system.blocks
    if frame(blocks) != "rotating":
        raise ValueError(
            "Only axes that turn with the shaft part its critical speeds in two, but no part of this "
            "rotor alone does; look at `jaxrotor.critical_speeds`."
        )
    part = _filled(system)
    inertia = part(blocks.inertia) - part(blocks.gyroscopic)
    unequal = part(blocks.rotating_stiffness)
    real = jnp.all(is_rounding(unequal.imag, jnp.max(jnp.abs(unequal))))
    speeds = (_synchronous_of(part(blocks.stiffness) + s * unequal, inertia)[0] for s in (1, -1))
    along, across = (jnp.where(real, jnp.sort(one), jnp.nan) for one in speeds)
    return along, across


def _zero(system: System) -> Complex[Array, "n n"]:
    return jnp.zeros((system.n, system.n), complex)


def _filled(system: System) -> Callable[[Array | None], Array]:
    """Blocks as complex matrices, those that nothing draws as zeros."""
    zero = _zero(system)
    return lambda block: zero if block is None else block + 0j


def _synchronous_of(
    stiffness: Array, inertia: Array, vectors: bool = False
) -> tuple[Float[Array, " c"], Complex[Array, "c m"] | None]:
    """Every real `Omega > 0` with `(K - Omega^2 M) q = 0`, else infinite; and `q`, if asked for.

    `Omega = 0` of a free shaft is none; rounding leaves about 1e-15 of the scale in its square.
    """
    squares, shapes = _squares(vectors, stiffness, inertia)
    scale = _scale(stiffness, inertia)
    real = jnp.isfinite(squares) & (squares.real > 1e-10 * scale)
    real = real & (jnp.abs(squares.imag) < 1e-6 * jnp.abs(squares))
    return jnp.where(real, jnp.sqrt(jnp.where(real, squares.real, 1.0)), jnp.inf), shapes


def _scale(stiffness: Array, inertia: Array) -> Scalar:
    """Of the order of the square of the first critical speed."""
    return Pencil(inertia, inertia, stiffness).rate ** 2


@functools.partial(jax.custom_jvp, nondiff_argnums=(0,))
def _squares(vectors: bool, stiffness: Array, inertia: Array):
    """Every `s` with `(K - s M) q = 0`, infinite for coordinates without inertia; and `q`, one a row."""
    shift, shapes = _scale(stiffness, inertia), None
    matrix = jnp.linalg.solve(stiffness + shift * inertia, inertia)
    if vectors:
        inverses, columns = jnp.linalg.eig(matrix)
        shapes = columns.T
    else:
        inverses = jnp.linalg.eigvals(matrix)
    there = jnp.abs(inverses) * shift > 1e-10
    return jnp.where(there, 1 / jnp.where(there, inverses, 1.0) - shift, jnp.inf), shapes


@_squares.defjvp
def _squares_jvp(vectors, primals, tangents):
    """Like the derivatives of roots; of two that are equal the mean. Vectors are held."""
    values, shapes = _squares(vectors, *primals)
    linear = lambda stiffness, inertia: Pencil(jnp.zeros_like(inertia), -inertia, stiffness)
    moved = root_changes(values, linear(*primals), linear(*tangents))
    return (values, shapes), (moved, None if shapes is None else jnp.zeros_like(shapes))
