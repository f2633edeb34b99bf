"""Long runs keep their phase, and a rub its energy balance."""

import numpy as np
import pytest
from jeffcott import AT, jeffcott, path, state

import jaxrotor as jr


REVOLUTIONS = 100_000


def turned(z: np.ndarray, want: np.ndarray) -> float:
    """Largest difference of phase, in revolutions."""
    return abs(np.angle(z / want)).max() / (2 * np.pi)


@pytest.mark.hard("1.7 100,000 revolutions of a free whirl")
def test_phase_of_a_free_whirl(record_property):
    """Undamped `z = exp(i t)` at a speed that is no ratio of its frequency."""
    speed = np.sqrt(5.0)
    r = jr.simulate(jeffcott(speed=speed), REVOLUTIONS, 8, start=state(1.0, 1j), keep=1)
    theta = np.asarray(r.angle)[0] + 2 * np.pi * np.arange(9) / 8
    off = turned(path(r)[0], np.exp(1j * theta / speed))
    size = abs(abs(path(r)[0]) - 1).max()
    record_property("measured", f"phase {off:.0e} rev, radius {size:.0e}")
    assert off < 1e-9
    assert size < 1e-8


@pytest.mark.slow
@pytest.mark.hard("1.7 100,000 revolutions in contact, whatever the steps")
@pytest.mark.parametrize("steps", [8, 13])
def test_phase_in_contact_does_not_drift(steps, record_property):
    """Stops pressed all the time: the phase of revolution 100,000 is that of 1000."""
    stops = [jr.Limiter(AT, a, -1.0, 0.2, 0.1) for a in np.pi / 3 * np.array([1, 3, 5])]
    scene = jeffcott(*stops, jr.DiscDamping(AT, 0.2), jr.Unbalance(AT, 1.0, 0.05), speed=1.7)
    solver = jr.Exponential(4)
    early = jr.simulate(scene, 1000, steps, solver=solver, keep=1)
    late = jr.simulate(scene, REVOLUTIONS - 1000, steps, solver=solver, keep=1, start=early.end)
    drift = turned(path(late)[0], path(early)[0])
    # three stops are a spring 3 k / 2 and a damper 3 d / 2
    exact = 0.05 * 1.7**2 / (1.3 - 1.7**2 + 0.35j * 1.7)
    off = turned(path(late)[0], exact * np.exp(1j * np.asarray(early.angle)))
    record_property("measured", f"drift {drift:.0e} rev, phase {off:.0e} rev by {steps} steps")
    assert drift < 1e-9
    assert off < 2e-4


@pytest.mark.slow
@pytest.mark.hard("1.7 phase in contact by fine steps")
def test_phase_in_contact_converges(record_property):
    stops = [jr.Limiter(AT, a, -1.0, 0.2, 0.1) for a in np.pi / 3 * np.array([1, 3, 5])]
    scene = jeffcott(*stops, jr.DiscDamping(AT, 0.2), jr.Unbalance(AT, 1.0, 0.05), speed=1.7)
    r = jr.simulate(scene, 100, 512, solver=jr.Exponential(4), keep=1)
    exact = 0.05 * 1.7**2 / (1.3 - 1.7**2 + 0.35j * 1.7)
    off = turned(path(r)[0], exact * np.exp(1j * np.asarray(r.angle)))
    record_property("measured", f"phase {off:.0e} rev")
    assert off < 1e-9


# === energy


@pytest.mark.slow
@pytest.mark.hard("1.7 energy balance of a rub: work = dissipation + change of energy")
@pytest.mark.parametrize("voigt", [0.0, 0.05])
def test_energy_balance_of_a_rub(voigt, record_property):
    """Work of unbalance, friction and rotating damping, less losses, is the change of energy.

    All of it from displacement and velocity alone, by the trapezoidal rule.
    """
    speed, friction, k, gap = 2.5, 0.3, 60.0, 0.05
    eccentricity, c, steps, turns = 0.03, 0.1, 16384, 3
    angles = np.pi / 3 * np.array([1, 3, 5])
    stops = [jr.Limiter(AT, a, gap, k, 0.0, friction, rim_radius=1.0) for a in angles]
    effects = [jr.Unbalance(AT, 1.0, eccentricity), jr.DiscDamping(AT, c)]
    if voigt:
        effects.append(jr.InternalDamping(voigt))
    scene = jeffcott(*effects, *stops, speed=speed)
    start = state(0.04, 0.2j)
    r = jr.simulate(scene, turns, steps, start=start, solver=jr.Exponential(4))
    (z, v), t = path(r), np.asarray(r.time)
    local = z[:, None] * np.exp(-1j * angles)
    rate = v[:, None] * np.exp(-1j * angles)
    depth = np.maximum(local.real - gap, 0.0)
    assert (speed + rate.imag > 0).all()  # friction keeps its sign
    assert (depth > 0).any() and (depth.max(axis=1) == 0).any()  # touches, and leaves
    drive = eccentricity * speed**2 * np.exp(1j * speed * t)
    power = {
        "unbalance": (drive * v.conj()).real,
        "friction": -(friction * k * depth * rate.imag).sum(1),
        "external": -c * abs(v) ** 2,
        "internal": -voigt * ((v - 1j * speed * z) * v.conj()).real,
    }
    work = {name: np.trapezoid(p, t) for name, p in power.items()}
    energy = abs(v) ** 2 / 2 + abs(z) ** 2 / 2 + k * (depth**2).sum(1) / 2
    gross = np.trapezoid(sum(map(abs, power.values())), t)
    off = abs(energy[-1] - energy[0] - sum(work.values())) / gross
    record_property("measured", f"balance {off:.0e} of the work done")
    assert all(abs(w) > 0.005 * gross for name, w in work.items() if voigt or name != "internal")
    assert off < 1e-6
