"""Exponential steps: with coefficients computed once for a fixed size, or of any size.

Source: Cox, Matthews, J. Comput. Phys. 176 (2002), eqs. (22) (ETDRK2) and (26)-(29) (ETDRK4).
"""

import abc
from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Float, Inexact

from ..core import linalg
from ..core.extremes import larger
from ..core.lanes import product
from ..core.quantities import Scalar
from ..equations.port import Port
from .basis import Basis, Dense, Rotation, SlotRotation, as_real, packed, unpacked


def phase_at(theta: ArrayLike, rates: Any = (), axis: int = -1) -> Float[Array, "... c2"]:
    """Cosine and sine of angles of revolution, then those of other clocks, which turn by `rates` of it."""
    angles = [theta, *(rate * theta for rate in rates)]
    angles = jnp.broadcast_arrays(*angles) if len(angles) > 1 else angles
    return jnp.stack([of(angle) for angle in angles for of in (jnp.cos, jnp.sin)], axis=axis)


def phase_rate(phase: Float[Array, "c2 ..."], rates: Any = ()) -> Float[Array, "c2 ..."]:
    """Rate of what `phase_at` gives, along a first axis, by the angle of revolution."""
    parts = [-phase[1], phase[0]]
    for k, rate in enumerate(rates):
        parts += [-rate * phase[2 * k + 3], rate * phase[2 * k + 2]]
    return jnp.stack(parts)


class AbstractTableau(eqx.Module):
    """One exponential step of fixed size in terms of the readings of the ports, of one or many lanes.

        Y_i = C exp(c_i h A) y + steady(theta + c_i h) + Sum_j coupling[i][j] f_j,   f_i = f(Y_i)
        y <- exp(h A) y + Sum_i weights[i] f_i

    Loads known in time add to both.
    """

    h: eqx.AbstractVar[Scalar]
    times: eqx.AbstractVar[tuple[float, ...]]  # distinct, in steps
    stages: eqx.AbstractVar[tuple[int, ...]]  # which time each stage is at

    @property
    def order(self) -> int:
        """2 or 4: as many as there are stages."""
        return len(self.stages)

    def phases(self, theta: ArrayLike, rates: Any = ()) -> Float[Array, "..."]:
        """Cosine and sine of the angles at the distinct times of steps from `theta` on, see `phase_at`.

        Clocks whose rates are those of lanes have a last axis of these.
        """
        times = jnp.asarray(self.times, jnp.result_type(self.h))
        angles = jnp.asarray(theta)[..., None] + times * self.h
        if len(rates) and jnp.ndim(rates[0]):
            of_lanes = rates.shape[-1] > 1
            if of_lanes:
                return phase_at(angles[..., None], rates, axis=-2)
            rates = rates[..., 0]
        return phase_at(angles, rates)

    @abc.abstractmethod
    def ahead(self, y: Array, load: Array | None) -> tuple[Array, list[Array]]:
        """State after the step, and readings at the distinct times, without the forces of the step."""

    @abc.abstractmethod
    def increment(self, free: list[Array], forces: Callable) -> Float[Array, "m2 ..."]:
        """Sum that the forces of all stages add to the state by the end of the step.

        `forces` takes the readings of a stage and which of the distinct times it is at.
        """


class OnceTableau(AbstractTableau):
    """A tableau of a step that is taken once: nothing is multiplied in advance, all is in the basis."""

    basis: Basis
    output: Inexact[Array, "s m"]
    flows: tuple[Any, ...]  # to the distinct times but the first
    coupling: tuple["Terms", ...]
    weights: "Terms"
    loads: tuple[Float[Array, "m2 u"], ...]
    h: Scalar
    times: tuple[float, ...] = eqx.field(static=True)
    stages: tuple[int, ...] = eqx.field(static=True)

    def ahead(self, y, load):
        begin = unpacked(self.basis, y)
        states = [self.basis.apply(flow, begin[:, None])[:, 0] for flow in self.flows]
        if load is not None:
            added = [unpacked(self.basis, product(part, load)) for part in self.loads]
            states = [state + more for state, more in zip(states, added, strict=True)]
        return packed(states[-1]), [packed(self.output @ state) for state in (begin, *states)]

    def increment(self, free, forces):
        found: list[Array] = []
        for time, coupling in zip(self.stages, self.coupling, strict=True):
            stage = free[time]
            if coupling:
                stage = stage + packed(self.output @ _total(coupling, found))
            found.append(unpacked(self.basis, forces(stage, time)))
        return packed(_total(self.weights, found))


class Tableau(AbstractTableau):
    """A tableau of steps of one size."""

    propagator: Rotation | SlotRotation | Dense
    outputs: Float[Array, "c_s m2"]  # C exp(c h A), one for every distinct time
    coupling: tuple[dict[int, Float[Array, "s p2"]], ...]  # of stage i to earlier stages j
    weights: Float[Array, "m2 stages_p2"]
    # Change of the state by known loads, and of the readings at the distinct times but the first:
    load: Float[Array, "m2 u"] | None
    load_outputs: tuple[Float[Array, "s u"], ...]
    h: Scalar
    times: tuple[float, ...] = eqx.field(static=True)
    stages: tuple[int, ...] = eqx.field(static=True)

    @property
    def output(self) -> Float[Array, "s m2 ..."]:
        """`C` as it acts on the real state."""
        return self.outputs[: self.outputs.shape[0] // len(self.times)]

    def ahead(self, y, load):
        end = self.propagator(y)
        if self.load is not None and load is not None:
            end = end + product(self.load, load)
        if not self.outputs.shape[0]:
            return end, [jnp.zeros((0, *y.shape[1:]))] * len(self.times)
        free = jnp.split(product(self.outputs, y), len(self.times))
        if load is not None:
            added = [product(part, load) for part in self.load_outputs]
            free = [free[0], *(one + more for one, more in zip(free[1:], added, strict=True))]
        return end, free

    def increment(self, free, forces):
        found: list[Array] = []
        for time, coupling in zip(self.stages, self.coupling, strict=True):
            stage = free[time]
            for earlier, gain in coupling.items():
                stage = stage + product(gain, found[earlier])
            found.append(forces(stage, time))
        return product(self.weights, jnp.concatenate(found))

    def contact_stiffness_ratio(
        self,
        seen: Float[Array, "p4 m2"],
        ports: tuple[Port, ...],
        through: Float[Array, "p4 p2"] | None = None,
    ) -> Float[Array, "k 2"]:
        """Force of every stop after a unit of force is held at its port for one step.

        `k d` and `c v`, with the stiffness `k` and damping `c` of the stop, and the displacement `d` and
        velocity `v` that the unit force gives the port in a step `h`. A mass `m` on the stop alone has
        `k h^2 / (2 m)` and `c h / m`. Stiffness and damping are those of `Port.hardnesses`. `seen` reads
        the ports, whose forces are the first of the inputs. A port that yields at once by `through`
        presses a stop as much softer.
        """
        hardness = [port.hardnesses() for port in ports]  # (k, 2) each
        found = [h * own for h, own in zip(hardness, self._port_response(seen), strict=True)]
        if through is not None:
            least = linalg.svd(_own_parts(through, len(ports)), compute_uv=False)[..., -1].T
            softer = [1 + h @ own for h, own in zip(hardness, least, strict=True)]
            found = [f / one[:, None] for f, one in zip(found, softer, strict=True)]
        return jnp.concatenate(found)

    def _port_response(self, seen: Float[Array, "p4 m2"]) -> Float[Array, "p 2"]:
        """Displacement [m] and velocity [m/s] of every port after a step under a unit force held there."""
        p = seen.shape[0] // 4
        inputs = self.weights.shape[1] // (2 * len(self.stages))
        held = self.weights.reshape(self.weights.shape[0], -1, 2, inputs).sum(1)  # at all stages
        own = _own_parts(jnp.einsum("sm,mif->sif", seen, held[..., :p]), p)
        square = jnp.sum(own**2, axis=(-2, -1))
        determinant = own[..., 0, 0] * own[..., 1, 1] - own[..., 0, 1] * own[..., 1, 0]
        # The larger singular value: the softer of two unequal axes counts.
        most = jnp.sqrt((square + jnp.sqrt(larger(square**2 - 4 * determinant**2, 0.0))) / 2)
        return most.T


def _own_parts(response: Float[Array, "..."], p: int) -> Float[Array, "2 p 2 2"]:
    """Displacement and velocity of every port by the force there, without derivatives."""
    parts = response.reshape(2, 2, p, 2, p)  # (Re Im, d v, port, Re Im, force)
    return jax.lax.stop_gradient(jnp.einsum("adpbp->dpab", parts))


Parts = list[Array]  # `span phi_k(span A) b`, k = 1, 2, ..


class Flows(NamedTuple):
    """`exp(c h A)` and `c h phi_k(c h A) b` of a step, at half of it (order 4 alone) and at its end."""

    middle: tuple[Any, Parts] | None
    end: tuple[Any, Parts]

    @classmethod
    def of(
        cls,
        order: int,
        basis: Basis,
        b: Inexact[Array, "m p"],
        h: Scalar,
        count: int = 2,
    ):
        """Those of a step of `h`; `count` functions `phi_k` of order 2, three of order 4."""
        if order == 2:
            return cls(None, basis.flow(h, b, count))
        middle, parts = basis.flow(h / 2, b, 3)
        return cls((middle, parts), (basis.twice(middle), doubled(basis, middle, parts)))

    def columns(self, some: slice) -> "Flows":
        """The same for some columns of `b`."""
        take = lambda at: at and (at[0], [part[:, some] for part in at[1]])
        return Flows(take(self.middle), take(self.end))


def doubled(basis: Basis, flow: Any, parts: Parts) -> Parts:
    """`phi_k(2 z) = (e^z phi_k(z) + Sum_j phi_j(z) / (k - j)!) / 2^k`, j = 1 .. k, times the span.

    So one matrix exponential serves a step and half of it.
    """
    one, two, three = parts
    sums = one, one + two, one / 2 + two + three
    return [
        (basis.apply(flow, part) + own) / 2**k
        for k, (part, own) in enumerate(zip(parts, sums, strict=True))
    ]


# A sum over parts (m, p), each times the sum of the inputs of some stages times their shares:
Terms = tuple[tuple[Inexact[Array, "m p"], dict[int, float]], ...]


class Scheme(NamedTuple):
    """Stages of a step: flows to the distinct times but the first, what stages and step add by inputs."""

    flows: tuple[Any, ...]
    times: tuple[float, ...]
    stages: tuple[int, ...]
    coupling: tuple[Terms, ...]  # of stage i to earlier stages
    weights: Terms


def scheme_of(basis: Basis, flows: Flows) -> Scheme:
    """Stages of order 2, or 4 where the flows have the middle of a step, by Cox and Matthews."""
    if flows.middle is None:
        flow, (one, two, *_) = flows.end
        weights = (one, {0: 1.0}), (two, {0: -1.0, 1: 1.0})
        return Scheme((flow,), (0.0, 1.0), (0, 1), ((), ((one, {0: 1.0}),)), weights)
    middle, (half, *_) = flows.middle
    flow, (one, two, three) = flows.end
    last = (basis.apply(middle, half), {0: 1.0}), (half, {0: -1.0, 2: 2.0})
    coupling = (), ((half, {0: 1.0}),), ((half, {1: 1.0}),), last
    weights = (
        (one, {0: 1.0}),
        (two, {0: -3.0, 1: 2.0, 2: 2.0, 3: -1.0}),
        (three, {0: 4.0, 1: -4.0, 2: -4.0, 3: 4.0}),
    )
    return Scheme((middle, flow), (0.0, 0.5, 1.0), (0, 1, 1, 2), coupling, weights)


def _total(terms: Terms, inputs: list[Array]) -> Array:
    """The sum by the inputs of the stages."""
    parts = []
    for part, shares in terms:
        scaled = [inputs[k] if c == 1 else c * inputs[k] for k, c in shares.items()]
        parts.append(part @ sum(scaled[1:], start=scaled[0]))
    return sum(parts[1:], start=parts[0])


def _by_stage(terms: Terms) -> dict[int, Array]:
    """The matrix of every stage that takes part in a sum."""
    found: dict[int, Array] = {}
    for part, shares in terms:
        for stage, share in shares.items():
            own = part if share == 1 else share * part
            found[stage] = found[stage] + own if stage in found else own
    return found


def tableau_of(
    basis: Basis,
    output: Inexact[Array, "s m"],
    flows: Flows,
    h: Scalar,
    loads: tuple[Float[Array, "m2 u"], ...] = (),
    *,
    once: bool = False,
) -> Tableau | OnceTableau:
    """Tableau of steps of `h` [rad] between outputs and inputs in a basis, as it acts on the real state.

    `flows` are those of `h` and the inputs, `loads` the changes of the state by known loads until the
    distinct times but the first. `once`: the tableau of a step that is taken once.
    """
    scheme = scheme_of(basis, flows)
    places: dict[str, Any] = {"h": h, "times": scheme.times, "stages": scheme.stages}
    if once:
        return OnceTableau(
            basis=basis,
            output=output,
            flows=scheme.flows,
            coupling=scheme.coupling,
            weights=scheme.weights,
            loads=loads,
            **places,
        )
    real = as_real(output)
    outputs = [real, *(as_real(basis.output_after(output, flow)) for flow in scheme.flows)]
    coupling, weights = map(_by_stage, scheme.coupling), _by_stage(scheme.weights)
    return Tableau(
        propagator=basis.propagator(scheme.flows[-1]),
        outputs=jnp.concatenate(outputs),
        coupling=tuple({j: as_real(output @ part) for j, part in row.items()} for row in coupling),
        weights=jnp.concatenate([as_real(weights[k]) for k in range(len(weights))], axis=1),
        load=loads[-1] if loads else None,
        load_outputs=tuple(real @ part for part in loads),
        **places,
    )
