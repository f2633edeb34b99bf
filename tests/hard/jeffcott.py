"""The simplest rotor, a disc on a massless shaft, and what SciPy makes of any rotor in its stops."""

import cmath

import jax.numpy as jnp
import numpy as np
from scipy.integrate import solve_ivp

import jaxrotor as jr
from jaxrotor.equations.system import assemble


AT = 0.5


def jeffcott(*effects, speed=0.0, mass=1.0, stiffness=1.0):
    """`mass z.. + stiffness z = forces of the effects`, one complex coordinate."""
    shaft = jr.MasslessShaft(1.0, AT, stiffness)
    return jr.Scene(shaft, jr.Disc(AT, mass), *effects, spin=jr.ConstantSpeed(speed))


def state(z: complex, v: complex) -> jr.Continued:
    """Displacement and velocity to start from."""
    return jr.Continued(jnp.asarray([z + 0j]), jnp.asarray([v + 0j]))


def path(response: jr.TimeHistory) -> tuple[np.ndarray, np.ndarray]:
    """Displacement and velocity at the observed station."""
    return np.asarray(response.displacement[:, 0]), np.asarray(response.velocity[:, 0])


def stop_force(scene: jr.Scene):
    """Force of all stops of a scene on the shaft by displacement and velocity, from the written law."""
    speed, stops = float(scene.spin.speed), []
    for one in scene.of(jr.Limiter):
        names = ("gap", "stiffness", "damping", "friction", "rim_radius")
        slip = None if one.slip is None else float(one.slip)
        numbers = [float(getattr(one, name)) for name in names]
        stops.append((cmath.exp(1j * float(one.angle)), slip, *numbers))

    def force(z, v):
        total = 0j
        for out, slip, gap, stiffness, damping, friction, rim_radius in stops:
            local, rate = z / out, v / out
            depth = local.real - gap
            normal = stiffness * depth + damping * rate.real
            if depth <= 0 or normal <= 0:
                continue
            u = speed * rim_radius + rate.imag
            if slip is None:
                direction = np.sign(u)
            else:
                u = min(max(u / slip, -1.0), 1.0)
                direction = u * (15 - 10 * u**2 + 3 * u**4) / 8
            total -= normal * (1 + 1j * friction * direction) * out
        return total

    return force


def by_scipy(scene: jr.Scene, q, v, times, force=None, method="DOP853", tol=1e-11):
    """Displacement at the stops' station: SciPy on the library's linear blocks and a written law."""
    force = force or stop_force(scene)
    system = assemble(scene)
    b, n, speed = system.blocks, system.n, float(scene.spin.speed)
    inverse = np.linalg.inv(b.inertia)
    part = lambda block: 0.0 if block is None else inverse @ np.asarray(block)
    low = part(b.stiffness) - 1j * speed * part(b.circulatory)
    high = part(b.damping) - 1j * speed * part(b.gyroscopic) + np.zeros((n, n))
    still, shaken = (part(load) for load in (system.load.constant, system.load.unbalance))
    at = scene.stations()[0]
    row, column = np.asarray(system.line.row(at)), part(system.line.column(at))

    def rate(t, y):
        q, v = y[: 2 * n].view(complex), y[2 * n :].view(complex)
        a = -(low @ q) - high @ v + still + speed**2 * shaken * np.exp(1j * speed * t)
        a = a + column * force(complex(row @ q), complex(row @ v))
        return np.concatenate([v, a]).view(float)

    begin = np.concatenate([np.asarray(q), np.asarray(v)]).astype(complex).view(float)
    span = (0.0, times[-1])
    found = solve_ivp(rate, span, begin, method, times, rtol=tol, atol=1e-3 * tol)
    assert found.success
    return row @ found.y[: 2 * n].T.copy().view(complex).T
