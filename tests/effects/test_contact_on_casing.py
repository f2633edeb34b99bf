"""Contacts that stand on casings: suspended rings of the sheet, and a stop beside SciPy."""

import diffrax as dfx
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import jaxrotor as jr


# === suspended rings, sheet 7, sections 2 and 4


def suspended(speed, ring, suspension, *, zeta, e=0.0):
    """A unit mass on a unit spring in a ring (k, mu, g, d) with a mass and a suspension (m_s, k_s, c)."""
    (k, mu, gap, d), (mass, stiffness, damping) = ring, suspension
    own = jr.AnnularStator(0.5, gap, k, d, mu, rim_radius=1.0, on="ring")
    held = jr.Casing("ring", mass), jr.Support(of="ring", stiffness=stiffness, damping=damping)
    parts = jr.Disc(0.5, 1.0), jr.DiscDamping(0.5, 2 * zeta, 0.0), jr.Unbalance(0.5, 1.0, e)
    spin = jr.ConstantSpeed(speed)
    return jr.Scene(jr.MasslessShaft(1.0, 0.5, 1.0), *parts, own, *held, spin=spin)


@pytest.mark.slow
@pytest.mark.hard("7.8 full rub in a ring with a mass and a suspension, light and heavy")
def test_full_rub_in_a_suspended_ring():
    """R12, in closed form and in time; a heavy ring stands still."""
    ring = (6.0, 0.05, 1.6, 0.0)
    scene = suspended(1.4, ring, (0.5, 10.0, 0.3), zeta=0.08, e=1.0)
    found = jr.annular_rub(scene)
    assert float(found.normal_force[0, 0]) == pytest.approx(4.494796102, rel=1e-9)
    both = np.abs(np.asarray(found.coordinates[0, 0]))
    np.testing.assert_allclose(both, [2.8475271924, 0.498396926], rtol=1e-9)
    slowest = complex(found.roots[0, 0, 0])
    assert slowest.real == pytest.approx(-0.107139867, abs=1e-9)
    assert abs(slowest.imag) == pytest.approx(3.167315399, abs=1e-9)
    heavy = jr.annular_rub(suspended(1.4, ring, (1e4, 10.0, 0.3), zeta=0.08, e=1.0))
    assert float(heavy.normal_force[0, 0]) == pytest.approx(4.004093853, rel=1e-9)
    solver = jr.Exponential(4, located=True)
    run = jr.simulate(scene, 3, 256, start=found.start(), solver=solver)
    np.testing.assert_allclose(np.abs(run.coordinates), both * np.ones((769, 2)), rtol=1e-7)
    force = 4.494796102 * np.hypot(1, 0.05)
    np.testing.assert_allclose(np.abs(run.contact_force), force, rtol=1e-7)


@pytest.mark.slow
@pytest.mark.hard("7.8 dry whirl in a ring with a mass and a suspension, and its flutter")
def test_dry_whirl_in_a_suspended_ring():
    """R14 and R15, whose upper whirl flutters, unless the ring is damped."""
    cases = (
        ((20.0, 0.15, 1.0, 0.0), (0.2, 10.0, 1.0), (-2.0491931373, -0.095034627)),
        ((20.0, 0.15, 1.0, 0.0), (0.2, 10.0, 1.0), (-1.1519272291, 0.143517994)),
        ((20.0, 0.25, 1.0, 0.0), (0.5, 10.0, 0.3), (-2.3924021646, 0.460087460)),
        ((20.0, 0.25, 1.0, 2.0), (0.5, 10.0, 0.3), (-2.3924021646, None)),
    )
    near = lambda found, rate: int(np.nanargmin(np.abs(np.asarray(found.rate) - rate)))
    for ring, suspension, (rate, growth) in cases:
        found = jr.dry_whirl(suspended(20.0, ring, suspension, zeta=0.02))
        number = near(found, rate)
        assert float(found.rate[number]) == pytest.approx(rate, rel=1e-9)
        largest = float(found.roots[number, 0].real)
        assert largest < 0 if growth is None else largest == pytest.approx(growth, abs=1e-8)
    first = jr.dry_whirl(suspended(20.0, *cases[0][:2], zeta=0.02))
    number = near(first, cases[0][2][0])
    assert float(first.normal_force[number]) == pytest.approx(6.131299548, rel=1e-9)
    assert float(first.radius[number]) == pytest.approx(1.3065649774, rel=1e-9)
    z, ring = np.abs(np.asarray(first.coordinates[number]))
    assert (z, ring) == pytest.approx((1.9373198003, 0.6605065586), rel=1e-9)


# === a stop on a casing that the ground holds

HEAVY, TILT, LIGHT, SPRING, FOUNDATION = 2.0, 0.5, 0.4, 3e3, 8e3
STOP, GAP, SPEED, MOMENT = 2e4, 1e-3, 42.0, 4e-3


def stopped():
    """A disc on the end of a rigid shaft that turns about a pin, and a stop on a casing."""
    return jr.Scene(
        jr.RigidShaft(1.0, (jr.Constraint(0.0, "pin"),)),
        jr.Disc(1.0, HEAVY, TILT, 0.0),
        jr.Support(1.0, SPRING, 8.0),
        jr.Casing("housing", LIGHT),
        jr.Support(of="housing", stiffness=FOUNDATION, damping=30.0),
        jr.Limiter(1.0, 0.3, GAP, STOP, on="housing"),
        jr.Unbalance(1.0, moment=MOMENT),
        spin=jr.ConstantSpeed(SPEED),
    )


def stop_force(y):
    out = np.exp(0.3j)
    depth = ((y[0] - y[1]) * np.conj(out)).real - GAP
    return -STOP * max(depth, 0.0) * out


def acceleration(t, y):
    """Of the disc, whose tilt is its displacement over 1 m, and of the housing."""
    push = stop_force(y)
    load = MOMENT * SPEED**2 * np.exp(1j * SPEED * t)
    disc = (load + push - SPRING * y[0] - 8.0 * y[2]) / (HEAVY + TILT)
    return np.array([disc, (-push - FOUNDATION * y[1] - 30.0 * y[3]) / LIGHT])


@pytest.mark.slow
def test_stop_on_a_casing_between_shaft_and_ground():
    """By exponential steps and integrated, with the force of the stop, and what pin and ground bear."""
    scene, end = stopped(), 4 * np.pi / SPEED
    rates = lambda t, y: np.concatenate([y[2:], acceleration(t, y)])
    how = {"rtol": 1e-11, "atol": 1e-14, "max_step": 1e-3}
    known = solve_ivp(rates, (0, end), np.zeros(4, complex), "DOP853", **how).y[:, -1]
    times, fine = np.linspace(0.0, end, 65), dfx.PIDController(rtol=1e-9, atol=1e-12)
    runs = (
        jr.simulate(scene, 2, 256, solver=jr.Exponential(4, located=True)),
        jr.run_up(scene, times, solver=dfx.Dopri8(), controller=fine),
    )
    for run in runs:
        at = np.asarray([run.displacement[-1, 0], run.of_casing("housing")[-1]])
        np.testing.assert_allclose(at, known[:2], rtol=2e-7)
        assert np.abs(run.contact_force).max() > 1.0
        push = complex(run.contact_force[-1, 0])
        assert push == pytest.approx(stop_force(known), abs=1e-4)
    moved = acceleration(end, known)
    found = jr.reactions(runs[1])
    load = MOMENT * SPEED**2 * np.exp(1j * SPEED * end)
    pin = HEAVY * moved[0] + SPRING * known[0] + 8.0 * known[2] - load - stop_force(known)
    ground = -FOUNDATION * known[1] - 30.0 * known[3]
    for name, force in (("constraints.0", pin), ("supports.1", ground)):
        bears = complex(found.force[-1, found.names.index(name)])
        assert bears == pytest.approx(force, rel=1e-5)


def test_a_casing_needs_more_than_a_stop():
    spin = jr.ConstantSpeed(1.0)
    stop = jr.Limiter(0.5, 0.0, 1e-3, 1e5, on="housing")
    shaft, disc = jr.MasslessShaft(1.0, 0.5, 1e5), jr.Disc(0.5, 1.0)
    with pytest.raises(ValueError, match="Nothing holds the casing 'housing'"):
        jr.Scene(shaft, disc, jr.Casing("housing", 1.0), stop, spin=spin)
    with pytest.raises(ValueError, match="There is no casing 'housing'"):
        jr.Scene(shaft, disc, stop, spin=spin)


@pytest.mark.slow
def test_films_on_a_casing_are_supports_there():
    """At rest under its weight the journal sinks in a bush that sinks with its casing."""
    film = jr.JournalBearing(0.5, 1.2, 1.0, 1.0, 1.0, on="housing")
    below = jr.Casing("housing", 3.0), jr.Support(of="housing", stiffness=50.0)
    parts = jr.Disc(0.5, 1.0), jr.Gravity(1.0), film, *below
    scene = jr.Scene(jr.MasslessShaft(1.0, 0.5, 1e-9), *parts, spin=jr.ConstantSpeed(2.0))
    alone = jr.Scene(
        scene.shaft, *parts[:2], jr.JournalBearing(0.5, 1.2, 1.0, 1.0, 1.0), spin=scene.spin
    )
    found, ground = jr.static_positions(scene), jr.static_positions(alone)
    np.testing.assert_allclose(found.position, ground.position, rtol=1e-8)
    linear = jr.linearized(scene)
    (support,) = [one for one in linear.of(jr.Support) if one.of is None]
    (other,) = jr.linearized(alone).of(jr.Support)
    assert support.on == "housing" and float(support.kxx) == pytest.approx(
        float(other.kxx), rel=1e-8
    )
