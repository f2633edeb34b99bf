"""Evidence: how probable a record is by a scene with parameters within bounds, and what a fit leaves."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from scipy import stats
from scipy.special import expit, log_expit

from .whiteness import correlations


APART = 3.0  # standard deviations between two minima above which they are two


class Posterior(NamedTuple):
    """Posterior density of free numbers `u` about one of its modes; `n` parameters, `m` residuals."""

    u: Float[np.ndarray, " n"]  # of the mode
    hessian: Float[np.ndarray, "n n"]  # of the logarithm of its inverse
    log_likelihood: float
    log_evidence: float  # of this mode alone
    criterion: float  # Schwarz's
    noise: Float[np.ndarray, " r"]  # [m]
    residuals: Float[np.ndarray, " m"]  # [m]
    slopes: Float[np.ndarray, "m n"]  # in units of the noise, by free numbers
    freedom: float  # numbers that the record leaves, the parameters it determines taken off


def posterior(
    u: Float[np.ndarray, " n"],
    residuals: Float[np.ndarray, " m"],
    slopes: Float[np.ndarray, "m n"],
    noise: Float[np.ndarray, " r"],
    estimated: np.ndarray,
    counts: list[int],
) -> Posterior:
    """`log p(z) = log p(z | u, sigma) + log p(u) + n/2 log 2 pi - 1/2 log |H| + sum 1/2 log(pi / nu_i)`.

    It is Laplace's approximation of the integral over `u`, with `p(u) = prod s (1 - s)` of a prior that is
    uniform in `s = 1 / (1 + exp(-u))`, and `H = J^T W J + diag(1 - 2 s (1 - s))` at the mode, where the
    record is taken to be linear in `s`. The last sum, over records whose noise was estimated with a
    density of `1 / sigma`, is that over the noise: `nu_i = m_i - n_i`, `n_i` the trace of the record's
    block of the hat matrix. `log p` is 0.12 too small for a parameter that does not matter, and 0.15 for
    one whose best value is a bound. Schwarz's criterion is `-2 log p(z | u, sigma) + k log m`, `k` the
    parameters and the estimated noises.

    Args:
        u: free numbers of the mode.
        residuals: of all records, one behind the other.
        slopes: of these by the free numbers.
        noise: of every record.
        estimated: which of these came from the residuals.
        counts: of numbers in every record.

    Source: Kass, Raftery (1995), Journal of the American Statistical Association 90, 773-795, section
    4.1 and eq. (9); choice of u: MacKay (1998), Machine Learning 33, 77-86; Schwarz (1978), Annals of
    Statistics 6, 461-464.
    """
    each, share = np.repeat(noise, counts), expit(u)
    weighted = slopes / each[:, None]
    hessian = weighted.T @ weighted + np.diag(1 - 2 * share * (1 - share))
    hat = np.sum(weighted * np.linalg.solve(hessian, weighted.T).T, axis=1)
    first = np.cumsum([0, *counts[:-1]])
    left = np.asarray(counts) - np.add.reduceat(hat, first)
    squares = np.add.reduceat((residuals / each) ** 2, first)
    likelihood = -np.sum(np.asarray(counts) * np.log(2 * np.pi * noise**2) + squares) / 2
    evidence = likelihood + np.sum(log_expit(u) + log_expit(-u)) + u.size / 2 * np.log(2 * np.pi)
    evidence -= np.linalg.slogdet(hessian)[1] / 2
    evidence += np.sum(np.log(np.pi / left[estimated])) / 2
    # At the noise of greatest likelihood, as Schwarz's criterion has it
    most = np.where(estimated, noise * np.sqrt(squares / counts), noise)
    size = squares * (noise / most) ** 2
    best = -np.sum(np.asarray(counts) * np.log(2 * np.pi * most**2) + size) / 2
    criterion = -2 * best + (u.size + np.sum(estimated)) * np.log(residuals.size)
    return Posterior(
        u=u,
        hessian=hessian,
        log_likelihood=float(best),
        log_evidence=float(evidence),
        criterion=float(criterion),
        noise=noise,
        residuals=residuals,
        slopes=weighted,
        freedom=float(np.sum(left)),
    )


def total_evidence(modes: list[Posterior]) -> float:
    """`log sum p_k(z)` over the modes that are apart, the most probable first."""
    kept: list[Posterior] = []
    for mode in sorted(modes, key=lambda one: -one.log_evidence):
        away = [(mode.u - one.u) @ one.hessian @ (mode.u - one.u) for one in kept]
        if all(distance > APART**2 for distance in away):
            kept.append(mode)
    return float(np.logaddexp.reduce([mode.log_evidence for mode in kept]))


def residual_test(
    mode: Posterior, estimated: np.ndarray, shapes: list[tuple[int, ...]]
) -> tuple[float, str]:
    """The least `p` of the tests of residuals times their number, at most 1, and what that test looks at.

    The sum of squares in units of the known noise is compared with chi-square of `nu` degrees; where noise
    was estimated it says nothing. Correlations of neighbours are those of `Fitted.z_scores`.
    """
    counts = [times * channels for times, channels in shapes]
    left = mode.residuals / np.repeat(mode.noise, counts)
    ways, sizes, _ = np.linalg.svd(mode.slopes, full_matrices=False)
    _, scores = correlations(left, ways[:, sizes > 1], shapes)
    found = []
    if not np.any(estimated):
        found.append((float(stats.chi2.sf(left @ left, mode.freedom)), "larger than the noise"))
    for column, name in zip(scores.T, ("sample to sample", "channel to channel"), strict=True):
        tested = column[column != 0]
        found += [(2 * float(stats.norm.sf(abs(z))), f"correlated from {name}") for z in tested]
    if not found:
        return 1.0, "not tested"
    p, what = min(found)
    return min(1.0, p * len(found)), what
