"""Steady whirls of rotor and balls with balls in any places: their roots, and two kinds of them."""

import itertools
from collections.abc import Sequence
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
from .linear import first_order, matrix_roots, solved_for_accelerations
from .positions import checked, labellings


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
    return jnp.sort(
        matrix_roots(first_order(*solved_for_accelerations(inertia, damping, stiffness)))
    )


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


# === balls that rotate with the rotor, all on one line


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


# === balls that rotate near the critical speed


class LagWhirl(NamedTuple):
    """Steady whirl without imbalance in which the balls of each of `r` rows are at one angle."""

    speed: Scalar  # om of the rotor
    rate: Scalar  # Om of the rotor's tilt and the balls
    angles: Float[Array, " r"]  # angles of the rows relative to the first [rad]
    delta: Complex[Array, ""]  # tilt, in axes rotating at Om with the first row at angle 0
    # Largest real part of the full model's roots, without the zero of its free phase
    growth: Scalar


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
