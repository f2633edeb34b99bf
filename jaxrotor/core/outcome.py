"""Outcome of a run, and the status that data sets give for every lane."""

from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Int

from .quantities import known


LARGEST_RATIO = {2: 2.0, 4: 0.5}  # by order of the step: above it a rebound gains energy on average
# Steps of a rebound that leave an error of about 1 %, by order and whether located: see docs/choosing.md.
FEWEST = {(2, False): 12, (4, False): 12, (2, True): 8, (4, True): 4}
STATUS = (
    "ok",
    "not_finite",
    "whirl_undefined",
    "solver_gave_up",
    "start_or_steady_response_undefined",
    "steps_too_long_for_a_stop",
    "not_computed",
)
WITHOUT_RESULT = (
    "not_finite",
    "solver_gave_up",
    "start_or_steady_response_undefined",
    "not_computed",
)
FAILED = tuple(map(STATUS.index, WITHOUT_RESULT))


class Outcome(eqx.Module):
    """Outcome of some revolutions; `a & b` is the outcome of both together."""

    finite: Bool[Array, "*lanes"]
    solved: Bool[Array, "*lanes"]  # the solver met its tolerance within its number of steps
    unresolved: Int[Array, "*lanes"]  # steps whose changes of contact were not located
    touched: Bool[Array, "*lanes"]  # a stop changed the state by more than sqrt(eps)

    @classmethod
    def good(cls, *shape: int) -> "Outcome":
        """Outcome of a run without any failure."""
        yes, no = jnp.ones(shape, bool), jnp.zeros(shape, bool)
        return cls(yes, yes, jnp.zeros(shape, int), no)

    @property
    def ok(self) -> Bool[Array | np.ndarray, "*lanes"]:
        """Whether the run has a result."""
        return self.finite & self.solved

    def __and__(self, other: "Outcome") -> "Outcome":
        return Outcome(
            self.finite & other.finite,
            self.solved & other.solved,
            self.unresolved + other.unresolved,
            self.touched | other.touched,
        )


def too_long(ratio: Any, order: int) -> Any:
    """Whether steps are too long for the stiffest stop, from `contact_stiffness_ratio` (.., k, 2)."""
    return ratio.sum(-1).max(-1, initial=0.0) > LARGEST_RATIO[order]


def gains_energy(touched: Any, ratio: Any, order: int) -> bool:
    """Whether, of known results, a stop was touched that is too stiff for the steps."""
    return known(ratio) and known(touched) and bool(touched) and bool(too_long(ratio, order))


def more_needed(ratio: np.ndarray, order: int) -> float:
    """How many times as many steps, `r`, bring `elastic / r^2 + viscous / r` of all stops to its limit."""
    (elastic, viscous), limit = ratio.T, LARGEST_RATIO[order]
    return float(np.max(viscous + np.sqrt(viscous**2 + 4 * elastic * limit)) / (2 * limit))


def rebound_steps(ratio: Any) -> np.ndarray:
    """Steps of a rebound from every stop, `pi / (w h)`, from `contact_stiffness_ratio` (.., 2).

    `w h` is the larger root of `x^2 = 2 elastic + viscous x`: `sqrt(k / m) h` of a stop without damping.
    """
    elastic, viscous = np.moveaxis(np.asarray(ratio), -1, 0)
    with np.errstate(divide="ignore"):
        return 2 * np.pi / (viscous + np.sqrt(viscous**2 + 8 * elastic))


def failed(status: Any) -> np.ndarray:
    """Whether each lane lacks a result, from the `status` of a data set."""
    return np.isin(status, FAILED)


def statuses(
    outcome: Outcome, started: np.ndarray, undefined: np.ndarray, overlong: np.ndarray
) -> np.ndarray:
    """Index in `STATUS` of the first reason that holds, for every lane."""
    reasons = {
        "start_or_steady_response_undefined": ~started,
        "solver_gave_up": ~np.asarray(outcome.solved),
        "not_finite": ~np.asarray(outcome.finite),
        "steps_too_long_for_a_stop": overlong,
        "whirl_undefined": undefined,
    }
    numbers = [STATUS.index(name) for name in reasons]
    return np.select(list(reasons.values()), numbers, 0).astype(np.int8)
