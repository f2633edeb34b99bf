"""What the benchmarks hand to other codes is the rotor that they are compared on."""

import importlib
from pathlib import Path

import jax.numpy as jnp
import numpy as np

import jaxrotor as jr


def test_peers_get_the_stops_of_the_scene(monkeypatch):
    monkeypatch.syspath_prepend(str(Path(__file__).parents[1] / "benchmarks"))
    rotor = importlib.import_module("peers.rotor")
    rest = jnp.zeros(jr.assemble(rotor.SCENE).n, complex)
    monkeypatch.setattr(rotor, "settled", lambda: jr.Continued(rest, rest))
    found = rotor.Arrays.of(*rotor.motion_and_state.__wrapped__())
    stops = rotor.SCENE.of(jr.Limiter)
    for name in ("gap", "stiffness", "damping", "friction"):
        np.testing.assert_allclose(getattr(found, name), [getattr(stop, name) for stop in stops])
    np.testing.assert_allclose(found.cos, [np.cos(stop.angle) for stop in stops], atol=1e-15)
    assert found.a.shape == (2 * rest.size, 2 * rest.size)
