"""Classify: the kind of motion in which every lane of a sweep ends, claimed where it can be shown."""

import dataclasses
from collections.abc import Callable
from typing import Any, NamedTuple

import diffrax as dfx
import jax.numpy as jnp
import numpy as np
import xarray as xr
from jaxtyping import Bool, Complex, Float, Int
from scipy import stats

from ..core.attributes import about, flags
from ..core.checks import check_counts
from ..core.outcome import failed, too_long
from ..core.parallel import Threads, chunk_size, cores, first_alone
from ..core.progress import progress as bar, segments
from ..equations.system import assemble
from ..files.toml import loads
from ..motion.base import Plan
from ..motion.revolutions import check_constant, revolution_rate
from ..orbits.lyapunov import BLOCKS, mean_and_error, taper
from ..orbits.shooting import differentiable
from ..results.provenance import check_repeatable, period_of, start_and_solver
from ..scene import Scene
from ..solvers.exponential import Exponential
from .axes import shared_ports
from .followed import Followed, follow, polish, returns
from .job import STEPS_IN_SINGLE
from .lanes import Context, Stages


MOTIONS = ("periodic", "quasi_periodic", "chaotic", "transient", "undecided", "failed")
PERIODIC, QUASI_PERIODIC, CHAOTIC, TRANSIENT, UNDECIDED, FAILED = range(len(MOTIONS))
NEAR = 1e-3  # of the state: a motion that returns at least as near may be periodic
CLOSED = 1e-8  # of the state: what an orbit may miss after its period
FAR = 0.2  # of the state: an orbit that attracts a motion from further away is another motion
TRIES = 3  # periods of a lane for which an orbit is sought
REGULAR = 1e-5  # change of weighted averages from one half of a regular run to the other
STILL, ZERO = (
    2e-3,
    1e-6,
)  # growth in a revolution of a regular motion: at most, and what is rounding
MARGIN = 1e-7  # of the multiplier of an orbit that attracts, below 1
BOUNDED = 10.0  # times the largest distance of the first half: a motion that goes further grows
GROWN = 10.0  # logarithm of the growth of a disturbance in half of a run that no regular motion has
CONFIDENCE = 0.95  # of the bounds of an exponent


def classify(
    dataset: xr.Dataset,
    revolutions: int = 1000,
    *,
    longest: int = 8,
    steps_per_revolution: int = 64,
    solver: Exponential | None = None,
    confirm: bool = True,
    lanes_per_chunk: int = 128,
    workers: int | None = None,
    progress: bool | None = None,
) -> xr.Dataset:
    """Kind of motion of every lane of a sweep: periodic, quasi-periodic, chaotic, transient or undecided.

        periodic         F^p(y) = y by Newton's method, near the lane, all |multipliers| < 1
        quasi-periodic   averages converge, the bounds of the largest exponent include zero
        chaotic          a disturbance grows e^10 times in either half, averages do not converge,
                         and the motion does not grow

    Every lane is run again to the end of its sweep, and then followed for `revolutions` from there, by
    steps that know the derivative of contact. A motion is "transient" where it is on its way to a
    periodic orbit, or where it was chaotic in the first half of the run alone. What none of these can be
    shown for is "undecided", and so is a lane whose kind is another with twice the steps. Numbers are
    those of the finer run. Kinds are those of the map over a revolution: without an unbalance, a motion
    with a period of its own is quasi-periodic. Chaos may end after the run: `jaxrotor.escapes` tells how
    long it lasts.

    Args:
        dataset: sweep by `Exponential` at constant speed, without `carry`; only its settings are used.
        revolutions: that are followed, 200 or more.
        longest: period that is sought [revolutions].
        steps_per_revolution: of the steps that follow.
        solver: of these, by default `Exponential(4, located=True)`; sharp stops take located steps.
        confirm: whether lanes are followed again with twice the steps.
        lanes_per_chunk: lanes run as one program.
        workers: chunks run at once, by default one a core.
        progress: whether to show a progress bar; by default on a terminal.

    Returns:
        The data set with `motion`, the kind; `orbit_period` [revolutions] and `multiplier`, the largest
        modulus, of periodic lanes; `rotation`, turns about the centre in a revolution, and
        `rotation_error` of regular ones; `exponent` [1/s] with `exponent_low` and `exponent_high`, bounds
        of 95 %, of all. Its attribute `withdrawn` is the number of claims that twice the steps
        contradicted. Not differentiable.

    Raises:
        ValueError: if the data set cannot be run again, or an argument is out of its range.

    Source: rotation numbers by weighted averages: Das, Saiki, Sander, Yorke (2017), Nonlinearity 30, 4111;
    as a test of chaos: Sander, Meiss (2020), Physica D 411, 132569.
    """
    check_counts(revolutions=revolutions, longest=longest, lanes_per_chunk=lanes_per_chunk)
    check_counts(steps_per_revolution=steps_per_revolution)
    if revolutions < 20 * BLOCKS:
        raise ValueError(
            f"`revolutions` must be at least {20 * BLOCKS} to tell motions apart, but is {revolutions}."
        )
    check_repeatable(dataset, "classified", "have no revolutions to classify.")
    solver = Exponential(4, located=True) if solver is None else solver
    first, points = _context(dataset)
    context = _following(first, solver, steps_per_revolution)
    size = chunk_size(len(points), lanes_per_chunk, cores(workers))
    chunks = [np.arange(i, min(i + size, len(points))) for i in range(0, len(points), size)]
    programs = first_alone(follow), first_alone(returns), first_alone(polish)
    settings = points, size, revolutions, longest, confirm
    run = Run(first, context, Stages.fresh(), *programs, *settings)
    total = len(points) * (first.settle + (1 + confirm) * revolutions)
    with bar(progress, total, f"{len(points)} lanes", "lane-revolutions") as tick:
        parts = Threads(cores(workers)).each(run.claims, chunks, tick)
    found = Claims(*map(np.concatenate, zip(*(part[0] for part in parts), strict=True)))
    lost = failed(dataset["status"].values).ravel()
    found = found._replace(motion=np.where(lost, FAILED, found.motion))
    return _dataset(dataset, first, found, sum(part[1] for part in parts))


class Claims(NamedTuple):
    """Claims about lanes, each (lanes,)."""

    motion: Int[np.ndarray, " l"]  # number in `MOTIONS`
    period: Int[np.ndarray, " l"]  # revolutions, 0 where it is not periodic
    multiplier: Float[np.ndarray, " l"]  # largest modulus
    rotation: Float[np.ndarray, " l"]
    rotation_error: Float[np.ndarray, " l"]
    exponent: Float[np.ndarray, " l"]  # a revolution
    error: Float[np.ndarray, " l"]  # standard error of it


# === before the run


def _context(dataset: xr.Dataset) -> tuple[Context, Float[np.ndarray, "l p"]]:
    """Settings of the lanes of a data set, without observables, and the values of each."""
    attributes, status = dataset.attrs, dataset["status"]
    scene, (start, solver) = loads(attributes["scene"]), start_and_solver(attributes)
    check_constant(scene, "`classify`")
    coords = [str(name) for name in status.coords if "." in str(name)]
    columns = {path: status[path].broadcast_like(status).values.ravel() for path in coords}
    period = period_of(attributes)
    steps = int(attributes["steps_per_revolution"])
    plan = _plan(scene, columns, solver, steps)
    settle = int(attributes["settle"]) + int(attributes["keep"])
    lanes = scene, start, tuple(columns), plan, jnp.asarray(float(attributes["station"])), period
    in_single = attributes["precision"] == STEPS_IN_SINGLE
    context = Context(*lanes, (), settle, 0, in_single=in_single)
    return context, np.column_stack(list(columns.values()))


def _plan(scene: Scene, columns: dict[str, np.ndarray], solver: Exponential, steps: int) -> Plan:
    """The plan of the sweep, without what its observables read."""
    together = shared_ports(scene, {path: np.unique(values) for path, values in columns.items()})
    return Plan(
        solver,
        None,
        dfx.ForwardMode(),
        steps,
        steps,
        slopes=False,
        coordinates=False,
        contacts=False,
        together=together,
        batch=True,
    )


def _following(context: Context, solver: Exponential, steps: int) -> Context:
    """The context with steps whose derivatives include changes of contact."""
    solver = differentiable(solver, assemble(context.scene))
    plan = dataclasses.replace(
        context.plan, solver=solver, steps=steps, max_steps=steps, batch=False
    )
    return dataclasses.replace(context, plan=plan)


# === the run


class Run(NamedTuple):
    """Settings by which chunks of lanes are followed, and the programs that all chunks share."""

    first: Context  # of the sweep, up to its end
    context: Context  # of the run after it
    stages: Stages
    follow: Callable
    returns: Callable
    polish: Callable
    points: Float[np.ndarray, "l p"]
    size: int  # lanes of a program
    revolutions: int
    longest: int
    confirm: bool

    def claims(
        self, lanes: Int[np.ndarray, " c"], tick: Callable[[int], None]
    ) -> tuple[Claims, int]:
        """Claims about some lanes, by their numbers, and how many claims were withdrawn."""
        count, stages = len(lanes), self.stages
        points = self.points[np.append(lanes, np.repeat(lanes[-1:], self.size - count))]
        shared, own, y, _ = stages.prepare(self.first, points, None)
        for part in segments(self.first.settle):
            y, _ = stages.skip(shared, own, y, jnp.asarray(part))
            tick(count * part)
        begin = tuple(map(np.asarray, stages.decode(shared, own, y)))
        steps = self.context.plan.steps
        found, end = self._followed(points, steps, begin)
        tick(count * self.revolutions)
        withdrawn = np.zeros(self.size, bool)
        if self.confirm:
            finer, _ = self._followed(points, 2 * steps, end)
            tick(count * self.revolutions)
            found, withdrawn = _confirmed(found, finer)
        return Claims(*(leaf[:count] for leaf in found)), int(withdrawn[:count].sum())

    def _followed(self, points: np.ndarray, steps: int, begin: Any) -> tuple[Claims, Any]:
        """Claims by so many steps from a state, and the state at the end of the run."""
        plan = dataclasses.replace(self.context.plan, steps=steps, max_steps=steps)
        context = dataclasses.replace(self.context, plan=plan)
        shared, own, y, ratio = self.stages.prepare(context, points, begin)
        followed = self.follow(shared, own, y, self.revolutions)
        end = tuple(map(np.asarray, self.stages.decode(shared, own, followed.y)))
        found = _claims(self, followed, shared, own)
        solver: Any = plan.solver
        overlong = np.asarray(followed.outcome.touched) & too_long(ratio, solver.order)
        overlong &= found.motion != FAILED  # steps too long for a stop may make chaos of their own
        return found._replace(motion=np.where(overlong, UNDECIDED, found.motion)), end


def _confirmed(found: Claims, finer: Claims) -> tuple[Claims, Bool[np.ndarray, " l"]]:
    """Claims with the numbers of the finer run, and which it contradicts: these are undecided."""
    same = (finer.motion == found.motion) & (finer.period == found.period)
    same |= (found.motion == TRANSIENT) & np.isin(finer.motion, (PERIODIC, QUASI_PERIODIC))
    withdrawn = ~same & (found.motion < UNDECIDED)
    motion = np.where(withdrawn, UNDECIDED, found.motion)
    return finer._replace(motion=np.where(finer.motion == FAILED, FAILED, motion)), withdrawn


def _claims(run: Run, followed: Followed, shared: Any, own: Any) -> Claims:
    """Claims about lanes that were followed."""
    growth, turned, section = map(np.asarray, followed[2:])
    exponent, error = mean_and_error(growth.T)
    rotation, change = _average(turned)
    half = growth.shape[1] // 2
    early, late = growth[:, :half].sum(axis=1), growth[:, -half:].sum(axis=1)
    smooth = (change < REGULAR) & _converges(section)
    regular = smooth & (np.abs(exponent) < np.minimum(_quantile() * error + ZERO, STILL))
    before, after = (np.abs(part).max(axis=1) for part in (section[:, :half], section[:, -half:]))
    chaotic = ~smooth & (early > GROWN) & (late > GROWN) & (after < BOUNDED * before)
    motion = np.full(len(growth), UNDECIDED)
    motion[(early > GROWN) & (late < 0)] = TRANSIENT
    motion[chaotic] = CHAOTIC
    distances = np.asarray(run.returns(shared, own, followed.y, run.longest))  # (lanes, longest)
    motion[regular & (distances.min(axis=1) > CLOSED)] = QUASI_PERIODIC
    period, multiplier = np.zeros(len(growth), int), np.full(len(growth), np.nan)
    for candidate in _candidates(distances).T:
        tried = np.where(((late < 0) | regular) & (period == 0), candidate, 0)
        for p in np.unique(tried[tried > 0]):
            orbits = run.polish(shared, own, followed.y, jnp.asarray(p))
            miss, shift, largest = map(np.asarray, orbits[1:])
            closed = (tried == p) & (miss < CLOSED) & (largest < 1 - MARGIN)
            here = closed & (shift < NEAR)
            motion[closed & ~here & (shift < FAR) & (late < -1) & ~regular] = TRANSIENT
            if here.any():
                back = np.asarray(run.returns(shared, own, orbits.y, run.longest)) < CLOSED
                least = 1 + np.argmax(back, axis=1)  # of which `p` is a multiple
                motion[here], period[here] = PERIODIC, least[here]
                multiplier[here] = largest[here] ** (least[here] / p)
    motion = np.where(np.asarray(followed.outcome.ok), motion, FAILED)
    for k in np.flatnonzero(motion == PERIODIC):  # of the last periods, not of what led there
        last, former = turned[k, -period[k] :].mean(), turned[k, -2 * period[k] : -period[k]].mean()
        rotation[k], change[k] = last, abs(last - former)
    return Claims(motion, period, multiplier, rotation, change, exponent, error)


def _converges(section: Complex[np.ndarray, "l R"]) -> Bool[np.ndarray, " l"]:
    """Whether averages of displacements at the ends of revolutions converge, over their spread."""
    apart = section - section.mean(axis=1, keepdims=True)
    spread = np.sqrt(np.mean(np.abs(apart) ** 2, axis=1))
    rounding = np.finfo(float).eps * np.abs(section).max(axis=1)
    changes = [_average(part)[1] for part in (apart.real, apart.imag, np.abs(apart) ** 2)]
    limits = [REGULAR * spread + rounding] * 2 + [REGULAR * spread**2 + rounding**2]
    return np.all([c <= limit for c, limit in zip(changes, limits, strict=True)], axis=0)


def _candidates(distances: Float[np.ndarray, "l p"]) -> Int[np.ndarray, "l t"]:
    """Periods of which orbits are sought: those of near returns, the shortest first, else the nearest.

    0 where there are no more.
    """
    near = distances < NEAR
    order = np.argsort(~near, axis=1, kind="stable")[:, :TRIES]
    found = np.where(np.take_along_axis(near, order, 1), order + 1, 0)
    found[:, 0] = np.where(near.any(axis=1), found[:, 0], np.argmin(distances, axis=1) + 1)
    return found


def _quantile() -> float:
    """Standard errors of the mean of blocks to the bounds."""
    return float(stats.t.ppf((1 + CONFIDENCE) / 2, BLOCKS - 1))


def _average(values: Float[np.ndarray, "l R"]) -> tuple[np.ndarray, np.ndarray]:
    """Weighted averages over revolutions, and their change from the first half to the second."""
    mean = lambda part: part @ taper(part.shape[1])
    half = values.shape[1] // 2
    return mean(values), np.abs(mean(values[:, :half]) - mean(values[:, -half:]))


# === data


def _dataset(dataset: xr.Dataset, first: Context, found: Claims, withdrawn: int) -> xr.Dataset:
    """The data set with the claims of all lanes."""
    status = dataset["status"]
    of = lambda values, attrs: (status.dims, np.reshape(values, status.shape), attrs)
    if "spin.speed" in status.coords:
        speeds = np.abs(status["spin.speed"].broadcast_like(status).values.ravel())
        rate = np.where(speeds > 0, speeds, np.nan)
    else:
        rate = float(revolution_rate(first.scene, first.period))
    each = rate / (2 * np.pi)  # revolutions a second
    half, exponent = _quantile() * found.error, found.exponent
    regular = np.isin(found.motion, (PERIODIC, QUASI_PERIODIC))
    periodic = found.motion == PERIODIC
    smallest = np.finfo(float).tiny  # a multiplier may be zero
    of_orbit = np.log(np.where(periodic, np.maximum(found.multiplier, smallest), 1.0))
    exponent = np.where(periodic, of_orbit / np.maximum(found.period, 1), exponent)
    half = np.where(periodic, 0.0, half)
    shown = np.where(found.motion == FAILED, np.nan, 1.0) * each
    only = lambda chosen, values: np.where(chosen, values, np.nan)
    turns, growth = "turns about the centre in a revolution", "largest Lyapunov exponent"
    return dataset.assign(
        motion=of(found.motion.astype(np.int8), flags("kind of motion", MOTIONS)),
        orbit_period=of(np.where(periodic, found.period, 0), about("1", "revolutions in a period")),
        multiplier=of(
            only(periodic, found.multiplier), about("1", "largest modulus of a multiplier")
        ),
        rotation=of(only(regular, found.rotation), about("1", turns)),
        rotation_error=of(only(regular, found.rotation_error), about("1", f"change of {turns}")),
        exponent=of(shown * exponent, about("1/s", growth)),
        exponent_low=of(shown * (exponent - half), about("1/s", f"{growth}, lower bound")),
        exponent_high=of(shown * (exponent + half), about("1/s", f"{growth}, upper bound")),
    ).assign_attrs(withdrawn=withdrawn)
