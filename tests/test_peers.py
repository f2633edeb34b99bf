"""What the benchmarks hand to other codes is the rotor that they are compared on."""

import importlib
from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pytest
from rich.console import Console

import jaxrotor as jr


@pytest.mark.parametrize(
    "errors, setting",
    [
        ([1.0, 0.1, 0.1, 0.1], 2),
        ([1.0, 0.1, 1.0, 0.1, 0.1, 0.1], 4),  # the second meets the target by chance
        ([0.1, np.nan, 0.1, 0.1], 3),
        ([1.0, 1.0, 0.1], 3),
        ([1.0, 0.1, 1.0], 3),
    ],
)
def test_the_loosest_setting_is_confirmed_by_the_next(monkeypatch, errors, setting):
    monkeypatch.syspath_prepend(str(Path(__file__).parents[1] / "benchmarks"))
    loosest = importlib.import_module("peers.loosest").loosest
    error, log = (lambda k: errors[k - 1]), Console(quiet=True)
    found = loosest("", lambda k: k, range(1, 1 + len(errors)), error, 0.5, log)
    assert (found["setting"], found["error"]) == (setting, errors[setting - 1])


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
