"""Classify: against Duffing's equation by a Runge-Kutta method, and motions known in closed form."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from systems import one_disc

import jaxrotor as jr
from jaxrotor.sweeps.claims import MOTIONS, Claims, confirmed


TURN = 2 * np.pi
DAMPING, STIFFNESS, SPEED = 0.1, 0.1, 1.0


def kinds(dataset) -> list[str]:
    return [MOTIONS[number] for number in dataset["motion"].values]


# === Duffing: x.. + c x. + k x + x^3 = e Omega^2 cos(Omega t)


def runge_kutta(e: np.ndarray, revolutions: int, steps: int = 256, settle: int = 200, start=0.0):
    """States at every revolution, and growth of a disturbance in it, after some that are not kept."""
    disturbance = jnp.stack([0 * e + 1, 0 * e])
    start = jnp.concatenate(
        [start + 0 * disturbance, disturbance]
    )  # x, v and a disturbance of both
    h = TURN / SPEED / steps

    def rates(force, y):
        x, v, dx, dv = y
        slope = STIFFNESS + 3 * x**2
        return jnp.stack(
            [v, force - STIFFNESS * x - x**3 - DAMPING * v, dv, -slope * dx - DAMPING * dv]
        )

    def step(k, y):
        before, middle, after = (
            e * SPEED**2 * jnp.cos(TURN * (k + part) / steps) for part in (0.0, 0.5, 1.0)
        )
        one = rates(before, y)
        two = rates(middle, y + h / 2 * one)
        three = rates(middle, y + h / 2 * two)
        four = rates(after, y + h * three)
        return y + h / 6 * (one + 2 * (two + three) + four)

    def revolution(y, _):
        y = jax.lax.fori_loop(0, steps, step, y)
        size = jnp.hypot(y[2], y[3])
        y = y.at[2:].divide(size)
        return y, (y[:2], jnp.log(size))

    run = jax.jit(lambda y: jax.lax.scan(revolution, y, None, length=settle + revolutions)[1])
    seen, growth = run(start)
    return np.asarray(seen)[settle:], np.asarray(growth)[settle:]


def period_of(states: np.ndarray, longest: int = 8) -> int:
    """Revolutions after which the last states return, 0 if they do not."""
    for p in range(1, longest + 1):
        if (
            np.abs(states[-1 : -1 - longest : -1] - states[-1 - p : -1 - p - longest : -1]).max()
            < 1e-6
        ):
            return p
    return 0


def multiplier(e: float, start: np.ndarray, period: int) -> float:
    """Largest modulus of a multiplier of an orbit, along x or, of a linear oscillator, across."""

    def field(t, y):
        slope = STIFFNESS + 3 * y[0] ** 2
        x, v = (
            y[1],
            e * SPEED**2 * np.cos(SPEED * t) - STIFFNESS * y[0] - y[0] ** 3 - DAMPING * y[1],
        )
        return [x, v, y[3], -slope * y[2] - DAMPING * y[3], y[5], -slope * y[4] - DAMPING * y[5]]

    how = {"method": "DOP853", "rtol": 1e-11, "atol": 1e-12}
    y = solve_ivp(field, (0.0, period * TURN / SPEED), [*start, 1, 0, 0, 1], **how).y[:, -1]
    along = np.abs(np.linalg.eigvals(y[2:].reshape(2, 2))).max()
    return max(along, np.exp(-DAMPING / 2 * period * TURN / SPEED))


@pytest.mark.slow
def test_duffing():
    """All lanes are what a Runge-Kutta run shows, or undecided; multipliers are those of DOP853."""
    e = np.linspace(0.5, 13.5, 27)
    scene = one_disc(
        jr.CubicSpring(0.5, 0.0, 1.0), damping=DAMPING, stiffness=STIFFNESS, speed=SPEED
    )
    steps = {"steps_per_revolution": 64, "solver": jr.Exponential(4), "progress": False}
    swept = jr.sweep(
        scene,
        {"unbalance.eccentricity": e},
        settle=200,
        keep=1,
        observe=[jr.observe.Radius()],
        **steps,
    )
    found = jr.classify(swept, 400, **steps)
    states, growth = runge_kutta(e, 400)
    exponents = growth.mean(axis=0)
    periods = np.array([period_of(states[..., lane]) for lane in range(e.size)])
    expected = np.where(periods > 0, "periodic", np.where(exponents > 0.02, "chaotic", "unclear"))
    claimed = np.array(kinds(found))
    shown = claimed != "undecided"
    assert (claimed[shown] == expected[shown]).all(), list(zip(e, claimed, expected, strict=True))
    assert shown.sum() >= 24 and set(claimed[shown]) == {"periodic", "chaotic"}
    periodic = np.flatnonzero(claimed == "periodic")
    np.testing.assert_array_equal(found["orbit_period"].values[periodic], periods[periodic])
    for lane in periodic[::3]:
        exact = multiplier(e[lane], states[-1, :, lane], periods[lane])
        assert found["multiplier"].values[lane] == pytest.approx(exact, rel=1e-4)
    chaotic = claimed == "chaotic"
    low, high = found["exponent_low"].values, found["exponent_high"].values
    apart = np.abs(found["exponent"].values - exponents / TURN * SPEED)
    assert (apart < high - low)[chaotic].all() and (low > 0)[chaotic].all()


def lifetimes(e: float, starts: np.ndarray, revolutions: int) -> np.ndarray:
    """Revolutions after which motions from starts, (2, lanes), by Runge-Kutta repeat themselves."""
    lanes = np.full(starts.shape[1], e)
    seen, _ = runge_kutta(lanes, revolutions, settle=0, start=starts)
    ends = np.full(starts.shape[1], np.inf)
    for period in range(1, 9):
        near = np.abs(seen[period:] - seen[:-period]).max(axis=1) < 1e-3
        lasting = np.logical_and.accumulate(near[::-1])[::-1]
        ends = np.minimum(ends, np.where(lasting.any(axis=0), lasting.argmax(axis=0), np.inf))
    return ends


@pytest.mark.slow
def test_chaos_that_ends_is_a_transient():
    """In a window of Duffing's equation chaos lasts some 900 revolutions, as Runge-Kutta runs show.

    Of runs of 200 revolutions it outlasts many, but not further ones from where these end.
    """
    e, radii = 10.903, np.linspace(0.3, 2.7, 16)
    ended = lifetimes(e, np.stack([radii, 0 * radii]), 6000)
    assert np.isfinite(ended).all() and 500 < ended.mean() < 1500
    spring = jr.CubicSpring(0.5, 0.0, 1.0)
    scene = one_disc(spring, damping=DAMPING, stiffness=STIFFNESS, speed=SPEED, eccentricity=e)
    steps = {"steps_per_revolution": 96, "solver": jr.Exponential(4), "progress": False}
    radius = {"observe": [jr.observe.Radius()], "settle": 0, "keep": 1}
    swept = jr.sweep(scene, {"start.radius": radii}, start=jr.Whirl(1.0), **radius, **steps)
    once = jr.classify(swept, 200, confirm=False, repeats=0, **steps)
    chaotic = np.array(kinds(once)) == "chaotic"
    assert chaotic.sum() >= 5
    assert once.attrs["lifetime_low"] == pytest.approx(200 / np.log(20))
    assert once.attrs["lifetime_low"] < ended.mean()
    found = jr.classify(swept, 200, confirm=False, repeats=60, **steps)
    assert found.attrs["lifetime_low"] == pytest.approx(62 * 200 / np.log(20))
    assert "chaotic" not in kinds(found) and found.attrs["withdrawn"] == 0
    assert (np.array(kinds(found))[chaotic] == "transient").all()


# === what runs together show


@pytest.mark.parametrize(
    ("found", "finer", "later", "expected", "withdrawn"),
    [
        ("chaotic", "chaotic", "chaotic", "chaotic", False),
        ("chaotic", "chaotic", "periodic", "transient", False),
        ("chaotic", "periodic", "transient", "transient", False),
        ("chaotic", "periodic", "chaotic", "undecided", True),
        ("chaotic", "chaotic", "undecided", "undecided", False),
        ("chaotic", "chaotic", "failed", "undecided", False),
        ("chaotic", "undecided", "chaotic", "undecided", True),
        ("chaotic", "failed", "chaotic", "failed", True),
        ("transient", "periodic", "transient", "transient", False),
        ("periodic", "chaotic", "periodic", "undecided", True),
        ("periodic", "periodic", "periodic", "periodic", False),
        ("undecided", "periodic", "undecided", "undecided", False),
    ],
)
def test_what_is_claimed_after_all_runs(found, finer, later, expected, withdrawn):
    def claims(kind):
        motion = np.array([MOTIONS.index(kind)])
        return Claims(motion, np.where(motion == 0, 2, 0), *np.zeros((5, 1)))

    motion, gone = confirmed(claims(found), claims(finer), claims(later).motion)
    assert MOTIONS[motion.motion[0]] == expected and gone[0] == withdrawn


def test_orbits_of_two_periods_contradict_each_other():
    one, two = (Claims(np.zeros(1, int), np.array([p]), *np.zeros((5, 1))) for p in (1, 2))
    motion, gone = confirmed(one, two, one.motion)
    assert MOTIONS[motion.motion[0]] == "undecided" and gone[0]


# === closed forms


QUICK = {"steps_per_revolution": 16, "progress": False}


def ends(scene: jr.Scene, over, start=None, settle=50, **how) -> list[str]:
    """Kinds of motion of lanes from a start, with all that is claimed of them."""
    swept = jr.sweep(
        scene, over, start=start, settle=settle, keep=1, observe=[jr.observe.Radius()], **QUICK
    )
    return jr.classify(swept, 400, **QUICK, **how)


def whirling(damping: float, speed: float = np.sqrt(2.0)) -> jr.Scene:
    """A disc of unit mass and stiffness, with an unbalance of 0.08."""
    return one_disc(damping=damping, stiffness=1.0, speed=speed)


@pytest.mark.slow
def test_free_and_forced_whirl():
    """Undamped, the free whirl lasts: natural frequency over speed turns a revolution. Damped, it ends.

    Three lanes in two chunks, of which one is filled up.
    """
    radii, start = {"start.radius": [0.4, 0.5, 0.6]}, jr.Whirl(0.5, 1.0)
    found = ends(whirling(0.0), radii, start, confirm=False, lanes_per_chunk=2)
    assert kinds(found) == ["quasi_periodic"] * 3
    assert np.isnan(found["multiplier"]).all() and found.attrs["withdrawn"] == 0
    assert found["rotation"].values == pytest.approx(1 / np.sqrt(2.0), abs=1e-7)
    assert (found["rotation_error"].values < 1e-5).all()
    found = ends(whirling(0.4), radii, start)
    assert kinds(found) == ["periodic"] * 3 and (found["orbit_period"].values == 1).all()
    exact = np.exp(-0.2 * TURN / np.sqrt(2.0))
    assert found["multiplier"].values == pytest.approx(exact, rel=1e-6)
    assert found["rotation"].values == pytest.approx(1.0, abs=1e-9)
    assert found["exponent"].values == pytest.approx(-0.2, rel=1e-6)


@pytest.mark.slow
def test_stops_out_of_reach_count_for_nothing():
    """A rebound lasts steps enough at the soft stop that is touched, not at the stiff one that is not."""
    gap, stiffness = 0.1, 0.5
    stops = jr.Limiter(0.5, 0.0, gap, stiffness), jr.Limiter(0.5, np.pi, 0.5, 1e7)
    scene = one_disc(*stops)
    found = ends(scene, {"unbalance.eccentricity": [0.08]}, repeats=0, confirm=False, longest=1)

    def rate(t, y):
        x, v = y
        push = 0.08 * 0.8**2 * np.cos(0.8 * t)
        return v, push - 0.1 * v - x - stiffness * max(x - gap, 0.0)

    ends_at = TURN / 0.8 * np.array([60, 61])
    run = solve_ivp(rate, (0, ends_at[1]), (0.0, 0.0), t_eval=ends_at, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(run.y[:, 0], run.y[:, 1], rtol=1e-4)  # a period of one revolution
    assert kinds(found) == ["periodic"] and found["orbit_period"].values == [1]


@pytest.mark.slow
def test_an_unstable_rotor_is_neither_chaotic_nor_anything_else():
    """A linear rotor that grows, from its unbalance and from rest, where it stays exactly."""
    pushed = jr.Support(0.5, kxx=1.0, kxy=0.2, kyx=-0.2, kyy=1.0)
    scene = one_disc(pushed, damping=0.1, stiffness=0.001, speed=1.5)
    assert float(jr.growth_rate(scene)) > 0.04
    found = ends(scene, {"unbalance.eccentricity": [0.0, 0.08]})
    assert kinds(found) == ["undecided", "undecided"]


@pytest.mark.slow
def test_slow_decay_and_marginal_orbits_are_not_claimed():
    """A free whirl that decays by 4e-4 a revolution; an undamped rotor that stays in its steady whirl."""
    steady = 0.16  # of the unbalance, opposite to it
    start = jr.Whirl(steady, np.sqrt(2.0), np.pi)
    slow = ends(whirling(2e-4), {"start.radius": [1.0028 * steady]}, start, settle=0)
    assert kinds(slow)[0] in ("transient", "undecided")
    assert float(slow["exponent_high"][0]) < 0
    still = ends(whirling(0.0), {"start.radius": [steady]}, start, settle=0)
    assert kinds(still) == ["undecided"]


@pytest.mark.slow
def test_the_period_is_the_least():
    """At twice the natural frequency multipliers are near -1, so a lane returns nearer after two turns."""
    speed, steady = 2.0, 0.08 * 4 / 3
    start = jr.Whirl(steady, speed, np.pi)
    over = {"start.radius": [steady + 5e-5, steady + 1e-4]}
    found = ends(whirling(2e-3, speed), over, start, settle=0)
    assert kinds(found) == ["periodic", "periodic"]
    assert (found["orbit_period"].values == 1).all()
    exact = np.exp(-1e-3 * TURN / speed)
    assert found["multiplier"].values == pytest.approx(exact, rel=1e-6)


# === refusals


@pytest.fixture(scope="module")
def rub():
    scene = jr.load("limiter-rotor").with_nodes(2)
    how = {"settle": 1, "keep": 1, "steps_per_revolution": 16, "observe": [jr.observe.Radius()]}
    how |= {"start": jr.Whirl(1e-3), "error_sample": 0, "progress": False}
    return jr.sweep(scene, {"start.radius": [1e-3]}, **how)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("changed", "words"),
    [
        (
            {"revolutions": 100},
            "`revolutions` must be at least 200 to tell motions apart, but is 100",
        ),
        (
            {"lanes_per_chunk": 0},
            "`lanes_per_chunk` must be a whole number of at least 1, but is 0",
        ),
        ({"repeats": -1}, "`repeats` must be a whole number of at least 0, but is -1"),
        ({"longest": 0}, "`longest` must be a whole number of at least 1, but is 0"),
        ({"solver": jr.Exponential(4)}, "sharp stops take located steps"),
    ],
)
def test_refusals(rub, changed, words):
    with pytest.raises(ValueError, match=words):
        jr.classify(rub, **changed)
