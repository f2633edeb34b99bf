"""Stability: onset speed, critical speeds, growth and damping of modes as objectives."""

from typing import Any

import jax
import jax.numpy as jnp

from ... import analysis
from ...core.extremes import largest
from ...core.quantities import Scalar
from ...scene import Scene
from .means import over


def onset_speed(
    scene: Scene, within: tuple[float, float] | None = None, samples: int = 200
) -> Scalar:
    """`|Omega*|` [rad/s] with `max Re lambda(Omega*) = 0`, rising; see `jaxrotor.onset_speed`.

    Smooth while the same whirl is the first to grow. It jumps where a band of instability opens or
    closes below, and its slope grows without bound where two crossings merge (a tongue's tip).

    Args:
        scene: the rotor.
        within: speeds to search [rad/s], as in `jaxrotor.onset_speed`.
        samples: growth rates computed to bracket the onset.

    Returns:
        The onset speed [rad/s], positive for reversed rotation too; not a number where there is none.
    """
    return jnp.abs(analysis.onset_speed(scene, within, samples, throw=False).speed)


def critical_gap(scene: Scene, order: int = 0) -> Scalar:
    """`|P_along| - |P_across|` [rad/s] of the critical speeds of an unequal shaft; see `axis_speeds`.

    Signed, so smooth through zero, where its square is least and the band between the two speeds
    closes; the sorted difference has a kink there.

    Args:
        scene: a rotor of unequal axes.
        order: number of the critical speed, counted from 0.

    Returns:
        The difference [rad/s].

    Source: Klochkov, eq. (17).
    """
    along, across = analysis.axis_speeds(scene)
    return jnp.abs(along[order]) - jnp.abs(across[order])


def largest_growth(scene: Scene, speeds: Any, sharpness: float | int | None = None) -> Scalar:
    """`max_Omega max Re lambda` [1/s] over given speeds, or a smooth mean, `log( mean exp(s r) ) / s`.

    Without the sharpness `s` it has kinks, where the largest moves to another speed or another root, and
    at exceptional points the slope grows as `1 / sqrt(distance)`. At a kink the derivative is a mean of
    both sides. It may be flat over whole ranges: without internal damping, away from bands of
    instability, every root has the same decay. The smooth mean lies below the largest, and its minimum
    elsewhere. Least growth is not least anisotropy.

    Args:
        scene: the rotor.
        speeds: one or many [rad/s].
        sharpness: `s` of the smooth mean [s]; None for the largest.

    Returns:
        The growth rate [1/s], negative where every motion decays.

    Source: sheet of the rotor of two stiffnesses, section 4.
    """
    rates = over(speeds, lambda speed: analysis.growth_rate(scene.at_speed(speed)))
    if sharpness is None:
        return largest(rates)
    return (jax.nn.logsumexp(sharpness * rates) - jnp.log(rates.size)) / sharpness


def damping_ratio(scene: Scene, mode: int = 0) -> Scalar:
    """`-Re lambda / |lambda|` [1] of one of the `jaxrotor.modes`.

    Smooth while modes keep their order; it jumps to another mode where two are equally fast, and its
    slope grows without bound where two roots merge.

    Args:
        scene: the rotor.
        mode: number of the mode, counted from the slowest, 0.

    Returns:
        The damping ratio [1].
    """
    return analysis.modes(scene, mode + 1).damping_ratio[mode]
