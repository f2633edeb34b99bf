"""Lyapunov: the rates at which neighbouring motions diverge."""

from collections.abc import Callable
from typing import Any

import diffrax as dfx
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from ..core import linalg
from ..core.checks import check_counts
from ..core.outcome import Outcome
from ..core.progress import progress as bar, segments
from ..core.tables import notebook_table
from ..effects.base import AbstractContact
from ..equations.start import AbstractStart, AtRest
from ..equations.system import assemble, port_groups
from ..motion.rebounds import Rebounds, in_revolutions
from ..motion.revolutions import March, check_constant, revolution_rate
from ..scene import Scene
from ..solvers.choice import choose, solver_name
from ..solvers.exponential import Exponential
from .guess import start_of
from .memory import check_returning, start_on, state_in, steps_for_states
from .passes import cycle_of, cycle_rate, with_cycle
from .shooting import differentiable, plan_of


BLOCKS = 10  # parts of the run, whose means give the error


class Lyapunov(eqx.Module):
    """`lim ln |dz(t)| / t`, mean exponential growth of `e` independent small disturbances."""

    exponents: Float[Array | np.ndarray, " e"]  # [1/s], largest first
    error: Float[Array | np.ndarray, " e"]  # standard error, see `lyapunov` [1/s]
    growth: Float[Array | np.ndarray, "R e"]  # in every revolution [1/s]
    unresolved: Int[Array, ""]  # steps whose changes of contact were not located
    end: AbstractStart  # state to continue from
    period: float = eqx.field(static=True)  # of a revolution, or a pass [s]
    scene: Scene
    steps: int = eqx.field(static=True)  # in a revolution
    solver: str = eqx.field(static=True)

    @property
    def running(self) -> Float[np.ndarray, "R e"]:
        """Mean growth from the first revolution to each later one [1/s]."""
        growth = np.asarray(self.growth)
        return np.cumsum(growth, axis=0) / np.arange(1, len(growth) + 1)[:, None]

    def _repr_html_(self) -> str:
        pairs = zip(np.asarray(self.exponents), np.asarray(self.error), strict=True)
        return notebook_table(str(self), ("exponent [1/s]", "standard error [1/s]"), list(pairs))

    def __str__(self) -> str:
        pairs = zip(np.asarray(self.exponents), np.asarray(self.error), strict=True)
        rates = ", ".join(f"{rate:.5g} +- {error:.2g}" for rate, error in pairs)
        return (
            f"Lyapunov exponents {rates} 1/s over {len(self.growth)} revolutions of {self.steps} "
            f"steps, {self.solver}"
        )


def lyapunov(
    scene: Scene,
    start: Any = None,
    revolutions: int = 1000,
    *,
    count: int = 1,
    settle: int = 200,
    steps_per_revolution: int = 64,
    solver: Exponential | dfx.AbstractSolver | None = None,
    period: float | None = None,
    seed: int = 0,
    progress: bool | None = None,
) -> Lyapunov:
    """Largest Lyapunov exponents `lim ln |dz(t)| / t` of a motion, `count` of them.

    Small disturbances follow the derivative of every step, jumps at changes of contact included, and
    are made orthonormal after every revolution; the exponents are the means of the logarithms of their
    growth. A positive exponent means chaos. Zero belongs to a motion along itself, of a scene without
    unbalance, or to a motion of two periods; angles of several shafts are not disturbed. Of a scene
    without contact they are the real parts of the roots.

    Args:
        scene: the rotor, at constant speed. Runs of other values of the same scene reuse the program.
        start: state to begin with, end of a `TimeHistory`, or an orbit; by default `AtRest()`.
        revolutions: over which the growth is averaged; in rolling bearings without unbalance passes of
            their balls, as in `periodic`.
        count: number of exponents, up to four a coordinate and one a state of a law.
        settle: revolutions before the average; in the last half of them the disturbances already turn
            into their directions.
        steps_per_revolution: of the shaft, or in a pass; more where states of laws change faster.
        solver: `Exponential(4, located=True)` by default. Sharp stops take located steps.
        period: length of a "revolution" at zero speed [s].
        seed: of the first disturbances.
        progress: whether to show a progress bar; by default on a terminal.

    Returns:
        A `Lyapunov`, not differentiable. The means have a smooth weight, so they converge fast for
        periodic and quasi-periodic motion. `error` is the standard deviation of the means of 10 blocks
        over the root of 10, which is right for chaos where a block is independent of the one before.
        An exponent is -inf, without an error, where a disturbance shrinks in a revolution to rounding
        beside the fastest.

    Raises:
        ValueError: if an argument is out of its range or of another type, the speed is not constant, or
            a state of a law only grows, as wear does.
        RuntimeError: if the motion does not stay finite, or a stop is too stiff for the steps.

    Source: Benettin, Galgani, Giorgilli, Strelcyn (1980), Meccanica 15, 9-30; jumps: Mueller (1995),
    Chaos, Solitons and Fractals 5, 1671-1681; weights: Das, Saiki, Sander, Yorke (2017), Nonlinearity
    30, eq. (2).
    """
    solver = Exponential(4, located=True) if solver is None else solver
    check_counts(revolutions=revolutions, count=count, steps_per_revolution=steps_per_revolution)
    check_counts(0, settle=settle)
    _check_length(revolutions, period)
    check_constant(scene, "`lyapunov`", memory=True)
    asked, (scene, station) = scene, scene.to_simulate(in_time=False)
    together = port_groups(scene)
    system = assemble(scene, together)
    passes = cycle_of(scene, system, "`lyapunov`").passes
    system = with_cycle(system, passes)
    start = AtRest() if start is None else start_of(start, "start", system.state_count)
    if count > (most := 4 * system.n + system.state_count):
        own = " and one a state of a law" if system.state_count else ""
        raise ValueError(f"`count` must be at most {most}, four a coordinate{own}, but is {count}.")
    rate = cycle_rate(system, passes) if passes else revolution_rate(scene, period)
    chosen: Any = choose(differentiable(solver, system), system, rate, start)
    several = len(scene.of(AbstractContact)) > 1  # of which some may never be touched
    steps = steps_for_states(system, steps_per_revolution, 2 * jnp.pi / rate)
    plan = plan_of(chosen, together, steps, contacts=several)
    march = eqx.filter_jit(March.of)(system, plan, rate, station[:1])
    y = march.begin(start, station[0])
    aligned = settle - settle // 2
    with bar(progress, settle + revolutions, f"{count} exponents", "revolutions") as tick:
        y, good = _skip(march, y, jnp.asarray(settle - aligned))
        tick(settle - aligned)
        # Turns of further shafts, the last numbers of a state, are not disturbed.
        disturbances = random_disturbances(y.size - len(system.others), count, seed)
        disturbances = jnp.pad(disturbances, ((0, len(system.others)), (0, 0)))
        growths, loads, states = [], [], []
        for segment in segments(aligned) + segments(revolutions):
            y, disturbances, (growth, loaded, own), ok = _follow(march, y, disturbances, segment)
            good = good & ok
            growths.append(np.asarray(growth))
            loads.append(loaded)
            states.append(np.asarray(own))
            tick(segment)
    if not bool(good.ok):
        raise RuntimeError(
            "The motion did not stay finite: take more `steps_per_revolution`, or look at "
            "`jaxrotor.roots` for growth."
        )
    force = None
    if several:
        ever, always = np.moveaxis(np.concatenate(loads), 1, 0)
        force = np.stack([ever.any(0), always.all(0)])
    stops = Rebounds(scene, system.members, good.touched, march.contact_stiffness_ratio, force)
    stops.check(chosen, in_revolutions(steps))
    check_returning(scene, np.concatenate(states)[aligned:])
    length = 2 * np.pi / float(rate)
    growth = np.concatenate(growths)[aligned:] / length
    exponents, error = largest_first(*mean_and_error(growth), length)
    return Lyapunov(
        exponents,
        error,
        growth,
        good.unresolved,
        start_on(*state_in(march, y)),
        length,
        asked,
        steps,
        solver_name(chosen),
    )


def _check_length(revolutions: int, period: Any) -> None:
    """Raise unless revolutions are those of the first shaft, and enough for an error."""
    if isinstance(period, str):
        raise ValueError(
            f"Exponents are by revolutions of the first shaft, so `period` is for zero speed only, but is "
            f"{period!r}."
        )
    if revolutions < 2 * BLOCKS:
        raise ValueError(
            f"`revolutions` must be at least {2 * BLOCKS} to estimate an error, but is {revolutions}."
        )


def random_disturbances(size: int, count: int, seed: int) -> Float[Array, "m e"]:
    """Orthonormal disturbances of a state of `size` numbers."""
    drawn = np.random.default_rng(seed).standard_normal((size, count))
    return jnp.asarray(np.linalg.qr(drawn)[0])


def advance_disturbed(
    advance: Callable[[Array], tuple[Array, Any]], y: Array, disturbances: Float[Array, "m e"]
) -> tuple[Array, Float[Array, "m e"], Float[Array, " e"], Any]:
    """Next state of a map, orthonormal disturbances, their growth, and what else the map returns."""
    push = lambda tangent: jax.jvp(advance, (y,), (tangent.reshape(y.shape),), has_aux=True)
    y, moved, outcome = jax.vmap(push, in_axes=-1, out_axes=(None, -1, None))(disturbances)
    moved = moved.reshape(disturbances.shape)
    if disturbances.shape[1] == 1:
        size = linalg.norm(moved, axis=0)
        left = size > 0  # a disturbance may shrink to nothing in a step of the map
        size = jnp.where(left, size, jnp.finfo(size.dtype).tiny)
        return y, jnp.where(left, moved / size, disturbances), jnp.log(size), outcome
    disturbances, triangle = linalg.qr(moved)
    return y, disturbances, jnp.log(jnp.abs(jnp.diagonal(triangle))), outcome


def mean_and_error(growth: Float[Array | np.ndarray, "R e"]) -> tuple[Any, Any]:
    """Mean over revolutions, and its standard error by the means of blocks.

    The weight rises and falls smoothly over the first and the last quarter, so that what oscillates with
    the phase of a periodic motion cancels faster than by 1 / revolutions.
    """
    length = len(growth) // BLOCKS
    blocks = growth[len(growth) - BLOCKS * length :].reshape(BLOCKS, length, -1)
    means = (taper(length)[:, None] * blocks).sum(axis=1)
    return taper(len(growth)) @ growth, means.std(axis=0, ddof=1) / BLOCKS**0.5


def largest_first(exponents, error, length: float) -> tuple[np.ndarray, np.ndarray]:
    """Exponents in order; -inf, without an error, where they are but rounding beside the largest."""
    floor = exponents.max() + 0.9 * np.log(np.finfo(float).eps) / length
    lost = exponents < floor
    exponents, error = np.where(lost, -np.inf, exponents), np.where(lost, np.nan, error)
    order = np.argsort(-exponents, kind="stable")
    return exponents[order], error[order]


def taper(length: int) -> Float[np.ndarray, " R"]:
    """Weights of sum 1 that rise from 0 and fall to 0 with all derivatives."""
    t = (np.arange(length) + 0.5) / length
    ramp = np.minimum(1.0, 4 * np.minimum(t, 1 - t))
    falls = np.divide(1.0, 1 - ramp, out=np.full(length, np.inf), where=ramp < 1)
    weight = 1 / (1 + np.exp(np.minimum(1 / ramp - falls, 700.0)))
    return weight / weight.sum()


@eqx.filter_jit
def _skip(march: March, y: Array, revolutions: Int[Array, ""]):
    return march.skip(y, revolutions)


@eqx.filter_jit
def _follow(march: March, y: Array, disturbances: Float[Array, "m e"], revolutions: int):
    """State, disturbances, growth with loads of contacts, ever and always, and outcome of revolutions."""

    def advance(y):
        if not march.plan.contacts:
            y, ok = march.skip(y, 1)
            return y, (ok, None)
        y, window, ok = march.observe(y)
        loaded = window.contact_force != 0
        return y, (ok, jnp.stack([loaded.any(0), loaded.all(0)]))

    def one(carry, _):
        y, disturbances, good = carry
        y, disturbances, growth, (ok, loaded) = advance_disturbed(advance, y, disturbances)
        own = y[y.size - march.beside : y.size - len(march.system.others)]
        return (y, disturbances, good & ok), (growth, loaded, own)

    begin = y, disturbances, Outcome.good()
    (y, disturbances, good), seen = jax.lax.scan(one, begin, None, length=revolutions)
    return y, disturbances, seen, good
