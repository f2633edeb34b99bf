"""Branches of contact: forces continued smoothly, and how far they are from changing their law."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Inexact

from ..core.quantities import Scalar
from ..equations.stationary_frame import Motion
from ..equations.system import Branches
from .basis import packed
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
        old, generator = contacts.reading, form.basis.matrix()
        if form.axes is None:
            see = jnp.concatenate([contacts.see, contacts.see[p:] @ generator])
        else:
            velocity = contacts.see.reshape(2, 2, p, -1)[:, 1]
            see = _with_third(contacts.see, _carried(velocity @ generator, velocity, old.turn))
        still, cos, sin = old.still, old.cos, old.sin
        if still is not None:
            velocity = still.reshape(2, 2, p)[:, 1]
            still = _with_third(still, _carried(jnp.zeros((2, p)), velocity, old.turn))
        if cos is not None and sin is not None:
            along, across = (part.reshape(2, 2, p)[:, 1] for part in (cos, sin))
            cos = _with_third(cos, _carried(across, along, old.turn))
            sin = _with_third(sin, _carried(-along, across, old.turn))
        reading = Reading(jnp.zeros((6 * p, 0)), still, cos, sin, old.turn)
        feed = motion.rate * motion.rows @ motion.columns
        return cls(motion, Contacts(see, contacts.drive, reading), feed)

    def read(self, w: Inexact[Array, " m"], theta: Scalar) -> Float[Array, " p6"]:
        """The ports in a state, along fixed axes."""
        phase, reading = phase_at(theta), self.contacts.reading
        return reading.fixed(lambda: phase, packed(self.contacts.see @ w) + reading.steady(phase))

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


def _with_third(part: Float[Array, "p4 ..."], third: Float[Array, "2 p ..."]) -> Array:
    """Displacement and velocity with an acceleration behind them, each of its ports."""
    pair = part.reshape(2, 2, *third.shape[1:])
    return jnp.concatenate([pair, third[:, None]], axis=1).reshape(-1, *third.shape[2:])


def _carried(rate: Float[Array, "2 ..."], velocity: Float[Array, "2 ..."], turn: Scalar | None):
    """Rate of a velocity whose axes turn: `v' + i s v`."""
    if turn is None:
        return rate
    x, y = velocity
    return rate + turn * jnp.stack([-y, x])
