"""Exponential steps: with coefficients computed once for a fixed size, or of any size.

Source: Cox, Matthews, J. Comput. Phys. 176 (2002), eqs. (22) (ETDRK2) and (26)-(29) (ETDRK4).
"""

from collections.abc import Callable
from typing import Any, ClassVar, NamedTuple

import diffrax as dfx
import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Float, Inexact

from ..core import linalg
from ..core.extremes import larger
from ..core.quantities import Scalar
from ..equations.system import Port
from .basis import Basis, BasisWithOthers, Dense, Rotation, SlotRotation, as_real
from .lanes import product
from .ports import Reading, phase_at


class Tableau(eqx.Module):
    """One exponential step of fixed size in terms of the readings of the ports, of one or many lanes.

    Stage `i` reads `Y_i = outputs[c_i] y + steady(theta + c_i h) + Sum_j coupling[i][j] f_j`, with forces
    `f_i = f(Y_i)`; the step is `y <- advance(y) + weights (f_0, f_1, ..)`.
    """

    advance: Rotation | SlotRotation | Dense
    outputs: Float[Array, "c_p4 m2"]  # C exp(c h A), one for every distinct stage time
    coupling: tuple[dict[int, Float[Array, "p4 p2"]], ...]  # of stage i to earlier stages j
    weights: Float[Array, "m2 stages_p2"]
    h: Scalar
    times: tuple[float, ...] = eqx.field(static=True)  # distinct, in steps
    stages: tuple[int, ...] = eqx.field(static=True)  # which time each stage is at

    def phases(self, theta: ArrayLike) -> Float[Array, "... c 2"]:
        """Cosine and sine of the angles at the distinct times of steps from `theta` on."""
        times = jnp.asarray(self.times, jnp.result_type(self.h))
        return phase_at(jnp.asarray(theta)[..., None] + times * self.h)

    def free_readings(
        self, phases: Float[Array, "c 2"], y: Float[Array, "m2 lanes"], reading: Reading
    ) -> list[Array]:
        """Readings of the ports at the distinct times without the forces of this step."""
        free = jnp.split(product(self.outputs, y), len(self.times))
        return [one + reading.steady(phase) for one, phase in zip(free, phases, strict=True)]

    def increment(self, free: list[Array], forces: Callable) -> Float[Array, "m2 lanes"]:
        """Sum that the forces of all stages add to the state by the end of the step.

        `forces` takes the readings of a stage and which of the distinct times it is at.
        """
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


class AbstractStep(dfx.AbstractSolver):
    """A tableau as a diffrax solver, on a fixed grid of steps of `tableau.h`."""

    tableau: eqx.AbstractVar[Tableau]
    order_: eqx.AbstractVar[int]

    term_structure: ClassVar = dfx.ODETerm
    interpolation_cls: ClassVar[Callable[..., Any]] = dfx.LocalLinearInterpolation

    def order(self, terms) -> int:
        del terms
        return self.order_

    def func(self, terms, t0, y0, args):
        return terms.vf(t0, y0, args)


Parts = list[Array]  # `span phi_k(span A) b`, k = 1, 2, ..


class Flows(NamedTuple):
    """`exp(c h A)` and `c h phi_k(c h A) b` of a step, at half of it (order 4 alone) and at its end."""

    middle: tuple[Any, Parts] | None
    end: tuple[Any, Parts]

    @classmethod
    def of(
        cls,
        order: int,
        basis: Basis | BasisWithOthers,
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


def doubled(basis: Basis | BasisWithOthers, flow: Any, parts: Parts) -> Parts:
    """`phi_k(2 z) = (e^z phi_k(z) + Sum_j phi_j(z) / (k - j)!) / 2^k`, j = 1 .. k, times the span.

    So one matrix exponential serves a step and half of it.
    """
    one, two, three = parts
    sums = one, one + two, one / 2 + two + three
    return [
        (basis.apply(flow, part) + own) / 2**k
        for k, (part, own) in enumerate(zip(parts, sums, strict=True))
    ]


def tableau_of(
    order: int,
    basis: Basis,
    output: Inexact[Array, "s m"],
    b: Inexact[Array, "m p"],
    h: Scalar,
    flows: Flows | None = None,
) -> Tableau:
    """Tableau of order 2 or 4 for steps of `h` [rad] between outputs and inputs in a basis.

    `flows` are those of `h` and `b`, where they are at hand.
    """
    flows = Flows.of(order, basis, b, h) if flows is None else flows
    return (_etdrk4 if order == 4 else _etdrk2)(basis, output, flows, h)


def _etdrk2(basis: Basis, output: Array, flows: Flows, h: Scalar) -> Tableau:
    flow, (one, two, *_) = flows.end
    return _tableau(
        basis,
        output,
        h,
        flow,
        outputs={0.0: output, 1.0: basis.output_after(output, flow)},
        stages=(0, 1),
        coupling=({}, {0: one}),
        weights=(one - two, two),
    )


def _etdrk4(basis: Basis, output: Array, flows: Flows, h: Scalar) -> Tableau:
    assert flows.middle is not None
    middle, (half, *_) = flows.middle
    flow, (one, two, three) = flows.end
    both = 2 * two - 4 * three
    return _tableau(
        basis,
        output,
        h,
        flow,
        outputs={
            0.0: output,
            0.5: basis.output_after(output, middle),
            1.0: basis.output_after(output, flow),
        },
        stages=(0, 1, 1, 2),
        coupling=({}, {0: half}, {1: half}, {0: basis.apply(middle, half) - half, 2: 2 * half}),
        weights=(one - 3 * two + 4 * three, both, both, 4 * three - two),
    )


def _tableau(basis, output, h, flow, outputs, stages, coupling, weights) -> Tableau:
    """The coefficients as they act on the real state."""
    return Tableau(
        basis.propagator(flow),
        jnp.concatenate([as_real(part) for part in outputs.values()]),
        tuple({j: as_real(output @ part) for j, part in row.items()} for row in coupling),
        jnp.concatenate([as_real(part) for part in weights], axis=1),
        h,
        tuple(outputs),
        stages,
    )


State = Inexact[Array, " m"]
Force = Callable[[State, Scalar | float], Inexact[Array, " p"]]  # of state and angle in the step


class LoadInStep(NamedTuple):
    """A load known in time: `matrix (g0 + g1 x + g2 x^2)`, with `x` from 0 to 1 in a step."""

    matrix: Inexact[Array, "m l"]
    values: tuple[Array, Array, Array]  # g0, g1, g2


def step_of(
    order: int,
    basis: Basis | BasisWithOthers,
    input_matrix: Inexact[Array, "m p"],
    w: State,
    span: Scalar,
    force: Force,
    load: LoadInStep | None = None,
) -> State:
    """State after a step of any size `span` [rad] under the force of the ports, and a load."""
    own, columns = input_matrix.shape[1], input_matrix
    if load is not None:
        columns = jnp.concatenate([input_matrix, load.matrix], axis=1)
    flows = Flows.of(order, basis, columns, span, 2 if load is None else 3)

    def free(w: State, at: tuple[Any, Parts], share: float) -> State:
        """State without the forces of the ports after a share of the step."""
        flow, parts = at
        ahead = basis.apply(flow, w[:, None])[:, 0]
        if load is None:
            return ahead
        # Int exp((1 - x) a) x^k dx = k! phi_(k+1)(a)
        terms = zip(parts, (1.0, share, 2 * share**2), load.values, strict=True)
        return ahead + sum(factor * part[:, own:] @ value for part, factor, value in terms)

    end, by_force = free(w, flows.end, 1.0), flows.columns(slice(own))
    if by_force.middle is None or flows.middle is None:
        return _step2(by_force.end[1], w, span, force, end)
    go_half = flows.middle[0]
    go = lambda w: basis.apply(go_half, w[:, None])[:, 0]
    parts, middle = (by_force.middle[1], by_force.end[1]), free(w, flows.middle, 0.5)
    return _step4(parts, w, span, force, (middle, end), go)


def _step2(parts: Parts, w: State, span: Scalar, force: Force, end: State) -> State:
    one, two, *_ = parts
    f = force(w, 0.0)
    a = end + one @ f
    return a + two @ (force(a, span) - f)


def _step4(parts: tuple[Parts, Parts], w: State, span: Scalar, force: Force, free, go) -> State:
    (half, *_), (one, two, three) = parts
    middle, end = free
    f = force(w, 0.0)
    a = middle + half @ f
    fa = force(a, span / 2)
    fb = force(middle + half @ fa, span / 2)
    fc = force(end + go(half @ f) + half @ (2 * fb - f), span)
    return end + one @ f + two @ (2 * (fa + fb) - 3 * f - fc) + three @ (4 * (f - fa - fb + fc))
