"""Coupled forces: those of a rotor with which balls, states or its own rotation move, at a few stations.

    z.. = a + D f,   f = (contacts, balls, (Omega^2 - i Omega.) e^(i theta))

Contacts, balls and the unbalance act on a linear rotor at a few stations, by the forces `f`. What these
depend on are displacements and velocities at contacts, and accelerations at races and at the unbalance,
which are `a` without the forces. So the equations of `coupling` are those of a rotor whose coordinates are
the stations, with the accelerance `D` in place of the inverse inertia.
"""

import dataclasses
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float

from ..core import linalg
from ..core.blocks import Blocks, Load
from ..core.lanes import computed_once, per_lane, product
from ..core.plane import plane
from ..core.quantities import Number, Scalar
from ..scene import Scene
from ..spins.base import AbstractSpin, Turning
from .accelerations import with_accelerations
from .fixed_axes import SpeedTerms
from .forces import resistance, state_rates
from .kinematics import Kinematics
from .moments import MomentBalance, drive_of, work
from .parts import unbalances
from .port import Law, actual, of_each
from .start import Launch
from .system import System


INSIDE = (
    1e-3  # share of the way to the middle of a step by which an acceleration is taken off a jump
)


class Stations(eqx.Module):
    """Where balls, and then the unbalance, act on a rotor, and what of it they read.

    Parts that turn with the shaft act on a drive with feedback by all coordinates and their rates.
    """

    rows: Complex[Array, "r n"]  # of races, and of the unbalance under such a drive: accelerations
    columns: Complex[Array, "n c"]
    all_coordinates: Float[Array, "a n"]  # their rows where all are read, else none

    unbalance: Complex[Array, " u"]  # what its columns, which are the last, are multiplied by

    @classmethod
    def of(cls, scene: Scene, system: System, moments: MomentBalance | None) -> "Stations":
        """The stations of a scene; `moments` are those of a drive with feedback."""
        rows = [race.row for race in system.races]
        columns = [race.column for race in system.races]
        unbalance, every, amounts = system.load.unbalance, jnp.zeros((0, system.n)), []
        if unbalance is not None and moments is None:
            own, amounts = unbalances(scene, system.line, system.blocks)
            columns += own
        elif unbalance is not None:
            columns.append(unbalance)
            amounts = [jnp.ones(())]
        if moments is not None and moments.galerkin.unbalance is not None:
            rows.append(jnp.conj(moments.galerkin.unbalance))
        if moments is not None and moments.corotating is not None:
            every = jnp.eye(system.n)
        stacked = lambda parts: jnp.reshape(jnp.array(parts), (-1, system.n)) + 0j
        amounts = jnp.concatenate([jnp.zeros(0, complex), *(one[None] for one in amounts)])
        return cls(stacked(rows), stacked(columns).T, every, amounts)


class Instant(NamedTuple):
    """A time, and one beside it at which the acceleration of a given speed is taken, off a jump [s]."""

    time: Array
    inside: Array

    @classmethod
    def at(cls, time: Array) -> "Instant":
        """An instant that is not one of a step."""
        return cls(time, time)

    @classmethod
    def of_step(cls, time: Array, middle: Array) -> "Instant":
        """An instant of a step; of one at its end, the acceleration is that of this side of a jump."""
        return cls(time, time + INSIDE * (middle - time))


class AuxiliaryState(eqx.Module):
    """State of what moves with a rotor: a free spin, balls, and states of laws.

    A part that the scene lacks has no entries.
    """

    angle: Float[Array, "d ..."]  # theta [rad], d = 1 where the spin is free
    speed: Float[Array, "d ..."]  # Omega [rad/s]
    bodies: Float[Array, "b ..."]  # psi [rad]
    bodies_rate: Float[Array, "b ..."]  # psi. [rad/s]
    states: Float[Array, "s ..."]  # of laws, in their own units

    @classmethod
    def of(cls, launch: Launch, system: System, *, free: bool) -> "AuxiliaryState":
        """That of a start with balls, of a system; `free` where the spin is integrated too."""
        alone = lambda value: jnp.reshape(value, -1)[: int(free)]
        join = lambda parts: jnp.concatenate([jnp.zeros(0), *parts])
        balls = launch.balls or ()
        places = join(one.angle for one in balls), join(one.rate for one in balls)
        states = system.begin() if launch.states is None else launch.states
        return cls(alone(launch.angle), alone(system.spin.speed), *places, states)


class CoupledForces(eqx.Module):
    """Forces at the stations, and rates of the others, by what is seen there in fixed axes."""

    system: System  # whose coordinates are the ports, the races and the unbalance
    moments: MomentBalance | None  # of a drive with feedback, by these alone
    corotating: Blocks | None  # parts that turn with the shaft, see `MomentBalance`
    accelerance: Complex[Array, "s s"]  # at races and unbalance; rows of ports are zero
    weight: Complex[Array, " s"] | None  # accelerations by it
    by_terms: Complex[Array, "s k"] | None  # and by the speed terms
    centre: Scalar  # speed of decomposition [rad/s]
    begin: Scalar  # angle at time 0 of a rotation that is known in time [rad]
    read_coordinates: int = eqx.field(static=True)  # all or none
    free: bool = eqx.field(static=True)  # whether the spin is integrated

    @classmethod
    def of(
        cls, scene: Scene, system: System, terms: SpeedTerms | None, centre: Scalar, begin: Scalar
    ) -> "tuple[CoupledForces, Stations]":
        """The forces of a scene, and the stations of balls and unbalance."""
        moments = MomentBalance.of(scene, system)
        stations, p = Stations.of(scene, system, moments), len(system.ports)
        inverse = linalg.inv(system.blocks.inertia)
        columns = [port.column[:, None] for port in system.ports]
        columns = inverse @ jnp.concatenate([*columns, stations.columns], axis=1)
        size = columns.shape[1]
        rows = (
            jnp.zeros((size, system.n), complex).at[p : p + len(stations.rows)].set(stations.rows)
        )
        load = system.load
        weight = None if load.constant is None else rows @ (inverse @ load.constant)
        by_terms = None if terms is None else rows @ terms.columns
        unit, unbalance = jnp.eye(size), None
        if load.unbalance is not None:
            unbalance = (
                jnp.zeros(size, complex)
                .at[size - len(stations.unbalance) :]
                .set(stations.unbalance)
            )
        reduced = dataclasses.replace(
            system,
            blocks=Blocks(polar=system.blocks.polar),
            load=Load(None, unbalance, load.gravity),
            ports=_at(system.ports, unit),
            races=_at(system.races, unit[p:]),
            n=size,
            deviators=(),
            tabled=None,
            over_speed=None,
        )
        corotating = None if moments is None else moments.corotating
        if moments is not None:
            moments = dataclasses.replace(moments, corotating=None)
            if moments.galerkin.unbalance is not None:
                moments = eqx.tree_at(lambda m: m.galerkin.unbalance, moments, unit[-1] + 0j)
        free = not system.spin.given
        parts = reduced, moments, corotating, rows @ columns, weight, by_terms
        return cls(*parts, centre, begin, len(stations.all_coordinates), free), stations

    def turning(self, now: Instant, others: AuxiliaryState) -> Turning:
        """Rotation now; the acceleration of a free spin is not known yet."""
        if self.free:
            return Turning(others.angle[0], others.speed[0], jnp.zeros(()))

        def known(parts: tuple[AbstractSpin, Scalar | None], now: Instant) -> Turning:
            (spin, polar), (time, inside) = parts, now
            found = spin.turning(time, polar)
            if spin.kinks is None:
                return found
            return found._replace(acceleration=spin.turning(inside, polar).acceleration)

        parts = self.system.spin, self.system.blocks.polar
        alone = jnp.ndim(now.time) == 0
        found = known(parts, now) if alone else per_lane(known, parts, now)
        return found._replace(angle=self.begin + found.angle)

    def __call__(
        self, at: Instant, seen: Complex[Array, "z ..."], others: AuxiliaryState, law: Law = actual
    ) -> tuple[Complex[Array, "i ..."], AuxiliaryState]:
        """Inputs of the linear rotor, and the rates of the others per second.

        `seen` are displacements and velocities of the ports, signals of the speed terms, and accelerations
        of the stations by the linear rotor at its centre speed. `law` gives the forces of the ports. All
        arrays may have lanes last, those of the equations too.
        """
        system, p = self.system, len(self.system.ports)
        turning = self.turning(at, others)
        terms = 0 if self.by_terms is None else self.by_terms.shape[1]
        rest = 2 * (p + self.read_coordinates) + terms
        ends = np.cumsum([p, p, terms, len(seen) - rest])
        place, velocity, signals, acceleration, q = jnp.split(seen, ends)
        signals = (turning.speed - self.centre) * signals
        nothing = jnp.zeros((system.n, *seen.shape[1:]), complex)
        given = jnp.concatenate([nothing[:p], acceleration, nothing[p + len(acceleration) :]])
        motion = plane(place, axis=1), plane(velocity, axis=1)
        none = jnp.zeros_like(others.bodies)
        bodies = others.bodies, turning.speed + others.bodies_rate, none
        still = Kinematics(turning, none, none, none, *bodies, others.states, at.time)
        own = of_each(system.ports, still.of_laws, *motion)
        motions = list(zip(system.ports, *motion, own, strict=True))
        contacts = [law(i, *motion) for i, motion in enumerate(motions)]
        contact = nothing[:0]
        if p:
            pairs = zip(motions, contacts, strict=True)
            x, y = jnp.stack([port.added(f, d, v) for (port, d, v, _), f in pairs], axis=1)
            contact = computed_once(jax.lax.complex(x, y))
            given = given + product(self.accelerance[:, :p], contact)
        if self.weight is not None:
            given = given + self.weight
        if self.by_terms is not None:
            given = given + product(self.by_terms, signals)
        ahead = lambda part: jnp.concatenate([part, nothing[p:]])
        r = still.back * ahead(place)
        drift = still.back * ahead(velocity) - 1j * turning.speed * r
        now = still._replace(r=r, drift=drift, absolute=jnp.zeros_like(r))
        spin, moments = None, self.moments
        if self.free:
            drive = drive_of(system)
            inertia = drive.inertia(system.blocks.polar)
            if moments is None:
                torque = drive.moment(turning.speed)
                spin = lambda then: torque / inertia
            else:
                torque = moments.torque(system, now, contacts, None)
                if self.corotating is not None:
                    torque = torque + self._turning_parts(now, *jnp.split(now.back * q, 2))
                spin = lambda then: moments.with_inertia(system, then, torque) / inertia
        then, force = with_accelerations(system, self.accelerance, now, now.back * given, spin)
        force = now.turn * force
        acceleration = then.turning.acceleration
        rates = AuxiliaryState(
            turning.speed + 0 * others.angle,
            acceleration + 0 * others.angle,
            others.bodies_rate,
            then.bodies_acceleration - acceleration,
            state_rates(system, now, contacts, law),
        )
        return jnp.concatenate([contact, signals, force[p:]]), rates

    def _turning_parts(self, now: Kinematics, r: Array, velocity: Array) -> Number:
        """Torque of parts that turn with the shaft, by all coordinates and their rates [N m]."""
        assert self.corotating is not None
        whole = now._replace(r=r, drift=velocity - 1j * now.turning.speed * r)
        return work(r, resistance(self.corotating, whole)).imag


def _at(parts, unit: Float[Array, "_ s"]):
    """Ports or races at the first coordinates."""
    pairs = zip(parts, unit, strict=False)
    return tuple(dataclasses.replace(part, row=own, column=own) for part, own in pairs)
