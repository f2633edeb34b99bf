"""Speeds of rotation: known in time, or to be expected of a drive, and the steps that follow them."""

import dataclasses
import math

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..core.compiled import compiled_quickly
from ..core.quantities import Scalar, known
from ..effects.law import Now
from ..equations.pencil import Pencil
from ..equations.port import rates_of_states
from ..equations.system import System
from ..spins.base import Turning
from ..spins.constant import constant
from ..spins.drive import Drive


STEPS_ALONE = 4096  # by which the speed of a drive alone is found
SLOW = 1e-6  # change of an exponent in a step below which a series serves


def turning(system: System, time: Array) -> Turning:
    """Rotation of a rotor at times."""
    return system.spin.turning(time, system.blocks.polar)


def decomposed_at(system: System, speed: Scalar) -> System:
    """The rotor at a speed of decomposition; coefficients over speed stay those of its own one."""
    return dataclasses.replace(system, spin=constant(speed))


def expected_speed(system: System, times: Array) -> Array:
    """Speeds at ascending times from 0 on, of a drive as if it did not feel the rotor [rad/s]."""
    spin, polar = system.spin, system.blocks.polar
    if isinstance(spin, Drive):
        spin = dataclasses.replace(spin, feedback=False)
        if not spin.given:
            return _run_alone(spin, polar, times)
    return spin.turning(times, polar).speed


def _run_alone(spin: Drive, polar: Scalar | None, times: Array) -> Array:
    """Speeds of a drive at times, by Rosenbrock's exponential method of order two.

    A step is `Omega <- Omega + h phi_1(h a) M / I`, with `a = d(M / I) / d Omega`.
    """
    inertia, span = spin.inertia(polar), times[-1] / STEPS_ALONE

    def step(speed: Scalar, _):
        rate = lambda speed: spin.moment(speed) / inertia
        value, slope = jax.jvp(rate, (speed,), (jnp.ones(()),))
        z = span * slope
        slow = jnp.abs(z) < SLOW
        phi = jnp.where(slow, 1 + z / 2, jnp.expm1(z) / jnp.where(slow, 1.0, z))
        speed = speed + span * phi * value
        return speed, speed

    first = jnp.asarray(spin.speed, float)
    _, speeds = jax.lax.scan(step, first, length=STEPS_ALONE)
    found = jnp.interp(times, span * jnp.arange(STEPS_ALONE + 1), jnp.append(first, speeds))
    if known(found) and not np.isfinite(found).all():
        raise ValueError(
            "The speed that the Drive would have alone grows without bound, so that it tells no steps; "
            "leave `solver` out, or check whether `Drive(odd=True)` is meant."
        )
    return found


def steps_between(length: float, fastest: float, revolution: int) -> int:
    """Steps in a length of time [s], of `revolution` in a turn at the speed `fastest` [rad/s]."""
    return max(1, math.ceil(float(revolution * length * fastest) / (2 * math.pi) - 1e-6))


def coupled_steps(
    system: System,
    length: float,
    speeds: Float[np.ndarray, " t"],
    ball_rate: float,
    revolution: int,
) -> int:
    """Steps in a length of time [s] of a rotor whose spin or balls are part of the motion.

    A turn has `revolution` of them at the fastest of these: the speeds that are expected, balls that roll
    past the shaft by `ball_rate` [rad/s], and the first natural frequency, since whirl may turn a rotor
    at rest. The torque of a drive, the drag of balls and states of laws change little in a step.
    """
    whirl = float(Pencil.mean(system.at_rest).rate)
    fastest = max(np.abs(speeds).max() + ball_rate, whirl if np.isfinite(whirl) else 0.0)
    rates = [0.0]
    spin = system.spin
    if isinstance(spin, Drive) and not spin.given:
        slope = jax.vmap(jax.grad(lambda speed: spin.moment(speed)))(jnp.asarray(speeds))
        rates.append(float(jnp.abs(slope).max() / spin.inertia(system.blocks.polar)))
    for race in system.races:
        bodies = race.bodies
        none, one = jnp.zeros(bodies.places), jnp.ones(bodies.places)
        drag = jnp.abs(jax.jvp(bodies.drag, (none,), (one,))[1])
        masses = jnp.where(bodies.masses > 0, bodies.masses, jnp.inf)
        rates.append(float(jnp.max(drag / (bodies.rolling * masses * bodies.race_radius))))
    rates.append(rate_of_states(system))
    return max(steps_between(length, fastest, revolution), math.ceil(length * max(rates)))


def rate_of_states(system: System) -> float:
    """Largest rate at which states of laws change by themselves, 0 without any [1/s]."""
    if not system.state_count:
        return 0.0
    own = np.linalg.eigvals(np.nan_to_num(np.asarray(_by_states(system))))
    return float(np.abs(own).max())


@compiled_quickly
def _by_states(system: System) -> Float[Array, "s s"]:
    """Derivative of the rates of the states of laws by them, of a straight rotor at the start [1/s]."""
    still = jnp.zeros((len(system.ports), 2))

    def rates(states: Array) -> Array:
        now = Now(system.spin.speed, jnp.zeros(()), states)
        return rates_of_states(system.ports, still, still, now)

    return jax.jacfwd(rates)(system.begin())
