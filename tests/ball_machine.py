"""The auto-balancer of the sheet in SI, its reference sets and runs, and its equations by numpy alone."""

import diffrax as dfx
import jax.numpy as jnp
import numpy as np

import jaxrotor as jr


D, RACE, M1, M2, TILT = 0.14, 0.06, 0.025, 0.020, 0.003

SETS = {"R": (1.40, 3.50, 2.24), "L": (0.35, 0.70, 0.448), "free": (0.0, 0.0, 0.0)}

PSI0 = (np.array([0.3, 2.0]), np.array([4.0, 5.0, 1.0]))

FINE = dfx.PIDController(rtol=1e-12, atol=1e-15)


def balancer(case="R", om=2.0, imbalance=1.6, places=(2, 3), polar=0.014):
    """Sets R and L of the source in SI; times are in units of 10 ms, rates of 100 rad/s."""
    mount, first, second = SETS[case]
    balls = D**2 * (places[0] * M1 + places[1] * M2)
    return jr.Scene(
        jr.RigidShaft(D, (jr.Constraint(0.0),)),
        jr.Disc(0.0, 1.0, 0.07 - balls, polar),
        jr.Support(0.0, 0.0, angular_stiffness=700.0, angular_damping=mount),
        jr.Unbalance(D, 1.0, imbalance * 1.5e-3),
        jr.BallBalancer(D, M1, RACE, first, places=places[0]),
        jr.BallBalancer(D, M2, RACE, second, places=places[1]),
        spin=jr.ConstantSpeed(100.0 * om),
    )


def launch(angles=PSI0, rates=0.0):
    """The shaft at rest, by coordinates as in any other state: one program serves all starts."""
    balls = (jr.Balls(jnp.asarray(a, float), jnp.full(len(a), rates)) for a in angles)
    still = jnp.zeros(1) + 0j
    return jr.Launch(jr.Continued(still, still), balls=tuple(balls))


def run(scene, tau, start=None, fine=True, **options):
    controller = FINE if fine else None
    start = launch() if start is None else start
    times = np.asarray(tau, float) / 100
    return jr.run_up(
        scene, times, start=start, at=D, solver=dfx.Dopri8(), controller=controller, **options
    )


def s_of(result):
    return np.asarray(result.imbalance) / 1.5e-3


def delta_of(result):
    return 1j * np.asarray(result.instants.r[:, 0]) / TILT
