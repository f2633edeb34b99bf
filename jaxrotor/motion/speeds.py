"""Speeds of rotation: known in time, or to be expected of a drive."""

import dataclasses

import jax
import jax.numpy as jnp
from jaxtyping import Array

from ..core.quantities import Scalar
from ..equations.system import System
from ..spins.base import Turning
from ..spins.drive import Drive


ALONE = 4096  # steps by which the speed of a drive alone is found


def turning(system: System, time: Array) -> Turning:
    """Rotation of a rotor at times."""
    return system.spin.turning(time, system.blocks.polar)


def expected_speed(system: System, times: Array) -> Array:
    """Speeds at ascending times from 0 on, of a drive as if it did not feel the rotor [rad/s]."""
    spin, polar = system.spin, system.blocks.polar
    if isinstance(spin, Drive):
        spin = dataclasses.replace(spin, feedback=False)
        if not spin.given:
            return _run_alone(spin, polar, times)
    return spin.turning(times, polar).speed


def _run_alone(spin: Drive, polar: Scalar | None, times: Array) -> Array:
    """Speeds of a drive at times, by many steps of order two."""
    inertia, span = spin.inertia(polar), times[-1] / ALONE

    def step(speed: Scalar, _):
        middle = speed + span / 2 * spin.moment(speed) / inertia
        speed = speed + span * spin.moment(middle) / inertia
        return speed, speed

    first = jnp.asarray(spin.speed, float)
    _, speeds = jax.lax.scan(step, first, length=ALONE)
    return jnp.interp(times, span * jnp.arange(ALONE + 1), jnp.append(first, speeds))
