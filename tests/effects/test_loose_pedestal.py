"""Loose pedestal: orbits, a flip, lift-off, by DOP853 and collocation of order 12, in um and ms."""

import jax.numpy as jnp
import numpy as np
import pytest
from differences import check_by_each
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import jaxrotor as jr
from jaxrotor.effects.law import Now


MASS, BODY, G, ECC = 30.0, 12.0, 9.81, 50e-6
K, C, K1, C1, K2, C2, PLAY = 8e6, 3000.0, 5e7, 8000.0, 2e7, 4000.0, 40e-6
LOCATED = jr.Exponential(4, located=True)
ORBITS = {  # speed: revolutions, y, y_b and velocities, multipliers of the vertical motion
    400.0: (
        1,
        (-169.386644787, -23.182835896, 57.556835708, 7.344338214),
        (0.492485539 + 0.327924110j, -0.001980268, -0.006822040),
    ),
    600.0: (
        1,
        (-58.103207803, -22.836037541, -53.793404031, -32.866357024),
        (-0.263359759 + 0.650295472j, -0.005245621 + 0.029487121j),
    ),
    700.0: (
        2,
        (-71.140084213, -19.979724978, -52.364821694, -13.612326854),
        (0.313648711 + 0.315035368j, -0.007931423, -0.001106169),
    ),
}


def pedestal(**values):
    given = {"mass": BODY, "stiffness": K1, "damping": C1} | values
    return jr.LoosePedestal("block", bolt_stiffness=K2, bolt_damping=C2, play=PLAY, **given)


def machine(speed, eccentricity=ECC, body=None):
    """A disc on a shaft in a bearing that stands on the pedestal."""
    return jr.Scene(
        jr.MasslessShaft(1.0, 0.5, 1e-6),
        jr.Disc(0.5, MASS),
        jr.Support(0.5, K, C, on="block"),
        jr.Gravity(G),
        jr.Unbalance(0.5, MASS, eccentricity),
        *([pedestal()] if body is None else body),
        spin=jr.ConstantSpeed(speed),
    )


PRESSED = [jr.Casing("block", BODY), jr.Support(of="block", stiffness=K1, damping=C1)]


def vertical(q, velocity):
    """y of disc and pedestal [um], and their velocities [um/ms]."""
    return np.concatenate([1e6 * np.asarray(q).imag, 1e3 * np.asarray(velocity).imag])


def motion(speed, count, settle=60):
    how = {"solver": LOCATED, "steps_per_revolution": 512}
    run = jr.simulate(machine(speed), settle, start=jr.AtRest(), **how)
    return jr.periodic(machine(speed), run, revolutions=count, **how)


@pytest.mark.slow
def test_orbits():
    """That of two revolutions begins with the second of them after an odd number from rest."""
    for speed, (count, start, multipliers) in ORBITS.items():
        found = motion(speed, count, 61 if count == 2 else 60)
        own = vertical(found.start.q, found.start.velocity)
        np.testing.assert_allclose(own, start, rtol=0, atol=3e-6)
        away = np.abs(np.asarray(found.multipliers)[:, None] - np.array(multipliers)).min(axis=0)
        assert away.max() < 1e-7


@pytest.mark.slow
def test_flip():
    """Saltation by the jumps of the force is in the multipliers."""
    branch = jr.continue_(motion(600.0, 1), "spin.speed", (600.0, 690.0), solver=LOCATED)
    flip = next(point for point in branch.points if point.kind == "flip")
    assert flip.value == pytest.approx(653.0288049856, abs=1e-5)


def test_motion_from_the_centre():
    """Through lift-off and touch-down, from y = y_b = 0 at rest."""
    still = jr.Launch(jr.Continued(jnp.zeros(2, complex), jnp.zeros(2, complex)))
    times = np.linspace(0.0, 0.05, 41)
    run = jr.run_up(machine(425.0), times, start=still, solver=LOCATED, substeps=128)
    wanted = 154.302064539, 82.025899797, 50.118163822, 39.961485891
    end = run.end.shaft
    np.testing.assert_allclose(vertical(end.q, end.velocity), wanted, rtol=0, atol=1e-6)


@pytest.mark.slow
def test_rest_and_lift_off():
    """Pressed, it is a casing on a linear foundation: at rest, and up to where the response lifts it."""
    scene = machine(400.0, 0.0)
    run = jr.simulate(scene, 60, keep=1, start=jr.AtRest(), solver=LOCATED)
    y, y_b = vertical(run.end.shaft.q, run.end.shaft.velocity)[:2]
    assert (y_b, y) == pytest.approx((-8.2404, -45.0279), abs=1e-4)

    def excess(speed):
        response = jr.unbalance_response(machine(400.0, body=PRESSED), [speed], at="block")
        return K1 * abs(complex(response.forward[0, 0]) * (1 + 1j * speed * C1 / K1)) - 42.0 * G

    assert brentq(excess, 340, 360, xtol=1e-10) == pytest.approx(353.1653978332, abs=1e-8)
    np.testing.assert_allclose(
        jr.roots(machine(400.0).without("unbalances")), jr.roots(machine(400.0, body=PRESSED)), rtol=1e-12
    )  # fmt: skip


def test_force_of_both_sides():
    """Added to that of the foundation as the equations have it, `k z + c z.`; turned, the force turns."""
    draw = np.random.default_rng(2)
    place = jnp.asarray(draw.uniform(-2, 2, (2, 400)) * PLAY)
    rate = jnp.asarray(draw.uniform(-0.3, 0.3, (2, 400)))
    now = Now(jnp.ones(()))
    force = np.asarray(pedestal().law()(place, rate, now))[1]
    y, v = np.asarray(place[1]), np.asarray(rate[1])
    below = np.where(y < 0, np.maximum(-K1 * y - C1 * v, 0.0), 0.0)
    above = np.where(y > PLAY, np.maximum(K2 * (y - PLAY) + C2 * v, 0.0), 0.0)
    np.testing.assert_allclose(force - K1 * y - C1 * v, below - above, rtol=0, atol=1e-8)
    turn = jnp.array([[0.0, -1.0], [1.0, 0.0]])
    turned = pedestal(angle=0.0).law()(turn @ place, turn @ rate, now)
    np.testing.assert_allclose(turned[0], -force, rtol=0, atol=1e-8)


def test_motion_against_scipy():
    """From high above, where the bolts hold, at 300 rad/s."""

    def rates(t, s):
        y, b, v, w = s
        shaft = K * (y - b) + C * (v - w)
        below = max(-K1 * b - C1 * w, 0.0) if b < 0 else 0.0
        above = max(K2 * (b - PLAY) + C2 * w, 0.0) if b > PLAY else 0.0
        turning = MASS * ECC * 300.0**2 * np.sin(300.0 * t)
        return [v, w, (turning - shaft) / MASS - G, (shaft + below - above) / BODY - G]

    start = np.array([1e-4, 8e-5, 0.0, 0.05])
    exact = solve_ivp(rates, (0, 4e-3), start, "DOP853", rtol=1e-10, atol=1e-14, max_step=1e-6).y
    q = jnp.asarray(1j * start[:2])
    launch = jr.Launch(jr.Continued(q, jnp.asarray(1j * start[2:])))
    how = {"start": launch, "solver": LOCATED, "substeps": 128}
    end = jr.run_up(machine(300.0), np.linspace(0.0, 4e-3, 41), **how).end.shaft
    wanted = exact[:, -1] * [1e6, 1e6, 1e3, 1e3]
    np.testing.assert_allclose(vertical(end.q, end.velocity), wanted, rtol=0, atol=1e-4)


FINE = {"solver": LOCATED, "steps_per_revolution": 512, "start": jr.AtRest()}
NUMBERS = {
    "loose_pedestal.mass": BODY,
    "loose_pedestal.stiffness": K1,
    "loose_pedestal.damping": C1,
    "loose_pedestal.bolt_stiffness": K2,
    "loose_pedestal.bolt_damping": C2,
    "loose_pedestal.play": PLAY,
    "loose_pedestal.angle": -np.pi / 2,
    "spin.speed": 425.0,
}


@pytest.mark.slow
def test_derivatives_of_a_motion():
    """Through lift-off, bolts and touch-down."""
    scene, values = machine(425.0), jnp.array(list(NUMBERS.values()))

    def own(values):
        there = scene.replace(dict(zip(NUMBERS, values, strict=True)))
        z = 1e6 * jr.simulate(there, 4, **FINE).displacement[-1, 0]
        return jnp.stack([z.real, z.imag])

    check_by_each(own, values, 1e-5, least=1e-2)


@pytest.mark.long
def test_lanes_are_runs():
    scene = machine(425.0)
    over = {"loose_pedestal.play": [PLAY, 2 * PLAY], "spin.speed": [425.0, 600.0]}
    found = jr.sweep(scene, over, settle=3, keep=1, error_sample=0, **FINE)
    for i, play in enumerate(over["loose_pedestal.play"]):
        for j, speed in enumerate(over["spin.speed"]):
            here = scene.replace({"loose_pedestal.play": play, "spin.speed": speed})
            z = complex(jr.simulate(here, 4, **FINE).displacement[-1, 0])
            np.testing.assert_allclose(found.section[i, j, -1], [z.real, z.imag], atol=1e-14)


def test_reactions_are_refused():
    run = jr.simulate(machine(400.0), 1, start=jr.AtRest(), solver=LOCATED)
    with pytest.raises(ValueError, match="but loose_pedestal acts otherwise"):
        jr.reactions(run)


def test_bearings_alone_stand_on_a_pedestal():
    """Its foundation holds it, so it needs no Support."""
    film = jr.JournalBearing(0.5, 0.02, 0.025, 0.02, 1e-4, on="ped")
    pedestal = jr.LoosePedestal("ped", 12.0, 5e7, 8e3, 2e7)
    parts = jr.MasslessShaft(1.0, 0.5, 1e-6), jr.Disc(0.5, 30.0), jr.Gravity(), pedestal, film
    scene = jr.Scene(*parts, spin=jr.ConstantSpeed(300.0))
    assert jr.assemble(scene).n == 2
