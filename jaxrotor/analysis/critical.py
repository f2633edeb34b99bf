"""Critical speeds: speeds of rotation that equal a whirl frequency of the undamped rotor."""

import dataclasses
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Complex, Float, Int

from ..core.compiled import compiled_quickly
from ..core.quantities import Scalar, known, on_host
from ..core.tables import RPM, notebook_table
from ..effects.places import of_first_order
from ..equations.pencil import check_moves, frame, is_rounding, isotropic
from ..equations.speed_tables import check_no_tables
from ..equations.system import System, assemble
from ..scene import Scene
from .linearized import check_linear
from .modal import STRAIGHT, inertia_shares, kind_of_whirl
from .operating_line import OperatingLine, check_first, whirls_by
from .resolved import resolved
from .synchronous import crossings, families, filled, synchronous_of
from .whirl_tables import synchronous


class CriticalSpeeds(eqx.Module):
    """`c` speeds of rotation that equal a whirl frequency, and the kind of each whirl.

    The orbit of a whirl is `f exp(i Omega t) + b exp(-i Omega t)` at every station, a circle where the
    rotor is the same along every axis, else an ellipse. `forward_share` is the share `f' M f / (f' M f +
    b' M b)` of the kinetic energy. A whirl is mixed where neither part has 60 % of it: its orbits are
    nearly straight lines.
    """

    # [rad/s] in the scene's sense, by magnitude; traced, infinite ones fill up
    speeds: Float[Array, " c"]
    forward_share: Float[Array, " c"]  # from 0 to 1
    stations: Float[Array, " x"]  # [m]
    senses: Float[Array, "c x"]  # see `Modes.senses`: +1 forward circle, 0 line, -1 backward circle
    count: int | None = eqx.field(static=True)  # largest number of each kind
    line: OperatingLine | None = None  # of a machine of several shafts

    @property
    def operating(self) -> Float[Array, "c j"] | None:
        """Speeds of all shafts [rad/s] at each critical speed; None of a scene of one shaft.

        Where that of the first shaft has another sign than the scene's, it is another machine's.
        """
        return None if self.line is None else self.line.at(self.speeds)

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
        """Critical speeds [rad/s] of whirl with the spin, by rising magnitude."""
        return self._only(self._sense >= STRAIGHT)

    @property
    def backward(self) -> Float[Array, " b"]:
        """Critical speeds [rad/s] of whirl against the spin, by rising magnitude."""
        return self._only(self._sense <= -STRAIGHT)

    @property
    def mixed(self) -> Float[Array, " m"]:
        """Critical speeds [rad/s] of mixed whirl, by rising magnitude."""
        return self._only(abs(self._sense) < STRAIGHT)

    @property
    def kinds(self) -> list[str]:
        """Kind of whirl at every speed: "forward", "backward" or "mixed"."""
        return [kind_of_whirl(sense) for sense in self._sense.tolist()]

    def where(self, chosen: Bool[np.ndarray, " c"] | Int[np.ndarray, " k"]) -> "CriticalSpeeds":
        """The chosen critical speeds, or those at indices; none may be traced."""
        parts = (jnp.asarray(np.asarray(part)[chosen]) for part in _columns(self))
        return eqx.tree_at(_columns, self, tuple(parts))

    @property
    def _sense(self) -> Any:
        return 2 * on_host(self.forward_share) - 1

    def _only(self, chosen: Any) -> Float[Array, " k"]:
        if known(self.speeds) and known(chosen):
            speeds = np.asarray(self.speeds)
            return jnp.asarray(speeds[np.asarray(chosen) & np.isfinite(speeds)][: self.count])
        speeds = jnp.where(chosen, self.speeds, jnp.inf)
        return speeds[jnp.argsort(jnp.abs(speeds))][: self.count]


def _columns(whirls: CriticalSpeeds) -> tuple[Any, Any, Any]:
    return whirls.speeds, whirls.forward_share, whirls.senses


class AxisSpeeds(NamedTuple):
    """Critical speeds [rad/s] of an unequal rotor, along its principal axis and across."""

    along: Float[Array, " a"]
    across: Float[Array, " b"]


def critical_speeds(
    scene: Scene, count: int | None = None, points: int = 101, by: str | None = None
) -> CriticalSpeeds:
    """Undamped synchronous whirl: `det( K - Omega^2 (M - G) ) = 0` forward, `M + G` backward.

    These hold for equal axes. On unequal supports the pair `(q, q*)` replaces `q`; whirl is elliptic
    and is classified by the kinetic energy of its parts. An unequal shaft has no backward critical
    speeds: it is critical where it stands bent in its own axes, `det( K - Omega^2 (M - G) ) = 0` for the
    pair in these axes. The eigenvalue problem for `Omega^2` gives all speeds; nothing is scanned.
    Where coefficients are tables over the speed, `K` is that of the speed: critical speeds within the
    tables are found by a scan and a bracket each, and there may be none or several of a mode. Two of one
    mode within a forty-eighth of the tables, between two nodes, are found where the mode comes near its
    crossing there.

    Args:
        scene: the rotor; of its own speed the sense alone matters. Damping, hysteresis and cross-coupled
            stiffness are left out.
        count: largest number of each kind to return, by default all; nodes that are "auto" are as many as
            twice as many `roots` need.
        points: number of stations along the shaft at which the sense of the whirl is evaluated.
        by: name of a shaft, where there are several, by default the first one: speeds at which the
            unbalance of that shaft is in resonance, as speeds of that shaft; `operating` has those of
            all. Where its speed does not depend on that of the first shaft, they are of that.

    Returns:
        `CriticalSpeeds` [rad/s] by rising magnitude, negative where the scene turns backward (where
        traced, infinite ones fill up). The speeds are differentiable, equal ones by the mean of their
        derivatives; shares and senses are held constant.

    Raises:
        ValueError: nothing can move or has mass, or some unequal axes stand still and others turn.

    Source: Brysin, Nikiforov (2019), eq. (3) with Lambda = omega; Klochkov, eqs. (16), (17).
    """
    scene = resolved(synchronous(scene), None if count is None else 2 * count)
    check_linear(scene, [])
    _check_undamped(scene)
    line = OperatingLine.of(scene, by)
    found = dataclasses.replace(_synchronous(scene, assemble(scene), points, line), count=count)
    if not known(found.speeds):
        return found
    finite = np.isfinite(found.speeds)
    chosen, kinds = np.zeros(finite.shape, bool), np.array(found.kinds, object)
    for kind in ("forward", "backward", "mixed"):
        chosen[np.flatnonzero(finite & (kinds == kind))[:count]] = True
    return found.where(chosen)


def _check_undamped(scene: Scene) -> None:
    """Raise if coordinates are of first order, of which nothing is left without damping."""
    if owners := of_first_order(scene.effects):
        # One that was linearized has the name of the part that the scene has.
        names = ", ".join(owner.name for owner in owners)
        raise ValueError(
            f"Critical speeds are those of the rotor without damping, but controllers ({names}) have none "
            "without their first-order terms; look at `jaxrotor.response_peaks` or `jaxrotor.campbell`."
        )


def critical_between(
    scene: Scene, low: float, high: float, by: str | None = None
) -> CriticalSpeeds:
    """Critical speeds of either sense in a range of speeds [rad/s], by rising magnitude.

    Those by a shaft are speeds of the first one, at which the unbalance of that shaft is in resonance.
    A rotor with coordinates of first order has none.
    """
    if of_first_order(scene.effects):
        every = _synchronous(scene, assemble(scene), 2, None)
        return every.where(np.zeros(len(every.kinds), bool))
    own = float(scene.spin.sense)
    senses = [sense for sense in (1.0, -1.0) if max(sense * low, sense * high) > 0]
    of = lambda s: critical_speeds(scene if s == own else scene.at_speed(s), by=by)
    both = [_of_first(of(s)) for s in senses or [own]]
    columns = tuple(np.concatenate(parts) for parts in zip(*map(_columns, both), strict=True))
    order = np.argsort(np.abs(columns[0]))
    inside = (columns[0] >= low) & (columns[0] <= high)
    return eqx.tree_at(_columns, both[0], columns).where(order[inside[order]])


def _of_first(found: CriticalSpeeds) -> CriticalSpeeds:
    """Critical speeds by a shaft as speeds of the first one."""
    if found.line is None:
        return found
    first = dataclasses.replace(found.line, by=0, tied=True)
    return dataclasses.replace(found, speeds=found.line.at(found.speeds)[:, 0], line=first)


def critical_if_any(scene: Scene, low: float, high: float) -> CriticalSpeeds | None:
    """Critical speeds as of `critical_between`, None of a rotor that has none at any speed."""
    try:
        return critical_between(scene, low, high)
    except ValueError:
        return None


@compiled_quickly
def _synchronous(
    scene: Scene, system: System, points: int, line: OperatingLine | None
) -> CriticalSpeeds:
    """Critical speeds by rising magnitude; infinite ones fill up."""
    check_moves(system)
    stations = scene.shaft.seen(points)
    if line is not None and system.tabled is None and isotropic(system.blocks):
        speeds, family = whirls_by(scene, system, line)
        order, share = jnp.argsort(jnp.abs(speeds)), 1.0 - family
        senses = (2 * share - 1)[:, None] * jnp.ones(stations.size)
        return CriticalSpeeds(speeds[order], share[order], stations, senses[order], None, line)
    if line is not None:
        check_first(scene, system, line)
    speeds, share, senses = _whirls(scene, system, stations)
    order = jnp.argsort(speeds)
    share, senses = jax.lax.stop_gradient((share, senses))
    speeds = _signed(system, speeds[order])
    return CriticalSpeeds(speeds, share[order], stations, senses[order], None, line)


def _signed(system: System, speeds: Float[Array, " c"]) -> Float[Array, " c"]:
    """Speeds of the sense of the spin from their magnitudes, infinite ones as they are."""
    return jnp.where(jnp.isfinite(speeds), system.spin.sense * speeds, jnp.inf)


def _whirls(scene: Scene, system: System, stations: Array) -> tuple[Array, Array, Array]:
    """Magnitudes of critical speeds, forward shares and senses, unordered."""
    blocks, own = system.blocks, families(system)
    paired = not isotropic(blocks)
    bent = paired and frame(blocks) == "rotating"
    vectors = None
    if system.tabled is not None:
        speeds, family = crossings(system)
        if paired and not bent:
            vectors = jax.lax.map(lambda speed: _shape_at(system, speed), speeds)
    else:
        found = [synchronous_of(*one, vectors=paired and not bent) for one in own]
        speeds, vectors = jnp.concatenate([one for one, _ in found]), found[0][1]
        family = jnp.repeat(jnp.arange(len(own)), found[0][0].size)
    if vectors is None:
        share = jnp.ones(speeds.size) if bent else 1.0 - family
        senses = (2 * share - 1)[:, None] * jnp.ones(stations.size)
        return speeds, share, senses
    # Amplitude of `exp(i Omega t)`, and conjugate amplitude of `exp(-i Omega t)`.
    halves = vectors.reshape(-1, 2, system.n)
    share = inertia_shares(scene, system, halves)[:, 0]
    ahead, behind = jnp.moveaxis(jnp.abs(halves @ jax.vmap(system.line.row)(stations).T) ** 2, 1, 0)
    total = ahead + behind
    senses = jnp.where(total > 0, (ahead - behind) / jnp.where(total > 0, total, 1.0), 0.0)
    return speeds, share, senses


def _shape_at(system: System, speed: Scalar) -> Complex[Array, " m"]:
    """Shape of the synchronous whirl at a critical speed of a rotor whose stiffness depends on it."""
    speed = jax.lax.stop_gradient(speed)
    (own,) = families(jax.lax.stop_gradient(system).at_speed(system.spin.sense * speed))
    found, vectors = synchronous_of(*own, vectors=True)
    assert vectors is not None
    return vectors[jnp.argmin(jnp.where(jnp.isfinite(found), jnp.abs(found - speed), jnp.inf))]


def axis_speeds(scene: Scene) -> AxisSpeeds:
    """`det( K + U - Omega^2 (M - G) ) = 0` along the axis of angle 0, `det( K - U - .. ) = 0` across it.

    `U` is the unequal part of the stiffness in axes that turn with the shaft. The speeds are those of
    `critical_speeds`, but each stays with its axis where they cross, so they are smooth there.

    Args:
        scene: a rotor whose unequal parts turn with the shaft, their axes at angle 0; of its own speed
            the sense alone matters.

    Returns:
        `AxisSpeeds` [rad/s] by rising magnitude, of the scene's sense; infinite ones fill up, and where
        traced all are NaN if an axis is not at angle 0. Differentiable.

    Raises:
        ValueError: nothing can move or has mass, no unequal part turns with the shaft alone, or an
            axis is not at angle 0.

    Source: Klochkov, eqs. (16), (17).
    """
    check_linear(scene, [])
    _check_undamped(scene)
    check_no_tables(scene, "`axis_speeds`")
    speeds = _axis_speeds(assemble(scene))
    if known(speeds[0]) and jnp.any(jnp.isnan(speeds[0])):
        raise ValueError(
            "Critical speeds along and across refer to axes at angle 0, but an unequal part of this rotor "
            "has its axis at another angle; set it to 0, or use `jaxrotor.critical_speeds`."
        )
    return AxisSpeeds(*speeds)


@compiled_quickly
def _axis_speeds(system: System) -> tuple[Float[Array, " a"], Float[Array, " b"]]:
    check_moves(system)
    blocks = system.blocks
    if frame(blocks) != "rotating":
        raise ValueError(
            "Critical speeds along and across exist only where all unequal axes turn with the shaft, but "
            "this rotor has none, or others that stand still; use `jaxrotor.critical_speeds`."
        )
    part = filled(system)
    inertia = part(blocks.inertia) - part(blocks.gyroscopic)
    unequal = part(blocks.rotating_stiffness)
    real = jnp.all(is_rounding(unequal.imag, jnp.max(jnp.abs(unequal))))
    speeds = (synchronous_of(part(blocks.stiffness) + s * unequal, inertia)[0] for s in (1, -1))
    along, across = (jnp.where(real, _signed(system, jnp.sort(one)), jnp.nan) for one in speeds)
    return along, across
