"""Stability limits of balanced positions: over speed, polar inertia, or two parameters."""

import functools
from collections.abc import Mapping
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float

from ...core.compiled import compiled_quickly
from ...core.quantities import Scalar, known
from ...core.roots import implicit_root, sign_change
from ..maps import CHUNK, traced
from .groups import BalancerGroups
from .linear import growth_rate


PARAMETERS = ("speed", "damping", "polar", "drag", "mass")  # stability depends on these


def stability_speed(
    groups: BalancerGroups,
    beta: Complex[Array, " r"],
    within: tuple[float, float] = (0.5, 5.0),
    samples: int = 200,
) -> Scalar:
    """Speed om* above which a balanced position stays stable up to the end of the range.

    It is above the critical speed, from which on the first approximation predicts stability (a11 < 0), by
    about `m_l / (h_l ha)`: see `boundary_shift`.

    Args:
        groups: the balancer; its speed does not matter.
        beta: `second_harmonics` of the position.
        within: lowest and highest speed.
        samples: growth rates computed to bracket the crossing.

    Returns:
        Speed to 1e-14 of the range, differentiable by the implicit function theorem.

    Raises:
        ValueError: the position is unstable at the end of the range, or stable throughout.
    """
    held = jax.lax.stop_gradient((groups, jnp.asarray(beta, complex)))
    speeds = jnp.linspace(*within, samples)
    growth = _growth_at(*held, speeds)
    unstable = growth > 0
    refusals = [
        (unstable[-1], "The position is unstable at the highest speed"),
        (~jnp.any(unstable), "The position is stable at every speed"),
    ]
    for wrong, sentence in refusals:
        if known(wrong):
            if bool(wrong):
                low, high = within
                raise ValueError(f"{sentence} from {low:g} to {high:g}; change `within`.")
        else:
            speeds = eqx.error_if(speeds, wrong, f"{sentence} searched; change `within`.")
    last = samples - 1 - jnp.argmax(unstable[::-1])
    ends = speeds[last], speeds[last + 1], growth[last], growth[last + 1]
    speed, slope = _regained(*held, *ends)
    residual = growth_rate(_at_speed(groups, speed), beta)
    return speed - (residual - jax.lax.stop_gradient(residual)) / slope


@compiled_quickly
def _regained(groups: BalancerGroups, beta: Array, *ends: Array):
    """Speed where growth ends, between two with their growth, and the slope of growth there."""
    growth = lambda om: growth_rate(_at_speed(groups, om), beta)
    speed = sign_change(growth, *ends, rises=False)
    return speed, jax.grad(growth)(speed)


def _at_speed(groups: BalancerGroups, speed: Any) -> BalancerGroups:
    return eqx.tree_at(lambda g: g.speed, groups, jnp.asarray(speed, float))


@compiled_quickly
def _growth_at(groups: BalancerGroups, beta: Array, speeds: Array) -> Float[Array, " k"]:
    return jax.lax.map(lambda om: growth_rate(_at_speed(groups, om), beta), speeds)


@compiled_quickly
def polar_limit(groups: BalancerGroups, beta: Complex[Array, " r"]) -> Scalar:
    """Largest polar inertia C at which balance is stable at high speed without damping and drag.

        y^2 (y + q^2) - 2 m y (y^2 - 3 C y - q) + (y + 1)^3 (m^2 - |n|^2) = 0,  q = 1 - C
        m = sum m_l,  n = sum m_l beta_l

    must have real roots only (they are then all negative). `1 - C` grows like the cube root of the ball
    mass, so C < 1 alone is far from sufficient.

    Args:
        groups: the balancer; only the ball masses matter.
        beta: `second_harmonics` of the position.

    Returns:
        C, at most 1, and 0 if there is none. Differentiable.
    """
    held = jax.lax.stop_gradient((groups.mass, jnp.asarray(beta, complex)))
    discriminant = lambda polar: _discriminant(polar, *held)
    grid = jnp.linspace(0.0, 1.0, 1001)
    values: Any = jax.vmap(discriminant)(grid)
    inside = values >= 0  # all roots are real
    first = jnp.argmin(inside)  # 0 also if all are inside
    ends = jnp.stack([jnp.maximum(first - 1, 0), jnp.maximum(first, 1)])
    found = sign_change(discriminant, *grid[ends], *values[ends], rises=False)
    limit = implicit_root(lambda polar: _discriminant(polar, groups.mass, beta), found)
    return jnp.where(first > 0, limit, jnp.where(inside[0], 1.0, 0.0))


def _discriminant(polar: Any, mass: Array, beta: Array) -> Scalar:
    """Discriminant of the cubic of `polar_limit`, not negative where all its roots are real."""
    q, m = 1 - polar, jnp.sum(mass)
    gap = m**2 - jnp.abs(jnp.sum(mass * beta)) ** 2
    a, b, c, d = 1 - 2 * m + gap, q**2 + 6 * m * polar + 3 * gap, 2 * m * q + 3 * gap, gap
    return 18 * a * b * c * d - 4 * b**3 * d + b**2 * c**2 - 4 * a * c**3 - 27 * a**2 * d**2


class StabilityChart(eqx.Module):
    """Growth rate of a balanced position over two parameters, beside the sign of a11."""

    growth_unit: ClassVar[str] = "omega0"

    x: Float[np.ndarray, " a"]  # values of the first parameter
    y: Float[np.ndarray, " b"]  # values of the second parameter
    growth: Float[np.ndarray, "a b"]  # largest real part; unstable above zero
    a11: Float[np.ndarray, "a b"]  # the first approximation predicts stability below zero
    boundaries: tuple[Float[np.ndarray, "_ 2"], ...]  # curves (x, y) of zero growth
    paths: tuple[str, str] = eqx.field(static=True)
    units: tuple[str, str] = eqx.field(static=True)

    @property
    def misjudged(self) -> np.ndarray:
        """Mask (a, b) of points where a11 < 0 predicts stability but the exact growth is positive."""
        return (self.a11 < 0) & (self.growth > 0)


def stability_chart(
    groups: BalancerGroups, beta: Complex[Array, " r"], over: Mapping[str, Any]
) -> StabilityChart:
    """Exact growth rate over two of speed, damping, polar, drag, mass, and its zero curves.

    Args:
        groups: the balancer.
        beta: `second_harmonics` of the position.
        over: two names and ascending values of each. Values of `drag` and `mass` are factors on all
            rows: `{"speed": .., "mass": [0.1, 0.5, 1.0]}`.

    Returns:
        `StabilityChart`, boundaries to 1e-10 of a cell. Not differentiable; `stability_speed` is.

    Raises:
        ValueError: `over` does not name two of the parameters, or values are not two or more ascending
            numbers from zero on.
    """
    if len(over) != 2 or not set(over) <= set(PARAMETERS):
        raise ValueError(
            f"`over` must name two of {', '.join(PARAMETERS)}, but names {', '.join(over) or 'none'}."
        )
    first, second = over
    names = first, second
    x, y = (_ascending(name, values) for name, values in over.items())
    evaluate = functools.partial(_chart, groups, jnp.asarray(beta, complex), names)
    growth, boundaries = traced(evaluate, x, y)
    a11 = np.array([[float(_with(groups, names, (a, b)).a11) for b in y] for a in x])
    return StabilityChart(x, y, growth, a11, boundaries, names, ("1", "1"))


def _ascending(name: str, values: Any) -> np.ndarray:
    values = np.asarray(values, float)
    if values.ndim != 1 or values.size < 2 or not np.all(np.diff(values) > 0) or values[0] < 0:
        raise ValueError(
            f"`over['{name}']` must be two or more ascending values, none negative, but is {values}."
        )
    return values


def _with(groups: BalancerGroups, names: tuple[str, ...], point: Any) -> BalancerGroups:
    for name, value in zip(names, point, strict=True):
        old = getattr(groups, name)
        new = old * value if name in ("drag", "mass") else jnp.asarray(value, float)
        groups = eqx.tree_at(lambda g, name=name: getattr(g, name), groups, new)
    return groups


def _chart(groups: BalancerGroups, beta: Array, names: tuple[str, ...], *values: np.ndarray):
    """Growth rates at points (k,), twice, (2, k), as `traced` expects them."""
    points = np.stack(values)
    count = points.shape[1]
    points = np.pad(points, [(0, 0), (0, -count % CHUNK)], mode="edge")
    chunks = np.split(points, points.shape[1] // CHUNK, axis=1)
    found = np.concatenate([_chart_chunk(groups, beta, names, jnp.asarray(c.T)) for c in chunks])
    return np.stack([found[:count]] * 2)


@compiled_quickly
def _chart_chunk(groups: BalancerGroups, beta: Array, names: tuple[str, ...], points: Array):
    return jax.lax.map(lambda point: growth_rate(_with(groups, names, point), beta), points)
