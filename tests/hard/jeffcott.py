"""The simplest rotor, a disc on a massless shaft, and what SciPy makes of any rotor in its stops."""

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


def path(response: jr.Response) -> tuple[np.ndarray, np.ndarray]:
    """Displacement and velocity at the observed station."""
    return np.asarray(response.displacement[:, 0]), np.asarray(response.velocity[:, 0])


def stop_force(scene: jr.Scene, z, v):
    """Force of all stops of a scene on the shaft, from the written law."""
    speed, total = float(scene.spin.speed), 0j
    for one in scene.of(jr.Limiter):
        out = np.exp(1j * float(one.angle))
        local, rate = z / out, v / out
        depth = local.real - float(one.gap)
        normal = float(one.stiffness) * depth + float(one.damping) * rate.real
        normal = np.where((depth > 0) & (normal > 0), normal, 0.0)
        u = speed * float(one.rim_radius) + rate.imag
        if one.slip is None:
            direction = np.sign(u)
        else:
            u = np.clip(u / float(one.slip), -1, 1)
            direction = u * (15 - 10 * u**2 + 3 * u**4) / 8
        total = total - normal * (1 + 1j * float(one.friction) * direction) * out
    return total


def by_scipy(scene: jr.Scene, q, v, times, force=stop_force, method="DOP853", tol=1e-11):
    """Displacement at the stops' station: SciPy on the library's linear blocks and a written law."""
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
        a = a + column * force(scene, row @ q, row @ v)
        return np.concatenate([v, a]).view(float)

    begin = np.concatenate([np.asarray(q), np.asarray(v)]).astype(complex).view(float)
    span = (0.0, times[-1])
    found = solve_ivp(rate, span, begin, method, times, rtol=tol, atol=1e-3 * tol)
    assert found.success
    return row @ found.y[: 2 * n].T.copy().view(complex).T
