"""Settling: whether, and after what time, balls balance the rotor for good."""

from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from ...core.quantities import Scalar
from ...effects import AbstractBodies
from ..balancing import total_mass


class Settling(NamedTuple):
    """Time after which a run stays balanced."""

    time: Scalar  # from the start of the run [s], infinite if it is not balanced at its end
    end: Scalar  # end of the run [s]
    left: Scalar  # imbalance at the end as a share of the capacity of the balls [1]

    @property
    def converged(self) -> bool:
        return bool(np.isfinite(self.time))

    def __str__(self) -> str:
        share = f"{float(self.left):.3g} of the balls' capacity is left"
        if self.converged:
            return f"Balanced after {float(self.time):.4g} s; {share} at {float(self.end):.4g} s."
        return f"Not converged in {float(self.end):.4g} s: {share}."


def settling_time(run: Any, within: float = 1e-3) -> Settling:
    """First sample from which on, to the end of the run, the balls are at rest and balance the rotor.

        |u| <= within * capacity,  |psi.| <= within * Omega,  |z| <= within * capacity / mass

    The imbalance may decay as `exp(-t)`, at the limit of the capacity as 1/t, or not at all. A run that is
    not balanced at its end is not converged. The resolution is that of the samples.

    Args:
        run: a `TimeHistory` of a scene with balls, from its start on.
        within: share that counts as balanced.

    Returns:
        `Settling`.

    Raises:
        ValueError: the scene has no balls, or `within` is not positive.
    """
    races = run.scene.of(AbstractBodies)
    if not races:
        raise ValueError(
            "The settling time is that of balls, but the scene has none; give it a `BallBalancer`."
        )
    if not within > 0:
        raise ValueError(f"`within` must be positive, but is {within!r}.")
    capacity = sum(jnp.sum(race.masses) * race.race_radius for race in races)
    share = jnp.abs(run.imbalance) / capacity
    rates = [jnp.where(r.masses > 0, b.rate, 0.0) for r, b in zip(races, run.balls, strict=True)]
    slip = jnp.max(jnp.abs(jnp.concatenate(rates, axis=1)), axis=1)
    radius = jnp.max(jnp.abs(run.displacement), axis=1)
    still = (share <= within) & (slip <= within * jnp.abs(run.speed))
    still &= radius <= within * capacity / total_mass(run.scene)
    for_good = jnp.cumprod(still[::-1])[::-1].astype(bool)
    time = jnp.asarray(run.time)
    first = jnp.where(for_good[-1], time[jnp.argmax(for_good)], jnp.inf)
    return Settling(first, time[-1], share[-1])
