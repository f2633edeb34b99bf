"""Derivatives by every parameter against central differences.

A derivative is one forward-mode pass; differences go through the same discretisation, because
`Scene.put` keeps the spans. The disc sits inside the shaft, so that its station and the length of
the shaft can both move both ways. Spectral spans end at the disc, where the interpolant has a kink,
so there all stations move as one; the trapezoidal rule is smooth between its nodes, so there each
moves by itself.
"""

import functools

import diffrax as dfx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from differences import central
from systems import LENGTH, TIME, leaf_values, limiter_rotor

import jaxrotor as jr


OBSERVED = 0.3  # [m], off every kink
RTOL = 1e-5
RULES = {
    "spectral": {"rule": "spectral", "nodes": 5, "station": 0.45 / LENGTH},
    "trapezoid": {"rule": "trapezoid", "nodes": 4, "station": 0.65 / LENGTH},
}

ASKEW = {"offset": 2e-4, "offset_angle": 0.7, "tilt": 4e-3, "tilt_axis": -0.4}  # m, rad

# A constraint at an end stays there; these shafts have no shear, and damping alike along every axis.
ELSEWHERE = ("shaft.constraints", "shaft.material.shear_modulus", "external_damping.angle")


def parameters(scene):
    """Every parameter by a path: one for all effects of a kind, and one for each where they differ."""
    found = {}
    for path, value in leaf_values(scene).items():
        if path.startswith(ELSEWHERE):
            continue
        if path.endswith(".at") and scene.shaft.rule == "spectral":
            found["at"] = jnp.ravel(value)[0]
        elif value.ndim == 0:
            found[path] = value
        elif np.ptp(value) == 0:
            found[path] = value[0]
        else:
            kind, _, rest = path.partition(".")
            found |= {f"{kind}.{i}.{rest}": one for i, one in enumerate(value)}
    return found


def put(scene, values):
    values = dict(values)
    if "at" in values:
        at = values.pop("at")
        placed = [path for path in scene.paths() if path.endswith(".at")]
        values |= {path: at for path in placed if not path.startswith("shaft.constraints")}
    return scene.put(values)


def pushed(function):
    """One program for the value of a function, its derivative along any direction, and what is beside."""
    return jax.jit(lambda at, along: jax.jvp(function, (at,), (along,), has_aux=True))


def still(values):
    return {path: jnp.zeros(()) for path in values}


def forward(push, values):
    """Derivative by every entry, by one forward-mode pass each."""
    one = jnp.ones(())
    return {path: float(push(values, still(values) | {path: one})[1]) for path in values}


def scale_of(value):
    return abs(float(value)) if abs(value) > 1e-12 else 1.0


def agree(push, exact, values, change, most=0.02):
    """Exact derivatives equal central differences to RTOL.

    A parameter steps so far that the result changes by about `change`, at most by a share `most`:
    little enough for no contact to move to another step of the grid, enough to rise above rounding.
    """
    wrong, nowhere = {}, still(values)
    for path, slope in exact.items():
        value = values[path]
        scale = scale_of(value)
        size = abs(slope) * scale
        h = scale * (min(most, change / size) if size else 1e-4)
        moved = lambda k, p=path, v=value, h=h: values | {p: v + k * h}
        found = central(lambda k, moved=moved: float(push(moved(k), nowhere)[0]), h)
        if not abs(slope - found) <= RTOL * abs(found):
            wrong[path] = (slope, found)
    assert not wrong


# === onset speed


@pytest.mark.slow
@pytest.mark.parametrize("rule", RULES)
def test_onset_speed_by_every_parameter(rule):
    law = {"blend": 1e-3, "slip": 1.0, "out_of_true": ASKEW}
    scene = limiter_rotor(eps=1e-4, gravity=True, **law, **RULES[rule])
    values = parameters(scene)
    middle = float(jr.onset_speed(scene).speed)
    within = 0.8 * middle, 1.3 * middle
    speed = lambda at: jr.onset_speed(put(scene, at), within=within, samples=8).speed
    onset = pushed(lambda at: (speed(at), None))
    exact = forward(onset, values)
    idle = ("limiters", "unbalance", "gravity", "spin", "disc.offset", "disc.tilt")
    idle = [path for path in values if path.startswith(idle)]
    assert {exact[path] for path in idle} == {0.0}
    acting = {path: slope for path, slope in exact.items() if path not in idle}
    # shaft, disc, external damping, disc damping, internal damping
    assert len(acting) == 5 + 4 + 1 + 3 + 1 - (rule == "spectral")
    assert all(acting.values())
    agree(onset, acting, values, change=2e-4 * middle)


# === trajectories


def final(scene, start, revolutions, steps, **options):
    """Real part of the last displacement [mm], beside forces of contact, by scene and start."""

    def function(values):
        own = {path: value for path, value in values.items() if not path.startswith("start.")}
        begin = jr.Whirl(*(values[f"start.{name}"] for name in ("radius", "rate", "angle")))
        solver = jr.Exponential(basis="dense")  # as chosen under tracing
        run = jr.simulate(
            put(scene, own), revolutions, steps, start=begin, at=OBSERVED, solver=solver, **options
        )
        return 1e3 * run.displacement[-1, 0].real, run.contact_force

    radius, rate, angle = start
    values = parameters(scene) | {
        "start.radius": jnp.asarray(radius),
        "start.rate": jnp.asarray(rate / TIME),
        "start.angle": jnp.asarray(angle),
    }
    return function, values


@pytest.mark.slow
def test_free_trajectory_by_every_parameter():
    """Of a shaft by spectral nodes; of one by the trapezoidal rule with contact, below."""
    rule = "spectral"
    acting = {"gravity": True, "contact": False, "out_of_true": ASKEW}
    scene = limiter_rotor(eps=1e-3, phase=0.3, **acting, **RULES[rule])
    function, values = final(scene, (0.004, -3.0, 0.2), 2, 32)
    push = pushed(function)
    exact = forward(push, values)
    assert all(exact.values())
    agree(push, exact, values, change=1e-3, most=0.05)


CONTACT = {
    "sharp": {},
    "blended": {"blend": 2e-3, "slip": 80.0},  # the rim slips at 66 m/s: inside the blend
}
START = {"spectral": (0.0085, -10.0, 0.0), "trapezoid": (0.004, -10.0, 0.0)}  # m, 1/T*, rad


@functools.cache
def struck(rule, law):
    """A scene that strikes a limiter, its values, their program and the derivatives by them."""
    acting = {"gravity": True, "out_of_true": ASKEW}
    scene = limiter_rotor(eps=1e-3, phase=0.3, **acting, **CONTACT[law], **RULES[rule])
    function, values = final(scene, START[rule], 1, 64)
    push = pushed(function)
    loaded = np.abs(push(values, still(values))[2]) > 0
    assert not loaded[0].any() and loaded.any(axis=1).sum() > 5
    return scene, values, push, forward(push, values)


@pytest.mark.slow
@pytest.mark.parametrize(("rule", "law"), [("spectral", "sharp"), ("trapezoid", "blended")])
def test_contact_trajectory_by_every_parameter(rule, law):
    _, values, push, exact = struck(rule, law)
    # A limiter that is not struck does not matter, nor how fast the rim slips on a sharp one.
    idle = {path for path in values if not exact[path]}
    assert idle <= {"limiters.0.angle", "limiters.1.angle", "limiters.rim_radius"}
    agree(push, exact, values, change=1e-4)


@pytest.mark.slow
def test_reverse_mode_equals_forward_mode():
    scene, values, _, exact = struck("spectral", "sharp")
    reverse = dfx.RecursiveCheckpointAdjoint()
    back, _ = final(scene, START["spectral"], 1, 64, adjoint=reverse)
    gradient = jax.jit(jax.grad(back, has_aux=True))(values)[0]
    for path, value in values.items():
        close = pytest.approx(exact[path], rel=1e-7, abs=1e-9 / scale_of(value))
        assert float(gradient[path]) == close
