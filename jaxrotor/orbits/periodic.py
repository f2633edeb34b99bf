"""Periodic: the periodic motion near a guess, by shooting."""

import dataclasses
import math
from typing import Any

import diffrax as dfx
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jaxtyping import Array, ArrayLike, Float

from ..core.checks import check_counts
from ..core.compiled import QUICKLY, compiled_quickly
from ..core.progress import waiting
from ..core.quantities import known, with_values
from ..equations.start import AbstractStart
from ..equations.system import System, assemble, port_groups
from ..motion.history import TimeHistory
from ..motion.rebounds import Rebounds, in_revolutions
from ..motion.revolutions import March, check_constant, joined, revolution_rate
from ..scene import Scene
from ..solvers.choice import choose, solver_name
from ..solvers.exponential import Exponential
from .beat import beat_guess, check_period, check_revolutions
from .guess import OrbitGuess, autonomous_guess, repeated_guess, revolutions_of
from .memory import named_samples, one_way_states, parts_of, start_on
from .orbit import OrbitError, PeriodicOrbit, winding_angle
from .passes import Cycle, cycle_of, with_cycle
from .shooting import (
    NewtonByTrial,
    Shooting,
    differentiable,
    plan_of,
    shooting_residual,
    with_derivative,
)


def periodic(
    scene: Scene,
    guess: TimeHistory | PeriodicOrbit | AbstractStart,
    *,
    revolutions: int | None = None,
    beats: int | None = None,
    turn: ArrayLike | None = None,
    period: ArrayLike | None = None,
    steps_per_revolution: int = 256,
    solver: Exponential | dfx.AbstractSolver | None = None,
    tolerance: float = 1e-10,
    finder: Any = None,
    max_iterations: int = 20,
    at: Any = None,
    estimate: bool = False,
    throw: bool = True,
    progress: bool | None = None,
) -> PeriodicOrbit:
    """The periodic motion near a guess: `z(t + T) = e^(i turn) z(t)`, stable or not.

    Periodic motions are computed by shooting: Newton's method on the difference between the state and
    itself one period later. The Jacobian is that of the steps themselves, jumps at changes of contact
    included, and its eigenvalues are the multipliers. States of laws, as of the controller of a
    `MagneticBearing`, return with it, and have multipliers too. With unbalance, `T` is a number of
    `revolutions` and `turn` is 0. With unbalance of several shafts it is a number of `beats`, after which
    the angles between them are what they were and an orbit returns turned, whatever their ratio; where it
    does not, see `torus`. In rolling bearings without unbalance, `T` is a number of passes of their
    balls, by `2 pi / balls` of the cage. Else, without unbalance, `T` is unknown and, where stops at
    equal angles leave a scene as it is when rotated, an orbit may return rotated.

    Args:
        scene: the rotor, at constant speed.
        guess: end of a `TimeHistory`, another orbit, or any start. Without unbalance it must be near its
            orbit already: a start is first simulated for 8 revolutions. Of a motion of several shafts
            the sample nearest to their first angles is taken, turned back.
        revolutions: in a period, by default 1 in a scene with unbalance. Given for a scene without one
            they are the period, for a rotor that comes to rest under its loads. In rolling bearings
            without unbalance they count passes, by default 1; with unbalance a revolution must be a
            whole number of passes.
        beats: in a period of a scene in which several shafts have unbalance, by default 1 unless
            `revolutions` are given, in which all of them must make whole turns. Where it is one shaft
            beside the first, they are its revolutions.
        turn: rotation [rad] that leaves the scene as it is, by which the orbit returns after a period;
            whole turns do not matter. By default it is estimated from the guess.
        period: of a scene without unbalance [s], near that of the orbit; by default it is estimated
            from the guess. A quasi-periodic or chaotic guess, which returns after many revolutions by
            chance alone, is refused.
        steps_per_revolution: of the shaft; a short period takes at least 16 steps, and states of laws
            as many as follow what they do by themselves.
        solver: `Exponential(4, located=True)` by default. Sharp stops take located steps.
        tolerance: largest residual, relative to the largest of the state.
        finder: root finder of optimistix, by default its Newton; `optimistix.Dogleg` and
            `LevenbergMarquardt` take worse guesses.
        max_iterations: of the root finder; each takes as long as a period with all its tangents.
        at: station(s) to observe [m], as in `simulate`.
        estimate: whether to repeat the search with half the step, for `PeriodicOrbit.error`.
        throw: whether to raise an error where no orbit is found; if not, `converged` is False.
        progress: whether to show after two seconds that the search is under way; by default on a
            terminal.

    Returns:
        A `PeriodicOrbit`, differentiable in forward mode by the implicit function theorem. Under jax.jit
        and derivatives, give an orbit known before as the guess. A derivative by what breaks the
        symmetry of an orbit, or by unbalance where there is none, is not a number; with `turn=0` and the
        period of full turns it is that of the orbit in the unsymmetric scene.

    Raises:
        ValueError: if an argument is out of its range or of another type, the speed is not constant,
            `revolutions` is combined with `turn` or `period`, the guess shows no period, or `turn` does
            not leave the scene as it is.
        RuntimeError: if no orbit is found, unless `throw` is False, as where a state of a law only grows.

    Source: Parker, Chua (1989), Practical Numerical Algorithms for Chaotic Systems, sections 5.2, 5.3.
    """
    solver = Exponential(4, located=True) if solver is None else solver
    check_counts(steps_per_revolution=steps_per_revolution, max_iterations=max_iterations)
    check_constant(scene, "`periodic`", memory=True)
    (scene, stations), together = scene.to_simulate(at, in_time=False), port_groups(scene)
    system = assemble(scene, together)
    cycle = cycle_of(scene, system, "`periodic`")
    system = with_cycle(system, cycle.passes)
    solver = differentiable(solver, system)
    options = revolutions, beats, turn, period
    first = _guess(scene, system, cycle, guess, options, steps_per_revolution, solver, stations)
    revolutions = None if first.beats else first.revolutions
    finder = NewtonByTrial(tolerance, tolerance) if finder is None else finder
    chosen: Any = choose(solver, system, first.rate, first.start)
    settings = chosen, together, finder, tolerance
    traced = not all(map(known, jax.tree.leaves((system, first))))
    find = _COMPILED if traced else _COMPILED_QUICKLY
    with waiting(progress, "periodic orbit"):
        found = find(scene, system, stations, first, *settings, max_iterations)
        failed = known(found.converged) and not bool(found.converged)
    if throw and failed:
        raise RuntimeError(_failure(scene, system, stations, first, chosen, together, found))
    if not (failed or traced) and system.members:
        span = jnp.asarray(2 * jnp.pi) if revolutions else first.rate * found.period
        ratio = _stiffness_ratios(system, chosen, together, stations, first.rate, span, first.steps)
        touched = bool(jnp.any(found.contact_force != 0))
        stops = Rebounds(scene, system.members, touched, ratio, found.contact_force)
        stops.check(chosen, in_revolutions(steps_per_revolution), measured=estimate)
    if not estimate:
        return found
    finer = dataclasses.replace(
        first,
        start=parts_of(found.start, system, stations[0]),
        span=first.span if revolutions else first.rate * found.period,
        steps=2 * first.steps,
    )
    repeated = find(scene, system, stations, finer, *settings, max_iterations)
    return dataclasses.replace(found, error=_changes(found, repeated))


def _guess(
    scene: Scene,
    system: System,
    cycle: Cycle,
    guess: Any,
    options: tuple[Any, Any, Any, Any],
    steps_per_revolution: int,
    solver: Exponential,
    stations: Array,
) -> OrbitGuess:
    """The guess of an orbit by what is asked for its period: revolutions, beats, turn and period."""
    revolutions, beats, turn, period = options
    if system.others:
        check_period(*options)
        if revolutions is None:
            counts = 1 if beats is None else beats, steps_per_revolution
            return beat_guess(scene, system, guess, *counts, stations)
    elif beats is not None:
        raise ValueError(
            "`beats` are for scenes in which a shaft beside the first one has unbalance; give "
            "`revolutions`."
        )
    elif revolutions is None and turn is None and period is None:
        revolutions = revolutions_of(scene, system, guess)
    if revolutions is None:
        steps = steps_per_revolution, solver, stations
        return autonomous_guess(scene, system, guess, turn, period, *steps)
    check_counts(revolutions=revolutions)
    if turn is not None or period is not None:
        raise ValueError(
            "`revolutions` are the period, so they go without `turn` and `period`, which are for scenes "
            "without unbalance."
        )
    revolution_rate(scene, None)  # raises at rest
    if system.others:
        check_revolutions(scene, system, revolutions)
    return repeated_guess(system, guess, cycle, revolutions, steps_per_revolution, stations)


def _failure(
    scene: Scene,
    system: System,
    stations: Array,
    first: OrbitGuess,
    chosen: Exponential,
    together: Any,
    found: PeriodicOrbit,
) -> str:
    """Why no orbit was found, and what to do."""
    if system.state_count:
        along = _states_along(system, stations, first, chosen, together)
        if names := one_way_states(scene, np.asarray(along)):
            return (
                f"No orbit was found near the guess, along which a state of a law ({names}) goes on in "
                "one sense: where it can only grow, as wear does, no motion repeats; follow it by "
                "`jaxrotor.simulate`."
            )
    residual = float(found.residual)
    still = f"the residual is still {residual:.1e} of the state"
    return (
        f"No orbit was found near the guess: after {int(found.iterations)} iterations "
        f"{still if math.isfinite(residual) else 'the state diverged'}. Take a guess that "
        "has settled for longer (a chaotic motion settles on none, see `jaxrotor.lyapunov`), check "
        "`revolutions`, `turn` and `period`, or try `finder=optimistix.Dogleg(1e-10, 1e-10)`."
    )


def _find(
    scene: Scene,
    system: System,
    stations: Float[Array, " s"],
    guess: OrbitGuess,
    solver: Exponential,
    together: tuple[tuple[int, ...], ...],
    finder: Any,
    tolerance: float,
    max_iterations: int,
) -> PeriodicOrbit:
    plan = plan_of(solver, together, guess.steps)
    counted = 1 if guess.beats else guess.revolutions
    period = guess.span, guess.turn, guess.start, counted
    shooting = Shooting.near(system, plan, stations, guess.rate, *period)
    root = optx.root_find(
        shooting_residual,
        finder,
        shooting.first,
        shooting,
        has_aux=True,
        max_steps=max_iterations,
        throw=False,
    )
    # The last trial is nearer to the root than the tolerance.
    shot = with_derivative(root.value, shooting, root.aux)
    residual = jnp.max(jnp.abs(shot.residual))
    converged = (root.result == optx.RESULTS.successful) & (residual < 10 * tolerance)
    x = jnp.where(converged, root.value, jnp.nan)
    samples = jax.tree.map(lambda leaf: jnp.where(converged, joined(leaf), jnp.nan), shot.samples)
    jacobian = jnp.where(converged, shot.jacobian, jnp.nan)
    multipliers, trivial = shooting.multipliers(x, jacobian)
    span = shooting.length(x)
    period = shooting.revolutions * span / guess.rate
    turn = winding_angle(samples.displacement[:, 0], guess.turn)
    return PeriodicOrbit(
        start=start_on(*shooting.decode(x)),
        period=period,
        turn=turn,
        whirl_rate=turn / (period * scene.spin.speed),
        multipliers=multipliers,
        trivial=trivial,
        time=jnp.linspace(0.0, period, samples.displacement.shape[0]),
        **samples._asdict() | {"states": named_samples(scene, samples.states)},
        stations=stations,
        residual=residual,
        iterations=root.stats["num_steps"],
        converged=converged,
        unresolved=shot.outcome.unresolved,
        scene=with_values(scene, observed=None),
        error=None,
        revolutions=guess.revolutions,
        steps=guess.steps,
        solver=solver_name(solver),
        passes=guess.passes,
        beats=guess.beats,
        shaft=scene.observed,
    )


@compiled_quickly
def _stiffness_ratios(system, solver, together, stations, rate, span, steps):
    """See `Tableau.contact_stiffness_ratio`, of steps of a period with an angle `span`."""
    march = March.of(system, plan_of(solver, together, steps), rate, stations, span)
    return march.contact_stiffness_ratio


_COMPILED = eqx.filter_jit(_find)
# Compilation takes most of the time of a single orbit, and optimised code is hardly faster.
_COMPILED_QUICKLY = eqx.filter_jit(_find, **QUICKLY)


@compiled_quickly
def _states_along(
    system: System, stations: Array, guess: OrbitGuess, solver: Exponential, together: Any
) -> Float[Array, "T k"]:
    """States of laws along the guess."""
    plan = plan_of(solver, together, guess.steps)
    period = guess.span, guess.turn, guess.start, guess.revolutions
    shooting = Shooting.near(system, plan, stations, guess.rate, *period)
    _, (samples, _) = shooting.residual(shooting.first)
    assert samples.states is not None
    return joined(samples.states)


def _changes(found: PeriodicOrbit, finer: PeriodicOrbit) -> OrbitError:
    apart = jnp.abs(found.multipliers[:, None] - finer.multipliers)
    return OrbitError(
        jnp.abs(finer.period - found.period),
        jnp.abs(finer.whirl_rate - found.whirl_rate),
        jnp.max(jnp.abs(finer.displacement[::2] - found.displacement)),
        jnp.max(jnp.min(apart, axis=1)),
    )
