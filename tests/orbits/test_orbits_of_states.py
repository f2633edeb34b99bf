"""Orbits of a mass that a magnetic bearing holds: its controller is part of what returns.

Small ones against the linear closed loop, whose roots are those of a polynomial, large ones against
DOP853 and shooting with difference quotients, which share no code with the steps.
"""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from differences import central
from magnetic_bearing import (
    BIAS,
    CONSTANT,
    EARTH,
    FILTER,
    GAP,
    KD,
    KI,
    KP,
    LAG,
    MASS,
    NEGATIVE,
    PER_AMPERE,
    machine,
)
from own_laws import LimitedDrive, WornRim
from scipy.integrate import solve_ivp
from scipy.optimize import linear_sum_assignment

import jaxrotor as jr


SPEED = 400.0
SMALL = 1e-9  # eccentricity [m], so that the bearing is linear to ten digits
PLAIN = jr.Exponential(4)


def unbalanced(eccentricity, *parts, **values):
    given = {"speed": SPEED, "weight": 0.0, "limit": None} | values
    return machine(jr.Unbalance(0.5, MASS, eccentricity), *parts, **given)


def loop(negative=NEGATIVE, kd=KD, per_ampere=PER_AMPERE):
    """Coefficients of the closed loop of an axis, in falling powers of p."""
    mass = np.polymul([MASS, 0.0, -negative], [LAG, 1.0])
    free = np.polymul(np.polymul(mass, [FILTER, 1.0]), [1.0, 0.0])
    control = np.polymul([KP, KI], [FILTER, 1.0]) + np.array([kd, 0.0, 0.0])
    return np.polyadd(free, per_ampere * control)


def away(found, wanted):
    apart = np.abs(np.asarray(found)[:, None] - wanted)
    return apart[linear_sum_assignment(apart)].max()


def circle(speed, kd=KD):
    """Response of the closed loop to the unbalance, by the transfer function of an axis."""
    p = 1j * speed
    controller = (KP + KI / p + kd * p / (1 + FILTER * p)) / (1 + LAG * p)
    return MASS * SMALL * speed**2 / (MASS * p**2 - NEGATIVE + PER_AMPERE * controller)


@functools.cache
def small():
    return jr.periodic(unbalanced(SMALL), jr.AtRest(), solver=PLAIN)


@pytest.mark.slow
def test_small_orbit_is_the_circle_of_the_closed_loop():
    found = small()
    z = np.asarray(found.displacement[:, 0])
    wanted = circle(SPEED) * np.exp(1j * SPEED * np.asarray(found.time))
    np.testing.assert_allclose(z, wanted, rtol=0, atol=1e-7 * SMALL)
    current = found.states["magnetic_bearing.current_x"]
    size = PER_AMPERE * np.abs(current).max()
    force = np.abs(MASS * (1j * SPEED) ** 2 - NEGATIVE) * abs(circle(SPEED))
    load = MASS * SMALL * SPEED**2
    assert abs(size - force) < load + 1e-3 * force
    assert found.stable and found.multipliers.size == 10


@pytest.mark.slow
def test_multipliers_are_those_of_the_roots():
    """Two axes with five roots each, the slowest of which are those of the integrals."""
    found = small()
    wanted = np.exp(np.repeat(np.roots(loop()), 2) * 2 * np.pi / SPEED)
    assert away(found.multipliers, wanted) < 2e-6


def test_rest_under_weight():
    """Along y the current that bears the weight adds to the negative stiffness."""
    scene = machine(speed=SPEED, limit=None)
    found = jr.periodic(scene, jr.AtRest(), revolutions=1, solver=PLAIN)
    current = MASS * EARTH * GAP**2 / (4 * CONSTANT * BIAS)
    assert np.abs(np.asarray(found.displacement)).max() < 1e-12
    np.testing.assert_allclose(found.states["magnetic_bearing.current_y"], current, rtol=1e-9)
    negative = 4 * CONSTANT * (BIAS**2 + current**2) / GAP**3
    roots = np.concatenate([np.roots(loop()), np.roots(loop(negative))])
    assert away(found.multipliers, np.exp(roots * 2 * np.pi / SPEED)) < 2e-6


# === large orbits


def field(time, y, eccentricity, weight, limit):
    """x, y; velocities; integrals; filtered; currents of a mass, by (3) and (4) of an axis each."""
    place, speed, integral, filtered, current = y.reshape(5, 2)
    pull = ((BIAS + current) / (GAP - place)) ** 2 - ((BIAS - current) / (GAP + place)) ** 2
    turn = SPEED * time
    load = MASS * eccentricity * SPEED**2 * np.array([np.cos(turn), np.sin(turn)])
    force = CONSTANT * pull + load - np.array([0.0, MASS * weight])
    rate = (place - filtered) / FILTER
    wanted = np.clip(-(KP * place + KI * integral + KD * rate), -limit, limit)
    return np.concatenate([speed, force / MASS, place, rate, (wanted - current) / LAG])


def after(y, *values):
    span = (0.0, 2 * np.pi / SPEED)
    exact = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-16, "max_step": span[1] / 400}
    return solve_ivp(field, span, y, args=values, **exact).y[:, -1]


SIZES = np.repeat([1e-5, 1e-3, 1e-8, 1e-5, 0.1], 2)


def shot(y, *values):
    """Orbit and multipliers, by Newton's method with difference quotients."""
    for _ in range(4):
        end = after(y, *values)
        quotients = [
            (after(y + k, *values) - after(y - k, *values)) / (2e-3 * size)
            for k, size in zip(1e-3 * np.diag(SIZES), SIZES, strict=True)
        ]
        jacobian = np.stack(quotients, axis=1)
        y = y + np.linalg.solve(np.eye(10) - jacobian, end - y)
    return y, np.linalg.eigvals(jacobian)


def numbers(found):
    """The start of an orbit as the equations above have it."""
    (z,), (v,) = found.start.q, found.start.velocity
    x = np.asarray(found.start.states).reshape(3, 2)
    factors = np.array([1 / KI, FILTER / KD, 1.0])[:, None]
    parts = [[z.real, z.imag], [v.real, v.imag], *(x * factors)]
    return np.concatenate([np.asarray(part) for part in parts])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("eccentricity", "limit", "error", "slopes"),
    [(3e-5, None, 1e-8, 1e-6), (3e-5, 0.8, 1e-6, 1e-4)],
    ids=["nonlinear", "saturated"],
)
def test_large_orbit(eccentricity, limit, error, slopes):
    scene = unbalanced(eccentricity, weight=EARTH, limit=limit)
    found = jr.periodic(scene, jr.AtRest(), steps_per_revolution=4096)
    y, multipliers = shot(numbers(found), eccentricity, EARTH, BIAS if limit is None else limit)
    np.testing.assert_allclose(numbers(found) / SIZES, y / SIZES, rtol=0, atol=error)
    assert away(found.multipliers, multipliers) < slopes
    current = np.abs(found.states["magnetic_bearing.current_y"]).max()
    assert current > 0.9 if limit is None else current == pytest.approx(limit, abs=1e-3)


# === disturbances, branches, derivatives


@pytest.mark.slow
def test_neighbours_approach_by_the_roots():
    """Lyapunov exponents of an orbit are the real parts of the roots of the closed loop."""
    found = jr.lyapunov(unbalanced(SMALL), revolutions=400, count=3, settle=200, solver=PLAIN)
    real = np.sort(np.repeat(np.roots(loop()).real, 2))[::-1]
    np.testing.assert_allclose(found.exponents, real[:3], rtol=2e-3)
    assert found.end.states.size == 6


def least_damping(negative):
    """Derivative gain at which a pair of roots of an axis crosses, by bisection."""
    low, high = 3.0, 8.0
    for _ in range(60):
        middle = (low + high) / 2
        stable = np.roots(loop(negative, middle)).real.max() < 0
        low, high = (low, middle) if stable else (middle, high)
    return low


@pytest.mark.slow
def test_branch_loses_its_stability_where_roots_cross():
    """With too little damping; weight makes the axes differ, of which that along it loses it first."""
    weight = 3 * EARTH
    first = jr.AtRest()
    for kd in (KD, 6.5):
        first = jr.periodic(unbalanced(SMALL, weight=weight, kd=kd), first, solver=PLAIN)
    path, between = "magnetic_bearing.kd", (5.0, 6.5)
    found = jr.continue_(first, path, between, direction="down", solver=PLAIN)
    current = MASS * weight * GAP**2 / (4 * CONSTANT * BIAS)
    negative = 4 * CONSTANT * (BIAS**2 + current**2) / GAP**3
    wanted = least_damping(negative)
    (point,) = found.points
    assert point.kind == "neimark-sacker" and point.value == pytest.approx(wanted, rel=2e-6)
    np.testing.assert_array_equal(found.stable, found.values > wanted)


@pytest.mark.slow
def test_branch_over_speed():
    found = jr.continue_(small(), "spin.speed", (150.0, 900.0), solver=PLAIN)
    wanted = [abs(circle(speed)) for speed in found.values]
    np.testing.assert_allclose(found.radius_max[:, 0], wanted, rtol=1e-4)
    assert found.stable.all() and not found.points
    at = found.orbit(0)
    assert at.start.states.size == 6 and set(at.states) == set(small().states)


@pytest.mark.slow
def test_derivatives_of_an_orbit():
    """By the speed and by numbers of the controller, through its states."""
    known = small()
    paths = ("spin.speed", "magnetic_bearing.kp", "magnetic_bearing.ki", "magnetic_bearing.lag")
    values = jnp.array([SPEED, KP, KI, LAG])

    def parts(values):
        moved = unbalanced(SMALL).replace(dict(zip(paths, values, strict=True)))
        found = jr.periodic(moved, known, solver=PLAIN)
        q, states = found.start.q[0] / SMALL, found.start.states / (KP * SMALL)
        return jnp.concatenate([jnp.stack([q.real, q.imag]), states])

    for along in jnp.diag(values):
        slopes = jax.jvp(parts, (values,), (along,))[1]
        differences = central(lambda k, along=along: parts(values + k * 1e-4 * along), 1e-4)
        size = float(jnp.abs(slopes).max())
        np.testing.assert_allclose(differences, slopes, rtol=0, atol=1e-5 * size)
    speeds = SPEED + np.array([-1e-3, 1e-3])
    wanted = np.diff([circle(speed) for speed in speeds])[0] / 2e-3 / SMALL
    found = jax.jvp(parts, (values,), (jnp.array([1.0, 0, 0, 0]),))[1]
    assert abs(found[0] + 1j * found[1] - wanted) < 1e-5 * abs(wanted)


def test_traced_values_take_the_steps_of_the_guess():
    start = lambda kp: (
        jr.periodic(unbalanced(SMALL).replace({"magnetic_bearing.kp": kp}), jr.AtRest()).start.q
    )
    with pytest.raises(ValueError, match="counted by the rates of the states of laws"):
        jax.jvp(start, (KP,), (1.0,))


@pytest.mark.slow
def test_orbit_of_its_own_period():
    """`(a - s) z.` balances a damper on the circle `b r^2 = a - c`, at the natural frequency.

    Its multipliers are by the roots of `r` and `s` about it, as z turns: `z = r exp(i phi)`.
    """
    stiffness, damping, gain, limit, lag = 1e6, 30.0, 80.0, 5e9, 2e-3
    parts = jr.MasslessShaft(1.0, 0.5, stiffness), jr.Disc(0.5, MASS), jr.DiscDamping(0.5, damping)
    drive = LimitedDrive(0.5, gain, limit, lag)
    scene = jr.Scene(*parts, drive, spin=jr.ConstantSpeed(SPEED))
    rate, radius = np.sqrt(stiffness / MASS), np.sqrt((gain - damping) / limit)
    start = jr.Launch(jr.Whirl(1.02 * radius, rate), states=[0.98 * (gain - damping)])
    found = jr.periodic(scene, start, turn=0.0, period=2 * np.pi / rate, solver=PLAIN)
    assert float(found.period) == pytest.approx(2 * np.pi / rate, rel=1e-8)
    np.testing.assert_allclose(np.abs(found.displacement), radius, rtol=1e-6)
    np.testing.assert_allclose(found.states["limited_drive.seen"], gain - damping, rtol=1e-6)
    assert float(found.trivial) == pytest.approx(1.0, abs=1e-6)
    # z = (r + u) exp(i w t), u = x + i y: m (u.. + 2 i w u.) = (a - c - s) u. - (s - s0)(u. + i w (r + u))
    inertia, twice = np.eye(2), 2 * rate * np.array([[0.0, -1.0], [1.0, 0.0]])
    zero, none = np.zeros((2, 2)), np.zeros((2, 1))
    push = -rate * radius / MASS * np.array([[0.0], [1.0]])  # of the state, along the motion
    seen = np.array([[2 * limit * radius / lag, 0.0, 0.0, 0.0, -1 / lag]])
    matrix = np.block([[zero, inertia, none], [zero, -twice, push], [seen]])
    roots = np.linalg.eigvals(matrix)
    wanted = np.exp(np.delete(roots, np.abs(roots).argmin()) * 2 * np.pi / rate)
    assert away(found.multipliers, wanted) < 1e-5


# === what does not return


def worn():
    parts = jr.MasslessShaft(1.0, 0.5, 1e6), jr.Disc(0.5, MASS), jr.DiscDamping(0.5, 300.0)
    rim = WornRim(0.5, 2e-5, 1e7, 1e-8, 0.05)
    whirl = jr.Unbalance(0.5, MASS, 1e-4)
    return jr.Scene(*parts, whirl, rim, spin=jr.ConstantSpeed(300.0))


@pytest.mark.slow
def test_wear_does_not_return():
    with pytest.raises(
        RuntimeError, match="a state of a law .worn_rim.depth. goes on in one sense"
    ):
        jr.periodic(worn(), jr.AtRest())
    with pytest.raises(ValueError, match="a state of a law .worn_rim.depth. goes on in one sense"):
        jr.lyapunov(worn(), revolutions=40, settle=20)


def test_states_do_not_turn():
    scene = machine(speed=SPEED, weight=0.0)
    with pytest.raises(ValueError, match="States of laws do not turn with an orbit"):
        jr.periodic(scene, jr.Whirl(1e-6), turn=np.pi / 2, period=0.01)
