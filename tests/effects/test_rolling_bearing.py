"""Rolling bearing: motions of a mass in it, its energy, its symmetries, the order of steps."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from ball_bearing import (
    BALLS,
    DAMPING,
    GAP,
    GEAR,
    HERTZ,
    INNER,
    MASS,
    ONCE,
    ONCE_MULTIPLIERS,
    OUTER,
    PASSAGES,
    SHARE,
    TIGHT,
    WEIGHT,
    bearing,
    end_of,
    launch,
    machine,
)
from differences import central
from scipy.integrate import solve_ivp

import jaxrotor as jr
from jaxrotor.effects.law import Now


START = (0.0, -26.0)  # um
STOPPED = -INNER / OUTER  # speed of the outer race over that of the shaft at which the cage stands


def final(scene, duration, start=START):
    """x, y [um] and their velocities [um/ms] after a duration [s]; all scenes share a program."""
    times = jnp.array([0.0, 1.0]) * duration
    return end_of(jr.run_up(scene, times, start=launch(*start), **TIGHT))


# === motions, against numbers of DOP853 and collocation of order 12


@pytest.mark.parametrize(
    ("values", "duration", "wanted"),
    [
        (
            {"speed": 900.0, "eccentricity": 2e-6},
            0.05,
            (-4.7720340955, -22.0527923807, 4.3907174506, 0.3091662222),
        ),
        ({"speed": 520.0, "eccentricity": 2e-6}, 0.02, (-10.2431995379, -24.305487048)),
        ({"speed": 300.0}, 0.02, (5.8725420086, -25.3198232940)),
        ({"speed": 500.0, "outer_speed": -0.6}, 0.02, (-1.3825902556, -26.0894282226)),
    ],
    ids=["unbalance", "slower", "balls alone", "opposite races"],
)
def test_motion_from_the_bottom(values, duration, wanted):
    found = final(machine(**values), duration)
    np.testing.assert_allclose(found[: len(wanted)], wanted, rtol=0, atol=5e-9)


@pytest.mark.parametrize("speed", PASSAGES)
def test_orbit_closes_after_a_passage(speed):
    """It has the period of a ball, 2 pi / (balls cage), about a third of a turn."""
    start, _ = PASSAGES[speed]
    found = final(machine(speed), 2 * np.pi / (BALLS * SHARE * speed), start)
    np.testing.assert_allclose(found, start, rtol=0, atol=5e-9)


@pytest.mark.slow
def test_multipliers_of_orbits():
    """Derivatives of motions by their starts, of the orbits above and of one that has a period of a turn.

    The force has a derivative whose slope is infinite at a touch, which costs 3/2 powers of the step.
    """
    tight = {"speed": 300.0, "eccentricity": 1e-6, "damping": 1500.0, "gap": 5e-6} | GEAR
    orbits = [
        (machine(speed), 2 * np.pi / (BALLS * SHARE * speed), *PASSAGES[speed])
        for speed in PASSAGES
    ]
    orbits.append((machine(**tight), 2 * np.pi / 300.0, ONCE, ONCE_MULTIPLIERS))

    @jax.jit
    def moved(scene, duration, start, along):
        call = lambda start: final(scene, duration, start)
        value = call(start)
        return value, jax.vmap(lambda one: jax.jvp(call, (start,), (one,))[1])(along)

    for scene, duration, start, wanted in orbits:
        value, slopes = moved(scene, duration, jnp.array(start), jnp.eye(4))
        np.testing.assert_allclose(value, start, rtol=0, atol=5e-9)
        found = np.linalg.eigvals(np.asarray(slopes))
        both = np.concatenate([wanted, np.conj(wanted)])
        away = np.abs(found[:, None] - both).min(axis=0)
        assert away.max() < 1e-7


def rates(time, y, speed, eccentricity, outer_speed):
    """Equations of motion, written out."""
    x, vx, vy = y[0], y[2], y[3]
    cage = (SHARE + (1 - SHARE) * outer_speed) * speed * time - np.pi / 2
    angles = cage + 2 * np.pi / BALLS * np.arange(BALLS)
    depth = x * np.cos(angles) + y[1] * np.sin(angles) - GAP
    loads = HERTZ * np.maximum(depth, 0.0) ** 1.5
    turning = MASS * eccentricity * speed**2
    fx = turning * np.cos(speed * time) - DAMPING * vx - loads @ np.cos(angles)
    fy = turning * np.sin(speed * time) - DAMPING * vy - loads @ np.sin(angles) - WEIGHT
    return [vx, vy, fx / MASS, fy / MASS]


def test_motion_against_scipy():
    """At a backward speed, with an unbalance and an outer race that turns."""
    values = {"speed": -650.0, "eccentricity": 3e-6, "outer_speed": 0.4}
    exact = solve_ivp(
        rates, (0, 0.01), [0, -26e-6, 0, 0], "DOP853", rtol=1e-11, atol=1e-18, args=values.values()
    )
    wanted = exact.y[:, -1] * [1e6, 1e6, 1e3, 1e3]
    np.testing.assert_allclose(final(machine(**values), 0.01), wanted, rtol=0, atol=1e-7)


# === law


def places(count=200):
    """Displacements [m], some in the gap, and angles of rotation [rad]."""
    draw = np.random.default_rng(5)
    size, angle, turn = draw.uniform(0, 2, count) * GAP, *draw.uniform(-9, 9, (2, count))
    return jnp.asarray(size * np.array([np.cos(angle), np.sin(angle)])), jnp.asarray(turn)


def force_and_torque(law, place, angle):
    now = Now(jnp.asarray(300.0), angle)
    force = law(place, jnp.zeros_like(place), now)
    return force, law.torque(force, place, jnp.zeros_like(place), now)


@pytest.mark.parametrize(
    ("exponent", "blend"), [(1.0, None), (10 / 9, None), (None, None), (None, 2e-6), (1.4, 2e-6)]
)
def test_force_and_torque_are_slopes_of_the_energy(exponent, blend):
    """`Re(F* z.) + T_i w_i + T_o w_o = -U.`, `U = K Sum u^(n+1) / (n+1)` of balls pressed by `u = (d)_+`.

    Blended it is `u = (d + sqrt(d^2 + b^2)) / 2`, and `K u^(n-1) b^2 / 4 / (n-1)` comes to it.
    """
    law = bearing(exponent=exponent, angle=0.3, outer_speed=0.7, blend=blend).law()
    exponent = float(law.power)

    def power(depth):
        if blend is None:
            return jnp.where(depth > 0, jnp.abs(depth) ** (exponent + 1), 0.0) / (exponent + 1)
        u = (depth + jnp.sqrt(depth**2 + blend**2)) / 2
        more = blend**2 / 4 * u ** (exponent - 1) / (exponent - 1)
        return u ** (exponent + 1) / (exponent + 1) + more

    def energy(place, inner, outer):
        cage = law.phase + law.inner * inner + (1 - law.inner) * outer
        angles = cage + 2 * np.pi / BALLS * np.arange(BALLS)
        depth = place[0] * jnp.cos(angles) + place[1] * jnp.sin(angles) - GAP
        return law.stiffness * jnp.sum(power(depth))

    at, turn = places()
    slopes = jax.vmap(jax.grad(energy, (0, 1)), (1, 0, 0))(at, turn, 0.7 * turn)
    force, torque = force_and_torque(law, at, turn)
    size, moment = np.abs(force).max(), np.abs(torque).max()
    assert size > 100 and moment > 1e-4
    np.testing.assert_allclose(-slopes[0].T, force, rtol=0, atol=1e-12 * size)
    np.testing.assert_allclose(-slopes[1], torque, rtol=0, atol=1e-12 * moment)


@pytest.mark.parametrize("blend", [None, 2e-6])
def test_mirror_image_and_turned_law(blend):
    """Conjugate, with angles reversed, it has the force `F*` and the torque `-T`."""
    at, turn = places()
    flip = jnp.array([[1.0], [-1.0]])
    values = {"outer_speed": -0.3, "blend": blend}
    force, torque = force_and_torque(bearing(angle=0.4, **values).law(), at, turn)
    mirror, back = force_and_torque(bearing(angle=-0.4, **values).law(), flip * at, -turn)
    size, moment = np.abs(force).max(), np.abs(torque).max()
    np.testing.assert_allclose(mirror, flip * force, rtol=0, atol=1e-12 * size)
    np.testing.assert_allclose(back, -torque, rtol=0, atol=1e-12 * moment)
    rotation = jnp.array([[jnp.cos(0.8), -jnp.sin(0.8)], [jnp.sin(0.8), jnp.cos(0.8)]])
    turned, same = force_and_torque(bearing(angle=1.2, **values).law(), rotation @ at, turn)
    np.testing.assert_allclose(turned, rotation @ force, rtol=0, atol=1e-12 * size)
    np.testing.assert_allclose(same, torque, rtol=0, atol=1e-12 * moment)


@pytest.mark.parametrize("exponent", [1.0, None])
@pytest.mark.parametrize("blend", [None, 1e-8])
def test_derivatives_where_a_ball_begins_to_bear(exponent, blend):
    """At the edge of the gap, within it and at its centre, in both precisions."""
    law = bearing(exponent=exponent, angle=0.0, gap=2.0**-16, blend=blend).law()

    def force(law, x):
        place = jnp.stack([x, jnp.zeros_like(x)])
        return law(place, jnp.zeros(2, x.dtype), Now(jnp.ones((), x.dtype), jnp.zeros((), x.dtype)))

    for kind in (jnp.float32, jnp.float64):
        own = jax.tree.map(lambda leaf, kind=kind: leaf.astype(kind), law)
        for x in (2.0**-16, 2.0**-17, 0.0, 2.0**-15):
            slopes = jax.jacfwd(force, (0, 1))(own, jnp.asarray(x, kind))
            assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(slopes))
            assert slopes[1].dtype == kind
    slope = jax.jacfwd(force, 1)(law, jnp.asarray(2.0**-16))[0]
    if blend is not None and exponent == 1:
        assert float(slope) == pytest.approx(-HERTZ / 2, rel=1e-5)  # and tails of others


def test_opposite_races_stop_the_cage():
    """There is no passage then: a mass at rest stays there."""
    scene = machine(300.0, outer_speed=STOPPED, angle=-np.pi / 2 + 0.2, linear="frozen")
    law = scene.of(jr.RollingBearing)[0].law()
    assert abs(float(law.rate)) < 1e-16
    rest = 1e6 * complex(jr.static_positions(scene).position[0, 0])
    found = final(scene, 0.02, (rest.real, rest.imag))
    np.testing.assert_allclose(found, [rest.real, rest.imag, 0, 0], rtol=0, atol=1e-9)


@pytest.mark.slow
def test_a_rotor_that_turns_freely_keeps_its_energy():
    """Rolling is a gear: without the torque on the shaft passing balls would drive the motion."""
    polar = 2e-3
    drive = jr.Drive(500.0, 0.0, polar=polar, feedback=True)
    scene = machine(damping=0.0, eccentricity=2e-6, spin=drive)
    times = np.linspace(0.0, 0.02, 33)
    run = jr.run_up(scene, times, start=launch(3.0, -30.0), **TIGHT)
    law, (x, y) = (
        scene.of(jr.RollingBearing)[0].law(),
        np.array([run.displacement[:, 0].real, run.displacement[:, 0].imag]),
    )
    angles = law.phase + law.rate * run.angle[:, None] + 2 * np.pi / BALLS * np.arange(BALLS)
    depth = x[:, None] * np.cos(angles) + y[:, None] * np.sin(angles) - GAP
    pressed = HERTZ * np.sum(np.maximum(depth, 0.0) ** 2.5, axis=1) / 2.5
    # The centre of mass is off the axis; its own weight and kinetic energy, and what turns about it.
    off = 2e-6 * np.exp(1j * run.angle)
    velocity = run.velocity[:, 0] + 1j * run.speed * off
    kinetic = MASS * np.abs(velocity) ** 2 / 2 + polar * run.speed**2 / 2
    total = kinetic + pressed + WEIGHT * (y + off.imag)
    exchanged = np.ptp(pressed)
    assert np.ptp(polar * run.speed**2 / 2) > 0.1 * exchanged
    np.testing.assert_allclose(total, total[0], rtol=0, atol=1e-7 * exchanged)


# === steps, derivatives, lanes


def by_steps(scene, count, located=False):
    """x, y and velocities after 20 ms by steps of order 4."""
    solver = jr.Exponential(4, located=located)
    times = np.linspace(0.0, 0.02, 9)
    return end_of(jr.run_up(scene, times, start=launch(*START), solver=solver, substeps=count))


@pytest.mark.slow
@pytest.mark.parametrize(("blend", "counts", "order"), [(None, 7, 2.5), (2e-6, 5, 4.0)])
def test_order_of_steps(blend, counts, order):
    """The force of a ball is C1, so a touch costs h^2.5; blended, steps have their order, 4."""
    counts = 16 * 2 ** np.arange(counts)
    scenes = [machine(300.0, blend=blend, angle=angle) for angle in np.linspace(0, 0.75, 8)]
    exact = np.array([final(scene, 0.02) for scene in scenes])[:, :2]
    errors = [[by_steps(scene, int(n))[:2] for scene in scenes] - exact for n in counts]
    errors = np.sqrt(np.mean(np.square(errors), axis=(1, 2)))
    slope = np.polyfit(np.log2(counts), np.log2(errors), 1)[0]
    assert -slope == pytest.approx(order, abs=0.2)
    if blend is None:  # there is no change of formula to locate
        one, other = (by_steps(scenes[0], 64, located) for located in (False, True))
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-9)


NUMBERS = {
    "rolling_bearing.stiffness": HERTZ,
    "rolling_bearing.exponent": 1.5,
    "rolling_bearing.gap": GAP,
    "rolling_bearing.inner_radius": INNER,
    "rolling_bearing.outer_radius": OUTER,
    "rolling_bearing.angle": -np.pi / 2,
    "rolling_bearing.outer_speed": -0.3,
    "rolling_bearing.blend": 1e-6,
    "unbalance.eccentricity": 2e-6,
}

STEP = 1e-5


@pytest.mark.slow
def test_derivatives_of_a_motion_by_all_numbers():
    scene = machine(520.0, 2e-6, outer_speed=-0.3, blend=1e-6, exponent=1.5)
    values = jnp.array(list(NUMBERS.values()))

    def end(values):
        return by_steps(scene.replace(dict(zip(NUMBERS, values, strict=True))), 64)

    for along in jnp.diag(values):
        slopes = jax.jvp(end, (values,), (along,))[1]
        moved = lambda k, along=along: end(values + k * STEP * along)
        differences = central(moved, STEP)
        size = float(jnp.abs(slopes).max())
        assert size > 0
        np.testing.assert_allclose(differences, slopes, rtol=0, atol=1e-6 * size)


@pytest.mark.slow
def test_lanes_are_runs():
    """Along times, of gaps and speeds of the outer race; largest displacements."""
    scene, times = machine(520.0, 2e-6), np.linspace(0.0, 0.02, 9)
    over = {"rolling_bearing.gap": [15e-6, GAP], "rolling_bearing.outer_speed": [0.0, 0.5]}
    how = {"times": times, "start": launch(*START), "error_sample": 0}
    found = jr.sweep(scene, over, solver=jr.Exponential(4), steps_per_revolution=512, **how)
    for i, gap in enumerate(over["rolling_bearing.gap"]):
        for j, outer in enumerate(over["rolling_bearing.outer_speed"]):
            here = {"rolling_bearing.gap": gap, "rolling_bearing.outer_speed": outer}
            run = jr.run_up(scene.replace(here), times, start=launch(*START), **TIGHT)
            peak = np.abs(run.displacement[1:]).max()
            assert float(found.peak[i, j]) == pytest.approx(peak, rel=1e-5)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: bearing(exponent=0.9), "`exponent .1.` must not be below 1, but is 0.9"),
        (lambda: bearing(balls=2), "`balls` must be a whole number of at least 3, but is 2"),
        (
            lambda: jr.harmonic_balance(machine(eccentricity=1e-6)),
            "contacts .rolling_bearing. have states",
        ),
    ],
)
def test_what_is_no_bearing_is_refused(call, message):
    with pytest.raises(ValueError, match=message):
        call()
