"""Coupling: accelerations that depend on each other, of a shaft, of bodies round it and of a free spin."""

from collections.abc import Callable

import jax
import jax.numpy as jnp
from jaxtyping import Array, Inexact

from ..core.elimination import eliminated
from ..core.plane import plane
from ..core.quantities import Scalar
from .forces import applied_force, body_accelerations, body_force
from .kinematics import Kinematics
from .system import System


def with_accelerations(
    system: System,
    inverse: Inexact[Array, "n n"],
    now: Kinematics,
    given: Array,
    spin: Callable[[Kinematics], Scalar] | None,
) -> Kinematics:
    """The motion at an instant with all its accelerations.

        b = given + inverse (loads + bodies),   b = q.. exp(-i theta)

    Bodies act on each other by their inertia, as does a spin with feedback. Their accelerations are the
    solution of a linear system, two unknowns a race and one for the spin. Its leading minors are
    inertias with fewer degrees of freedom, and so of one sign.

    Args:
        system: the equations, of `n` coordinates.
        inverse: accelerations by unit forces.
        now: the motion without accelerations; that of the rotation counts where `spin` is None.
        given: accelerations without loads and bodies.
        spin: acceleration of a rotation with feedback that follows from a motion [rad/s^2].

    Returns:
        The motion with accelerations.
    """
    loaded = system.load.unbalance is not None or system.load.steady
    start = 0 if spin is None else 1

    def respond(unknown: Array) -> tuple[Kinematics, Array]:
        """The motion that follows from assumed accelerations, and the residual of these."""
        races = unknown[start::2] + 1j * unknown[start + 1 :: 2]
        turning = now.turning
        if spin is not None:
            turning = turning._replace(acceleration=unknown[0])
        bodies = body_accelerations(system, now, races, turning.acceleration)
        then = now._replace(turning=turning, bodies_acceleration=bodies, absolute=given)
        if loaded or system.races:
            force = applied_force(system.load, then)
            force = force + body_force(system, then, lambda race: race.column)
            then = then._replace(absolute=given + inverse @ force)
        residual = [race.row @ then.absolute for race in system.races]
        residual = jnp.stack(residual) - races if residual else races
        residual = plane(residual, axis=1).ravel()
        if spin is not None:
            residual = jnp.append(spin(then) - turning.acceleration, residual)
        return then, residual

    size = 2 * len(system.races) + start
    if not size:
        return respond(jnp.zeros(0))[0]
    zero = jnp.zeros(size)
    gain = jax.jacfwd(lambda unknown: respond(unknown)[1])(zero)
    return respond(eliminated(gain, -respond(zero)[1]))[0]
