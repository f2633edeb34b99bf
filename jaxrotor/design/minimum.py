"""Minimum: the least sum of squares of residuals that are weighted by the noise they show."""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from ..core import linalg
from ..core.compiled import compiled_quickly
from ..core.constants import with_arrays, with_constants
from ..core.extremes import smaller
from ..core.quantities import Scalar
from ..scene import Scene
from .bounds import Bounds
from .records import AbstractRecord, own_scenes
from .target import evaluator


ROUNDING = 1e-10  # of a record: smaller noise cannot be distinguished from rounding
SETTLED = 1e-5  # step of all parameters in their standard deviations at which a search ends
NEAR = (
    1e-2  # likewise of the mode of a density, whose logarithm is then within half the square of it
)
FIRST_DAMPING = 1e-3  # of Levenberg and Marquardt, over the squares of the scaled slopes
MOST_DAMPING = 1e8  # at which a search ends
LONGEST = 2.0  # change of a free number in a step
MOST_STEPS = 2**31 - 1  # that a program can count
SMALL = 1e-2  # free number below which a logarithm of a hyperbolic cosine is its series
PASSES = 4  # in which the noises of several records are found, as each changes the weights of all


class Minimum(NamedTuple):
    """The minimum of the weighted sum of squares, as free numbers; `m` residuals, `r` records."""

    u: Float[Array, " n"]
    residuals: Float[Array, " m"]  # [m]
    slopes: Float[Array, "m n"]  # by the parameters
    noise: Float[Array, " r"]  # [m]
    remaining: Scalar  # step that would come next, in standard deviations
    evaluations: Int[Array, ""]
    ended: Bool[Array, ""]  # whether the search ended of itself, not for want of steps


class _Point(NamedTuple):
    """Parameters as free numbers, and the residuals there."""

    at: Float[Array, " n"]
    left: Float[Array, " m"]
    slopes: Float[Array, "m n"]  # by free numbers
    noise: Float[Array, " r"]
    remaining: Scalar


class _Split(NamedTuple):
    """`W J = B S V^T D`: `n` directions in which the parameters move apart."""

    basis: Float[Array, "m n"]  # B
    sizes: Float[Array, " n"]  # S
    directions: Float[Array, "n n"]  # V^T D^-1
    components: Float[Array, " n"]  # of the residuals, B^T r


def minima(
    scene: Scene,
    records: tuple[AbstractRecord, ...],
    limits: Bounds,
    starts: Float[Array, "s n"],
    steps: int,
) -> Minimum:
    """The `minimum` from every start, `s` of them in front of its arrays.

    One program serves all scenes of one structure, records of the same shapes, bounds and numbers of
    steps. What decides the structure is compiled into it: stations, the length of the shaft, settings of
    records, and all numbers of a support or an external damping that has a parameter, since they decide
    together whether it is isotropic. A program stays for as long as the process runs.
    """
    known = fixed(scene, records, limits.paths)
    return _minima(*known, limits, starts, jnp.asarray(min(steps, MOST_STEPS)))


def fixed(scene: Scene, records: tuple[AbstractRecord, ...], paths: tuple[str, ...]) -> Any:
    """Scene and records with those numbers as constants that decide the structure of a program."""
    blank = scene.put(dict.fromkeys(paths, jnp.zeros(())))  # the first guess decides nothing
    known = tuple(with_constants(record, record.deciding) for record in records)
    return with_constants(blank, _deciding(blank, paths)), known


def _deciding(scene: Scene, paths: tuple[str, ...]) -> list[Any]:
    """Arrays of a scene that decide the structure of its equations.

    They are stations, the length of the shaft, and all numbers of those effects that a change of one
    number may make isotropic or anisotropic, if one of them is a parameter. An effect without a station
    gives None.
    """
    found: list[Any] = [scene.shaft.length, *scene.shaft.stations]
    heads = {path.partition(".")[0] for path in paths}
    for effect in scene.effects:
        if hasattr(effect, "refreshed") and heads & {effect.kind, effect.plural}:
            found += jax.tree.leaves(effect)
        else:
            found.append(getattr(effect, "at", None))
    return found


@compiled_quickly
def _minima(scene: Any, records: Any, limits: Bounds, starts: Array, steps: Array) -> Minimum:
    scene, records = with_arrays((scene, records))
    return jax.lax.map(lambda u: minimum(scene, records, limits, u, steps), starts)


def minimum(
    scene: Scene,
    records: tuple[AbstractRecord, ...],
    limits: Bounds,
    u: Float[Array, " n"],
    steps: int | Array,
    noise: Float[Array, " r"] | None = None,
) -> Minimum:
    """`(J^T W J + lambda D) d = -J^T W r`, `D` the diagonal of the first, with weights of the noise found.

    With a `noise`, known or NaN where residuals show it, it is the mode of the posterior density of `u`
    for a prior that is uniform in `s(u)`. It is traced, so that starts and records may
    be mapped over.
    """
    counts = [record.count for record in records]
    floors = [ROUNDING * record.scale for record in records]
    given = jnp.full(len(records), jnp.nan)
    if noise is not None:  # the prior is a record more, of one number a parameter and noise 1
        counts, floors = [*counts, u.size], [*floors, jnp.zeros(())]
        given = jnp.append(noise, 1.0)
    owner, floors = np.repeat(np.arange(len(counts)), counts), jnp.stack(floors)

    def every(u):
        scenes = own_scenes(records, limits.placed(scene, u))
        pairs = zip(records, scenes, strict=True)
        parts = [jnp.ravel(record.residuals(own)) for record, own in pairs]
        return jnp.concatenate(parts if noise is None else [*parts, prior_residuals(u)])

    evaluate = evaluator(every, reverse=False)
    totals = lambda x: jax.ops.segment_sum(x, owner, len(floors))
    known_or = lambda found: jnp.where(jnp.isnan(given), found, given)
    counts = jnp.asarray(counts, float)

    def split(left, slopes, noise):
        """The singular values of the weighted slopes by scaled parameters, and the residuals by them."""
        weighted = slopes / noise[owner, None]
        norms = linalg.norm(weighted, axis=0)
        units = jnp.where(norms > 0, norms, 1.0)  # a stop that is not reached has no slopes
        basis, sizes, ways = linalg.svd(weighted / units, full_matrices=False)
        return _Split(basis, sizes, ways / units, basis.T @ (left / noise[owner]))

    def weighed(at, left, slopes, noise):
        """The point with the noise there."""
        for _ in range(PASSES if len(records) > 1 else 1):
            used = totals(jnp.sum(split(left, slopes, noise).basis ** 2, axis=1))
            noise = known_or(jnp.sqrt(totals(left**2) / (counts - used) + floors**2))
        parts = split(left, slopes, noise)
        return _Point(at, left, slopes, noise, linalg.norm(parts.components))

    def body(state):
        best, damping, number = state
        parts = split(best.left, best.slopes, best.noise)
        damped = parts.components * parts.sizes / (parts.sizes**2 + damping)
        move = -parts.directions.T @ damped
        move = move * smaller(LONGEST / jnp.max(jnp.abs(move)), 1.0)
        at = jnp.where(number > 0, best.at + move, best.at)
        left, slopes = evaluate(at)
        first = jnp.sqrt(totals(left**2) / counts + floors**2)
        noise = jnp.where(number > 0, best.noise, known_or(first))
        total = lambda left: jnp.sum((left / noise[owner]) ** 2)
        lower = (total(left) < total(best.left)) & jnp.all(jnp.isfinite(slopes))
        trial = weighed(at, left, slopes, noise)
        best = jax.tree.map(lambda new, old: jnp.where(lower, new, old), trial, best)
        return best, jnp.where(lower, damping / 10, damping * 10), number + 1

    settled = SETTLED if noise is None else NEAR
    going = lambda s: (s[0].remaining > settled) & (s[1] < MOST_DAMPING) & (s[2] <= steps)
    zero, none = jnp.zeros((owner.size, u.size)), jnp.full(len(floors), jnp.inf)
    begin = _Point(u, jnp.full(owner.size, jnp.inf), zero, none, jnp.asarray(jnp.inf))
    best, damping, number = jax.lax.while_loop(
        going, body, (begin, jnp.asarray(FIRST_DAMPING), jnp.asarray(0))
    )
    ended = (best.remaining <= settled) | (damping >= MOST_DAMPING)
    own = sum(record.count for record in records)
    slopes = best.slopes[:own] / limits.rates(best.at)
    found = best.left[:own], slopes, best.noise[: len(records)]
    return Minimum(best.at, *found, best.remaining, number, ended)


def prior_residuals(u: Array) -> Array:
    """`2 sgn(u) sqrt(log cosh(u / 2))`, half the square of which is `-log(4 s (1 - s))`."""
    small = jnp.abs(u) < SMALL
    half = jnp.where(small, 1.0, jnp.abs(u) / 2)
    root = jnp.sqrt(half + jnp.log1p(jnp.exp(-2 * half)) - jnp.log(2.0))
    return jnp.where(small, u / jnp.sqrt(2.0) * (1 - u**2 / 48), 2 * jnp.sign(u) * root)
