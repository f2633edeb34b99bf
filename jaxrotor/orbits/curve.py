"""Curve: the periodic motions of a scene as one of its parameters is changed.

    missed(x, s) = 0,   x of `Shooting`,   s from 0 to 1 along the range of the parameter

One compiled program tells all there is to know of a trial, whatever the values.
"""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import diffrax as dfx
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Complex, Float

from ..core.compiled import QUICKLY
from ..core.quantities import Scalar
from ..equations.start import Continued
from ..equations.system import System, assemble, port_groups
from ..motion.base import Plan
from ..motion.revolutions import Outcome, joined
from ..scene import Scene, check_fixed_nodes
from ..solvers.choice import choose, solver_name
from ..solvers.exponential import Exponential
from .periodic import PeriodicOrbit, winding_angle
from .shooting import Seen, Shooting, differentiable, without_unbalance
from .symmetry import SAME, changes, order


class Gauge(NamedTuple):
    """Which of the states of a motion without unbalance is meant: `along . (x - at) = 0`."""

    at: Any  # (m,), of jax where it is traced, else of numpy
    along: Any  # (m,)


class Look(NamedTuple):
    """What there is to know of a trial; of `T` samples, `k` contacts and `i` images of the orbit."""

    missed: Float[Array, " a"]
    jacobian: Float[Array, "a b"]  # by x and s
    direction: Float[Array, " m"]  # of motion in the state
    multipliers: Complex[Array, " r"]
    trivial: Scalar | None
    seen: Seen
    clearance: Float[Array, "T i k"]  # left until a contact acts [m]
    parting: Float[Array, "T i k"]  # its rate [m/s]
    period: Scalar  # [s]
    turn: Scalar  # [rad], whole turns included
    speed: Scalar  # [rad/s]
    outcome: Outcome


class Curve(eqx.Module):
    """The problem: a scene, one of its parameters, and what counts as a period."""

    scene: Scene
    stations: Float[Array, " s"]
    plan: Plan
    size: Scalar  # [m] that states are measured in
    span: Scalar  # [rad], see `Shooting`
    turn: Scalar  # [rad]
    low: Scalar  # range of the parameter
    high: Scalar
    path: str = eqx.field(static=True)
    revolutions: int | None = eqx.field(static=True)  # None: a period of its own
    order: int = eqx.field(static=True)  # of the turns that leave the scene as it is
    images: int = eqx.field(static=True)  # after how many periods the motion closes
    decades: bool = eqx.field(static=True)  # whether s is along the logarithm

    def value(self, s: ArrayLike) -> Array:
        """The parameter."""
        share = jnp.asarray(s)
        if self.decades:
            return self.low * (self.high / self.low) ** share
        return self.low + (self.high - self.low) * share

    def share(self, value: float) -> float:
        """`s` of a value."""
        low, high = float(self.low), float(self.high)
        if self.decades:
            return math.log(value / low) / math.log(high / low)
        return (value - low) / (high - low)

    def system(self, s: ArrayLike) -> System:
        """The equations there."""
        system = assemble(self.scene.put({self.path: self.value(s)}), self.plan.together)
        if self.revolutions is None:
            system = without_unbalance(system)
        return system

    def shooting(self, system: System, gauge: Gauge) -> Shooting:
        """What a state misses in these equations; contacts are observed behind the stations."""
        stations = jnp.concatenate(
            [self.stations, *(jnp.atleast_1d(port.at) for port in system.ports)]
        )
        rate = jnp.abs(system.spin.speed)
        along = gauge.along if self.revolutions is None else None
        parts = system, self.plan, stations, rate, self.span, self.turn, self.size
        return Shooting(*parts, gauge.at, along, self.revolutions or 1)

    def orbit(self, u: Float[np.ndarray, " b"], look: Look, iterations: int = 0) -> PeriodicOrbit:
        """The orbit of unknowns `u = (x, s)` that were looked at."""
        scene = self.scene.replace({self.path: float(self.value(u[-1]))})
        q, velocity = self.state(u, look)
        seen, count = look.seen, self.stations.size
        samples = look.seen.displacement.shape[0]
        residual = jnp.max(jnp.abs(look.missed))
        return PeriodicOrbit(
            start=Continued(jnp.asarray(q), jnp.asarray(velocity)),
            period=jnp.asarray(look.period),
            turn=jnp.asarray(look.turn),
            whirl_rate=jnp.asarray(look.turn / (look.period * look.speed)),
            multipliers=jnp.asarray(look.multipliers),
            trivial=None if look.trivial is None else jnp.asarray(look.trivial),
            time=jnp.linspace(0.0, look.period, samples),
            displacement=jnp.asarray(seen.displacement[:, :count]),
            velocity=jnp.asarray(seen.velocity[:, :count]),
            contact_force=None if seen.contact_force is None else jnp.asarray(seen.contact_force),
            stations=self.stations,
            residual=residual,
            iterations=jnp.asarray(iterations),
            converged=jnp.isfinite(residual),
            unresolved=jnp.asarray(look.outcome.unresolved),
            scene=scene,
            error=None,
            revolutions=self.revolutions,
            steps=self.plan.steps,
            solver=solver_name(self.plan.solver),
        )

    def state(self, u: Float[np.ndarray, " b"], look: Look) -> tuple[np.ndarray, np.ndarray]:
        """Coordinates [m] and their velocities [m/s]."""
        m = look.direction.size
        real, imag = np.split(float(self.size) * np.asarray(u[:m]), 2)
        q, rates = np.split(real + 1j * imag, 2)
        return q, abs(float(look.speed)) * rates


def _look(curve: Curve, u: Float[Array, " b"], gauge: Gauge) -> Look:
    x, s = u[:-1], u[-1]
    # Only what the parameter changes is differentiated through assembly, and once.
    split = lambda s: eqx.partition(curve.system(s), eqx.is_inexact_array)
    constant = split(s)[1]
    system, change = jax.jvp(lambda s: split(s)[0], (s,), (jnp.ones_like(s),))

    def gap(x, system):
        shooting = curve.shooting(eqx.combine(system, constant), gauge)
        return shooting.gap(x)

    def push(along):
        moved = jax.tree.map(lambda leaf: along[-1] * leaf, change)
        return jax.jvp(gap, (x, system), (along[:-1], moved), has_aux=True)

    missed, jacobian, (seen, outcome) = jax.vmap(push, out_axes=(None, -1, None))(jnp.eye(u.size))
    shooting = curve.shooting(eqx.combine(system, constant), gauge)
    own = curve.revolutions is None
    direction = shooting.direction(x) if own else jnp.zeros_like(gauge.at)
    multipliers, trivial = shooting.multipliers(x, jacobian[:, :-1])
    seen = jax.tree.map(joined, seen)
    period = shooting.revolutions * shooting.length(x) / shooting.rate
    return Look(
        missed,
        jacobian,
        direction,
        multipliers,
        trivial,
        seen,
        *_clearances(curve, shooting.system, seen),
        period,
        winding_angle(seen.displacement[:, 0], curve.turn),
        shooting.system.spin.speed,
        outcome,
    )


look = eqx.filter_jit(_look, **QUICKLY)


def _clearances(curve: Curve, system: System, seen: Seen) -> tuple[Array, Array]:
    """Of every contact along every image of the orbit, and their rates."""
    samples = seen.displacement.shape[0]
    if not system.ports:
        return jnp.zeros((samples, 1, 0)), jnp.zeros((samples, 1, 0))
    ahead = jnp.exp(1j * curve.turn * jnp.arange(curve.images))[:, None]
    first = curve.stations.size
    z, v = (
        part[:, None, first:] * ahead for part in (seen.displacement, seen.velocity)
    )  # (T, i, p)
    plane = lambda z: jnp.stack([z.real, z.imag], axis=-1)
    rate = lambda z, v: jax.jvp(system.clearances, (plane(z),), (plane(v),))
    return jax.vmap(jax.vmap(rate))(z, v)


# === what is followed


def curve_of(
    orbit: PeriodicOrbit, path: str, between: Sequence[float], solver: Exponential | None
) -> tuple[Curve, np.ndarray]:
    """The problem of an orbit, and its unknowns; refuses what cannot be followed."""
    if not isinstance(orbit, PeriodicOrbit):
        raise ValueError(
            f"`orbit` must be of `jaxrotor.periodic`, but is a {type(orbit).__name__}."
        )
    if not float(orbit.scene.spin.speed):
        raise ValueError(
            "The steps of a branch are those of a rotor that turns, but its speed is 0."
        )
    scene, (low, high) = orbit.scene, _range(orbit.scene, path, between)
    together = port_groups(scene)
    system = assemble(scene, together)
    given = Exponential(4, located=True) if solver is None else solver
    chosen = differentiable(given, system)
    basis = {
        _basis(scene.replace({path: value}), chosen) for value in (*between, _own(scene, path))
    }
    modal = "modal" if basis == {"modal"} else "dense"
    chosen = Exponential(chosen.order, modal, chosen.located)
    how = {"slopes": False, "contacts": True, "coordinates": False, "together": together}
    plan = Plan(chosen, None, dfx.ForwardMode(), orbit.steps, orbit.steps, **how)
    rate = abs(float(scene.spin.speed))
    own = orbit.revolutions is None
    turn = orbit.turn if own else jnp.zeros(())
    images = _images(scene, path, float(turn), between) if own else 1
    state: Any = np.concatenate([orbit.start.q, np.asarray(orbit.start.velocity) / rate])
    moved = np.concatenate([np.ravel(orbit.displacement), np.ravel(orbit.velocity) / rate])
    size = float(np.abs(np.concatenate([state, moved])).max()) or 1.0
    curve = Curve(
        scene=scene,
        stations=orbit.stations,
        plan=plan,
        size=jnp.asarray(size, float),
        span=jnp.asarray(rate * orbit.period if own else 2 * math.pi, float),
        turn=jnp.asarray(turn),
        low=jnp.asarray(low, float),
        high=jnp.asarray(high, float),
        path=path,
        revolutions=orbit.revolutions,
        order=order(scene, system) if own else 1,
        images=images,
        decades=low > 0 and high > 10 * low,
    )
    x = np.concatenate([state.real, state.imag]) / size
    share = curve.share(_own(scene, path))
    return curve, np.concatenate([x, [1.0] if own else [], [share]])


def _own(scene: Scene, path: str) -> float:
    """The value that the scene has."""
    values = np.ravel(scene.get(path))
    if values.size == 0 or np.ptp(values) > SAME * np.abs(values).max():
        raise ValueError(
            f"`{path}` stands for values that differ, {', '.join(f'{v:g}' for v in values)}; name one of "
            "them, as in `limiters.0.stiffness`."
        )
    return float(values[0])


def _range(scene: Scene, path: str, between: Any) -> tuple[float, float]:
    """The range, in which both ends are scenes."""
    own = _own(scene, path)
    try:
        low, high = (float(value) for value in between)
    except (TypeError, ValueError):
        low = high = math.nan
    if not (math.isfinite(high - low) and low < high):
        raise ValueError(f"`between` must be two numbers, low and high, but is {between!r}.")
    if not low <= own <= high:
        raise ValueError(
            f"`between` must hold the orbit's own `{path}`, {own:g}, but is {low:g} to {high:g}."
        )
    if path == "spin.speed" and low * high <= 0:
        raise ValueError(f"`between` must keep the sense of rotation, but is {low:g} to {high:g}.")
    check_fixed_nodes(scene, path)
    for value in (low, high):
        other = scene.replace({path: value})
        if other.spans != scene.spans or port_groups(other) != port_groups(scene):
            raise ValueError(
                f"`{path}` moves a station past another, or stops apart that are at one, between {low:g} "
                f"and {high:g}; keep their order."
            )
    return low, high


def _basis(scene: Scene, solver: Exponential) -> str:
    rate: Scalar = jnp.abs(scene.spin.speed)
    chosen: Any = choose(solver, assemble(scene), rate)
    return chosen.basis


def _images(scene: Scene, path: str, turn: float, between: Sequence[float]) -> int:
    """Periods after which a motion without unbalance closes; refuses what breaks its symmetry."""
    for value in between:
        other = scene.replace({path: value})
        apart = changes(other, assemble(other, port_groups(scene)), jnp.asarray(turn))
        if float(jnp.max(jnp.abs(apart))) > SAME:
            raise ValueError(
                f"`{path}` breaks the symmetry that an orbit without unbalance rests on; find the orbit "
                "by `periodic` with `turn=0`, or in a scene with unbalance."
            )
    count = 1
    while abs(math.remainder(count * turn, 2 * math.pi)) > 1e-9 and count < 360:
        count += 1
    return count
