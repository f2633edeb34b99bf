"""Coupling: accelerations that depend on each other, of a shaft, of bodies round it and of a free spin."""

from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float, Inexact

from ..core.elimination import eliminated_in_order
from ..core.lanes import computed_once, product, reduced
from ..core.plane import directions
from ..core.quantities import Number
from .forces import applied_force, body_accelerations, body_force, races_of
from .kinematics import Kinematics
from .system import System


def with_accelerations(
    system: System,
    inverse: Inexact[Array, "n n ..."],
    now: Kinematics,
    given: Inexact[Array, "n ..."],
    spin: Callable[[Kinematics], Number] | None,
) -> tuple[Kinematics, Array]:
    """The motion at an instant with all its accelerations, and the force of loads and bodies.

        b = given + inverse force,   b = q.. exp(-i theta)

    Bodies act on each other by their inertia, as does a spin with feedback. Their accelerations are the
    solution of a linear system, two unknowns a race and one for the spin. Its leading minors are
    inertias with fewer degrees of freedom, and so of one sign. A race that accelerates by `b` adds the
    force `Sum m / (2 k) (b - exp(2 i psi) b*)` of its bodies.

    Args:
        system: the equations, of `n` coordinates.
        inverse: accelerations by unit forces.
        now: the motion without accelerations; that of the rotation counts where `spin` is None.
        given: accelerations without loads and bodies.
        spin: acceleration of a rotation with feedback that follows from a motion [rad/s^2].

    Returns:
        The motion with accelerations, and the force. All arrays may have lanes last.
    """
    outward = computed_once(directions(now.bodies))
    loaded = system.load.unbalance is not None or system.load.steady or bool(system.races)
    spins = [] if spin is None else [spin]

    def respond(unknown: Array) -> tuple[Kinematics, Array, Array]:
        """The motion that follows from assumed accelerations, the force, and the residual of these."""
        _, x, y = jnp.split(unknown, [len(spins), len(spins) + len(system.races)])
        races, turning = jax.lax.complex(x, y), now.turning
        if spins:
            turning = turning._replace(acceleration=unknown[0])
        bodies = body_accelerations(system, now, outward, races, turning.acceleration)
        then = now._replace(turning=turning, bodies_acceleration=bodies, absolute=given)
        force = jnp.zeros_like(given)
        if loaded:
            force = force + applied_force(system.load, then)
            force = force + body_force(system, then, outward, lambda race: race.column)
            force = computed_once(force)
            then = then._replace(absolute=given + product(inverse, force))
        residual = [(spin(then) - turning.acceleration)[None] for spin in spins]
        if system.races:
            rows = jnp.stack([race.row for race in system.races])
            off = product(rows, then.absolute) - races
            residual += [off.real, off.imag]
        return then, force, jnp.concatenate(residual) if residual else unknown

    zero = jnp.zeros((2 * len(system.races) + len(spins), *given.shape[1:]))
    if not len(zero):
        return respond(zero)[:2]
    if spins:
        change = lambda unit: jax.jvp(lambda unknown: respond(unknown)[2], (zero,), (unit,))[1]
        units = np.eye(len(zero)).reshape(*2 * [len(zero)], *[1] * (zero.ndim - 1))
        matrix = jnp.stack([change(unit + zero) for unit in units], axis=1)
    else:
        matrix = _of_races(system, inverse, outward)
    return respond(eliminated_in_order(matrix, -respond(zero)[2]))[:2]


def _of_races(
    system: System, inverse: Array, outward: Complex[Array, "b ..."]
) -> Float[Array, "r2 r2 ..."]:
    """Change of the residual by the accelerations of races, `[Re, Im]` of all."""
    rows = jnp.stack([race.row for race in system.races])
    moved = [product(inverse, race.column) for race in system.races]
    gain = jnp.stack([product(rows, column) for column in moved], axis=1)
    own, other = [], []
    for race, part in races_of(system):
        share = race.bodies.masses / (2 * race.bodies.rolling)
        own.append(reduced(jnp.add, share + 0 * outward[part].real))
        other.append(-reduced(jnp.add, share * outward[part] ** 2))
    plus, minus = (
        gain * jnp.stack([a + sign * b for a, b in zip(own, other, strict=True)])
        for sign in (1, -1)
    )
    real = jnp.concatenate([plus.real, -minus.imag], axis=1)
    imag = jnp.concatenate([plus.imag, minus.real], axis=1)
    both = jnp.concatenate([real, imag])
    return both - np.eye(len(both)).reshape(*both.shape[:2], *[1] * (both.ndim - 2))
