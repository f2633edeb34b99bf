"""Settling: how long balls take to balance, or that they do not."""

from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from ...core.quantities import Scalar
from ...effects import AbstractBodies
from ..balancing import total_mass


class Settling(NamedTuple):
    """Whether and when a run is balanced for good."""

    time: Scalar  # from the start of the run [s], infinite where it is not
    end: Scalar  # of the run [s]
    left: Scalar  # imbalance at the end, of the capacity of the balls [1]

    @property
    def converged(self) -> bool:
        return bool(np.isfinite(self.time))

    def __str__(self) -> str:
        share = f"{float(self.left):.3g} of the balls' capacity is left"
        if self.converged:
            return f"Balanced after {float(self.time):.4g} s; {share} at {float(self.end):.4g} s."
        return f"Not converged in {float(self.end):.4g} s: {share}."


def settling_time(run: Any, within: float = 1e-3) -> Settling:
    """First sample from which on, to the end of the run, all is still and balanced.

        |u| <= within * capacity,  |psi.| <= within * Omega,  |z| <= within * capacity / mass

    Balance may come as `exp(-t)`, at the limit of the capacity only as 1/t, or never: the run is the
    cap, and one that is not balanced at its end is not converged. It is as sharp as its samples.

    Args:
        run: a `RunUp` of a scene with balls, from its start on.
        within: share that counts as balanced.
    """
    races = run.scene.of(AbstractBodies)
    if not races:
        raise ValueError("Only a run with balls settles so; give the scene a `BallBalancer`.")
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
