"""Balance of moments about the axis, of a spin with feedback from the rotor."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Complex

from ..core.blocks import Blocks, Load
from ..core.quantities import Scalar
from ..scene import Scene
from ..shafts.virtual import VirtualLine
from ..spins.drive import Drive
from .forces import Contacts, contact_torque, races_of, resistance
from .kinematics import Kinematics
from .parts import assemble_blocks, assemble_load
from .system import System


class MomentBalance(eqx.Module):
    """`I Omega. = M_drive - Im(u_row* b) + Im(r* (c r. + k_a r*)) + contacts - bodies`.

    Here `b = q.. exp(-i theta)`, `u_row` is the unbalance, and `c` and `k_a` are the blocks of the parts
    that rotate with the shaft: internal damping, unequal axes. Weight adds its moment about the axis, and
    an unequal stiffness to a line beside that of the shaft, whose force at rest is `f exp(2 i theta)`,
    `Im(twist exp(2 i theta) - 2 r* f exp(i theta))`.
    """

    galerkin: Load  # work of the loads on the coordinates
    resultant: Load  # their resultants
    corotating: Blocks | None  # work, by all that rotates with the shaft; None where nothing does

    @classmethod
    def of(cls, scene: Scene, system: System) -> "MomentBalance | None":
        """The balance of a scene whose drive has feedback, else None."""
        if not (isinstance(scene.spin, Drive) and scene.spin.feedback):
            return None
        line = VirtualLine.galerkin(system.line)
        load = assemble_load(scene, line, Blocks())
        if load.carried is not None:
            raise ValueError(
                "The disc of an OldhamCoupling is for a speed that is given in time, but the drive of the "
                "scene has `feedback`; leave that out, or the coupling."
            )
        return cls(
            load,
            assemble_load(scene, VirtualLine.resultant(system.line), Blocks()),
            _corotating(assemble_blocks(scene, line)),
        )

    def torque(
        self, system: System, now: Kinematics, contacts: Contacts, sense: Scalar | None
    ) -> Array:
        """Torque on the shaft without the part that depends on accelerations [N m].

        `contacts` are the forces of these. Coulomb friction of the drive opposes `sense`, by default
        that of the speed.
        """
        torque = drive_of(system).moment(now.turning.speed, sense)
        if self.corotating is not None:
            torque = torque + work(now.r, resistance(self.corotating, now)).imag
        torque = torque + contact_torque(system, now, contacts)
        if self.galerkin.twice is not None and self.galerkin.twist is not None:
            beside = work(now.r, self.galerkin.twice)
            torque = torque + jnp.imag((self.galerkin.twist * now.turn - 2 * beside) * now.turn)
        for race, part in races_of(system):
            rate = now.bodies_speed[part] - now.turning.speed
            torque = torque - race.bodies.race_radius * jnp.sum(race.bodies.drag(rate), axis=0)
        return torque

    def with_inertia(self, system: System, now: Kinematics, torque: Array) -> Array:
        """`torque` and the part that depends on the accelerations `now` [N m]."""
        whole = self.resultant.unbalance
        if self.galerkin.unbalance is not None:
            torque = torque - work(self.galerkin.unbalance, now.absolute).imag
            gravity = system.load.gravity
            if gravity is not None and whole is not None:
                pull = jnp.conj(whole[0]) * gravity * now.back
                torque = torque + pull.imag
        for race, part in races_of(system):
            bodies = race.bodies
            share = (bodies.rolling - 1) * bodies.race_radius**2 * bodies.masses
            late = now.bodies_acceleration[part] - now.turning.acceleration
            torque = torque + jnp.sum(share * late, axis=0)
        return torque


def work(displacement: Complex[Array, "n ..."], force: Array) -> Complex[Array, "..."]:
    """`Sum conj(displacement) force`."""
    return jnp.sum(jnp.conj(displacement) * force, axis=0)


def drive_of(system: System) -> Drive:
    """The drive of a system whose spin is integrated."""
    assert isinstance(system.spin, Drive), "only a drive is integrated"
    return system.spin


def _corotating(blocks: Blocks) -> Blocks | None:
    """Dampers and unequal stiffness that rotate with the shaft; None where there are none."""
    found = Blocks(
        damping=blocks.circulatory,
        circulatory=blocks.circulatory,
        skew_damping=blocks.skew_circulatory,
        skew_circulatory=blocks.skew_circulatory,
        rotating_damping=blocks.rotating_damping,
        rotating_stiffness=blocks.rotating_stiffness,
    )
    return found if jax.tree.leaves(found) else None
