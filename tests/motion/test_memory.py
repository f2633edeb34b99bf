"""Memory of reverse mode: it does not grow with every revolution, and nothing else changes."""

import diffrax as dfx
import jax
import jax.numpy as jnp
import pytest
from systems import LENGTH, TIME, limiter_rotor

import jaxrotor as jr
from jaxrotor.core.compiled import QUICKLY


SCENE = limiter_rotor(nodes=4, eps=1e-3)
STATE = 8 * 4 * jr.assemble(SCENE).n  # bytes
STIFFNESS = SCENE.get("limiters.stiffness")[0]


def bounced(revolutions, keep=1, **options):
    """Mean square displacement at the end of a run against stops, as a function of their stiffness."""

    def function(stiffness):
        run = jr.simulate(
            SCENE.put({"limiters.stiffness": stiffness}),
            revolutions,
            32,
            start=jr.Whirl(0.012 * LENGTH, rate=-10 / TIME),
            solver=jr.Exponential(4, basis="dense"),
            keep=keep,
            **options,
        )
        return 1e4 * jnp.mean(jnp.abs(run.displacement) ** 2)

    return function


@pytest.mark.slow
def test_checkpoints_change_no_derivative():
    """23 revolutions leave a remainder after the last checkpoint, the 24 that are kept do not."""
    forward = lambda k: jax.jvp(bounced(47, 24), (k,), (jnp.ones(()),))
    _, exact = jax.jit(forward, **QUICKLY)(STIFFNESS)
    reverse = bounced(47, 24, adjoint=dfx.RecursiveCheckpointAdjoint())
    found = jax.jit(jax.grad(reverse), **QUICKLY)(STIFFNESS)
    assert exact != 0
    assert float(found) == pytest.approx(float(exact), rel=1e-8)


@pytest.mark.slow
def test_reverse_mode_keeps_few_revolutions():
    """Counted by XLA; a checkpoint at every revolution would take one more state for each."""

    def needed(revolutions):
        reverse = bounced(revolutions, adjoint=dfx.RecursiveCheckpointAdjoint())
        lowered = jax.jit(jax.grad(reverse), **QUICKLY).lower(STIFFNESS)
        return lowered.compile().memory_analysis().temp_size_in_bytes

    few, many = needed(41), needed(401)  # 40 and 400 but for the one that is kept
    assert few > 0
    assert many - few < 0.25 * (401 - 41) * STATE
