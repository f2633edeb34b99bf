"""Derivatives by every parameter against central differences.

A derivative is one forward-mode pass; differences go through the same discretisation, because
`Scene.put` keeps the spans. The disc sits inside the shaft, so that its station and the length of
the shaft can both move both ways.
"""

import diffrax as dfx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from systems import LENGTH, TIME, leaf_values, limiter_rotor

import jaxrotor as jr


STATION = 0.65 / LENGTH
OBSERVED = 0.6  # off every kink
RTOL = 1e-5


def parameters(scene):
    """Every parameter by a path of its own: of like effects together, and apart where they differ."""
    found = {}
    for path, value in leaf_values(scene).items():
        if value.ndim == 0:
            found[path] = value
        elif np.ptp(value) == 0:
            found[path] = value[0]
        else:
            kind, _, rest = path.partition(".")
            found |= {f"{kind}.{i}.{rest}": one for i, one in enumerate(value)}
    return found


def forward(function, values):
    """Derivative by every entry, one compiled forward-mode pass for each."""
    push = jax.jit(lambda at, along: jax.jvp(function, (at,), (along,))[1])
    still = {path: jnp.zeros(()) for path in values}
    return {path: float(push(values, still | {path: jnp.ones(())})) for path in values}


STENCIL = {1: 3 / 4, 2: -3 / 20, 3: 1 / 60}  # sixth order


def differences(function, values, step):
    """Central differences by every entry, at steps relative to it (to 1 where it is below 1e-3)."""
    function = jax.jit(function)

    def one(path):
        value = values[path]
        h = step * (abs(float(value)) if abs(value) > 1e-12 else 1.0)
        at = lambda k: float(function(values | {path: value + k * h}))
        return sum(w * (at(k) - at(-k)) for k, w in STENCIL.items()) / h

    return {path: one(path) for path in values}


def agree(exact, approximate, values, rounding):
    """Equal to RTOL, or in elasticity to `rounding`, what differences lose to rounding."""
    wrong = {}
    for path, value in values.items():
        scale = abs(float(value)) if abs(value) > 1e-12 else 1.0
        error = abs(exact[path] - approximate[path])
        if not error <= RTOL * abs(approximate[path]) + rounding / scale:
            wrong[path] = (exact[path], approximate[path])
    assert not wrong


# === onset speed


def test_onset_speed_by_every_parameter():
    scene = limiter_rotor(eps=1e-4, gravity=True, station=STATION, nodes=6, blend=1e-3, slip=1.0)
    values = parameters(scene)
    onset = lambda values: jr.onset_speed(
        scene.put(values), within=(8.0 / TIME, 24.0 / TIME), samples=4
    ).speed
    exact = forward(onset, values)
    idle = [p for p in values if p.startswith(("limiters", "unbalance", "gravity", "spin"))]
    assert {exact[path] for path in idle} == {0.0}
    acting = {path: value for path, value in values.items() if path not in idle}
    assert len(acting) == 5 + 4 + 1 + 3 + 1  # shaft, disc, external, disc damping, internal
    assert all(exact[path] for path in acting)
    approximate = differences(lambda some: onset(values | some), acting, step=4e-3)
    agree(exact, approximate, acting, rounding=0.0)


# === trajectories


def final(scene, start, revolutions, steps, **options):
    """Real part of the last displacement, as a function of scene and start, in millimetres."""

    def function(values):
        own = {path: value for path, value in values.items() if not path.startswith("start.")}
        begin = jr.Whirl(*(values[f"start.{name}"] for name in ("radius", "rate", "angle")))
        solver = jr.Exponential(basis="dense")  # as chosen under tracing
        run = jr.simulate(
            scene.put(own), revolutions, steps, start=begin, at=OBSERVED, solver=solver, **options
        )
        return 1e3 * run.displacement[-1, 0].real

    radius, rate, angle = start
    values = parameters(scene) | {
        "start.radius": jnp.asarray(radius),
        "start.rate": jnp.asarray(rate / TIME),
        "start.angle": jnp.asarray(angle),
    }
    return function, values


def test_free_trajectory_by_every_parameter():
    scene = limiter_rotor(
        eps=1e-3, phase=0.3, gravity=True, station=STATION, contact=False, nodes=5
    )
    function, values = final(scene, (0.004, -3.0, 0.2), 2, 32)
    exact = forward(function, values)
    assert all(exact.values())
    agree(exact, differences(function, values, step=1e-3), values, rounding=0.0)


CONTACT = {
    "sharp": {},
    "blended": {"blend": 2e-3, "slip": 80.0},  # the rim slips at 66 m/s: inside the blend
}


@pytest.mark.parametrize("law", CONTACT)
def test_contact_trajectory_by_every_parameter(law):
    scene = limiter_rotor(
        eps=1e-3, phase=0.3, gravity=True, station=STATION, nodes=5, **CONTACT[law]
    )
    start = 0.0105, -10.0, 0.0
    run = jr.simulate(scene, 1, 64, start=jr.Whirl(start[0], start[1] / TIME), at=OBSERVED)
    touching = np.abs(run.contact_force) > 0
    assert not touching[0].any() and touching.any() and not touching[-1].all()
    function, values = final(scene, start, 1, 64)
    exact = forward(function, values)
    # The force jumps at a touch-down: so small a step that none crosses a stage of the grid.
    step = {"sharp": 1e-6, "blended": 1e-5}[law]
    agree(exact, differences(function, values, step), values, rounding=1e-8)


def test_reverse_mode_equals_forward_mode():
    scene = limiter_rotor(eps=1e-3, station=STATION, nodes=5)
    start = 0.0105, -10.0, 0.0
    function, values = final(scene, start, 1, 64)
    exact = forward(function, values)
    back, values = final(scene, start, 1, 64, adjoint=dfx.RecursiveCheckpointAdjoint())
    gradient = jax.jit(jax.grad(back))(values)
    for path in values:
        scale = max(abs(float(values[path])), 1e-3)
        assert float(gradient[path]) == pytest.approx(exact[path], rel=1e-7, abs=1e-10 / scale)
