"""Run-up in closed form: values of the sheet, integration by scipy, and every degenerate case."""

import itertools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import jaxrotor as jr


INERTIA = 2.2354  # I_zz of the sheet, to first order in the tilt
BASE = (1950.0, 1.57, 0.039, 600.0)  # M0, k1, k2, Omega_0 of variant 31


def closed(time, data, polar=INERTIA):
    return jr.riccati(time, polar, *data)


def integrated(times, data, polar=INERTIA):
    """Angle and speed by scipy, (2, T)."""
    m0, k1, k2, speed = data
    law = lambda t, y: [y[1], (m0 - k1 * y[1] - k2 * y[1] ** 2) / polar]
    options = {"method": "DOP853", "rtol": 1e-13, "atol": 1e-13, "t_eval": times}
    return solve_ivp(law, (0.0, times[-1]), [0.0, speed], **options).y


# === the sheet, section 3.2, 3.3, 3.5

TABLE = [
    (0.00, 600.0000000, -5829.829113),
    (0.02, 504.3056223, -3918.941619),
    (0.04, 438.1651545, -2784.950656),
    (0.06, 390.2296553, -2058.490082),
    (0.08, 354.2807596, -1566.296950),
    (0.10, 326.6244689, -1218.331672),
    (0.12, 304.9273902, -964.026045),
    (0.14, 287.6426786, -773.191875),
    (0.16, 273.7042059, -626.895098),
    (0.18, 262.3532918, -512.765235),
    (0.20, 253.0354659, -422.437422),
    (0.22, 245.3363078, -350.086900),
    (0.24, 238.9401198, -291.553566),
    (0.26, 233.6024701, -243.799913),
    (0.28, 229.1314533, -204.564765),
    (0.30, 225.3745909, -172.135927),
    (0.32, 222.2094790, -145.197250),
    (0.34, 219.5369827, -122.723471),
    (0.36, 217.2761978, -103.906473),
    (0.38, 215.3606638, -88.102642),
    (0.40, 213.7354748, -74.794654),
    (0.42, 212.3550502, -63.563324),
    (0.44, 211.1813915, -54.066569),
    (0.46, 210.1827071, -46.023483),
    (0.48, 209.3323160, -39.202137),
]


def test_speed_and_acceleration_of_the_sheet():
    times, speeds, rates = np.array(TABLE).T
    found = closed(times, BASE)
    np.testing.assert_allclose(found.speed, speeds, atol=5.1e-8, rtol=0)
    np.testing.assert_allclose(found.acceleration, rates, atol=5.1e-7, rtol=0)
    assert abs(closed(0.16, BASE).angle - 60.68796105) < 5.1e-9
    assert abs(closed(0.48, BASE).angle - 133.69098650) < 5.1e-9


def test_steady_speed_and_rate_of_the_sheet():
    assert abs(jr.steady_speed(*BASE[:3]) - 204.382695814) < 5.1e-10
    assert abs(jr.relaxation_rate(INERTIA, *BASE[:3]) - 7.833877728) < 5.1e-10
    assert abs(closed(0.592086, BASE).speed / 204.382695814 - 1.01) < 1e-7


STEADY = float(1950 * 2 / (1.57 + np.sqrt(1.57**2 + 4 * 0.039 * 1950)))
SPECIAL = {
    "k2 = 0": ((1950.0, 1.57, 0.0, 600.0), 668.2420602522),
    "k1 = 0": ((1950.0, 0.0, 0.039, 600.0), 291.1107768288),
    "k1 = k2 = 0": ((1950.0, 0.0, 0.0, 600.0), 739.5723360472),
    "M0 = 0": ((0.0, 1.57, 0.039, 600.0), 207.5025550998),
    "M0 = k1 = 0": ((0.0, 0.0, 0.039, 600.0), 224.3101314513),
    "steady": ((1950.0, 1.57, 0.039, STEADY), 204.3826958136),
    "from rest": ((1950.0, 1.57, 0.039, 0.0), 117.9015589611),
    "D^2 < 0": ((-100.0, 1.57, 0.039, 600.0), 203.9163588945),
    "D = 0": ((-(1.57**2) / (4 * 0.039), 1.57, 0.039, 600.0), 206.9372477372),
}
MORE = {  # cases that are not in the sheet
    "k1 < 0": (50.0, -0.9, 0.01, 3.0),
    "k1 < 0, k2 = 0": (50.0, -0.9, 0.0, 3.0),
    "nothing": (0.0, 0.0, 0.0, 40.0),
    "M0 = k2 = 0": (0.0, 1.57, 0.0, 600.0),
    "M0 < 0, k1 = 0": (-100.0, 0.0, 0.039, 600.0),
    "D^2 < 0, strong": (-1e4, 1.57, 0.039, 600.0),
    "negative speed": (1950.0, 1.57, 0.039, -200.0),
}
CASES = {name: data for name, (data, _) in SPECIAL.items()} | MORE | {"base": BASE}


@pytest.mark.hard("4.5 no drag, no slope, no torque, D = 0, D^2 < 0")
@pytest.mark.parametrize("name", SPECIAL)
def test_special_cases_of_the_sheet(name, record_property):
    data, speed = SPECIAL[name]
    error = abs(closed(0.16, data).speed - speed)
    record_property("measured", f"{name}: {error:.0e} rad/s")
    assert error < 5.1e-11


@pytest.mark.parametrize("name", CASES)
def test_integration_agrees(name):
    data = CASES[name]
    end = min(3.0, 0.9 * float(jr.blow_up_time(INERTIA, *data)))
    times = np.linspace(0.0, end, 13)
    angle, speed = integrated(times, data)
    found = closed(times, data)
    scale = np.abs(speed).max()
    np.testing.assert_allclose(found.speed, speed, atol=2e-11 * scale, rtol=0)
    np.testing.assert_allclose(found.angle, angle, atol=2e-11 * scale * end, rtol=0)
    m0, k1, k2, _ = data
    law = (m0 - k1 * speed - k2 * speed**2) / INERTIA
    size = (abs(m0) + abs(k1) * scale + k2 * scale**2) / INERTIA
    np.testing.assert_allclose(found.acceleration, law, atol=1e-10 * size, rtol=0)


# === hard cases of the sheet, section 4


@pytest.mark.hard("4.3 reactions at once on starting from rest")
def test_run_up_from_rest_starts_with_full_acceleration():
    start = closed(0.0, (1950.0, 1.57, 0.039, 0.0))
    assert start.angle == 0 and start.speed == 0
    np.testing.assert_allclose(start.acceleration, 1950 / INERTIA, rtol=1e-15)


@pytest.mark.hard("4.4 braked to a stop")
def test_braking_stops_at_the_time_of_the_sheet():
    braked = (-100.0, 1.57, 0.039, 600.0)
    stop = jr.stop_time(INERTIA, *braked)
    assert abs(stop - 1.3411738400) < 5.1e-11
    assert abs(closed(stop, braked).speed) < 1e-11
    d = np.sqrt(4 * 0.039 * 100 - 1.57**2)
    beyond = np.arctan(1.57 / d) + np.pi / 2  # phase from Omega = 0 to minus infinity, D^2 < 0
    np.testing.assert_allclose(
        jr.blow_up_time(INERTIA, *braked) - stop, 2 * INERTIA / d * beyond, rtol=1e-14
    )


@pytest.mark.hard("4.4 coast-down never ends")
def test_a_rotor_left_alone_never_stops():
    for data in (
        (0.0, 1.57, 0.039, 600.0),
        (0.0, 1.57, 0.0, 600.0),
        (0.0, 0.0, 0.039, 600.0),
        BASE,
    ):
        assert jr.stop_time(INERTIA, *data) == np.inf
        assert jr.blow_up_time(INERTIA, *data) == np.inf
    assert jr.stop_time(INERTIA, 0.0, 1.57, 0.039, 0.0) == 0  # at rest from the start
    late = closed(200.0, (0.0, 1.57, 0.0, 600.0)).speed
    np.testing.assert_allclose(late, 600 * np.exp(-1.57 * 200 / INERTIA), rtol=1e-13)


ARC = np.sqrt(0.02 * 50)  # |D| / 2
STOPS = [
    ((-1950.0, 1.57, 0.0, 600.0), INERTIA / 1.57 * np.log1p(600 * 1.57 / 1950)),
    ((-50.0, 0.0, 0.0, 600.0), INERTIA * 600 / 50),
    ((-50.0, 0.0, 0.02, 600.0), INERTIA / ARC * np.arctan(600 * 0.02 / ARC)),
    ((-(1.57**2) / 0.156, 1.57, 0.039, 600.0), INERTIA * (2 / 1.57 - 1 / (0.039 * 600 + 0.785))),
    ((1950.0, 1.57, 0.039, -200.0), None),
]


@pytest.mark.parametrize(("data", "stop"), STOPS)
def test_other_stops(data, stop):
    found = jr.stop_time(INERTIA, *data)
    if stop is not None:
        np.testing.assert_allclose(found, stop, rtol=1e-12)
    before, after = closed(np.array([0.999, 1.001]) * found, data).speed
    assert before * data[3] > 0 > after * data[3]
    assert abs(closed(found, data).speed) < 1e-10


@pytest.mark.hard("4.4 drag to the letter runs away at negative speed", outcome="refused")
def test_a_negative_speed_that_its_drag_drives_runs_away():
    runaway = (1950.0, 1.57, 0.039, -300.0)
    last = jr.blow_up_time(INERTIA, *runaway)
    assert abs(last - 0.282039) < 5.1e-7
    assert jr.stop_time(INERTIA, *runaway) == np.inf
    assert closed(0.28203, runaway).speed < -1e5
    with pytest.raises(ValueError, match=r"`time \[s\]` must be below 0.282039, where the speed"):
        closed(0.3, runaway)
    traced = jax.jit(lambda t: closed(t, runaway))(jnp.asarray([0.1, 0.3, 50.0]))
    for value in traced:
        assert np.isfinite(value[0]) and np.isnan(value[1:]).all()


def test_a_braked_rotor_has_no_solution_after_its_blow_up():
    """After its pole the tangent of the formula would give finite values, which are no solution."""
    braked = (-100.0, 1.57, 0.039, 600.0)
    last = float(jr.blow_up_time(INERTIA, *braked))
    times = jnp.asarray([0.99, 1.01, 1.5, 3.3]) * last
    speed = jax.jit(lambda t: closed(t, braked).speed)(times)
    assert np.isfinite(speed[0]) and np.isnan(speed[1:]).all()


def test_a_negative_time_is_refused():
    with pytest.raises(ValueError, match=r"`time \[s\]` must not be negative, but is -0.1."):
        closed(np.array([0.0, -0.1]), BASE)


@pytest.mark.hard("4.6 the angle as drag vanishes")
@pytest.mark.parametrize("k2", [1e-4, 1e-8, 1e-12, 1e-16, 1e-20, 1e-300, 0.0])
@pytest.mark.parametrize("time", [0.01, 0.16, 3.0, 50.0])
def test_the_angle_keeps_its_digits_as_drag_vanishes(k2, time):
    """First order in k2: `I theta_1.. + k1 theta_1. = -Omega_0(t)^2` in closed form by hand."""
    m0, k1, _, speed = BASE
    w, rate = m0 / k1, k1 / INERTIA
    v, e = speed - w, np.exp(-rate * time)
    angle = w * time - v / rate * np.expm1(-rate * time)
    if k2 <= 1e-12:
        first = w * w * (time / rate + np.expm1(-rate * time) / rate**2)
        first += 2 * w * v * (-np.expm1(-rate * time) / rate**2 - time * e / rate)
        first += v * v * np.expm1(-rate * time) ** 2 / (2 * rate**2)
        np.testing.assert_allclose(
            closed(time, (m0, k1, k2, speed)).angle, angle - k2 / INERTIA * first, rtol=2e-14
        )
    else:
        reference = integrated(np.array([0.0, time]), (m0, k1, k2, speed))[0, -1]
        np.testing.assert_allclose(closed(time, (m0, k1, k2, speed)).angle, reference, rtol=1e-11)


def test_the_angle_without_any_resistance():
    for k1, k2 in itertools.product([0.0, 1e-18, 1e-13], repeat=2):
        found = closed(2.0, (7.0, k1, k2, 3.0))
        np.testing.assert_allclose(found.angle, 3.0 * 2 + 7.0 / INERTIA * 2, rtol=1e-12)


@pytest.mark.hard("4.6 no overflow at late times")
def test_no_overflow_at_late_times():
    late = closed(np.array([1e3, 1e6, 1e9]), BASE)
    np.testing.assert_allclose(late.speed, STEADY, rtol=1e-15)
    assert (late.acceleration == 0).all()
    offset = float(closed(10.0, BASE).angle) - STEADY * 10
    np.testing.assert_allclose(late.angle, STEADY * np.array([1e3, 1e6, 1e9]) + offset, rtol=1e-14)
    unstable = closed(
        1e5, (50.0, -0.9, 0.01, 3.0)
    )  # the torque grows with speed until drag balances it
    top = float(jr.steady_speed(50.0, -0.9, 0.01))
    np.testing.assert_allclose(top, (0.9 + np.sqrt(0.81 + 2)) / 0.02, rtol=1e-15)
    np.testing.assert_allclose(unstable.speed, top, rtol=1e-14)
    np.testing.assert_allclose(unstable.angle / 1e5, top, rtol=1e-3)
    middle = float(closed(600.0, (50.0, -0.9, 0.01, 3.0)).angle)  # E does not overflow yet
    np.testing.assert_allclose(unstable.angle - middle, top * (1e5 - 600), rtol=1e-13)


@pytest.mark.hard("4.8 at the steady speed")
def test_acceleration_near_the_steady_speed_keeps_its_digits():
    """At t = 3 s the difference of torques has an error of 3.6e-6 (sheet); the closed form has none."""
    d = np.sqrt(np.longdouble(1.57) ** 2 + 4 * np.longdouble(0.039) * 1950)
    up, down = (-np.longdouble(1.57) + d) / 0.078, (-np.longdouble(1.57) - d) / 0.078
    c = (600 - up) / (600 - down) * np.exp(-d * 3 / np.longdouble(INERTIA))
    v = (up - down) * c / (1 - c)
    rate = -v * (d + np.longdouble(0.039) * v) / np.longdouble(INERTIA)
    np.testing.assert_allclose(closed(3.0, BASE).acceleration, float(rate), rtol=1e-12)
    assert abs(closed(1.0, (1950.0, 1.57, 0.039, STEADY)).acceleration) < 1e-12


# === derivatives

POINTS = {
    "base": BASE,
    "D = 0": (-(1.5**2) / (4 * 0.0625), 1.5, 0.0625, 60.0),  # without rounding
    "k2 = 0": (1950.0, 1.57, 0.0, 60.0),
    "k1 = 0": (195.0, 0.0, 0.039, 60.0),
    "M0 = 0": (0.0, 1.57, 0.039, 60.0),
    "k1 = k2 = 0": (195.0, 0.0, 0.0, 60.0),
    "M0 = k1 = 0": (0.0, 0.0, 0.039, 60.0),
    "M0 = k2 = 0": (0.0, 1.57, 0.0, 60.0),
    "nothing": (0.0, 0.0, 0.0, 60.0),
    "steady": (1950.0, 1.57, 0.039, STEADY),
    "from rest": (1950.0, 1.57, 0.039, 0.0),
    "D^2 < 0": (-100.0, 1.57, 0.039, 600.0),
}


@jax.jit
def outputs(point):
    return jnp.stack(jr.riccati(*point))


BACKWARD, FORWARD = jax.jit(jax.jacrev(outputs)), jax.jit(jax.jacfwd(outputs))


@pytest.mark.hard("4.5 no drag, no slope, no torque, D = 0, D^2 < 0")
@pytest.mark.parametrize("time", [0.05, 0.9])
@pytest.mark.parametrize("name", POINTS)
def test_derivatives_at_every_degenerate_point(name, time):
    point = np.array([time, INERTIA, *POINTS[name]])
    found, forward = BACKWARD(point), FORWARD(point)
    np.testing.assert_allclose(found, forward, rtol=1e-12, atol=1e-12 * np.abs(found).max())
    value = np.abs(outputs(point))
    for i, h in enumerate([1e-5, 1e-4, 0.1, 1e-3, 1e-5, 0.1]):
        at = lambda c, i=i, h=h: np.asarray(outputs(point + c * h * np.eye(6)[i]))
        change = (8 * (at(1) - at(-1)) - (at(2) - at(-2))) / (12 * h)
        scale = np.maximum(np.maximum(np.abs(change), value), 1e-6)
        np.testing.assert_allclose(found[:, i] / scale, change / scale, atol=1e-7, err_msg=str(i))


def test_second_derivatives_are_finite_where_nothing_acts():
    point = jnp.asarray([0.5, INERTIA, 0.0, 0.0, 0.0, 60.0])
    gradient = jax.grad(lambda p: outputs(p)[0])
    bends = jax.jit(lambda p: jax.jvp(gradient, (p,), (jnp.eye(6)[0],))[1])(point)
    by_torque, by_drag = (
        0.5 / INERTIA,
        -(60.0**2) * 0.5 / INERTIA,
    )  # derivatives of Omega at t = 0.5
    np.testing.assert_allclose(bends, [0, 0, by_torque, -60 * by_torque, by_drag, 1], rtol=1e-13)


def test_derivatives_of_the_times():
    stop = lambda p: jr.stop_time(*p)
    blow = lambda p: jr.blow_up_time(*p)
    braked = np.array([INERTIA, -100.0, 1.57, 0.039, 600.0])
    runaway = np.array([INERTIA, 1950.0, 1.57, 0.039, -300.0])
    flat = np.array([INERTIA, -(1.5**2) / 0.25, 1.5, 0.0625, 60.0])
    for function, point in ((stop, braked), (blow, braked), (blow, runaway), (stop, flat)):
        found = jax.grad(function)(jnp.asarray(point))
        for i, h in enumerate(1e-5 * np.abs(point)):
            step = h * np.eye(5)[i]
            change = (
                (function(jnp.asarray(point + step)) - function(jnp.asarray(point - step))) / 2 / h
            )
            np.testing.assert_allclose(found[i], change, rtol=1e-6)


def test_many_times_and_many_rotors():
    times = jnp.linspace(0.0, 0.5, 7)
    speeds = jnp.asarray([600.0, 0.0, STEADY])
    many = jax.vmap(lambda w: jr.riccati(times, INERTIA, 1950.0, 1.57, 0.039, w).speed)(speeds)
    assert many.shape == (3, 7)
    for row, w in zip(many, speeds.tolist(), strict=True):
        one = [closed(float(t), (1950.0, 1.57, 0.039, w)).speed for t in times]
        np.testing.assert_allclose(row, one, rtol=1e-14)
