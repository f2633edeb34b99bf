"""Steady response of a linear rotor to its loads."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float

from ..pencil import steady_response
from ..quantities import Scalar, known
from ..scene import Scene
from ..system import System, assemble
from .modal import natural_roots


CRITICAL = 1e-9  # relative distance of speed and frequency at which a response has no digits


class UnbalanceResponse(eqx.Module):
    """`z(x, t) = displacement exp(i Omega t) + deflection`; `w` speeds, `s` stations."""

    speeds: Float[Array, " w"]  # [rad/s]
    stations: Float[Array, " s"]  # [m]
    displacement: Complex[Array, "w s"]  # amplitude and phase of synchronous whirl [m]
    deflection: Complex[Array, "w s"]  # static, by weight [m]


def unbalance_response(scene: Scene, speeds, at=None) -> UnbalanceResponse:
    """`( K - i Omega H + i Omega (C - i Omega G) - Omega^2 M ) q = Omega^2 U`, without time stepping.

    Args:
        scene: a rotor without contact (`scene.without("limiters")` removes it).
        speeds: [rad/s], one or many, none of them an undamped critical speed.
        at: station(s) [m], by default the observed station of `simulate`.

    Returns:
        Complex amplitudes: magnitude is the radius of the circular orbit, the angle its lead over
        the rotation angle.

    Source: Azarov, Gouskov, Panovko (2023), eq. (9) with Pi = eps N^2 exp(i N tau).
    """
    if assemble(scene).ports:
        raise ValueError(
            "The closed-form response is that of a linear rotor, but the scene has contacts; remove "
            'them with `scene.without("limiters")` or use `simulate`.'
        )
    speeds = jnp.atleast_1d(jnp.asarray(speeds, float))
    stations = scene.stations(at)
    displacement, deflection, distance = _respond(scene, speeds, stations)
    if known(distance) and np.any(distance < CRITICAL):
        bad = float(speeds[np.argmin(distance)])
        raise ValueError(
            f"The response is unbounded at {bad:g} rad/s, an undamped critical speed; add damping."
        )
    return UnbalanceResponse(speeds, stations, displacement, deflection)


def _from_critical(system: System) -> Scalar:
    """How far the speed is from that of an undamped whirl, relative; 1 without unbalance."""
    if system.load.unbalance is None:
        return jnp.ones(())
    speed = jax.lax.stop_gradient(system.spin.speed)
    still = jnp.where(speed == 0, 1.0, speed)
    values = natural_roots(jax.lax.stop_gradient(system))
    return jnp.where(speed == 0, 1.0, jnp.min(jnp.abs(values / (1j * still) - 1)))


@eqx.filter_jit
def _respond(scene: Scene, speeds, stations):
    def one(speed):
        system = assemble(scene.put({"spin.speed": speed}))
        still, whirling = steady_response(system)
        rows = jax.vmap(system.line.row)(stations)
        see = lambda q: jnp.zeros(stations.shape, complex) if q is None else rows @ q
        return see(whirling), see(still), _from_critical(system)

    return jax.lax.map(one, speeds)
