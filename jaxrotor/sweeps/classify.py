"""Classify: the kind of motion in which every lane of a sweep ends, claimed where it can be shown."""

import dataclasses
from collections.abc import Callable
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
import xarray as xr
from jaxtyping import Float, Int

from ..core.attributes import about, flags
from ..core.checks import check_counts
from ..core.outcome import failed, too_long
from ..core.parallel import Threads, chunk_size, cores, first_alone
from ..core.progress import progress as bar, segments
from ..equations.system import structure
from ..motion.rebounds import counted
from ..motion.revolutions import revolution_rate
from ..orbits.lyapunov import BLOCKS
from ..results.provenance import check_repeatable
from ..solvers.exponential import Exponential
from .claims import (
    CHAOTIC,
    CONFIDENCE,
    FAILED,
    MOTIONS,
    PERIODIC,
    REGULAR_KINDS,
    UNDECIDED,
    Claims,
    claims_of,
    confirmed,
    quantile,
)
from .followed import follow, polish, returns
from .lanes import Context, Stages
from .rerun import rerun


def classify(
    dataset: xr.Dataset,
    revolutions: int = 1000,
    *,
    longest: int = 8,
    steps_per_revolution: int = 64,
    solver: Exponential | None = None,
    confirm: bool = True,
    repeats: int = 40,
    lanes_per_chunk: int = 32,
    workers: int | None = None,
    progress: bool | None = None,
) -> xr.Dataset:
    """Kind of motion of every lane of a sweep: periodic, quasi-periodic, chaotic, transient or undecided.

        periodic         F^p(y) = y by Newton's method, near the lane, all |multipliers| < 1
        quasi-periodic   averages converge, the bounds of the largest exponent include zero
        chaotic          a disturbance grows e^10 times in either half, averages do not converge,
                         the motion does not grow, and it ends in none of `repeats` further runs

    Every lane is run again to the end of its sweep, and then followed for `revolutions` from there, by
    steps that know the derivative of contact, and on from there with twice the steps. A motion is
    "transient" where it is on its way to a periodic orbit, or where its chaos ends, in the run or in a
    repeated one. What none of these can be shown for is "undecided", and so is a lane whose kind is
    another with twice the steps. Numbers are those of the finer run. Kinds are those of the map over a
    revolution: without an unbalance, a motion with a period of its own is quasi-periodic. In rolling
    bearings without unbalance a pass of the balls counts as a revolution; where forces are never again
    what they were, the angle that laws count is part of the state, and no motion is periodic. A motion in
    which a state of a law goes on in one sense, as wear does, is undecided.

    Chaos that has lasted for `T` revolutions may end later. Since escape from a chaotic saddle is
    exponential, the mean lifetime is above `-T / log(0.05)` with a one-sided confidence of 95 %. What is
    followed last after the further runs, which take the steps of the sweep, tells whether it has ended.

    Args:
        dataset: sweep by `Exponential` at constant speed, without `carry`; only its settings are used. Of
            laws with states or by turns, which sweeps integrate, lanes take the steps that follow from
            their start on.
        revolutions: that are followed, 200 or more.
        longest: period that is sought [revolutions].
        steps_per_revolution: of the steps that follow, or in a pass; more where states of laws change
            faster.
        solver: of these, by default `Exponential(4, located=True)`; sharp stops take located steps.
        confirm: whether lanes are followed again with twice the steps.
        repeats: further runs that chaos must survive, one after another, by the steps of the sweep.
        lanes_per_chunk: lanes run as one program; in larger ones all wait longer for the lane whose step
            meets most impacts.
        workers: chunks run at once, by default one a core.
        progress: whether to show a progress bar; by default on a terminal.

    Returns:
        The data set with `motion`, the kind; `orbit_period` [revolutions] and `multiplier`, the largest
        modulus, of periodic lanes; `rotation`, turns about the centre in a revolution, and
        `rotation_error` of regular ones; `exponent` [1/s] with `exponent_low` and `exponent_high`, bounds
        of 95 %, of all. Its attributes are `withdrawn`, the number of claims that twice the steps
        contradicted, and `lifetime_low`, the lower bound of the mean lifetime of what is called chaotic
        [revolutions]. Not differentiable.

    Raises:
        ValueError: if the data set cannot be run again, or an argument is out of its range.

    Source: rotation numbers by weighted averages: Das, Saiki, Sander, Yorke (2017), Nonlinearity 30, 4111;
    as a test of chaos: Sander, Meiss (2020), Physica D 411, 132569; lifetimes: Lai, Tel (2011), Transient
    Chaos, section 1.2.
    """
    check_counts(revolutions=revolutions, longest=longest, lanes_per_chunk=lanes_per_chunk)
    check_counts(steps_per_revolution=steps_per_revolution)
    check_counts(0, repeats=repeats)
    if revolutions < 20 * BLOCKS:
        raise ValueError(
            f"`revolutions` must be at least {20 * BLOCKS} to tell motions apart, but is {revolutions}."
        )
    check_repeatable(dataset, "classified", "have no revolutions to classify.")
    solver = Exponential(4, located=True) if solver is None else solver
    first, context, points, turns = rerun(dataset, solver, steps_per_revolution)
    size = chunk_size(len(points), lanes_per_chunk, cores(workers))
    chunks = [np.arange(i, min(i + size, len(points))) for i in range(0, len(points), size)]
    programs = first_alone(follow), first_alone(returns), first_alone(polish)
    settings = points, size, revolutions, longest, confirm, repeats
    run = Run(first, context, Stages.fresh(), *programs, *settings)
    total = len(points) * (first.settle + (1 + confirm + repeats) * revolutions)
    with bar(progress, total, f"{len(points)} lanes", "lane-revolutions") as tick:
        parts = Threads(cores(workers)).each(run.claims, chunks, tick)
    found = Claims(*map(np.concatenate, zip(*(part[0] for part in parts), strict=True)))
    lost = failed(dataset["status"].values).ravel()
    found = found._replace(motion=np.where(lost, FAILED, found.motion))
    lasted = revolutions * (2 + repeats if repeats else 1 + confirm)
    claims = _dataset(dataset, first, turns, found)
    return claims.assign_attrs(
        withdrawn=sum(part[1] for part in parts),
        lifetime_low=lasted / -np.log(1 - CONFIDENCE),
    )


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
    repeats: int

    def claims(
        self, lanes: Int[np.ndarray, " c"], tick: Callable[[int], None]
    ) -> tuple[Claims, int]:
        """Claims about some lanes, by their numbers, and how many claims were withdrawn."""
        count = len(lanes)
        points = self.points[np.append(lanes, np.repeat(lanes[-1:], self.size - count))]
        begin = self._skipped(points, self.first.settle, None, lambda part: tick(count * part))
        steps = self.context.plan.steps
        found, end = self._followed(points, steps, begin)
        tick(count * self.revolutions)
        finer = found
        if self.confirm:
            finer, _ = self._followed(points, 2 * steps, end)
            tick(count * self.revolutions)
        later = self._repeated(points, found.motion, finer.motion, end, count, tick)
        found, withdrawn = confirmed(found, finer, later)
        return Claims(*(leaf[:count] for leaf in found)), int(withdrawn[:count].sum())

    def _repeated(
        self,
        points: np.ndarray,
        motion: Int[np.ndarray, " l"],
        finer: Int[np.ndarray, " l"],
        end: Any,
        count: int,
        tick: Callable[[int], None],
    ) -> Int[np.ndarray, " l"]:
        """Kinds of motion of lanes whose chaos goes on for further runs; others keep theirs.

        The runs take the steps of the sweep, which cost little. What they end in is told by the steps of
        the finest run.
        """
        chaotic = np.flatnonzero((motion == CHAOTIC) & (finer < UNDECIDED))
        chaotic = chaotic[chaotic < count]
        total = self.repeats * self.revolutions
        tick((count - len(chaotic)) * total)
        if not (chaotic.size and self.repeats):
            return motion
        lanes = np.resize(chaotic, self.size)  # programs take so many
        own = points[lanes], tuple(part[lanes] for part in end)
        state = self._skipped(own[0], total, own[1], lambda part: tick(len(chaotic) * part))
        steps = (1 + self.confirm) * self.context.plan.steps
        last, _ = self._followed(own[0], steps, state)
        later = motion.copy()
        later[chaotic] = last.motion[: len(chaotic)]
        return later

    def _skipped(
        self, points: np.ndarray, revolutions: int, begin: Any, tick: Callable[[int], None]
    ) -> Any:
        """States after some revolutions by the steps of the sweep."""
        shared, own, y, _ = self.stages.prepare(self.first, points, begin)
        for part in segments(revolutions):
            y, _ = self.stages.skip(shared, own, y, jnp.asarray(part))
            tick(part)
        return tuple(map(np.asarray, self.stages.decode(shared, own, y)))

    def _followed(self, points: np.ndarray, steps: int, begin: Any) -> tuple[Claims, Any]:
        """Claims by so many steps from a state, and the state at the end of the run."""
        plan = dataclasses.replace(self.context.plan, steps=steps, max_steps=steps)
        context = dataclasses.replace(self.context, plan=plan)
        shared, own, y, ratio = self.stages.prepare(context, points, begin)
        followed = self.follow(shared, own, y, self.revolutions)
        end = tuple(map(np.asarray, self.stages.decode(shared, own, followed.y)))
        near = lambda p: self.polish(shared, own, followed.y, jnp.asarray(p))
        again = lambda y: np.asarray(self.returns(shared, own, y, self.longest))
        own_states = structure(context.scene).state_count  # others count turns
        seen = followed._replace(states=followed.states[..., :own_states])
        apart = context.cycle is not None and not context.cycle.common
        returned = np.full((len(points), 1), np.inf) if apart else again(followed.y)
        found = claims_of(seen, returned, near, again)
        solver: Any = plan.solver
        if followed.loaded is not None:  # stops out of reach count for nothing
            members = structure(context.scene, plan.together).members
            loaded = np.asarray(followed.loaded)
            loads = loaded, loaded
            ratio = counted(context.scene, members, np.asarray(ratio), loads, bounced=False)
        overlong = np.asarray(followed.outcome.touched) & too_long(ratio, solver.order)
        overlong &= found.motion != FAILED  # steps too long for a stop may make chaos of their own
        return found._replace(motion=np.where(overlong, UNDECIDED, found.motion)), end


# === data


def _dataset(
    dataset: xr.Dataset, first: Context, revolutions: Float[np.ndarray, " l"], found: Claims
) -> xr.Dataset:
    """The data set with the claims of all lanes, by so many `revolutions` in what counts as one."""
    status = dataset["status"]
    of = lambda values, attrs: (status.dims, np.reshape(values, status.shape), attrs)
    if "spin.speed" in status.coords:
        speeds = np.abs(status["spin.speed"].broadcast_like(status).values.ravel())
        rate = np.where(speeds > 0, speeds, np.nan)
    else:
        rate = float(revolution_rate(first.scene, first.period))
    each = rate / (2 * np.pi * revolutions)  # revolutions, or passes, a second
    passes = first.cycle is not None and first.cycle.passes
    one, many = ("pass", "passes") if passes else ("revolution", "revolutions")
    half, exponent = quantile() * found.error, found.exponent
    regular = np.isin(found.motion, REGULAR_KINDS)
    periodic = found.motion == PERIODIC
    smallest = np.finfo(float).tiny  # a multiplier may be zero
    of_orbit = np.log(np.where(periodic, np.maximum(found.multiplier, smallest), 1.0))
    exponent = np.where(periodic, of_orbit / np.maximum(found.period, 1), exponent)
    half = np.where(periodic, 0.0, half)
    shown = np.where(found.motion == FAILED, np.nan, 1.0) * each
    only = lambda chosen, values: np.where(chosen, values, np.nan)
    turns, growth = f"turns about the centre in a {one}", "largest Lyapunov exponent"
    return dataset.assign(
        motion=of(found.motion.astype(np.int8), flags("kind of motion", MOTIONS)),
        orbit_period=of(np.where(periodic, found.period, 0), about("1", f"{many} in a period")),
        multiplier=of(
            only(periodic, found.multiplier), about("1", "largest modulus of a multiplier")
        ),
        rotation=of(only(regular, found.rotation), about("1", turns)),
        rotation_error=of(only(regular, found.rotation_error), about("1", f"change of {turns}")),
        exponent=of(shown * exponent, about("1/s", growth)),
        exponent_low=of(shown * (exponent - half), about("1/s", f"{growth}, lower bound")),
        exponent_high=of(shown * (exponent + half), about("1/s", f"{growth}, upper bound")),
    )
