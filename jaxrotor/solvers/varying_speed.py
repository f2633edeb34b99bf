"""Exponential steps at a speed that varies: the linear rotor exactly at one speed, the rest by stages.

    w' = A(Omega_c) w + B f(C w) + P (Omega - Omega_c) R w + U g(t),   g = (Omega^2 - i Omega.) e^(i theta)

Contact forces and the change of the linear terms with the speed enter through ports, as in
docs/concepts/ports.md. Loads are known in time: a step takes the parabola through their values at its
beginning, middle and end.
"""

from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Inexact, Int

from ..core import linalg
from ..core.quantities import Scalar
from ..equations.coupled import Stations
from ..equations.fixed_axes import FixedAxes, SpeedTerms
from ..equations.system import Port, System
from .basis import Basis, DenseBasis, as_real, packed, unpacked
from .lanes import lanes_last, product
from .ports import forces_of_lanes
from .tableau import Flows, Parts, Tableau, tableau_of


# `[Re, Im]` of the port forces of all lanes, by displacement and velocity, and half-steps since the start.
Law = Callable[[Float[Array, "p4 lanes"], int], Float[Array, "p2 lanes"]]


class Course(eqx.Module):
    """Loads and speeds of some steps, known in time, at the beginning, middle and end of each."""

    load: Float[Array, "... u"]  # see `load_values`
    speed: Float[Array, "... 3"]  # Omega [rad/s]
    change: Float[Array, "... 3"]  # Omega - Omega_c


class RotorAtSpeed(eqx.Module):
    """A rotor in a basis of its linear equations at one speed."""

    axes: FixedAxes
    basis: Basis
    # Of all ports, of the speed terms, then of what `Stations` read, in the basis:
    output: Inexact[Array, "s m"] | None
    input: Inexact[Array, "m p"] | None
    unbalance: Inexact[Array, "m u"] | None
    weight: Inexact[Array, "m w"] | None
    port_count: int = eqx.field(static=True)

    @classmethod
    def build(
        cls,
        system: System,
        rate: Scalar,
        terms: SpeedTerms | None,
        basis: Basis | None,
        stations: Stations | None = None,
    ) -> "RotorAtSpeed":
        """The rotor at the speed of its spin, in a dense basis unless one is given.

        Where there are `stations`, the unbalance acts there, and is no load that is known in time.
        """
        axes = FixedAxes.of(system, rate)
        basis = DenseBasis.build(axes.matrix) if basis is None else basis
        inverse, load = linalg.inv(system.blocks.inertia), system.load
        none = jnp.zeros((0, system.n))
        position, velocity, columns = [none], [none], [none.T]
        if system.ports:
            rows = jnp.stack([port.row for port in system.ports])
            position += [rows, 0 * rows]
            velocity += [0 * rows, rows]
            columns += [inverse @ port.column[:, None] for port in system.ports]
        if terms is not None:
            position, velocity = [*position, terms.position], [*velocity, terms.velocity]
            columns.append(terms.columns)
        enters = lambda force: basis.inverse @ axes.input((inverse @ force)[:, None])
        output = entry = unbalance = None
        if stations is not None:
            columns.append(inverse @ stations.columns)
        if len(columns) > 1:
            output = axes.output(*map(jnp.concatenate, (position, velocity))) @ basis.vectors
            entry = basis.inverse @ axes.input(jnp.concatenate(columns, axis=1))
        if stations is None and load.unbalance is not None:
            unbalance = enters(load.unbalance)
        if stations is not None and output is not None:
            rows = axes.output(0 * stations.rows, rate * stations.rows) @ basis.vectors
            every, no = stations.all_coordinates, 0 * stations.all_coordinates
            every = axes.output(jnp.concatenate([every, no]), jnp.concatenate([no, every]))
            output = _stacked(axes, output, rows @ basis.matrix(), every @ basis.vectors)
        weight = None if load.constant is None else enters(load.constant)
        count = len(system.ports)
        return cls(axes, basis, output, entry, unbalance, weight, count)

    def encode(self, state: Array) -> Float[Array, " m2"]:
        """State of the steps from one of the equations."""
        return packed(self.basis.inverse @ state)

    def decode(self, y: Float[Array, " m2"]) -> Array:
        """State of the equations from one of the steps."""
        return self.basis.vectors @ unpacked(self.basis, y)

    def reading(self, row: Float[Array, " n"]) -> Float[Array, "4 m2"]:
        """Output matrix of `[Re, Im]` of displacement and velocity of a station, by a state of steps."""
        both = jnp.stack([row, 0 * row])
        return as_real(self.axes.output(both, both[::-1]) @ self.basis.vectors)

    def step(self, order: int, h: Scalar, ports: tuple[Port, ...]) -> "VaryingStep":
        """A step of `h`, in time `tau`, with the laws of these ports, which may be given later."""
        basis, output, entry = self.basis, self.output, self.input
        nothing = jnp.zeros((0, basis.vectors.shape[0]), basis.vectors.dtype)
        seen, enters = (nothing, nothing.T) if output is None or entry is None else (output, entry)
        given = [part for part in (enters, self.unbalance, self.weight) if part is not None]
        flows = Flows.of(order, basis, jnp.concatenate(given, axis=1), h, 3)
        own = enters.shape[1]
        tableau = tableau_of(order, basis, seen, enters, h, flows.columns(slice(own)))
        loaded = flows.columns(slice(own, None))
        parts = [] if loaded.middle is None else [self._parabola(0.5, loaded.middle[1])]
        parts.append(self._parabola(1.0, loaded.end[1]))
        loads = tuple(as_real(seen) @ part for part in parts)
        half = as_real(seen).reshape(2, -1, tableau.weights.shape[0])
        reading = half[:, : 2 * self.port_count].reshape(4 * self.port_count, half.shape[-1])
        return VaryingStep(tableau, loads, parts[-1], reading, ports)

    def _parabola(self, share: float, flows: Parts) -> Float[Array, "m2 u"]:
        """Change of the state by the loads of a step after a `share` of it, 1/2 or all.

        `flows` are `share h phi_k(share h A)` times the unbalance and the weight. The load is
        `g0 (1 - 3 x + 2 x^2) + g1 (4 x - 4 x^2) + g2 (2 x^2 - x)`, with `x` from 0 to 1 in a step, and
        `Int exp((1 - x) a) x^k dx = k! phi_(k+1)(a)`.
        """
        columns = [jnp.zeros((as_real(self.basis.vectors).shape[0], 0))]
        of_weight = 0
        if self.unbalance is not None:
            of_weight = self.unbalance.shape[1]
            one, two, three = (part[:, :of_weight] for part in flows)
            x, x2 = share * two, 2 * share**2 * three
            parts = one - 3 * x + 2 * x2, 4 * x - 4 * x2, 2 * x2 - x
            columns += [as_real(part) for part in parts]
        if self.weight is not None:
            columns.append(as_real(flows[0][:, of_weight:])[:, :1])
        return jnp.concatenate(columns, axis=1)

    @property
    def load_matrix(self) -> Inexact[Array, "m l"]:
        """Input matrix, in the basis, of the unbalance `g`, or [Re, Im] of it, and of weight."""
        columns = [jnp.zeros((self.basis.vectors.shape[1], 0), self.basis.vectors.dtype)]
        if self.unbalance is not None:
            columns.append(self.unbalance)
        if self.weight is not None:
            columns.append(self.weight[:, :1])
        return jnp.concatenate(columns, axis=1)

    def load_nodes(self, load: Float[Array, " u"]) -> Inexact[Array, "3 l"]:
        """Inputs of `load_matrix` at the beginning, middle and end of a step, by its `load_values`."""
        nodes = [jnp.zeros((3, 0), self.basis.vectors.dtype)]
        if self.unbalance is not None:
            g = load[:6].reshape(3, 2)
            nodes.append(g[:, :1] + 1j * g[:, 1:] if self.axes.equal else g)
        if self.weight is not None:
            nodes.append(jnp.ones((3, 1)))
        return jnp.concatenate(nodes, axis=1)

    def load_values(self, g: Inexact[Array, "... 3"]) -> Float[Array, "... u"]:
        """Values that the loads of a step take, from `g` at its beginning, middle and end."""
        values = [jnp.zeros((*g.shape[:-1], 0))]
        if self.unbalance is not None:
            values.append(jnp.stack([g.real, g.imag], axis=-1).reshape(*g.shape[:-1], 6))
        if self.weight is not None:
            values.append(jnp.ones((*g.shape[:-1], 1)))
        return jnp.concatenate(values, axis=-1)


def _stacked(axes: FixedAxes, *outputs: Inexact[Array, "_ m"]) -> Inexact[Array, "s m"]:
    """Output matrices as one, of complex outputs or of `[Re, Im]` of them."""
    if axes.equal:
        return jnp.concatenate(outputs)
    parts = [part.reshape(2, -1, part.shape[-1]) for part in outputs]
    return jnp.concatenate(parts, axis=1).reshape(-1, outputs[0].shape[-1])


class VaryingStep(eqx.Module):
    """A step of fixed size; all arrays may have lanes last."""

    tableau: Tableau
    load_outputs: tuple[Float[Array, "s u"], ...]  # at the distinct times but the first
    load: Float[Array, "m2 u"]
    reading: Float[Array, "p4 m2"]  # of the ports
    ports: tuple[Port, ...]

    @property
    def contact_stiffness_ratio(self) -> Float[Array, "k 2"]:
        """See `Tableau.contact_stiffness_ratio`; zero without contact."""
        if not self.ports:
            return jnp.zeros((0, 2))
        return self.tableau.contact_stiffness_ratio(self.reading, self.ports)

    def several(
        self, course: Course, y: Float[Array, " m2"], *, batch: bool
    ) -> tuple[Array, Bool[Array, ""], Int[Array, ""]]:
        """State after the steps of a course, and whether a contact was loaded at the start of one.

        No step is split, so none is unresolved.
        """

        def run(parts, y):
            step, course = parts
            begin = y, jnp.zeros(y.shape[1], bool)

            def one(carry, now):
                y, touched = carry
                y, loaded = step.of_lanes(now, y)
                return (y, touched | loaded), None

            return jax.lax.scan(one, begin, course)[0]

        return *lanes_last(run, (self, course), y, batch=batch), jnp.zeros((), int)

    def of_lanes(
        self, now: Course, y: Float[Array, "m2 lanes"], law: Law | None = None
    ) -> tuple[Array, Array]:
        """States after a step, and whether a contact was loaded at its start, lanes last.

        `law` takes the place of the forces of the ports.
        """
        tableau, p = self.tableau, len(self.ports)
        loaded = jnp.zeros(y.shape[1], bool)
        end = tableau.advance(y)
        if self.load.shape[1]:
            end = end + product(self.load, now.load)
        if not tableau.outputs.shape[0]:
            return end, loaded
        free = jnp.split(product(tableau.outputs, y), len(tableau.times))
        if self.load.shape[1]:
            added = [product(part, now.load) for part in self.load_outputs]
            free = [free[0], *(one + more for one, more in zip(free[1:], added, strict=True))]
        contact: list[Array] = []

        def forces(stage: Array, time: int) -> Array:
            half = int(2 * tableau.times[time])  # of a step
            both = stage.reshape(2, -1, stage.shape[-1])  # (Re Im, signal, lane)
            parts = []
            if p:
                seen = both[:, : 2 * p].reshape(4 * p, -1)
                if law is None:
                    found = forces_of_lanes(self.ports, now.speed[half], seen)
                else:
                    found = law(seen, half)
                contact.append(found)
                parts.append(found.reshape(2, p, -1))
            if both.shape[1] > 2 * p:
                parts.append(now.change[half] * both[:, 2 * p :])
            return jnp.concatenate(parts, axis=1).reshape(-1, stage.shape[-1])

        end = end + tableau.increment(free, forces)
        if p:
            loaded = jnp.any(contact[0] != 0, axis=0)
        return end, loaded
