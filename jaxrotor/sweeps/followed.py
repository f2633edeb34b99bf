"""Followed: lanes with a disturbance each, the returns of their motions, and orbits near them."""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Complex, Float, Int

from ..core import linalg
from ..core.compiled import compiled
from ..core.outcome import Outcome
from ..motion.base import AbstractMarch
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


class Polished(NamedTuple):
    """Orbits near lanes; distances are over `size_of` the state."""

    y: Float[Array, "l m"]
    miss: Float[Array, " l"]  # distance from the state after a period
    shift: Float[Array, " l"]  # distance from the lane
    multiplier: Float[Array, " l"]  # largest modulus


@compiled
def follow(
    shared: AbstractMarch, own: AbstractMarch, y: Float[Array, "l m"], revolutions: int
) -> Followed:
    """States of lanes after some revolutions, with the growth of a disturbance of each."""
    first = random_disturbances(y.shape[1], 1, 0)

    def lane(own, y):
        march = eqx.combine(own, shared)

        def advance(y):
            end, window, ok = march.observe(y)
            turn = Turn.of(window, jnp.zeros((), int), revolutions)
            turns = turn.s * jnp.sum(turn.turned()) / (2 * jnp.pi)
            force = window.contact_force
            loaded = None if force is None else jnp.any(force != 0, axis=0)
            return end, (turns, turn.z[-1], loaded, ok)

        def one(carry, _):
            y, disturbances, good = carry
            y, disturbances, growth, seen = advance_disturbed(advance, y, disturbances)
            *kept, ok = seen
            return (y, disturbances, good & ok), (growth[0], *kept)

        begin = y, first, Outcome.good()
        (y, _, good), seen = jax.lax.scan(one, begin, None, length=revolutions)
        growth, turned, section, loaded = seen
        loaded = None if loaded is None else loaded.any(0)
        return Followed(y, good, growth, turned, section, loaded)

    return jax.vmap(lane)(own, y)


@compiled
def returns(
    shared: AbstractMarch, own: AbstractMarch, y: Float[Array, "l m"], longest: int
) -> Float[Array, "l p"]:
    """Distance of lanes from their state after 1, 2, .. revolutions, over `size_of` the state."""

    def lane(own, y):
        march = eqx.combine(own, shared)
        size = size_of(march, y)

        def one(now, _):
            now, _ = march.skip(now, 1)
            return now, linalg.norm(now - y) / size

        return jax.lax.scan(one, y, None, length=longest)[1]

    return jax.vmap(lane)(own, y)


@compiled
def polish(
    shared: AbstractMarch, own: AbstractMarch, y: Float[Array, "l m"], period: Int[Array, ""]
) -> Polished:
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
        size = size_of(march, y)
        return x, linalg.norm(miss) / size, linalg.norm(x - y) / size, jacobian

    x, miss, shift, jacobian = jax.vmap(lane)(own, y)
    finite = jnp.isfinite(jacobian).all(axis=(1, 2), keepdims=True)
    multipliers = linalg.eigvals(jnp.where(finite, jacobian, 2.0))
    return Polished(x, miss, shift, jnp.abs(multipliers).max(axis=1))


def size_of(march: AbstractMarch, y: Float[Array, " m"]) -> Float[Array, ""]:
    """Size of a state of the march, which may be its difference from a steady motion."""
    q, velocity = march.decode(y)
    rest, apart = march.encode(0 * q, 0 * velocity), march.encode(0 * q + LEAST, 0 * velocity)
    sizes = jnp.stack([linalg.norm(one) for one in (y, rest, apart - rest)])
    return jnp.max(sizes)
