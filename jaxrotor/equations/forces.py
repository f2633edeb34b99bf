"""Forces on the shaft in its own axes: of the linear blocks, loads, contacts and rolling bodies."""

from collections.abc import Callable, Iterator

import jax.numpy as jnp
from jaxtyping import Array, Float

from ..core.blocks import Blocks, Load
from ..core.lanes import computed_once, product, reduced
from ..core.plane import plane
from ..core.quantities import Number, Scalar
from ..effects.law import Now, States
from .kinematics import Kinematics
from .port import Law, Port, actual, of_all, of_each
from .system import Race, System


def resistance(blocks: Blocks, now: Kinematics) -> Array:
    """`(C - i Omega G) q. + (K - i Omega H) q + ..` times `exp(-i theta)`: all blocks but the inertia.

    Its rows are those of the blocks: equations of motion, or work on virtual displacements.
    """
    speed, r, v = now.turning.speed, now.r, now.velocity
    back = now.back**2  # conj(q) exp(-i theta) = conj(r) exp(-2 i theta)
    parts = [
        (blocks.damping, v),
        (blocks.gyroscopic, -1j * speed * v),
        (blocks.stiffness, r),
        (blocks.circulatory, -1j * speed * r),
        (blocks.skew_damping, 1j * v),
        (blocks.skew_stiffness, 1j * r),
        (blocks.skew_circulatory, speed * r),
        (blocks.fixed_damping, back * jnp.conj(v)),
        (blocks.fixed_stiffness, back * jnp.conj(r)),
        (blocks.rotating_damping, jnp.conj(now.drift)),
        (blocks.rotating_stiffness, jnp.conj(r)),
    ]
    of = jnp.matmul if r.ndim == 1 else product
    every = (of(part, vector) for part, vector in parts if part is not None)
    return sum(every, start=jnp.zeros(()))


def applied_force(load: Load, now: Kinematics) -> Array:
    """All of `load` times `exp(-i theta)`."""
    rates = now.turning.speed, now.turning.acceleration
    parts = [
        (load.still_force(*rates), now.back),
        (load.unbalance_force(*rates), 1.0),
        (load.twice_force(*rates), now.turn),
    ]
    return sum((part * turn for part, turn in parts if part is not None), start=jnp.zeros(()))


# === contacts


Contacts = list[Float[Array, "_ 2 ..."]]  # force of every law of every port, in fixed axes [N]


def contacts_of(system: System, now: Kinematics) -> Contacts:
    """Forces of all contacts."""
    return [port.forces(*motion) for port, motion in port_motion(system, now)]


def contact_force(
    system: System, now: Kinematics, contacts: Contacts, column: Callable[[Port], Array]
) -> Array:
    """`Sum_ports column F exp(-i theta)`: force of all contacts together."""
    force = jnp.zeros(())
    for port, forces in zip(system.ports, contacts, strict=True):
        both = forces.sum(0)
        force = force + column(port) * (both[0] + 1j * both[1]) * now.back
    return force


def contact_torque(system: System, now: Kinematics, contacts: Contacts) -> Number:
    """Torque of all contacts on the shaft about its axis [N m]."""
    torque = jnp.zeros(())
    for (port, motion), forces in zip(port_motion(system, now), contacts, strict=True):
        torque = torque + port.torque(forces, *motion)
    return torque


def state_rates(
    system: System, now: Kinematics, contacts: Contacts | None = None, law: Law = actual
) -> States:
    """Rates of the states of all laws per second, by the forces of the contacts where these are known."""
    if not system.state_count:
        return now.states
    contacts = contacts_of(system, now) if contacts is None else contacts
    every = zip(port_motion(system, now), contacts, strict=True)
    found = [law.rates(i, port, f, *motion) for i, ((port, motion), f) in enumerate(every)]
    return of_all(system.ports, found)


def port_motion(system: System, now: Kinematics) -> Iterator[tuple[Port, tuple[Array, Array, Now]]]:
    """Every port, its displacement and velocity [x, y] in fixed axes, and what its laws are given."""
    motions = []
    for port in system.ports:
        place, velocity = (product(port.row[None], part)[0] for part in (now.r, now.velocity))
        motions.append((plane(place * now.turn), plane(velocity * now.turn)))
    places, velocities = ([motion[k] for motion in motions] for k in (0, 1))
    own = of_each(system.ports, now.of_laws, places, velocities)
    yield from zip(system.ports, zip(places, velocities, own, strict=True), strict=True)


# === rolling bodies


def races_of(system: System) -> Iterator[tuple[Race, slice]]:
    """Every race with the slice of its bodies."""
    start = 0
    for race in system.races:
        stop = start + race.bodies.places
        yield race, slice(start, stop)
        start = stop


def body_force(
    system: System, now: Kinematics, outward: Array, column: Callable[[Race], Array]
) -> Array:
    """`-Sum column m R (i phi.. - phi.^2) exp(i psi)`: force of all bodies.

    `outward` is `exp(i psi)`. The inertia of bodies carried along with the shaft, `m z..`, is in the
    blocks.
    """
    force = jnp.zeros(())
    for race, part in races_of(system):
        whirl = 1j * now.bodies_acceleration[part] - now.bodies_speed[part] ** 2
        whirl = race.bodies.masses * whirl * outward[part]
        force = force - column(race) * (race.bodies.race_radius * reduced(jnp.add, whirl))
    return force


def body_accelerations(
    system: System, now: Kinematics, outward: Array, races: Array, spin: Number
) -> Float[Array, "b ..."]:
    """`phi..` of all bodies where the centres of their races accelerate by `races exp(i theta)`."""
    found: list[Array] = []
    gravity = system.load.gravity
    for (race, part), acceleration in zip(races_of(system), races, strict=True):
        bodies, psi = race.bodies, now.bodies[part]
        rate = now.bodies_speed[part] - now.turning.speed
        force = bodies.drag(rate)
        for between in system.between:
            force = force + between.between(psi, rate, bodies)
        if gravity is not None:
            acceleration = acceleration - gravity * now.back
        push = force / jnp.where(bodies.masses > 0, bodies.masses, 1.0)
        push = push - jnp.imag(jnp.conj(outward[part]) * acceleration)
        lag = (bodies.rolling - 1) * spin
        found.append((push / bodies.race_radius + lag) / bodies.rolling)
    return computed_once(jnp.concatenate(found)) if found else now.bodies


def nonlinear_columns(system: System) -> list[tuple[Scalar, Array]]:
    """Station [m] and column of every contact and every race, which act by laws of their own."""
    return [(part.at, part.column) for part in (*system.ports, *system.races)]
