"""Motion at varying speed: against scipy, a Lagrangian, energy, and the closed run-up."""

import dataclasses

import diffrax as dfx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import cumulative_simpson, solve_ivp
from scipy.special import ellipkm1

import jaxrotor as jr


FINE = dfx.PIDController(rtol=1e-12, atol=1e-15)
MASS, STIFFNESS, DAMPING, OFFSET = 2.0, 8e4, 12.0, 1e-4  # critical speed 200 rad/s
CRITICAL = (STIFFNESS / MASS) ** 0.5


def jeffcott(*effects, spin, offset=OFFSET, polar=0.01, **shaft):
    """Disc of two coordinates on a massless shaft."""
    return jr.Scene(
        jr.MasslessShaft(1.0, 0.5, STIFFNESS, **shaft),
        jr.Disc(0.5, MASS, 0.0, polar, offset=offset, exact=False),
        jr.DiscDamping(0.5, DAMPING),
        *effects,
        spin=spin,
    )


def at_rest(speed):
    """The centre at rest, as the end of a run has it: both begin runs of the same program."""
    none = jnp.zeros(1) + 0j
    return jr.Launch(jr.Continued(none, none), balls=(), speed=speed)


def ramp(t, start=100.0, rate=400.0):
    return start * t + rate * t**2 / 2, start + rate * t, rate


def integrate(acceleration, times, size=2, start=None):
    """q and q. of `q.. = acceleration(t, q, q.)`, real, by DOP853."""
    y0 = np.zeros(2 * size) if start is None else start
    rates = lambda t, y: np.concatenate([y[size:], acceleration(t, y[:size], y[size:])])
    found = solve_ivp(rates, (0, times[-1]), y0, "DOP853", times, rtol=1e-12, atol=1e-15)
    return found.y[:size].T, found.y[size:].T


# === a given speed


@pytest.mark.slow
def test_ramp_through_the_critical_speed():
    times = np.linspace(0, 0.6, 121)

    def own(t, q, v):
        angle, speed, rate = ramp(t)
        turned = np.array([np.cos(angle), np.sin(angle)])
        ahead = np.array([-turned[1], turned[0]])
        push = MASS * OFFSET * (speed**2 * turned - -rate * -ahead)  # Omega^2 u - i Omega. u
        return (push - DAMPING * v - STIFFNESS * q) / MASS

    q, v = integrate(own, times)
    scene = jeffcott(spin=jr.SpeedProfile.ramp(100.0, 340.0, 0.6))
    run = jr.run_up(scene, times, controller=FINE)
    z = np.asarray(run.displacement[:, 0])
    assert np.abs(z - q @ [1, 1j]).max() < 1e-9 * np.abs(z).max()
    velocity = np.asarray(run.velocity[:, 0])
    assert np.abs(velocity - v @ [1, 1j]).max() < 1e-8 * np.abs(velocity).max()
    still = MASS * OFFSET * CRITICAL / DAMPING  # the steady peak, which a quick run does not reach
    assert 0.3 * still < np.abs(z).max() < 0.9 * still


@pytest.mark.slow
def test_flexible_rotor_through_its_first_critical_speed():
    """Gyroscopic, with internal damping; scipy integrates its matrices in fixed axes."""
    scene = jr.load("limiter-rotor").without("limiters").replace({"unbalance.eccentricity": 1e-4})
    small = jr.FlexibleShaft(
        0.7, 0.02, scene.shaft.material, nodes=3, constraints=[jr.Constraint(0.0, "clamp")]
    )
    scene = jr.Scene(small, *scene.effects, spin=jr.SpeedProfile.ramp(30.0, 130.0, 0.5))
    critical = float(jr.critical_speeds(scene).forward[0])
    assert 30 < critical < 130
    system = jr.assemble(scene)
    blocks = system.blocks
    m, c, g, k, h = (
        np.asarray(getattr(blocks, name))
        for name in ("inertia", "damping", "gyroscopic", "stiffness", "circulatory")
    )
    u, inverse, n = np.asarray(system.load.unbalance), np.linalg.inv(m), len(m)
    times = np.linspace(0, 0.5, 26)

    def rates(t, y):
        angle, speed, rate = ramp(t, 30.0, 200.0)
        q, v = y[:n], y[n:]
        force = (speed**2 - 1j * rate) * u * np.exp(1j * angle)
        force = force - (c - 1j * speed * g) @ v - (k - 1j * speed * h) @ q
        return np.concatenate([v, inverse @ force])

    expected = solve_ivp(
        rates, (0, 0.5), np.zeros(2 * n, complex), "DOP853", times, rtol=1e-10, atol=1e-14
    )
    row = np.asarray(system.line.row(jnp.asarray(0.7)))
    fine = dfx.PIDController(rtol=1e-9, atol=1e-12)
    z = np.asarray(jr.run_up(scene, times, at=0.7, controller=fine).displacement[:, 0])
    assert np.abs(z - row @ expected.y[:n]).max() < 1e-6 * np.abs(z).max()
    assert np.abs(z).max() > 3 * np.abs(z[3])


@pytest.mark.slow
def test_unequal_axes_fixed_and_turning():
    """A shaft of two stiffnesses with Voigt damping in unequal supports: periodic coefficients."""
    times, mu, voigt = np.linspace(0, 0.3, 31), 0.2, 2e-4
    supports = [
        jr.Support(at, 9e4, 20.0, anisotropy=0.3, angle=0.4, damping_anisotropy=0.1)
        for at in (0.0, 1.0)
    ]
    shaft = jr.MasslessShaft(1.0, 0.5, STIFFNESS, anisotropy=mu, ends="elastic")
    discs = [jr.Disc(at, mass) for at, mass in ((0.0, 0.3), (0.5, MASS))]
    scene = jr.Scene(
        shaft,
        *discs,
        jr.Unbalance(0.5, MASS, OFFSET),
        jr.InternalDamping(voigt),
        *supports,
        spin=jr.SpeedProfile.ramp(100.0, 220.0, 0.3),
    )

    def own(t, q, v):
        angle, speed, rate = ramp(t)
        z, z0, dz, dz0 = (w[0] + 1j * w[1] for w in (q[:2], q[2:], v[:2], v[2:]))
        turn = np.exp(1j * angle)
        stretch, rise = (z - z0) / turn, (dz - dz0) / turn - 1j * speed * (z - z0) / turn
        strained = stretch + voigt * rise
        pull = turn * STIFFNESS * (strained + mu * np.conj(strained))
        axis = np.exp(0.8j)
        hold = 2 * 9e4 * (z0 + 0.3 * axis * np.conj(z0))
        hold = hold + 2 * 20.0 * (dz0 + 0.1 * axis * np.conj(dz0))
        push = MASS * OFFSET * (speed**2 - 1j * rate) * turn
        a, a0 = (push - pull) / MASS, (pull - hold) / 0.3
        return np.array([a.real, a.imag, a0.real, a0.imag])

    q, _ = integrate(own, times, 4)
    run = jr.run_up(scene, times, at=[0.5, 0.0], controller=FINE)
    z = np.asarray(run.displacement)
    assert np.abs(z - q.reshape(-1, 2, 2) @ [1, 1j]).max() < 1e-8 * np.abs(z).max()


@pytest.mark.slow
def test_rub_on_the_way():
    """Run-up into a limiter with friction: a non-smooth field, so 1e-4 of the radius."""
    gap, stop, brake, friction, rim = 2e-4, 4e5, 50.0, 0.15, 0.03
    limiter = jr.Limiter(0.5, 0.3, gap, stop, brake, friction, rim)
    times = np.linspace(0, 0.6, 61)

    def own(t, q, v):
        angle, speed, rate = ramp(t)
        z, dz, turn = q @ [1, 1j], v @ [1, 1j], np.exp(1j * angle)
        out, along = z * np.exp(-0.3j), dz * np.exp(-0.3j)
        normal = stop * (out.real - gap) + brake * along.real
        normal = normal if out.real > gap and normal > 0 else 0.0
        rub = -normal * (1 + 1j * friction * np.sign(speed * rim + along.imag)) * np.exp(0.3j)
        a = MASS * OFFSET * (speed**2 - 1j * rate) * turn - DAMPING * dz - STIFFNESS * z + rub
        return np.array([a.real, a.imag]) / MASS

    q, _ = integrate(own, times)
    scene = jeffcott(limiter, spin=jr.SpeedProfile.ramp(100.0, 340.0, 0.6))
    run = jr.run_up(scene, times, controller=FINE)
    z = np.asarray(run.displacement[:, 0])
    assert np.abs(z - q @ [1, 1j]).max() < 1e-4 * np.abs(z).max()
    assert (np.abs(run.contact_force) > 0).sum() > 3


@pytest.mark.slow
def test_constant_speed_is_what_simulate_gives():
    scene = jr.load("limiter-rotor").replace({"unbalance.eccentricity": 1e-4})
    scene = scene.without("limiters")
    response = jr.simulate(scene, 3, 32)
    run = jr.run_up(scene, response.time, at=response.stations)
    gap = np.abs(run.displacement - response.displacement).max()
    assert gap < 1e-5 * np.abs(response.displacement).max()


# === a drive


def lagrangian(q, v):
    """Disc on springs whose centre of mass is off the axis, free to turn: x, y, theta."""
    centre = lambda q: q[:2] + OFFSET * 20 * jnp.array([jnp.cos(q[2]), jnp.sin(q[2])])
    speed = jax.jvp(centre, (q,), (v,))[1]
    return MASS * speed @ speed / 2 + 0.01 * v[2] ** 2 / 2 - STIFFNESS * q[:2] @ q[:2] / 2


def free_jeffcott(torque, slope):
    """The same as a scene; its moment of inertia about the axis includes the offset."""
    inertia = 0.01 + MASS * (20 * OFFSET) ** 2
    drive = jr.Drive(100.0, torque, slope, polar=inertia, feedback=True)
    return jeffcott(spin=drive, offset=20 * OFFSET)


@pytest.mark.slow
def test_feedback_of_unbalance_is_that_of_the_lagrangian():
    torque, slope, times = 6.0, 0.02, np.linspace(0, 1.0, 41)

    @jax.jit
    def own(q, v):
        momentum = jax.grad(lagrangian, 1)
        mass = jax.jacfwd(momentum, 1)(q, v)
        along = jax.jvp(lambda q: momentum(q, v), (q,), (v,))[1]
        outer = jnp.array([-DAMPING * v[0], -DAMPING * v[1], torque - slope * v[2]])
        return jnp.linalg.solve(mass, jax.grad(lagrangian)(q, v) - along + outer)

    start = np.array([0, 0, 0, 0, 0, 100.0])
    q, v = integrate(lambda t, q, v: np.asarray(own(q, v)), times, 3, start)
    run = jr.run_up(free_jeffcott(torque, slope), times, controller=FINE)
    z = np.asarray(run.displacement[:, 0])
    assert np.abs(run.angle - q[:, 2]).max() < 1e-6
    assert np.abs(run.speed - v[:, 2]).max() < 1e-7 * 200
    assert np.abs(z - q[:, :2] @ [1, 1j]).max() < 1e-7 * np.abs(z).max()


@pytest.mark.slow
def test_a_weak_drive_is_captured_at_the_critical_speed():
    """Sommerfeld effect: 2 N m stay below 200 rad/s, 12 N m pass; without feedback both pass."""
    times = np.linspace(0, 8.0, 41)  # as many as above: one program
    weak, strong = (
        jr.run_up(free_jeffcott(torque, 0.004), times, controller=FINE) for torque in (2.0, 12.0)
    )
    assert float(weak.speed[-1]) < CRITICAL and float(strong.speed[-1]) > 1.5 * CRITICAL
    assert np.ptp(np.asarray(weak.speed[-6:])) < 2.0
    # What the drive gives while it hangs is what the damper takes: c |z.|^2 = (M - k Omega) Omega.
    speed = np.asarray(weak.speed[-6:])
    taken = DAMPING * np.abs(weak.velocity[-6:, 0]) ** 2
    assert taken.mean() == pytest.approx(((2.0 - 0.004 * speed) * speed).mean(), rel=0.02)
    alone = jeffcott(spin=jr.Drive(100.0, 2.0, 0.004, 0.0, polar=0.018))
    passed = jr.run_up(alone, [7.0, 7.5, 8.0], start=at_rest(100.0), controller=FINE)
    assert float(passed.speed[-1]) > 1.5 * CRITICAL


@pytest.mark.slow
def test_friction_of_a_stop_brakes_the_drive():
    """Energy: the work of the drive is stored, or lost in dampers, stop and friction."""
    drive = jr.Drive(150.0, 3.0, 0.01, polar=0.02, feedback=True)
    limiter = jr.Limiter(0.5, 0.3, 1e-4, 4e5, 0.0, 0.2, 0.03)
    scene = jeffcott(limiter, spin=drive, offset=None)
    start = jr.Whirl(4e-4)
    times = np.linspace(0, 0.05, 4001)
    run = jr.run_up(scene, times, start=start, controller=FINE)
    z, v = np.asarray(run.displacement[:, 0]), np.asarray(run.velocity[:, 0])
    force, speed = np.asarray(run.contact_force[:, 0]), np.asarray(run.speed)
    outward = np.exp(0.3j)
    depth = np.maximum((z * np.conj(outward)).real - 1e-4, 0)
    stored = MASS * np.abs(v) ** 2 / 2 + STIFFNESS * np.abs(z) ** 2 / 2 + 4e5 * depth**2 / 2
    stored = stored + 0.02 * speed**2 / 2
    normal, rubbing = -(force * np.conj(outward)).real, (force * np.conj(1j * outward)).real
    slip = speed * 0.03 + (v * np.conj(1j * outward)).real
    power = (3.0 - 0.01 * speed) * speed - DAMPING * np.abs(v) ** 2 + rubbing * slip
    gained = np.concatenate([[0], np.cumsum((power[1:] + power[:-1]) / 2 * np.diff(times))])
    assert normal.max() > 10 and (rubbing * slip).min() < -10
    assert np.abs(stored - stored[0] - gained).max() < 1e-4 * np.ptp(stored)


SPRUNG = jr.Drive(400.0, 0.0, feedback=True)  # left to itself


def pairs(mu):
    """Along and across axes that turn with the shaft: 1 + mu, 1 - mu."""
    return lambda size: lambda z: size * ((1 + mu) * z.real**2 + (1 - mu) * z.imag**2)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("shaft", "effects", "spring", "damper"),
    [
        (
            jr.MasslessShaft(1.0, 0.5, STIFFNESS, anisotropy=0.2),
            [jr.InternalDamping(1e-3)],
            pairs(0.2)(STIFFNESS),
            pairs(0.2)(80.0),
        ),
        (
            jr.MasslessShaft(1.0, 0.5, STIFFNESS, damping=80.0),
            [],
            pairs(0.0)(STIFFNESS),
            pairs(0.0)(80.0),
        ),
        (
            jr.RigidShaft(1.0),
            [
                jr.Support(
                    at, STIFFNESS / 2, 40.0, anisotropy=0.3, damping_anisotropy=0.1, rotating=True
                )
                for at in (0.0, 1.0)
            ],
            pairs(0.3)(STIFFNESS),
            pairs(0.1)(80.0),
        ),
    ],
    ids=["voigt", "shaft", "support"],
)
def test_what_turns_with_the_shaft_makes_no_energy(shaft, effects, spring, damper):
    """Above critical speed internal damping drives the whirl; the rotation pays for it."""
    disc = jr.Disc(0.5, MASS, 0.1, 0.01, offset=1e-3)
    scene = jr.Scene(shaft, disc, *effects, spin=SPRUNG)
    times = np.linspace(0, 0.04, 2001)
    run = jr.run_up(scene, times, start=jr.Whirl(1e-3, 200.0), at=0.5, controller=FINE)
    z, v = np.asarray(run.displacement[:, 0]), np.asarray(run.velocity[:, 0])
    angle, speed = np.asarray(run.angle), np.asarray(run.speed)
    turn = np.exp(1j * angle)
    centre = v + 1j * speed * 1e-3 * turn  # of mass
    kinetic = MASS * np.abs(centre) ** 2 / 2 + 0.01 * speed**2 / 2
    energy = kinetic + spring(z / turn) / 2
    lost = np.concatenate([[0], cumulative_simpson(damper((v - 1j * speed * z) / turn), x=times)])
    assert lost[-1] > 0.5 and np.diff(energy).max() < 1e-9 * energy[0]
    assert np.abs(energy - energy[0] + lost).max() < 1e-7 * lost[-1]


@pytest.mark.slow
def test_internal_damping_of_a_flexible_shaft_brakes_as_that_of_a_spring():
    """A disc in the middle of a shaft of almost no mass: k = 48 EI / l^3."""
    bar, times = jr.Material(2e11, 1.0), np.linspace(0, 0.03, 7)
    stiffness = 48 * 2e11 * np.pi * 0.02**4 / 64
    pinned = jr.FlexibleShaft(
        1.0, 0.02, bar, constraints=(jr.Constraint(0.0), jr.Constraint(1.0)), nodes=2
    )
    disc, spin = jr.Disc(0.5, MASS, 0.05, 0.01), jr.Drive(400.0, 0.0, polar=0.01, feedback=True)
    fine, start = dfx.PIDController(rtol=1e-9, atol=1e-12), jr.Whirl(1e-3, 200.0)
    run = lambda shaft: jr.run_up(
        jr.Scene(shaft, disc, jr.InternalDamping(1e-3), spin=spin),
        times,
        start=start,
        at=0.5,
        controller=fine,
    )
    one, two = run(pinned), run(jr.MasslessShaft(1.0, 0.5, stiffness))
    drop = 400 - np.asarray(two.speed)
    assert drop[-1] > 0.05
    assert np.abs(400 - np.asarray(one.speed) - drop).max() < 1e-3 * drop[-1]


@pytest.mark.slow
@pytest.mark.hard("4.4 braked to a stop")
def test_stop_and_reversal():
    fixed = jr.RigidShaft(1.0, (jr.Constraint(0.0), jr.Constraint(1.0)))
    turn = lambda drive: jr.Scene(fixed, jr.Disc(0.5, 1.0, polar=2.2354), spin=drive)
    times = np.linspace(0, 2.0, 41)
    stops = jr.Drive(600.0, -100.0, 1.57, 0.039, stops=True)
    run = jr.run_up(turn(stops), times)
    assert float(run.stopped) == pytest.approx(1.3411738400, abs=1e-8)
    late = np.asarray(times) > 1.35
    assert not np.asarray(run.speed)[late].any() and not np.asarray(run.acceleration)[late].any()
    assert np.ptp(np.asarray(run.angle)[late]) == 0
    # Dry friction alone: Omega = w0 - M t / I, then rest; the turn made is w0^2 I / 2 M.
    dry = jr.run_up(turn(jr.Drive(10.0, 0.0, coulomb=20.0)), times)
    assert float(dry.stopped) == pytest.approx(10 * 2.2354 / 20, abs=1e-9)
    assert float(dry.angle[-1]) == pytest.approx(100 * 2.2354 / 40, abs=1e-8)
    # A motor that is stronger than friction turns it round.
    back = jr.run_up(turn(jr.Drive(10.0, -30.0, coulomb=20.0)), times)
    first = 10 * 2.2354 / 50
    assert np.isinf(float(back.stopped))
    assert float(back.speed[-1]) == pytest.approx(-10 / 2.2354 * (2 - first), rel=1e-7)
    # A rotor at rest that friction holds stays there; a motor that is stronger starts it.
    held = jr.run_up(turn(jr.Drive(0.0, 15.0, coulomb=20.0)), times)
    assert float(held.stopped) == 0 and not np.asarray(held.speed).any()
    starts = jr.run_up(turn(jr.Drive(0.0, 30.0, coulomb=20.0, stops=True)), times)
    assert np.isinf(float(starts.stopped))
    assert np.allclose(starts.speed, 10 / 2.2354 * times, rtol=1e-9)
    # What has stopped for good does not turn back when the run goes on.
    later = jr.run_up(turn(stops), times, start=run.end)
    assert not np.asarray(later.speed).any() and float(later.stopped) == 0
    assert np.allclose(later.angle, run.angle[-1], rtol=1e-15)


@pytest.mark.slow
def test_derivative_of_the_time_of_a_stop():
    """t = w0 I / M_C."""
    fixed = jr.RigidShaft(1.0, (jr.Constraint(0.0), jr.Constraint(1.0)))
    scene = jr.Scene(fixed, jr.Disc(0.5, 1.0, polar=2.2354), spin=jr.Drive(10.0, 0.0, coulomb=20.0))
    stop = lambda dry: jr.run_up(scene.put({"spin.coulomb": dry}), np.linspace(0, 2, 3)).stopped
    assert float(jax.jit(jax.jacfwd(stop))(20.0)) == pytest.approx(-10 * 2.2354 / 400, rel=1e-7)


@pytest.mark.slow
def test_a_pendulum_with_dry_friction_swings_until_friction_holds_it():
    """Weight moment 0.981 N m at rest; scipy from one turning point to the next."""
    fixed = jr.RigidShaft(1.0, (jr.Constraint(0.0), jr.Constraint(1.0)))
    disc = jr.Disc(0.5, 1.0, polar=1.0, offset=0.1, exact=False)
    pendulum = lambda **kind: jr.Scene(
        fixed, disc, jr.Gravity(9.81), spin=jr.Drive(0.0, 0.0, feedback=True, **kind)
    )

    def swings(dry):
        """Times and angles of the turning points."""
        time, angle, found = 0.0, 0.0, []
        while abs(0.981 * np.cos(angle)) > dry:
            sense = -np.sign(np.cos(angle))
            law = lambda t, y, sense=sense: [y[1], -0.981 * np.cos(y[0]) - dry * sense]
            halt = lambda t, y, sense=sense: sense * y[1] if t > 1e-3 else 1.0
            halt.terminal = True
            one = solve_ivp(
                law, (0, 20), [angle, 0.0], "DOP853", events=halt, rtol=1e-12, atol=1e-14
            )
            time, angle = time + one.t[-1], one.y[0, -1]
            found.append((time, angle))
        return np.array(found)

    points = swings(0.3)
    assert len(points) > 1  # there and back
    times = np.append(0.0, points[:, 0].repeat(2) + np.tile([-1e-6, 1e-6], len(points)))
    run = jr.run_up(pendulum(coulomb=0.3), np.append(times, times[-1] + 5), controller=FINE)
    assert np.allclose(run.angle[1:-1:2], points[:, 1], rtol=0, atol=1e-8)
    assert float(run.stopped) == pytest.approx(points[-1, 0], abs=1e-7)
    assert run.angle[-1] == run.angle[-2] and run.acceleration[-1] == 0
    few = dict(controller=FINE, max_stops=0)
    with pytest.raises(RuntimeError, match="`max_stops`"):
        jr.run_up(pendulum(coulomb=0.3), np.append(times, times[-1] + 5), **few)
    # Without friction it stays where it first stops, half a turn on.
    once = jr.run_up(pendulum(stops=True), [1.0, 5.0, 6.0], controller=FINE)
    assert np.allclose(once.angle[1:], -np.pi, rtol=0, atol=1e-8)
    half = 2 * float(ellipkm1(0.5)) / np.sqrt(0.981)
    assert float(once.stopped) == pytest.approx(half, abs=1e-7)


@pytest.mark.hard("4.4 drag to the letter runs away at negative speed", outcome="refused")
def test_drag_to_the_letter_runs_away_and_odd_drag_does_not():
    fixed = jr.RigidShaft(1.0, (jr.Constraint(0.0), jr.Constraint(1.0)))
    turn = lambda drive: jr.Scene(fixed, jr.Disc(0.5, 1.0, polar=2.2354), spin=drive)
    odd = jr.run_up(
        turn(jr.Drive(-300.0, 1950.0, 1.57, 0.039, odd=True)), [0.1, 0.3], controller=FINE
    )
    assert np.allclose(odd.speed, [-124.01992032, 62.28080152], rtol=0, atol=1e-7)
    letter = turn(jr.Drive(-300.0, 1950.0, 1.57, 0.039, odd=False))
    with pytest.raises(RuntimeError, match=r"did not stay finite.*odd=True"):
        jr.run_up(letter, [0.1, 0.3])
    before = jr.run_up(letter, [0.1, 0.282039])  # runs away at 0.28204 s
    assert abs(before.speed[1]) > 1e6
    # From 50 rad/s a brake of 1950 N m turns the rotor back after 0.05 s.
    with pytest.raises(ValueError, match="turns backward from 50 rad/s under -1950 N m; give `odd"):
        jr.run_up(turn(jr.Drive(50.0, -1950.0, 1.57, 0.039)), [0.1, 0.2])
    # A traced torque cannot be refused, so the motion is not finite where it turns the rotor back.
    scene = turn(jr.Drive(50.0, 10.0, 1.57, 0.039))
    path = lambda torque: jr.run_up(scene.replace({"spin.torque": torque}), [0.1, 0.2]).displacement
    forward, backward = map(jax.jit(path), jnp.array([10.0, -1950.0]))
    assert jnp.isfinite(forward).all() and jnp.isnan(backward).all()


# === as a function


TO = np.linspace(0, 0.1, 6)


@pytest.mark.slow
def test_a_run_continues():
    scene = jeffcott(spin=jr.ConstantSpeed(150.0))
    whole = jr.run_up(scene, TO / 0.5, start=at_rest(150.0), controller=FINE)
    first = jr.run_up(scene, TO, start=at_rest(150.0), controller=FINE)
    second = jr.run_up(scene, TO, start=first.end, controller=FINE)
    assert np.allclose(second.displacement[-1], whole.displacement[-1], rtol=0, atol=1e-12)
    assert float(second.angle[-1]) == pytest.approx(float(whole.angle[-1]), rel=1e-12)


@pytest.mark.slow
def test_a_run_goes_on_at_another_speed():
    """Displacement and velocity in fixed axes are continuous; against scipy at both speeds."""
    times = TO

    def at(speed, begin):
        def own(t, q, v):
            push = MASS * OFFSET * speed**2 * np.exp(1j * (begin + speed * t))
            return (np.array([push.real, push.imag]) - DAMPING * v - STIFFNESS * q) / MASS

        return own

    one, two = jeffcott(spin=jr.ConstantSpeed(100.0)), jeffcott(spin=jr.ConstantSpeed(150.0))
    first = jr.run_up(one, times, start=at_rest(100.0), controller=FINE)
    second = jr.run_up(two, times, start=first.end, controller=FINE)
    q, v = integrate(at(100.0, 0.0), times)
    q, v = integrate(at(150.0, 10.0), times, start=np.concatenate([q[-1], v[-1]]))
    z, rate = np.asarray(second.displacement[:, 0]), np.asarray(second.velocity[:, 0])
    assert np.abs(z - q @ [1, 1j]).max() < 1e-9 * np.abs(z).max()
    assert np.abs(rate - v @ [1, 1j]).max() < 1e-9 * np.abs(rate).max()
    assert np.allclose(second.velocity[0], first.velocity[-1], rtol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize(
    "spin",
    [
        jr.SpeedProfile([0.0, 0.15, 0.4], [100.0, 220.0, 150.0]),
        jr.Drive(100.0, 3.0, 0.01, 1e-5, polar=0.02),
        jr.Drive(100.0, 3.0, 0.01, 1e-5, polar=0.02, odd=True),
    ],
    ids=["profile", "closed", "free"],
)
def test_a_run_goes_on_at_a_speed_that_varies(spin):
    """A run in parts equals one in a single piece; the speed is compared with scipy."""
    scene = jeffcott(spin=spin)
    whole = jr.run_up(scene, [0.1, 0.2, 0.3], start=at_rest(100.0), controller=FINE)
    first = jr.run_up(scene, [0.02, 0.05, 0.1], start=at_rest(100.0), controller=FINE)
    second = jr.run_up(scene, [0.05, 0.1, 0.2], start=first.end, controller=FINE)
    assert np.allclose(second.displacement[1:], whole.displacement[1:], rtol=0, atol=1e-11)
    if isinstance(spin, jr.SpeedProfile):
        speeds = np.interp([0.1, 0.2, 0.3], [0.0, 0.15, 0.4], [100.0, 220.0, 150.0])
    else:
        law = lambda t, w: (3.0 - 0.01 * w - 1e-5 * w**2) / 0.02
        speeds = solve_ivp(law, (0, 0.3), [100.0], "DOP853", [0.1, 0.2, 0.3], rtol=1e-12).y[0]
    assert np.allclose(whole.speed, speeds, rtol=1e-9)
    assert np.allclose(second.speed[1:], speeds[1:], rtol=1e-8)
    assert np.allclose(second.angle[1:], whole.angle[1:], rtol=1e-9)


@pytest.mark.slow
def test_a_profile_that_a_run_cannot_go_on_in_is_refused():
    rising = jeffcott(spin=jr.SpeedProfile.ramp(100.0, 200.0, 0.1))
    first = jr.run_up(rising, [0.0, 0.05], start=at_rest(100.0))
    scene = jeffcott(spin=jr.SpeedProfile.ramp(150.0, 50.0, 0.1))
    with pytest.raises(ValueError, match=r"150 rad/s, but at 0.05 s it is 100 rad/s.*`time`"):
        jr.run_up(scene, [0.0, 0.1], start=first.end)
    again = dataclasses.replace(first.end, time=0.0)
    run = jr.run_up(scene, [0.0, 0.1], start=again)
    assert np.allclose(run.speed, [150.0, 50.0]) and float(run.end.time) == 0.1


@pytest.mark.long
def test_gradient_and_lanes():
    times = np.linspace(0, 0.4, 5)
    scene = jeffcott(spin=jr.SpeedProfile.ramp(150.0, 250.0, 0.4))
    put = lambda damping: scene.put({"disc_damping.translational": damping})

    def radius(damping):
        return jnp.abs(jr.run_up(put(damping), times, controller=FINE).displacement[2, 0])

    lanes = jax.jit(jax.vmap(lambda damping: jax.jvp(radius, (damping,), (jnp.ones(()),))))
    step = 1e-3
    values, slopes = lanes(jnp.array([DAMPING, DAMPING + step, DAMPING - step, 6.0]))
    slope = (values[1] - values[2]) / (2 * step)
    assert float(slopes[0]) == pytest.approx(float(slope), rel=1e-6)
    for damping, value in ((DAMPING, values[0]), (6.0, values[3])):
        alone = jr.run_up(put(damping), np.linspace(0, 0.4, 121), controller=FINE)
        assert float(value) == pytest.approx(float(np.abs(alone.displacement[60, 0])), rel=1e-7)


@pytest.mark.parametrize("times", [[0.0], [0.2, 0.1], [-0.1, 0.1], [[0.0, 1.0]]])
def test_times_are_checked(times):
    with pytest.raises(ValueError, match=r"`times \[s\]` must be two or more ascending"):
        jr.run_up(jeffcott(spin=jr.ConstantSpeed(1.0)), times)


def test_refusals():
    scene = jeffcott(spin=jr.Drive(1.0, 1.0), polar=0.0)
    with pytest.raises(ValueError, match=r"positive moment of inertia, but that of the scene is 0"):
        jr.run_up(scene, [0.0, 1.0])
    with pytest.raises(ValueError, match=r"the rotor may come to rest under its Drive"):
        driven = jeffcott(spin=jr.Drive(1.0, 1.0, feedback=True, stops=True))
        jr.run_up(driven, [0.0, 1.0], solver=jr.Exponential())
    lost = jeffcott(jr.HystereticDamping(0.1), spin=jr.ConstantSpeed(1.0))
    with pytest.raises(ValueError, match=r"harmonic motions only"):
        jr.run_up(lost, [0.0, 1.0])
