"""Lanes: trajectories of one chunk, stepped as one program and observed as they are stepped."""

import dataclasses
from collections.abc import Callable
from typing import Any, NamedTuple, cast

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from ..core.compiled import compiled, compiled_quickly
from ..core.outcome import Outcome
from ..core.parallel import first_alone
from ..core.precision import double, single
from ..core.progress import segments
from ..equations.constant_frame import linear_matrix
from ..equations.lent import with_lent_films
from ..equations.start import AbstractStart, put_number
from ..equations.system import assemble
from ..motion.base import AbstractMarch, Plan
from ..motion.integrated import IntegratedMarch, IntegratedPace
from ..motion.revolutions import March, revolution_rate
from ..motion.stepped import Stepping
from ..motion.windows import WindowMarch
from ..orbits.passes import Cycle, cycle_rate
from ..scene import Scene
from ..solvers.basis import ModalBasis, SlotBasis, modal
from ..solvers.choice import decide_basis
from ..solvers.exponential import Exponential
from .observable import AbstractObservable, Turn, updated


MANY_NODES = 12  # of a shaft, from which lanes of equal equations are decomposed once


class Context(eqx.Module):
    """The settings that all chunks of a sweep share."""

    scene: Scene
    start: AbstractStart
    paths: tuple[str, ...] = eqx.field(static=True)
    plan: Plan
    station: Float[Array, ""]
    period: float | str | None = eqx.field(static=True)
    observe: tuple[AbstractObservable, ...]
    settle: int = eqx.field(static=True)  # revolutions, or windows along times
    keep: int = eqx.field(static=True)
    pace: Stepping | IntegratedPace | None = None  # None: exponential steps of whole revolutions
    in_single: bool = eqx.field(static=True, default=False)  # whether steps are of single precision
    # Periods of laws that count turns, by which a "revolution" is stepped; None: there are none
    cycle: Cycle | None = eqx.field(static=True, default=None)

    @property
    def interval(self) -> float | None:
        """Time from sample to sample [s]; None where windows are revolutions."""
        match self.pace:
            case Stepping():
                return float(self.pace.breaks[1])
            case IntegratedPace():
                return None if self.pace.interval is None else float(self.pace.interval)
        return None


class Stages(NamedTuple):
    """The programs of a chunk, each compiled by the first chunk and shared by all."""

    prepare: Callable
    skip: Callable
    keep: Callable
    decode: Callable

    @staticmethod
    def fresh() -> "Stages":
        """Programs that are yet to be compiled."""
        return Stages(*map(first_alone, (_prepare, _skip, _keep, _decode)))

    def __reduce__(self) -> tuple:  # another process compiles its own
        return Stages.fresh, ()


class Lanes(NamedTuple):
    """Results of lanes, all with the lanes in front."""

    carries: tuple  # the last carry of every observable
    stored: tuple  # what every observable stored of every kept revolution
    outcome: Outcome
    started: np.ndarray  # whether the starting state is finite
    contact_stiffness_ratio: np.ndarray  # (lanes, k, 2), see `Tableau.contact_stiffness_ratio`
    end: tuple[np.ndarray, ...] | None  # see `AbstractMarch.decode`, (lanes, ..) each


def run_chunk(
    context: Context,
    stages: Stages,
    points: np.ndarray,
    size: int,
    tick: Callable[[int], None],
    begin: tuple[np.ndarray, ...] | None = None,
    keep_end: bool = False,
    moved: np.ndarray | None = None,
) -> Lanes:
    """Results of a chunk of lanes, in programs for `size` of them.

    Lanes start from the start of the context, or each from its own state in `begin`; with `keep_end`
    the results have the states at the end, or those at the beginning of lanes that failed. Starts are
    `moved` by a share of the state of each.
    """
    lanes = len(points)
    pad = lambda leaf: np.concatenate([leaf, np.repeat(leaf[-1:], size - lanes, axis=0)])
    padded = pad(points), jax.tree.map(pad, begin)
    shared, own, y, ratio = stages.prepare(context, *padded)
    if moved is not None:
        y = jax.device_put(np.asarray(y) * (1 + pad(moved)[:, None]).astype(y.dtype))
    started = np.isfinite(y).reshape(size, -1).all(axis=1)
    decode = lambda y: jax.tree.map(np.asarray, stages.decode(shared, own, y))
    first = decode(y) if keep_end else None
    outcome = Outcome.good(size)
    for revolutions in segments(context.settle):
        y, ok = stages.skip(shared, own, y, jnp.asarray(revolutions))
        outcome = outcome & ok
        tick(revolutions)
    contacts = sum(len(group) for group in context.plan.together)
    empty = tuple(one.start(contacts) for one in context.observe)
    # Through numpy, because weak types, which a program does not return, would compile it twice.
    lanes_of = lambda leaf: jax.device_put(np.broadcast_to(leaf, (size, *np.shape(leaf))))
    carry = jax.tree.map(lanes_of, empty)
    stored, number = [], 0
    for revolutions in segments(context.keep):
        (y, carry, ok), out = stages.keep(
            context.observe, shared, own, y, carry, jnp.asarray(number), context.keep, revolutions
        )
        outcome = outcome & ok
        number += revolutions
        stored.append(jax.tree.map(lambda leaf: np.asarray(leaf)[:lanes], out))
        tick(revolutions)
    stored = jax.tree.map(lambda *parts: np.concatenate(parts, axis=1), *stored)
    unpad = lambda tree: jax.tree.map(lambda leaf: np.asarray(leaf)[:lanes], tree)
    end = unpad(_end_or_first(outcome.ok, decode(y), first)) if keep_end else None
    return Lanes(unpad(carry), stored, unpad(outcome), started[:lanes], ratio[:lanes], end)


def run_rows(
    context: Context,
    stages: Stages,
    rows: np.ndarray,
    size: int,
    tick: Callable[[int], None],
    kick: float = 0.0,
) -> Lanes:
    """Results of lanes that go through a row of points each, (lanes, points, paths).

    A lane starts at every point from the state it had at the end of the point before; after a point where
    it failed, from the state it had at the beginning of that point. Each time its first ball is moved by
    `kick` [rad].
    """
    results: list[Lanes] = []
    begin = None
    for points in rows.swapaxes(0, 1):
        results.append(run_chunk(context, stages, points, size, tick, begin, keep_end=True))
        begin = _kicked(results[-1].end, kick) if kick else results[-1].end
    observed = [lanes._replace(end=None) for lanes in results]
    return jax.tree.map(lambda *parts: np.stack(parts, axis=1), *observed)


def _kicked(parts: Any, kick: float) -> tuple[np.ndarray, ...]:
    """States, see `IntegratedMarch.decode`, with the first ball moved by an angle [rad]."""
    q, velocity, angles, *rest = parts
    return q, velocity, angles + kick * (np.arange(angles.shape[1]) == 0), *rest


def _end_or_first(ok: Any, end: Any, first: Any) -> Any:
    """States at the end; of lanes that failed, those at the beginning.

    A state may be finite where an observable of it has overflowed, so `ok` counts as well.
    """
    good = np.all([np.isfinite(part).all(axis=1) for part in end], axis=0) & np.asarray(ok)
    return jax.tree.map(lambda here, before: np.where(good[:, None], here, before), end, first)


def _prepare(context: Context, points: np.ndarray, begin: Any):
    """Marches of the lanes, as leaves that all share and leaves of each; states; stiffness ratios.

    Lanes are prepared one after the other, each in the same way whatever the size of its chunk.
    A leaf is shared if its values are equal in all lanes. Steps of single precision have coefficients
    that were computed in double precision.
    """
    march, y, ratio = _marches(context, points, begin)
    if context.in_single:
        march, y = single((march, y))
    arrays, constant = eqx.partition(march, eqx.is_array)
    equal = jax.tree.map(lambda leaf: bool((leaf == leaf[:1]).all()), arrays)
    shared = jax.tree.map(
        lambda leaf, same: jax.device_put(leaf[0]) if same else None, arrays, equal
    )
    own = jax.tree.map(lambda leaf, same: None if same else jax.device_put(leaf), arrays, equal)
    return eqx.combine(shared, constant), own, jax.device_put(y), ratio


def _marches(
    context: Context, points: np.ndarray, begin: Any
) -> tuple[AbstractMarch, np.ndarray, np.ndarray]:
    """Marches, states at the start and stiffness ratios of all lanes, with basis "auto" decided."""
    plan, solver = context.plan, context.plan.solver
    if not isinstance(solver, Exponential) or solver.basis != "auto":
        return _build_lanes(context, plan, points, begin)
    bases = _bases_of_equal_lanes(context, points)
    if bases is not None:
        chosen = decide_basis(solver, bases.vectors)
        bases = bases if chosen.basis == "modal" else None
        return _build_lanes(context, _with_solver(plan, chosen), points, begin, bases)
    in_modes = dataclasses.replace(solver, basis="modal")
    built = _build_lanes(context, _with_solver(plan, in_modes), points, begin)
    march = cast(March | WindowMarch, built[0])
    chosen = decide_basis(solver, march.eigenvectors)
    if chosen == in_modes:
        return built
    return _build_lanes(context, _with_solver(plan, chosen), points, begin)


def _with_solver(plan: Plan, solver: Exponential) -> Plan:
    """The plan with another solver."""
    return eqx.tree_at(lambda p: p.solver, plan, solver)


def _bases_of_equal_lanes(context: Context, points: np.ndarray) -> ModalBasis | SlotBasis | None:
    """Modal bases of all lanes, where many share their linear equations, which are decomposed once.

    None where most differ, or where a decomposition costs little: of few nodes or few shapes.
    """
    few = isinstance(getattr(context.plan.solver, "shapes", None), int) or context.cycle is not None
    if context.pace is not None or few or sum(context.scene.resolution) < MANY_NODES:
        return None
    settings = context.scene, context.plan.together, context.period, context.paths
    with jax.default_device(jax.local_devices(backend="cpu")[0]):
        matrices = np.asarray(_matrices(*settings, jnp.asarray(points)))
        distinct: dict[bytes, int] = {}
        which = [distinct.setdefault(one.tobytes(), len(distinct)) for one in matrices]
        if 2 * len(distinct) > len(points):
            return None
        first = [which.index(number) for number in range(len(distinct))]
        own = [jax.device_get(_decomposed(jnp.asarray(matrices[lane]))) for lane in first]
    return jax.tree.map(lambda *leaves: np.stack(leaves)[which], *own)


def _matrices_of_lanes(scene: Scene, together, period, paths, points: Float[Array, "l p"]):
    """Matrices of the linear equations of all lanes."""

    def one(point):
        own = _at_point(scene, paths, point)
        system = with_lent_films(assemble(own, together))
        return linear_matrix(system, revolution_rate(own, period))

    return jax.lax.map(one, points)


_matrices = compiled_quickly(_matrices_of_lanes)
_decomposed = compiled_quickly(modal)


def _build_lanes(
    context: Context, plan: Plan, points: np.ndarray, begin: Any, bases: Any = None
) -> tuple[AbstractMarch, np.ndarray, np.ndarray]:
    """Marches, states at the start and stiffness ratios of all lanes, on the processor."""
    cpu = jax.local_devices(backend="cpu")[0]
    paced = context.pace or context.cycle or context.period
    parts = (context.scene, plan, context.start, context.station, paced)
    with jax.default_device(cpu):  # small matrices, one lane after the other
        lanes, constant = _build_all(
            *parts, context.paths, jax.tree.map(jnp.asarray, (points, begin, bases))
        )
    return eqx.combine(jax.device_get(lanes), constant)


def _build_lane_by_lane(scene, plan, start, station, paced, paths, lanes):
    """`_build` of every lane: its arrays, with lanes in front, and all else, which lanes share."""
    constant = []  # known once a lane is traced

    def one(lane):
        built = _build(scene, plan, start, station, paced, paths, *lane)
        arrays, rest = eqx.partition(built, eqx.is_array)
        constant.append(rest)
        return arrays

    return jax.lax.map(one, lanes), constant[0]


# Runs once for a chunk, so compiling it with optimisation would take longer than all its runs.
_build_all = compiled_quickly(_build_lane_by_lane)


def _build(
    scene: Scene, plan: Plan, start: AbstractStart, station, paced, paths, point, begin, basis
) -> tuple[AbstractMarch, Array, Float[Array, "k 2"]]:
    """March of a lane, its state at the start, and its contact stiffness ratio.

    `paced` says how windows are stepped, which periods forces have, or is the period of a revolution,
    see `revolution_rate`.
    """
    values = dict(zip(paths, point, strict=True))
    scene = _at_point(scene, paths, point)
    for path in values:
        if path.startswith("start."):
            start = put_number(start, path.removeprefix("start."), values[path])
    march: AbstractMarch
    if isinstance(paced, Stepping):
        march = WindowMarch.build(scene, plan, paced, start, station[None])
    elif isinstance(paced, IntegratedPace):
        march = IntegratedMarch.build(scene, plan, paced, start, station[None])
    elif isinstance(paced, Cycle):
        system = paced.of(assemble(scene, plan.together))
        march = March.of(system, plan, cycle_rate(system, paced.passes), station[None])
    else:
        rate = revolution_rate(scene, paced)
        march = March.build(scene, plan, rate, station[None], basis, paced)
    y = march.begin(start, station) if begin is None else march.encode(*begin)
    return march, y, march.contact_stiffness_ratio


def _at_point(scene: Scene, paths: tuple[str, ...], point: Float[Array, " p"]) -> Scene:
    """The scene with the values of a point, those of the start left out."""
    values = zip(paths, point, strict=True)
    return scene.put({path: value for path, value in values if not path.startswith("start.")})


@compiled
def _skip(shared: AbstractMarch, own: AbstractMarch, y: Array, revolutions: Int[Array, ""]):
    """States after some revolutions that are not observed, and how these went."""
    return jax.vmap(lambda own, y: eqx.combine(own, shared).skip(y, revolutions))(own, y)


@compiled
def _keep(observe, shared, own, y, carry, number, count: int, revolutions: int):
    """States, carries and stored arrays after some kept revolutions or windows.

    The first of them has the given `number`, of `count` that are kept in all.
    """

    def lane(own: AbstractMarch, y, carry):
        def update(carries, samples, since):
            turn = Turn.of(double(samples), number + since, count)
            pairs = [updated(one, c, turn) for one, c in zip(observe, carries, strict=True)]
            return tuple(c for c, _ in pairs), tuple(out for _, out in pairs)

        return eqx.combine(own, shared).collect(y, carry, update, revolutions)

    return jax.vmap(lane)(own, y, carry)


@compiled
def _decode(shared, own, y: Array):
    """Parts of the state of every lane, see `AbstractMarch.decode`."""
    return jax.vmap(lambda own, y: eqx.combine(own, shared).decode(y))(own, y)
