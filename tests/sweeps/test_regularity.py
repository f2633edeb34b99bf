"""Regularity of motions that are known: of two and three periods, of a chaotic map, and of noise."""

import jax.numpy as jnp
import numpy as np
import pytest

import jaxrotor as jr
from jaxrotor.sweeps.observable import Turn
from jaxrotor.sweeps.observe_regular import SETTLED


COUNT, STEPS, PACE = 100, 32, jnp.ones(())


def observed(z):
    """The regularity of `COUNT` revolutions of displacements."""
    one = jr.observe.Regularity()
    carry = one.start(0)
    for number, turn in enumerate(np.reshape(z, (COUNT, STEPS))):
        turn = jnp.asarray(np.append(turn[:1], turn))
        seen = Turn(turn + 0j, 0j * turn, None, jnp.asarray(number), PACE, PACE, COUNT)
        carry, _ = one.update(carry, seen)
    return float(one.report(carry, None, COUNT)["regularity"].values)


def chaotic():
    """Values of the logistic map, one a revolution."""
    values = [0.3]
    for _ in range(COUNT - 1):
        values.append(3.99 * values[-1] * (1 - values[-1]))
    return np.repeat(values, STEPS)


THETA = 2 * np.pi * (np.arange(COUNT * STEPS) + 1) / STEPS
REGULAR = {
    "circle": np.exp(1j * THETA),
    "two clocks": np.exp(1j * THETA) + 0.7 * np.exp(1.3j * THETA),
    "against": np.exp(1j * THETA) + 0.7 * np.exp(-1.2j * THETA),
    "three clocks": np.exp(1j * THETA)
    + 0.5 * np.exp(2**0.5 * 1j * THETA)
    + 0.3 * np.exp(-0.4j * THETA),
}


@pytest.mark.parametrize("name", REGULAR)
def test_motions_of_several_periods_are_regular(name):
    assert observed(REGULAR[name]) < 1e-5


def test_others_are_not():
    noise = np.repeat(np.random.default_rng(0).normal(size=COUNT), STEPS)
    for radius in (1 + noise, chaotic(), np.exp(-THETA / THETA[-1])):  # the last is a transient
        assert observed(radius * np.exp(1j * THETA)) > SETTLED
    slow = REGULAR["circle"] + 0.7 * np.exp(1.004j * THETA)  # a beat of 250 revolutions
    assert observed(slow) > SETTLED


def test_lanes_are_observed_as_each_alone():
    one, z = jr.observe.Regularity(), np.stack([REGULAR["against"][: STEPS + 1]] * 2, 1)
    z = jnp.asarray(z * np.array([1.0, 2.0]))
    many = Turn(z, 0 * z, None, jnp.asarray(3), PACE, PACE, COUNT)
    zero = tuple(jnp.zeros((*leaf.shape, 2)) for leaf in one.start(0))
    together, _ = one.update(zero, many)
    for lane in range(2):
        alone = Turn(z[:, lane], 0 * z[:, lane], None, jnp.asarray(3), PACE, PACE, COUNT)
        found, _ = one.update(one.start(0), alone)
        for part, own in zip(together, found, strict=True):
            np.testing.assert_allclose(part[..., lane], own, rtol=1e-12)
