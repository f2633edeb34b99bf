"""The orbit between two motions and the smallest impulse, by SciPy's Duffing and a closed form."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, fsolve
from systems import one_disc

import jaxrotor as jr


SPEED, FINE = 1.25, {"rtol": 1e-11, "atol": 1e-13, "method": "DOP853"}
TURN = 2 * np.pi / SPEED
SETTINGS = {"revolutions": 60, "steps_per_revolution": 64, "progress": False}


def beside_rest(displacement):
    return jr.Continued(jnp.array([displacement + 0j]), jnp.zeros(1, complex))


def duffing(start, revolutions=1):
    """State of `x.. + 0.1 x. + x + x^3 = 0.08 Omega^2 cos Omega t` and its derivative by the start."""

    def field(t, y):
        x, v, *d = y
        push = 0.08 * SPEED**2 * np.cos(SPEED * t)
        rates = [v, push - 0.1 * v - x - x**3]
        for a, b in zip(d[::2], d[1::2], strict=True):
            rates += [b, -(1 + 3 * x**2) * a - 0.1 * b]
        return rates

    y = solve_ivp(field, (0, TURN * revolutions), [*start, 1, 0, 0, 1], **FINE).y[:, -1]
    return y[:2], y[2:].reshape(2, 2).T


@pytest.fixture(scope="module")
def resonant():
    return one_disc(jr.CubicSpring(0.5, 0.0, 1.0), speed=SPEED)


@pytest.fixture(scope="module")
def between(resonant):
    """The edge of the small and the large motion of the hardening resonance."""
    return jr.edge(resonant, jr.AtRest(), beside_rest(0.9), **SETTINGS)


def test_orbit_is_the_saddle_of_scipy(between):
    orbit = between.orbit
    start = [float(orbit.start.q[0].real), float(orbit.start.velocity[0].real)]
    exact = fsolve(lambda x: duffing(x)[0] - x, start, xtol=1e-13)
    np.testing.assert_allclose(start, exact, atol=1e-6)  # of 64 steps
    own = np.linalg.eigvals(duffing(exact)[1])
    largest = np.abs(orbit.multipliers[0])
    assert largest == pytest.approx(np.abs(own).max(), rel=1e-6)
    assert np.abs(orbit.multipliers[1:]).max() < 1


@pytest.mark.slow
def test_line_is_crossed_where_scipy_changes_its_motion(between):
    """Bisection of 60 revolutions each; the large motion has more than twice the displacement."""

    def is_large(share):
        y, _ = duffing([0.9 * share, 0.0], 60)
        return abs(y[1]) > 0.5  # at whole revolutions 0.07 and 1.01

    low, high = 0.0, 1.0
    while high - low > 1e-5:
        middle = (low + high) / 2
        low, high = (low, middle) if is_large(middle) else (middle, high)
    assert low - 1e-5 < between.share < high + 1e-5
    assert float(between.crossing.q[0].real) == pytest.approx(0.9 * between.share, abs=1e-12)


@pytest.mark.slow
def test_both_sides_lead_away(between, resonant):
    """A motion that begins beside the orbit leaves it by its multiplier, to either side."""
    radii = []
    for side in between.sides:
        motion = jr.simulate(resonant, revolutions=60, keep=1, start=side)
        radii.append(float(np.abs(motion.displacement).max()))
    assert radii[0] < 0.25 < 0.9 < radii[1]
    assert "Edge at 0.6" in str(between)


@pytest.mark.slow
def test_the_middle_one_of_three_circles_in_a_ring():
    """`((k - m Omega^2) r + K (r - g))^2 + (c Omega r)^2 = (m e Omega^2)^2` in contact, by brentq."""
    scene = one_disc(jr.AnnularStator(0.5, gap=0.2, stiffness=4.0), speed=1.6)

    def missing(r):
        spring = (1 - 1.6**2) * r + 4 * max(r - 0.2, 0.0)
        return spring**2 + (0.1 * 1.6 * r) ** 2 - (0.08 * 1.6**2) ** 2

    free, middle, _ = (brentq(missing, *ends) for ends in ((0.1, 0.2), (0.2, 0.3), (0.3, 0.6)))
    begin = jr.Whirl(free, rate=1.6, angle=np.angle(1 / (1 - 1.6**2 + 0.16j)))
    fine = SETTINGS | {"steps_per_revolution": 128}
    found = jr.edge(scene, begin, jr.Whirl(0.4, rate=1.6), **fine)
    np.testing.assert_allclose(found.orbit.radius, middle, rtol=1e-7)


# === the smallest impulse


@pytest.fixture(scope="module")
def struck(resonant, between):
    rest = jr.simulate(resonant, revolutions=150, keep=1)
    small = jr.periodic(resonant, rest, revolutions=1, steps_per_revolution=64)
    return jr.resilience(small, between, revolutions=60)


@pytest.mark.slow
def test_smallest_impulse_is_where_scipy_changes_its_motion(struck):
    """Along x alone, as nothing couples y to it; bisection from the small orbit of SciPy."""
    start = fsolve(lambda x: duffing(x)[0] - x, [-0.227, 0.068], xtol=1e-13)
    low, high = 0.0, 1.0
    while high - low > 1e-5:
        middle = (low + high) / 2
        grown = abs(duffing([start[0], start[1] + middle], 60)[0][1]) > 0.5
        low, high = (low, middle) if grown else (middle, high)
    size = abs(complex(struck.impulse))
    assert low - 1e-5 < size < high + 1e-5
    assert abs(np.angle(complex(struck.impulse))) < 1e-3
    np.testing.assert_array_less(size, struck.sizes * np.abs(np.cos(struck.angles)) + 1e-12)
    assert str(struck).startswith("The smallest impulse that changes the motion is 0.7028")


@pytest.mark.slow
def test_impulses_below_it_change_nothing(struck, resonant):
    """A thousand in all directions just below it, a hundred along it just above it."""
    size, start = abs(complex(struck.impulse)), struck.orbit.start
    angles = 2 * np.pi * np.arange(1000) / 1000

    @jax.jit
    def radii(impulses):
        def radius(impulse):
            begin = jr.Continued(start.q, start.velocity + impulse)
            settled = {"keep": 1, "steps_per_revolution": 64, "solver": jr.Exponential(4)}
            run = jr.simulate(resonant, revolutions=61, start=begin, progress=False, **settled)
            return jnp.abs(run.displacement).max()

        return jax.lax.map(radius, impulses)

    assert radii(0.999 * size * jnp.exp(1j * angles)).max() < 0.5
    assert radii(size * (1 + jnp.linspace(1e-3, 1e-2, 100)) + 0j).min() > 0.5


@pytest.mark.slow
def test_derivative_of_the_smallest_impulse(struck, resonant):
    """By the stiffness of the spring, against new searches on both sides."""
    put = lambda value: resonant.replace({"cubic_spring.stiffness": value})
    size, slope = jax.jvp(lambda value: struck.size(put(value)), (1.0,), (1.0,))
    assert size == pytest.approx(abs(complex(struck.impulse)), rel=1e-12)

    def anew(value):
        scene = put(value)
        settings = {"revolutions": 1, "steps_per_revolution": 64}
        small = jr.periodic(scene, struck.orbit, **settings)
        edge = jr.edge(scene, jr.AtRest(), beside_rest(0.9), **SETTINGS)
        return abs(complex(jr.resilience(small, edge, revolutions=60).impulse))

    assert slope == pytest.approx((anew(1.002) - anew(0.998)) / 0.004, rel=1e-4)
    assert np.isnan(struck.size(put(1.01)))


def test_what_has_no_smallest_impulse(between, resonant):
    with pytest.raises(ValueError, match="`orbit` must be stable"):
        jr.resilience(between.orbit, between)


# === refusals


@pytest.mark.parametrize(
    ("other", "error", "message"),
    [
        (
            beside_rest(0.1),
            ValueError,
            "Both states lead to one motion, of the rms radius 0.2251 m",
        ),
        (3.0, ValueError, "`b` must be a motion of jaxrotor.simulate, an orbit or a start"),
    ],
)
def test_refused_states(resonant, other, error, message):
    with pytest.raises(error, match=message):
        jr.edge(resonant, jr.AtRest(), other, **SETTINGS)


def test_without_unbalance_nothing_returns(resonant):
    with pytest.raises(ValueError, match="give it an `Unbalance`"):
        jr.edge(resonant.without("unbalance"), jr.AtRest(), beside_rest(0.9), **SETTINGS)
