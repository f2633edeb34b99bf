"""Disturbances: how fast neighbours of a motion that is known as a sum of whirls leave it.

    w' = A w + B (F_u C_u w + F_v C_v w),    F_u, F_v of the forces along the motion

Source: Strang (1968), SIAM Journal on Numerical Analysis 5, 506-517, eq. (6).
"""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Complex, Float

from ..core import linalg
from ..core.plane import plane
from ..core.quantities import Scalar
from ..equations.stationary_frame import Motion
from ..solvers.basis import ModalBasis
from .balance import Balance
from .lyapunov import mean_and_error, random_disturbances


def growth_along(
    balance: Balance, ports: Complex[Array, "K p"], revolutions: int, steps: int
) -> tuple[Scalar, Scalar]:
    """Growth of the fastest small disturbance of a motion [1/s], and its standard error.

    The linear part is exact in every step, before and after an impulse of the forces at its middle.
    Half as many revolutions as are averaged pass before.
    """
    if not revolutions:
        return jnp.asarray(jnp.nan), jnp.asarray(jnp.nan)
    forces = Disturbed.of(*jax.lax.stop_gradient((balance, ports)))
    h = 2 * jnp.pi / steps
    half = jnp.exp(h / 2 * forces.values)

    def step(w: Complex[Array, " m"], number: Array) -> tuple[Array, None]:
        w = half * w
        if balance.system.ports:
            w = w + forces.pushed @ forces.impulse(w, h * (number + 0.5), h)
        return half * w, None

    def revolution(w: Array, number: Array) -> tuple[Array, Scalar]:
        w, _ = jax.lax.scan(step, w, number * steps + jnp.arange(steps))
        size = linalg.norm(w)
        return w / size, jnp.log(size)

    m = half.size
    begin = random_disturbances(2 * m, 1, 0)[:, 0]
    begin = jax.lax.complex(begin[:m], begin[m:])
    growth: Any = jax.lax.scan(revolution, begin, jnp.arange(-(revolutions // 2), revolutions))[1]
    growth = growth[revolutions // 2 :, None] * forces.rate / (2 * jnp.pi)
    (mean,), (error,) = mean_and_error(growth)
    return mean, error


class Disturbed(eqx.Module):
    """A motion as harmonics of its ports, and what small disturbances of it do, in modal coordinates."""

    balance: Balance
    ports: Complex[Array, "K p"]  # [m]
    rate: Scalar  # |Omega| [rad/s]; time is the angle of the first shaft
    values: Complex[Array, " m"]
    pushed: Complex[Array, "m p"]  # by an impulse at every port
    places: Complex[Array, "p m"]  # of the ports [m]
    velocities: Complex[Array, "p m"]  # [m/s]

    @classmethod
    def of(cls, balance: Balance, ports: Complex[Array, "K p"]) -> "Disturbed":
        """Disturbances of a motion of these harmonics."""
        rate, n, rows = jnp.abs(balance.system.spin.speed), balance.system.n, balance.rows
        motion = Motion(balance.system, rate, loads=False)
        basis = ModalBasis.build(motion.matrix())
        columns = jnp.zeros((n, 0)) if motion.columns is None else motion.columns
        pushed = basis.inverse[:, n:] @ columns
        seen = rows @ basis.vectors[:n], rate * (rows @ basis.vectors[n:])
        return cls(balance, ports, rate, basis.values, pushed, *seen)

    def impulse(self, w: Complex[Array, " m"], theta: Scalar, h: float) -> Complex[Array, " p"]:
        """Impulse over a step by the mean of the velocities before and after it."""
        time, balance = theta / self.rate, self.balance
        motion = self.ports, 1j * balance.frequencies[:, None] * self.ports
        place, velocity = (plane(balance.at(part, time), axis=-1) for part in motion)
        angle = balance.system.spin.speed * time
        slopes = jax.jacfwd(balance.port_forces, argnums=(0, 1))(place, velocity, angle)
        size = place.size
        by_place, by_velocity = (slope.reshape(size, size) for slope in slopes)
        u, v = (plane(row @ w, axis=-1).ravel() for row in (self.places, self.velocities))
        along = lambda one: plane(self.velocities @ (self.pushed @ one), axis=-1).ravel()
        mobility = jax.vmap(lambda unit: along(_complex(unit)), out_axes=1)(jnp.eye(size))
        force = h * (by_place @ u + by_velocity @ v)
        return _complex(linalg.solve(jnp.eye(size) - h / 2 * by_velocity @ mobility, force))


def _complex(pairs: Float[Array, " p2"]) -> Complex[Array, " p"]:
    """X + i y of (x, y) of every port."""
    x, y = pairs.reshape(-1, 2).T
    return jax.lax.complex(x, y)
