"""Outcome: how a run went, and in which words a data set says so of every lane."""

import math
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Int


LARGEST_RATIO = {2: 2.0, 4: 0.5}  # by order: beyond it a bounce gains energy on average
STATUS = (
    "ok",
    "not_finite",
    "whirl_undefined",
    "solver_gave_up",
    "start_or_steady_response_undefined",
    "steps_too_long_for_a_stop",
    "not_computed",
)
NONE = ("not_finite", "solver_gave_up", "start_or_steady_response_undefined", "not_computed")
FAILED = tuple(map(STATUS.index, NONE))


class Outcome(eqx.Module):
    """How some revolutions went; `a & b` is how both did."""

    finite: Bool[Array, "*lanes"]
    solved: Bool[Array, "*lanes"]  # the solver met its tolerance in the steps it had
    unresolved: Int[Array, "*lanes"]  # steps whose changes of contact were not located
    touched: Bool[Array, "*lanes"]  # by more than the root of the precision, if `Exponential` steps

    @classmethod
    def good(cls, *shape: int) -> "Outcome":
        yes, no = jnp.ones(shape, bool), jnp.zeros(shape, bool)
        return cls(yes, yes, jnp.zeros(shape, int), no)

    @property
    def ok(self) -> Bool[Array | np.ndarray, "*lanes"]:
        """Whether there is a result."""
        return self.finite & self.solved

    def __and__(self, other: "Outcome") -> "Outcome":
        return Outcome(
            self.finite & other.finite,
            self.solved & other.solved,
            self.unresolved + other.unresolved,
            self.touched | other.touched,
        )


def too_long(ratio: Any, order: int) -> Any:
    """Whether a stop answers within a step, see `March.contact_stiffness_ratio` (.., 2)."""
    return ratio.sum(-1) > LARGEST_RATIO[order]


def steps_needed(ratio: Any, order: int, steps: int) -> int:
    """Steps a revolution at which `elastic / r^2 + viscous / r` is at its limit, `r` times as many."""
    (elastic, viscous), limit = map(float, ratio), LARGEST_RATIO[order]
    return math.ceil(steps * (viscous + math.sqrt(viscous**2 + 4 * elastic * limit)) / (2 * limit))


def failed(status: Any) -> np.ndarray:
    """Which lanes have no result, by the `status` of a data set."""
    return np.isin(status, FAILED)


def statuses(
    outcome: Outcome, started: np.ndarray, undefined: np.ndarray, overlong: np.ndarray
) -> np.ndarray:
    """Numbers in `STATUS` of lanes, the first reason that holds."""
    reasons = {
        "start_or_steady_response_undefined": ~started,
        "solver_gave_up": ~np.asarray(outcome.solved),
        "not_finite": ~np.asarray(outcome.finite),
        "steps_too_long_for_a_stop": overlong,
        "whirl_undefined": undefined,
    }
    numbers = [STATUS.index(name) for name in reasons]
    return np.select(list(reasons.values()), numbers, 0).astype(np.int8)
