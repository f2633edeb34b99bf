"""Disturbances: how fast neighbours of a motion that is known as a sum of whirls leave it.

    M d.. + C d. + K d = column ( F_u row d + F_v row d. ),    F_u, F_v along the motion

Source: Strang (1968), SIAM Journal on Numerical Analysis 5, 506-517, eq. (6).
"""

from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array, Complex

from ..core import linalg
from ..core.plane import plane
from ..core.quantities import Scalar
from ..equations.pencil import Pencil
from .balance import Balance
from .lyapunov import mean_and_error, random_disturbances


def growth_along(
    balance: Balance, ports: Complex[Array, "K p"], revolutions: int, steps: int
) -> tuple[Scalar, Scalar]:
    """Growth of the fastest small disturbance of a motion [1/s], and its standard error.

    Its linear part is exact in every step, before and after an impulse of the forces at the middle.
    Half as many revolutions as are averaged pass before.
    """
    if not revolutions:
        return jnp.asarray(jnp.nan), jnp.asarray(jnp.nan)
    balance, ports = jax.lax.stop_gradient((balance, ports))
    speed, n = jnp.abs(balance.system.spin.speed), balance.system.n
    h = 2 * jnp.pi / (steps * speed)
    pencil = Pencil.of(balance.system)
    lower = linalg.solve(pencil.inertia, jnp.concatenate([pencil.stiffness, pencil.damping], 1))
    matrix = jnp.concatenate([jnp.eye(n, 2 * n, n) + 0j, -lower])
    half = linalg.expm(h / 2 * matrix, max_squarings=64)
    columns = jnp.stack([port.column for port in balance.system.ports] or [jnp.zeros(n)], axis=1)
    pushed = linalg.solve(pencil.inertia, columns + 0j)  # velocity by impulses

    def step(state: Complex[Array, " m"], number: Array) -> tuple[Array, None]:
        state = half @ state
        if balance.system.ports:
            impulse = _impulse(balance, ports, pushed, state, h * (number + 0.5), h)
            state = state.at[n:].add(pushed @ impulse)
        return half @ state, None

    def revolution(state: Array, number: Array) -> tuple[Array, Scalar]:
        state, _ = jax.lax.scan(step, state, number * steps + jnp.arange(steps))
        size = linalg.norm(state)
        return state / size, jnp.log(size)

    begin = random_disturbances(4 * n, 1, 0)[:, 0]
    begin = jax.lax.complex(begin[: 2 * n], begin[2 * n :])
    growth: Any = jax.lax.scan(revolution, begin, jnp.arange(-(revolutions // 2), revolutions))[1]
    growth = growth[revolutions // 2 :, None] * speed / (2 * jnp.pi)
    (mean,), (error,) = mean_and_error(growth)
    return mean, error


def _impulse(
    balance: Balance,
    ports: Complex[Array, "K p"],
    pushed: Complex[Array, "n p"],
    state: Complex[Array, " m"],
    time: Scalar,
    h: Scalar,
) -> Complex[Array, " p"]:
    """Impulses of the forces over a step [N s], by the mean of the velocities before and after."""
    n, p = pushed.shape
    motion = [ports, 1j * balance.frequencies[:, None] * ports]
    place, velocity = (plane(balance.at(part, time), axis=-1) for part in motion)
    angle = balance.system.spin.speed * time
    by_place, by_velocity = jax.jacfwd(balance.port_forces, argnums=(0, 1))(place, velocity, angle)
    flat = lambda matrix: matrix.reshape(2 * p, 2 * p)
    seen = balance.rows @ state.reshape(2, n).T  # (p, displacement or velocity)
    u, v = (plane(part, axis=-1).ravel() for part in seen.T)
    mobility = balance.rows @ pushed  # velocity there by impulses, complex
    rotated = jnp.stack([mobility.real, -mobility.imag, mobility.imag, mobility.real])
    mobility = rotated.reshape(2, 2, p, p).transpose(2, 0, 3, 1).reshape(2 * p, 2 * p)
    force = h * (flat(by_place) @ u + flat(by_velocity) @ v)
    implicit = jnp.eye(2 * p) - h / 2 * flat(by_velocity) @ mobility
    x, y = linalg.solve(implicit, force).reshape(p, 2).T
    return jax.lax.complex(x, y)
