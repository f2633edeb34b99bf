"""Rotor: the linear equations at one speed, in a basis, and steps of any size that are made of them.

    w' = A(Omega_c) w + B f(C w) + P (Omega - Omega_c) R w + U g(t),   g = (Omega^2 - i Omega.) e^(i theta)

Contact forces and the change of the linear terms with the speed enter through ports, as in
docs/concepts/ports.md. Loads are known in time: a step takes the parabola through their values at its
beginning, middle and end.
"""

import jax.numpy as jnp
from jaxtyping import Array, Float, Inexact

from ..core import linalg
from ..core.quantities import Scalar
from ..equations.coupled import Stations
from ..equations.fixed_axes import FixedAxes, SpeedTerms
from ..equations.system import System
from .basis import Basis, DenseBasis, as_real, packed, unpacked
from .step import AbstractRotor, Step
from .tableau import Flows, Parts, tableau_of


class RotorAtSpeed(AbstractRotor):
    """A rotor in a basis of its linear equations at one speed."""

    axes: FixedAxes
    basis: Basis
    # Of all ports, of the speed terms, then of what `Stations` read, in the basis:
    output: Inexact[Array, "s m"] | None
    input: Inexact[Array, "m p"] | None
    unbalance: Inexact[Array, "m u"] | None
    weight: Inexact[Array, "m w"] | None

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
        return cls(axes, basis, output, entry, unbalance, weight)

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

    def step(self, order, h, forcing, *, once=False) -> Step:
        """A step of `h`, in time `tau`; ports of its forcing may be given later."""
        basis, output, entry = self.basis, self.output, self.input
        nothing = jnp.zeros((0, basis.vectors.shape[0]), basis.vectors.dtype)
        seen, enters = (nothing, nothing.T) if output is None or entry is None else (output, entry)
        given = [part for part in (enters, self.unbalance, self.weight) if part is not None]
        count, own = 3 if len(given) > 1 else 2, enters.shape[1]
        flows = Flows.of(order, basis, jnp.concatenate(given, axis=1), h, count)
        loads: list[Array] = []
        if len(given) > 1:
            loaded = flows.columns(slice(own, None))
            shares = (0.5, loaded.middle), (1.0, loaded.end)
            loads = [self._parabola(share, at[1]) for share, at in shares if at is not None]
        own = flows.columns(slice(own))
        return Step(tableau_of(basis, seen, own, h, tuple(loads), once=once), forcing)

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
    def load_matrix(self) -> Float[Array, "m2 l"]:
        """Input matrix of [Re, Im] of the unbalance `g`, and of 1 for a weight."""
        columns = [jnp.zeros((as_real(self.basis.vectors).shape[1], 0))]
        if self.unbalance is not None:
            columns.append(as_real(self.unbalance))
        if self.weight is not None:
            columns.append(as_real(self.weight)[:, :1])
        return jnp.concatenate(columns, axis=1)


def _stacked(axes: FixedAxes, *outputs: Inexact[Array, "_ m"]) -> Inexact[Array, "s m"]:
    """Output matrices as one, of complex outputs or of `[Re, Im]` of them."""
    if axes.equal:
        return jnp.concatenate(outputs)
    parts = [part.reshape(2, -1, part.shape[-1]) for part in outputs]
    return jnp.concatenate(parts, axis=1).reshape(-1, outputs[0].shape[-1])
