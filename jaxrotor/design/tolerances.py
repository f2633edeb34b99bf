"""Tolerances: parameters that scatter, and what draws of them tell about a machine."""

from collections.abc import Callable, Mapping
from numbers import Real
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr
from jaxtyping import Array
from scipy import stats

from ..core.attributes import about
from ..core.checks import check_counts
from ..core.quantities import known
from ..core.shares import check_confidence
from ..scene import Scene
from .bounds import ascending_pair, own_value
from .estimates import checked_replicates


RESAMPLED = 500  # times, for the bounds of Sobol indices


def draws(
    spread: Mapping[str, Any],
    count: int,
    *,
    seed: int = 0,
    replicates: int | None = None,
    correlations: Mapping[tuple[str, str], float] | None = None,
) -> dict[str, np.ndarray]:
    """`p_i = F_i^-1(u_i)` with `u` uniform in the unit cube: values of random parameters.

        jr.sweep(scene, {"draw": jr.draws(spread, 1000)}, ..)

    Args:
        spread: by path, `(low, high)` for a uniform distribution, or any distribution of `scipy.stats`
            with its parameters given, such as `scipy.stats.norm(7.5e-3, 2e-4)`; SI.
        count: number of draws.
        seed: number from which the draws follow; the same seed gives the same draws.
        replicates: None for independent draws. A number, 2 or more, is how many scrambled Sobol sequences
            follow one another, each of `count / replicates` draws, a power of two. They fill the cube more
            evenly, so means of smooth quantities have smaller errors, which replicates tell; give the same
            number to `expectation`. A `probability` needs independent draws.
        correlations: by pair of paths, between -1 and 1; other pairs are independent. `r` is that of the
            normal scores `z = Phi^-1(u)`, so Spearman's rank correlation is `6 / pi asin(r / 2)`, and each
            parameter keeps its own distribution.

    Returns:
        `count` values by path, in the order of `spread`.

    Raises:
        ValueError: if a spread is not a distribution or gives a value that is not finite, `count` is no
            multiple of `replicates` by a power of two, or no parameters can have the `correlations`.

    Source: Owen (1997), SIAM J. Numer. Anal. 34, 1884-1910, as `scipy.stats.qmc.Sobol` has it; Nelsen
    (2006), An Introduction to Copulas, section 2.3.
    """
    check_counts(count=count)
    distributions = _distributions(spread)
    if replicates is None:
        points = np.random.default_rng(seed).random((count, len(distributions)))
    else:
        points = _sobol(len(distributions), count, checked_replicates(replicates, count), seed)
    if correlations:
        roots = _correlated(list(distributions), correlations)
        within = np.clip(points, 2.0**-53, 1 - 2.0**-53)
        points = stats.norm.cdf(stats.norm.ppf(within) @ roots.T)
    found = {}
    for (path, one), column in zip(distributions.items(), points.T, strict=True):
        found[path] = np.asarray(one.ppf(column), float)
        if found[path].shape != (count,) or not np.all(np.isfinite(found[path])):
            raise ValueError(
                f"The spread of `{path}` does not give a finite number for every draw; bound it, as "
                "`scipy.stats.truncnorm` does."
            )
    return found


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
        confidence: level of the bounds, which are those of resampled draws and therefore too wide rather
            than too narrow, as Sobol points are more even than random ones.

    Returns:
        Dataset over `path`: `first` and `total`, each with `_low` and `_high`.

    Raises:
        ValueError: if there are fewer than two parameters, `count` is not a power of two, or y is not a
            finite number for every draw or is the same for all.

    Source: Saltelli et al. (2010), Computer Physics Communications 181, 259-270.
    """
    check_confidence(confidence)
    check_counts(count=count)
    distributions = _distributions(spread)
    if len(distributions) < 2:
        raise ValueError("`spread` has one parameter, which makes all of the variance; name more.")
    if count < 2 or count & (count - 1):
        raise ValueError(f"`count` must be a power of two from 2 on, but is {count}.")

    def of_columns(columns: np.ndarray) -> np.ndarray:
        found = np.array(quantity(dict(zip(distributions, columns, strict=True))), float)
        if found.shape != columns.shape[1:]:
            raise ValueError(
                f"`quantity` must give one number for each of {columns.shape[1]} draws, but gives an "
                f"array of shape {found.shape}."
            )
        if wrong := np.count_nonzero(~np.isfinite(found)):
            raise ValueError(
                f"`quantity` must be finite, but {wrong} of {found.size} values are not; give them a "
                "value, or narrow the spread."
            )
        return found

    seen: list[tuple[np.ndarray, ...]] = []

    def indices(f_A: np.ndarray, f_B: np.ndarray, f_AB: np.ndarray) -> tuple:  # names of SciPy
        seen.append((f_A, f_B, f_AB))
        return _sobol_indices(f_A, f_B, f_AB)

    random, of_all = np.random.default_rng(seed), list(distributions.values())
    options: Any = {"method": indices, "rng": random}
    found = stats.sobol_indices(func=of_columns, n=count, dists=of_all, **options)
    chosen = random.integers(count, size=(RESAMPLED, count))
    again = [_sobol_indices(*(values[..., one] for values in seen[0])) for one in chosen]
    tail = (1 - confidence) / 2
    variables = {}
    for k, (name, words) in enumerate((("first", "alone"), ("total", "with interactions"))):
        low, high = np.quantile([one[k].ravel() for one in again], (tail, 1 - tail), axis=0)
        value = np.ravel((found.first_order, found.total_order)[k])
        for end, values in (("", value), ("_low", low), ("_high", high)):
            variables[name + end] = ("path", values, about("1", f"share of variance {words}"))
    return xr.Dataset(
        variables, {"path": list(distributions)}, {"draws": count, "confidence": confidence}
    )


def _sobol_indices(a: np.ndarray, b: np.ndarray, ab: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """First and total indices (1, d) of values (1, n), (1, n) and (d, 1, n), as `sobol_indices` asks."""
    variance = np.var([a, b], axis=(0, -1))
    if not np.all(variance > 0):
        raise ValueError("`quantity` is the same for every draw, so there is no variance to share.")
    first = np.mean(b * (ab - a), axis=-1) / variance
    total = 0.5 * np.mean((a - ab) ** 2, axis=-1) / variance
    return first.T, total.T


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
        A function of a scene that returns the quantities of all draws. Values of parameters are not
        checked in it: what a draw makes of a mass below zero is not a number.

    Raises:
        ValueError: if `deviations` are not lists of one length, or a parameter is not one number.
    """
    shapes = {path: np.shape(values) for path, values in deviations.items()}
    if len(set(shapes.values())) != 1 or len(next(iter(shapes.values()))) != 1:
        raise ValueError(
            f"`deviations` must be a list of draws for every path, of one length, but has the shapes "
            f"{shapes}."
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
        if not isinstance(one, stats.distributions.rv_frozen):
            ends = ascending_pair(one)
            if ends is None:
                raise ValueError(
                    f"`spread['{path}']` must be a pair (low, high) or a distribution of scipy.stats with "
                    f"its parameters given, but is {one!r}."
                )
            one = stats.uniform(ends[0], ends[1] - ends[0])
        if np.ndim(one.ppf(0.5)) != 0:
            raise ValueError(
                f"`spread['{path}']` must be one distribution, but its parameters are lists."
            )
        found[path] = one
    return found


def _correlated(paths: list[str], correlations: Mapping[tuple[str, str], float]) -> np.ndarray:
    """`L` with `L L^T` the correlations of normal scores, by Cholesky's decomposition."""
    matrix = np.eye(len(paths))
    for pair, value in correlations.items():
        known = isinstance(pair, tuple) and len(pair) == len(set(pair)) == 2 and {*pair} <= {*paths}
        if not known or not isinstance(value, Real) or not -1 < value < 1:
            raise ValueError(
                f"`correlations[{pair!r}]` must be a number between -1 and 1 for two paths of `spread`, "
                f"but is {value!r}."
            )
        i, j = map(paths.index, pair)
        matrix[i, j] = matrix[j, i] = value
    try:
        return np.linalg.cholesky(matrix)
    except np.linalg.LinAlgError:
        least = np.linalg.eigvalsh(matrix)[0]
        raise ValueError(
            f"No parameters have these `correlations` together: the least eigenvalue of their matrix is "
            f"{least:.3g}, but must be positive."
        ) from None


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
