"""Lag whirl: balls that rotate near the critical speed and make the rotor whirl with them."""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jaxtyping import Array, Complex, Float

from ...core import linalg
from ...core.compiled import compiled_quickly
from ...core.extremes import largest
from ...core.quantities import Scalar
from .groups import BalancerGroups
from .relative import whirl_spectrum


class LagWhirl(NamedTuple):
    """Steady whirl without imbalance in which the balls of each of `r` rows are at one angle."""

    speed: Scalar  # om of the rotor
    rate: Scalar  # Om of the rotor's tilt and the balls
    angles: Float[Array, " r"]  # angles of the rows relative to the first [rad]
    delta: Complex[Array, ""]  # tilt, in axes rotating at Om with the first row at angle 0
    growth: (
        Scalar  # largest real part of the full model's roots, without the zero of its free phase
    )


class LagBranch(NamedTuple):
    """Lag whirls along one branch, at `k` whirl rates."""

    rate: Float[Array, " k"]
    speed: Float[Array, " k"]  # NaN where the branch ends
    angles: Float[Array, "k r"]


def _torques(groups: BalancerGroups, speed: Any, rate: Any, angles: Array) -> Float[Array, " r"]:
    """`h_l (om - Om) + mu_l Re( a exp(-i psi_l) )`, `a = -i Om^4 S / K`: zero in a lag whirl."""
    acceleration = -(rate**2) * _tilt(groups, speed, rate, angles)
    pull = groups.coupling * (acceleration * jnp.exp(-1j * angles)).real
    return groups.drag * (speed - rate) + pull


def _tilt(groups: BalancerGroups, speed: Any, rate: Any, angles: Array) -> Array:
    """`delta = i Om^2 S / K`, `K = 1 - Om^2 + om C Om + i ha Om`, `S = sum n_l S_l exp(i psi_l)`."""
    moments = jnp.asarray(groups.balls) * groups.moment
    stiffness = 1 - rate**2 + speed * groups.polar * rate + 1j * groups.damping * rate
    return 1j * rate**2 * jnp.sum(moments * jnp.exp(1j * angles)) / stiffness


def _angles(others: Array) -> Array:
    return jnp.concatenate([jnp.zeros(1), others])


@compiled_quickly
def lag_branch(groups: BalancerGroups, rates: Any) -> LagBranch:
    """Branch of lag whirls from slow rotation on, parametrised by Om, so it passes folds in the speed.

    Args:
        groups: the balancer; its speed and imbalance do not matter.
        rates: ascending whirl rates Om from one well below 1, in steps small enough to follow the branch.

    Returns:
        `LagBranch`, NaN from where the branch is lost.
    """
    rates = jnp.asarray(rates, float)

    residual = lambda x, rate: _torques(groups, x[0], rate, _angles(x[1:]))

    def follow(x, rate):
        def newton(_, x):
            slope = jax.jacfwd(residual)(x, rate)
            return x - linalg.solve(slope, residual(x, rate))

        x = jax.lax.fori_loop(0, 12, newton, x)
        wrong = ~(jnp.max(jnp.abs(residual(x, rate))) < 1e-9)
        x = jnp.where(wrong, jnp.nan, x)
        return x, x

    start = jnp.concatenate([rates[:1], jnp.zeros(groups.rows - 1)])
    found = jax.lax.scan(follow, start, rates)[1]
    return LagBranch(rates, found[:, 0], jax.vmap(_angles)(found[:, 1:]))


def _rising(groups: BalancerGroups, rates: Any) -> tuple[LagBranch, int]:
    """The branch, and the index of its first fold (the last index if there is none)."""
    branch = lag_branch(groups, rates)
    speed = np.asarray(branch.speed)
    ends = np.flatnonzero(~(np.diff(speed) > 0))
    return branch, int(ends[0]) if ends.size else len(speed) - 1


RATES = np.linspace(0.05, 3.0, 2000)  # whirl rates searched by default


def lag_whirl(groups: BalancerGroups, rates: Any = RATES) -> LagWhirl:
    """Lag whirl at the speed of the groups, on the branch that begins at rest, before its first fold.

        h_l (om - Om) = -mu_l Re( a exp(-i psi_l) ),  a = -i Om^4 S / K,  S = sum n_l S_l exp(i psi_l)
        K = 1 - Om^2 + om C Om + i ha Om

    The imbalance is left out; it would modulate the whirl. With light mount damping, light drag and heavy
    balls the whirl is stable and coexists with balanced motions: a run-up can be captured by it.

    Args:
        groups: the balancer.
        rates: ascending whirl rates Om along which the branch is followed, from well below 1.

    Returns:
        `LagWhirl`. Differentiable.

    Raises:
        ValueError: there is no such whirl up to the last rate: the speed is past the fold (`lag_fold`).
    """
    held = jax.lax.stop_gradient(groups)
    branch, top = _rising(held, rates)
    speed = np.asarray(branch.speed)[: top + 1]
    if not speed[0] <= float(held.speed) <= speed[-1]:
        raise ValueError(
            f"There is no lag whirl at speed {float(held.speed):g}: its branch runs from {speed[0]:g} "
            f"to {speed[-1]:g}; give higher `rates` if it does not fold there."
        )
    here = int(np.searchsorted(speed, float(held.speed)))
    start = jnp.concatenate([branch.rate[here][None], branch.angles[here, 1:]])
    found = _solve(_at_speed, start, groups)
    return _whirl(groups, groups.speed, found[0], _angles(found[1:]))


def lag_fold(groups: BalancerGroups, rates: Any = RATES) -> LagWhirl:
    """Lag whirl of highest speed, at the fold of its branch over the speed.

    One root is zero there; another may have become unstable at a lower speed.

    Args:
        groups: the balancer; its speed does not matter.
        rates: ascending whirl rates Om along which the branch is followed, from well below 1.

    Returns:
        `LagWhirl`. Differentiable.

    Raises:
        ValueError: the branch does not fold up to the last rate.
    """
    branch, top = _rising(jax.lax.stop_gradient(groups), rates)
    if top == len(branch.rate) - 1 or not np.isfinite(float(branch.speed[top + 1])):
        raise ValueError(
            f"The branch of lag whirls does not fold up to rate {float(branch.rate[top]):g} "
            f"(speed {float(branch.speed[top]):g}); give higher `rates` in smaller steps."
        )
    start = jnp.concatenate(
        [branch.speed[top][None], branch.rate[top][None], branch.angles[top, 1:]]
    )
    found = _solve(_at_fold, start, groups)
    return _whirl(groups, found[0], found[1], _angles(found[2:]))


def _at_speed(x: Array, groups: BalancerGroups) -> Array:
    """Residual of rate and angles at the speed of the groups."""
    return _torques(groups, groups.speed, x[0], _angles(x[1:]))


def _at_fold(x: Array, groups: BalancerGroups) -> Array:
    """Residual of speed, rate and angles: equilibrium, and its Jacobian at fixed speed singular."""
    at = lambda inner: _torques(groups, x[0], inner[0], _angles(inner[1:]))
    return jnp.append(at(x[1:]), linalg.det(jax.jacfwd(at)(x[1:])))


@compiled_quickly
def _solve(residual: Any, start: Array, groups: BalancerGroups) -> Array:
    solver = optx.Newton(rtol=1e-12, atol=1e-13)
    return optx.root_find(residual, solver, start, groups, max_steps=100).value


def _whirl(groups: BalancerGroups, speed: Scalar, rate: Scalar, angles: Array) -> LagWhirl:
    turning = eqx.tree_at(lambda g: g.speed, groups, speed)
    delta = _tilt(turning, speed, rate, angles)
    placed = [jnp.full(n, angle) for n, angle in zip(groups.balls, angles, strict=True)]
    values = whirl_spectrum(turning, placed, delta, rate)
    phase = jnp.argmin(jnp.abs(values))  # the phase is free, so one root is zero
    growth = largest(jnp.where(jnp.arange(len(values)) == phase, -jnp.inf, values.real))
    return LagWhirl(speed, rate, angles, delta, growth)
