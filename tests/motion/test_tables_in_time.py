"""Motion in supports whose coefficients are tables over speed, against SciPy's integration."""

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import PchipInterpolator

import jaxrotor as jr


MASS, ECCENTRICITY, PHASE = 2.0, 1e-4, 0.3
NODES = np.array([0.0, 300.0, 600.0, 1200.0])
KXX = np.array([8e5, 6e5, 9e5, 1.2e6])
KYY = np.array([9e5, 8e5, 1e6, 1.2e6])
KXY = np.array([0.0, 1e5, 2e5, 2.5e5])
CXX, CYY = np.array([900.0, 700.0, 650.0, 600.0]), 800.0
TABLE = PchipInterpolator(NODES, np.stack([KXX, KYY, KXY, CXX]), axis=1)
TIMES = np.linspace(0.0, 0.05, 11)


def rotor(spin):
    """A rigid disc midway between two equal bearings."""
    bearings = [
        jr.Support(
            at,
            kxx=KXX / 2,
            kxy=KXY / 2,
            kyx=-KXY / 2,
            kyy=KYY / 2,
            cxx=CXX / 2,
            cyy=CYY / 2,
            speeds=NODES,
        )
        for at in (0.0, 1.0)
    ]
    disc, heavy = jr.Disc(0.5, MASS, 0.1, 0.0), jr.Unbalance(0.5, MASS, ECCENTRICITY, PHASE)
    return jr.Scene(jr.RigidShaft(1.0, constraints=()), disc, heavy, *bearings, spin=spin)


def matrices(speed):
    """`C` and `K` of both bearings at a speed."""
    xx, yy, xy, along = TABLE(speed)
    return np.diag([along, CYY]), np.array([[xx, xy], [-xy, yy]])


def displacement(start, rate):
    """Motion from rest at the speed `start + rate t`."""

    def field(time, state):
        speed, angle = start + rate * time, start * time + rate * time**2 / 2
        damping, stiffness = matrices(speed)
        push = (speed**2 - 1j * rate) * ECCENTRICITY * np.exp(1j * (angle + PHASE))
        inner = (damping @ state[2:] + stiffness @ state[:2]) / MASS
        return np.concatenate([state[2:], np.array([push.real, push.imag]) - inner])

    options = {"t_eval": TIMES, "method": "DOP853", "rtol": 1e-11, "atol": 1e-16}
    x, y, *_ = solve_ivp(field, (0.0, TIMES[-1]), np.zeros(4), **options).y
    return x + 1j * y


@pytest.mark.slow
def test_run_up_takes_the_coefficients_of_its_speed():
    run = jr.run_up(rotor(jr.SpeedProfile.ramp(200.0, 1000.0, TIMES[-1])), TIMES, at=0.5)
    expected = displacement(200.0, 16000.0)
    error = np.abs(np.asarray(run.displacement)[:, 0] - expected).max()
    assert error < 3e-6 * np.abs(expected).max()
    damping, stiffness = matrices(1000.0)
    q, v = (complex(part[-1, 0]) for part in (run.displacement, run.velocity))
    x, y = -stiffness @ [q.real, q.imag] - damping @ [v.real, v.imag]
    force = np.asarray(jr.reactions(run).force)[-1]
    np.testing.assert_allclose(force, (x + 1j * y) / 2, rtol=1e-9)


@pytest.mark.slow
def test_motion_at_constant_speed_and_lanes_each_with_its_own():
    """The steady amplitudes of a sweep are those of the response at each speed."""
    run = jr.simulate(rotor(jr.ConstantSpeed(500.0)), times=TIMES, at=0.5)
    expected = displacement(500.0, 0.0)
    error = np.abs(np.asarray(run.displacement)[:, 0] - expected).max()
    assert error < 3e-6 * np.abs(expected).max()
    speeds = [220.0, 500.0, 1150.0]
    scene = rotor(jr.ConstantSpeed(500.0))
    lanes = jr.sweep(
        scene, {"spin.speed": speeds}, settle=100, keep=2, steps_per_revolution=64, at=0.5
    )
    assert not lanes.status.values.any()
    largest = []
    for speed in speeds:
        damping, stiffness = matrices(speed)
        dynamic = stiffness + 1j * speed * damping - MASS * speed**2 * np.eye(2)
        x, y = np.linalg.solve(dynamic, MASS * ECCENTRICITY * speed**2 * np.array([1, -1j]))
        largest.append((abs(x + 1j * y) + abs(x - 1j * y)) / 2)
    assert lanes.radius_max.values.tolist() == pytest.approx(largest, rel=3e-3)  # at samples
    response = jr.unbalance_response(scene, jnp.asarray(speeds), 0.5)
    assert response.major[:, 0].tolist() == pytest.approx(largest, rel=1e-10)


@pytest.mark.slow
def test_lanes_along_times():
    """Lanes at constant speeds, by exponential steps, and one that runs up, by a diffrax solver."""
    speeds, along = (
        [300.0, 500.0, 1100.0],
        {"times": TIMES, "observe": [jr.observe.Peak()], "at": 0.5},
    )
    lanes = jr.sweep(rotor(jr.ConstantSpeed(500.0)), {"spin.speed": speeds}, **along)
    expected = [np.abs(displacement(speed, 0.0)[1:]).max() for speed in speeds]
    assert lanes.peak.values.tolist() == pytest.approx(expected, rel=1e-5)
    ramp = rotor(jr.SpeedProfile.ramp(200.0, 1000.0, TIMES[-1]))
    lanes = jr.sweep(ramp, {"unbalance.eccentricity": [ECCENTRICITY]}, **along)
    expected = np.abs(displacement(200.0, 16000.0)[1:]).max()
    assert lanes.peak.values.tolist() == pytest.approx([expected], rel=3e-6)


@pytest.mark.slow
@pytest.mark.hard("8.8 a run-up that leaves the tables of coefficients", outcome="refused")
def test_a_run_that_leaves_the_tables_is_refused():
    said = "from 0 to 1200 rad/s, but coefficients are needed at 12.*extend the tables"
    for spin in (
        jr.SpeedProfile.ramp(200.0, 1500.0, TIMES[-1]),
        jr.Drive(1100.0, torque=100.0, polar=0.01),
    ):
        with pytest.raises(ValueError, match=said):
            jr.run_up(rotor(spin), TIMES)


def test_exponential_steps_do_not_take_tables_at_a_speed_that_varies():
    scene = rotor(jr.SpeedProfile.ramp(200.0, 1000.0, TIMES[-1]))
    with pytest.raises(ValueError, match="tables over the speed, which varies; leave `solver` out"):
        jr.run_up(scene, TIMES, solver=jr.Exponential())
