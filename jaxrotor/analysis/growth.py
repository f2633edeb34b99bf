"""Growth rate of a rotor, from its roots or its Floquet exponents."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..core.compiled import compiled_quickly
from ..core.extremes import largest
from ..core.quantities import Scalar, known
from ..equations.pencil import Pencil, is_rounding
from ..equations.system import System
from ..scene import Scene
from .floquet import exponents
from .linearized import check_linear
from .whirl_tables import OverWhirl


EDGES = (0.0, 0.02, 0.98, 1.0)  # places in a bracket where growth is sampled, see `undamped_side`
FAST = 100  # times the first natural frequency, beyond which a growing root loses digits
UNRESOLVED = 1000  # times the first one, as mode 30 of a shaft: no discretisation resolves it
# Steps per half revolution; the smallest number that resolves the first mode is used.
STEPS = (32, 128, 512)
TOO_SLOW = "The lowest speeds are too low for Floquet multipliers"
BEYOND = (
    "A whirl beyond the tables over its frequency may be unstable, as it is with the coefficients at "
    "their end (give wider tables, or `hold=True`)"
)


def growth_rate(scene: Scene) -> Scalar:
    """`max Re lambda`: largest growth rate of the straight rotor, stable where it is negative.

    `lambda` are its `roots` or, where no frame has constant coefficients, the Floquet exponents
    `log(mu) / T`, with the smallest number of `STEPS` that resolves the first mode (where traced, with
    the smallest of all). At rest such a rotor has the roots of its present position.

    Args:
        scene: the rotor at its own speed.

    Returns:
        Growth rate [1/s], zero where it is within rounding. Differentiable. NaN where the speed is too
        low for the steps: below 1/30 of the first natural frequency where traced, else below 1/490; and,
        where traced, if a whirl beyond tables over its frequency may grow.

    Raises:
        ValueError: tables of coefficients have no values at the speed of the scene, or a whirl beyond
            tables over its frequency grows with the coefficients at their end.
    """
    check_linear(scene)
    system = OverWhirl.of(scene)
    growth = _growth_rate(system, STEPS[0])
    if isinstance(system, OverWhirl) and known(growth) and np.isnan(growth):
        raise ValueError(f"{BEYOND}.")
    for steps in STEPS[1:]:
        if known(growth) and np.isnan(growth):
            growth = _growth_rate(system, steps)
    return growth


def why_unknown(over_whirl: bool) -> str:
    """Beginning of a sentence that says why a growth rate is NaN, with or without tables over whirl."""
    return BEYOND if over_whirl else TOO_SLOW


@compiled_quickly
def _growth_rate(system: System | OverWhirl, steps: int) -> Scalar:
    return growth_of(system, steps)[0]


@compiled_quickly
def growth_rates(system: System | OverWhirl, speeds: Float[Array, " k"]) -> Float[Array, " k"]:
    """Growth rates [1/s] at some speeds [rad/s], as `growth_rate` where traced."""
    return jax.lax.map(lambda speed: growth_of(system.at_speed(speed))[0], speeds)


def growth_of(system: System | OverWhirl, steps: int = STEPS[0]) -> tuple[Scalar, Scalar]:
    """Largest growth rate [1/s] with rounding set to zero, and as computed."""
    values = exponents(system, steps)
    return beyond_rounding(values, first_frequency(system)), largest_growth(values)


def undamped_side(ends: Any) -> Any:
    """Whether growth (4, ..) at `EDGES` of a bracket is only rounding near one end of it.

    The rotor is then marginally stable on that side, where growth has no sign to search by: the boundary
    is where growth exceeds rounding. Two places are tested, as at one growth may be zero by chance.
    """
    still = ends == 0
    return still[:2].all(0) | still[2:].all(0)


def first_frequency(system: System | OverWhirl) -> Scalar:
    """Scale [rad/s] of the order of the first natural frequency."""
    return Pencil.mean(system.at_rest).rate


def largest_growth(values: Array) -> Scalar:
    """Largest real part of finite roots [1/s], as computed."""
    return largest(values.real)


def beyond_rounding(values: Array, first: Scalar) -> Scalar:
    """Largest growth rate [1/s], zero where it is within rounding.

    Roots have the digits of their inverses, so that a fast one that seems to grow has fewer. The fastest
    modes of a discretised shaft have hardly any motion at its dampers, so that those within rounding
    count for nothing beside slower ones.
    """
    size = jnp.maximum(jnp.abs(values), first)
    small = is_rounding(values.real, size)
    small = small | (values.real > 0) & is_rounding(values.real, size * size / (FAST * first))
    still = jnp.where(size > UNRESOLVED * first, -jnp.inf, 0.0)
    return jnp.max(jnp.where(jnp.isfinite(values) & small, still, values.real))


def rate_over_speed(system: System | OverWhirl) -> Callable[[Scalar], Scalar]:
    """The function from a speed [rad/s] to the largest growth rate [1/s]."""
    first = first_frequency(system)
    return lambda speed: beyond_rounding(roots_at(system, speed), first)


def roots_at(system: System | OverWhirl, speed: Scalar) -> Array:
    """Roots or Floquet exponents [1/s] at a speed [rad/s]."""
    return exponents(system.at_speed(speed))
