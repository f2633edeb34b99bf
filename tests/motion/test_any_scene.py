"""Any scene in `simulate` and `sweep`: what is drawn decides how it is stepped."""

import dataclasses

import diffrax as dfx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import jaxrotor as jr
from jaxrotor.plot import record


MASS, STIFFNESS, DAMPING, OFFSET = 2.0, 8e4, 40.0, 2e-4  # critical speed 200 rad/s
CRITICAL = (STIFFNESS / MASS) ** 0.5
BALL, RACE, DRAG, GAP, STOP = 0.02, 0.05, 0.5, 1.5e-4, 5e4
FINE = dfx.PIDController(rtol=1e-12, atol=1e-15)
TIMES = np.linspace(0.0, 0.3, 97)


def jeffcott(*effects, speed=260.0, spin=None, **shaft):
    """Disc of two coordinates on a massless shaft."""
    return jr.Scene(
        jr.MasslessShaft(1.0, 0.5, STIFFNESS, **shaft),
        jr.Disc(0.5, MASS, 0.0, 0.01, offset=OFFSET, exact=False),
        jr.DiscDamping(0.5, DAMPING),
        *effects,
        spin=jr.ConstantSpeed(speed) if spin is None else spin,
    )


def with_balls(*effects):
    return jeffcott(jr.BallBalancer(0.5, BALL, RACE, DRAG, rolling=1.0, places=2), *effects)


STOPS = [jr.Limiter(0.5, angle, GAP, STOP, 0.0) for angle in (0.0, 2.1, 4.2)]
LAUNCH = jr.Launch(balls=(jr.Balls(jnp.array([0.4, 2.0]), jnp.zeros(2)),))


# === one motion


def test_times_are_those_of_run_up():
    scene = jeffcott()
    run, one = jr.run_up(scene, TIMES), jr.simulate(scene, times=TIMES)
    assert isinstance(one, jr.TimeHistory) and one.steps_per_revolution is None
    np.testing.assert_array_equal(one.displacement, run.displacement)
    for given, words in (({"keep": 1}, "`keep`"), ({"revolutions": 3}, "`revolutions`")):
        with pytest.raises(ValueError, match=f"{words} is for whole revolutions"):
            jr.simulate(scene, times=TIMES, **given)
    with pytest.raises(ValueError, match="needs `revolutions`, or the `times`"):
        jr.simulate(scene)
    with pytest.raises(ValueError, match="no error estimate"):
        jr.simulate(with_balls(), 1, solver=dfx.Euler())


@pytest.mark.slow
def test_a_motion_begins_at_any_angle():
    """Three parts of a motion, the second of whole revolutions from an angle in between."""
    scene = jeffcott(jr.Gravity(9.81))
    period = 2 * np.pi / 260.0
    # As many samples from zero, steps and coordinates to begin with as a revolution of 32 steps has:
    # one program serves all parts.
    run = {"controller": FINE, "max_steps": 4096}
    samples = lambda last: np.linspace(0.0, last, 33) * period
    none = jnp.zeros(1) + 0j
    rest = jr.Launch(jr.Continued(none, none), balls=(), speed=260.0)  # as the end of a run
    whole = jr.simulate(scene, times=samples(3.2), start=rest, **run)
    first = jr.simulate(scene, times=samples(1.3), start=rest, **run)
    second = jr.simulate(scene, 1, 32, start=first.end, **run)
    assert second.steps_per_revolution == 32 and second.time.shape == (33,)
    z = np.asarray(whole.displacement[[23, 32], 0])  # at 2.3 and 3.2 revolutions
    assert abs(second.displacement[-1, 0] - z[0]) < 1e-6 * abs(z[0])
    third = jr.simulate(scene, times=samples(0.9), start=second.end, **run)
    assert abs(third.displacement[-1, 0] - z[1]) < 1e-6 * abs(z[0])
    with pytest.raises(ValueError, match="begins at angle zero, but the start is at"):
        jr.lyapunov(scene, start=first.end)
    turned = {"start.angle": [0.0, float(first.end.angle)]}
    counts = {"settle": 0, "keep": 1, "steps_per_revolution": 32, "progress": False}
    lanes = jr.sweep(scene, turned, start=first.end, observe=[jr.observe.Radius()], **counts)
    radius = np.abs(second.displacement[1:]).max()
    assert float(lanes.radius_max[1]) == pytest.approx(radius, rel=1e-6)
    assert float(lanes.radius_max[0]) != pytest.approx(radius, rel=1e-3)
    again = dataclasses.replace(first.end, angle=jnp.asarray(first.end.angle) + 0.7 * 2 * np.pi)
    assert jr.simulate(scene, 1, 16, start=again).solver.startswith("Exponential")


def lagrangian(q, v, angle):
    """Rotor and two balls: x, y of the disc, and the angles of the balls in fixed axes."""
    centre = lambda q, angle: q[:2] + OFFSET * jnp.array([jnp.cos(angle), jnp.sin(angle)])
    speed = jax.jvp(centre, (q, angle), (v, jnp.asarray(260.0)))[1]
    value = MASS * speed @ speed / 2 - STIFFNESS * q[:2] @ q[:2] / 2
    for k in (2, 3):
        at = lambda q, k=k: q[:2] + RACE * jnp.array([jnp.cos(q[k]), jnp.sin(q[k])])
        speed = jax.jvp(at, (q,), (v,))[1]
        value += BALL * speed @ speed / 2
    return value


@jax.jit
def rates(t, y):
    q, v, angle = y[:4], y[4:], 260.0 * t
    momentum = jax.grad(lagrangian, 1)
    mass = jax.jacfwd(momentum, 1)(q, v, angle)
    along = jax.jvp(lambda q, angle: momentum(q, v, angle), (q, angle), (v, jnp.asarray(260.0)))[1]
    stops = 0.0
    for stop in (0.0, 2.1, 4.2):
        normal = jnp.array([jnp.cos(stop), jnp.sin(stop)])
        stops -= STOP * jnp.maximum(normal @ q[:2] - GAP, 0.0) * normal
    drag = -DRAG * RACE**2 * (v[2:] - 260.0)
    outer = jnp.concatenate([stops - DAMPING * v[:2], drag])
    return jnp.concatenate(
        [v, jnp.linalg.solve(mass, jax.grad(lagrangian)(q, v, angle) - along + outer)]
    )


@pytest.fixture(scope="module")
def by_lagrangian():
    """The rotor with balls that rubs, by SciPy on its Lagrangian."""
    y = np.array([0, 0, 0.4, 2.0, 0, 0, 260.0, 260.0])
    options = {"rtol": 1e-10, "atol": 1e-14, "max_step": 5e-4}
    own = lambda t, y: np.asarray(rates(np.float64(t), y))
    found = solve_ivp(own, (0, 0.3), y, "DOP853", TIMES, **options)
    return found.y


@pytest.mark.slow
def test_balls_with_rub_move_by_their_lagrangian(by_lagrangian):
    z, balls = by_lagrangian[:2].T @ [1, 1j], by_lagrangian[2:4].T
    assert (np.abs(z) > 1.1 * GAP).any()
    run = jr.simulate(with_balls(*STOPS), times=TIMES, start=LAUNCH)
    assert np.abs(run.displacement[:, 0] - z).max() < 1e-5 * np.abs(z).max()
    assert np.abs(run.balls[0].angle - (balls - 260.0 * TIMES[:, None])).max() < 1e-4
    assert np.abs(run.contact_force).max() > 0


def test_angle_of_rotation_has_the_sign_of_the_speed():
    back = jr.simulate(jeffcott(speed=-300.0), 2, 16)
    assert float(back.angle[-1]) == pytest.approx(-4 * np.pi)
    np.testing.assert_allclose(record.revolutions(back), np.arange(33) / 16)
    still = jr.simulate(jeffcott(speed=0.0), 3, 16, keep=2, period=0.01, start=jr.Whirl(1e-4))
    assert not still.angle.any() and not still.speed.any()
    np.testing.assert_allclose(record.revolutions(still), 1 + np.arange(33) / 16)


def test_whirl_of_a_run_up_is_over_its_own_speed():
    spin = jr.SpeedProfile([0.0, 0.3], [0.0, 100.0])
    motion = jr.simulate(jeffcott(spin=spin), times=TIMES)
    whirl = record.whirl_speed(motion, 0)
    assert np.isfinite(whirl[1:]).all() and whirl[-20:].mean() == pytest.approx(1.0, abs=0.3)


# The counter-rotor is the dual rotor at another ratio, and takes two minutes; motions of rotors in
# magnetic bearings are those of tests/effects/test_magnetic_bearing.py
LONG = {"counter-rotor", "magnetic-rotor"}


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(n, marks=pytest.mark.long if n in LONG else pytest.mark.slow)
        for n, *_ in jr.shipped()
    ],
)
def test_every_shipped_scene_moves(name):
    """In `simulate` and in lanes of a sweep over two parameters, which end alike; or for a reason."""
    scene = jr.load(name)
    if scene.resolution:
        scene = scene.with_nodes(3)
    if not has(scene, "gravity.acceleration"):
        scene = scene.of_parts(*scene.effects, jr.Gravity(9.81))
    station = scene.shaft.length if "ball" in name else None
    paths = "disc.mass", "discs.0.mass", "ball_balancers.0.drag", "magnetic_bearings.kd"
    path = next(path for path in paths if has(scene, path))
    values = {
        "gravity.acceleration": [5.0, 9.81],
        path: [1.01 * float(np.ravel(scene.get(path))[0])],
    }
    one = scene.replace({path: values[path][0], "gravity.acceleration": 9.81})
    times = np.linspace(0.0, 0.05, 33)
    if isinstance(scene.spin, jr.ConstantSpeed):
        run = {"revolutions": 2, "steps_per_revolution": 32}
        lanes = {"settle": 0, "keep": 2, "steps_per_revolution": 32}
    else:
        run = lanes = {"times": times}
    if name.startswith("gyroscopic"):
        with pytest.raises(ValueError, match="Hysteretic damping .*not in time"):
            jr.simulate(one, at=station, **run)
        with pytest.raises(ValueError, match="Hysteretic damping .*not in time"):
            jr.sweep(scene, values, at=station, progress=False, **lanes)
        return
    motion = jr.simulate(one, at=station, **run)
    lanes |= {"observe": [jr.observe.Radius()], "error_sample": 0, "progress": False}
    found = jr.sweep(scene, values, at=station, **lanes)
    last = found.sel({"gravity.acceleration": 9.81}).isel({path: 0})
    radius = np.abs(motion.displacement[1:, 0]).max()
    assert int(last.status) in (0, 2) and np.isfinite(float(last.radius_max))
    assert float(last.radius_max) == pytest.approx(radius, rel=1e-5, abs=1e-12)


def has(scene, path):
    try:
        return scene.get(path) is not None
    except ValueError:
        return False
