"""Exponential steps: coefficients worked out for one length, or taken at any length.

Source: Cox, Matthews, J. Comput. Phys. 176 (2002), eqs. (22) (ETDRK2) and (26)-(29) (ETDRK4).
"""

from collections.abc import Callable
from typing import Any, ClassVar

import diffrax as dfx
import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Float, Inexact

from ..core.quantities import Scalar
from .basis import Basis, Dense, Rotation, SlotRotation, as_real
from .lanes import product
from .ports import Contacts, Reading, phase_at


class Tableau(eqx.Module):
    """One exponential step of fixed size, in terms of the ports; built for one lane, used for many.

    Stage `i`: `Y_i = look[c_i] y + steady(theta + c_i h) + Sum_j echo[i][j] f_j`, `f_i = f(Y_i)`;
    then `y <- advance(y) + feed (f_0, f_1, ..)`.
    """

    advance: Rotation | SlotRotation | Dense
    look: Float[Array, "c_p4 m2"]  # one for every distinct stage time
    echo: tuple[dict[int, Float[Array, "p4 p2"]], ...]  # of stage i by earlier stage j
    feed: Float[Array, "m2 stages_p2"]
    h: Scalar
    times: tuple[float, ...] = eqx.field(static=True)  # distinct, in steps
    stages: tuple[int, ...] = eqx.field(static=True)  # which time each stage is at

    def phases(self, theta: ArrayLike) -> Float[Array, "... c 2"]:
        """Cosine and sine of the angles at the distinct times of steps from `theta` on."""
        return phase_at(jnp.asarray(theta)[..., None] + jnp.asarray(self.times) * self.h)

    def seen(
        self, phases: Float[Array, "c 2"], y: Float[Array, "m2 lanes"], reading: Reading
    ) -> list[Array]:
        """Ports at the distinct times, as far as contact has not yet changed them."""
        free = jnp.split(product(self.look, y), len(self.times))
        return [one + reading.steady(phase) for one, phase in zip(free, phases, strict=True)]

    def fed(self, seen: list[Array], forces: Callable) -> Float[Array, "m2 lanes"]:
        """What the forces of all stages add to the state by the end of the step.

        `forces` takes what the ports see and which of the distinct times it is seen at.
        """
        found: list[Array] = []
        for time, echo in zip(self.stages, self.echo, strict=True):
            stage = seen[time]
            for earlier, gain in echo.items():
                stage = stage + product(gain, found[earlier])
            found.append(forces(stage, time))
        return product(self.feed, jnp.concatenate(found))

    def answer(self, reading: Reading) -> tuple[Float[Array, " p"], Float[Array, " p"]]:
        """How far [m] and how fast [m/s] every port goes in a step under a unit of force held there."""
        p = reading.matrix.shape[0] // 4
        fed = self.feed.reshape(self.feed.shape[0], -1, 2 * p).sum(1)  # all stages feel the same
        plane = (reading.matrix @ fed).reshape(2, 2, p, 2, p)  # (Re Im, d v, port, Re Im, force)
        own = jnp.linalg.norm(jnp.einsum("adpbp->dpab", plane), axis=(-2, -1)) / jnp.sqrt(2.0)
        return own[0], own[1]


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


def tableau_of(order: int, basis: Basis, contacts: Contacts, h: Scalar) -> Tableau:
    """The tableau of a step `h`."""
    return (_etdrk4 if order == 4 else _etdrk2)(basis, contacts, h)


def _etdrk2(basis: Basis, contacts: Contacts, h: Scalar) -> Tableau:
    see, b = contacts.see, contacts.drive
    flow, (one, two) = basis.flow(h, b, 2)
    return _tableau(
        basis,
        see,
        h,
        flow,
        looks={0.0: see, 1.0: basis.look(see, flow)},
        stages=(0, 1),
        echo=({}, {0: one}),
        feed=(one - two, two),
    )


def _etdrk4(basis: Basis, contacts: Contacts, h: Scalar) -> Tableau:
    see, b = contacts.see, contacts.drive
    middle, (half,) = basis.flow(h / 2, b, 1)
    flow, (one, two, three) = basis.flow(h, b, 3)
    both = 2 * two - 4 * three
    return _tableau(
        basis,
        see,
        h,
        flow,
        looks={0.0: see, 0.5: basis.look(see, middle), 1.0: basis.look(see, flow)},
        stages=(0, 1, 1, 2),
        echo=({}, {0: half}, {1: half}, {0: basis.apply(middle, half) - half, 2: 2 * half}),
        feed=(one - 3 * two + 4 * three, both, both, 4 * three - two),
    )


def _tableau(basis, see, h, flow, looks, stages, echo, feed) -> Tableau:
    """The complex coefficients as they act on `[re, im]`."""
    return Tableau(
        basis.step(flow),
        jnp.concatenate([as_real(look) for look in looks.values()]),
        tuple({j: as_real(see @ part) for j, part in row.items()} for row in echo),
        jnp.concatenate([as_real(part) for part in feed], axis=1),
        h,
        tuple(looks),
        stages,
    )


State = Inexact[Array, " m"]
Force = Callable[[State, Scalar | float], Inexact[Array, " p"]]  # of state and time in the step


def step_of(order: int, basis: Basis, drive, w: State, span: Scalar, force: Force) -> State:
    """State after a step of any length; `force` is what the ports feed in through `drive`."""
    return (_step4 if order == 4 else _step2)(basis, drive, w, span, force)


def _step2(basis: Basis, drive, w: State, span: Scalar, force: Force) -> State:
    flow, (one, two) = basis.flow(span, drive, 2)
    f = force(w, 0.0)
    a = basis.apply(flow, w[:, None])[:, 0] + one @ f
    return a + two @ (force(a, span) - f)


def _step4(basis: Basis, drive, w: State, span: Scalar, force: Force) -> State:
    middle, (half,) = basis.flow(span / 2, drive, 1)
    flow, (one, two, three) = basis.flow(span, drive, 3)
    go = lambda flow, w: basis.apply(flow, w[:, None])[:, 0]
    f, there = force(w, 0.0), go(middle, w)
    a = there + half @ f
    fa = force(a, span / 2)
    fb = force(there + half @ fa, span / 2)
    fc = force(go(middle, a) + half @ (2 * fb - f), span)
    return (
        go(flow, w)
        + one @ f
        + two @ (2 * (fa + fb) - 3 * f - fc)
        + three @ (4 * (f - fa - fb + fc))
    )
