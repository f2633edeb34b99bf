"""Speed tables: coefficients of a scene that are given over its speed of rotation, or over whirl."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ..core.quantities import Scalar, known
from ..effects.base import AbstractOverSpeed
from ..scene import Scene


def has_tables(scene: Scene) -> bool:
    """Whether coefficients of a scene are tables over the speed of rotation."""
    return bool(parts_with_tables(scene))


def parts_with_tables(scene: Scene) -> list[AbstractOverSpeed]:
    """Parts of a scene with coefficients over the speed of rotation."""
    return [part for part in scene.of(AbstractOverSpeed) if part.nodes_over_speed]


def has_whirl_tables(scene: Scene) -> bool:
    """Whether coefficients of a scene are tables over the frequency of whirl."""
    return any(effect.nodes_over_whirl is not None for effect in scene.of(AbstractOverSpeed))


def whirl_range(scene: Scene) -> tuple[Scalar, Scalar, bool]:
    """Frequencies [rad/s] between which roots are sought, and whether there are roots above, too.

    Where all tables over whirl are held, these are zero and the highest node.
    """
    every = [(one.nodes_over_whirl, one.hold) for one in scene.of(AbstractOverSpeed)]
    tables = [(nodes, hold) for nodes, hold in every if nodes is not None]
    ends = [(nodes[0], nodes[-1]) for nodes, hold in tables if not hold]
    if not ends:
        return jnp.zeros(()), jnp.max(jnp.stack([nodes[-1] for nodes, _ in tables])), True
    lows, highs = (jnp.stack(side) for side in zip(*ends, strict=True))
    return jnp.max(lows), jnp.min(highs), False


def at_own_speed(scene: Scene, part: Any) -> Any:
    """A part of a scene with its coefficients at the speed of the scene at t = 0."""
    if isinstance(part, AbstractOverSpeed) and part.nodes_over_whirl is not None:
        raise ValueError(
            f"Coefficients of {scene.name_of(part)} are tables over the frequency of whirl, which only a "
            "harmonic motion has; take `roots`, `growth_rate`, `onset_speed`, `stability_crossings`, "
            "`stability_map`, `campbell`, `critical_speeds` or `unbalance_response`, or the numbers at "
            "one frequency, `support.at_whirl(frequency)`."
        )
    if isinstance(part, AbstractOverSpeed) and part.nodes_over_speed:
        return part.at_speed(scene.spin.speed)
    return part


def speed_range(scene: Scene) -> tuple[Scalar, Scalar] | None:
    """Speeds [rad/s] between which all tables of a scene have values; None where there is no limit."""
    tables = [one.nodes_over_speed for one in scene.of(AbstractOverSpeed) if not one.hold]
    ends = [(nodes[0], nodes[-1]) for own in tables for nodes in own]
    if not ends:
        return None
    lows, highs = (jnp.stack(side) for side in zip(*ends, strict=True))
    return jnp.max(lows), jnp.min(highs)


def check_no_tables(scene: Scene, what: str) -> None:
    """Raise if coefficients of a scene are tables; `what` needs numbers."""
    if has_whirl_tables(scene):
        raise ValueError(
            f"{what} is for constant coefficients, but supports have tables over the frequency of whirl; "
            "give their numbers at one frequency, `support.at_whirl(frequency)`."
        )
    if has_tables(scene):
        raise ValueError(
            f"{what} is for constant coefficients, but supports have tables over the speed; give their "
            "numbers at one speed, `support.at_speed(speed)`."
        )


def check_tables(scene: Scene, speeds: Any = None) -> None:
    """Raise unless tables of a scene have values at some speeds, by default its own, if all are known."""
    span = speed_range(scene)
    if span is None:
        return
    speeds = scene.spin.speed if speeds is None else speeds
    if not all(map(known, jax.tree.leaves((speeds, span)))):
        return
    low, high = map(float, span)
    if low > high:
        raise ValueError(
            f"The tables of the supports have no speed in common: one begins at {low:g} rad/s, where "
            f"another has ended at {high:g} rad/s; extend one, or give `hold=True`."
        )
    every = np.ravel(np.asarray(speeds, float))
    outside = every[(every < low) | (every > high)]
    if outside.size:
        raise ValueError(
            f"The tables of the supports are for speeds from {low:g} to {high:g} rad/s, but coefficients "
            f"are needed at {outside[0]:g} rad/s; extend the tables, or give `hold=True`, which takes "
            "them as constant beyond their ends."
        )
