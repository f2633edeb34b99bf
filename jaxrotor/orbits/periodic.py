"""Periodic: a motion that repeats itself, with its multipliers and derivatives."""

import dataclasses
import math
from typing import Any

import diffrax as dfx
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jaxtyping import Array, ArrayLike, Bool, Complex, Float, Int

from ..core.checks import check_counts
from ..core.compiled import QUICKLY
from ..core.extremes import largest
from ..core.progress import waiting
from ..core.quantities import Scalar, known
from ..core.tables import notebook_table
from ..equations.start import AbstractStart, Continued
from ..equations.system import System, assemble, port_groups
from ..motion.base import Plan
from ..motion.revolutions import check_constant, joined, revolution_rate
from ..motion.simulate import Response, simulate
from ..scene import Scene
from ..solvers.choice import choose, solver_name
from ..solvers.exponential import Exponential
from .recurrence import recurrence
from .shooting import Shooting, again, differentiable, missed
from .symmetry import SAME, changes, nan_unless_symmetric, order


LEAST = 16  # steps in a period
SEARCH = 8  # revolutions from a start that are looked at for a period


class OrbitError(eqx.Module):
    """Changes by steps of half the length: about what those of full length are off."""

    period: Scalar  # [s]
    whirl_rate: Scalar  # [1]
    displacement: Scalar  # largest of the orbit [m]
    multipliers: Scalar  # largest [1]


class PeriodicOrbit(eqx.Module):
    """A motion with `z(t + period) = e^(i turn) z(t)`, sampled over a period at `s` stations."""

    start: Continued  # a state on it; of a scene with unbalance that at angle 0
    period: Scalar  # [s]
    turn: Scalar  # [rad] that it turns about the centre in a period, whole turns included
    whirl_rate: Scalar  # turn / (period Omega) [1]
    multipliers: Complex[Array, " m"]  # of a period, turned back; largest first
    trivial: Scalar | None  # multiplier along a motion without unbalance, 1 but for errors; or None
    time: Float[Array, " T"]  # [s]
    displacement: Complex[Array, "T s"]  # x + i y [m]
    velocity: Complex[Array, "T s"]  # [m/s]
    contact_force: Complex[Array, "T k"] | None  # on the shaft, by contact of the scene [N]
    stations: Float[Array, " s"]  # [m]
    residual: Scalar  # largest that a period misses, over the largest of the state [1]
    iterations: Int[Array, ""]
    converged: Bool[Array, ""]
    unresolved: Int[Array, ""]  # steps whose changes of contact were not located
    scene: Scene
    error: OrbitError | None
    revolutions: int | None = eqx.field(static=True)  # in a period; None if that is not given
    steps: int = eqx.field(static=True)  # in a revolution, or in a period that is not given
    solver: str = eqx.field(static=True)

    @property
    def stable(self) -> Bool[Array, ""]:
        """Whether every multiplier is inside the unit circle."""
        return jnp.all(jnp.abs(self.multipliers) < 1)

    @property
    def radius(self) -> tuple[Float[Array, " s"], Float[Array, " s"]]:
        """Smallest and largest distance from the centre [m] at the samples."""
        radius = jnp.abs(self.displacement)
        return -largest(-radius), largest(radius)

    @property
    def duty(self) -> Float[Array, " k"]:
        """Share of the samples at which each contact is under load; not differentiable."""
        return jnp.mean(jnp.abs(self._forces()[1:]) > 0, axis=0)

    @property
    def peak_force(self) -> Float[Array, " k"]:
        """Largest force of each contact [N] at the samples."""
        return largest(jnp.abs(self._forces()))

    def _forces(self) -> Complex[Array, "T k"]:
        if self.contact_force is None:
            raise ValueError("The scene of this orbit has no contact.")
        return self.contact_force

    def _repr_html_(self) -> str:
        low, high = self.radius
        heads = ("station [m]", "least radius [m]", "largest radius [m]")
        rows = list(zip(self.stations.tolist(), low.tolist(), high.tolist(), strict=True))
        return notebook_table(str(self), heads, rows)

    def __str__(self) -> str:
        if self.revolutions is None:
            degrees = math.degrees(float(self.turn))
            kind = f"Orbit of period {float(self.period):.9g} s that turns by {degrees:.6g} degrees"
        else:
            kind = f"Orbit of {self.revolutions} revolution{'s' * (self.revolutions > 1)}"
        largest = complex(self.multipliers[0])
        return (
            f"{kind}, whirl rate {float(self.whirl_rate):.9g}, "
            f"{'stable' if self.stable else 'unstable'}: largest multiplier {abs(largest):.6g} at "
            f"{math.degrees(np.angle(largest)):.4g} degrees; residual {float(self.residual):.1e} after "
            f"{int(self.iterations)} iterations of {self.steps} steps, {self.solver}"
        )


def periodic(
    scene: Scene,
    guess: Response | PeriodicOrbit | AbstractStart,
    *,
    revolutions: int | None = None,
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

    With unbalance, `T` is a number of `revolutions`, and nothing is turned. Without, it is unknown
    and, where stops at equal angles leave a scene as it is when turned, an orbit may come back turned.
    The root of what a state misses after `T` is found by Newton's method; its Jacobian is that of the
    steps themselves, jumps at changes of contact included, and its eigenvalues are the multipliers.

    Args:
        scene: what moves, at constant speed, the same along every axis but for contact and loads.
        guess: end of a `Response`, another orbit, or any start. A scene without unbalance takes what
            has come near its orbit: from a start, the end of 8 revolutions.
        revolutions: in a period, by default 1 in a scene with unbalance; given for one without, it is
            the period, for a rotor that comes to rest under its loads.
        turn: [rad] that leaves the scene as it is, by which the orbit is to be turned after a period;
            whole turns do not matter. By default as the guess comes back.
        period: [s] near that of an orbit of a scene without unbalance; by default as the guess
            comes back; a guess that does so after many turns by chance alone (quasi-periodic or
            chaotic) is refused.
        steps_per_revolution: of the shaft; a short period takes 16 steps at least.
        solver: `Exponential(4, located=True)` by default. Sharp stops take located steps.
        tolerance: of the root, of the largest of the state.
        finder: root finder of optimistix, by default its Newton; `optimistix.Dogleg` and
            `LevenbergMarquardt` take worse guesses.
        max_iterations: of the root finder; each takes as long as a period with all its tangents.
        at: station(s) [m] to observe, as in `simulate`.
        estimate: whether to repeat it with half the step, for `error`.
        throw: whether to raise an error where no orbit is found; else `converged` says so.
        progress: whether to say after two seconds that it is under way; by default on a terminal.

    Returns:
        A `PeriodicOrbit`. Differentiable in forward mode, by the implicit function theorem. Under
        jax.jit and derivatives give an orbit known before as the guess. A derivative by what breaks the
        symmetry an orbit rests on, or by unbalance where there is none, is not a number; with `turn=0`
        and the period of full turns it is that of the orbit in the unsymmetric scene.

    Source: Parker, Chua (1989), Practical Numerical Algorithms for Chaotic Systems, sections 5.2, 5.3.
    """
    solver = Exponential(4, located=True) if solver is None else solver
    check_counts(steps_per_revolution=steps_per_revolution, max_iterations=max_iterations)
    check_constant(scene, "`periodic`")
    stations, together = scene.stations(at), port_groups(scene)
    system = assemble(scene, together)
    solver = differentiable(solver, system)
    if revolutions is None and turn is None and period is None:
        revolutions = _revolutions(scene, system, guess)
    if revolutions is None:
        aim = _free(scene, system, guess, turn, period, steps_per_revolution, solver, stations)
    else:
        check_counts(revolutions=revolutions)
        if turn is not None or period is not None:
            raise ValueError(
                "`revolutions` are the period, so they go without `turn` and `period`, which are for "
                "scenes without unbalance."
            )
        rate, whole = revolution_rate(scene, None), jnp.asarray(2 * jnp.pi)
        start = start_of(guess).state(system, stations[0])
        aim = _Aim(start, rate, whole, jnp.zeros(()), revolutions, steps_per_revolution)
    finder = optx.Newton(tolerance, tolerance) if finder is None else finder
    chosen: Any = choose(solver, system, aim.rate, aim.start)
    settings = chosen, together, finder, tolerance
    traced = not all(map(known, jax.tree.leaves((system, aim))))
    find = _COMPILED if traced else _COMPILED_QUICKLY
    with waiting(progress, "periodic orbit"):
        found = find(scene, system, stations, aim, *settings, max_iterations)
        failed = known(found.converged) and not bool(found.converged)
    if throw and failed:
        residual = float(found.residual)
        still = f"a period still misses {residual:.1e} of the state"
        raise RuntimeError(
            f"No orbit was found near the guess: after {int(found.iterations)} iterations "
            f"{still if math.isfinite(residual) else 'the state is beyond all bounds'}. Take a guess that "
            "has settled for longer (a chaotic motion settles on none, see `jaxrotor.lyapunov`), check "
            "`revolutions`, `turn` and `period`, or try `finder=optimistix.Dogleg(1e-10, 1e-10)`."
        )
    if not estimate:
        return found
    halved = dataclasses.replace(
        aim,
        start=found.start.state(system, stations[0]),
        span=aim.span if revolutions else aim.rate * found.period,
        steps=2 * aim.steps,
    )
    finer = find(scene, system, stations, halved, *settings, max_iterations)
    return dataclasses.replace(found, error=_changes(found, finer))


class _Aim(eqx.Module):
    """What is sought: from where, and of which period and turn."""

    start: tuple[Complex[Array, " n"], Complex[Array, " n"]]
    rate: Scalar  # [rad/s]
    span: Scalar  # [rad] of the guess, of a revolution where the period is given
    turn: Scalar  # [rad]
    revolutions: int | None = eqx.field(static=True)
    steps: int = eqx.field(static=True)


def _find(
    scene: Scene,
    system: System,
    stations: Float[Array, " s"],
    aim: _Aim,
    solver: Exponential,
    together: tuple[tuple[int, ...], ...],
    finder: Any,
    tolerance: float,
    max_iterations: int,
) -> PeriodicOrbit:
    plan = Plan(
        solver,
        None,
        dfx.ForwardMode(),
        aim.steps,
        aim.steps,
        slopes=False,
        contacts=True,
        coordinates=False,
        together=together,
    )
    shooting = Shooting.about(
        system,
        plan,
        stations,
        aim.rate,
        aim.span,
        aim.turn,
        aim.start,
        aim.revolutions,
    )
    root = optx.root_find(
        missed,
        finder,
        shooting.first,
        shooting,
        has_aux=True,
        max_steps=max_iterations,
        throw=False,
    )
    # The last trial is nearer to the root than the tolerance.
    change, jacobian, seen, outcome = again(root.value, shooting, root.aux)
    residual = jnp.max(jnp.abs(change))
    converged = (root.result == optx.RESULTS.successful) & (residual < 10 * tolerance)
    x = jnp.where(converged, root.value, jnp.nan)
    seen = jax.tree.map(lambda leaf: jnp.where(converged, joined(leaf), jnp.nan), seen)
    multipliers, trivial = shooting.multipliers(x, jnp.where(converged, jacobian, jnp.nan))
    (q, velocity), span = shooting.decode(x), shooting.length(x)
    period = shooting.revolutions * span / aim.rate
    turn = winding_angle(seen.displacement[:, 0], aim.turn)
    return PeriodicOrbit(
        start=Continued(q, velocity),
        period=period,
        turn=turn,
        whirl_rate=turn / (period * scene.spin.speed),
        multipliers=multipliers,
        trivial=trivial,
        time=jnp.linspace(0.0, period, seen.displacement.shape[0]),
        **seen._asdict(),
        stations=stations,
        residual=residual,
        iterations=root.stats["num_steps"],
        converged=converged,
        unresolved=outcome.unresolved,
        scene=scene,
        error=None,
        revolutions=aim.revolutions,
        steps=aim.steps,
        solver=solver_name(solver),
    )


_COMPILED = eqx.filter_jit(_find)
# By far the most of a single orbit's time is compilation, and optimised code is hardly faster.
_COMPILED_QUICKLY = eqx.filter_jit(_find, **QUICKLY)


def winding_angle(z: Complex[Array, " T"], turn: Scalar) -> Scalar:
    """The turn with all whole turns about the centre; not a number through the centre."""
    total = jnp.sum(jnp.angle(z[1:] * jnp.conj(z[:-1])))
    whole = jax.lax.stop_gradient(jnp.round((total - turn) / (2 * jnp.pi)))
    return jnp.where(jnp.any(z == 0), jnp.nan, turn + 2 * jnp.pi * whole)


def _changes(found: PeriodicOrbit, finer: PeriodicOrbit) -> OrbitError:
    apart = jnp.abs(found.multipliers[:, None] - finer.multipliers)
    return OrbitError(
        jnp.abs(finer.period - found.period),
        jnp.abs(finer.whirl_rate - found.whirl_rate),
        jnp.max(jnp.abs(finer.displacement[::2] - found.displacement)),
        jnp.max(jnp.min(apart, axis=1)),
    )


# === what is sought


def _revolutions(scene: Scene, system: System, guess: Any) -> int | None:
    """In a period, None where it is not given by the rotation."""
    if isinstance(guess, PeriodicOrbit):
        return guess.revolutions
    unbalance, speed = system.load.unbalance, scene.spin.speed
    if not system.ports:
        return 1
    if unbalance is None or (known(speed) and not float(speed)):
        return None
    return 1 if not known(unbalance) or bool(jnp.any(unbalance != 0)) else None


def _free(
    scene: Scene,
    system: System,
    guess: Any,
    turn: ArrayLike | None,
    period: ArrayLike | None,
    steps_per_revolution: int,
    solver: Exponential,
    stations: Float[Array, " s"],
) -> _Aim:
    """An orbit of a period of its own."""
    if not system.ports:
        raise ValueError(
            "A scene without contact is linear, so it has no period of its own to be found; look at "
            "`jaxrotor.roots`."
        )
    if isinstance(guess, PeriodicOrbit):
        turn = guess.turn if turn is None else turn
        period = guess.period if period is None else period
    elif period is None:
        if not isinstance(guess, Response):
            how = {"solver": solver, "start": start_of(guess), "at": stations}
            guess = simulate(scene, SEARCH, steps_per_revolution, **how)
        if not all(map(known, jax.tree.leaves((system, guess)))):
            raise ValueError(
                "A period is sought by values, so not inside jax.jit or a derivative; give an orbit that "
                "`periodic` found before as the guess, or `period` and `turn`."
            )
        count = order(scene, system)
        given = [float(jnp.asarray(turn))] if turn is not None else None
        allowed = given or [2 * math.pi * k / count for k in range(count)]
        period, turn = recurrence(guess, float(_rate(scene, 1.0)), allowed)
    turn = jnp.asarray(0.0 if turn is None else turn, float)
    broken = changes(scene, system, turn)
    if known(broken) and float(jnp.max(jnp.abs(broken))) > SAME:
        raise ValueError(_refusal(scene, system, turn))
    rate = _rate(scene, period)
    orbit = isinstance(guess, PeriodicOrbit)
    turns = _turns(guess.scene, guess.period) if orbit else _turns(scene, period)
    steps = max(LEAST, math.ceil(steps_per_revolution * turns * (1 - 1e-9)))
    start = start_of(guess).state(system, stations[0])
    return _Aim(
        start, rate, rate * jnp.asarray(period), nan_unless_symmetric(turn, broken), None, steps
    )


def _rate(scene: Scene, period: Any) -> Scalar:
    """`|Omega|`, or at zero speed 2 pi over a period."""
    speed = scene.spin.speed
    at_rest = known(speed) and not float(speed)
    return jnp.asarray(2 * jnp.pi / period) if at_rest else jnp.abs(speed)


def _turns(scene: Scene, period: Any) -> float:
    """Revolutions in a period, 1 at rest; of known values also inside jax.jit."""
    speed = scene.spin.speed
    if not (known(speed) and known(period)):
        raise ValueError(
            "Steps are counted by the period of the guess, which is being traced here; give an orbit of "
            "known values as the guess."
        )
    return abs(float(speed)) * float(period) / (2 * math.pi) or 1.0


def start_of(guess: Any, name: str = "guess") -> AbstractStart:
    """State that a guess, or an argument of another name, stands for."""
    if isinstance(guess, Response):
        return guess.end
    if isinstance(guess, PeriodicOrbit):
        return guess.start
    if isinstance(guess, AbstractStart):
        return guess
    raise ValueError(
        f"`{name}` must be a response of jaxrotor.simulate, an orbit or a start such as AtRest(), but is "
        f"{guess!r}."
    )


def _refusal(scene: Scene, system: System, turn: Scalar) -> str:
    unbalance, degrees = system.load.unbalance, math.degrees(float(turn))
    if unbalance is not None and bool(jnp.any(unbalance != 0)):
        return (
            "A scene with unbalance repeats itself after whole revolutions, so it takes `revolutions` "
            "and no `turn` or `period`; or set the eccentricity to 0."
        )
    count = order(scene, system)
    same = f"a turn of {360 / count:g} degrees" if count > 1 else "whole turns alone"
    return (
        f"`turn` must leave the scene as it is, but one of {degrees:g} degrees does not: stops that are "
        f"equal but for their angles, and weight, allow {same}."
    )
