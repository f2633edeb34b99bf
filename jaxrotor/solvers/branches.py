"""Branches of contact laws: forces continued smoothly past the ends of a branch, and margins to these."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Complex, Float

from ..core.quantities import Scalar
from ..equations.stationary_frame import Motion
from ..equations.system import Branches
from .crossing import Crossing
from .ports import Contacts, PortForm, Reading, phase_at


class BranchedPorts(eqx.Module):
    """Ports that read displacement, velocity and the acceleration without contact.

    Readings are `[Re, Im]` of the three by port, (2, 3, p) raveled; the acceleration is the rate
    of the velocity by the angle of revolution.
    """

    motion: Motion
    contacts: Contacts
    accelerance: Float[Array, "p p"]  # acceleration of the ports by a unit of force at each

    @classmethod
    def build(cls, form: PortForm) -> "BranchedPorts":
        motion, contacts = form.motion, form.contacts
        assert contacts is not None and motion.rows is not None and motion.columns is not None
        p = motion.rows.shape[0]
        velocity = contacts.output_matrix[p:]
        output = jnp.concatenate([contacts.output_matrix, velocity @ form.basis.matrix()])
        old = contacts.reading
        still, cos, sin = old.still, old.cos, old.sin
        if still is not None:
            still = _with_third(still, jnp.zeros((2, p)))
        if cos is not None and sin is not None:
            along, across = (part.reshape(2, 2, p)[:, 1] for part in (cos, sin))
            cos, sin = _with_third(cos, across), _with_third(sin, -along)
        reading = Reading(jnp.zeros((6 * p, 0)), still, cos, sin)
        accelerance = motion.rate * motion.rows @ motion.columns
        return cls(motion, Contacts(output, contacts.input_matrix, reading), accelerance)

    def read(self, w: Complex[Array, " m"], theta: Scalar) -> Float[Array, " p6"]:
        """Readings of the ports in a state."""
        output = self.contacts.output_matrix @ w
        steady = self.contacts.reading.steady(phase_at(theta))
        return jnp.concatenate([output.real, output.imag]) + steady

    def branches(self, seen: Float[Array, " p6"]) -> tuple[Branches, ...]:
        """Branches of all laws in a state."""
        d, v, _ = self._parts(seen)
        speed = self.motion.speed
        ports = enumerate(self.motion.ports)
        return tuple(port.branches(d[:, i], v[:, i], speed) for i, port in ports)

    def forces(self, branches: tuple[Branches, ...], seen: Float[Array, " p6"]):
        """`[Re, Im]` of the port forces by the formulas of given branches."""
        d, v, _ = self._parts(seen)
        ports = enumerate(zip(self.motion.ports, branches, strict=True))
        along = [port.along(b, d[:, i], v[:, i], self.motion.speed) for i, (port, b) in ports]
        return jnp.stack([force.sum(0) for force in along], axis=1).ravel()

    def actual_forces(self, seen: Float[Array, " p6"]) -> Float[Array, " p2"]:
        """`[Re, Im]` of the port forces, with their jumps."""
        d, v, _ = self._parts(seen)
        return self.motion.port_forces(d, v).ravel()

    def crossing(self, branches: tuple[Branches, ...], seen: Float[Array, " p6"]) -> Crossing:
        """Margins of the conditions of given branches, and their rates."""
        d, v, a = self._parts(seen)
        a = a + self.forces(branches, seen).reshape(2, -1) @ self.accelerance.T

        def margins(d, v):
            ports = enumerate(zip(self.motion.ports, branches, strict=True))
            found = [port.margins(b, d[:, i], v[:, i], self.motion.speed) for i, (port, b) in ports]
            return jnp.concatenate([one.ravel() for one in jax.tree.leaves(found)])

        return Crossing(*jax.jvp(margins, (d, v), (v / self.motion.rate, a)))

    def _parts(self, seen: Float[Array, " p6"]) -> tuple[Array, Array, Array]:
        """Displacement, velocity and acceleration, (2, p) each."""
        d, v, a = jnp.moveaxis(seen.reshape(2, 3, -1), 1, 0)
        return d, v, a


def _with_third(part: Float[Array, " p4"], third: Float[Array, "2 p"]) -> Float[Array, " p6"]:
    """Readings of displacement and velocity, with a third quantity."""
    pair = part.reshape(2, 2, -1)
    return jnp.concatenate([pair, third[:, None]], axis=1).ravel()
