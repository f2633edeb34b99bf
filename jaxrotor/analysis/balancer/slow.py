"""Slow model: the balls move slowly and the rotor follows quasi-statically."""

from collections.abc import Sequence
from typing import Any

import diffrax as dfx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ...core.compiled import compiled_quickly
from .groups import BalancerGroups
from .positions import Positions, checked


def slow_rates(groups: BalancerGroups, positions: Sequence) -> Positions:
    """`psi_i' = (mu_l om^4 / (h_l Delta)) Im( s_z conj(A_z) exp(-i psi_i) )`.

    The model is valid where `om^4 m_l / (h_l^2 |A_z|)` and `m_l / (h_l ha)` are small. It is of first
    order in ball mass, so its stable states are those of `first_approximation`; it has no lag whirl.

    Args:
        groups: the balancer.
        positions: psi [rad], one array per row.

    Returns:
        Rates of the angles, one array per row. Differentiable.

    Raises:
        ValueError: the positions are not one angle per ball.
    """
    flat = _rates(0.0, jnp.concatenate(checked(groups, positions)), groups)
    return tuple(jnp.split(flat, np.cumsum(groups.balls)[:-1]))


def slow_motion(
    groups: BalancerGroups, start: Sequence, times: Any, tolerance: float = 1e-10
) -> tuple[Float[Array, "T _"], ...]:
    """Angles of the slow model over time, by integration of `slow_rates`.

    Args:
        groups: the balancer.
        start: psi [rad] at the first time, one array per row.
        times: ascending dimensionless times tau (T,).
        tolerance: relative and absolute tolerance of the integration.

    Returns:
        Angles [rad] at the times, one array (T, n_l) per row. Differentiable.

    Raises:
        ValueError: `start` is not one angle per ball.
    """
    flat = jnp.concatenate(checked(groups, start))
    angles = _motion(groups, flat, jnp.asarray(times, float), tolerance)
    return tuple(jnp.split(angles, np.cumsum(groups.balls)[:-1], axis=1))


@compiled_quickly
def _motion(groups: BalancerGroups, start: Array, times: Array, tolerance: float) -> Array:
    solution = dfx.diffeqsolve(
        dfx.ODETerm(_rates),
        dfx.Dopri8(),
        times[0],
        times[-1],
        None,
        start,
        groups,
        saveat=dfx.SaveAt(ts=times),
        stepsize_controller=dfx.PIDController(rtol=tolerance, atol=tolerance),
        max_steps=100_000,
    )
    assert solution.ys is not None
    return solution.ys


@compiled_quickly
def _rates(time: Any, psi: Float[Array, " n"], groups: BalancerGroups) -> Float[Array, " n"]:
    moment, drag, coupling = map(groups.per_ball, (groups.moment, groups.drag, groups.coupling))
    turned = jnp.exp(1j * psi)
    total = groups.imbalance + jnp.sum(moment * turned)
    pull = (total * jnp.conj(groups.a_z) * turned.conj()).imag
    return coupling * groups.speed**4 / (drag * groups.determinant) * pull
