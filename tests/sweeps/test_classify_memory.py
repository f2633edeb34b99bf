"""Kinds of motion of rotors whose laws have states or count turns, by facts that share no code with it.

These are multipliers by DOP853, roots of a polynomial and a Runge-Kutta method of a mass in a rolling
bearing with a disturbance beside it.
"""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from ball_bearing import (
    BALLS,
    GAP,
    GEAR,
    HERTZ,
    INNER,
    MASS,
    ONCE_MULTIPLIERS,
    OUTER,
    PASSAGES,
    SHARE,
    TIGHT,
    WEIGHT,
    end_of,
    launch,
    machine,
)
from magnetic_bearing import machine as magnetic

import jaxrotor as jr
from jaxrotor.core.outcome import Outcome
from jaxrotor.equations.system import assemble
from jaxrotor.files.toml_writer import dumps
from jaxrotor.motion.revolutions import March
from jaxrotor.orbits.passes import cycle_of, cycle_rate
from jaxrotor.orbits.shooting import plan_of
from jaxrotor.sweeps.claims import MOTIONS, claims_of
from jaxrotor.sweeps.followed import Followed


TURN = 2 * np.pi
OFTEN = {"confirm": False, "repeats": 0, "progress": False}


def lanes(scene, over, settle=300, start=None):
    """A sweep whose lanes go on for so many revolutions more than it has run."""
    how = {"steps_per_revolution": 16, "observe": [jr.observe.Radius()], "progress": False}
    dataset = jr.sweep(scene, over, start=start, settle=0, keep=1, error_sample=0, **how)
    return dataset.assign_attrs(settle=settle)


def kinds(dataset) -> list[str]:
    return [MOTIONS[number] for number in dataset["motion"].values]


def bearing_by_runge_kutta(speeds, eccentricity, damping, revolutions, steps=256, settle=400):
    """Section of every revolution, [um] and cage angle, and growth of a disturbance in it, from rest."""
    speeds = jnp.asarray(speeds)
    h = TURN / speeds / steps
    ahead = TURN / BALLS * jnp.arange(BALLS)[:, None] - jnp.pi / 2

    def rates(t, y):
        x, z, u, v = y
        balls = SHARE * speeds * t + ahead
        deep = jnp.maximum(jnp.cos(balls) * x + jnp.sin(balls) * z - GAP, 0.0)
        load = HERTZ * deep * jnp.sqrt(jnp.where(deep > 0, deep, 1.0))
        push = MASS * eccentricity * speeds**2
        along = push * jnp.cos(speeds * t) - damping * u - jnp.sum(load * jnp.cos(balls), axis=0)
        across = push * jnp.sin(speeds * t) - damping * v - jnp.sum(load * jnp.sin(balls), axis=0)
        return jnp.stack([u, v, along / MASS, (across - WEIGHT) / MASS])

    def step(t, y):
        one = rates(t, y)
        two = rates(t + h / 2, y + h / 2 * one)
        three = rates(t + h / 2, y + h / 2 * two)
        four = rates(t + h, y + h * three)
        return y + h / 6 * (one + 2 * (two + three) + four)

    scale = jnp.stack([jnp.ones_like(speeds)] * 2 + [speeds] * 2)

    def revolution(carry, number):
        start = TURN / speeds * number
        run = lambda y: jax.lax.fori_loop(0, steps, lambda k, y: step(start + k * h, y), y)
        y, moved = jax.jvp(run, carry[:1], carry[1:])
        size = jnp.sqrt(jnp.sum((moved / scale) ** 2, axis=0))
        return (y, moved / size), (1e6 * y[:2], jnp.log(size))

    begin = jnp.zeros((4, len(speeds))), jnp.ones((4, 1)) * scale
    total = jnp.arange(settle + revolutions)
    seen, growth = jax.jit(lambda begin: jax.lax.scan(revolution, begin, total)[1])(begin)
    return np.asarray(seen)[settle:], np.asarray(growth)[settle:]


# === passes of balls


@pytest.mark.slow
def test_passes_of_balls():
    """Beyond the flips at 482 and 1076.2 rad/s orbits have two passes; at 400 rad/s there is chaos.

    The determinant of a pass tells the exponent of both: two pairs of multipliers decay by `c / (2 m)`.
    """
    speeds = [400.0, 700.0, 1050.0, 1100.0]
    swept = lanes(machine(), {"spin.speed": speeds})
    found = jr.classify(swept, 400, **OFTEN)
    assert kinds(found) == ["chaotic", "periodic", "periodic", "periodic"]
    np.testing.assert_array_equal(found["orbit_period"], [0, 1, 1, 2])
    assert found["orbit_period"].attrs["long_name"] == "passes in a period"
    largest = [np.abs(PASSAGES[speed][1]).max() for speed in (700.0, 1050.0)]
    np.testing.assert_allclose(found["multiplier"][1:3], largest, rtol=1e-6)
    np.testing.assert_allclose(found["exponent"][1:], -200.0 / (2 * MASS), rtol=1e-5)
    _, growth = bearing_by_runge_kutta([400.0], 0.0, 200.0, 600)
    exponent = growth.mean() / TURN * 400.0
    low, high = (float(found[f"exponent_{end}"][0]) for end in ("low", "high"))
    assert low > 0 and abs(float(found["exponent"][0]) - exponent) < high - low


@pytest.mark.slow
def test_unbalance_and_balls_have_no_common_period():
    """Two starts end in one motion, and its sections are a curve over the angle of the cage."""
    speeds, values = [700.0, 900.0], {"eccentricity": 2e-6, "damping": 2000.0}
    found = jr.classify(lanes(machine(**values), {"spin.speed": speeds}), 1000, **OFTEN)
    assert kinds(found) == ["quasi_periodic"] * 2
    assert (np.abs(found["exponent"]) < 1e-3).all()
    section, growth = bearing_by_runge_kutta(speeds, 2e-6, 2000.0, 400, settle=100)
    assert (growth.sum(axis=0) < -50).all()  # but for the angle of the cage all disturbances decay
    cage = np.mod(BALLS * SHARE * np.arange(400), 1.0)
    order = np.argsort(cage)
    apart = np.abs(np.diff(section[order], axis=0)).max(axis=(0, 1))
    assert (apart < 0.1 * np.ptp(section, axis=0).max(axis=0)).all()
    back = np.abs(section[1:9] - section[0]).max(axis=(1, 2))
    assert back.min() > 1e-3  # um: none returns within eight revolutions


@pytest.mark.slow
def test_three_balls_pass_in_a_revolution():
    given = GEAR | {"gap": 5e-6, "damping": 1500.0, "eccentricity": 1e-6}
    found = jr.classify(lanes(machine(300.0, **given), {"spin.speed": [300.0]}), 200, **OFTEN)
    assert kinds(found) == ["periodic"] and found["orbit_period"].values == [1]
    largest = np.abs(ONCE_MULTIPLIERS).max()
    np.testing.assert_allclose(found["multiplier"], largest, rtol=5e-3)


@pytest.mark.slow
def test_a_counted_angle_is_that_of_turns():
    """Revolutions with the angle of the cage as a state, and an integration along times."""
    scene, start = machine(900.0, 2e-6), launch(0.0, -26.0)
    system = assemble(scene)
    cycle = cycle_of(scene, system, "a test", apart=True)
    assert not cycle.common and not cycle.passes
    turning = cycle.of(system)
    plan = plan_of(jr.Exponential(4), ((0,),), 4096)
    march = March.of(turning, plan, cycle_rate(turning, False), jnp.array([0.5]))
    y, _ = march.skip(march.begin(start, jnp.array(0.5)), 5)
    q, velocity, *_, states = march.decode(y)
    assert float(states[0]) == pytest.approx(5 * TURN, rel=1e-12)
    run = jr.run_up(scene, np.array([0.0, 5 * TURN / 900.0]), start=start, **TIGHT)
    z, v = 1e6 * complex(q[0]), 1e3 * complex(velocity[0])
    np.testing.assert_allclose([z.real, z.imag, v.real, v.imag], end_of(run), rtol=0, atol=1e-7)


# === states of laws


@pytest.mark.slow
def test_controllers_are_part_of_what_returns():
    """Small whirl decays by the slowest root of the closed loop, of a polynomial."""
    scene = magnetic(jr.Unbalance(0.5, 10.0, 1e-9), speed=400.0, weight=0.0)
    found = jr.classify(lanes(scene, {"spin.speed": [400.0]}, 20), 200, **OFTEN)
    assert kinds(found) == ["periodic"] and found["orbit_period"].values == [1]
    np.testing.assert_allclose(found["exponent"], -92.526249374, rtol=1e-7)


def test_wear_is_no_kind_of_motion():
    """Of two regular runs, whose averages converge, a state of the first goes on in one sense."""
    turns = np.arange(400)
    section = np.exp(TURN * 0.38j * turns) * np.ones((2, 1))
    still = np.zeros((2, 400))
    states = np.stack([1e-9 * turns, np.sin(turns)])[..., None]
    run = Followed(None, Outcome.good(2), still, still, section, None, states)
    apart = np.full((2, 1), np.inf)
    found = claims_of(run, apart, list, list)
    assert [MOTIONS[number] for number in found.motion] == ["undecided", "quasi_periodic"]


# === refusals


@pytest.fixture(scope="module")
def plain():
    """A sweep whose scene is put in place of that of others, as `classify` takes settings alone."""
    return lanes(machine(eccentricity=2e-6), {"unbalance.eccentricity": [0.0, 2e-6]}, 1)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({}, "Lanes must have periods of one kind, but those of some repeat with passes"),
        (GEAR | {"balls": 7}, "so both do after 8 at the earliest"),
        ({"outer_speed": -INNER / OUTER}, "in rolling_bearing stands, so there is no period"),
    ],
)
def test_refusals(plain, values, message):
    text = dumps(machine(eccentricity=2e-6, **values))
    with pytest.raises(ValueError, match=message):
        jr.classify(plain.assign_attrs(scene=text), 200, **OFTEN)
