"""Hard cases of the ball balancer beside its sheet: many balls, a speed that varies, an unstable rest."""

import diffrax as dfx
import numpy as np
import pytest
from balancer_model import MACHINE, Model
from ball_machine import M1, M2, PSI0, RACE, D, balancer, launch, run, s_of
from scipy.integrate import solve_ivp

import jaxrotor as jr


FINE = dfx.PIDController(rtol=1e-11, atol=1e-14)
MOUNT, FIRST, SECOND = 1.40, 3.50, 2.24  # set R


def crowd(n, imbalance):
    """Set R with n balls a row that weigh as much as its two and three; drag by the ball's mass."""
    one, two = 2 * M1 / n, 3 * M2 / n
    drag = FIRST / M1 * one, SECOND / M2 * two
    scene = jr.Scene(
        jr.RigidShaft(D, (jr.Constraint(0.0),)),
        jr.Disc(0.0, 1.0, 0.07 - D**2 * n * (one + two), 0.014),
        jr.Support(0.0, 0.0, angular_stiffness=700.0, angular_damping=MOUNT),
        jr.Unbalance(D, 1.0, imbalance * one * RACE),
        jr.BallBalancer(D, one, RACE, drag[0], places=n),
        jr.BallBalancer(D, two, RACE, drag[1], places=n),
        spin=jr.ConstantSpeed(200.0),
    )
    machine = MACHINE | dict(unbalance=imbalance * one * RACE, balls=(n, n), drag=list(drag))
    return scene, machine | dict(ball_mass=[one, two], speed=200.0, damping=MOUNT)


@pytest.mark.slow
@pytest.mark.hard("5.10 many balls")
@pytest.mark.parametrize("n", [5, 100])
def test_many_balls(n, record_property):
    """Against the dense mass matrix in fixed axes, five units of time on."""
    scene, machine = crowd(n, 0.3 * n)
    rows = [np.linspace(0.3, 2.0, n), np.linspace(1.0, 5.0, n)]
    model = Model(machine)
    end = model.run(model.at(rows), 5.0, rtol=1e-10, atol=1e-12).y[:, -1]
    found = jr.run_up(
        scene, [0.0, 0.05], start=launch(rows), at=D, solver=dfx.Dopri8(), controller=FINE
    )
    delta = 1j * complex(found.instants.r[-1, 0]) / model.tilt
    angles = np.concatenate([row.angle[-1] for row in found.balls])
    error = max(
        abs(delta - (end[0] + 1j * end[1])) / abs(delta), *np.abs(angles - end[2:][: 2 * n])
    )
    record_property("measured", f"{2 * n} balls: {error:.0e}")
    assert error < 1e-8


@pytest.mark.slow
@pytest.mark.hard("5.12 balls on a rotor that speeds up")
def test_balls_on_a_rotor_that_speeds_up(record_property):
    """From 100 rad/s by 600 rad/s^2 through the critical speed, in fixed axes with a dense mass matrix.

    The ball's own rotation brings `(k - 1) m R Omega.`; the torque of the drive acts along the axis of
    the body, so that `C_p Omega.` does not appear beside the tilt (fixed axis: 2 % more tilt).
    """
    polar, stiffness, unbalance, rolling, first, gain = 0.014, 700.0, 2.4e-3, 1.4, 100.0, 600.0
    mass, drag = np.repeat([M1, M2], [2, 3]), np.repeat([FIRST, SECOND], [2, 3])

    def rates(t, y):
        speed, (q, v) = first + gain * t, np.split(y, 2)
        phi, dphi = q[2:], v[2:]
        c, s = np.cos(phi), np.sin(phi)
        big = np.diag(np.append([0.07, 0.07], mass * rolling * RACE))
        big[0, 2:], big[1, 2:] = -D * mass * RACE * c, -D * mass * RACE * s
        big[2:, 0], big[2:, 1] = -mass * D * c, -mass * D * s
        turned = np.exp(1j * (first * t + gain * t**2 / 2))
        thrown = unbalance * (1j * gain - speed**2) * turned
        thrown -= np.sum(mass * RACE * dphi**2 * np.exp(1j * phi))
        force = -MOUNT * v[:2] - stiffness * q[:2] + speed * polar * np.array([-v[1], v[0]])
        force += D * np.array([thrown.imag, -thrown.real])
        along = -drag * RACE * (dphi - speed) + (rolling - 1) * mass * RACE * gain
        return np.concatenate([v, np.linalg.solve(big, np.concatenate([force, along]))])

    times = [0.05, 0.1, 0.2]
    start = np.concatenate([[0, 0], *PSI0, [0, 0], np.full(5, first)])
    own = solve_ivp(rates, (0, 0.2), start, "DOP853", times, rtol=1e-11, atol=1e-13).y
    spin = jr.SpeedProfile.ramp(first, first + gain, 1.0)
    scene = jr.Scene(balancer().shaft, *balancer().effects, spin=spin)
    found = jr.run_up(scene, times, start=launch(), at=D, solver=dfx.Dopri8(), controller=FINE)
    tilt, known = 1j * np.asarray(found.displacement[:, 0]) / D, own[0] + 1j * own[1]
    angles = np.concatenate([row.angle for row in found.balls], axis=1)
    error = max(abs(tilt - known)) / max(abs(known))
    record_property("measured", f"relative error of the tilt {error:.0e}")
    assert error < 1e-8
    np.testing.assert_allclose(angles + found.angle[:, None], own[2:7].T, rtol=0, atol=1e-9)


@pytest.mark.slow
@pytest.mark.hard("5.8 exactly balanced where balance is unstable")
def test_an_unstable_balance_stays_until_it_is_disturbed():
    """Set R at om 0.9, balls at rest where they balance."""
    scene = balancer(om=0.9)
    groups, _ = jr.balancer.groups_of(scene)
    balanced = jr.balancer.nearest_balanced(groups, PSI0)
    assert float(jr.balancer.growth_rate(groups, jr.balancer.second_harmonics(balanced))) > 0.01
    times = [20, 400]
    still = np.abs(s_of(run(scene, times, launch(balanced))))
    moved = np.abs(s_of(run(scene, times, launch([row + 1e-3 for row in balanced]))))
    assert still[0] < 1e-13 and moved[0] > 1e-4 and moved[1] > 0.1
