"""Lyapunov exponents: against Lorenz's attractor, roots of a linear rotor, and an orbit's multipliers."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from shown import shown
from systems import LENGTH, TIME, limiter_rotor, one_disc

import jaxrotor as jr
import jaxrotor.plot
from jaxrotor.orbits.lyapunov import (
    advance_disturbed,
    largest_first,
    mean_and_error,
    random_disturbances,
)


def lorenz(y):
    """State after half a time unit by the classical Runge-Kutta method, and an empty outcome."""

    def field(y):
        x, y, z = y
        return jnp.stack([10 * (y - x), x * (28 - z) - y, x * y - 8 / 3 * z])

    def step(y, _):
        h = 0.005
        a = field(y)
        b = field(y + h / 2 * a)
        c = field(y + h / 2 * b)
        d = field(y + h * c)
        return y + h / 6 * (a + 2 * b + 2 * c + d), None

    return jax.lax.scan(step, y, None, length=100)[0], ()


def test_lorenz():
    """Sprott (2003), Chaos and Time-Series Analysis: 0.9056, 0, -14.5723; their sum is exact."""

    @jax.jit
    def run(y, disturbances):
        def one(carry, _):
            y, disturbances, growth, _ = advance_disturbed(lorenz, *carry)
            return (y, disturbances), growth

        return jax.lax.scan(one, (y, disturbances), None, length=20000)[1]

    growth = np.asarray(run(jnp.array([1.0, 2.0, 20.0]), random_disturbances(3, 3, 0))) * 2
    exponents, error = mean_and_error(growth[200:])
    assert error[0] < 3e-3
    assert abs(exponents[0] - 0.9056) < 3 * error[0] + 5e-5
    assert abs(exponents[1]) < 1e-3
    assert exponents.sum() == pytest.approx(-(10 + 1 + 8 / 3), abs=1e-4)


@pytest.mark.slow
def test_linear_rotor_parts_by_its_roots():
    """Section 3.2: first roots at N = 15, one that grows and one that decays, of two directions each."""
    scene = limiter_rotor(contact=False)
    found = jr.lyapunov(scene, revolutions=200, settle=400, count=4, steps_per_revolution=16)
    expected = np.repeat([0.00912266, -0.23335496], 2) / TIME
    assert found.exponents == pytest.approx(expected, rel=1e-6)
    assert found.running[-1] == pytest.approx(found.exponents)
    assert "Lyapunov exponents 0.40283" in str(found)


def test_what_is_rounding_beside_the_fastest_is_lost():
    """In 10 ms a rate of -3600 /s leaves 2e-16, the precision of a number; the largest comes first."""
    given = np.array([-50.0, 1.0, -5000.0]), np.array([2.0, 0.1, 3.0])
    exponents, error = largest_first(*given, 0.01)
    assert exponents.tolist() == [1.0, -50.0, -np.inf]
    assert error[:2].tolist() == [0.1, 2.0] and np.isnan(error[2])


@pytest.mark.long
def test_backward_rub_has_an_exponent_of_zero_and_those_of_its_multipliers():
    """The motion along itself neither grows nor decays; the next are ln |multiplier| / period."""
    scene = limiter_rotor(nodes=4)
    start = jr.Whirl(0.012 * LENGTH, rate=-10 / TIME)
    settled = jr.simulate(scene, 200, 128, solver=jr.Exponential(4), start=start, keep=4)
    found = jr.lyapunov(scene, settled, 2000, count=3, settle=100)
    assert found.unresolved == 0
    assert found.error[0] * TIME < 1e-4 and abs(found.exponents[0]) < 3 * found.error[0]
    orbit = jr.periodic(scene, settled, steps_per_revolution=128)
    expected = np.log(np.abs(orbit.multipliers[:2])) / float(orbit.period)
    assert np.abs(found.exponents[1:] - expected).max() < 4 * found.error[1:].max() < 0.06


@pytest.mark.slow
def test_forward_bouncing_is_chaos():
    """Section 3.4: forward bouncing is not periodic, and neighbours part.

    As many exponents and revolutions as of the rub above: one program.
    """
    scene = limiter_rotor(nodes=4)
    start = jr.Whirl(0.01 * LENGTH, rate=1.7 / TIME)
    found = jr.lyapunov(scene, start, 2000, count=3, settle=300)
    assert found.exponents[0] > 4 * found.error[0] > 0
    left, right = np.asarray(found.growth)[:1000], np.asarray(found.growth)[1000:]
    (first, off), (second, too) = mean_and_error(left), mean_and_error(right)
    assert abs(first[0] - second[0]) < 4 * np.hypot(off, too)[0]


@pytest.mark.slow
def test_stops_out_of_reach_count_for_nothing():
    """Exponents sum up to `-2 c / m`, also of a mass that touches one stop and not a very stiff one."""
    stops = jr.Limiter(0.5, 0.0, 0.1, 0.5), jr.Limiter(0.5, np.pi, 0.5, 1e9)
    how = {"settle": 20, "steps_per_revolution": 32, "progress": False}
    found = jr.lyapunov(one_disc(*stops), revolutions=40, count=4, **how)
    assert found.exponents.sum() == pytest.approx(-0.2, rel=1e-5)


def test_picture():
    """Exponents `-c / 2 m` of a damped disc, and the means of noise in their place."""
    found = jr.lyapunov(one_disc(), revolutions=100, settle=20, count=2, steps_per_revolution=16)
    assert [float(rate) for rate, _ in shown(found)[2]] == pytest.approx([-0.05, -0.05], abs=1e-5)
    growth = np.random.default_rng(0).normal([0.5, -2.0], 1.0, (400, 2))
    noisy = dataclasses.replace(
        found, exponents=np.array([0.5, -2.0]), error=np.array([0.05, 0.05]), growth=growth
    )
    for result, rates in ((found, [-0.05, -0.05]), (noisy, [0.5, -2.0])):
        ax = jr.plot.lyapunov(result)
        assert ax.get_xlabel() == "revolutions [1]"
        assert ax.get_ylabel() == "mean growth of a disturbance [1/s]"
        curves = ax.get_lines()
        assert len(curves) == 5  # two exponents, each with its mean, and zero
        for mean, curve, rate, running in zip(
            curves[:4:2], curves[1:4:2], rates, result.running.T, strict=True
        ):
            assert mean.get_ydata() == pytest.approx(rate)
            assert curve.get_ydata() == pytest.approx(running)


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"revolutions": 10}, "`revolutions` must be at least 20 to estimate an error, but is 10"),
        ({"count": 1000}, "`count` must be at most 16, four a coordinate, but is 1000"),
        ({"count": 0}, "`count` must be a whole number of at least 1, but is 0"),
        ({"settle": -1}, "`settle` must be a whole number of at least 0, but is -1"),
        ({"solver": jr.Exponential(4)}, "sharp stops take located steps"),
        ({"start": "rest"}, "`start` must be a motion"),
    ],
)
def test_refusals(changed, words):
    with pytest.raises(ValueError, match=words):
        jr.lyapunov(limiter_rotor(nodes=4), **changed)
