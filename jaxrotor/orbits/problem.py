"""Problem: the periodic motions of a scene as one of its parameters changes.

    residual(x, s) = 0,   x of `Shooting`,   s from 0 to 1 along the range of the parameter

One compiled program evaluates everything about a trial, whatever the values.
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
from ..core.plane import plane
from ..core.quantities import Scalar
from ..effects.rub import AbstractRub
from ..equations.speed_tables import check_tables
from ..equations.start import Continued
from ..equations.system import System, assemble, port_groups
from ..motion.base import Plan
from ..motion.revolutions import Outcome, joined
from ..scene import Scene, with_shared_nodes
from ..shafts.cased import same_shape
from ..solvers.choice import choose, solver_name
from ..solvers.exponential import Exponential
from .orbit import PeriodicOrbit, winding_angle
from .shooting import OrbitSamples, Shooting, differentiable, without_unbalance
from .symmetry import SAME, symmetry_defects, symmetry_order


class PhaseCondition(NamedTuple):
    """`normal . (x - reference) = 0`: picks one of the states that an autonomous orbit goes through."""

    reference: Any  # (m,), of jax where it is traced, else of numpy
    normal: Any  # (m,)


class Evaluation(NamedTuple):
    """The residual of a trial and all that comes with it: `T` samples, `k` contacts, `i` images."""

    residual: Float[Array, " a"]
    jacobian: Float[Array, "a b"]  # by x and s
    direction: Float[Array, " m"]  # of motion in the state
    multipliers: Complex[Array, " r"]
    trivial: Scalar | None
    samples: OrbitSamples
    clearance: Float[Array, "T i k"]  # of every contact [m]
    clearance_rate: Float[Array, "T i k"]  # [m/s]
    period: Scalar  # [s]
    turn: Scalar  # [rad], whole turns included
    speed: Scalar  # [rad/s]
    outcome: Outcome


class ContinuationProblem(eqx.Module):
    """`residual(x, s) = 0` for a scene, one of its parameters, and what counts as a period."""

    scene: Scene
    stations: Float[Array, " s"]
    plan: Plan
    size: Scalar  # [m], the unit of the states
    span: Scalar  # [rad], see `Shooting`
    turn: Scalar  # [rad]
    low: Scalar  # range of the parameter
    high: Scalar
    path: str = eqx.field(static=True)
    revolutions: int | None = eqx.field(static=True)  # None: the period is unknown
    order: int = eqx.field(static=True)  # of the rotations that leave the scene as it is
    images: int = eqx.field(static=True)  # periods after which the motion closes
    decades: bool = eqx.field(static=True)  # whether s runs along the logarithm

    def value(self, s: ArrayLike) -> Array:
        """Value of the parameter at `s`."""
        s = jnp.asarray(s)
        if self.decades:
            return self.low * (self.high / self.low) ** s
        return self.low + (self.high - self.low) * s

    def place(self, value: float) -> float:
        """The `s` of a value."""
        low, high = float(self.low), float(self.high)
        if self.decades:
            return math.log(value / low) / math.log(high / low)
        return (value - low) / (high - low)

    def system(self, s: ArrayLike) -> System:
        """The equations of motion at `s`."""
        system = assemble(self.scene.put({self.path: self.value(s)}), self.plan.together)
        if self.revolutions is None:
            system = without_unbalance(system)
        return system

    def shooting(self, system: System, condition: PhaseCondition) -> Shooting:
        """Shooting with these equations; contacts are sampled after the stations."""
        stations = jnp.concatenate(
            [self.stations, *(jnp.atleast_1d(port.at) for port in system.ports)]
        )
        rate = jnp.abs(system.spin.speed)
        normal = condition.normal if self.revolutions is None else None
        parts = system, self.plan, stations, rate, self.span, self.turn, self.size
        return Shooting(*parts, condition.reference, normal, self.revolutions or 1)

    def orbit(
        self, u: Float[np.ndarray, " b"], evaluation: Evaluation, iterations: int = 0
    ) -> PeriodicOrbit:
        """The orbit of unknowns `u = (x, s)`, from their evaluation."""
        scene = self.scene.replace({self.path: float(self.value(u[-1]))})
        q, velocity = self.state(u, evaluation)
        samples, stations = evaluation.samples, self.stations.size
        times, force = samples.displacement.shape[0], samples.contact_force
        period, turn, trivial = evaluation.period, evaluation.turn, evaluation.trivial
        residual = jnp.max(jnp.abs(evaluation.residual))
        return PeriodicOrbit(
            start=Continued(jnp.asarray(q), jnp.asarray(velocity)),
            period=jnp.asarray(period),
            turn=jnp.asarray(turn),
            whirl_rate=jnp.asarray(turn / (period * evaluation.speed)),
            multipliers=jnp.asarray(evaluation.multipliers),
            trivial=None if trivial is None else jnp.asarray(trivial),
            time=jnp.linspace(0.0, period, times),
            displacement=jnp.asarray(samples.displacement[:, :stations]),
            velocity=jnp.asarray(samples.velocity[:, :stations]),
            contact_force=None if force is None else jnp.asarray(force),
            stations=self.stations,
            residual=residual,
            iterations=jnp.asarray(iterations),
            converged=jnp.isfinite(residual),
            unresolved=jnp.asarray(evaluation.outcome.unresolved),
            scene=scene,
            error=None,
            revolutions=self.revolutions,
            steps=self.plan.steps,
            solver=solver_name(self.plan.solver),
        )

    def state(
        self, u: Float[np.ndarray, " b"], evaluation: Evaluation
    ) -> tuple[np.ndarray, np.ndarray]:
        """Coordinates [m] and their velocities [m/s]."""
        m = evaluation.direction.size
        real, imag = np.split(float(self.size) * np.asarray(u[:m]), 2)
        q, rates = np.split(real + 1j * imag, 2)
        return q, abs(float(evaluation.speed)) * rates


def _evaluate(
    problem: ContinuationProblem, u: Float[Array, " b"], condition: PhaseCondition
) -> Evaluation:
    x, s = u[:-1], u[-1]
    # Only what the parameter changes is differentiated through assembly, and once.
    split = lambda s: eqx.partition(problem.system(s), eqx.is_inexact_array)
    constant = split(s)[1]
    system, change = jax.jvp(lambda s: split(s)[0], (s,), (jnp.ones_like(s),))

    def residual_of(x, system):
        return problem.shooting(eqx.combine(system, constant), condition).residual(x)

    def push(along):
        moved = jax.tree.map(lambda leaf: along[-1] * leaf, change)
        return jax.jvp(residual_of, (x, system), (along[:-1], moved), has_aux=True)

    residual, jacobian, motion = jax.vmap(push, out_axes=(None, -1, None))(jnp.eye(u.size))
    revolutions, outcome = motion
    shooting = problem.shooting(eqx.combine(system, constant), condition)
    autonomous = problem.revolutions is None
    direction = shooting.direction(x) if autonomous else jnp.zeros_like(condition.reference)
    multipliers, trivial = shooting.multipliers(x, jacobian[:, :-1])
    samples = jax.tree.map(joined, revolutions)
    period = shooting.revolutions * shooting.length(x) / shooting.rate
    return Evaluation(
        residual,
        jacobian,
        direction,
        multipliers,
        trivial,
        samples,
        *_clearances(problem, shooting.system, samples),
        period,
        winding_angle(samples.displacement[:, 0], problem.turn),
        shooting.system.spin.speed,
        outcome,
    )


evaluate = eqx.filter_jit(_evaluate, **QUICKLY)


def _clearances(
    problem: ContinuationProblem, system: System, samples: OrbitSamples
) -> tuple[Array, Array]:
    """Clearances of every contact along every image of the orbit, and their rates."""
    times = samples.displacement.shape[0]
    if not system.ports:
        return jnp.zeros((times, 1, 0)), jnp.zeros((times, 1, 0))
    ahead = jnp.exp(1j * problem.turn * jnp.arange(problem.images))[:, None]
    first = problem.stations.size
    z, v = (
        part[:, None, first:] * ahead for part in (samples.displacement, samples.velocity)
    )  # (T, i, p)
    rate = lambda z, v: jax.jvp(system.clearances, (plane(z, -1),), (plane(v, -1),))
    return jax.vmap(jax.vmap(rate))(z, v)


# === from an orbit and a range


def problem_of(
    orbit: PeriodicOrbit, path: str, between: Sequence[float], solver: Exponential | None
) -> tuple[ContinuationProblem, np.ndarray]:
    """The problem of an orbit, and its unknowns; raise where it cannot be continued."""
    if not isinstance(orbit, PeriodicOrbit):
        raise ValueError(
            f"`orbit` must be a result of `jaxrotor.periodic`, but is a {type(orbit).__name__}."
        )
    if not float(orbit.scene.spin.speed):
        raise ValueError(
            "The steps of a branch are parts of a revolution, so the rotor must rotate, but its speed is "
            "0; give an orbit of a rotating scene."
        )
    for contact in orbit.scene.of(AbstractRub):
        if contact.on is not None:
            raise ValueError(
                f"`{orbit.scene.name_of(contact)}` stands on the casing {contact.on!r}, but branches "
                "look for grazing of contacts that stand on the ground; call `periodic` value by value."
            )
    scene = with_shared_nodes(orbit.scene, [path])
    low, high = _range(scene, path, between)
    together = port_groups(scene)
    system = assemble(scene, together)
    given = Exponential(4, located=True) if solver is None else solver
    chosen = differentiable(given, system)
    basis = {
        _basis(scene.replace({path: value}), chosen) for value in (*between, _own(scene, path))
    }
    modal = "modal" if basis == {"modal"} else "dense"
    chosen = Exponential(chosen.order, modal, chosen.located)
    options = {"slopes": False, "contacts": True, "coordinates": False, "together": together}
    plan = Plan(chosen, None, dfx.ForwardMode(), orbit.steps, orbit.steps, **options)
    rate = abs(float(scene.spin.speed))
    autonomous = orbit.revolutions is None
    turn = orbit.turn if autonomous else jnp.zeros(())
    images = _images(scene, path, float(turn), between) if autonomous else 1
    q, velocity = orbit.start.q, np.asarray(orbit.start.velocity)
    if scene.resolution != orbit.scene.resolution:
        lines = orbit.scene.line(), scene.line()
        q, velocity = (same_shape(part, *lines) for part in (q, velocity))
    state: Any = np.concatenate([q, velocity / rate])
    moved = np.concatenate([np.ravel(orbit.displacement), np.ravel(orbit.velocity) / rate])
    size = float(np.abs(np.concatenate([state, moved])).max()) or 1.0
    problem = ContinuationProblem(
        scene=scene,
        stations=orbit.stations,
        plan=plan,
        size=jnp.asarray(size, float),
        span=jnp.asarray(rate * orbit.period if autonomous else 2 * math.pi, float),
        turn=jnp.asarray(turn),
        low=jnp.asarray(low, float),
        high=jnp.asarray(high, float),
        path=path,
        revolutions=orbit.revolutions,
        order=symmetry_order(scene, system) if autonomous else 1,
        images=images,
        decades=low > 0 and high > 10 * low,
    )
    x = np.concatenate([state.real, state.imag]) / size
    s = problem.place(_own(scene, path))
    return problem, np.concatenate([x, [1.0] if autonomous else [], [s]])


def _own(scene: Scene, path: str) -> float:
    """The scene's own value of a parameter."""
    values = np.ravel(scene.get(path))
    if values.size == 0 or np.ptp(values) > SAME * np.abs(values).max():
        raise ValueError(
            f"`{path}` has several values, {', '.join(f'{v:g}' for v in values)}; name one of them, as in "
            "`limiters.0.stiffness`."
        )
    return float(values[0])


def _range(scene: Scene, path: str, between: Any) -> tuple[float, float]:
    """The range of a parameter; raise unless both ends make a scene of the same layout."""
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
    if path == "spin.speed":
        check_tables(scene, (low, high))
    for value in (low, high):
        other = scene.replace({path: value})
        if other.spans != scene.spans or port_groups(other) != port_groups(scene):
            raise ValueError(
                f"`{path}` moves a station past another, or separates stops at the same station, between "
                f"{low:g} and {high:g}; give a range that keeps their order."
            )
    return low, high


def _basis(scene: Scene, solver: Exponential) -> str:
    rate: Scalar = jnp.abs(scene.spin.speed)
    chosen: Any = choose(solver, assemble(scene), rate)
    return chosen.basis


def _images(scene: Scene, path: str, turn: float, between: Sequence[float]) -> int:
    """Periods after which an autonomous orbit closes; raise where the parameter breaks its symmetry."""
    for value in between:
        other = scene.replace({path: value})
        system = assemble(other, port_groups(scene))
        defects = symmetry_defects(other, system, jnp.asarray(turn))
        if float(jnp.max(jnp.abs(defects))) > SAME:
            raise ValueError(
                f"`{path}` breaks the symmetry that an orbit without unbalance depends on; compute the "
                "orbit by `periodic` with `turn=0`, or in a scene with unbalance."
            )
    count = 1
    while abs(math.remainder(count * turn, 2 * math.pi)) > 1e-9 and count < 360:
        count += 1
    return count
