"""Orbits over the beat of two shafts: numbers of two other integrators, differences, one shaft."""

import jax
import numpy as np
import pytest
from differences import central
from shafts_of_tests import launched, toy

import jaxrotor as jr


LOCATED = jr.Exponential(4, located=True)
AT = ("lp", 1.0)
STOP = {"gap": 0.12, "stiffness": 20.0, "damping": 0.3, "friction": 0.1, "rim_radius": 1.0}
RING = jr.AnnularStator(AT, **STOP)
STOPS = [jr.Limiter(AT, angle=np.pi / 3 + 2 * np.pi * j / 3, **STOP) for j in range(3)]
# Displacements and multipliers over the beat, at angles of zero, by two integrators to 1e-8
P1 = [0.0280266638 - 0.1297026002j, 0.0507306969 + 0.0484681222j]
P2 = [0.1076781955 - 0.1091524990j, 0.1122737139 - 0.0132767007j]
MULTIPLIERS = -0.62814405 + 0.50078450j
pytestmark = pytest.mark.filterwarnings("ignore::jaxrotor.ImplausibleWarning")


@pytest.fixture(scope="module")
def stopped():
    """The toy with three stops at a ratio of 1.3, and its orbit over a beat."""
    scene = toy(1.3, None, *STOPS)
    run = jr.simulate(scene, 120, 64, keep=60, at=AT, start=launched(), solver=LOCATED)
    return scene, run, jr.periodic(scene, run, at=AT, steps_per_revolution=512)


def test_an_orbit_between_stops_returns_turned(stopped):
    """After 10/3 revolutions, by 120 degrees."""
    _, _, orbit = stopped
    assert orbit.beats and orbit.revolutions == 1 and bool(orbit.stable)
    assert float(orbit.period) == pytest.approx(2 * np.pi / (0.3 * 1.4), rel=1e-12)
    np.testing.assert_allclose(np.exp(1j * orbit.turn), np.exp(2j * np.pi / 3), atol=1e-12)
    np.testing.assert_allclose(orbit.start.q, P2, atol=1e-8)
    slowest = np.asarray(orbit.multipliers[:2])
    np.testing.assert_allclose(slowest[np.argmax(slowest.imag)], MULTIPLIERS, atol=2e-7)
    assert str(orbit).startswith("Orbit of 1 beat,")


@pytest.mark.slow  # a period of ten revolutions is another program
def test_three_beats_are_ten_revolutions(stopped):
    scene, _, orbit = stopped
    whole = jr.periodic(scene, orbit.start, revolutions=10, at=AT, steps_per_revolution=512)
    np.testing.assert_allclose(whole.start.q, orbit.start.q, atol=1e-8)
    np.testing.assert_allclose(
        np.sort(np.abs(whole.multipliers)), np.sort(np.abs(orbit.multipliers) ** 3), atol=1e-6
    )


@pytest.fixture(scope="module")
def ringed():
    """The toy with a ring at a ratio of sqrt(2), and its orbit over a beat."""
    scene = toy(2**0.5, None, RING)
    run = jr.simulate(scene, 120, 64, keep=60, at=AT, start=launched(), solver=LOCATED)
    return scene, jr.periodic(scene, run, at=AT, steps_per_revolution=512)


@pytest.mark.slow  # a ring is another program
def test_an_orbit_in_a_ring_at_an_irrational_ratio(ringed):
    _, orbit = ringed
    assert float(orbit.period) == pytest.approx(10.8349651, rel=1e-8)
    np.testing.assert_allclose(orbit.start.q, P1, atol=1e-8)
    radius = np.abs(orbit.displacement)
    np.testing.assert_allclose([radius.min(), radius.max()], [0.01261, 0.14848], atol=1e-5)
    wanted = [-0.8206947, -0.0520316 + 0.6640272j, -0.0520316 - 0.6640272j]
    np.testing.assert_allclose(
        np.sort_complex(orbit.multipliers[:3]), np.sort_complex(wanted), atol=1e-7
    )


@pytest.mark.slow  # a derivative of an orbit is a program of its own
def test_a_derivative_by_the_unbalance(stopped):
    scene, _, orbit = stopped

    def depth(moment):
        near = jr.periodic(scene.replace({"unbalances.1.moment": moment}), orbit, at=AT)
        return abs(near.start.q[0])

    h = 1e-4
    wanted = central(lambda k: float(depth(0.03 + k * h)), h)
    assert float(jax.jacfwd(depth)(0.03)) == pytest.approx(wanted, rel=1e-5)


@pytest.mark.slow  # a branch is a program of its own
def test_a_branch_over_the_ratio_of_speeds(ringed):
    """The beat changes along it; at its end the orbit is the one found there alone."""
    scene, fine = ringed
    orbit = jr.periodic(scene, fine, at=AT, steps_per_revolution=128)
    branch = jr.continue_(orbit, "shafts.hp.ratio", (1.41, 1.43), direction="up", max_step=0.4)
    assert branch.values[-1] == pytest.approx(1.43)
    end = branch.orbit(branch.values.size - 1)
    alone = jr.periodic(end.scene, end.start, at=AT)
    np.testing.assert_allclose(end.start.q, alone.start.q, atol=1e-6)
    assert float(branch.period[-1]) == pytest.approx(2 * np.pi / (0.43 * 1.4), rel=1e-9)


@pytest.mark.slow  # exponents are a program of their own
def test_exponents_are_those_of_the_multipliers():
    scene = toy(1.3, None, *STOPS)
    found = jr.lyapunov(scene, launched(), 300, settle=100)
    rate = np.log(abs(MULTIPLIERS)) / (2 * np.pi / (0.3 * 1.4))
    assert float(found.exponents[0]) == pytest.approx(rate, abs=3e-4)
    still = jr.lyapunov(toy(1.3), launched(), 300, settle=300, count=2)
    slowest = max(np.asarray(jr.roots(toy(1.3), 4)).real)
    np.testing.assert_allclose(still.exponents, slowest, rtol=1e-3)


def test_a_shaft_alone_with_unbalance_beats_by_its_revolutions():
    scene = toy(1.3)
    only = scene.replace({"unbalances.0.moment": 0.0})
    bare = only.of_parts(*(e for e in only.effects if e is not only.of(jr.Unbalance)[0]))
    orbit = jr.periodic(bare, launched(), at=AT)
    wanted = jr.unbalance_response(scene, 1.4, at=AT, by="hp").forward[0]
    np.testing.assert_allclose(orbit.displacement[0], wanted, atol=1e-9)
    assert float(orbit.period) == pytest.approx(2 * np.pi / (1.3 * 1.4), rel=1e-12)


@pytest.mark.parametrize(
    ("scene", "how", "told"),
    [
        (toy(1.3, None, *STOPS), {"turn": 0.0}, "one of them, without `turn`"),
        (toy(1.3, None, *STOPS), {"revolutions": 3}, "turns 3.9 times, which is not whole"),
        (toy(1.4, None, *STOPS), {}, "by -180 degrees, which does not leave .*; give `beats=2`"),
        (toy(2**0.5, None, *STOPS), {}, "or take `jaxrotor.torus`"),
        (toy(1.3, None, *STOPS).at_speed(0.0), {}, "is at rest, so its revolutions"),
    ],
)
def test_what_is_refused(scene, how, told):
    with pytest.raises(ValueError, match=told):
        jr.periodic(scene, launched(), at=AT, **how)
