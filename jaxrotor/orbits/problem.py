"""Problem: the periodic motions of a scene as one or more of its parameters change.

    residual(x, s) = 0,   x of `Shooting`,   s from 0 to 1 along the range of each parameter

One compiled program evaluates everything about a trial, whatever the values.
"""

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float

from ..core.compiled import QUICKLY
from ..core.plane import plane
from ..core.quantities import Scalar, with_values
from ..effects.rub import AbstractRub
from ..equations.shared_nodes import with_shared_nodes
from ..equations.system import System, assemble, phrase, port_groups, state_names
from ..motion.base import Plan
from ..motion.revolutions import Outcome, joined
from ..scene import Scene
from ..shafts.cased import same_shape
from ..solvers.choice import choose, solver_name
from ..solvers.exponential import Exponential
from .beat import beat_of, checked_beat
from .memory import named_samples, start_on, steps_for_states
from .orbit import PeriodicOrbit, winding_angle
from .parameter_range import AbstractRanged, ParameterRange, own, range_of
from .passes import check_ranges, cycle_rate, with_cycle
from .shooting import (
    OrbitSamples,
    Shooting,
    differentiable,
    plan_of,
    sizes_of,
    without_unbalance,
)
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
    rate: Scalar  # [rad/s], see `Shooting`
    outcome: Outcome


class ContinuationProblem(AbstractRanged):
    """`residual(x, s) = 0` for a scene, `p` of its parameters, and what counts as a period."""

    scene: Scene
    stations: Float[Array, " s"]
    plan: Plan
    size: Float[Array, " m"]  # unit of every number of a state, see `Shooting`
    span: Scalar  # [rad], see `Shooting`
    turn: Scalar  # [rad]
    parameters: tuple[ParameterRange, ...]
    revolutions: int | None = eqx.field(static=True)  # None: the period is unknown
    order: int = eqx.field(static=True)  # of the rotations that leave the scene as it is
    images: int = eqx.field(static=True)  # periods after which the motion closes
    # Whether `revolutions` are passes, see `Cycle`:
    passes: bool = eqx.field(static=True, default=False)
    beats: bool = eqx.field(static=True, default=False)  # whether they are beats, see `beat_of`

    def system(self, s: Float[Array, " p"]) -> System:
        """The equations of motion at places `s`."""
        paths = [one.path for one in self.parameters]
        scene = self.scene.put(dict(zip(paths, self.values(s), strict=True)))
        system = assemble(scene, self.plan.together)
        if self.revolutions is None:
            system = without_unbalance(system)
        return with_cycle(system, self.passes)

    def shooting(self, system: System, condition: PhaseCondition) -> Shooting:
        """Shooting with these equations; contacts are sampled after the stations."""
        stations = jnp.concatenate(
            [self.stations, *(jnp.atleast_1d(port.at) for port in system.ports)]
        )
        rate = cycle_rate(system, self.passes)
        normal = condition.normal if self.revolutions is None else None
        span, turn, count = self.span, self.turn, self.revolutions or 1
        if self.beats:
            (span, turn), count = beat_of(system, count), 1
        parts = system, self.plan, stations, rate, span, turn, self.size
        return Shooting(*parts, condition.reference, normal, count)

    def orbit(
        self, u: Float[np.ndarray, " b"], evaluation: Evaluation, iterations: int = 0
    ) -> PeriodicOrbit:
        """The orbit of unknowns `u = (x, s)`, from their evaluation."""
        values = zip(self.parameters, self.values(u), strict=True)
        scene = self.scene.replace({one.path: float(value) for one, value in values})
        samples, stations = evaluation.samples, self.stations.size
        times, force = samples.displacement.shape[0], samples.contact_force
        period, turn, trivial = evaluation.period, evaluation.turn, evaluation.trivial
        residual = jnp.max(jnp.abs(evaluation.residual))
        return PeriodicOrbit(
            start=start_on(*map(jnp.asarray, self.state(u, evaluation))),
            period=jnp.asarray(period),
            turn=jnp.asarray(turn),
            whirl_rate=jnp.asarray(turn / (period * evaluation.speed)),
            multipliers=jnp.asarray(evaluation.multipliers),
            trivial=None if trivial is None else jnp.asarray(trivial),
            time=jnp.linspace(0.0, period, times),
            displacement=jnp.asarray(samples.displacement[:, :stations]),
            velocity=jnp.asarray(samples.velocity[:, :stations]),
            contact_force=None if force is None else jnp.asarray(force),
            states=named_samples(scene, samples.states),
            stations=self.stations,
            residual=residual,
            iterations=jnp.asarray(iterations),
            converged=jnp.isfinite(residual),
            unresolved=jnp.asarray(evaluation.outcome.unresolved),
            scene=with_values(scene, observed=None),
            error=None,
            revolutions=self.revolutions,
            steps=self.plan.steps,
            solver=solver_name(self.plan.solver),
            passes=self.passes,
            beats=self.beats,
            shaft=self.scene.observed,
        )

    def state(
        self, u: Float[np.ndarray, " b"], evaluation: Evaluation
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Coordinates [m], their velocities [m/s], and states of laws."""
        m = evaluation.direction.size
        state, k = np.asarray(self.size) * np.asarray(u[:m]), len(state_names(self.scene))
        real, imag = np.split(state[: m - k], 2)
        q, rates = np.split(real + 1j * imag, 2)
        return q, float(evaluation.rate) * rates, state[m - k :]

    def radius(self, evaluation: Evaluation) -> tuple[np.ndarray, np.ndarray]:
        """Smallest and largest radius at the stations [m]."""
        radius = np.abs(evaluation.samples.displacement[:, : self.stations.size])
        return radius.min(axis=0), radius.max(axis=0)

    def any_phase(self, u: Float[np.ndarray, " b"]) -> PhaseCondition:
        """A phase condition that every state meets, for one that is on its orbit already."""
        m = u.size - len(self.parameters) - (1 if self.revolutions is None else 0)
        return PhaseCondition(u[:m], np.zeros(m))


def with_slopes(
    problem: ContinuationProblem,
    u: Float[Array, " b"],
    condition: PhaseCondition,
    observed: Callable[[Shooting, Array], tuple[Any, Any]],
) -> tuple[Any, Any, Any, Shooting]:
    """Values `observed(shooting, x)[0]`, their derivatives by `u`, what else it gave, and the shooting.

    The derivatives have one more axis, the last.
    """
    count = len(problem.parameters)
    x, s = u[:-count], u[-count:]
    # Only what the parameters change is differentiated through assembly, and once.
    split = lambda s: eqx.partition(problem.system(s), eqx.is_inexact_array)
    constant = split(s)[1]
    changed = lambda along: jax.jvp(lambda s: split(s)[0], (s,), (along,))
    system, change = jax.vmap(changed, out_axes=(None, 0))(jnp.eye(count))

    def of(x, system):
        return observed(problem.shooting(eqx.combine(system, constant), condition), x)

    def push(along):
        moved = jax.tree.map(lambda leaf: jnp.tensordot(along[-count:], leaf, 1), change)
        return jax.jvp(of, (x, system), (along[:-count], moved), has_aux=True)

    values, slopes, more = jax.vmap(push, out_axes=(None, -1, None))(jnp.eye(u.size))
    return values, slopes, more, problem.shooting(eqx.combine(system, constant), condition)


def _evaluate(
    problem: ContinuationProblem, u: Float[Array, " b"], condition: PhaseCondition
) -> Evaluation:
    residual = lambda shooting, x: shooting.residual(x)
    found, jacobian, motion, shooting = with_slopes(problem, u, condition, residual)
    return evaluation_of(problem, shooting, u, found, jacobian, motion)


def evaluation_of(
    problem: ContinuationProblem,
    shooting: Shooting,
    u: Float[Array, " b"],
    residual: Float[Array, " a"],
    jacobian: Float[Array, "a b"],
    motion: tuple[OrbitSamples, Outcome],
) -> Evaluation:
    """All that is told of a trial, from its residual, the Jacobian and the motion."""
    revolutions, outcome = motion
    x = u[: -len(problem.parameters)]
    autonomous = problem.revolutions is None
    direction = shooting.direction(x) if autonomous else jnp.zeros_like(shooting.guess)
    multipliers, trivial = shooting.multipliers(x, jacobian[:, : x.size])
    samples = jax.tree.map(joined, revolutions)
    period = shooting.revolutions * shooting.length(x) / shooting.rate
    return Evaluation(
        residual,
        jacobian,
        direction,
        multipliers,
        trivial,
        samples,
        *clearances(problem, shooting.system, samples),
        period,
        winding_angle(samples.displacement[:, 0], shooting.turn),
        shooting.system.spin.speed,
        shooting.rate,
        outcome,
    )


evaluate = eqx.filter_jit(_evaluate, **QUICKLY)


def clearances(
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


# === from an orbit and ranges


def problem_of(
    orbit: PeriodicOrbit,
    ranges: Mapping[str, Sequence[float]],
    solver: Exponential | None,
    name: str = "between",
) -> tuple[ContinuationProblem, np.ndarray]:
    """The problem of an orbit with parameters in ranges, and its unknowns; raise where there is none.

    `name` is the argument that has the ranges.
    """
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
    scene = with_values(orbit.scene, observed=orbit.shaft)
    scene = with_shared_nodes(scene, list(ranges))
    parameters = tuple(range_of(scene, path, between, name) for path, between in ranges.items())
    together = port_groups(scene)
    system = with_cycle(assemble(scene, together), orbit.passes)
    given = Exponential(4, located=True) if solver is None else solver
    chosen = differentiable(given, system)
    corners = itertools.product(*[(*between, own(scene, path)) for path, between in ranges.items()])
    ends = [scene.replace(dict(zip(ranges, corner, strict=True))) for corner in corners]
    if "turns" in system.clocks:
        check_ranges(scene, ends, orbit.passes, phrase(f"`{path}`" for path in ranges))
    basis = {_basis(end, chosen, orbit.passes) for end in ends}
    modal = "modal" if basis == {"modal"} else "dense"
    chosen = Exponential(chosen.order, modal, chosen.located)
    steps = max(_steps(end, orbit) for end in (scene, *ends))
    if orbit.beats:
        spans = [_span_of_beats(one, orbit) for one in (scene, *ends)]
        steps = math.ceil(steps * max(spans) / spans[0])
    plan = plan_of(chosen, together, steps)
    rate = float(cycle_rate(system, orbit.passes))
    autonomous = orbit.revolutions is None
    turn = orbit.turn if autonomous else jnp.zeros(())
    images = 1
    if autonomous:
        images = _images(float(turn))
        for path, between in ranges.items():
            check_symmetry(scene, path, float(turn), between)
    q, velocity = orbit.start.q, np.asarray(orbit.start.velocity)
    if scene.resolution != orbit.scene.resolution:
        lines = orbit.scene.line(), scene.line()
        q, velocity = (same_shape(part, *lines) for part in (q, velocity))
    state: Any = np.concatenate([q, velocity / rate])
    moved = np.concatenate([np.ravel(orbit.displacement), np.ravel(orbit.velocity) / rate])
    size = float(np.abs(np.concatenate([state, moved])).max()) or 1.0
    along = [orbit.states[name] for name in state_names(scene)]
    states = np.array([np.abs(one).max() for one in along])
    sizes = sizes_of(system, jnp.asarray(size), states)
    sizes = jnp.where(sizes > 0, sizes, 1.0)
    problem = ContinuationProblem(
        scene=scene,
        stations=orbit.stations,
        plan=plan,
        size=sizes,
        span=jnp.asarray(rate * orbit.period if autonomous else 2 * math.pi, float),
        turn=jnp.asarray(turn),
        parameters=parameters,
        revolutions=orbit.revolutions,
        order=symmetry_order(scene, system) if autonomous and not states.size else 1,
        images=images,
        passes=orbit.passes,
        beats=orbit.beats,
    )
    begin = [one[0] for one in along]
    x = np.concatenate([state.real, state.imag, begin]) / np.asarray(sizes)
    s = [one.place(own(scene, one.path)) for one in parameters]
    return problem, np.concatenate([x, [1.0] if autonomous else [], s])


def _steps(scene: Scene, orbit: PeriodicOrbit) -> int:
    """Steps of a period that follow the states of laws in a scene as well."""
    system = with_cycle(assemble(scene), orbit.passes)
    length = orbit.period
    if orbit.revolutions is not None:
        length = 2 * math.pi / cycle_rate(system, orbit.passes)
    return steps_for_states(system, orbit.steps, length)


def _span_of_beats(scene: Scene, orbit: PeriodicOrbit) -> float:
    """Angle of the first shaft in the beats of an orbit [rad]; raises where it does not return."""
    assert orbit.revolutions is not None
    return float(checked_beat(scene, assemble(scene), orbit.revolutions)[0])


def _basis(scene: Scene, solver: Exponential, passes: bool) -> str:
    system = with_cycle(assemble(scene), passes)
    chosen: Any = choose(solver, system, cycle_rate(system, passes))
    return chosen.basis


def _images(turn: float) -> int:
    """Periods after which an autonomous orbit closes."""
    count = 1
    while abs(math.remainder(count * turn, 2 * math.pi)) > 1e-9 and count < 360:
        count += 1
    return count


def check_symmetry(scene: Scene, path: str, turn: float, between: Sequence[float]) -> None:
    """Raise where a parameter breaks the symmetry by which an autonomous orbit returns turned."""
    for value in between:
        other = scene.replace({path: value})
        system = assemble(other, port_groups(scene))
        defects = symmetry_defects(other, system, jnp.asarray(turn))
        if float(jnp.max(jnp.abs(defects))) > SAME:
            raise ValueError(
                f"`{path}` breaks the symmetry that an orbit without unbalance depends on; compute the "
                "orbit by `periodic` with `turn=0`, or in a scene with unbalance."
            )
