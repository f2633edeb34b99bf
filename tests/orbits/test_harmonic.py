"""Harmonic balance: against closed forms, scipy, shooting and differences."""

import functools

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
import pytest
from differences import central
from scipy.integrate import solve_ivp
from shown import shown
from soft_stop import soft_force
from systems import LENGTH, limiter_rotor

import jaxrotor as jr
from jaxrotor.core.compiled import QUICKLY


MASS, STIFFNESS, DAMPING, ECCENTRICITY = 1.0, 1e4, 10.0, 2e-4  # natural frequency 100 rad/s
STOP = {
    "angle": 0.3,
    "gap": 1e-4,
    "stiffness": 3e4,
    "damping": 20.0,
    "friction": 0.1,
    "rim_radius": 0.05,
    "blend": 1e-4,
    "slip": 0.5,
}
HALVED, TOUCHING = 250.0, 200.0  # rad/s, with a period of two revolutions and of one


def one_stop(speed, **stop):
    """A disc on a shaft without mass that presses on one stop."""
    return jr.Scene(
        jr.MasslessShaft(1.0, 0.5, STIFFNESS),
        jr.Disc(0.5, MASS),
        jr.DiscDamping(0.5, DAMPING),
        jr.Unbalance(0.5, MASS, ECCENTRICITY),
        jr.Limiter(0.5, **(STOP | stop)),
        spin=jr.ConstantSpeed(speed),
    )


def integrated(orbit, speed):
    """Displacement and velocity by scipy from the start of an orbit, at its times."""

    def field(t, y):
        z, v = y[0] + 1j * y[1], y[2] + 1j * y[3]
        drive = MASS * ECCENTRICITY * speed**2 * np.exp(1j * speed * t)
        a = (drive - STIFFNESS * z - DAMPING * v + soft_force(z, v, speed, STOP)) / MASS
        return [v.real, v.imag, a.real, a.imag]

    z, v = complex(orbit.start.q[0]), complex(orbit.start.velocity[0])
    time, fine = np.asarray(orbit.time), {"rtol": 1e-12, "atol": 1e-16}
    start = [z.real, z.imag, v.real, v.imag]
    y = solve_ivp(field, (0, time[-1]), start, "DOP853", t_eval=time, **fine).y
    return y[0] + 1j * y[1], y[2] + 1j * y[3]


def apart(orbit, path):
    """Largest distance of an orbit from a path, over the largest of the path."""
    return np.abs(np.asarray(orbit.displacement[:, 0]) - path).max() / np.abs(path).max()


# === linear rotors


def test_linear_orbit_is_the_closed_form():
    """Unbalance turns forward once a revolution, also where a period is two; weight bends."""
    scene = limiter_rotor(N=9.0, eps=1e-3, contact=False, nodes=4, gravity=True)
    scene = scene.of_parts(*scene.effects, jr.HystereticDamping(0.02))
    at, speed = [LENGTH / 2, LENGTH], float(scene.spin.speed)
    orbit = jr.harmonic_balance(scene, harmonics=4, revolutions=2, at=at)
    expected = np.zeros((9, 2), complex)
    expected[4] = jr.weight_response(scene, speed, at=at).deflection[0]
    expected[6] = jr.unbalance_response(scene, speed, at=at).forward[0]
    size = np.abs(expected).max()
    np.testing.assert_allclose(orbit.coefficients, expected, rtol=0, atol=1e-12 * size)
    np.testing.assert_array_equal(orbit.orders, np.arange(-4, 5) / 2)
    assert float(orbit.period) == pytest.approx(4 * np.pi / speed, rel=1e-14)
    assert orbit.contact_force is None and orbit.converged and orbit.truncation == 0


# === a stop that is struck


@pytest.fixture(scope="module")
def halved():
    """A rotor above twice its critical speed that strikes a stop every second turn (Ehrich)."""
    scene = one_stop(HALVED)
    response = jr.simulate(scene, 120, 128, keep=2)
    return scene, response, jr.harmonic_balance(scene, response, harmonics=128, revolutions=2)


@pytest.mark.slow
def test_subharmonic_motion_is_that_of_scipy(halved):
    """The error against scipy falls with the number of harmonics."""
    scene, response, orbit = halved
    path, velocity = integrated(orbit, HALVED)
    size = np.abs(path).max()
    assert abs(path[-1] - path[0]) < 1e-7 * size  # periodic
    assert abs(path[orbit.samples // 2] - path[0]) > 0.1 * size  # not before two turns
    assert apart(orbit, path) < 1e-7
    scale = np.abs(velocity).max()
    np.testing.assert_allclose(orbit.velocity[:, 0], velocity, rtol=0, atol=1e-5 * scale)
    forces = [soft_force(z, v, HALVED, STOP) for z, v in zip(path, velocity, strict=True)]
    np.testing.assert_allclose(
        orbit.contact_force[:, 0], forces, rtol=0, atol=1e-5 * np.abs(forces).max()
    )
    few, errors = response, []
    for harmonics in (8, 32):
        how = {"harmonics": harmonics, "revolutions": 2, "samples": orbit.samples}
        few = jr.harmonic_balance(scene, few, **how)
        errors.append(apart(few, path))
    assert apart(orbit, path) < errors[1] / 30 < errors[0] / 30**2


@pytest.mark.slow
def test_stop_that_is_not_touched_does_nothing(halved):
    """`z = m e Omega^2 / (k + i c Omega - m Omega^2)`, forward."""
    scene, _, orbit = halved
    eccentricity = 1e-5
    scene = scene.replace({"unbalance.eccentricity": eccentricity})
    rest = eqx.tree_at(lambda orbit: orbit.ports, orbit, 0 * orbit.ports)
    found = jr.harmonic_balance(scene, rest, harmonics=128, revolutions=2)
    dynamic = STIFFNESS + 1j * DAMPING * HALVED - MASS * HALVED**2
    expected = np.zeros(257, complex)
    expected[130] = MASS * eccentricity * HALVED**2 / dynamic
    np.testing.assert_allclose(found.coefficients[:, 0], expected, rtol=0, atol=1e-9 * eccentricity)
    assert not np.any(found.contact_force)


@pytest.mark.slow
def test_mirrored_rotor_moves_in_the_mirror(halved):
    """Spin the other way round: forward stays forward, and every coefficient is conjugate."""
    _, response, orbit = halved
    scene = one_stop(-HALVED, angle=-STOP["angle"])
    start = jr.Continued(response.end.q.conj(), response.end.velocity.conj())
    found = jr.harmonic_balance(scene, start, harmonics=128, revolutions=2)
    size = np.abs(orbit.coefficients).max()
    np.testing.assert_allclose(
        found.coefficients, np.conj(orbit.coefficients), rtol=0, atol=1e-9 * size
    )
    np.testing.assert_allclose(found.displacement, orbit.displacement.conj(), atol=1e-9 * size)


@pytest.mark.slow
def test_agrees_with_shooting():
    """A flexible rotor that rests on its stops and is thrown about among them."""
    law = {"blend": 1e-3, "slip": 2.0, "gravity": True}
    scene = limiter_rotor(N=1.6, eps=2e-3, nodes=4, **law).replace({"limiters.stiffness": 1e5})
    orbit = jr.harmonic_balance(scene, harmonics=64)
    shot = jr.periodic(
        scene,
        orbit.start,
        revolutions=orbit.revolutions,
        steps_per_revolution=512,
        solver=jr.Exponential(4),
    )
    assert shot.iterations <= 3 and (np.asarray(orbit.contact_force).any(axis=0)).sum() > 1
    size = np.abs(shot.displacement).max()
    differ = np.abs(orbit.displacement[::2] - shot.displacement).max() / size
    assert differ < 1e-6


# === derivatives

NAMES = (
    "limiter.stiffness",
    "limiter.gap",
    "limiter.friction",
    "limiter.blend",
    "unbalance.eccentricity",
    "spin.speed",
)


@pytest.mark.long
def test_derivatives_against_differences():
    """In forward mode, and in reverse mode the same."""
    scene = one_stop(TOUCHING)
    orbit = jr.harmonic_balance(scene, harmonics=12)
    assert float(orbit.truncation) < 1e-3 and np.any(orbit.contact_force)
    values = jnp.stack([scene.get(name) for name in NAMES])
    weights = jnp.asarray(np.random.default_rng(0).normal(size=(25, 2)) @ [1, 1j])

    def found(scaled):
        changed = scene.put(dict(zip(NAMES, scaled * values, strict=True)))
        near = jr.harmonic_balance(changed, orbit, harmonics=12)
        return 1e4 * jnp.real(weights @ near.coefficients[:, 0])

    one, compiled = jnp.ones(len(NAMES)), functools.partial(jax.jit, **QUICKLY)
    both = compiled(lambda at, along: jax.jvp(found, (at,), (along,)))
    reverse = compiled(jax.grad(found))(one)
    for name, other, along in zip(NAMES, reverse, jnp.eye(one.size), strict=True):
        at = lambda k, along=along: both(one + 1e-4 * k * along, along)
        slope = float(at(0)[1])
        assert float(other) == pytest.approx(slope, rel=1e-9), name
        expected = central(lambda k, at=at: float(at(k)[0]), 1e-4)
        assert slope == pytest.approx(expected, rel=1e-5), name


# === refusals


@pytest.mark.slow
def test_refusals(halved):
    scene, response, orbit = halved
    sharp = one_stop(HALVED, blend=None)
    for changed, guess, how, sentence in (
        (sharp, None, {}, "sharp stops; give them `blend` and `slip`, or take `jaxrotor.periodic`"),
        (scene, None, {"samples": 27}, "`samples` must be at least 28, 4 a harmonic"),
        (scene, None, {"harmonics": 0}, "`harmonics` must be a whole number"),
        (scene, None, {"harmonics": 2, "revolutions": 3}, "must be at least `revolutions` = 3"),
        (scene.without("unbalance"), None, {}, "Without unbalance or weight nothing moves"),
        (scene.replace({"unbalance.eccentricity": 0.0}), None, {}, "the balance is that of rest"),
        (scene.at_speed(0.0), None, {}, "At zero speed a revolution has no length"),
        (scene, response, {"revolutions": 3}, "must hold 3 revolutions, but holds 2; raise"),
        (scene, orbit, {"revolutions": 3}, "has a period of 2 revolutions"),
        (scene, 1.0, {}, "`guess` must be a motion"),
    ):
        with pytest.raises(ValueError, match=sentence):
            jr.harmonic_balance(changed, guess, **how)
    unequal = jr.load("dual-stiffness-rigid")
    with pytest.raises(ValueError, match="the same along every axis"):
        jr.harmonic_balance(unequal)


@pytest.mark.slow
def test_what_is_not_found_is_said(halved):
    scene, _, orbit = halved
    how = {"harmonics": 128, "revolutions": 2, "max_iterations": 2}
    how["finder"] = optx.Newton(1e-10, 1e-10)
    far = eqx.tree_at(lambda orbit: orbit.ports, orbit, 30 * orbit.ports)
    with pytest.raises(RuntimeError, match="after 2 iterations the residual is still"):
        jr.harmonic_balance(scene, far, **how)
    lost = jr.harmonic_balance(scene, far, throw=False, **how)
    assert not lost.converged and np.isnan(lost.displacement).all() and np.isfinite(lost.residual)
    found = jr.harmonic_balance(scene, orbit, **how)
    assert found.converged and "Orbit of 2 revolutions by 128 harmonics" in str(found)
    assert shown(found)[0] == str(found)
    assert shown(found)[2][0][2] == f"{np.abs(found.displacement).max():.6g}"
