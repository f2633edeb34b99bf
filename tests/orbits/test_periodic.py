"""Periodic orbits: against the sheet of the limiter rotor, scipy, closed forms and differences."""

import types

import diffrax as dfx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import linear_sum_assignment
from shown import shown
from switched import TURN, Switched
from systems import LENGTH, TIME, limiter_rotor

import jaxrotor as jr
from jaxrotor import objectives
from jaxrotor.orbits.recurrence import recurrence
from jaxrotor.orbits.symmetry import nan_unless_symmetric, symmetry_defects, symmetry_order


RUB = jr.Whirl(0.012 * LENGTH, rate=-10 / TIME)  # leads to the backward rub
THIRD = TURN / 3


def settled(scene, revolutions=200):
    """The end of a run by plain steps, with some revolutions before it."""
    return jr.simulate(scene, revolutions, 128, solver=jr.Exponential(4), start=RUB, keep=4)


def state(scene, orbit):
    """Start of an orbit as `Switched` takes it."""
    w = np.concatenate([orbit.start.q, orbit.start.velocity / float(scene.spin.speed)])
    return np.concatenate([w.real, w.imag])


def paired(found, expected):
    """The found values that belong to the expected ones."""
    found, expected = np.asarray(found), np.asarray(expected)
    return found[linear_sum_assignment(np.abs(expected[:, None] - found))[1]]


@pytest.fixture(scope="module")
def rub():
    """The backward rub with few nodes, found by many steps."""
    scene = limiter_rotor(nodes=4)
    return scene, jr.periodic(scene, settled(scene), steps_per_revolution=512)


@pytest.mark.slow
def test_backward_rub_of_the_sheet():
    """Section 3.4: whirl rate and radius, every contact a third of a turn further back.

    Fixed steps put the sheet's digits off by 5e-6 and 6e-7; to 2e-8 the rate is known by contacts
    located in a Ritz basis, see `test_rub_agrees_with_contacts_located_exactly`.
    """
    scene = limiter_rotor(nodes=12)
    orbit = jr.periodic(scene, settled(scene), steps_per_revolution=400, estimate=True)
    assert orbit.converged and orbit.stable and orbit.unresolved == 0
    assert float(orbit.turn) == pytest.approx(-THIRD, abs=1e-15)
    assert float(orbit.whirl_rate) == pytest.approx(-0.56762695, abs=2e-8)
    assert float(orbit.whirl_rate) == pytest.approx(-0.567622, abs=6e-6)
    low, high = (float(r[0]) / LENGTH for r in orbit.radius)
    assert (low, high) == pytest.approx((0.0090533, 0.0145980), abs=7e-7)
    assert float(orbit.error.whirl_rate) < 1e-8
    assert float(orbit.error.displacement) < 1e-7 * high * LENGTH
    assert float(orbit.trivial) == pytest.approx(1.0, abs=1e-7)
    # one stop is met in a period, and by the images of the orbit each of the three
    assert sorted(np.asarray(orbit.duty) > 0) == [False, False, True]
    assert "stable" in str(orbit) and "-120 degrees" in str(orbit)
    row = [f"{value:.6g}" for value in (LENGTH, low * LENGTH, high * LENGTH)]
    assert shown(orbit) == (
        str(orbit),
        ["station [m]", "least radius [m]", "largest radius [m]"],
        [row],
    )


@pytest.mark.slow
def test_multipliers_are_those_of_direct_integration(rub):
    """Multipliers by scipy, which integrates the orbit and its derivative from event to event."""
    scene, orbit = rub
    y, period = state(scene, orbit), float(orbit.period * scene.spin.speed) / TURN
    end, changes, derivative = Switched(scene).followed(y, period)
    assert changes == 2  # touched and left
    back = np.exp(-1j * float(orbit.turn)) * np.eye(y.size // 2)
    back = np.block([[back.real, -back.imag], [back.imag, back.real]])
    assert np.abs(back @ end - y).max() < 1e-8 * np.abs(y).max()
    expected = np.linalg.eigvals(back @ derivative)
    expected = expected[np.abs(expected) > 1e-6]
    found = np.append(orbit.multipliers, orbit.trivial)
    np.testing.assert_allclose(paired(found, expected), expected, rtol=0, atol=1e-6)
    assert np.abs(expected - 1).min() < 1e-7  # the motion itself


@pytest.mark.slow
def test_full_turns_are_three_thirds(rub):
    """The same orbit without use of the symmetry, and from a start instead of a response."""
    scene, orbit = rub
    how = {"turn": 0.0, "period": 3 * orbit.period, "steps_per_revolution": 512}
    whole = jr.periodic(scene, orbit.start, **how)
    assert float(whole.turn) == pytest.approx(-TURN, abs=1e-14)
    assert float(whole.whirl_rate) == pytest.approx(float(orbit.whirl_rate), abs=1e-9)
    cubed = np.asarray(orbit.multipliers[:6]) ** 3
    np.testing.assert_allclose(paired(whole.multipliers, cubed), cubed, rtol=0, atol=1e-6)
    assert (np.asarray(whole.duty) > 0).all()


@pytest.mark.slow
def test_locked_orbit_is_a_subharmonic():
    """Section 3.4: with unbalance the backward rub locks to exactly -1/2, here two revolutions."""
    scene = limiter_rotor(nodes=4, eps=1e-3)
    response = settled(scene)
    orbit = jr.periodic(scene, response, revolutions=2)
    assert float(orbit.whirl_rate) == -0.5 and orbit.stable and orbit.trivial is None
    assert float(orbit.period) == pytest.approx(2 * TURN / float(scene.spin.speed), rel=1e-14)
    y = state(scene, orbit)
    end, changes = Switched(scene).run(y, 2)
    assert changes == 6  # three stops, touched and left
    assert np.abs(end - y).max() < 1e-6 * np.abs(y).max()
    # and is a guess of its neighbours
    near = jr.periodic(scene.replace({"unbalance.eccentricity": 1.1e-3 * LENGTH}), orbit)
    assert near.revolutions == 2 and float(near.whirl_rate) == -0.5


@pytest.mark.slow
def test_numbers_to_tune_by(rub):
    """Whirl rate and radius of the orbit found again; their derivatives are tested below."""
    scene, orbit = rub
    seen = objectives.rub(scene, orbit, steps_per_revolution=512)
    assert float(seen.whirl_rate) == pytest.approx(float(orbit.whirl_rate), abs=1e-9)
    radius = np.abs(orbit.displacement[:-1, 0])
    assert float(seen.radius) == pytest.approx(np.sqrt(np.mean(radius**2)), rel=1e-7)


@pytest.mark.slow
def test_linear_orbit_is_the_steady_state():
    scene = limiter_rotor(N=9.0, eps=1e-3, contact=False)
    orbit = jr.periodic(scene, jr.AtRest(), at=[LENGTH / 2, LENGTH])
    speed = float(scene.spin.speed)
    circle = jr.unbalance_response(scene, speed, at=[LENGTH / 2, LENGTH]).forward[0]
    expected = np.asarray(circle) * np.exp(1j * speed * np.asarray(orbit.time))[:, None]
    np.testing.assert_allclose(orbit.displacement, expected, rtol=0, atol=1e-10 * abs(circle[1]))
    assert float(orbit.whirl_rate) == pytest.approx(1.0, abs=1e-14)
    slow = np.exp(np.asarray(jr.roots(scene, 6)) * TURN / speed)
    slow = slow[np.abs(slow) > 1e-6]
    expected = np.concatenate([slow, slow.conj()])
    np.testing.assert_allclose(paired(orbit.multipliers, expected), expected, rtol=0, atol=1e-9)


# === derivatives

NAMES = ("limiters.stiffness", "limiters.friction", "spin.speed")


@pytest.mark.long
def test_derivatives_against_differences(rub):
    """Derivatives of whirl rate, rms radius and largest multiplier, by the implicit function theorem.

    Single samples, and their largest, depend on where on the orbit it begins, which is free.
    """
    scene, orbit = rub
    values = jnp.stack([jnp.ravel(scene.get(name))[0] for name in NAMES])

    def found(scaled):
        changed = scene.put(dict(zip(NAMES, scaled * values, strict=True)))
        near = jr.periodic(changed, orbit, steps_per_revolution=256)
        return jnp.stack(
            [
                near.whirl_rate,
                1e2 * jnp.sqrt(jnp.mean(jnp.abs(near.displacement[:-1]) ** 2)),
                jnp.abs(near.multipliers[0]),
            ]
        )

    # One program has the values and the derivative along a parameter, in turn by each.
    both = jax.jit(lambda scaled, along: jax.jvp(found, (scaled,), (along,)))
    one = jnp.ones(3)
    for name, along in zip(NAMES, jnp.eye(3), strict=True):
        at = lambda h, along=along: both(one + h * along, along)
        differ = lambda h, at=at: (at(h)[0] - at(-h)[0]) / (2 * h)
        expected = (4 * differ(1e-4) - differ(2e-4)) / 3
        np.testing.assert_allclose(at(0.0)[1], expected, rtol=1e-5, err_msg=name)


@pytest.mark.slow
def test_derivative_that_breaks_the_symmetry_is_not_a_number(rub):
    scene, orbit = rub
    defects = lambda changed: symmetry_defects(changed, jr.assemble(changed), orbit.turn)
    turned = lambda k: nan_unless_symmetric(orbit.turn, defects(scene.put(k)))
    stiffness = scene.get("limiters.0.stiffness")
    for names, broken in (("limiters", False), ("limiters.0", True)):
        at = lambda x, names=names: turned({f"{names}.stiffness": x})
        value, slope = jax.jvp(at, (stiffness,), (jnp.ones(()),))
        assert np.isfinite(value) and bool(np.isnan(slope)) == broken
    assert np.isnan(turned({"limiters.0.stiffness": 2 * stiffness}))
    assert np.isnan(turned({"unbalance.eccentricity": jnp.asarray(1e-6)}))


# === what is found from the scene and the guess


def test_symmetry_is_seen():
    for changed, expected in (
        ({}, 3),
        ({"limiters.0.stiffness": 5e6}, 1),
        ({"limiters.1.angle": 3.2}, 1),
    ):
        scene = limiter_rotor(nodes=4).replace(changed)
        assert symmetry_order(scene, jr.assemble(scene)) == expected
    heavy = limiter_rotor(nodes=4, gravity=True)
    assert symmetry_order(heavy, jr.assemble(heavy)) == 1


def response(z, step=0.01):
    """Samples of one coordinate with its exact rate left out."""
    return types.SimpleNamespace(
        coordinates=z[:, None], rates=np.zeros((z.size, 1)), time=step * np.arange(z.size)
    )


def test_recurrence():
    """`e^(i a t) (1 + b cos w t)` is rotated by `2 pi a / w` after 2 pi / w."""
    t, third = 0.01 * np.arange(4001), THIRD
    turns = [0.0, third, 2 * third]
    whirl = -third / 1.7  # turns by a third backward in a period of 1.7
    z = np.exp(1j * whirl * t) * (1 + 0.3 * np.cos(TURN * t / 1.7))
    time, turn = recurrence(response(z), 1.0, turns)
    assert time == pytest.approx(1.7, abs=1e-3) and turn == pytest.approx(2 * third)
    # seen in fixed axes alone it takes three of them
    assert recurrence(response(z), 1.0, [0.0])[0] == pytest.approx(5.1, abs=1e-3)
    # every second like the first: the period is of two
    doubled = z * (1 + 0.2 * np.cos(TURN * t / 3.4))
    time, turn = recurrence(response(doubled), 1.0, turns)
    assert time == pytest.approx(3.4, abs=1e-3) and turn == pytest.approx(third)
    with pytest.raises(ValueError, match="hardly moves"):
        recurrence(response(np.ones(100) + 0j), 1.0, turns)
    with pytest.raises(ValueError, match="not back where it was within 2.01 s"):
        recurrence(response(np.exp(0.3 * t[:201]) * z[:201]), 1.0, turns)


def test_recurrence_by_chance_is_refused():
    """`e^(i t)` and `e^(i w t) / 2` return after 2 pi n for `w = m / n`, and never for irrational w."""
    t = np.arange(0, 700, 0.02)

    def shown(w, t=t):
        z = np.stack([np.exp(1j * t), 0.5 * np.exp(1j * w * t)], axis=1)
        return types.SimpleNamespace(coordinates=z, rates=np.zeros(z.shape), time=t)

    time, turn = recurrence(shown(21 / 17), 1.0, [0.0])
    assert time == pytest.approx(17 * TURN, abs=1e-4) and turn == 0.0
    with pytest.raises(ValueError, match="first comes back after .* seems quasi-periodic"):
        recurrence(shown((1 + 5**0.5) / 2), 1.0, [0.0])
    with pytest.raises(ValueError, match=f"give period={17 * TURN:.6g} and turn=0"):
        recurrence(shown(21 / 17, t[: t.size // 4]), 1.0, [0.0])  # a second period is not shown


@pytest.mark.slow  # a run is compiled
def test_quasi_periodic_guess_is_refused():
    """Two frequencies of an undamped mass: a spring that hardens along x alone."""
    parts = jr.Disc(0.5, 1.0), jr.CubicSpring(at=0.5, angle=0.0, stiffness=1.0)
    scene = jr.Scene(jr.MasslessShaft(1.0, 0.5, 1.0), *parts, spin=jr.ConstantSpeed(1.0))
    motion = jr.simulate(scene, 100, 64, start=jr.Whirl(1.0, 0.7))
    with pytest.raises(ValueError, match="seems quasi-periodic or chaotic"):
        jr.periodic(scene, motion)


# === refusals


@pytest.mark.slow
def test_refusals(rub):
    scene, orbit = rub
    driven = limiter_rotor(nodes=4, eps=1e-3)
    for changed, how, sentence in (
        (
            scene,
            {"turn": 1.0},
            "must leave the scene as it is, but one of 57.2958 degrees does not",
        ),
        (driven, {"turn": 0.0}, "takes `revolutions` and no `turn`"),
        (driven, {"revolutions": 1, "period": 0.1}, "go without `turn` and `period`"),
        (driven, {"revolutions": 0}, "`revolutions` must be a whole number"),
        (scene, {"solver": jr.Exponential(4)}, "take located steps"),
        (scene, {"solver": dfx.Tsit5()}, "must be Exponential"),
        (limiter_rotor(contact=False), {"turn": 0.0}, "linear, so it has no period of its own"),
    ):
        with pytest.raises(ValueError, match=sentence):
            jr.periodic(changed, orbit, **how)
    with pytest.raises(ValueError, match="sought by values"):
        start = jr.AtRest()
        jax.jit(
            lambda k: jr.periodic(scene.put({"limiters.stiffness": k}), start, turn=0.0).period
        )(4e6)


@pytest.mark.slow
def test_what_is_not_found_is_said(rub):
    """From three times the state, with two iterations."""
    scene, orbit = rub
    far = jr.Continued(3 * orbit.start.q, 3 * orbit.start.velocity)
    how = {"turn": orbit.turn, "period": orbit.period, "steps_per_revolution": 512}
    how |= {"max_iterations": 2}
    with pytest.raises(RuntimeError, match="after 2 iterations the residual is still .* settled"):
        jr.periodic(scene, far, **how)
    lost = jr.periodic(scene, far, throw=False, **how)
    assert not lost.converged and np.isnan(lost.whirl_rate) and np.isnan(lost.multipliers).all()
    assert np.isfinite(lost.residual)
