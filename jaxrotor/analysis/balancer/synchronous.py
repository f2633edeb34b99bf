"""Unbalanced steady states in which the balls rotate with the rotor, all on one line."""

import itertools
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex

from ...core.extremes import largest
from ...core.quantities import Scalar
from .critical import labellings
from .groups import BalancerGroups
from .relative import whirl_spectrum


class SynchronousState(NamedTuple):
    """`psi = angle`, or `angle + pi` for `sides` of each row: steady state in axes of the rotor."""

    angle: Scalar  # psi* [rad], 0 to 2 pi
    sides: tuple[int, ...]  # j_l: balls of each row at psi* + pi
    imbalance: Complex[Array, ""]  # s_z
    delta: Complex[Array, ""]  # tilt
    growth: Scalar  # largest real part of the full model's roots, stable if negative
    labellings: int  # number of states of numbered balls that it represents


def synchronous_states(groups: BalancerGroups) -> list[SynchronousState]:
    """All steady states with `s0 != 0` that are not balanced, by rising growth rate.

        sin(psi* + arg A_z) = -N a12 / (s0 |A_z|),  N = sum S_l (n_l - 2 j_l)
        s_z = s0 + N exp(i psi*),  delta = i om^2 s_z / A_z

    Changing all sides and psi* by pi gives the same state, which is listed once. The state with all balls
    at psi* exists where s0 |A_z| >= a12 sum n_l S_l; there the balls increase the imbalance. Without
    imbalance the states rotate at a rate of their own: see `lag_whirl`.

    Args:
        groups: a balancer with imbalance.

    Returns:
        List of `SynchronousState`. Not traceable.

    Raises:
        ValueError: the imbalance is zero.
    """
    if float(groups.imbalance) == 0:
        raise ValueError(
            "Synchronous states need an imbalance above zero, but it is 0; use `lag_whirl`."
        )
    states = []
    for sides in itertools.product(*(range(n + 1) for n in groups.balls)):
        opposite = tuple(n - j for n, j in zip(groups.balls, sides, strict=True))
        if sides > opposite:
            continue
        signs = [[1] * (n - j) + [-1] * j for n, j in zip(groups.balls, sides, strict=True)]
        net = sum(s * sum(sign) for s, sign in zip(groups.moment, signs, strict=True))
        size = groups.imbalance * jnp.abs(groups.a_z)
        if float(jnp.abs(net) * groups.a12) > float(size):
            continue
        lean = jnp.arcsin(-net * groups.a12 / size)
        # If half of every row is on either side, both angles are the same state.
        for branch in (lean, jnp.pi - lean)[: 1 if sides == opposite else 2]:
            angle = jnp.mod(branch - jnp.angle(groups.a_z), 2 * jnp.pi)
            total = groups.imbalance + net * jnp.exp(1j * angle)
            delta = 1j * groups.speed**2 * total / groups.a_z
            placed = [angle + np.pi * (np.array(sign) < 0) for sign in signs]
            growth = largest(whirl_spectrum(groups, placed, delta).real)
            count = labellings(groups.balls, sides)
            states.append(SynchronousState(angle, sides, total, delta, growth, count))
    return sorted(states, key=lambda state: float(state.growth))


def wrong_side_speed(groups: BalancerGroups) -> Scalar:
    """`s0 |A_z| = N a12`: speed below the critical one up to which all balls can rest on the heavy side.

    Args:
        groups: a balancer with imbalance; its speed does not matter.

    Returns:
        Speed, NaN where the balls can rest there at every speed. Differentiable.
    """
    # With w = om^2: (1 - w (1 - C))^2 = w ha^2 ((N / s0)^2 - 1).
    long = 1 - groups.polar
    extra = groups.damping**2 * ((groups.capacity / groups.imbalance) ** 2 - 1)
    half = long + extra / 2
    inside = half**2 - long**2
    limited = (extra > 0) & (half > 0) & (inside > 0)
    root = jnp.sqrt(jnp.where(limited, inside, 1.0))
    return jnp.where(limited, jnp.sqrt(1 / jnp.where(limited, half + root, 1.0)), jnp.nan)
