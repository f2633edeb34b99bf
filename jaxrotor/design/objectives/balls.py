"""Balls: time and success of automatic balancing as objectives."""

from typing import Any

import jax.numpy as jnp
from jaxtyping import Array, Float

from ...core.quantities import Scalar
from ...effects import AbstractBodies
from ...motion.run_up import run_up
from ...scene import Scene


def balancing_time(scene: Scene, times: Any, **run: Any) -> Scalar:
    """`Int |u| dt / |u(0)|` [s], `u` the imbalance of rotor and balls: `T` of one like `exp(-t / T)`.

    Smooth where the imbalance does not pass exactly through zero and balls do not collide. The time
    of `balancer.settling_time`, the first sample from which on all is still, is a step function of every
    parameter and has no derivative to tune by.

    Args:
        scene: a rotor with balls.
        times: of the samples, ascending [s]; the run should end when balance is reached.
        **run: `start`, `controller` and other options of `run_up`.

    Returns:
        The time [s].

    Raises:
        ValueError: if the scene has no balls.
    """
    sizes = _imbalance(scene, times, run)
    return jnp.trapezoid(sizes, jnp.asarray(times, float)) / sizes[0]


def residual_imbalance(scene: Scene, times: Any, share: float = 0.25, **run: Any) -> Scalar:
    """`sqrt( mean |u|^2 ) / capacity` [1] over the last `share` of a run, `u` the imbalance left.

    Smooth unless it is zero or balls collide; flat once all is balanced, within the tolerance of the
    run.

    Args:
        scene: a rotor with balls.
        times: of the samples, ascending [s].
        share: fraction of the samples, from the end.
        **run: `start`, `controller` and other options of `run_up`.

    Returns:
        The imbalance over the greatest that the balls can balance [1].

    Raises:
        ValueError: if the scene has no balls.
    """
    sizes = _imbalance(scene, times, run)
    capacity = sum(jnp.sum(race.masses) * race.race_radius for race in scene.of(AbstractBodies))
    last = sizes[-max(1, round(share * sizes.size)) :]
    return jnp.sqrt(jnp.mean(last**2)) / capacity


def _imbalance(scene: Scene, times: Any, run: dict[str, Any]) -> Float[Array, " T"]:
    """Size of the imbalance left [kg m]."""
    if not scene.of(AbstractBodies):
        raise ValueError("The scene has no balls to balance it; give it a `BallBalancer`.")
    return jnp.abs(run_up(scene, times, **run).imbalance)
