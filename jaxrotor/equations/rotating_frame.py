"""Equations of motion at a speed that varies, in the axes of the shaft. See docs/concepts/frames.md."""

import dataclasses
from typing import Any, Literal

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from ..core import linalg
from ..core.blocks import Blocks
from ..core.compiled import compiled
from ..core.plane import plane
from ..core.quantities import Scalar, known
from ..scene import Scene
from ..spins.base import Turning
from ..spins.constant import ConstantSpeed
from .accelerations import with_accelerations
from .forces import (
    applied_force,
    contact_force,
    contacts_of,
    nonlinear_columns,
    resistance,
    state_rates,
)
from .kinematics import Kinematics, RotatingState
from .massless_coordinates import Known, Massless, MasslessCoordinates
from .moments import MomentBalance, drive_of
from .pencil import Pencil
from .stationary_frame import check_known_in_time
from .system import LEAST_DIGITS, System, assemble, has_massless


class Transient(eqx.Module):
    """`M q.. + (C - i Omega G) q. + (K - i Omega H) q = loads + contacts + bodies` at any `Omega(t)`.

        q = r exp(i theta),   q. = (r. + i Omega r) exp(i theta),   b = q.. exp(-i theta)
        M b = .. + (Omega^2 - i Omega.) u - Sum column m R (i phi.. - phi.^2) exp(i psi)
        I Omega. = moments about the axis, see `MomentBalance`

    The last line is that of a free spin. The torque that drives the shaft acts along its bent axis, so
    that no term `Omega. G` appears.
    Accelerations that depend on each other are those of `with_accelerations`.
    Sources: Filimonikhin, Goncharov (2011), eqs. (2.1), (2.2); Genta (2005), section 3.7.
    """

    system: System
    inverse: Float[Array, "n n"]  # of the inertia, zero for coordinates without mass
    rate: Scalar  # reference rate [rad/s]
    begin: Scalar  # angle at time 0 [rad]
    moments: MomentBalance | None  # of a spin with feedback
    massless: MasslessCoordinates | None  # None where all coordinates have mass
    held: Bool[Array, ""] | None = None  # whether the spin is at rest and stays
    sense: Scalar | None = None  # of rotation, which Coulomb friction opposes; None: of the speed

    @classmethod
    def of(
        cls,
        scene: Scene,
        rate: Scalar | None,
        begin: Scalar,
        massless: Known | Literal["unknown"] | None = None,
        system: System | None = None,
    ) -> "Transient":
        """Equations of a scene from the angle `begin` on; `rate` None is near its first frequency.

        `massless` is the result of `massless_of`. If it is "unknown" and a nonlinear force acts on a
        coordinate without mass, the motion is NaN. `system` are its equations, where they are at hand.
        """
        system = assemble(scene) if system is None else system
        check_known_in_time(system)
        if system.tabled is not None:
            first = system.blocks_within(system.spin.speed)
            system = dataclasses.replace(system, blocks=first)
        inertia, inverse = system.blocks.inertia, jnp.zeros((system.n, system.n))
        coordinates = None
        if massless == "unknown":
            coordinates = MasslessCoordinates.of(system.blocks, system.n)
        elif massless is not None:
            coordinates = MasslessCoordinates.known(massless)
        if inertia is not None:
            invert = linalg.inv if coordinates is None else coordinates.inverse
            inverse = invert(inertia)
        if coordinates is not None and massless == "unknown":
            acted_on = [
                jnp.any(jnp.where(coordinates.either, column, 0.0) != 0)
                for _, column in nonlinear_columns(system)
            ]
            inverse = jnp.where(jnp.any(jnp.array(acted_on, bool)), jnp.nan, inverse)
        rate = _reference_rate(system) if rate is None else rate
        return cls(system, inverse, rate, begin, MomentBalance.of(scene, system), coordinates)

    def hold(self, held: Array, sense: Scalar | None = None) -> "Transient":
        """The same with a free spin stopped where `held`, and friction that opposes `sense`."""
        return dataclasses.replace(self, held=held, sense=sense)

    @eqx.filter_jit
    def __call__(self, time: Scalar, y: RotatingState, args: None = None) -> RotatingState:
        """Rates of the state per second."""
        del args
        now, rate = self.instant(time, y), self.rate
        speed, acceleration = now.turning.speed, now.turning.acceleration
        # r.. from q.. = (r.. + 2 i Omega r. + (i Omega. - Omega^2) r) exp(i theta)
        relative = now.absolute - 2j * speed * now.drift - (1j * acceleration - speed**2) * now.r
        drift, free = rate * y.r_rate, y.speed.size
        if self.massless is not None:
            relative = jnp.where(self.massless.either, 0.0, relative)
            drift = plane(now.drift)
            if self.massless.undamped is not None:  # not integrated: computed at every instant
                drift = jnp.where(self.massless.undamped, 0.0, drift)
        return RotatingState(
            drift,
            plane(relative) / rate,
            rate * y.speed,
            jnp.full(free, acceleration / rate),
            rate * y.bodies_rate,
            (now.bodies_acceleration - acceleration) / rate,
            state_rates(self.system, now),
        )

    def breakaway_torque(self, time: Scalar, y: RotatingState) -> Array:
        """Torque on a spin at rest that dry friction has to hold [N m]."""
        if self.moments is None:
            return drive_of(self.system).moment(jnp.zeros(()), 0.0)
        held = self.hold(jnp.asarray(True), jnp.zeros(()))
        now = held.instant(time, y)
        contacts = contacts_of(self.system, now)
        torque = self.moments.torque(self.system, now, contacts, held.sense)
        return self.moments.with_inertia(self.system, now, torque)

    def instant(self, time: Scalar, y: RotatingState) -> Kinematics:
        """Motion at an instant, with all accelerations."""
        system, moments = self.system, self.moments
        r, drift = (v[0] + 1j * v[1] for v in (y.r, self.rate * y.r_rate))
        turning = self._turning(time, y)
        nothing = jnp.zeros_like(y.bodies)
        spinning = turning.speed + self.rate * y.bodies_rate
        bodies = y.bodies, spinning, nothing
        now = Kinematics(turning, r, drift, jnp.zeros_like(r), *bodies, y.states, time)
        if self.massless is not None:
            now = self._with_massless_motion(self.massless, now)
        push = -resistance(self._blocks(turning.speed), now)
        contacts = contacts_of(system, now)
        push = push + contact_force(system, now, contacts, lambda port: port.column)
        given, spin = self.inverse @ (push + jnp.zeros_like(r)), None
        if moments is not None:
            torque = moments.torque(system, now, contacts, self.sense)
            spin = lambda then: self._acceleration(moments.with_inertia(system, then, torque))
        return with_accelerations(system, self.inverse, now, given, spin)[0]

    def _blocks(self, speed: Scalar) -> Blocks:
        """Blocks at a speed; outside of tables those at their end, where no solver gets lost."""
        system = self.system
        if system.tabled is None or isinstance(system.spin, ConstantSpeed):
            return system.blocks
        return system.blocks_within(speed)

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
                turning = now.turning._replace(angle=angle, speed=speed)
                return imbalance(now._replace(turning=turning, r=r))

            _, rate = jax.jvp(at, (angle, speed, now.r), (speed, acceleration, drift))
            constant = imbalance(now._replace(r=0 * now.r))
            residual = lambda r: imbalance(now._replace(r=r)) - constant + rate
            drift = jnp.where(massless.undamped, massless.displacement(0 * now.r, residual), drift)
        return now._replace(drift=drift)

    def _imbalance_of_forces(self, now: Kinematics) -> Array:
        """`resistance - loads`, which inertia has to balance, without contacts and bodies."""
        left = resistance(self._blocks(now.turning.speed), now) - applied_force(
            self.system.load, now
        )
        return left + jnp.zeros_like(now.r)

    def condition_of_massless(self) -> Scalar:
        """Condition number of the equations for coordinates without mass, at the first speed."""
        assert self.massless is not None
        zero, none = jnp.zeros(self.system.n, complex), jnp.zeros(0)
        turning = Turning(
            jnp.asarray(self.begin), jnp.asarray(self.system.spin.speed), jnp.zeros(())
        )
        now = Kinematics(turning, zero, zero, zero, none, none, none, none)
        return self.massless.condition(
            lambda r: self._imbalance_of_forces(now._replace(r=r)),
            lambda drift: self._imbalance_of_forces(now._replace(drift=drift)),
        )

    # --- the spin

    def _turning(self, time: Scalar, y: RotatingState) -> Turning:
        """Rotation now; the acceleration of a spin with feedback is a first estimate."""
        if not y.speed.size:
            known = self.system.spin.turning(time, self.system.blocks.polar)
            return known._replace(angle=self.begin + known.angle)
        speed = self.rate * y.speed[0]
        torque = drive_of(self.system).moment(speed, self.sense)
        return Turning(y.angle[0], speed, self._acceleration(torque))

    def _acceleration(self, torque: Array) -> Array:
        """`Omega.` under a torque [N m], zero where the spin is held."""
        acceleration = torque / drive_of(self.system).inertia(self.system.blocks.polar)
        return acceleration if self.held is None else jnp.where(self.held, 0.0, acceleration)


def _reference_rate(system: System) -> Scalar:
    """Rate [rad/s] by which time is scaled: near the first natural frequency, else 1."""
    if not system.n:
        return jnp.ones(())
    rate = Pencil.mean(system.at_rest).rate
    return jax.lax.stop_gradient(jnp.where(jnp.isfinite(rate) & (rate > 0), rate, 1.0))


def massless_of(scene: Scene, system: System | None = None) -> Known | Literal["unknown"] | None:
    """Masks of the damped and the undamped massless coordinates of a scene; None if all have mass.

    The result is "unknown", and nothing is checked, where masses or dampings are traced. `system` are
    the equations of the scene, where they are at hand. Raises where the motion of massless coordinates
    is not determined or cannot be eliminated.
    """
    if has_massless(scene, system) is False:
        return None
    system, coordinates, condition = _massless(scene, system)
    if not _all_known(coordinates):
        return "unknown"
    for at, column in nonlinear_columns(system):
        if _acts_on(column, coordinates.either):
            raise ValueError(
                f"A contact or balls act at {float(at):g} m, where the rotor has no mass; put a Disc "
                "there. At constant speed a contact without friction can also be simulated by whole "
                "revolutions if `solver` is left out."
            )
    inertial = system.load.unbalance, system.load.carried, system.load.carried_twice
    if not isinstance(scene.spin, ConstantSpeed):
        for load in inertial:
            if load is not None and _acts_on(load, coordinates.either):
                raise ValueError(
                    "An Unbalance or an OldhamCoupling acts where the rotor has no mass, which is "
                    "possible at constant speed only; put a Disc there."
                )
    _check_determined(condition)
    return _constant(coordinates)


def massless_in_steps(scene: Scene, system: System) -> tuple[Massless | None, str | None]:
    """Massless coordinates that exponential steps eliminate at constant speed, or why they cannot.

    Both are None where all coordinates have mass, and where masses are traced. Raises where the motion
    of massless coordinates is not determined.
    """
    if not has_massless(scene, system):
        return None, None
    if system.blocks.inertia is None:
        return None, "no part of the rotor has mass"
    system, coordinates, condition = _massless(scene, system)
    if not _all_known(coordinates):
        return None, "dampings are traced, so that one may be zero where the rotor has no mass"
    _check_determined(condition)
    pressed = False
    for port in (*system.ports, *system.deviators):
        if not known(port.column):
            return None, "the station of a contact is traced, which may be without mass"
        if not _acts_on(port.column, coordinates.either):
            continue
        pressed, at = True, f"at {float(port.at):g} m, where the rotor has no mass,"
        for stack in port.laws:
            hardness = jax.vmap(lambda law: law.hardness())(stack)
            if not _is_zero(hardness.friction):
                return None, f"{at} a contact rubs"
            if _acts_on(port.column, coordinates.undamped) and not _is_zero(hardness.damping):
                return None, f"{at} a contact has damping and the rotor none"
    return Massless(*_constant(coordinates), pressed), None


def _all_known(coordinates: MasslessCoordinates) -> bool:
    return all(known(mask) for mask in (coordinates.damped, coordinates.undamped))


def _acts_on(column: Array, mask: Any) -> bool:
    """Whether a force acts on some coordinates, where that is known."""
    return known(column) and bool(np.any(np.asarray(column)[np.asarray(mask)] != 0))


def _is_zero(values: Array) -> bool:
    return known(values) and not np.any(np.asarray(values))


def _constant(coordinates: MasslessCoordinates) -> Known:
    """Masks of the damped and the undamped coordinates, as constants."""
    damped, undamped = (tuple(np.asarray(mask).tolist()) for mask in jax.tree.leaves(coordinates))
    return damped, undamped


def _check_determined(condition: Scalar) -> None:
    """Raise where the equations do not determine the motion of massless coordinates."""
    rounding = jnp.finfo(jnp.result_type(condition)).eps
    if known(condition) and not float(condition) * rounding < LEAST_DIGITS:
        raise ValueError(
            "The motion of a part of the rotor without mass is not determined: it is held or damped "
            "along one direction only, or by gyroscopic moments alone while the rotor does not turn; put "
            "a Disc there, give the Disc that tilts a `diametral` inertia, or damp every direction."
        )


@compiled
def _massless(scene: Scene, system: System | None) -> tuple[System, MasslessCoordinates, Scalar]:
    """Equations, coordinates without mass, and the condition number of the equations for these."""
    transient = Transient.of(scene, jnp.ones(()), jnp.zeros(()), "unknown", system)
    assert transient.massless is not None
    return transient.system, transient.massless, transient.condition_of_massless()
