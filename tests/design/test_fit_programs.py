"""Programs of fits: a second fit with other numbers compiles none; starts of several time records."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import jaxrotor as jr


K, M, C, E, PHASE = 8e5, 5.0, 60.0, 1e-4, 0.4  # [SI] of a disc in the middle of a massless shaft
STOP, RIM = 2e6, 0.1  # stiffness [N/m] of a stop and radius [m] of the rim that it meets
SPEED, SPEEDS = 380.0, np.linspace(350.0, 450.0, 20)
ANGLE = 2 * np.pi * np.arange(32) / 32
TURNING = {"unbalance.eccentricity": (1e-6, 1e-2), "unbalance.phase": None}
COMPILED = []  # events of compilation
jax.monitoring.register_event_duration_secs_listener(
    lambda event, *_, **__: (
        COMPILED.append(event) if event == "/jax/core/compile/backend_compile_duration" else None
    )
)


def rotor(damping=C, eccentricity=E, phase=PHASE, speed=SPEED, parts=()):
    disc = jr.Disc(0.5, M), jr.DiscDamping(0.5, damping)
    unbalance = jr.Unbalance(0.5, M, eccentricity=eccentricity, phase=phase)
    spin = jr.ConstantSpeed(speed)
    return jr.Scene(jr.MasslessShaft(1.0, 0.5, K), *disc, unbalance, *parts, spin=spin)


def whirl(speed, damping, eccentricity, phase):
    """`z = m e Omega^2 exp(i phase) / (k - m Omega^2 + i c Omega)`."""
    load = M * eccentricity * speed**2 * np.exp(1j * phase)
    return load / (K - M * speed**2 + 1j * damping * speed)


def noise(count, size=2e-6, seed=0):
    two = np.random.default_rng(seed).normal(scale=size, size=(2, count))
    return two[0] + 1j * two[1]


def decay(times, radius, turn, damping=C):
    """`z = r exp(i turn) exp(-d t) (cos w t + d / w sin w t)`: the disc let go from rest."""
    d = damping / M / 2
    w = np.sqrt(K / M - d**2)
    fall = np.exp(-d * times) * (np.cos(w * times) + d / w * np.sin(w * times))
    return radius * np.exp(1j * turn) * fall


def of_response(i):
    """Guess, record, parameters and their true values: other speeds, other damping."""
    speeds, damping = SPEEDS + i, C + 5 * i
    record = jr.ResponseRecord(whirl(speeds, damping, E, PHASE) + noise(20), speeds)
    where = {"disc_damping.translational": (10.0, 300.0), **TURNING}
    return rotor(damping + 10, 2e-4, 0.1 * i), record, where, (damping, E, PHASE)


def of_orbit(i):
    """Other speed of the rotor, other phase."""
    speed, phase = SPEED + i, PHASE + 0.1 * i
    record = jr.OrbitRecord(whirl(speed, C, E, phase) * np.exp(1j * ANGLE) + noise(32))
    return rotor(phase=0.1, speed=speed), record, TURNING, (E, phase)


def of_spectrum(i):
    """Weight is order 0; other orders, other eccentricity and gravity."""
    size, gravity = E * (1 + 0.2 * i), 9.8 + i
    line = whirl(SPEED, C, size, PHASE)
    amplitude = np.array([-1j * M * gravity / K, line, 0j]) + noise(3)
    record = jr.SpectrumRecord(amplitude, [0, 1, -1 - i])
    guess = rotor(phase=0.1, parts=[jr.Gravity(gravity)])
    return guess, record, TURNING, (size, PHASE)


def of_time(i):
    """Other start, other bounds, other damping."""
    times, damping = np.linspace(0.0, 4.0, 65) * 2 * np.pi / SPEED, C + 5 * i
    turn, radius = 0.3 * i, 1e-3 + 1e-4 * i
    start = jr.Whirl(radius * 1.1, angle=turn)
    seen = decay(times, radius, turn, damping) + noise(65)
    record = jr.TimeRecord(seen, 4, start=start, substeps=1)
    where = {
        "disc_damping.translational": (10.0, 300.0 + i),
        "start.shaft.radius": (1e-4, 1e-2 + 1e-3 * i),
    }
    return rotor(damping + 10, eccentricity=0.0), record, where, (damping, radius)


def of_contact(i):
    """A disc rubs on a stop, as SciPy integrates it: other speed, start, gap, friction and bounds."""
    speed, gap, friction, turn = SPEED + 10 * i, 1e-3 - 1e-4 * i, 0.2 + 0.1 * i, 0.6 - 0.1 * i
    stop = lambda gap, friction: jr.Limiter(0.5, 0.0, gap, STOP, friction=friction, rim_radius=RIM)

    def rate(t, state):
        x, y, vx, vy = state
        normal = STOP * max(x - gap, 0.0)
        along = friction * normal * np.sign(speed * RIM + vy)
        return vx, vy, -(K * x + C * vx + normal) / M, -(K * y + C * vy + along) / M

    times = np.linspace(0.0, 2.0, 33) * 2 * np.pi / speed
    first = [2e-3 * np.cos(turn), 2e-3 * np.sin(turn), 0.0, 0.0]
    fine = {"method": "DOP853", "rtol": 1e-10, "atol": 1e-13, "max_step": 5e-4}
    x, y = solve_ivp(rate, (0.0, times[-1]), first, t_eval=times, **fine).y[:2]
    located = jr.Exponential(4, located=True, basis="modal")  # compiles in two thirds of the time
    run = {"start": jr.Whirl(2e-3, angle=turn), "substeps": 2, "solver": located}
    record = jr.TimeRecord(x + 1j * y + noise(33), 2, **run)
    where = {"limiter.gap": (5e-4, 2e-3 + 1e-3 * i), "limiter.friction": (0.01, 0.9)}
    guess = rotor(eccentricity=0.0, speed=speed, parts=[stop(1.1 * gap, 0.25)])
    return guess, record, where, (gap, friction)


@pytest.mark.parametrize(
    "case",
    [
        of_response,
        of_orbit,
        of_spectrum,
        of_time,
        pytest.param(of_contact, marks=pytest.mark.slow),
    ],
)
def test_a_second_fit_compiles_nothing(case):
    """Its program takes the numbers of scene, record and bounds; results are right for both."""
    for i in range(2):
        scene, record, where, true = case(i)
        COMPILED.clear()
        found = jr.fit(scene, record, where, steps=50 + i, progress=False)
        assert not (i and COMPILED)
        values = dict(zip(where, true, strict=True))
        assert float(found.uncertainty.distance(values)) < 20.0  # a chi-square of 2 or 3 degrees
    jax.jit(lambda x: jnp.sin(x) + 1.7182)(jnp.zeros(11))
    assert COMPILED  # the list is filled by compilations


# === what decides the structure is compiled into the program


def test_an_isotropic_support_stays_so_beside_a_parameter():
    """Else it would have axes that stand still, beside those of the shaft that turn."""
    shaft = jr.MasslessShaft(1.0, 0.5, K, anisotropy=0.1, ends="elastic")
    at = lambda stiffness: jr.Scene(
        shaft,
        jr.Disc(0.5, M),
        jr.Unbalance(0.5, M, eccentricity=E),
        *[jr.Support(x, stiffness, damping=200.0, anisotropy=0.0) for x in (0.0, 1.0)],
        spin=jr.ConstantSpeed(300.0),
    )
    speeds = np.linspace(200.0, 250.0, 12)
    seen = np.asarray(jr.unbalance_response(at(2e6), speeds).forward)
    record = jr.ResponseRecord(seen * (1 + 1e-3 * noise(12, 1.0)[:, None]), speeds)
    found = jr.fit(at(1.7e6), record, {"supports.stiffness": (5e5, 1e7)}, progress=False)
    low, high = found.intervals(0.999)["supports.stiffness"]
    assert low < 2e6 < high and high - low < 2e5


# === starts of several time records


def test_two_time_records_have_starts_of_their_own():
    """Two decays of one rotor, and between them its response to a force, which has no start."""
    times = np.linspace(0.0, 4.0, 65) * 2 * np.pi / SPEED
    true = {"starts.0.shaft.radius": 1e-3, "starts.1.shaft.radius": 3e-3}
    shape = {"substeps": 1, "start": jr.Whirl(2e-3)}
    first, second = (
        jr.TimeRecord(decay(times, radius, 0.0) + noise(65, seed=seed), 4, **shape)
        for seed, radius in enumerate(true.values())
    )
    where = {**dict.fromkeys(true, (1e-4, 1e-2)), "disc_damping.translational": (10.0, 300.0)}
    true |= {"disc_damping.translational": C}
    force = jr.HarmonicForce(0.5, amplitude=20.0, whirl="forward")
    quiet = rotor(70.0, eccentricity=0.0)
    pushed = 20.0 / (K - M * SPEEDS**2 + 1j * C * SPEEDS)
    still = jr.ResponseRecord(pushed + noise(20, 1e-6), SPEEDS, force=force)
    found = jr.fit(quiet, [first, still, second], where, progress=False)
    assert float(found.uncertainty.distance(true)) < 20.0
    assert [float(start.radius) for start in found.starts] == [
        float(found.values[path]) for path in list(true)[:2]
    ]
    assert float(found.start.radius) == float(found.starts[0].radius)
    assert len(found.model.effects) == 5 and len(found.scene.effects) == 3
