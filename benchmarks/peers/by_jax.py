"""diffrax, and RK4 in a scan: all lanes under vmap, matrices shared."""

import diffrax as dfx
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxrotor.equations.stationary_frame import Motion
from jaxrotor.solvers.control import step_control

from .by_scipy import ATOL
from .rotor import SAMPLES, motion_and_state


def _loaded(motion: Motion, share) -> Motion:
    return eqx.tree_at(lambda m: m.unbalance, motion, motion.unbalance * share)


@eqx.filter_jit
def _diffrax(solver, motion, y0, rtol, shares, revolutions: int):
    angles = jnp.linspace(0, 2 * jnp.pi * revolutions, revolutions * SAMPLES + 1)
    saveat = dfx.SaveAt(ts=angles, fn=lambda t, y, args: y[0] @ motion.rows[0])
    how = {"saveat": saveat, "stepsize_controller": step_control(solver, rtol, ATOL * rtol)}
    how |= {"adjoint": dfx.ForwardMode(), "max_steps": None, "throw": False}

    def lane(share):
        term = dfx.ODETerm(_loaded(motion, share))
        span = (0.0, angles[-1], None)  # from, to, first step: diffrax chooses
        return dfx.diffeqsolve(term, solver, *span, y0, **how).ys

    return jax.vmap(lane)(shares)


@eqx.filter_jit
def _rk4(motion, y0, shares, steps: int, revolutions: int):
    h = 2 * jnp.pi / steps

    def lane(share):
        field = _loaded(motion, share)

        def step(y, k):
            theta = k * h
            a = field(theta, y)
            b = field(theta + h / 2, y + h / 2 * a)
            c = field(theta + h / 2, y + h / 2 * b)
            d = field(theta + h, y + h * c)
            return y + h / 6 * (a + 2 * b + 2 * c + d), None

        def sample(y, k):
            y, _ = jax.lax.scan(step, y, k * (steps // SAMPLES) + jnp.arange(steps // SAMPLES))
            return y, y[0] @ motion.rows[0]

        def turn(y, _):
            return jax.lax.scan(sample, y, jnp.arange(SAMPLES))

        _, seen = jax.lax.scan(turn, y0, None, length=revolutions)
        return jnp.concatenate([y0[:1] @ motion.rows[0], seen.reshape(-1, 2)])

    return jax.vmap(lane)(shares)


def _complex(orbits) -> np.ndarray:
    return np.asarray(orbits) @ [1, 1j]


def diffrax_orbits(solver, modes, rtol: float, revolutions: int, shares) -> np.ndarray:
    motion, y0 = motion_and_state(modes)
    given = (motion, *map(jnp.asarray, (y0, rtol, shares)))
    return _complex(_diffrax(solver, *given, revolutions))


def rk4_orbits(modes, steps: int, revolutions: int, shares) -> np.ndarray:
    motion, y0 = motion_and_state(modes)
    return _complex(_rk4(motion, jnp.asarray(y0), jnp.asarray(shares), steps, revolutions))
