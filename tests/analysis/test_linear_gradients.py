"""Derivatives of roots, onset and critical speeds of the published scenes, by every parameter.

One forward-mode pass against sixth-order central differences. Stations and lengths are labels on a
massless shaft, and loads do not matter to a root: their derivatives are zero.
"""

import re
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from differences import central
from systems import leaf_values

import jaxrotor as jr


SCENES = {  # range with one onset [rad/s]
    "dual-stiffness-rigid": (60.0, 100.0),
    "dual-stiffness-elastic": (180.0, 300.0),
    "dual-stiffness-rotating": (110.0, 190.0),
    "gyroscopic-cantilever": (60.0, 120.0),  # "gyroscopic-propped" differs by its numbers alone
}
LABELS = (".at", ".length", "spin.speed")
LOADS = ("unbalance", "gravity")


def parameters(scene):
    """Every parameter; those of equal effects are varied together, so that both ends stay equal."""
    return {path: jnp.ravel(value)[0] for path, value in leaf_values(scene).items()}


def roots(scene, count):
    values = jr.roots(scene)[:count]
    return jnp.concatenate([values.real, values.imag])


def functions(name):
    scene = jr.load(name)
    count = jr.roots(scene).size
    critical = jr.critical_speeds(scene).speeds.size
    low, high = SCENES[name]
    return scene, {
        "roots": lambda scene: roots(scene, count),
        "onset": lambda scene: jnp.stack(jr.onset_speed(scene, (low, high), 20)),
        "critical": lambda scene: jr.critical_speeds(scene).speeds[:critical],
    }


@pytest.mark.slow
@pytest.mark.parametrize("what", ["roots", "onset", "critical"])
@pytest.mark.parametrize("name", SCENES)
def test_by_every_parameter(name, what):
    scene, choices = functions(name)
    values, function = parameters(scene), choices[what]
    push = jax.jit(
        lambda values, along: jax.jvp(lambda v: function(scene.put(v)), (values,), (along,))
    )
    still = {path: jnp.zeros(()) for path in values}
    at = lambda values: push(values, still)[0]  # compiled once, with its derivative
    acting = 0
    for path, value in values.items():
        result, exact = push(values, still | {path: jnp.ones(())})
        if path.endswith(LABELS[:2]) or path.startswith(LOADS):
            assert not np.any(exact), path
            continue
        h = 1e-3 * (abs(float(value)) or 1.0)
        found = central(lambda k, p=path, v=value, h=h: at(values | {p: v + k * h}), h)
        scale = np.max(np.abs(result)) / (abs(float(value)) or 1.0)
        np.testing.assert_allclose(exact, found, rtol=1e-6, atol=1e-9 * scale, err_msg=path)
        acting += bool(np.any(exact))
    assert acting >= {"roots": 5, "onset": 4, "critical": 3}[what]


# === claims of the page of linear analyses

PAGE = (Path(__file__).parents[2] / "docs" / "guides" / "linear.md").read_text()
STATED = re.findall(r"`(\w+)`", re.search(r"^Differentiable: (.*?)\.$", PAGE, re.S | re.M)[1])
PUSH = jr.HarmonicForce(0.16125)
DIFFERENTIABLE = {
    "roots": lambda scene: jr.roots(scene).imag,
    "modes": lambda scene: jr.modes(scene).values.imag,
    "critical_speeds": lambda scene: jr.critical_speeds(scene).forward[0],
    "onset_speed": lambda scene: jr.onset_speed(scene, (60.0, 120.0), 20).speed,
    "stability_crossings": lambda scene: (
        jr.stability_crossings(scene, (60.0, 120.0), 20)[0][0].speed
    ),
    "growth_rate": lambda scene: jr.growth_rate(scene),
    "floquet_multipliers": lambda scene: jr.floquet_multipliers(scene)[0].real,
    "unbalance_response": lambda scene: jr.unbalance_response(scene, 70.0).major,
    "weight_response": lambda scene: jr.weight_response(scene, 70.0).deflection.real,
    "forced_response": lambda scene: jr.forced_response(scene, 30.0, PUSH).major,
    "reduction": lambda scene: jr.reduction(scene, 0.16125).shaft.k11,
    "perturbed_roots": lambda scene: jr.perturbed_roots(scene).values.imag,
}


SLOW = {"onset_speed", "stability_crossings"}  # a derivative of a scan takes ten seconds to compile


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.slow] * (name in SLOW)) for name in STATED]
)
def test_what_the_page_calls_differentiable(name):
    cantilever = jr.load("gyroscopic-cantilever")
    loads = jr.Gravity(), jr.Unbalance(0.16125, 1.0, 1e-4)
    scene = jr.Scene(cantilever.shaft, *cantilever.effects, *loads, spin=jr.ConstantSpeed(70.0))
    at = lambda k: jnp.ravel(DIFFERENTIABLE[name](scene.put({"shaft.k11": k})))
    k = scene.get("shaft.k11")
    h = 1e-4 * k
    expected = (8 * (at(k + h) - at(k - h)) - at(k + 2 * h) + at(k - 2 * h)) / (12 * h)
    assert np.any(expected)
    np.testing.assert_allclose(jax.jacfwd(at)(k), expected, rtol=1e-6)
