"""Coupled steps: exponential ones of a rotor, with balls and a drive that it holds back beside them."""

import dataclasses

import diffrax as dfx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import jaxrotor as jr
from jaxrotor.equations.system import assemble
from jaxrotor.motion.speeds import expected_speed


MASS, STIFFNESS, DAMPING, OFFSET, POLAR = 2.0, 8e4, 12.0, 2e-3, 0.018  # critical speed 200 rad/s
TORQUE, SLOPE = 12.0, 0.004
DRIVE = jr.Drive(150.0, TORQUE, SLOPE, polar=POLAR, feedback=True)
BALL, RACE, DRAG, ROLLING = 0.05, 0.04, 2.0, 1.4
STOP = {"gap": 1e-3, "stiffness": 4e5, "damping": 50.0, "friction": 0.2, "rim_radius": 0.03}
QUIET = {"progress": False}


def jeffcott(*effects, spin=DRIVE):
    """Disc of two coordinates on a massless shaft."""
    disc = jr.Disc(0.5, MASS, 0.0, 0.01, offset=OFFSET, exact=False)
    shaft = jr.MasslessShaft(1.0, 0.5, STIFFNESS)
    return jr.Scene(shaft, disc, jr.DiscDamping(0.5, DAMPING), *effects, spin=spin)


# === against equations of the test's own, by SciPy


def balls_and_drive():
    """`q..` of x, y, theta and the angles of two balls, from their Lagrangian, and their friction."""
    turned = lambda angle: jnp.array([jnp.cos(angle), jnp.sin(angle)])

    def lagrangian(q, v):
        centre = lambda q: q[:2] + OFFSET * turned(q[2])
        speed = jax.jvp(centre, (q,), (v,))[1]
        value = (
            MASS * speed @ speed / 2 - STIFFNESS * q[:2] @ q[:2] / 2 - 9.81 * MASS * centre(q)[1]
        )
        value += (POLAR - MASS * OFFSET**2) * v[2] ** 2 / 2
        for k in (3, 4):
            place = lambda q, k=k: q[:2] + RACE * turned(q[k])
            speed = jax.jvp(place, (q,), (v,))[1]
            rolls = (ROLLING - 1) * BALL * RACE**2 * (v[k] - v[2]) ** 2 / 2
            value += BALL * speed @ speed / 2 + rolls - 9.81 * BALL * place(q)[1]
        return value

    @jax.jit
    def acceleration(q, v):
        momentum = jax.grad(lagrangian, 1)
        mass = jax.jacfwd(momentum, 1)(q, v)
        along = jax.jvp(lambda q: momentum(q, v), (q,), (v,))[1]
        drag = DRAG * RACE**2 * (v[3:] - v[2])
        drives = TORQUE - SLOPE * v[2] + jnp.sum(drag)
        outer = jnp.concatenate([-DAMPING * v[:2], drives[None], -drag])
        return jnp.linalg.solve(mass, jax.grad(lagrangian)(q, v) - along + outer)

    return lambda t, y: np.concatenate([y[5:], acceleration(y[:5], y[5:])])


@pytest.mark.slow
def test_balls_under_a_drive_against_their_lagrangian():
    """24 revolutions through the critical speed, with weight: errors fall by order 2 and 4."""
    angles, time = np.array([0.5, 2.0]), 0.5
    start = np.concatenate([[0, 0, 0], angles, [0, 0, 150, 150, 150]])
    exact = solve_ivp(balls_and_drive(), (0, time), start, "DOP853", rtol=1e-11, atol=1e-13).y[
        :, -1
    ]
    scene = jeffcott(
        jr.BallBalancer(0.5, BALL, RACE, DRAG, rolling=ROLLING, places=2), jr.Gravity(9.81)
    )
    begin = jr.Launch(balls=(jr.Balls(jnp.asarray(angles), jnp.zeros(2)),))
    for order, slope, last in ((2, 1.9, 1e-2), (4, 3.9, 1e-6)):
        errors = []
        for steps in (800, 1600):
            solver = jr.Exponential(order=order)
            run = jr.run_up(scene, [0.0, time], start=begin, solver=solver, substeps=steps)
            z, balls = complex(run.displacement[-1, 0]), run.balls[0].angle[-1] + run.angle[-1]
            found = np.array([z.real, z.imag, run.angle[-1], *balls, run.speed[-1]])
            sizes = np.array([OFFSET, OFFSET, 1.0, 1.0, 1.0, 100.0])
            errors.append(np.abs((found - exact[[0, 1, 2, 3, 4, 7]]) / sizes).max())
        assert errors[1] < last and np.log2(errors[0] / errors[1]) > slope


def rub_under_a_drive(t, y):
    """Rates of x, y, theta and theirs: a stop along x that brakes the drive."""
    z, dz, (angle, speed) = y[0] + 1j * y[1], y[3] + 1j * y[4], y[[2, 5]]
    depth = z.real - STOP["gap"]
    normal = max(STOP["stiffness"] * depth + STOP["damping"] * dz.real, 0.0) * (depth > 0)
    rubs = STOP["friction"] * normal * np.sign(speed * STOP["rim_radius"] + dz.imag)
    force = -DAMPING * dz - STIFFNESS * z - normal - 1j * rubs
    turn = np.exp(1j * angle)
    # m z.. = force + m e (O^2 - i O.) turn,  I O. = torque + m e Im(.. z..): two equations for O.
    torque = TORQUE - SLOPE * speed - STOP["rim_radius"] * rubs
    ahead = (force + MASS * OFFSET * speed**2 * turn) / MASS
    pull = MASS * OFFSET * np.imag(np.conj(turn) * ahead)
    late = (torque - pull) / (POLAR - MASS * OFFSET**2)
    acceleration = ahead - 1j * OFFSET * late * turn
    return np.array([dz.real, dz.imag, speed, acceleration.real, acceleration.imag, late])


@pytest.mark.slow
def test_steps_are_located_where_a_stop_brakes_the_drive():
    """Three revolutions with impacts: order 4 to 2e-9, which plain steps miss by 1e-4."""
    time = 0.1
    exact = solve_ivp(
        rub_under_a_drive, (0, time), [0, 0, 0, 0, 0, 150.0], "DOP853", rtol=1e-12, atol=1e-15
    ).y[:, -1]
    scene, errors = jeffcott(jr.Limiter(0.5, 0.0, **STOP)), []
    for located, steps in ((False, 800), (True, 400), (True, 800)):
        solver = jr.Exponential(order=4, located=located)
        run = jr.run_up(scene, [0.0, time], solver=solver, substeps=steps)
        found = complex(run.displacement[-1, 0]) - (exact[0] + 1j * exact[1])
        errors.append(abs(found) / OFFSET + abs(float(run.speed[-1]) - exact[5]) / 100)
        assert int(run.unresolved) == 0
    plain, coarse, fine = errors
    assert fine < 1e-8 and fine < coarse / 10 and plain > 1e3 * fine


# === against integration in the axes of the shaft


@pytest.fixture(scope="module")
def flexible():
    """Two nodes a span, gyroscopic disc, unequal bearings, damping in the shaft, a balancer, a drive."""
    shaft = jr.FlexibleShaft(
        1.0, 0.02, jr.Material(2e11, 7800.0), nodes=2, constraints=[jr.Constraint(0.0, "clamp")]
    )
    return jr.Scene(
        shaft,
        jr.Disc(0.3, 3.0, 0.02, 0.04, offset=1e-3),
        jr.Support(1.0, 1e6, 300.0, anisotropy=0.3, cross_stiffness=2e4),
        jr.InternalDamping(2e-5),
        jr.BallBalancer(0.7, 0.03, 0.05, 2.0, places=2),
        jr.Gravity(9.81),
        spin=jr.Drive(120.0, 6.0, 0.004, feedback=True),
    )


@pytest.mark.long
def test_a_flexible_rotor_with_all_of_it(flexible):
    """Parts that turn with the shaft act on the drive, which no other effect here does."""
    times = np.linspace(0.0, 0.2, 3)
    fine = {"solver": dfx.Dopri8(), "controller": dfx.PIDController(rtol=1e-10, atol=1e-13)}
    exact = jr.run_up(flexible, times, **fine)
    without = jr.run_up(flexible.without("internal_damping"), times, **fine)
    errors = []
    for steps in (800, 1600):
        run = jr.run_up(flexible, times, solver=jr.Exponential(order=4), substeps=steps)
        z, ref = np.asarray(run.displacement), np.asarray(exact.displacement)
        turned = np.abs(run.angle - exact.angle).max()
        errors.append(np.abs(z - ref).max() / np.abs(ref).max() + turned)
    assert errors[1] < 1e-6 and errors[0] > 12 * errors[1]
    assert np.abs(without.angle - exact.angle).max() > 10 * errors[1]


# === lanes


@pytest.mark.slow
def test_lanes_are_runs(flexible):
    """By default exponential ones, and the same steps as a run takes; a window before the samples."""
    times = np.linspace(0.05, 0.15, 33)
    over = {"spin.torque": [4.0, 8.0], "start.balls.0.angle.0": [0.5]}
    start = jr.Launch(balls=(jr.Balls(jnp.array([0.0, 1.0]), jnp.zeros(2)),))
    observe = [jr.observe.Peak(), jr.observe.Imbalance(), jr.observe.Capture(200.0)]
    found = jr.sweep(
        flexible, over, start=start, times=times, observe=observe, error_sample=2, **QUIET
    )
    assert "Exponential" in found.attrs["solver"] and "order=4" in found.attrs["solver"]
    start = jr.Launch(balls=(jr.Balls(jnp.array([0.5, 1.0]), jnp.zeros(2)),))
    for k, torque in enumerate(over["spin.torque"]):
        scene = flexible.replace({"spin.torque": torque})
        steps = found.attrs["steps_per_sample"]
        run = jr.run_up(
            scene,
            np.append(np.linspace(0.0, 0.05, 17)[:-1], times),
            start=start,
            solver=jr.Exponential(order=4),
            substeps=steps,
        )
        radius = np.abs(run.displacement[16:, 0]).max()
        assert float(found.peak[k, 0]) == pytest.approx(radius, rel=1e-8)
        size = np.abs(run.imbalance)[-1]
        assert float(found.imbalance_end[k, 0]) == pytest.approx(size, rel=1e-8)
    assert 0 < found.peak.attrs["error"] < 1e-2 * float(found.peak.max())


@pytest.mark.long
def test_lanes_of_a_located_rub(flexible):
    """Lanes that touch a stop at different times are those of single runs."""
    scene = jeffcott(jr.Limiter(0.5, 0.0, **STOP))
    times, torques = np.linspace(0.0, 0.1, 33), [8.0, 12.0, 16.0]
    solver = jr.Exponential(order=4, located=True)
    settings = {"times": times, "solver": solver, "steps_per_revolution": 64, "error_sample": 0}
    observe = [jr.observe.Capture(200.0)]
    found = jr.sweep(scene, {"spin.torque": torques}, observe=observe, **settings, **QUIET)
    assert found.status.values.tolist() == [0, 0, 0]
    for k, torque in enumerate(torques):
        one = scene.replace({"spin.torque": torque})
        run = jr.run_up(one, times, solver=solver, substeps=16)
        assert float(found.end_speed[k]) == pytest.approx(float(run.speed[-1]), rel=1e-7)


@pytest.mark.slow
@pytest.mark.parametrize("which", ["coasting", "table"])
def test_lanes_keep_what_depends_on_the_speed(which):
    """A drive that alone would keep its speed, and the coefficients over speed of every lane."""
    shaft = jr.FlexibleShaft(
        1.0, 0.02, jr.Material(2e11, 7800.0), nodes=2, constraints=[jr.Constraint(0.0, "clamp")]
    )
    parts = [jr.Disc(0.3, 3.0, 0.05, 0.03, offset=2e-3)]
    if which == "coasting":  # only the rotor slows it down
        parts.append(jr.Support(1.0, 1e6, 300.0))
        spin = jr.Drive(150.0, 0.0, feedback=True)
    else:
        stiffness = np.array([5e5, 2e6])
        parts.append(
            jr.Support(
                1.0, kxx=stiffness, kyy=stiffness, cxx=300.0, cyy=300.0, speeds=[100.0, 300.0]
            )
        )
        parts.append(jr.BallBalancer(0.7, 0.03, 0.05, 2.0, places=2))
        spin = jr.ConstantSpeed(150.0)
    scene, times = jr.Scene(shaft, *parts, spin=spin), np.linspace(0.0, 0.1, 33)
    observe, over = [jr.observe.Peak()], {"spin.speed": [150.0, 250.0]}
    found = jr.sweep(scene, over, times=times, observe=observe, **QUIET)
    for k, speed in enumerate(over["spin.speed"]):
        run = jr.run_up(
            scene.replace({"spin.speed": speed}),
            times,
            solver=jr.Exponential(order=4),
            substeps=found.attrs["steps_per_sample"],
        )
        assert float(found.peak[k]) == pytest.approx(np.abs(run.displacement).max(), rel=1e-5)


def test_balls_meet_a_kink_of_the_speed():
    """The acceleration of the shaft jumps within a run: order 4 as without."""
    profile = jr.SpeedProfile([0.0, 0.1, 0.2], [250.0, 320.0, 250.0])
    balls = jr.BallBalancer(0.5, BALL, RACE, DRAG, rolling=ROLLING, places=2)
    scene, last = jeffcott(balls, spin=profile), []
    for steps in (200, 400, 1600):
        run = jr.run_up(scene, [0.0, 0.2], solver=jr.Exponential(order=4), substeps=steps)
        last.append(complex(run.displacement[-1, 0]))
    assert abs(last[1] - last[2]) < abs(last[0] - last[2]) / 12


@pytest.mark.parametrize(
    ("drive", "end"),
    [
        (jr.Drive(0.0, 400.0, 2.5, 0.001, polar=0.018, odd=True), 400 / 2.5),
        (jr.Drive(150.0, 0.0, table_speeds=[145.0, 157.0], table_torques=[30.0, 0.0], polar=0.018), 157.0),
    ],
)  # fmt: skip
def test_speed_of_a_steep_motor_alone(drive, end):
    """It settles where its torque is zero, however long the run is for the time its motor takes."""
    system = assemble(jeffcott(spin=dataclasses.replace(drive, feedback=True)))
    speeds = expected_speed(system, jnp.array([0.0, 50.0, 100.0]))
    torque = dataclasses.replace(drive).moment(speeds[-1])
    assert abs(float(torque)) < 1e-6 and float(speeds[-1]) <= end * (1 + 1e-9)


# === derivatives, settings


@pytest.mark.slow
def test_derivative_by_the_torque():
    def last(torque):
        scene = jeffcott().replace({"spin.torque": torque})
        run = jr.run_up(scene, [0.0, 0.2], solver=jr.Exponential(order=4), substeps=200)
        return jnp.stack([run.speed[-1], jnp.abs(run.displacement[-1, 0])])

    by = jax.jacfwd(last)(TORQUE)
    step = 1e-3
    differences = (last(TORQUE + step) - last(TORQUE - step)) / (2 * step)
    np.testing.assert_allclose(by, differences, rtol=1e-6)


@pytest.mark.slow
def test_steps_that_a_motor_map_needs():
    """A drive with a table has no closed form; its speed alone tells how many steps follow it."""
    table = {"table_speeds": jnp.array([0.0, 400.0]), "table_torques": jnp.array([0.0, -1.6])}
    mapped = dataclasses.replace(DRIVE, slope=None, **table)
    runs = [
        jr.run_up(jeffcott(spin=spin), [0.0, 0.2], solver=jr.Exponential(order=4))
        for spin in (DRIVE, mapped)
    ]
    np.testing.assert_allclose(runs[0].displacement, runs[1].displacement, rtol=1e-9)


@pytest.mark.slow
def test_lanes_under_a_motor_map():
    """Each reads the table of its own motor, at its own speed, beside balls and a stop."""
    table = {
        "table_speeds": jnp.array([0.0, 200.0, 400.0]),
        "table_torques": jnp.array([0.0, -1.0, -1.6]),
    }
    balls = jr.BallBalancer(0.5, BALL, RACE, DRAG)
    scene = jeffcott(
        balls, jr.Limiter(0.5, 0.0, **STOP), spin=dataclasses.replace(DRIVE, slope=None, **table)
    )
    times, torques = np.linspace(0.0, 0.1, 33), [4.0, 8.0]
    settings = {"times": times, "steps_per_revolution": 64, "solver": jr.Exponential(order=4)}
    observe = [jr.observe.Peak(), jr.observe.Capture(200.0), jr.observe.Imbalance()]
    found = jr.sweep(
        scene, {"spin.torque": torques}, observe=observe, error_sample=0, **settings, **QUIET
    )
    for k, torque in enumerate(torques):
        run = jr.run_up(
            scene.replace({"spin.torque": torque}),
            times,
            solver=jr.Exponential(order=4),
            substeps=found.attrs["steps_per_sample"],
        )
        assert float(found.end_speed[k]) == pytest.approx(float(run.speed[-1]), rel=1e-9)
        assert float(found.peak[k]) == pytest.approx(np.abs(run.displacement[:, 0]).max(), rel=1e-9)
        assert float(found.imbalance_end[k]) == pytest.approx(np.abs(run.imbalance)[-1], rel=1e-8)


@pytest.mark.parametrize(
    ("scene", "words"),
    [
        (
            jeffcott(spin=dataclasses.replace(DRIVE, coulomb=1.0)),
            "the rotor may come to rest under its Drive",
        ),
        (
            jeffcott(jr.BallBalancer(0.5, BALL, RACE, DRAG, ball_radius=5e-3), jr.BallContact(1e5)),
            "balls touch each other",
        ),
        (jeffcott(jr.Support(0.5, 1e3, rotating=True, anisotropy=0.2)), "unequal axes turn"),
    ],
)
def test_what_coupled_steps_do_not_take(scene, words):
    with pytest.raises(ValueError, match=words):
        jr.run_up(scene, [0.0, 0.1], solver=jr.Exponential())


def test_a_drive_beside_a_rotor_that_does_not_feel_it():
    """Nothing acts on the rotor and nothing of it is read: a damped oscillation beside a motor."""
    disc, shaft = jr.Disc(0.5, MASS, exact=False), jr.MasslessShaft(1.0, 0.5, STIFFNESS)
    motor = jr.Drive(20.0, 12.0, 0.06, polar=POLAR, feedback=True)
    scene = jr.Scene(shaft, disc, jr.DiscDamping(0.5, DAMPING), spin=motor)
    times = np.linspace(0.0, 0.3, 7)
    found = jr.run_up(
        scene, times, start=jr.Whirl(1e-3, rate=0.0), solver=jr.Exponential(4), substeps=40
    )
    decay = DAMPING / (2 * MASS)
    rate = np.sqrt(STIFFNESS / MASS - decay**2)
    expected = np.exp(-decay * times) * (np.cos(rate * times) + decay / rate * np.sin(rate * times))
    place = found.displacement[:, 0]
    np.testing.assert_allclose(place / place[0], expected, atol=1e-9)
    speed = 200.0 - 180.0 * np.exp(-0.06 / POLAR * times)
    np.testing.assert_allclose(found.speed, speed, rtol=1e-9)
