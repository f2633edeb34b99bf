"""The slow model: balls that creep while the rotor follows them in quasi-static balance."""

from collections.abc import Sequence
from typing import Any

import diffrax as dfx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ...core.compiled import compiled_quickly
from .family import Positions, checked
from .groups import BalancerGroups


def slow_rates(groups: BalancerGroups, positions: Sequence) -> Positions:
    """`psi_i' = (mu_l om^4 / (h_l Delta)) Im( s_z conj(A_z) exp(-i psi_i) )`.

    Valid where `om^4 m_l / (h_l^2 |A_z|)` and `m_l / (h_l ha)` are small; of first order in ball mass, so
    its stable states are those of `first_approximation`, and it knows no lag whirl.
    """
    flat = _rates(0.0, jnp.concatenate(checked(groups, positions)), groups)
    return tuple(jnp.split(flat, np.cumsum(groups.balls)[:-1]))


def slow_motion(
    groups: BalancerGroups, start: Sequence, times: Any, tolerance: float = 1e-10
) -> tuple[Float[Array, "T _"], ...]:
    """Angles [rad] of the slow model at `times` (T,), from `start` at the first; one array a row."""
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
