"""Located steps at a speed that varies: the steps of `varying_speed`, split as `splits` has it.

Within a step the speed and the loads are parabolas through their values at its beginning, middle and end.
"""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Inexact, Int

from ..core.quantities import Scalar
from .basis import Basis, as_real, packed, unpacked
from .branches import BranchedPorts
from .lanes import one_lane
from .ports import Contacts, Reading
from .splits import AbstractInstant, AbstractSplitStep, in_turn
from .tableau import LoadInStep, step_of
from .varying_speed import Course, RotorAtSpeed, VaryingStep


# Coefficients of a parabola by its values at 0, 1/2 and 1.
PARABOLA = np.array([[1.0, 0.0, 0.0], [-3.0, 4.0, -1.0], [2.0, -4.0, 2.0]])


class Outputs(eqx.Module):
    """Readings of a state `[Re w, Im w]`: motion of the ports, and the signals of the speed terms.

    Rows are [Re, Im]. The acceleration is the rate of the velocity by `tau` without contact.
    """

    motion: Float[Array, "2 3 p m2"]  # displacement, velocity, acceleration
    signals: Float[Array, "2 k m2"]
    by_load: Float[Array, "2 p l2"]  # acceleration by the loads
    by_signals: Float[Array, "2 p 2 k"]  # and by the signals, for a unit change of the speed

    @classmethod
    def of(cls, rotor: RotorAtSpeed) -> "Outputs":
        """Outputs of a rotor with contact."""
        assert rotor.output is not None and rotor.input is not None
        p = rotor.port_count
        output, entry = as_real(rotor.output), as_real(rotor.input)
        output = output.reshape(2, -1, output.shape[-1])
        place, velocity, signals = jnp.split(output, [p, 2 * p], axis=1)
        motion = [place, velocity, velocity @ as_real(rotor.basis.matrix())]
        entry = entry.reshape(entry.shape[0], 2, -1)
        by_signals = jnp.einsum("apm,mbk->apbk", velocity, entry[..., p:])
        by_load = velocity @ as_real(rotor.load_matrix)
        return cls(jnp.stack(motion, axis=1), signals, by_load, by_signals)


class InstantOfCourse(AbstractInstant):
    """The ports of a rotor at an instant of a step along its course."""

    ports: BranchedPorts  # at the speed there
    outputs: Outputs
    load: Inexact[Array, " l"]
    change: Scalar  # of the speed, from that of the decomposition
    speed_rate: Scalar  # by `tau`
    real: bool = eqx.field(static=True)  # whether the basis is

    def read(self, w):
        y, outputs = packed(w), self.outputs
        motion = outputs.motion @ y
        more = outputs.by_load @ packed(self.load)
        more = more + jnp.tensordot(outputs.by_signals, self.change * (outputs.signals @ y))
        return motion.at[:, 2].add(more).ravel()

    def crossing(self, branches, seen):
        return self.ports.crossing(branches, seen, self.speed_rate)

    def inputs(self, branches, w, exhausted=None):
        force = self.ports.forces_of(branches, self.read(w), exhausted)
        return self._entering(force, self.change * (self.outputs.signals @ packed(w)))

    def jump(self, before, after, w):
        seen, forces = self.read(w), self.ports.forces
        change = forces(before, seen) - forces(after, seen)
        return self._entering(change, jnp.zeros(self.outputs.signals.shape[:2]))

    def _entering(self, force: Array, signals: Float[Array, "2 k"]) -> Inexact[Array, " i"]:
        both = jnp.concatenate([force.reshape(2, -1), signals], axis=1)
        return both.ravel() if self.real else both[0] + 1j * both[1]


class SplitOfCourse(AbstractSplitStep):
    """A step along a course, which may be split."""

    basis: Basis
    input_matrix: Inexact[Array, "m i"]
    load_matrix: Inexact[Array, "m l"]
    outputs: Outputs
    ports: BranchedPorts
    h: Scalar
    speed: Float[Array, "3"]  # coefficients of the parabola over the step [rad/s]
    change: Float[Array, "3"]
    load: Inexact[Array, "3 l"]
    order: int = eqx.field(static=True)
    batch: bool = eqx.field(static=True)

    def at(self, theta, w):
        del w
        x = theta / self.h
        powers, rates = jnp.stack([1.0 + 0 * x, x, x**2]), jnp.stack([0 * x, 1.0 + 0 * x, 2 * x])
        ports = eqx.tree_at(lambda ports: ports.speed, self.ports, powers @ self.speed)
        change, rate = powers @ self.change, rates @ self.speed / self.h
        real = not jnp.iscomplexobj(self.basis.vectors)
        return InstantOfCourse(
            ports=ports,
            outputs=self.outputs,
            load=powers @ self.load,
            change=change,
            speed_rate=rate,
            real=real,
        )

    def part(self, w, theta, span, force):
        load, matrix = None, self.load_matrix
        if matrix.shape[1]:
            x, share = theta / self.h, span / self.h
            g0, g1, g2 = self.load
            ahead = g0 + x * (g1 + x * g2), share * (g1 + 2 * x * g2), share**2 * g2
            load = LoadInStep(matrix, ahead)
        return step_of(self.order, self.basis, self.input_matrix, w, span, force, load)


class LocatedVaryingStep(eqx.Module):
    """A step of fixed size that is split where a force changes its branch."""

    plain: VaryingStep
    rotor: RotorAtSpeed
    outputs: Outputs
    ports: BranchedPorts
    order: int = eqx.field(static=True)

    @classmethod
    def of(cls, rotor: RotorAtSpeed, plain: VaryingStep, order: int) -> "LocatedVaryingStep":
        """The located step of a rotor whose `plain` step has the laws of its ports."""
        assert rotor.output is not None and rotor.input is not None
        outputs, p = Outputs.of(rotor), rotor.port_count
        _, velocity, _ = jnp.moveaxis(outputs.motion, 1, 0)
        entry = as_real(rotor.input).reshape(velocity.shape[-1], 2, -1)
        accelerance = jnp.einsum("pm,mq->pq", velocity[0], entry[:, 0, :p])
        nothing = Reading(jnp.zeros((6 * p, 0)), None, None, None)
        contacts = Contacts(rotor.output, rotor.input, nothing)
        speed = jnp.zeros(())  # that of an instant takes its place
        ports = BranchedPorts(plain.ports, speed, rotor.axes.rate, contacts, accelerance)
        return cls(plain, rotor, outputs, ports, order)

    @property
    def reading(self) -> Float[Array, "p4 m2"]:
        """Reading of the ports, as that of a `VaryingStep`."""
        return self.plain.reading

    @property
    def contact_stiffness_ratio(self) -> Float[Array, "k 2"]:
        """See `VaryingStep.contact_stiffness_ratio`."""
        return self.plain.contact_stiffness_ratio

    def several(
        self, course: Course, y: Float[Array, " m2"], *, batch: bool
    ) -> tuple[Array, Bool[Array, ""], Int[Array, ""]]:
        """State after the steps of a course, whether a contact was loaded, and how many are unresolved."""
        return in_turn(lambda now, y: self.advance(now, y, batch=batch), course, y)

    def advance(self, now: Course, y: Array, *, batch: bool) -> tuple[Array, Array, Array]:
        """State after a step, whether a contact was loaded in it, and 1 if it is not resolved."""
        basis, h = self.rotor.basis, self.plain.tableau.h
        parabola = jnp.asarray(PARABOLA)
        split = SplitOfCourse(
            basis=basis,
            input_matrix=self.ports.contacts.input_matrix,
            load_matrix=self.rotor.load_matrix,
            outputs=self.outputs,
            ports=self.ports,
            h=h,
            speed=parabola @ now.speed,
            change=parabola @ now.change,
            load=parabola @ self.rotor.load_nodes(now.load),
            order=self.order,
            batch=batch,
        )
        state = unpacked(basis, y)
        begin, finish = split.at(jnp.zeros(()), state), split.at(h, state)
        seen = begin.read(state)
        branches = begin.ports.branches(seen)

        def law(stage: Float[Array, "p4 1"], half: int) -> Float[Array, "p2 1"]:
            motion = stage[:, 0].reshape(2, 2, -1)
            third = jnp.zeros((2, 1, motion.shape[-1]))
            at = split.at(h * half / 2, state).ports
            return at.forces(branches, jnp.concatenate([motion, third], axis=1).ravel())[:, None]

        plain, course = one_lane((self.plain, now))
        end, loaded = plain.of_lanes(course, y[:, None], law)
        y1 = end[:, 0]
        after = finish.read(unpacked(basis, y1))
        ends = begin.crossing(branches, seen), finish.crossing(branches, after)
        done = split.complete(jnp.zeros(()), (y, y1), branches, ends)
        return done.y, loaded[0] | (done.tries > 0), done.unresolved
