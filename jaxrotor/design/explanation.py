"""Explanation: a candidate of a diagnosis fitted to records, from many points of its parameters."""

import dataclasses
from collections.abc import Mapping
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..core.compiled import compiled, compiled_quickly
from ..core.constants import with_arrays
from ..core.quantities import Scalar
from ..effects import AbstractContact
from ..equations.shared_nodes import with_shared_nodes
from ..scene import Scene
from .bounds import Bounds, bounds, own_value
from .evidence import Posterior, posterior, residual_test, total_evidence
from .fit import as_measured, check_enough
from .minimum import Minimum, fixed, minimum
from .records import AbstractRecord, with_starts, without_starts


TOGETHER = 256  # searches at once
ONE_BY_ONE = 4  # likewise of motions with located steps, which take longer together
OPTIMISED = 8  # conditions from which on a program is worth optimising


class Explanation(eqx.Module):
    """A candidate fitted to records: the most probable parameters within their bounds.

    `plot.fitted` draws it. `jr.fit(explanation.scene, records, ..)` has confidence intervals.
    """

    values: Mapping[str, float]  # of the parameters, SI
    deviations: Mapping[str, float]  # standard, by the curvature of their density, SI
    scene: Scene  # with these parameters
    records: tuple[AbstractRecord, ...]  # to which it was fitted
    residuals: tuple[Array, ...]  # prediction less measurement [m], each as its record
    noise: Float[np.ndarray, " r"]  # standard deviation of the numbers of every record [m]
    log_evidence: Scalar  # by Laplace's approximation
    log_likelihood: Scalar  # greatest
    criterion: Scalar  # Schwarz's, `k log m - 2 log L`
    p_value: Scalar  # probability of residuals as unusual as these by noise alone
    unusual: str = eqx.field(static=True)  # what is most unusual in them
    remaining_step: Scalar  # that would come next, in standard deviations


class _Lanes(NamedTuple):
    """Where searches begin, and the numbers to which they fit; L of them in front of every array."""

    measured: list[Array]
    guesses: Any
    u: Float[Array, "L n"]


class Search(NamedTuple):
    """Scene, records and points to begin at of one candidate, for its searches."""

    scene: Scene
    records: tuple[AbstractRecord, ...]
    limits: Bounds
    points: Float[np.ndarray, "k n"]  # free numbers
    guesses: Any  # of orbits, by points; None where there are none
    located: bool

    def explanations(
        self, every: list[tuple[AbstractRecord, ...]], noise: np.ndarray, starts: int, steps: int
    ) -> list[Explanation | None]:
        """The most probable explanation of every condition, None where no prediction is finite."""
        quickly = self.located or len(every) < OPTIMISED  # located steps take minutes to optimise
        numbers = [np.stack([own[k].measured for own in every]) for k in range(len(self.records))]
        flat = np.stack(
            [np.concatenate([np.ravel(r.numbers(r.measured)) for r in own]) for own in every]
        )
        counts = [record.count for record in self.records]
        points = np.arange(len(self.points))
        most = starts * len(every)
        begun = self._minima(numbers, 0 * points, points, noise, 0, quickly, most)
        lanes = []
        for i, row in enumerate(flat):
            merit = _misfits(begun.residuals + flat[0] - row, noise, counts)
            lanes += [(i, k) for k in np.argsort(merit)[:starts] if np.isfinite(merit[k])]
        owner, points = np.array(lanes, int).reshape(-1, 2).T
        if not lanes:
            return [None] * len(every)
        found = self._minima(numbers, owner, points, noise, steps, quickly, most)
        each = [jax.tree.map(lambda part, j=j: part[j], found) for j in range(len(lanes))]
        return [
            self._best([each[j] for j in np.flatnonzero(owner == i)], own, noise)
            for i, own in enumerate(every)
        ]

    def _minima(
        self,
        numbers: list[np.ndarray],
        conditions: np.ndarray,
        points: np.ndarray,
        noise: np.ndarray,
        steps: int,
        quickly: bool,
        most: int,
    ) -> Minimum:
        """Minima of the numbers of `conditions`, sought from `points`, as many at a time as of `most`."""
        count, program = len(conditions), _minima_quickly if quickly else _minima
        size = ONE_BY_ONE if self.located else min(TOGETHER, max(len(self.points), most))
        known = fixed(self.scene, self.records, self.limits.paths)
        settings = jnp.asarray(noise), jnp.asarray(steps), self.located
        parts: list[Any] = []
        for begin in range(0, count, size):
            some = np.minimum(np.arange(begin, begin + size), count - 1)
            measured = [jnp.asarray(one[conditions[some]]) for one in numbers]
            guesses = jax.tree.map(lambda leaf, k=points[some]: leaf[k], self.guesses)
            lanes = _Lanes(measured, guesses, jnp.asarray(self.points[points[some]]))
            parts.append(jax.device_get(program(*known, self.limits, lanes, *settings)))
        return jax.tree.map(lambda *part: np.concatenate(part)[:count], *parts)

    def _best(
        self, found: list[Any], records: tuple[AbstractRecord, ...], noise: np.ndarray
    ) -> Explanation | None:
        """The explanation of one condition by its minima."""
        counts, unknown = [record.count for record in records], np.isnan(noise)
        modes: list[tuple[Posterior, Any]] = []
        for one in found:
            if np.isfinite(one.residuals).all() and np.isfinite(one.slopes).all():
                slopes = one.slopes * np.asarray(self.limits.rates(jnp.asarray(one.u)))
                own = one.residuals, slopes, one.noise
                modes.append((posterior(one.u, *own, unknown, counts), one.remaining))
        if not modes:
            return None
        best, remaining = max(modes, key=lambda pair: pair[0].log_evidence)
        parts = np.split(best.residuals, np.cumsum(counts)[:-1])
        tables = [part.reshape(r.samples_left, -1) for part, r in zip(parts, records, strict=True)]
        p, unusual = residual_test(best, unknown, [table.shape for table in tables])
        u = jnp.asarray(best.u)
        values = dict(zip(self.limits.paths, self.limits.values(u).tolist(), strict=True))
        spread = np.sqrt(np.diag(np.linalg.inv(best.hessian))) * np.asarray(self.limits.rates(u))
        scene = self.scene.put({path: jnp.asarray(value) for path, value in values.items()})
        return Explanation(
            values=values,
            deviations=dict(zip(values, spread.tolist(), strict=True)),
            scene=scene.of_parts(*without_starts(scene)),
            records=records,
            residuals=tuple(map(as_measured, tables, records)),
            noise=best.noise,
            log_evidence=jnp.asarray(total_evidence([mode for mode, _ in modes])),
            log_likelihood=jnp.asarray(best.log_likelihood),
            criterion=jnp.asarray(best.criterion),
            p_value=jnp.asarray(p),
            unusual=unusual,
            remaining_step=jnp.asarray(remaining),
        )


def search_of(
    scene: Scene,
    records: tuple[AbstractRecord, ...],
    where: Mapping[str, Any],
    draws: int,
    seed: int,
) -> Search:
    """The search of a candidate, from its own values and a Latin hypercube of `draws` in all.

    Orbits with contact begin with a motion that has settled at each point; points are left out where it
    settles on no orbit.

    Raises:
        RuntimeError: if there is no orbit at any point.
    """
    scene = with_starts(records, scene, where)
    limits = bounds(scene, where, "parameters")
    scene = with_shared_nodes(scene, where)
    own = limits.numbers([own_value(scene, path) for path in where])
    points = np.concatenate([own[None], limits.drawn(draws - 1, seed)])
    first = (
        tuple(record.prepared(scene) for record in records) if not _orbits(scene, records) else ()
    )
    guesses = None
    if not first:
        kept, begun = [], []
        for u in points:
            at = scene.put(dict(zip(where, limits.values(jnp.asarray(u)), strict=True)))
            try:
                begun.append(tuple(record.prepared(at) for record in records))
            except RuntimeError:
                continue
            kept.append(u)
        if not kept:
            raise RuntimeError(
                "no steady motion is found at any point between the bounds; give other bounds"
            )
        each = [[getattr(record, "guess", None) for record in own] for own in begun]
        guesses = jax.tree.map(lambda *leaves: np.stack(leaves), *each)
        points, first = np.array(kept), begun[0]
    check_enough(first, len(where))
    laws = [effect.law() for effect in scene.of(AbstractContact)]
    located = any(law.kinked for law in laws)
    return Search(scene, first, limits, points, guesses, located)


def _orbits(scene: Scene, records: tuple[AbstractRecord, ...]) -> bool:
    """Whether predictions begin with an orbit that was found before."""
    return bool(scene.of(AbstractContact)) and any(hasattr(record, "guess") for record in records)


def _of_lanes(
    scene: Any,
    records: Any,
    limits: Bounds,
    lanes: _Lanes,
    noise: Array,
    steps: Array,
    located: bool,
) -> Minimum:
    scene, records = with_arrays((scene, records))

    def one(lane: _Lanes) -> Minimum:
        own = []
        for k, (record, measured) in enumerate(zip(records, lane.measured, strict=True)):
            record = eqx.tree_at(lambda record: record.measured, record, measured)
            if lane.guesses is not None and lane.guesses[k] is not None:
                record = dataclasses.replace(record, guess=lane.guesses[k])
            own.append(record)
        return minimum(scene, tuple(own), limits, lane.u, steps, noise)

    return jax.lax.map(one, lanes) if located else jax.vmap(one)(lanes)


@compiled
def _minima(*arguments: Any) -> Minimum:
    return _of_lanes(*arguments)


@compiled_quickly
def _minima_quickly(*arguments: Any) -> Minimum:
    return _of_lanes(*arguments)


def _misfits(
    residuals: Float[np.ndarray, "k m"], noise: np.ndarray, counts: list[int]
) -> Float[np.ndarray, " k"]:
    """`-log p(z | u)` of residuals at points, without what is alike; infinite where there is no motion."""
    squares = np.add.reduceat(residuals**2, np.cumsum([0, *counts[:-1]]), axis=1)
    unknown = np.isnan(noise)
    known = squares / (2 * np.where(unknown, 1.0, noise) ** 2)
    shown = np.asarray(counts) / 2 * np.log(np.where(unknown & (squares > 0), squares, 1.0))
    total = np.where(unknown, shown, known).sum(axis=1)
    return np.where(np.isfinite(residuals).all(axis=1), total, np.inf)
