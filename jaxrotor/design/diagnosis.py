"""Diagnosis: which of several causes explains a record, by the evidence for each."""

from collections.abc import Mapping
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from scipy.special import softmax

from ..core.checks import check_counts
from ..core.progress import waiting
from ..core.quantities import Scalar
from ..core.tables import notebook_table
from ..effects.base import AbstractEffect
from ..scene import Scene
from .bounds import check_paths
from .explanation import Explanation, search_of
from .fit import checked
from .records import AbstractRecord


class Diagnosis(eqx.Module):
    """`P_k = p_k(z) / sum p_j(z)`: probabilities of candidates, and whether the best explains the records.

    `str` and a notebook show a table, in which BIC is Schwarz's criterion.
    """

    probabilities: Mapping[str, float]  # of candidates that are equally likely before
    explanations: Mapping[str, Explanation]  # by each
    level: Scalar  # of the p of residuals, below which the cause is none of these
    scene: Scene  # to which candidates add
    failures: Mapping[str, str]  # reasons why candidates could not be fitted

    @property
    def most_probable(self) -> str:
        """The candidate of the greatest probability, whether it explains the records or not."""
        return max(self.probabilities, key=lambda name: self.probabilities[name])

    @property
    def cause(self) -> str | None:
        """The most probable candidate; None where its residuals say that it is none of these."""
        name = self.most_probable
        return name if float(self.explanations[name].p_value) >= float(self.level) else None

    @property
    def _sentences(self) -> tuple[str, ...]:
        name = self.most_probable
        one, share = self.explanations[name], f"{name}, probability {self.probabilities[name]:.4g}"
        p = f"p = {float(one.p_value):.2g}"
        said = f"Most probable: {share}; it leaves nothing but noise ({p})."
        if self.cause is None:
            said = (
                f"None of these explains the record: what the most probable of them leaves ({share}) is "
                f"{one.unusual} ({p})."
            )
        return said, *(f"{name} could not be fitted: {why}" for name, why in self.failures.items())

    @property
    def _rows(self) -> list[tuple[Any, ...]]:
        every = sorted(self.explanations.items(), key=lambda pair: -float(pair[1].log_evidence))
        numbers = lambda one: map(float, (one.log_evidence, one.criterion, one.p_value))
        return [(name, self.probabilities[name], *numbers(one)) for name, one in every]

    def _repr_html_(self) -> str:
        heads = ("candidate", "probability", "log evidence (Laplace)", "BIC", "p of residuals")
        return notebook_table("\n".join(self._sentences), heads, self._rows)

    def __str__(self) -> str:
        width = max(map(len, self.probabilities))
        rows = [
            f"  {name:{width}} {probability:.4f}, log evidence {evidence:.1f}, BIC {criterion:.1f}, "
            f"p of residuals {p:.2g}"
            for name, probability, evidence, criterion, p in self._rows
        ]
        return "\n".join((self._sentences[0], *rows, *self._sentences[1:]))


def diagnose(
    records: Any,
    scene: Scene,
    candidates: Mapping[str, Any],
    parameters: Mapping[str, Any] | None = None,
    *,
    noise: Any = None,
    draws: int = 32,
    starts: int = 2,
    steps: int = 50,
    seed: int = 0,
    level: float = 1e-3,
    progress: bool | None = None,
) -> Diagnosis:
    """`P_k = p_k(z) / sum p_j(z)`: which of several causes explains what was measured.

        log p(z) = log p(z | x, sigma) + log p(x) + n/2 log 2 pi - 1/2 log |H|

    Every candidate is a scene with parameters, fitted as by `fit`; its evidence `p(z)` is Laplace's
    approximation, with a prior that is uniform between the bounds, or in the logarithm where they are
    positive and more than a decade apart. So a candidate with wide bounds pays for what it could have
    explained and was not there. `Explanation.criterion` is Schwarz's (BIC), which needs no prior.
    The sum over minima that are apart counts, as far as the starts have found them. Where two candidates
    explain a record equally well, as faults too small for the noise, the probabilities say so.

    Args:
        records: what was measured, as in `fit`.
        scene: the machine as it should be.
        candidates: by name a pair of what it adds to the scene and its own parameters with bounds. It adds
            an effect, several, nothing (None), or is a function from the scene to another.
            `{"crack": (jr.Crack(0.5, 1e5), {"crack.loss": (1e4, 1e6)}), "unbalance": (None, {})}`.
        parameters: with bounds that are fitted in all candidates, such as those of the unbalance.
        noise: standard deviation of the numbers of a record [m], one or one a record; None: the residuals
            show it, and then their size says nothing.
        draws: points of a Latin hypercube between the bounds, from the scene's own values on, where a
            search may begin; orbits with contact are sought from a motion that has settled at each.
        starts: number of these from which the search is made, the likeliest first.
        steps: greatest number of steps of a search.
        seed: of the draws.
        level: probability below which residuals are no noise, so that none of the candidates is the cause.
        progress: whether to show after two seconds what is being fitted; by default on a terminal.

    Returns:
        A `Diagnosis`. It knows the candidates alone: residuals tell whether another cause is at work.

    Raises:
        ValueError: if an argument is not as described, or no candidate can be fitted.

    Source: Kass, Raftery (1995), Journal of the American Statistical Association 90, 773-795, section
    4.1; MacKay (1998), Machine Learning 33, 77-86; Schwarz (1978), Annals of Statistics 6, 461-464.
    """
    options = {"noise": noise, "draws": draws, "starts": starts, "steps": steps, "seed": seed}
    options |= {"level": level, "progress": progress}
    return diagnose_each([records], scene, candidates, parameters, **options)[0]


def diagnose_each(
    conditions: Any,
    scene: Scene,
    candidates: Mapping[str, Any],
    parameters: Mapping[str, Any] | None = None,
    *,
    noise: Any = None,
    draws: int = 32,
    starts: int = 2,
    steps: int = 50,
    seed: int = 0,
    level: float = 1e-3,
    progress: bool | None = None,
) -> list[Diagnosis]:
    """`diagnose` of many conditions of a machine, or of many like machines, by programs for all of them.

    Args:
        conditions: of each the record, or the records, all of the same kinds, shapes and settings.
        scene: as in `diagnose`, like all arguments that follow.
        candidates: see there.
        parameters: see there.
        noise: see there.
        draws: see there.
        starts: see there.
        steps: see there.
        seed: see there.
        level: see there.
        progress: see there.

    Returns:
        A `Diagnosis` of each.

    Raises:
        ValueError: as `diagnose`.
    """
    check_counts(draws=draws, starts=starts, steps=steps)
    _check_level(level)
    if not isinstance(conditions, list | tuple) or not conditions:
        raise ValueError("`conditions` must be a list of the records of one condition or more.")
    every = [checked(scene, records, {"any": None}) for records in conditions]
    _check_alike(every)
    given = _given_noise(noise, len(every[0]))
    found, failures = {}, {}
    for name, (own, where) in _scenes(scene, candidates, parameters).items():
        with waiting(progress, f"fit of {name}"):
            try:
                search = search_of(own, every[0], where, draws, seed)
            except RuntimeError as error:
                failures[name] = str(error)
                continue
            found[name] = search.explanations(every, given, starts, steps)
    return [
        _diagnosis({name: of[i] for name, of in found.items()}, scene, failures, level)
        for i in range(len(every))
    ]


def _diagnosis(
    found: Mapping[str, Explanation | None], scene: Scene, failures: Mapping[str, str], level: float
) -> Diagnosis:
    """The result of one condition from the explanation by every candidate, None of one that fails."""
    failed = dict(failures)
    failed |= {name: "no prediction is finite" for name, one in found.items() if one is None}
    fitted = {name: one for name, one in found.items() if one is not None}
    if not fitted:
        said = "; ".join(f"{name}: {why}" for name, why in failed.items())
        raise ValueError(f"No candidate can be fitted ({said}); give other bounds or more `draws`.")
    shares = softmax([float(one.log_evidence) for one in fitted.values()])
    probabilities = dict(zip(fitted, map(float, shares), strict=True))
    return Diagnosis(probabilities, fitted, jnp.asarray(level), scene, failed)


# === arguments


def _check_level(level: Any) -> None:
    if not isinstance(level, float) or not 0 < level < 1:
        raise ValueError(f"`level` must be a number between 0 and 1, but is {level!r:.200}.")


def _check_alike(conditions: list[tuple[AbstractRecord, ...]]) -> None:
    """Raise unless all conditions have records of the same kinds and shapes."""
    kinds = [[(type(r).__name__, r.measured.shape) for r in records] for records in conditions]
    for i, kind in enumerate(kinds):
        if kind != kinds[0]:
            raise ValueError(
                f"All conditions must have records of the same kinds and shapes, but condition {i} has "
                f"{kind} and the first one {kinds[0]}; diagnose them by several calls."
            )


def _given_noise(noise: Any, count: int) -> np.ndarray:
    """Known noise of every record, NaN where it is not."""
    if noise is None:
        return np.full(count, np.nan)
    try:
        given = np.asarray(noise, float)
    except (TypeError, ValueError):
        given = np.zeros(0)
    if given.shape not in ((), (count,)) or not (np.isfinite(given) & (given > 0)).all():
        raise ValueError(
            "`noise` must be the positive standard deviation of the numbers of a record [m], or one a "
            f"record, but is {noise!r:.200}; leave it out if it is not known."
        )
    return np.broadcast_to(given, count)


def _scenes(scene: Scene, candidates: Any, parameters: Any) -> dict[str, tuple[Scene, dict]]:
    """Scene and parameters of every candidate."""
    if not isinstance(candidates, Mapping) or len(candidates) < 2:
        raise ValueError(
            "`candidates` must have at least two causes to compare, such as {'unbalance': (None, {}), "
            f"'crack': (jr.Crack(0.5, 1e5), {{'crack.loss': (1e4, 1e6)}})}}, but are {candidates!r:.200}."
        )
    shared = {} if parameters is None else parameters
    found = {}
    for name, pair in candidates.items():
        if not isinstance(name, str) or not isinstance(pair, tuple) or len(pair) != 2:
            raise ValueError(
                f"Candidate {name!r:.100} must be a name with a pair, what it adds to the scene and its "
                f"parameters with bounds, but is {pair!r:.200}."
            )
        adds, own = pair
        for where in (shared, own):
            if not isinstance(where, Mapping) or None in where.values():
                raise ValueError(
                    f"Every parameter of {name} must have bounds, which are what is known of it before, "
                    f"but they are {where!r:.200}."
                )
        check_paths({**shared, **own}, f"parameters of {name}")
        found[name] = _with(scene, adds, name), {**shared, **own}
    return found


def _with(scene: Scene, adds: Any, name: str) -> Scene:
    """The scene with what a candidate adds."""
    if isinstance(adds, AbstractEffect):
        return scene.of_parts(*scene.effects, adds)
    if not (adds is None or callable(adds) or isinstance(adds, list | tuple)):
        raise ValueError(
            f"Candidate {name} must add an effect, a list of them, None, or be a function of a scene, but "
            f"is {adds!r:.200}."
        )
    changed = adds(scene) if callable(adds) else scene.of_parts(*scene.effects, *(adds or ()))
    if not isinstance(changed, Scene):
        raise ValueError(
            f"The function of candidate {name} must return a `Scene`, but returns {changed!r:.200}."
        )
    return changed
