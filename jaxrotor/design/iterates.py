"""Iterates: the history of one start of an optimiser, its best iterate, and when it stops."""

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from .target import Evaluation, Weights


INNER = 50  # most steps between two updates of the multipliers
FIRST_PENALTY = 10.0  # in units of the slope of the loss over the square of that of the constraint
LESS = 0.25  # fraction of its excess that may remain of a constraint from update to update
FLAT = 1e-12  # of a loss: a smaller slope by free numbers is rounding
FEASIBLE = 10.0  # times the tolerance: a smaller excess, by free numbers, counts as none


class Iterates:
    """History, best iterate, multipliers and reason to stop of one start; `c` constraints."""

    # Multipliers and penalties are our own: SLSQP of SciPy took 11 evaluations where these took 70 (means
    # over `CONSTRAINED` in tests/design/test_tune.py), but from the guess of notebooks/designs/limiters.py
    # it ended at -5.059, these at -5.120; nor can it use a given optimiser, or run all starts at once.

    def __init__(
        self, u: np.ndarray, constraints: int, squares: bool, tolerance: float | int, scaled: bool
    ):
        self.tolerance, self.squares, self.scaled = tolerance, squares, scaled
        self.count = constraints
        self.reason = ""
        self.changed = False  # whether the target has changed
        self.numbers: list[np.ndarray] = []
        self.losses: list[float] = []
        self.gradients: list[float] = []  # of the augmented loss by free numbers
        self.excess: list[np.ndarray] = []
        self.first, self.best = u, (u, np.inf, np.full(constraints, np.nan))
        self.merit = np.inf, np.inf  # of the best: excess, loss
        self.flattest = np.inf  # gradient of the best
        self.scale, self.largest, self.since, self.violation = 1.0, 0.0, 0, np.inf
        self.multipliers, self.penalties = np.zeros(constraints), np.ones(constraints)
        self.steepness = np.ones(constraints)

    @property
    def weights(self) -> Weights:
        """Weights of the target as it is now."""
        parts = self.scale, self.multipliers, self.penalties
        return Weights(*(jnp.asarray(part, float) for part in parts))

    def scale_by(self, first: Evaluation) -> None:
        """Take the scales of loss and constraints from their slopes at the start."""
        values, slopes = map(np.asarray, first)
        steep = np.linalg.norm(self._slope(values, slopes))
        if self.scaled and steep > 0:
            self.scale = 1 / steep
        steepness = np.linalg.norm(slopes[len(slopes) - self.count :], axis=1)
        self.steepness = np.where(steepness > 0, steepness, 1.0)
        self.penalties = FIRST_PENALTY * (steep if steep > 0 else 1.0) / self.steepness**2

    def add(self, u: np.ndarray, values: np.ndarray, slopes: np.ndarray, change: float) -> None:
        """Record an iterate, and stop or update the multipliers where it is time."""
        self.changed = False
        if not (np.isfinite(values).all() and np.isfinite(slopes).all() and np.isfinite(change)):
            self.reason = f"not finite from step {len(self.losses)}"
            return
        loss, excess = self._loss(values), values[len(values) - self.count :]
        multipliers = np.maximum(0.0, self.multipliers + self.penalties * excess)
        slope = self._slope(values, slopes) + multipliers @ slopes[len(slopes) - self.count :]
        size = float(np.linalg.norm(slope))
        self.numbers.append(u)
        self.losses.append(loss)
        self.gradients.append(size)
        self.excess.append(excess)
        self._keep(u, loss, excess, size)
        self.largest, self.since = max(self.largest, size), self.since + 1
        settled = ""
        if size <= FLAT * abs(loss):
            settled = "gradient within rounding of the loss"
        elif size <= self.tolerance * self.largest:
            settled = f"gradient below {self.tolerance:g} of its largest"
        elif change <= self.tolerance:
            settled = f"step below {self.tolerance:g}"
        if not self.count:
            self.reason = settled
        elif settled or self.since >= INNER:
            self._update(settled, excess, multipliers)
            if self.reason:
                self._end(u, loss, excess)

    def _update(self, settled: str, excess: np.ndarray, multipliers: np.ndarray) -> None:
        """Multipliers `max(0, lambda + rho c)`, and larger penalties where constraints lag."""
        off = np.abs(np.maximum(excess, -self.multipliers / self.penalties)) / self.steepness
        violation = float(np.max(off))
        if settled and violation <= FEASIBLE * self.tolerance:
            self.reason = settled
        lagging = (off > LESS * self.violation) & bool(settled)
        self.multipliers = multipliers
        self.penalties = np.where(lagging, 10 * self.penalties, self.penalties)
        self.violation, self.since, self.changed = violation, 0, True

    def _keep(self, u: np.ndarray, loss: float, excess: np.ndarray, size: float) -> None:
        """Keep the iterate if it is the best: of those that meet all constraints, the one of least loss.

        Of losses that differ by rounding, it is the one of least gradient.
        """
        over = float(np.max(excess / self.steepness, initial=0.0))
        over = 0.0 if over <= FEASIBLE * self.tolerance else over
        least, rounding = self.merit[1], 8 * np.finfo(float).eps * abs(loss)
        same = over == self.merit[0] and abs(loss - least) <= rounding
        if (size < self.flattest) if same else ((over, loss) < self.merit):
            self.best, self.merit, self.flattest = (u, loss, excess), (over, loss), size

    def _end(self, u: np.ndarray, loss: float, excess: np.ndarray) -> None:
        """Keep the last iterate where a best one is lower only by the excess that counts as none."""
        worth = 2 * FEASIBLE * self.tolerance * float(self.multipliers @ self.steepness)
        if self.merit[0] == 0 and loss - self.merit[1] <= worth + 1e-14 * abs(loss):
            self.best = u, loss, excess

    def _loss(self, values: np.ndarray) -> float:
        own = values[: len(values) - self.count]
        return float(own @ own) if self.squares else float(own[0])

    def _slope(self, values: np.ndarray, slopes: np.ndarray) -> Float[np.ndarray, " n"]:
        own = len(values) - self.count
        return 2 * values[:own] @ slopes[:own] if self.squares else slopes[0]
