"""Exponential integrator: the linear rotor exactly, contact forces by Cox-Matthews stages.

    w' = A w + B f(C w + steady(theta)),   w = state less the exact steady response

The eigenvalues of `A`, however stiff, set no step limit, and free flight is exact at any step. The
contact forces see the state only through a few ports, so a step needs one product from the state
to the stage values of the ports, the forces, and one product back.

Source: Cox, Matthews, J. Comput. Phys. 176 (2002), eqs. (22) (ETDRK2) and (26)-(29) (ETDRK4).
"""

from collections.abc import Callable
from typing import Any, ClassVar, Literal

import diffrax as dfx
import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..motion import Motion
from ..quantities import Scalar
from ..system import System
from .basis import Dense, DenseBasis, ModalBasis, Rotation, as_real
from .ports import Contacts, PortField, PortForm, Reading


class Exponential(eqx.Module):
    """Choice of the exponential integrator: `order` 2 or 4, `basis` "modal", "dense" or "auto".

    Modal coordinates take the fewest operations. They fail where eigenvectors merge (over-damped or
    defective pairs), and jax cannot differentiate eigenvectors; "auto" takes the dense
    matrix exponential there and whenever parameters are being traced.
    """

    order: Literal[2, 4] = eqx.field(default=2, static=True)
    basis: Literal["auto", "modal", "dense"] = eqx.field(default="auto", static=True)
    located: bool = eqx.field(default=False, static=True)

    def __check_init__(self):
        if self.order not in (2, 4):
            raise ValueError(f"`order` must be 2 or 4, but is {self.order!r}.")
        if self.basis not in ("auto", "modal", "dense"):
            raise ValueError(f"`basis` must be 'auto', 'modal' or 'dense', but is {self.basis!r}.")

    def form(self, system: System, motion: Motion, rows: Float[Array, "s n"]) -> PortForm:
        """The motion in the coordinates this solver steps."""
        build = DenseBasis.build if self.basis == "dense" else ModalBasis.build
        return PortForm.build(system, motion, rows, build(motion.matrix()))

    def stepper(self, form: PortForm, steps: int) -> "ExponentialStep | None":
        """One step of `steps` in a revolution, or None where no contact needs stepping."""
        field = form.field
        if form.contacts is None or field.reading is None:
            return None
        h = jnp.asarray(2 * jnp.pi / steps)
        if self.located:
            from .located import LocatedStep

            return LocatedStep.build(form, self.order, h)
        tableau = tableau_of(self.order, form.basis, form.contacts, h)
        return ExponentialStep(tableau, field, field.reading, self.order)


class Tableau(eqx.Module):
    """One exponential step of fixed size, in terms of the ports.

    Stage `i`: `Y_i = look[c_i] y + steady(theta + c_i h) + Sum_j echo[i][j] f_j`, `f_i = f(Y_i)`;
    then `y <- advance(y) + feed (f_0, f_1, ..)`.
    """

    advance: Rotation | Dense
    look: Float[Array, "c p4 m2"]  # one for every distinct stage time
    echo: tuple[dict[int, Float[Array, "p4 p2"]], ...]  # of stage i by earlier stage j
    feed: Float[Array, "m2 stages_p2"]
    h: Scalar
    times: tuple[float, ...] = eqx.field(static=True)  # distinct, in steps
    stages: tuple[int, ...] = eqx.field(static=True)  # which time each stage is at


def tableau_of(
    order: int, basis: ModalBasis | DenseBasis, contacts: Contacts, h: Scalar
) -> Tableau:
    """The tableau of a step `h`."""
    return (_etdrk4 if order == 4 else _etdrk2)(basis, contacts, h)


def _etdrk2(basis: ModalBasis | DenseBasis, contacts: Contacts, h: Scalar) -> Tableau:
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


def _etdrk4(basis: ModalBasis | DenseBasis, contacts: Contacts, h: Scalar) -> Tableau:
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
        jnp.stack([as_real(look) for look in looks.values()]),
        tuple({j: as_real(see @ part) for j, part in row.items()} for row in echo),
        jnp.concatenate([as_real(part) for part in feed], axis=1),
        h,
        tuple(looks),
        stages,
    )


class ExponentialStep(dfx.AbstractSolver):
    """A tableau as a diffrax solver, on a fixed grid of steps of `tableau.h`."""

    tableau: Tableau
    field: PortField
    reading: Reading
    order_: int = eqx.field(static=True)

    term_structure: ClassVar = dfx.ODETerm
    interpolation_cls: ClassVar[Callable[..., Any]] = dfx.LocalLinearInterpolation

    def order(self, terms) -> int:
        del terms
        return self.order_

    def init(self, terms, t0, t1, y0, args) -> None:
        del terms, t0, t1, y0, args

    def step(self, terms, t0, t1, y0, args, solver_state, made_jump):
        del terms, t1, args, solver_state, made_jump
        y1 = self.advance(jnp.asarray(t0), y0)
        return y1, None, {"y0": y0, "y1": y1}, None, dfx.RESULTS.successful

    def func(self, terms, t0, y0, args):
        return terms.vf(t0, y0, args)

    def advance(self, theta: Scalar, y: Float[Array, " m2"]) -> Float[Array, " m2"]:
        """State after a step from `theta`."""
        tableau = self.tableau
        seen = (tableau.look.reshape(-1, y.size) @ y).reshape(len(tableau.times), -1)
        steady = [self.reading.steady(theta + c * tableau.h) for c in tableau.times]
        forces: list[Array] = []
        for time, echo in zip(tableau.stages, tableau.echo, strict=True):
            stage = seen[time] + steady[time]
            for earlier, gain in echo.items():
                stage = stage + gain @ forces[earlier]
            forces.append(self.field.forces(stage))
        return tableau.advance(y) + tableau.feed @ jnp.concatenate(forces)
