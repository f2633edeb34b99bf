"""Analyses under jax.vmap equal those in a loop; a lane without a result does not affect the others."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxrotor as jr


SPEEDS = (20.0, 120.0)
FORCE = jr.HarmonicForce(0.5, 3.0, 0.2)
ROTOR = jr.Scene(
    jr.MasslessShaft(1.0, 0.5, 1e5, damping=40.0),
    jr.Disc(0.5, 10.0),
    jr.DiscDamping(0.5, 60.0),
    jr.Support(0.5, 2e4, anisotropy=0.2),
    jr.Unbalance(0.5, 10.0, 1e-4),
    spin=jr.ConstantSpeed(50.0),
)
ANALYSES = {
    "roots": jr.roots,
    "modes": lambda scene: jr.modes(scene).damping_ratio,
    "growth_rate": jr.growth_rate,
    "critical_speeds": lambda scene: jr.critical_speeds(scene).speeds,
    "onset_speed": lambda scene: jr.onset_speed(scene, (10.0, 600.0), 12),
    "unbalance_response": lambda scene: jr.unbalance_response(scene, SPEEDS).major,
    "forced_response": lambda scene: jr.forced_response(scene, SPEEDS, FORCE).minor,
}


@pytest.mark.slow
@pytest.mark.hard("2.12 batches of unsymmetric eigenvalues")
@pytest.mark.parametrize("name", ANALYSES)
def test_mapped_equals_one_by_one(name):
    analysis = lambda stiffness: ANALYSES[name](ROTOR.put({"shaft.k11": stiffness}))
    values = jnp.array([0.8e5, 1e5, 1.3e5])
    mapped = jax.tree.leaves(jax.vmap(analysis)(values))
    for k, value in enumerate(values):
        for found, part in zip(jax.tree.leaves(analysis(value)), mapped, strict=True):
            there = np.ravel(part[k])[
                np.isfinite(np.ravel(part[k]))
            ]  # one by one they are left out
            np.testing.assert_allclose(there, np.ravel(found), rtol=1e-11)


@pytest.mark.long
@pytest.mark.hard("2.12 one rotor of a batch has no onset", outcome="flagged")
def test_a_rotor_without_an_onset_does_not_end_the_batch():
    """Internal damping destabilises from `Omega = (c_i + c_e) / c_i sqrt(k / m)` on."""
    scene = jr.Scene(
        jr.MasslessShaft(1.0, 0.5, 1e5, damping=40.0),
        jr.Disc(0.5, 10.0),
        jr.DiscDamping(0.5, 60.0),
        spin=jr.ConstantSpeed(50.0),
    )

    def onset(inner):
        return jr.onset_speed(scene.put({"shaft.damping": inner}), (10.0, 600.0), 12, throw=False)

    inner = jnp.array([40.0, 1.0, 80.0])
    found = jax.vmap(onset)(inner)
    expected = (inner + 60.0) / inner * np.sqrt(1e5 / 10.0)
    assert expected[1] > 600.0
    np.testing.assert_allclose(found.speed[::2], expected[::2], rtol=1e-10)
    np.testing.assert_allclose(found.whirl_frequency[::2], np.sqrt(1e5 / 10.0), rtol=1e-9)
    assert np.isnan(found.speed[1]) and np.isnan(found.whirl_frequency[1])
    assert np.isnan(onset(1.0).speed)
    slopes = jax.vmap(jax.grad(lambda inner: onset(inner).speed))(inner)
    np.testing.assert_allclose(slopes[::2], -60.0 / inner[::2] ** 2 * 100.0, rtol=1e-8)


def test_crossings_cannot_be_mapped():
    count = lambda k: len(jr.stability_crossings(ROTOR.put({"shaft.k11": k}), (10.0, 600.0), 12))
    with pytest.raises(
        ValueError, match="cannot run inside jax.jit or jax.vmap; call it outside, or"
    ):
        jax.jit(count)(1e5)
