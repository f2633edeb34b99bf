"""Objectives of motion: forces of a window and balls, against central differences and by hand.

Differences go through the same discretisation; a contact moves to no other step within them.
"""

import types

import diffrax as dfx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from differences import central, check_forward
from systems import limiter_rotor, one_disc

import jaxrotor as jr
from jaxrotor import objectives


def rubbing():
    """A disc that strikes two soft, blended stops within a revolution, so that few steps follow them."""
    stop = {"gap": 7e-3, "stiffness": 4e5, "damping": 200.0, "friction": 0.1, "rim_radius": 0.1}
    stop |= {"blend": 2e-3, "slip": 8.0}
    stops = [jr.Limiter(0.5, angle, **stop) for angle in (0.0, 2.0)]
    return one_disc(*stops, mass=10.0, damping=60.0, stiffness=1e5, speed=100.0, eccentricity=1e-4)


START = jr.Whirl(0.0072, -220.0)
WINDOW = {"start": START, "steps_per_revolution": 128, "solver": jr.Exponential(basis="dense")}


def balls():
    return jr.load("ball-balancer-light")


RUN = {"solver": dfx.Dopri8(), "controller": dfx.PIDController(rtol=1e-11, atol=1e-14), "at": 0.14}
TIMES = np.linspace(0.0, 0.06, 7)

# objective: scene, function, parameters, step of the differences (relative)
CASES = {
    "contact_peak": (
        rubbing,
        lambda s: objectives.contact_peak(s, 1, **WINDOW),
        ("limiters.stiffness", "limiters.gap"),
        3e-6,
    ),
    "contact_rms": (
        rubbing,
        lambda s: objectives.contact_rms(s, 1, **WINDOW),
        ("limiters.friction", "limiters.gap"),
        3e-6,
    ),
    "contact_work": (
        rubbing,
        lambda s: objectives.contact_work(s, 1, **WINDOW),
        ("limiters.damping", "limiters.gap"),
        3e-6,
    ),
    "reaction_peak": (
        lambda: jr.load("two-discs").with_nodes(2),
        lambda s: objectives.reaction_peak(s, "supports.1", 1, steps_per_revolution=32),
        ("supports.stiffness",),
        1e-4,
    ),
    "reaction_rms": (
        lambda: jr.load("two-discs").with_nodes(2),
        lambda s: objectives.reaction_rms(s, "supports.0", 1, steps_per_revolution=32),
        ("supports.stiffness", "unbalance.eccentricity"),
        1e-4,
    ),
    "balancing_time": (
        balls,
        lambda s: objectives.balancing_time(s, TIMES, **RUN),
        ("support.angular_damping", "ball_balancers.0.drag_coefficient"),
        1e-3,
    ),
    "residual_imbalance": (
        balls,
        lambda s: objectives.residual_imbalance(s, TIMES, **RUN),
        ("support.angular_damping", "ball_balancers.0.drag_coefficient"),
        1e-3,
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_gradient_against_central_differences(name):
    build, objective, paths, step = CASES[name]
    scene = build()
    own = jnp.array([jnp.ravel(scene.get(path))[0] for path in paths])
    function = lambda values: objective(scene.put(dict(zip(paths, values, strict=True))))
    check_forward(function, own, step)


FORCES = jnp.array([[0.0, 3.0 + 4.0j], [-1.0j, 0.0]])  # [N]


def test_forces_of_a_window(monkeypatch):
    seen = types.SimpleNamespace(contact_force=FORCES, of=lambda name: FORCES[:, int(name[-1])])
    monkeypatch.setattr(objectives.motion, "simulate", lambda *_, **__: seen)
    monkeypatch.setattr(objectives.motion, "reactions", lambda response: response)
    scene = rubbing()
    assert float(objectives.contact_peak(scene, 1)) == 5.0
    mean = ((5.0**4 + 1.0) / 4) ** 0.25
    assert float(objectives.contact_peak(scene, 1, power=4)) == pytest.approx(mean, rel=1e-14)
    assert float(objectives.contact_rms(scene, 1)) == pytest.approx(13**0.5, rel=1e-14)
    assert float(objectives.reaction_peak(scene, "supports.1", 1)) == 5.0
    rms = float(objectives.reaction_rms(scene, "supports.0", 1))
    assert rms == pytest.approx(0.5**0.5, rel=1e-14)


def test_work_of_a_window(monkeypatch):
    """A constant power, weighed by a squared cosine, does the work of half of the window."""
    time, power = np.linspace(2.0, 5.0, 301), 7.0
    velocity = jnp.exp(3j * time)[:, None]
    force = power * velocity * jnp.array([[0.25 + 2j, 0.75 - 2j]])  # their cross parts do no work
    seen = types.SimpleNamespace(time=time, velocity=velocity, contact_force=force)
    monkeypatch.setattr(objectives.motion, "simulate", lambda *_, **__: seen)
    assert float(objectives.contact_work(rubbing(), 1)) == pytest.approx(power * 3.0 / 2, rel=1e-12)
    free, apart = one_disc(), limiter_rotor().replace({"limiters.0.at": 0.35})
    with pytest.raises(ValueError, match="no contacts"):
        objectives.contact_work(free, 1)
    with pytest.raises(ValueError, match="at one station"):
        objectives.contact_work(apart, 1)


def test_numbers_of_a_rub(monkeypatch):
    """A period's last sample is its first, so it does not count; derivatives: see `test_periodic`."""
    orbit = types.SimpleNamespace(
        whirl_rate=jnp.array(-0.5), displacement=jnp.array([[1.0], [2j], [-3.0], [1.0]])
    )
    monkeypatch.setattr(objectives.motion, "periodic", lambda *_, **__: orbit)
    seen = objectives.rub(rubbing(), orbit)
    assert float(seen.whirl_rate) == -0.5
    assert float(seen.radius) == pytest.approx((14 / 3) ** 0.5, rel=1e-14)
    assert float(objectives.rub(rubbing(), orbit, None).radius) == 3.0


def test_times_of_balls(monkeypatch):
    """An imbalance like `exp(-t / T)` takes the time T; what is left at the end by the capacity."""
    times = np.linspace(0.0, 30.0, 3001)
    fake = lambda *_, **__: types.SimpleNamespace(imbalance=1j * 1e-3 * jnp.exp(-times / 2.0))
    monkeypatch.setattr(objectives.balls, "run_up", fake)
    scene = balls()
    assert float(objectives.balancing_time(scene, times)) == pytest.approx(2.0, rel=1e-5)
    capacity = 0.06 * (2 * 0.025 + 3 * 0.020)
    last = 1e-3 * np.exp(-times[-300:] / 2.0)
    left = float(objectives.residual_imbalance(scene, times, 0.1))
    assert left == pytest.approx(np.sqrt(np.mean(last**2)) / capacity, rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["contact_rms", "contact_work", "reaction_peak"])
def test_derivatives_of_several_scenes_at_once_are_those_of_each(name):
    """`vmap` of the derivative by one parameter against a loop and differences.

    By friction alone, a compiler has lost some of the derivative (see `extremes`).
    """
    make, function, (path, *_), step = CASES[name]
    scene = make()
    value = jnp.ravel(scene.get(path))[0]
    of = lambda x: function(scene.put({path: x}))
    slope, of = jax.jacfwd(of), jax.jit(of)
    values = value * jnp.array([0.98, 1.0, 1.03])
    together = jax.jit(jax.vmap(slope))(values)
    alone = jax.jit(slope)
    np.testing.assert_allclose(together, [alone(x) for x in values], rtol=1e-9)
    h = step * abs(float(value))
    assert float(together[1]) == pytest.approx(
        central(lambda k: float(of(value + k * h)), h), rel=1e-5
    )
