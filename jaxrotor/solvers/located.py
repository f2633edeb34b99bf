"""Located steps at constant speed: exponential steps that are split where a force changes its branch."""

import diffrax as dfx
import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float, Inexact, Int

from ..core.quantities import Scalar
from .basis import Basis, as_real, unpacked
from .branches import BranchedPorts
from .lanes import one_lane
from .ports import PortForm, phase_at
from .splits import AbstractInstant, AbstractSplitStep
from .tableau import AbstractStep, Tableau, step_of, tableau_of


class PortsAtAngle(AbstractInstant):
    """The ports of a rotor of constant speed at an angle of revolution."""

    ports: BranchedPorts
    basis: Basis
    theta: Scalar

    def read(self, w):
        return self.ports.read(w, self.theta)

    def crossing(self, branches, seen):
        return self.ports.crossing(branches, seen)

    def inputs(self, branches, w, exhausted=None):
        return self._turned(self.ports.forces_of(branches, self.read(w), exhausted))

    def jump(self, before, after, w):
        seen, forces = self.read(w), self.ports.forces
        return self._turned(forces(before, seen) - forces(after, seen))

    def _turned(self, force: Float[Array, " p2"]) -> Inexact[Array, " p"]:
        turned = self.ports.contacts.reading.turned
        return unpacked(self.basis, turned(lambda: phase_at(self.theta), force))


class SplitOfRevolution(AbstractSplitStep):
    """A step at constant speed."""

    ports: BranchedPorts
    basis: Basis
    input_matrix: Inexact[Array, "m p"]
    h: Scalar
    order: int = eqx.field(static=True)
    batch: bool = eqx.field(static=True)

    def at(self, theta, w):
        del w
        ports = self.ports.at(lambda: phase_at(theta))
        return PortsAtAngle(ports=ports, basis=self.basis, theta=jnp.asarray(theta))

    def part(self, w, theta, span, force):
        del theta
        return step_of(self.order, self.basis, self.input_matrix, w, span, force)


class LocatedStep(AbstractStep):
    """A step that is split where a force changes its branch.

    The state of the solver counts the steps that `TRIES` attempts did not resolve. With `batch`, lanes
    under `jax.vmap` that are split run at once; otherwise one lane runs with all its tangents, as a
    Jacobian needs.
    """

    tableau: Tableau
    splitting: SplitOfRevolution
    order_: int = eqx.field(static=True)

    @classmethod
    def build(cls, form: PortForm, order: int, h: Scalar, *, batch: bool = False) -> "LocatedStep":
        ports = BranchedPorts.build(form)
        own = ports.contacts
        tableau = tableau_of(order, form.basis, own.output_matrix, own.input_matrix, h)
        splitting = SplitOfRevolution(
            ports=ports,
            basis=form.basis,
            input_matrix=own.input_matrix,
            h=h,
            order=order,
            batch=batch,
        )
        return cls(tableau=tableau, splitting=splitting, order_=order)

    def init(self, terms, t0, t1, y0, args) -> Int[Array, ""]:
        del terms, t0, t1, y0, args
        return jnp.zeros((), int)

    def step(self, terms, t0, t1, y0, args, solver_state, made_jump):
        del terms, t1, args, made_jump
        y1, unresolved = self.advance(jnp.asarray(t0), y0)
        return y1, None, {"y0": y0, "y1": y1}, solver_state + unresolved, dfx.RESULTS.successful

    def advance(self, theta: Scalar, y: Array) -> tuple[Array, Int[Array, ""]]:
        """State after a full step from `theta`, and 1 if it is not resolved."""
        ports = self.splitting.ports
        tableau, reading = one_lane((self.tableau, ports.contacts.reading))
        phases = self.tableau.phases(theta)
        free = tableau.free_readings(phases, y[:, None], reading)
        fixed, turned = ports.contacts.reading.fixed, ports.contacts.reading.turned
        now, then = fixed(lambda: phases[0], free[0][:, 0]), free[-1][:, 0]
        at = lambda time: ports.at(lambda: phases[time])
        branches = at(0).branches(now)

        def force(stage: Array, time: int) -> Array:
            phase = lambda: phases[time]
            return turned(phase, at(time).forces(branches, fixed(phase, stage[:, 0])))[:, None]

        added = tableau.increment(free, force)[:, 0]
        y1 = self.tableau.advance(y) + added
        finish = fixed(lambda: phases[-1], then + as_real(ports.contacts.output_matrix) @ added)
        ends = at(0).crossing(branches, now), at(-1).crossing(branches, finish)
        split = self.splitting.complete(theta, (y, y1), branches, ends)
        return split.y, split.unresolved
