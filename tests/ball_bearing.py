"""A mass in a rolling bearing of eight balls, for tests in time and of static positions, in um and ms."""

import diffrax as dfx
import jax.numpy as jnp
import numpy as np

import jaxrotor as jr


BALLS, HERTZ, GAP, MASS, DAMPING, WEIGHT = 8, 13.34e9, 20e-6, 20.0, 200.0, 196.0
INNER, OUTER = 40.1e-3, 63.9e-3  # JIS 6306 after Fukata (1985), as its races are printed
SHARE = INNER / (INNER + OUTER)
TIGHT = {
    "solver": dfx.Dopri8(),
    "controller": dfx.PIDController(rtol=1e-13, atol=1e-17),
}


def bearing(**values):
    """The bearing, whose ball 0 is at the bottom at the angle 0 unless an `angle` is given."""
    given = {"at": 0.5, "balls": BALLS, "stiffness": HERTZ, "gap": GAP, "angle": -np.pi / 2}
    return jr.RollingBearing(**(given | {"inner_radius": INNER, "outer_radius": OUTER} | values))


def machine(speed=900.0, eccentricity=0.0, damping=DAMPING, weight=WEIGHT, spin=None, **values):
    """A mass that the bearing holds alone: the stiffness of the shaft is of no account."""
    return jr.Scene(
        jr.MasslessShaft(1.0, 0.5, 1e-6),
        jr.Disc(0.5, MASS),
        jr.DiscDamping(0.5, damping),
        jr.Gravity(weight / MASS),
        jr.Unbalance(0.5, MASS, eccentricity),
        bearing(**values),
        spin=jr.ConstantSpeed(speed) if spin is None else spin,
    )


def launch(x, y, vx=0.0, vy=0.0):
    """Start from a place [um] and a velocity [um/ms]."""
    q, velocity = jnp.array([1e-6 * (x + 1j * y)]), jnp.array([1e-3 * (vx + 1j * vy)])
    return jr.Launch(jr.Continued(q, velocity))


def end_of(run):
    """x, y [um] and their velocities [um/ms] at the end."""
    z, v = 1e6 * run.displacement[-1, 0], 1e3 * run.velocity[-1, 0]
    return jnp.array([z.real, z.imag, v.real, v.imag])


# === orbits, by DOP853 and by collocation of order 12

PASSAGES = {  # speed: start of the orbit, multipliers
    700.0: (
        (0.001656286, -25.951911349, 0.515109919, -0.002461314),
        (0.300027034 + 0.938777875j, -0.213764626 + 0.962093969j),
    ),
    900.0: (
        (0.000709655, -26.006720188, 0.391496279, -0.000488947),
        (0.176418520 + 0.972881291j, -0.712978584 + 0.685042363j),
    ),
    1050.0: (
        (0.000434401, -26.017484319, 0.332186592, -0.000254097),
        (0.366899031 + 0.919876407j, -0.976038623 + 0.167738215j),
    ),
}
GEAR = {"inner_radius": 3.0, "outer_radius": 5.0}  # three balls pass in a turn
ONCE = (-0.2924594435, -9.8298316289, 1.4670646792, -0.2323204283)
ONCE_MULTIPLIERS = 0.127091544 + 0.437866778j, -0.275409695 + 0.363358055j
