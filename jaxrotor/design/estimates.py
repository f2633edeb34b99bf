"""Estimates: what draws tell of a mean or of a probability, with bounds or with a bias that is stated."""

import math
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jax.scipy.stats import norm
from jaxtyping import Array, Float
from scipy import stats

from ..core.checks import check_counts
from ..core.quantities import Scalar, known
from ..core.shares import check_confidence, share_of


class Estimate(NamedTuple):
    """A mean or a probability estimated by draws, with its confidence interval."""

    value: float  # in the unit of the quantity
    low: float  # end of the interval
    high: float  # end of the interval
    draws: int  # number of them
    confidence: float  # level of the interval [1]

    def __str__(self) -> str:
        bounds = f"{self.low:.3g} to {self.high:.3g} with {100 * self.confidence:g} % confidence"
        return f"{self.value:.4g} ({bounds}, {self.draws} draws)"


class Smoothed(NamedTuple):
    """A probability that is a smooth function of the draws, and what smoothing adds to it."""

    value: Scalar  # [1]
    bias: Scalar  # that the width causes, to its second order [1]


def probability(happened: Any, confidence: float = 0.95) -> Estimate:
    """Probability of an event, `n / N` of independent draws, with the exact bounds of a binomial count.

    After N draws without the event the bounds are 0 and `1 - (a / 2)^(1 / N)`, `a = 1 - confidence`.

    Args:
        happened: whether the event was seen, for every draw; a lane that failed is an event of its own,
            so `failed | backward` is on the safe side.
        confidence: level of the bounds.

    Returns:
        An `Estimate`.

    Raises:
        ValueError: if `happened` is not true or false for every draw, or is empty.

    Source: Clopper, Pearson (1934), Biometrika 26, 404-413.
    """
    check_confidence(confidence)
    seen = np.ravel(np.asarray(happened))
    if not seen.size:
        raise ValueError("`happened` is empty; give true or false for every draw.")
    if seen.dtype != bool:
        raise ValueError(
            f"`happened` must be true or false for every draw, but is of type {seen.dtype}."
        )
    value, low, high = map(float, share_of(seen.sum(), seen.size, confidence))
    return Estimate(value, low, high, seen.size, confidence)


def expectation(
    values: Any, *, replicates: int | None = None, confidence: float = 0.95
) -> Estimate:
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
    if values.size < 2:
        raise ValueError(f"`values` must be at least two numbers, but there are {values.size}.")
    if wrong := np.count_nonzero(~np.isfinite(values)):
        raise ValueError(
            f"`values` must be finite, but {wrong} of {values.size} are not, as those of lanes that "
            "failed; without these the mean would be another one."
        )
    groups = values
    if replicates is not None:
        groups = values.reshape(checked_replicates(replicates, values.size), -1).mean(axis=1)
    error = groups.std(ddof=1) / math.sqrt(groups.size)
    reach = float(stats.t.ppf((1 + confidence) / 2, groups.size - 1) * error)
    mean = float(values.mean())
    return Estimate(mean, mean - reach, mean + reach, values.size, confidence)


def exceedance(values: Float[Array, " n"], limit: Any, width: Any) -> Smoothed:
    """`P(y > limit)`, about `mean Phi((y_k - limit) / h)`: smooth in the draws, so `tune` can move it.

        loss = lambda scene: jr.exceedance(whirls(scene), 380.0, 2.0).value,  whirls = jr.over_draws(..)

    A share of draws has no gradient, as it jumps from draw to draw. With `Phi`, the normal distribution,
    the jump is `h` wide, which adds `b h^2` on average; from a second width, `h sqrt(2)`, follows `b`. The
    scatter of draws, about `sqrt(P (1 - P) / n)`, is not in it.

    Args:
        values: y of every draw, as `over_draws` gives them.
        limit: in the unit of y; for a probability of being below, `1 - value`.
        width: `h`, in the unit of y: a tenth to a third of the standard deviation of y. With less the
            gradient is that of few draws, with more the bias grows.

    Returns:
        `Smoothed`: `value` and `bias`, both differentiable. Verify a design by `probability` and draws of
        another seed.

    Raises:
        ValueError: if the width is not positive, or a value is not finite.

    Source: Nadaraya (1964), Theory of Probability and its Applications 9, 497-500.
    """
    if known(width) and not float(width) > 0:
        raise ValueError(f"`width` must be positive, but is {float(width):g}.")
    values = jnp.asarray(values)
    if known(values) and not (values.size and np.isfinite(values).all()):
        raise ValueError("`values` must be finite numbers, one for every draw.")
    apart = (values - limit) / width
    value = jnp.mean(norm.cdf(apart))
    return Smoothed(value, jnp.mean(norm.cdf(apart / math.sqrt(2))) - value)


def checked_replicates(replicates: int, count: int) -> int:
    """The number of replicates; raises unless they have one number of draws each."""
    check_counts(2, replicates=replicates)
    if count % replicates:
        raise ValueError(
            f"{count} draws are not the same number in each of {replicates} replicates."
        )
    return replicates
