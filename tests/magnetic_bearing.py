"""Numbers and machines of magnetic bearings, for tests in time, of static positions and of loops."""

import diffrax as dfx
import jax.numpy as jnp

import jaxrotor as jr


CONSTANT, BIAS, GAP, MASS, EARTH = 4e-6, 3.0, 4e-4, 10.0, 9.81
KP, KI, KD, FILTER, LAG = 15000.0, 6e5, 15.0, 1e-4, 1.5e-4
PER_AMPERE, NEGATIVE = 300.0, 2.25e6  # k_i [N/A], k_s [N/m] about the centre
PID = {"kp": KP, "ki": KI, "kd": KD, "filter": FILTER, "lag": LAG, "limit": BIAS}
TIGHT = {
    "solver": dfx.Dopri8(),
    "controller": dfx.PIDController(rtol=1e-13, atol=1e-17),
}
RING = {"gap": 1.5e-4, "stiffness": 5e7, "damping": 800.0}


def bearing(**values):
    """The bearing A1; a value of None leaves a part out."""
    given = {"at": 0.5, "constant": CONSTANT, "bias": BIAS, "gap": GAP} | PID
    return jr.MagneticBearing(**(given | values))


def machine(*parts, speed=0.0, weight=EARTH, mass=MASS, **values):
    """A mass that the bearing holds alone: the stiffness of the shaft is of no account."""
    pull = [jr.Gravity(weight)] if weight else []
    shaft = jr.MasslessShaft(1.0, 0.5, 1e-6)
    spin = jr.ConstantSpeed(speed)
    return jr.Scene(shaft, jr.Disc(0.5, mass), *pull, bearing(**values), *parts, spin=spin)


def launch(z=0.0, velocity=0.0, states=None):
    """Start from a complex place [um] and velocity [um/ms], and states [A]."""
    q, v = jnp.array([1e-6 * z + 0j]), jnp.array([1e-3 * velocity + 0j])
    return jr.Launch(jr.Continued(q, v), states=states)


def free_shaft(sensor, other=None, nodes="auto"):
    """Free steel shaft of a metre in two linear bearings about their centres, without rotary inertia.

    Sensors are at `sensor` from the left end, and at `other`, by default the same, from the right one.
    """
    current, gains = 1.5, {"kp": 7000.0, "ki": 2e5, "kd": 10.0, "filter": FILTER, "lag": LAG}
    factors = 4 * CONSTANT * current / GAP**2, 4 * CONSTANT * current**2 / GAP**3
    right = 1.0 - (sensor if other is None else other)
    bearings = [
        jr.LinearMagneticBearing(at, *factors, **gains, sensor=seen, name=name)
        for at, seen, name in ((0.1, sensor, "left"), (0.9, right, "right"))
    ]
    steel = jr.Material(2.1e11, 7850.0)
    shaft = jr.FlexibleShaft(1.0, 0.04, steel, rotary_inertia=False, nodes=nodes)
    return jr.Scene(shaft, *bearings, spin=jr.ConstantSpeed(0.0))
