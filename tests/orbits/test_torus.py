"""Tori of two shafts: against linear responses, scipy, differences, and motions that leave them."""

import dataclasses
import functools

import jax
import matplotlib.pyplot as plt
import numpy as np
import pytest
from differences import central
from scipy.integrate import solve_ivp
from shafts_of_tests import toy
from soft_stop import soft_force

import jaxrotor as jr
from jaxrotor import plot


RATIO = float(np.sqrt(2))  # of speeds that have no common period
AT = [("lp", 1.0), ("hp", 1.0)]
pytestmark = pytest.mark.filterwarnings("ignore::jaxrotor.ImplausibleWarning")


def hardening(stiffness=1.0, ratio=RATIO):
    """The toy with a cubic spring to the ground and one between the shafts, across each other."""
    ground = jr.CubicSpring(("lp", 1.0), np.pi / 2, stiffness)
    return toy(ratio, None, ground, jr.CubicSpring(("lp", 1.0), 0.0, stiffness, on="hp"))


STOPS = [
    {
        "angle": np.pi / 3 + 2 * np.pi * j / 3,
        "gap": 0.02,
        "stiffness": 0.6,
        "damping": 0.05,
        "friction": 0.05,
        "rim_radius": 1.0,
        "blend": 0.8,
        "slip": 4.0,
    }
    for j in range(3)
]


def field(t, y, stiffness=1.0, first=1.4, ratio=RATIO, stops=()):
    """Equations of the hardening toy, or with stops around the second shaft, written here."""
    across = np.array([[1.0, -1.0], [-1.0, 1.0]])
    speeds, d = np.diag([first, ratio * first]), np.diag([0.01, 0.02])
    damping = np.diag([0.04, 0.03]) + d + 0.02 * across - 1j * speeds @ np.diag([0.2, 0.18])
    elastic = np.diag([1.0, 2.0]) + 0.8 * across - 1j * speeds @ d
    q, v = y[:2], y[2:]
    phases = np.exp(1j * np.array([first * t, ratio * first * t + 0.7]))
    load = np.array([0.05, 0.03]) * np.diag(speeds) ** 2 * phases
    spring = stiffness * (q[0] - q[1]).real ** 3
    force = load + np.array([-1j * stiffness * q[0].imag ** 3 - spring, spring])
    force[1] += sum(soft_force(q[1], v[1], ratio * first, stop) for stop in stops)
    return np.concatenate([v, (force - damping @ v - elastic @ q) / np.array([1.0, 0.6])])


def integrated(start, times, **how):
    y = np.concatenate([start.q, start.velocity])
    right = functools.partial(field, **how)
    fine = {"rtol": 1e-12, "atol": 1e-14, "t_eval": times}
    return solve_ivp(right, (0, times[-1]), y, "DOP853", **fine).y[:2].T


def test_a_linear_torus_is_both_responses():
    scene = toy(RATIO)
    found = jr.torus(scene, harmonics=2, at=AT, revolutions=400)
    assert found.shafts == ("lp", "hp") and bool(found.stable)
    np.testing.assert_allclose(found.speeds, [1.4, 1.4 * RATIO], rtol=1e-14)
    wanted = np.zeros((25, 2), complex)
    for by, order in (("lp", [1, 0]), ("hp", [0, 1])):
        place = np.flatnonzero((np.asarray(found.orders) == order).all(axis=1))[0]
        wanted[place] = jr.unbalance_response(scene, 1.4, at=AT, by=by).forward[0]
    np.testing.assert_allclose(found.coefficients, wanted, atol=1e-13)
    slowest = max(np.asarray(jr.roots(scene, 4)).real)
    assert float(found.exponent) == pytest.approx(slowest, rel=1e-4)


@pytest.fixture(scope="module")
def found():
    return jr.torus(hardening(), harmonics=5, at=AT, revolutions=200)


def test_the_motion_is_that_of_scipy(found):
    """The error is about that of the harmonics left out, also over the angles of all starts."""
    times = np.linspace(0.0, 60.0, 121)
    off = np.abs(integrated(found.start, times) - found.at(times)).max()
    largest = np.abs(found.coefficients).max()
    assert off < 5 * float(found.truncation) * largest < 2e-4
    low, high = found.radius
    path = np.abs(integrated(found.start, np.linspace(0.0, 600.0, 6001)))
    np.testing.assert_allclose(high, path.max(axis=0), rtol=5e-3)
    np.testing.assert_allclose(low, path.min(axis=0), atol=5e-3)
    assert float(found.exponent) == pytest.approx(-0.0265, abs=5e-4)


def test_a_picture_has_the_path_and_both_sections(found):
    ax = plot.torus(found, station=1)
    drawn = {line.get_label(): line.get_xydata() for line in ax.lines}
    start = np.array([found.start.q[1].real, found.start.q[1].imag]) * 1e3
    for name in ("lp at angle 0", "hp at angle 0"):
        off = np.hypot(*(drawn[name] - start).T)
        assert off[0] < 1e-6 * off.max() and off[-1] == off[0]
    assert "not looked at" not in str(found) and "stable: disturbances grow" in str(found)
    plt.close(ax.figure)


@pytest.mark.slow  # more harmonics are another program
def test_more_harmonics_come_near_to_scipy(found):
    fine = jr.torus(hardening(), found, harmonics=9, at=AT, revolutions=0)
    times = np.linspace(0.0, 100.0, 201)
    assert np.abs(integrated(fine.start, times) - fine.at(times)).max() < 1e-7
    assert np.isnan(fine.exponent) and fine.iterations < 8


@pytest.mark.slow  # another scene, with more harmonics
def test_a_torus_through_contact_is_that_of_scipy():
    """Three stops with friction around the second shaft, which it presses on one by one."""
    scene = toy(RATIO, None, *(jr.Limiter(("hp", 1.0), **stop) for stop in STOPS))
    found = jr.torus(scene, harmonics=12, samples=64, at=AT, revolutions=0)
    times = np.linspace(0.0, 100.0, 201)
    path = integrated(found.start, times, stiffness=0.0, stops=STOPS)
    assert np.abs(path - found.at(times)).max() < 1e-6
    turned = [(path[:, 1] * np.exp(-1j * stop["angle"])).real - stop["gap"] for stop in STOPS]
    assert all(depth.max() > 0.3 and depth.min() < 0 for depth in turned)


@pytest.mark.slow  # a derivative is another program
def test_derivatives_by_the_ratio_and_the_spring(found):
    """Forward and reverse mode against differences."""
    scene = hardening()

    def largest(ratio, stiffness):
        changed = {"coaxial_shaft.ratio": ratio, "cubic_springs.stiffness": stiffness}
        near = jr.torus(scene.replace(changed), found, harmonics=5, at=AT, revolutions=0)
        return abs(near.coefficients[:, 1] ** 2).sum()

    h = 1e-3
    forward = jax.jit(jax.jacfwd(largest, argnums=(0, 1)))(RATIO, 1.0)
    reverse = jax.jit(jax.grad(largest, argnums=(0, 1)))(RATIO, 1.0)
    ratio = central(lambda k: float(largest(RATIO + k * h, 1.0)), h)
    stiffness = central(lambda k: float(largest(RATIO, 1.0 + k * h)), h)
    for both in (forward, reverse):
        np.testing.assert_allclose(both, [ratio, stiffness], rtol=1e-6)


@pytest.mark.slow  # stiffer springs need more harmonics
def test_an_unstable_torus_is_left_at_its_exponent():
    found = jr.torus(hardening(5.0), harmonics=9, at=AT)
    assert not found.stable
    times = np.arange(0.0, 601.0, 2 * np.pi / 1.4)
    off = np.abs(integrated(found.start, times, stiffness=5.0) - found.at(times)).max(axis=1)
    grown = (times > 150) & (off < 1e-3)
    rate = np.polyfit(times[grown], np.log(off[grown]), 1)[0]
    assert float(found.exponent) == pytest.approx(rate, rel=0.05)


@pytest.fixture(scope="module")
def branch(found):
    return jr.continue_(found, "spin.speed", (1.3, 2.0), max_step=0.1)


@pytest.mark.slow  # a branch of some hundred tori
def test_tori_end_where_a_branch_folds(branch):
    """Just beyond the fold no torus is near, so a motion of scipy goes away; before it, it stays."""
    assert [point.kind for point in branch.points] == ["fold", "fold"]
    assert branch.unlocated == ()
    lost = dataclasses.replace(branch, points=(), unlocated=((0, "fold"),))
    between = f"{branch.values[0]:.6g} and {branch.values[1]:.6g}"
    assert f"fold not located between {between}" in str(lost)
    ax = plot.branch(branch, station=1)
    assert {"fold", "stable", "unstable"} <= {line.get_label() for line in ax.lines}
    plt.close(ax.figure)
    upper, lower = (point.value for point in branch.points)
    assert lower < 1.52 < 1.8 < upper
    last = np.flatnonzero(
        (branch.values > lower) & (np.arange(branch.values.size) > branch.points[1].place)
    )
    stays = branch.torus(int(last[1]))
    times = np.linspace(0.0, 400.0, 2001)
    first = float(stays.speeds[0])
    path = integrated(stays.start, times, first=first)
    assert np.abs(path - stays.at(times)).max() < 1e-2 and first < lower + 0.02
    gone = integrated(stays.start, times, first=lower - 0.005)
    assert np.abs(gone[:, 0]).max() > 2 * float(stays.radius[1][0])


@pytest.mark.parametrize(
    ("call", "told"),
    [
        (lambda: jr.torus(hardening(), harmonics=(5, 5, 5)), "one for each of 2 angles"),
        (lambda: jr.torus(hardening(), harmonics=4, samples=8), "more than 16, 4 a harmonic"),
        (lambda: jr.torus(hardening(), harmonics=40), "more than the 6000"),
        (lambda: jr.torus(hardening(), revolutions=5), "at least 20"),
        (lambda: jr.torus(hardening(), 3.0), "must be a torus, or a motion"),
        (lambda: jr.torus(hardening().without("unbalances")), "nothing moves the rotor"),
        (
            lambda: jr.torus(
                toy(RATIO, None, jr.AnnularStator(("lp", 1.0), gap=0.1, stiffness=1.0))
            ),
            "takes smooth contact",
        ),
        (lambda: jr.harmonic_balance(hardening()), "take `jaxrotor.torus`"),
    ],
)
def test_what_is_refused(call, told):
    with pytest.raises(ValueError, match=told):
        call()
