"""Branches of contact laws: forces continued smoothly past the ends of a branch, and margins to these."""

import dataclasses
from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Inexact

from ..core.quantities import Scalar
from ..equations.system import Branches, Port, port_forces
from .basis import packed
from .crossing import Crossing
from .feedthrough import force_through
from .ports import Contacts, Phase, PortForm, Reading, phase_at


Law = Callable[[Array, Array], Array]  # (2, p) forces by displacement and velocity of the ports


class BranchedPorts(eqx.Module):
    """Ports that read displacement, velocity and the acceleration without contact.

    Readings are `[Re, Im]` of the three by port, (2, 3, p) raveled; the acceleration is the rate
    of the velocity by the angle of revolution.
    """

    laws: tuple[Port, ...]
    speed: Scalar  # [rad/s]
    rate: Scalar  # [rad/s], of the angle in which the acceleration is a rate
    contacts: Contacts
    accelerance: Float[Array, "p p"]  # acceleration of the ports by a unit of force at each
    # Rates of displacement and velocity by the forces, instead of it, where ports have no mass:
    mobility: Float[Array, "p4 p2"] | None = None

    @classmethod
    def build(cls, form: PortForm) -> "BranchedPorts":
        motion, contacts = form.motion, form.contacts
        assert contacts is not None and motion.rows is not None and motion.columns is not None
        p = motion.rows.shape[0]
        output, old, generator = contacts.output_matrix, contacts.reading, form.basis.matrix()
        if form.axes is None:
            output = jnp.concatenate([output, output[p:] @ generator])
        else:
            velocity = output.reshape(2, 2, p, -1)[:, 1]
            output = _with_third(output, _rate(velocity @ generator, velocity, old.turn))
        still, cos, sin = old.still, old.cos, old.sin
        if still is not None:
            velocity = still.reshape(2, 2, p)[:, 1]
            still = _with_third(still, _rate(jnp.zeros((2, p)), velocity, old.turn))
        if cos is not None and sin is not None:
            along, across = (part.reshape(2, 2, p)[:, 1] for part in (cos, sin))
            cos = _with_third(cos, _rate(across, along, old.turn))
            sin = _with_third(sin, _rate(-along, across, old.turn))
        reading = Reading(jnp.zeros((6 * p, 0)), still, cos, sin, old.turn)
        accelerance = motion.rate * motion.rows @ motion.columns
        enters, through = contacts.input_matrix, contacts.through
        mobility = None if through is None else contacts.output_matrix @ enters
        contacts = Contacts(output, enters, reading, through)
        return cls(motion.ports, motion.speed, motion.rate, contacts, accelerance, mobility)

    def at(self, phase: Phase) -> "BranchedPorts":
        """The ports with what forces change at once along fixed axes, as `seen` is."""
        contacts, mobility = self.contacts, self.mobility
        if contacts.through is None or mobility is None or contacts.reading.turn is None:
            return self
        around = contacts.reading.around
        contacts = dataclasses.replace(contacts, through=around(phase, contacts.through))
        return dataclasses.replace(self, contacts=contacts, mobility=around(phase, mobility))

    @eqx.filter_jit
    def read(self, w: Inexact[Array, " m"], theta: Scalar) -> Float[Array, " p6"]:
        """Readings of the ports in a state, along fixed axes."""
        phase, reading = phase_at(theta), self.contacts.reading
        output = packed(self.contacts.output_matrix @ w)
        return reading.fixed(lambda: phase, output + reading.steady(phase))

    @eqx.filter_jit
    def branches(self, seen: Float[Array, " p6"]) -> tuple[Branches, ...]:
        """Branches of all laws in a state."""
        d, v, _ = self._parts(seen)
        if self.contacts.through is not None:
            d, v = self._moved(d, v, self.actual_forces(seen), self.contacts.through)
        ports = enumerate(self.laws)
        return tuple(port.branches(d[:, i], v[:, i], self.speed) for i, port in ports)

    @eqx.filter_jit
    def forces(self, branches: tuple[Branches, ...], seen: Float[Array, " p6"]):
        """`[Re, Im]` of the port forces by the formulas of given branches."""
        d, v, _ = self._parts(seen)
        return self._by_law(self._along(branches), d, v, self.contacts.through)

    @eqx.filter_jit
    def actual_forces(self, seen: Float[Array, " p6"]) -> Float[Array, " p2"]:
        """`[Re, Im]` of the port forces, with their jumps."""
        d, v, _ = self._parts(seen)
        law = lambda d, v: port_forces(self.laws, d, v, self.speed)
        return self._by_law(law, d, v, self.contacts.through)

    @eqx.filter_jit
    def crossing(
        self,
        branches: tuple[Branches, ...],
        seen: Float[Array, " p6"],
        speed_rate: Scalar | None = None,
    ) -> Crossing:
        """Margins of the conditions of given branches, and their rates, at a speed that may change."""
        d, v, a = self._parts(seen)

        margins = lambda d, v, speed=self.speed: self.margins(branches, d, v, speed)
        force = self.forces(branches, seen)
        through, mobility = self.contacts.through, self.mobility
        if through is None or mobility is None:
            a = a + force.reshape(2, -1) @ self.accelerance.T
            point, rates = (d, v), (v / self.rate, a)
            if speed_rate is not None:
                point, rates = (*point, self.speed), (*rates, speed_rate)
            return Crossing(*jax.jvp(margins, point, rates))

        def yielding(d, v, through):
            force = self._by_law(self._along(branches), d, v, through)
            return margins(*self._moved(d, v, force, through))

        more = jnp.moveaxis((mobility @ force).reshape(2, 2, -1), 1, 0)
        rates = v / self.rate + more[0], a + more[1], self._turning(through)
        return Crossing(*jax.jvp(yielding, (d, v, through), rates))

    def margins(
        self, branches: tuple[Branches, ...], d: Array, v: Array, speed: Scalar
    ) -> Float[Array, " c"]:
        """Margins of the conditions of given branches, by displacement and velocity of the ports."""
        ports = enumerate(zip(self.laws, branches, strict=True))
        found = [port.margins(b, d[:, i], v[:, i], speed) for i, (port, b) in ports]
        return jnp.concatenate([one.ravel() for one in jax.tree.leaves(found)])

    def forces_of(
        self,
        branches: tuple[Branches, ...],
        seen: Float[Array, " p6"],
        exhausted: Bool[Array, ""] | None,
    ) -> Float[Array, " p2"]:
        """The forces of given branches; the actual ones where `exhausted`."""
        along = self.forces(branches, seen)
        return along if exhausted is None else jnp.where(exhausted, self.actual_forces(seen), along)

    def _along(self, branches: tuple[Branches, ...]) -> Law:
        """Port forces by the formulas of given branches."""

        def law(d: Array, v: Array) -> Array:
            ports = zip(self.laws, branches, d.T, v.T, strict=True)
            found = [port.added(port.along(b, z, w, self.speed), z, w) for port, b, z, w in ports]
            return jnp.stack(found, axis=1)

        return law

    def _by_law(self, law: Law, d: Array, v: Array, through: Array | None) -> Float[Array, " p2"]:
        """`[Re, Im]` of the port forces of a law, from the motion of the ports without them."""
        if through is None:
            return law(d, v).ravel()
        parts = lambda seen: jnp.moveaxis(seen.reshape(2, 2, -1), 1, 0)
        seen = jnp.stack([d, v], axis=1).ravel()
        return force_through(lambda seen: law(*parts(seen)).ravel(), seen, through)

    def _moved(self, d: Array, v: Array, force: Array, through: Array) -> tuple[Array, Array]:
        """Displacement and velocity of the ports under their forces, (2, p) each."""
        more = jnp.moveaxis((through @ force).reshape(2, 2, -1), 1, 0)
        return d + more[0], v + more[1]

    def _turning(self, through: Float[Array, "p4 p2"]) -> Float[Array, "p4 p2"]:
        """Rate of `through` along fixed axes, by the angle, where it stands still in axes that turn."""
        turn = self.contacts.reading.turn
        if turn is None:
            return jnp.zeros_like(through)
        quarter = lambda part: jnp.concatenate([-jnp.split(part, 2)[1], jnp.split(part, 2)[0]])
        return turn * (quarter(through) + quarter(through.T).T)

    def _parts(self, seen: Float[Array, " p6"]) -> tuple[Array, Array, Array]:
        """Displacement, velocity and acceleration, (2, p) each."""
        d, v, a = jnp.moveaxis(seen.reshape(2, 3, -1), 1, 0)
        return d, v, a


def _with_third(part: Float[Array, "p4 ..."], third: Float[Array, "2 p ..."]) -> Array:
    """Readings of displacement and velocity, with a third quantity."""
    pair = part.reshape(2, 2, *third.shape[1:])
    return jnp.concatenate([pair, third[:, None]], axis=1).reshape(-1, *third.shape[2:])


def _rate(change: Float[Array, "2 ..."], velocity: Float[Array, "2 ..."], turn: Scalar | None):
    """Rate of a velocity that changes by `change` in axes that turn: `v' + i s v`."""
    if turn is None:
        return change
    x, y = velocity
    return change + turn * jnp.stack([-y, x])
