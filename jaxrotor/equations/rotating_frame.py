"""Transient: a system's equations of motion at a speed that varies, in the axes of the shaft."""

import dataclasses
from typing import Literal, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Complex, Float

from ..core.blocks import Blocks, Load
from ..core.elimination import eliminated
from ..core.plane import plane
from ..core.quantities import Scalar, known
from ..scene import Scene
from ..shafts.virtual import VirtualLine
from ..spins.base import Turning
from ..spins.constant import ConstantSpeed
from ..spins.drive import Drive
from .massless_coordinates import Known, MasslessCoordinates
from .pencil import Pencil
from .stationary_frame import check_known_in_time
from .system import LEAST_DIGITS, System, assemble, assemble_blocks, assemble_load, has_massless


class RotatingState(eqx.Module):
    """State of all that moves; what a scene does not draw has no entries.

    `q = r exp(i theta)`. Rates are over the reference rate, so entries are of one size.
    """

    r: Float[Array, "2 n"]  # [x, y] of the coordinates in the axes of the shaft
    r_rate: Float[Array, "2 n"]
    angle: Float[Array, " d"]  # theta [rad], d = 1 where the spin is free
    speed: Float[Array, " d"]  # Omega over the reference rate
    bodies: Float[Array, " b"]  # angles from the shaft, psi = phi - theta [rad]
    bodies_rate: Float[Array, " b"]


class Kinematics(NamedTuple):
    """What moves how at an instant, in the axes of the shaft."""

    turning: Turning
    r: Complex[Array, " n"]
    drift: Complex[Array, " n"]  # r. [1/s]
    absolute: Complex[Array, " n"]  # q.. exp(-i theta) [1/s^2]; 0 for coordinates without mass
    bodies: Float[Array, " b"]  # psi [rad]
    bodies_speed: Float[Array, " b"]  # phi. [rad/s]
    bodies_acceleration: Float[Array, " b"]  # phi.. [rad/s^2]

    @property
    def velocity(self) -> Complex[Array, " n"]:
        """`q. exp(-i theta)` [1/s]."""
        return self.drift + 1j * self.turning.speed * self.r

    @property
    def turn(self) -> Complex[Array, ""]:
        """`exp(i theta)`."""
        return jnp.exp(1j * self.turning.angle)


class Transient(eqx.Module):
    """`M q.. + (C - i Omega G) q. + (K - i Omega H) q = loads + contacts + bodies`, `Omega(t)` any.

        q = r exp(i theta),   q. = (r. + i Omega r) exp(i theta),   b = q.. exp(-i theta)
        M b = .. + (Omega^2 - i Omega.) u - Sum column m R (i phi.. - phi.^2) exp(i psi)
        I Omega. = M_drive - Im(u_row* b) + Im(r* (c r. + k_a r*)) + friction of contacts - drag of bodies

    The last line is a free spin's, `c` and `k_a` of whatever turns with the shaft: internal damping,
    unequal axes. The torque that drives the shaft acts along its bent axis, so that no term `Omega. G`
    appears.
    Accelerations that depend on each other (bodies by their inertia, a spin that is fed back) are the
    solution of a linear system, two unknowns a race and one for the spin. Its leading minors are
    inertias with fewer freedoms, and so of one sign.
    Sources: Filimonikhin, Goncharov (2011), eqs. (2.1), (2.2); Genta (2005), section 3.7.
    """

    system: System
    inverse: Float[Array, "n n"]  # of the inertia, zero for coordinates without mass
    rate: Scalar  # reference rate [rad/s]
    begin: Scalar  # angle at time 0 [rad]
    galerkin: Load | None  # loads by Galerkin on the coordinates, of a spin they feed back to
    resultant: Load | None  # and their resultants
    rotating: Blocks | None  # by Galerkin, of what turns with the shaft
    massless: MasslessCoordinates | None  # None where all coordinates have mass
    held: Bool[Array, ""] | None = None  # whether the spin is at rest and stays
    sense: Scalar | None = None  # of rotation, that Coulomb friction is against; None: of the speed

    @classmethod
    def of(
        cls,
        scene: Scene,
        rate: Scalar | None,
        begin: Scalar,
        massless: Known | Literal["unknown"] | None = None,
    ) -> "Transient":
        """Equations of a scene from the angle `begin` on; `rate` None is near its first frequency.

        `massless` is what `massless_of` says. Unknown ones that a nonlinear force acts on make the
        motion not a number.
        """
        system = assemble(scene)
        check_known_in_time(system)
        galerkin = resultant = rotating = None
        if isinstance(scene.spin, Drive) and scene.spin.feedback:
            line = VirtualLine.galerkin(system.line)
            galerkin = assemble_load(scene, line, Blocks())
            resultant = assemble_load(scene, VirtualLine.resultant(system.line), Blocks())
            rotating = turning_with(assemble_blocks(scene, line))
        inertia, inverse = system.blocks.inertia, jnp.zeros((system.n, system.n))
        coordinates = None
        if massless == "unknown":
            coordinates = MasslessCoordinates.of(system.blocks, system.n)
        elif massless is not None:
            coordinates = MasslessCoordinates.known(massless)
        if inertia is not None:
            invert = jnp.linalg.inv if coordinates is None else coordinates.inverse
            inverse = invert(inertia)
        if coordinates is not None and massless == "unknown":
            acted_on = [
                jnp.any(jnp.where(coordinates.either, f, 0.0) != 0) for _, f in nonlinear(system)
            ]
            inverse = jnp.where(jnp.any(jnp.array(acted_on, bool)), jnp.nan, inverse)
        rate = _reference(system) if rate is None else rate
        return cls(system, inverse, rate, begin, galerkin, resultant, rotating, coordinates)

    def hold(self, held: Array, sense: Scalar | None = None) -> "Transient":
        """The same with a free spin stopped, or not, and friction against one sense."""
        return dataclasses.replace(self, held=held, sense=sense)

    def __call__(self, time: Scalar, y: RotatingState, args: None = None) -> RotatingState:
        """Rates of the state per second."""
        del args
        now, rate = self.instant(time, y), self.rate
        speed, acceleration = now.turning.speed, now.turning.acceleration
        # r.. from q.. = (r.. + 2 i Omega r. + (i Omega. - Omega^2) r) exp(i theta)
        still = now.absolute - 2j * speed * now.drift - (1j * acceleration - speed**2) * now.r
        drift, free = rate * y.r_rate, y.speed.size
        if self.massless is not None:
            still = jnp.where(self.massless.either, 0.0, still)
            drift = plane(now.drift)
            if self.massless.undamped is not None:  # not integrated: computed at every instant
                drift = jnp.where(self.massless.undamped, 0.0, drift)
        return RotatingState(
            drift,
            plane(still) / rate,
            rate * y.speed,
            jnp.full(free, acceleration / rate),
            rate * y.bodies_rate,
            (now.bodies_acceleration - acceleration) / rate,
        )

    def breakaway_torque(self, time: Scalar, y: RotatingState) -> Array:
        """Torque on a spin at rest that dry friction has to hold [N m]."""
        if self.galerkin is None:
            return self._drive.moment(jnp.zeros(()), 0.0)
        held = self.hold(jnp.asarray(True), jnp.zeros(()))
        now = held.instant(time, y)
        return held._moment(now, held._torque(now))

    def instant(self, time: Scalar, y: RotatingState) -> Kinematics:
        """All accelerations, and what they belong to."""
        system = self.system
        r, drift = (v[0] + 1j * v[1] for v in (y.r, self.rate * y.r_rate))
        turning = self._turning(time, y)
        nothing = jnp.zeros_like(y.bodies)
        spinning = turning.speed + self.rate * y.bodies_rate
        now = Kinematics(turning, r, drift, jnp.zeros_like(r), y.bodies, spinning, nothing)
        if self.massless is not None:
            now = self._with_massless_motion(self.massless, now)
        push = -resistance(system.blocks, now) + acting(system.load, now)
        push = push + self.contact(now, lambda port: port.column)
        torque = None if self.galerkin is None else self._torque(now)

        def respond(unknown: Array) -> tuple[Kinematics, Array]:
            """The motion these accelerations would give, and by how much it contradicts them."""
            start = 0 if torque is None else 1
            seen = unknown[start::2] + 1j * unknown[start + 1 :: 2]
            spin = turning.acceleration if torque is None else unknown[0]
            bodies = self._roll(now, seen, spin)
            then = now._replace(
                turning=turning._replace(acceleration=spin), bodies_acceleration=bodies
            )
            change = 0.0 if system.load.unbalance is None else -1j * spin * system.load.unbalance
            thrust = self.thrust(then, lambda race: race.column)
            then = then._replace(absolute=self.inverse @ (push + change + thrust))
            gap = [race.row @ then.absolute for race in system.races]
            gap = jnp.stack(gap) - seen if gap else seen
            gap = plane(gap, axis=1).ravel()
            if torque is not None:
                gap = jnp.append(self._spin_up(then, torque) - spin, gap)
            return then, gap

        size = 2 * len(system.races) + (torque is not None)
        if not size:
            return respond(jnp.zeros(0))[0]
        zero = jnp.zeros(size)
        gain = jax.jacfwd(lambda unknown: respond(unknown)[1])(zero)
        return respond(eliminated(gain, -respond(zero)[1]))[0]

    # --- coordinates without mass

    def _with_massless_motion(self, massless: MasslessCoordinates, now: Kinematics) -> Kinematics:
        """The same instant with the displacements and velocities of massless coordinates."""
        imbalance = self._imbalance_of_forces
        now = now._replace(drift=jnp.where(massless.either, 0.0, now.drift))
        now = now._replace(r=massless.displacement(now.r, lambda r: imbalance(now._replace(r=r))))
        drift = massless.velocity(now.drift, lambda drift: imbalance(now._replace(drift=drift)))
        if massless.undamped is not None:
            # d/dt of `A r + b = 0`: the change of `A` and `b` is balanced by `A r.`
            angle, speed, acceleration = now.turning

            def at(angle: Array, speed: Array, r: Array) -> Array:
                return imbalance(now._replace(turning=Turning(angle, speed, acceleration), r=r))

            _, rate = jax.jvp(at, (angle, speed, now.r), (speed, acceleration, drift))
            constant = imbalance(now._replace(r=0 * now.r))
            residual = lambda r: imbalance(now._replace(r=r)) - constant + rate
            drift = jnp.where(massless.undamped, massless.displacement(0 * now.r, residual), drift)
        return now._replace(drift=drift)

    def _imbalance_of_forces(self, now: Kinematics) -> Array:
        """What inertia has to balance, with the sign of the left side; contacts and bodies excluded."""
        left = resistance(self.system.blocks, now) - acting(self.system.load, now)
        if self.system.load.unbalance is not None:
            left = left + 1j * now.turning.acceleration * self.system.load.unbalance
        return left + jnp.zeros_like(now.r)

    def condition_of_massless(self) -> Scalar:
        """Condition number of the equations for coordinates without mass, at the first speed."""
        assert self.massless is not None
        zero, none = jnp.zeros(self.system.n, complex), jnp.zeros(0)
        turning = Turning(
            jnp.asarray(self.begin), jnp.asarray(self.system.spin.speed), jnp.zeros(())
        )
        now = Kinematics(turning, zero, zero, zero, none, none, none)
        return self.massless.condition(
            lambda r: self._imbalance_of_forces(now._replace(r=r)),
            lambda drift: self._imbalance_of_forces(now._replace(drift=drift)),
        )

    # --- the spin

    def _turning(self, time: Scalar, y: RotatingState) -> Turning:
        """Rotation now; the acceleration of a spin that is fed back is not known yet."""
        polar = self.system.blocks.polar
        if not y.speed.size:
            angle, speed, acceleration = self.system.spin.turning(time, polar)
            return Turning(self.begin + angle, speed, acceleration)
        speed = self.rate * y.speed[0]
        acceleration = self._drive.moment(speed, self.sense) / self._drive.inertia(polar)
        return Turning(y.angle[0], speed, self._unless_held(acceleration))

    @property
    def _drive(self) -> Drive:
        assert isinstance(self.system.spin, Drive), "only a drive is integrated"
        return self.system.spin

    def _unless_held(self, acceleration: Array) -> Array:
        return acceleration if self.held is None else jnp.where(self.held, 0.0, acceleration)

    def _torque(self, now: Kinematics) -> Array:
        """Torque on the shaft less what depends on accelerations [N m]."""
        torque = self._drive.moment(now.turning.speed, self.sense)
        if self.rotating is not None:
            torque = torque + jnp.imag(jnp.vdot(now.r, resistance(self.rotating, now)))
        displacement, velocity = self._seen_by_ports(now)
        for i, port in enumerate(self.system.ports):
            torque = torque + port.torque(displacement[i], velocity[i], now.turning.speed)
        for race, part in self._races():
            rate = now.bodies_speed[part] - now.turning.speed
            torque = torque - race.bodies.race_radius * jnp.sum(race.bodies.drag(rate))
        return torque

    def _spin_up(self, then: Kinematics, torque: Array) -> Array:
        """`Omega.` by the balance of moments."""
        inertia = self._drive.inertia(self.system.blocks.polar)
        return self._unless_held(self._moment(then, torque) / inertia)

    def _moment(self, then: Kinematics, torque: Array) -> Array:
        """Torque on the shaft with what depends on accelerations [N m]."""
        assert self.galerkin is not None and self.resultant is not None
        whole = self.resultant.unbalance
        if self.galerkin.unbalance is not None:
            torque = torque - jnp.imag(jnp.vdot(self.galerkin.unbalance, then.absolute))
            gravity = self.system.load.gravity
            if gravity is not None and whole is not None:
                pull = jnp.conj(whole[0]) * gravity / then.turn
                torque = torque + pull.imag
        for race, part in self._races():
            bodies = race.bodies
            share = (bodies.rolling - 1) * bodies.race_radius**2 * bodies.masses
            late = then.bodies_acceleration[part] - then.turning.acceleration
            torque = torque + jnp.sum(share * late)
        return torque

    # --- bodies and contacts

    def _races(self):
        """Every race with the slice of its bodies."""
        start = 0
        for race in self.system.races:
            stop = start + race.bodies.places
            yield race, slice(start, stop)
            start = stop

    def _roll(
        self, now: Kinematics, seen: Complex[Array, " p"], spin: Scalar
    ) -> Float[Array, " b"]:
        """`phi..` of all bodies where their races accelerate by `seen` exp(i theta)."""
        found = [jnp.zeros(0)]
        gravity = self.system.load.gravity
        for (race, part), acceleration in zip(self._races(), seen, strict=True):
            bodies, psi = race.bodies, now.bodies[part]
            rate = now.bodies_speed[part] - now.turning.speed
            there = bodies.masses > 0
            force = bodies.drag(rate)
            for between in self.system.between:
                force = force + between.between(psi, rate, bodies)
            if gravity is not None:
                acceleration = acceleration - gravity / now.turn
            push = force / jnp.where(there, bodies.masses, 1.0)
            push = push - jnp.imag(jnp.exp(-1j * psi) * acceleration)
            lag = (bodies.rolling - 1) * spin
            found.append((push / bodies.race_radius + lag) / bodies.rolling)
        return jnp.concatenate(found)

    def thrust(self, now: Kinematics, column) -> Array:
        """Force of all bodies on the shaft beyond their mass carried by it."""
        force = jnp.zeros(())
        for race, part in self._races():
            whirl = 1j * now.bodies_acceleration[part] - now.bodies_speed[part] ** 2
            whirl = race.bodies.masses * whirl * jnp.exp(1j * now.bodies[part])
            force = force - column(race) * race.bodies.race_radius * jnp.sum(whirl)
        return force

    def contact(self, now: Kinematics, column) -> Array:
        """Force of all contacts on the shaft, in its axes."""
        force = jnp.zeros(())
        displacement, velocity = self._seen_by_ports(now)
        for i, port in enumerate(self.system.ports):
            both = port.forces(displacement[i], velocity[i], now.turning.speed).sum(0)
            force = force + column(port) * (both[0] + 1j * both[1]) / now.turn
        return force

    def _seen_by_ports(self, now: Kinematics) -> tuple[list[Array], list[Array]]:
        """Displacement and velocity [x, y] of every port."""
        rows = [port.row for port in self.system.ports]
        displacement = [plane(row @ now.r * now.turn) for row in rows]
        return displacement, [plane(row @ now.velocity * now.turn) for row in rows]


def _reference(system: System) -> Scalar:
    """Rate [rad/s] by which time is scaled: near the first natural frequency, else 1."""
    if not system.n:
        return jnp.ones(())
    rate = Pencil.mean(system.at_speed(jnp.zeros(()))).rate
    return jax.lax.stop_gradient(jnp.where(jnp.isfinite(rate) & (rate > 0), rate, 1.0))


def resistance(blocks: Blocks, now: Kinematics) -> Array:
    """`M q.. + (C - i Omega G) q. + (K - i Omega H) q + ..` times `exp(-i theta)`, without `M`.

    Rows are those of the blocks: equations of motion, or work on virtual displacements.
    """
    speed, r, v = now.turning.speed, now.r, now.velocity
    back = jnp.conj(now.turn) ** 2  # what is fixed in space turns backward twice
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
    return sum((part @ vector for part, vector in parts if part is not None), start=jnp.zeros(()))


def turning_with(blocks: Blocks) -> Blocks | None:
    """Dampers and unequal stiffness that turn with the shaft; None where there are none."""
    found = Blocks(
        damping=blocks.circulatory,
        circulatory=blocks.circulatory,
        skew_damping=blocks.skew_circulatory,
        skew_circulatory=blocks.skew_circulatory,
        rotating_damping=blocks.rotating_damping,
        rotating_stiffness=blocks.rotating_stiffness,
    )
    return found if jax.tree.leaves(found) else None


def acting(load: Load, now: Kinematics) -> Array:
    """`constant exp(-i theta) + Omega^2 unbalance`; the part by `Omega.` is known later."""
    force = jnp.zeros(())
    if load.constant is not None:
        force = force + load.constant / now.turn
    if load.unbalance is not None:
        force = force + now.turning.speed**2 * load.unbalance
    return force


def nonlinear(system: System) -> list[tuple[Scalar, Array]]:
    """Station [m] and column of everything that acts by a law of its own: contacts and races."""
    return [(acting.at, acting.column) for acting in (*system.ports, *system.races)]


def massless_of(scene: Scene, system: System | None = None) -> Known | Literal["unknown"] | None:
    """Which coordinates of a scene have no mass: damped and undamped ones; None if all have some.

    They are "unknown" where masses or dampings are traced, and nothing is checked then. `system` are
    the equations of the scene, where they are at hand. Raises where their motion is not determined or
    cannot be eliminated.
    """
    if has_massless(scene, system) is False:
        return None
    system, coordinates, condition = _massless(scene)
    if not all(known(mask) for mask in (coordinates.damped, coordinates.undamped)):
        return "unknown"
    massless = np.asarray(coordinates.either)
    acted_on = lambda column: known(column) and np.any(np.asarray(column)[massless] != 0)
    for at, column in nonlinear(system):
        if acted_on(column):
            raise ValueError(
                f"A contact or balls act at {float(at):g} m, where the rotor has no mass; "
                "put a Disc there."
            )
    steady = isinstance(scene.spin, ConstantSpeed)
    if not steady and system.load.unbalance is not None and acted_on(system.load.unbalance):
        raise ValueError(
            "An Unbalance acts where the rotor has no mass, which is possible at constant speed only; "
            "put a Disc there."
        )
    rounding = jnp.finfo(jnp.result_type(condition)).eps
    if known(condition) and not float(condition) * rounding < LEAST_DIGITS:
        raise ValueError(
            "The motion of a part of the rotor without mass is not determined: it is held or damped "
            "along one direction only, or by gyroscopic moments alone while the rotor does not turn; put "
            "a Disc there, give the Disc that tilts a `diametral` inertia, or damp every direction."
        )
    damped, undamped = (tuple(np.asarray(mask).tolist()) for mask in jax.tree.leaves(coordinates))
    return damped, undamped


@eqx.filter_jit
def _massless(scene: Scene) -> tuple[System, MasslessCoordinates, Scalar]:
    """Equations, coordinates without mass, and the condition number of what determines these."""
    transient = Transient.of(scene, jnp.ones(()), jnp.zeros(()), "unknown")
    assert transient.massless is not None
    return transient.system, transient.massless, transient.condition_of_massless()
