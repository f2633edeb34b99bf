"""Followed: lanes with a disturbance each, the returns of their motions, and orbits near them."""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Complex, Float, Int

from ..core import linalg
from ..core.compiled import compiled
from ..core.outcome import Outcome
from ..motion.revolutions import March
from ..orbits.lyapunov import advance_disturbed, random_disturbances
from .observable import Turn


NEWTON = 5  # iterations
LEAST = 1e-9  # displacement of all coordinates that counts as none [m]


class Followed(NamedTuple):
    """Lanes after some revolutions, and what was seen in each of them."""

    y: Float[Array, "l m"]
    outcome: Outcome
    growth: Float[Array, "l R"]  # logarithm of the growth of a disturbance
    turned: Float[Array, "l R"]  # turns about the centre, along the spin
    section: Complex[Array, "l R"]  # displacement at the end [m]
    loaded: Bool[Array, "l k"] | None  # whether each contact ever was; None: not computed
    states: Float[Array, "l R x"]  # of laws at the end


class Polished(NamedTuple):
    """Orbits near lanes; distances are in `sizes_of` the state."""

    y: Float[Array, "l m"]
    miss: Float[Array, " l"]  # distance from the state after a period
    shift: Float[Array, " l"]  # distance from the lane
    multiplier: Float[Array, " l"]  # largest modulus


@compiled
def follow(shared: March, own: March, y: Float[Array, "l m"], revolutions: int) -> Followed:
    """States of lanes after some revolutions, with the growth of a disturbance of each."""
    first = random_disturbances(y.shape[1], 1, 0)

    def lane(own, y):
        march = eqx.combine(own, shared)
        k = march.state_count
        size = sizes_of(march, y) if k else 1.0  # of coordinates all numbers are metres

        def advance(y):
            end, window, ok = march.observe(size * y)
            turn = Turn.of(window, jnp.zeros((), int), revolutions)
            turns = turn.s * jnp.sum(turn.turned()) / (2 * jnp.pi)
            force = window.contact_force
            loaded = None if force is None else jnp.any(force != 0, axis=0)
            return end / size, (turns, turn.z[-1], loaded, end[end.size - k :], ok)

        def one(carry, _):
            y, disturbances, good = carry
            y, disturbances, growth, seen = advance_disturbed(advance, y, disturbances)
            *kept, ok = seen
            return (y, disturbances, good & ok), (growth[0], *kept)

        begin = y / size, first, Outcome.good()
        (y, _, good), seen = jax.lax.scan(one, begin, None, length=revolutions)
        growth, turned, section, loaded, states = seen
        loaded = None if loaded is None else loaded.any(0)
        return Followed(size * y, good, growth, turned, section, loaded, states)

    return jax.vmap(lane)(own, y)


@compiled
def returns(shared: March, own: March, y: Float[Array, "l m"], longest: int) -> Float[Array, "l p"]:
    """Distance of lanes from their state after 1, 2, .. revolutions, in `sizes_of` the state."""

    def lane(own, y):
        march = eqx.combine(own, shared)
        sizes = sizes_of(march, y)

        def one(now, _):
            now, _ = march.skip(now, 1)
            return now, linalg.norm((now - y) / sizes)

        return jax.lax.scan(one, y, None, length=longest)[1]

    return jax.vmap(lane)(own, y)


@compiled
def polish(shared: March, own: March, y: Float[Array, "l m"], period: Int[Array, ""]) -> Polished:
    """Orbits `F^p(y) = y` of a `period` near lanes, by Newton's method."""

    def lane(own, y):
        march = eqx.combine(own, shared)
        after = lambda y: march.skip(y, period)[0]

        def both(x):
            push = lambda tangent: jax.jvp(after, (x,), (tangent,))
            end, columns = jax.vmap(push, out_axes=(None, 1))(jnp.eye(x.size))
            return end - x, columns

        def step(_, carry):
            x, change, *_ = carry
            x = x + change
            miss, jacobian = both(x)
            return x, linalg.solve(jnp.eye(x.size) - jacobian, miss), miss, jacobian

        begin = y, 0 * y, y, jnp.zeros((y.size, y.size))
        x, _, miss, jacobian = jax.lax.fori_loop(0, NEWTON + 1, step, begin)
        sizes = sizes_of(march, y)
        return x, linalg.norm(miss / sizes), linalg.norm((x - y) / sizes), jacobian

    x, miss, shift, jacobian = jax.vmap(lane)(own, y)
    finite = jnp.isfinite(jacobian).all(axis=(1, 2), keepdims=True)
    multipliers = linalg.eigvals(jnp.where(finite, jacobian, 2.0))
    return Polished(x, miss, shift, jnp.abs(multipliers).max(axis=1))


def sizes_of(march: March, y: Float[Array, " m"]) -> Float[Array, " m"]:
    """Unit of every number of a state of the march, which may be its difference from a steady motion.

    That of the rotor is one for all, that of states of laws the largest of those of one unit; angles that
    laws count are in radians.
    """
    count, (q, velocity, *states) = y.size - march.state_count, march.decode(y)
    moved = lambda by: march.encode(0 * q + by, 0 * velocity, *states)[:count]
    rest, apart = moved(0.0), moved(LEAST)
    size = jnp.max(jnp.stack([linalg.norm(one) for one in (y[:count], rest, apart - rest)]))
    units = np.array(march.system.state_units)
    alike = (units[:, None] == units).reshape(len(units), len(units))
    largest = jnp.max(jnp.where(alike, jnp.abs(y[count:]), 0.0), axis=1, initial=0.0)
    fixed = jnp.asarray(units == "rad", bool).reshape(len(units)) | (largest == 0)
    return jnp.concatenate([jnp.full(count, size), jnp.where(fixed, 1.0, largest)])
