"""Escapes: the time motions last before their whirl reverses, from an ensemble of starts."""

import numpy as np
import xarray as xr
from scipy import stats

from ..core.attributes import about
from ..core.outcome import failed
from ..core.shares import check_confidence, share_of


def escapes(
    dataset: xr.Dataset,
    *,
    over: str | tuple[str, ...] | None = None,
    after: int = 0,
    confidence: float = 0.95,
) -> xr.Dataset:
    """Survival `S(t)`, the share of an ensemble not escaped yet, and the rate of `S = e^(-lambda t)`.

    For `n` escapes in the `T` revolutions that all lanes have survived in total, the rate `lambda` is
    `n / T`, the most likely one for lanes that a chaotic transient makes forget their start. Its bounds
    are exact for a Poisson count, `chi2(a/2, 2 n) / (2 T)` and `chi2(1 - a/2, 2 n + 2) / (2 T)`; those of
    the survival are exact for a binomial one. Lanes that have not escaped by the end count with the
    revolutions they survived.

    Args:
        dataset: sweep with `observe.Reversal`, settled for 0 revolutions.
        over: dimensions of the ensemble, by default all that start with `start.`.
        after: revolutions from which on escapes count, of lanes not escaped by then: a first transient
            depends on the starts.
        confidence: level of the bounds.

    Returns:
        Dataset over the other dimensions: `rate` [1/revolution], `survival` over `revolution`, both with
        `_low` and `_high`, numbers of `lanes`, `escaped` and `failed`; not differentiable.

    Raises:
        ValueError: if the sweep has no `reversal` or settled unobserved, `confidence` is not between 0
            and 1, `after` is not within the revolutions observed, or `over` names no dimensions of it.

    Source: Lai, Tel (2011), Transient Chaos, section 1.2; bounds: Garwood (1936), Biometrika 28, 437-442,
    Clopper, Pearson (1934), Biometrika 26, 404-413.
    """
    observed = _revolutions_observed(dataset)
    check_confidence(confidence)
    if not 0 <= after < observed:
        raise ValueError(
            f"`after` must be at least 0 and below the {observed} revolutions in which a reversal may be "
            f"seen, but is {after}."
        )
    times = dataset["reversal"]
    chosen = [str(d) for d in times.dims if str(d).startswith("start.")] if over is None else over
    chosen = [chosen] if isinstance(chosen, str) else list(chosen)
    if not chosen or not set(chosen) <= set(times.dims):
        raise ValueError(
            f"`over` must name dimensions of the ensemble, of {', '.join(map(str, times.dims))}, but is "
            f"{over!r}."
        )
    good = ~xr.zeros_like(times, bool).copy(data=failed(dataset["status"]))
    grid = times.stack(start=chosen).transpose(..., "start")
    good = good.stack(start=chosen).transpose(..., "start").values
    escape = np.where(np.isnan(grid.values), np.inf, grid.values)
    revolution = np.arange(observed + 1)
    lanes = good.sum(axis=-1)
    alive = np.stack([((escape > t) & good).sum(axis=-1) for t in revolution], axis=-1)
    late = good & (escape > after)
    count = (late & np.isfinite(escape)).sum(axis=-1)
    survived = np.sum(np.where(late, np.minimum(escape, observed) - after, 0.0), axis=-1)
    dims = tuple(grid.dims[:-1])
    rates = _poisson(count, survived, confidence)
    shares = share_of(alive, lanes[..., None], confidence)
    of_rate, of_share = about("1/revolution", "rate of escape"), about("1", "share not escaped")
    ends = ("", "_low", "_high")
    return xr.Dataset(
        {f"rate{end}": (dims, value, of_rate) for end, value in zip(ends, rates, strict=True)}
        | {
            f"survival{end}": ((*dims, "revolution"), value, of_share)
            for end, value in zip(ends, shares, strict=True)
        }
        | {
            "lanes": (dims, lanes, {"units": "1"}),
            "escaped": (dims, count, about("1", f"escapes after {after}")),
            "failed": (dims, (~good).sum(axis=-1), {"units": "1"}),
        },
        {"revolution": revolution, **{dim: dataset[dim] for dim in dims}},
        {**dataset.attrs, "title": "jaxrotor escapes", "after": after, "confidence": confidence},
    )


def _revolutions_observed(dataset: xr.Dataset) -> int:
    """Number of revolutions in which a reversal can be detected: it takes some to tell one."""
    if "reversal" not in dataset:
        raise ValueError(
            "The dataset has no `reversal`; run the sweep with `observe=[observe.Reversal()]`."
        )
    if dataset.attrs.get("settle"):
        raise ValueError(
            f"The sweep did not watch its first {dataset.attrs['settle']} revolutions; take `settle=0`."
        )
    return int(dataset["reversal_watched"].max())


def _poisson(count, survived, confidence):
    """Rate of a count of escapes in so many survived revolutions, and its bounds."""
    tail = (1 - confidence) / 2
    survived = np.where(survived > 0, survived, np.nan)
    low = np.where(count > 0, stats.chi2.ppf(tail, 2 * count) / 2, 0.0)
    high = stats.chi2.ppf(1 - tail, 2 * count + 2) / 2
    return count / survived, low / survived, high / survived
