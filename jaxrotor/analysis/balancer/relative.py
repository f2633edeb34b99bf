"""Linear motion of the full model about a steady whirl, in which rotor and balls share one rate."""

from collections.abc import Sequence

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Complex, Float

from ...core import linalg
from ...core.compiled import compiled_quickly
from ...core.quantities import Scalar
from .family import checked
from .groups import BalancerGroups
from .linear import matrix_roots


def whirl_spectrum(
    groups: BalancerGroups,
    positions: Sequence,
    delta: Array | complex = 0.0,
    rate: Array | float | None = None,
) -> Complex[Array, " k"]:
    """Roots (4 + 2 n) of the full model about `alpha_z = delta exp(i Om tau)`, `phi_i = Om tau + psi_i`.

    Args:
        groups: the balancer.
        positions: `psi` [rad], one array per row.
        delta: tilt, by default zero (a main motion).
        rate: Om, by default the speed; at a given rate the imbalance is left out, as no whirl is steady
            with it unless Om is the speed.

    Returns:
        Roots by rising real part, zeros included. They are meaningful at a steady whirl only, as from
        `balanced_positions`, `synchronous_states` or `lag_whirl`. Differentiable.

    Raises:
        ValueError: the positions are not one angle per ball.
    """
    if rate is None:
        rate = groups.speed
    else:
        groups = eqx.tree_at(lambda g: g.imbalance, groups, jnp.zeros(()))
    rate, delta = jnp.asarray(rate, float), jnp.asarray(delta, complex)
    place = jnp.concatenate([jnp.stack([delta.real, delta.imag]), *checked(groups, positions)])
    return _roots(groups, place, rate)


@compiled_quickly
def _roots(groups: BalancerGroups, place: Float[Array, " k"], rate: Scalar) -> Complex[Array, " _"]:
    still = jnp.zeros_like(place)
    slope = lambda which: jax.jacfwd(_residual, argnums=which)(place, still, still, groups, rate)
    stiffness, damping, inertia = (slope(which) for which in range(3))
    solved = -linalg.solve(inertia, jnp.concatenate([stiffness, damping], axis=1))
    size = len(place)
    upper = jnp.concatenate([jnp.zeros((size, size)), jnp.eye(size)], axis=1)
    values = matrix_roots(jnp.concatenate([upper, solved]))
    return values[jnp.lexsort((values.imag, values.real))]


def _residual(
    place: Float[Array, " k"], rate: Array, change: Array, groups: BalancerGroups, whirl: Scalar
) -> Float[Array, " k"]:
    """Residual of the equations of motion of `Re delta, Im delta, psi` in axes that turn at `whirl`."""
    moment, drag, coupling = map(groups.per_ball, (groups.moment, groups.drag, groups.coupling))
    z, z1, z2 = (x[0] + 1j * x[1] for x in (place, rate, change))
    psi, psi1, psi2 = (x[2:] for x in (place, rate, change))
    turned = jnp.exp(1j * psi)
    velocity = z1 + 1j * whirl * z
    acceleration = z2 + 2j * whirl * z1 - whirl**2 * z
    thrown = jnp.sum(moment * (1j * psi2 - (psi1 + whirl) ** 2) * turned)
    thrown = thrown - groups.speed**2 * groups.imbalance
    gyroscopic = groups.damping - 1j * groups.speed * groups.polar
    rotor = acceleration + gyroscopic * velocity + z + 1j * thrown
    slip = psi1 + whirl - groups.speed
    balls = psi2 + drag * slip - coupling * (acceleration * turned.conj()).real
    return jnp.concatenate([jnp.stack([rotor.real, rotor.imag]), balls])
