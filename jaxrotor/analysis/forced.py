"""Steady response of a linear rotor to its loads."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float

from ..pencil import steady_response
from ..quantities import known
from ..scene import Scene
from ..system import assemble


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
    displacement, deflection = _respond(scene, speeds, stations)
    if known(displacement) and not np.all(np.isfinite(displacement)):
        bad = np.asarray(speeds)[~np.isfinite(displacement).all(axis=1)]
        raise ValueError(
            f"The response is unbounded at {bad[0]:g} rad/s, an undamped critical speed; add damping."
        )
    return UnbalanceResponse(speeds, stations, displacement, deflection)


@eqx.filter_jit
def _respond(scene: Scene, speeds, stations) -> tuple[Complex[Array, "w s"], Complex[Array, "w s"]]:
    def one(speed):
        system = assemble(scene.put({"spin.speed": speed}))
        still, whirling = steady_response(system)
        rows = jax.vmap(system.line.row)(stations)
        see = lambda q: jnp.zeros(stations.shape, complex) if q is None else rows @ q
        return see(whirling), see(still)

    return jax.lax.map(one, speeds)
