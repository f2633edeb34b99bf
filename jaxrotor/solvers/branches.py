"""Branches of contact: forces continued smoothly, and how far they are from changing their law."""

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
    """Ports that read displacement, velocity and, but for contact, acceleration.

    Readings are `[Re, Im]` of the three by port, (2, 3, p) raveled; the acceleration is the rate
    of the velocity by the angle of revolution.
    """

    motion: Motion
    contacts: Contacts
    feed: Float[Array, "p p"]  # acceleration by forces

    @classmethod
    def build(cls, form: PortForm) -> "BranchedPorts":
        motion, contacts = form.motion, form.contacts
        assert contacts is not None and motion.rows is not None and motion.columns is not None
        p = motion.rows.shape[0]
        see = jnp.concatenate([contacts.see, contacts.see[p:] @ form.basis.matrix()])
        old = contacts.reading
        still, cos, sin = old.still, old.cos, old.sin
        if still is not None:
            still = _with_third(still, jnp.zeros((2, p)))
        if cos is not None and sin is not None:
            along, across = (part.reshape(2, 2, p)[:, 1] for part in (cos, sin))
            cos, sin = _with_third(cos, across), _with_third(sin, -along)
        reading = Reading(jnp.zeros((6 * p, 0)), still, cos, sin)
        feed = motion.rate * motion.rows @ motion.columns
        return cls(motion, Contacts(see, contacts.drive, reading), feed)

    def read(self, w: Complex[Array, " m"], theta: Scalar) -> Float[Array, " p6"]:
        """The ports in a state."""
        seen = self.contacts.see @ w
        return jnp.concatenate([seen.real, seen.imag]) + self.contacts.reading.steady(
            phase_at(theta)
        )

    def branches(self, seen: Float[Array, " p6"]) -> tuple[Branches, ...]:
        """The branches that hold."""
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

    def as_they_are(self, seen: Float[Array, " p6"]) -> Float[Array, " p2"]:
        """`[Re, Im]` of the port forces, jumps and all."""
        d, v, _ = self._parts(seen)
        return self.motion.port_forces(d, v).ravel()

    def crossing(self, branches: tuple[Branches, ...], seen: Float[Array, " p6"]) -> Crossing:
        """How near the branches are to their ends."""
        d, v, a = self._parts(seen)
        a = a + self.forces(branches, seen).reshape(2, -1) @ self.feed.T

        def margins(d, v):
            ports = enumerate(zip(self.motion.ports, branches, strict=True))
            found = [port.margins(b, d[:, i], v[:, i], self.motion.speed) for i, (port, b) in ports]
            return jnp.concatenate([one.ravel() for one in jax.tree.leaves(found)])

        return Crossing(*jax.jvp(margins, (d, v), (v / self.motion.rate, a)))

    def _parts(self, seen: Float[Array, " p6"]) -> tuple[Array, Array, Array]:
        d, v, a = jnp.moveaxis(seen.reshape(2, 3, -1), 1, 0)
        return d, v, a


def _with_third(part: Float[Array, " p4"], third: Float[Array, "2 p"]) -> Float[Array, " p6"]:
    pair = part.reshape(2, 2, -1)
    return jnp.concatenate([pair, third[:, None]], axis=1).ravel()
