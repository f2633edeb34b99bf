"""Tolerances: parameters that scatter, and what draws of them tell about a machine."""

import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr
from jaxtyping import Array
from scipy import stats

from ..core.attributes import about
from ..core.checks import check_counts
from ..core.quantities import known
from ..core.shares import check_confidence, share_of
from ..scene import Scene
from .bounds import own_value


class Estimate(NamedTuple):
    """A mean or a share by draws, with bounds that hold it in the stated part of such experiments."""

    value: float
    low: float
    high: float
    draws: int
    confidence: float

    def __str__(self) -> str:
        bounds = f"{self.low:.3g} to {self.high:.3g} with {100 * self.confidence:g} % confidence"
        return f"{self.value:.4g} ({bounds}, {self.draws} draws)"


def draws(
    spread: Mapping[str, Any], count: int, *, seed: int = 0, replicates: int | None = None
) -> dict[str, np.ndarray]:
    """`p_i = F_i^-1(u_i)` with `u` uniform in the unit cube: values of parameters that scatter apart.

        jr.sweep(scene, {"draw": jr.draws(spread, 1000)}, ..)

    Args:
        spread: by path, `(low, high)` for a uniform distribution, or any distribution of `scipy.stats`
            with its parameters, such as `scipy.stats.norm(7.5e-3, 2e-4)`; SI.
        count: number of draws.
        seed: number from which the draws follow; the same seed gives the same draws.
        replicates: None for independent draws. A number, 2 or more, is how many scrambled Sobol sequences
            follow one another, each of `count / replicates` draws, a power of two. They fill the cube more
            evenly, so means of smooth quantities have smaller errors, which replicates tell.

    Returns:
        `count` values by path, in the order of `spread`.

    Raises:
        ValueError: if a spread is not a distribution or gives a value that is not finite, or `count` is
            no multiple of `replicates` by a power of two.

    Source: Owen (1997), SIAM J. Numer. Anal. 34, 1884-1910, as `scipy.stats.qmc.Sobol` has it.
    """
    check_counts(count=count)
    distributions = _distributions(spread)
    if replicates is None:
        points = np.random.default_rng(seed).random((count, len(distributions)))
    else:
        points = _sobol(len(distributions), count, _checked_replicates(replicates, count), seed)
    found = {}
    for (path, one), column in zip(distributions.items(), points.T, strict=True):
        found[path] = np.asarray(one.ppf(column), float)
        if found[path].shape != (count,) or not np.all(np.isfinite(found[path])):
            raise ValueError(
                f"The spread of `{path}` does not give a finite number for every draw; bound it, as "
                "`scipy.stats.truncnorm` does."
            )
    return found


def share(happened: Any, *, replicates: int | None = None, confidence: float = 0.95) -> Estimate:
    """Probability of an event, `n / N` of the draws, and its bounds.

    Bounds of independent draws are exact for a binomial count: after N draws without the event they are
    0 and `1 - (a / 2)^(1 / N)`, `a = 1 - confidence`. Those of replicates are as in `average`.

    Args:
        happened: whether the event was seen, for every draw; a lane that failed is an event of its own,
            so `failed | backward` is on the safe side.
        replicates: as in `draws`.
        confidence: level of the bounds.

    Returns:
        An `Estimate`.

    Raises:
        ValueError: if `happened` is not true or false for every draw.

    Source: Clopper, Pearson (1934), Biometrika 26, 404-413.
    """
    check_confidence(confidence)
    seen = np.ravel(np.asarray(happened))
    if seen.dtype != bool or not seen.size:
        raise ValueError(
            f"`happened` must be true or false for every draw, but is {seen.size} of {seen.dtype}."
        )
    if replicates is None:
        found = share_of(seen.sum(), seen.size, confidence)
        return Estimate(*(float(one) for one in found), seen.size, confidence)
    found = average(seen.astype(float), replicates=replicates, confidence=confidence)
    return found._replace(low=max(found.low, 0.0), high=min(found.high, 1.0))


def average(values: Any, *, replicates: int | None = None, confidence: float = 0.95) -> Estimate:
    """Mean `m` over draws and its bounds `m +- t s / sqrt(n)`, by Student's t of n - 1 degrees.

    `n` and `s` are number and standard deviation of the draws where they are independent, or of the means
    of replicates. The bounds hold for many draws, or where values scatter normally.

    Args:
        values: a quantity of every draw.
        replicates: as in `draws`.
        confidence: level of the bounds.

    Returns:
        An `Estimate`.

    Raises:
        ValueError: if a value is not finite, as of a lane that failed, or there are fewer than two.
    """
    check_confidence(confidence)
    values = np.ravel(np.asarray(values, float))
    wrong = np.count_nonzero(~np.isfinite(values))
    if wrong or values.size < 2:
        raise ValueError(
            f"`values` must be two or more finite numbers, but {wrong} of {values.size} are not finite; a "
            "mean without lanes that failed would be another one."
        )
    groups = values
    if replicates is not None:
        groups = values.reshape(_checked_replicates(replicates, values.size), -1).mean(axis=1)
    error = groups.std(ddof=1) / math.sqrt(groups.size)
    reach = float(stats.t.ppf((1 + confidence) / 2, groups.size - 1) * error)
    mean = float(values.mean())
    return Estimate(mean, mean - reach, mean + reach, values.size, confidence)


def sensitivities(
    quantity: Callable[[dict[str, np.ndarray]], Any],
    spread: Mapping[str, Any],
    count: int,
    *,
    seed: int = 0,
    confidence: float = 0.95,
) -> xr.Dataset:
    """Sobol indices: `S_i = V[E(y | p_i)] / V(y)` and `T_i = 1 - V[E(y | p_~i)] / V(y)`.

    `S_i` is the share of the variance of y that goes when `p_i` is known, and `T_i` the share that is left
    when all others are known, interactions included.

    Args:
        quantity: function of draws, as `draws` returns them, that gives y for each; it is called with
            `count (d + 2)` draws in all for d parameters.
        spread: as in `draws`.
        count: number of draws, a power of two.
        seed: as in `draws`.
        confidence: level of the bounds, from resampled draws.

    Returns:
        Dataset over `path`: `first` and `total`, each with `_low` and `_high`.

    Raises:
        ValueError: if `count` is not a power of two, or y is not a finite number for every draw.

    Source: Saltelli et al. (2010), Computer Physics Communications 181, 259-270.
    """
    check_confidence(confidence)
    check_counts(count=count)
    distributions = _distributions(spread)
    if count < 2 or count & (count - 1):
        raise ValueError(f"`count` must be a power of two, but is {count}.")

    def of_columns(columns: np.ndarray) -> np.ndarray:
        found = np.array(quantity(dict(zip(distributions, columns, strict=True))), float)
        if found.shape != columns.shape[1:] or not np.all(np.isfinite(found)):
            raise ValueError(
                f"`quantity` must give one finite number for each of {columns.shape[1]} draws, but gives "
                f"an array of shape {found.shape} with {np.count_nonzero(~np.isfinite(found))} that are "
                "not finite."
            )
        return found

    random = np.random.default_rng(seed)
    of_all = list(distributions.values())
    found = stats.sobol_indices(func=of_columns, n=count, dists=of_all, rng=random)
    again = found.bootstrap(confidence_level=confidence)
    variables = {}
    for name, words in (("first", "share of variance"), ("total", "share with interactions")):
        bounds = getattr(again, f"{name}_order").confidence_interval
        ends = {"": getattr(found, f"{name}_order"), "_low": bounds.low, "_high": bounds.high}
        for end, values in ends.items():
            variables[name + end] = ("path", np.ravel(values), about("1", words))
    return xr.Dataset(
        variables, {"path": list(distributions)}, {"draws": count, "confidence": confidence}
    )


def over_draws(
    quantity: Callable[[Scene], Any], deviations: Mapping[str, Any], *, relative: bool = False
) -> Callable[[Scene], Array]:
    """`y_k = quantity(scene with p_i + d_ik)`, or `p_i (1 + d_ik)` if relative, for every draw k.

        loss = lambda scene: -jnp.quantile(onsets(scene), 0.05),  onsets = jr.over_draws(onset, ..)

    The draws are fixed, so a mean or a quantile of y is a smooth function of the scene's own values as far
    as `quantity` is, and `tune` takes it: what is tuned is the nominal design.

    Args:
        quantity: function of a scene that jax can map, such as an objective.
        deviations: by path, the deviations of all draws from the scene's own value, as `draws` returns
            them from spreads around zero. A path of several effects, as `limiters.gap`, is one parameter.
        relative: whether deviations are fractions of the scene's own value.

    Returns:
        A function of a scene that returns the quantities of all draws.

    Raises:
        ValueError: if the paths have different numbers of draws, or a parameter is not one number.
    """
    sizes = {path: np.size(values) for path, values in deviations.items()}
    if len(set(sizes.values())) != 1:
        raise ValueError(
            f"`deviations` must have as many draws of every path, but has {sizes or 'none'}."
        )
    given = {path: jnp.asarray(values, float) for path, values in deviations.items()}

    def quantities(scene: Scene) -> Array:
        for path in given:
            if all(map(known, scene.leaves(path))):
                own_value(scene, path)  # raises unless it is one number
        own = {path: jnp.ravel(scene.get(path))[0] for path in given}

        def one(deviation: dict[str, Array]) -> Array:
            moved = {
                path: own[path] * (1 + d) if relative else own[path] + d
                for path, d in deviation.items()
            }
            return quantity(scene.put(moved))

        return jax.vmap(one)(given)

    return quantities


def _distributions(spread: Mapping[str, Any]) -> dict[str, Any]:
    """Distributions by path; a pair is the range of a uniform one."""
    if not spread:
        raise ValueError("`spread` must name at least one parameter, but is empty.")
    found = {}
    for path, one in spread.items():
        if not hasattr(one, "ppf"):
            ends = np.asarray(one, float)
            if ends.shape != (2,) or not ends[0] < ends[1]:
                raise ValueError(
                    f"`spread['{path}']` must be a pair (low, high) or a distribution of scipy.stats, but "
                    f"is {one!r}."
                )
            one = stats.uniform(ends[0], ends[1] - ends[0])
        found[path] = one
    return found


def _sobol(dimension: int, count: int, replicates: int, seed: int) -> np.ndarray:
    """Scrambled Sobol sequences one after the other: (count, dimension), within the open cube."""
    each = count // replicates
    if each & (each - 1):
        raise ValueError(
            f"`count` must be `replicates` times a power of two, but {count} draws in {replicates} "
            f"replicates are {each} in each."
        )
    seeds = np.random.SeedSequence(seed).spawn(replicates)
    sequences = [stats.qmc.Sobol(dimension, rng=np.random.default_rng(own)) for own in seeds]
    points = np.concatenate([one.random(each) for one in sequences])
    return np.clip(points, 2.0**-53, 1 - 2.0**-53)


def _checked_replicates(replicates: int, count: int) -> int:
    check_counts(2, replicates=replicates)
    if count % replicates:
        raise ValueError(
            f"{count} draws are not the same number in each of {replicates} replicates."
        )
    return replicates
