"""Located coupled steps: the steps of `coupled_step`, split as `splits` has it.

A split step has one state, that of the rotor in its basis and then the numbers of the others, which have
no linear part.
"""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Bool, Float, Inexact, Int

from ..core.quantities import Scalar
from ..equations.coupled import Instant, SpinAndBalls
from ..equations.system import Branches, Port
from .basis import BasisWithOthers, packed, unpacked
from .branches import BranchedPorts
from .coupled_step import CoupledStep, Sizes
from .crossing import Crossing
from .lanes import one_lane
from .ports import Contacts, Reading
from .splits import AbstractInstant, AbstractSplitStep, in_turn
from .tableau import LoadInStep, step_of
from .varying_speed import RotorAtSpeed


class InstantOfCoupledStep(AbstractInstant):
    """The ports of a rotor at an instant of a coupled step, in a state."""

    ports: BranchedPorts
    split: "SplitOfCoupledStep"
    now: Instant
    w: Inexact[Array, " m"]

    def read(self, w):
        split = self.split
        seen = packed(split.rotor_output @ split.parts(w)[0]).reshape(2, -1)
        p = len(self.ports.laws)
        motion = jnp.stack([seen[:, :p], seen[:, p : 2 * p], jnp.zeros((2, p))], axis=1)
        return motion.ravel()  # the acceleration depends on the branches

    def crossing(self, branches, seen):
        d, v, _ = jnp.moveaxis(seen.reshape(2, 3, -1), 1, 0)
        rates, split = self.inputs(branches, self.w), self.split
        own, entering = split.parts(self.w)[0], split.parts(split.input_matrix @ rates)
        change = split.basis.own.matrix() @ own + entering[0]
        if split.load_matrix.shape[1]:
            change = change + split.parts(split.load_matrix)[0][:, 0]
        p, step = len(self.ports.laws), split.step
        acceleration = packed(split.rotor_output @ change).reshape(2, -1)[:, p : 2 * p]
        if step.forces.free:
            speed_rate = step.sizes.named(entering[1].real).speed[0]
        else:
            turning = step.forces.turning(self.now, split.others(self.w))
            speed_rate = turning.acceleration / step.rate
        margins = lambda d, v, speed: self.ports.margins(branches, d, v, speed)
        point, by = (d, v, self.ports.speed), (v / step.rate, acceleration, speed_rate)
        return Crossing(*jax.jvp(margins, point, by))

    def inputs(self, branches, w, exhausted=None):
        split, step = self.split, self.split.step
        own = packed(split.rotor_output @ split.parts(w)[0])
        real, imag = jnp.split(own, 2)
        law = along(branches, exhausted)
        found, rates = step.forces(self.now, jax.lax.complex(real, imag), split.others(w), law)
        rates = ravel_pytree(rates)[0]
        if jnp.iscomplexobj(split.basis.vectors):
            return jnp.concatenate([found, rates + 0j])
        return jnp.concatenate([found.real, found.imag, rates])

    def jump(self, before, after, w):
        return self.inputs(before, w) - self.inputs(after, w)


def along(branches: tuple[Branches, ...], exhausted: Bool[Array, ""] | None = None):
    """Forces of every contact of a port along given branches; the actual ones where `exhausted`."""

    def law(number: int, port: Port, place: Array, velocity: Array, speed: Scalar) -> Array:
        found = port.along(branches[number], place, velocity, speed)
        if exhausted is None:
            return found
        return jnp.where(exhausted, port.forces(place, velocity, speed), found)

    return law


class SplitOfCoupledStep(AbstractSplitStep):
    """A coupled step that may be split; its input matrix has the rates of the others behind the forces."""

    basis: BasisWithOthers
    input_matrix: Inexact[Array, "m i"]
    load_matrix: Inexact[Array, "m l"]  # of weight
    rotor_output: Inexact[Array, "s k"]
    ports: BranchedPorts
    step: CoupledStep
    begin: Scalar  # time of the step [s]
    h: Scalar
    batch: bool = eqx.field(static=True)

    @classmethod
    def of(cls, rotor: RotorAtSpeed, step: CoupledStep, begin: Scalar, *, batch: bool):
        """The step of a rotor with contact that begins at a time [s]."""
        assert rotor.output is not None and rotor.input is not None
        others, rate = step.sizes.total, rotor.axes.rate
        size, columns = rotor.input.shape
        inputs = jnp.zeros((size + others, columns + others), rotor.input.dtype)
        inputs = inputs.at[:size, :columns].set(rotor.input)
        inputs = inputs.at[size:, columns:].set(jnp.eye(others) / rate)
        load = jnp.zeros((size + others, rotor.load_matrix.shape[1]), rotor.input.dtype)
        load = load.at[:size].set(rotor.load_matrix)
        nothing = Reading(jnp.zeros((6 * rotor.port_count, 0)), None, None, None)
        contacts = Contacts(rotor.output, rotor.input, nothing)
        still = jnp.zeros((rotor.port_count,) * 2)
        ports = BranchedPorts(step.plain.ports, jnp.zeros(()), rate, contacts, still)
        basis, h = BasisWithOthers(rotor.basis, others), step.plain.tableau.h
        return cls(
            basis=basis,
            input_matrix=inputs,
            load_matrix=load,
            rotor_output=rotor.output,
            ports=ports,
            step=step,
            begin=begin,
            h=h,
            batch=batch,
        )

    def at(self, theta, w):
        after = lambda span: jnp.asarray(self.begin + span / self.step.rate)
        now = Instant.of_step(after(theta), after(self.h / 2))
        speed = self.step.forces.turning(now, self.others(w)).speed
        ports = dataclasses.replace(self.ports, speed=speed)
        return InstantOfCoupledStep(ports=ports, split=self, now=now, w=w)

    def part(self, w, theta, span, force):
        load = None
        if self.load_matrix.shape[1]:
            one, none = jnp.ones(1), jnp.zeros(1)
            load = LoadInStep(self.load_matrix, (one, none, none))
        return step_of(self.step.order, self.basis, self.input_matrix, w, span, force, load)

    def parts(self, w: Inexact[Array, "m ..."]) -> list[Array]:
        """Coordinates of the rotor, and the numbers of the others."""
        return jnp.split(w, [w.shape[0] - self.basis.count])

    def others(self, w: Inexact[Array, " m"]) -> SpinAndBalls:
        """The others in a state."""
        return self.step.sizes.named(self.parts(w)[1].real)

    def joined(self, y: Float[Array, " y"]) -> Float[Array, " m2"]:
        """State of the split step from one of a coupled step."""
        own, x = jnp.split(y, [y.size - self.basis.count])
        return packed(jnp.concatenate([unpacked(self.basis.own, own), x]))

    def apart(self, y: Float[Array, " m2"]) -> Float[Array, " y"]:
        """State of a coupled step from one of the split step."""
        own, x = self.parts(unpacked(self.basis.own, y))
        return jnp.concatenate([packed(own), x.real])


class LocatedCoupledStep(eqx.Module):
    """A coupled step of fixed size that is split where a force changes its branch."""

    plain: CoupledStep
    rotor: RotorAtSpeed

    @property
    def reading(self) -> Float[Array, "p4 m2"]:
        """Reading of the ports, as that of a `VaryingStep`."""
        return self.plain.reading

    @property
    def contact_stiffness_ratio(self) -> Float[Array, "k 2"]:
        """See `Tableau.contact_stiffness_ratio`."""
        return self.plain.contact_stiffness_ratio

    @property
    def sizes(self) -> Sizes:
        """Numbers of the spin and the balls."""
        return self.plain.sizes

    def several(
        self, begin: Scalar, steps: int, y: Float[Array, " y"], *, batch: bool
    ) -> tuple[Float[Array, " y"], Bool[Array, ""], Int[Array, ""]]:
        """State after some steps from a time on, whether a contact was loaded, how many are unresolved."""
        times = self.plain.times(begin, steps)
        return in_turn(lambda time, y: self.advance(time, y, batch=batch), times, y)

    def advance(self, time: Scalar, y: Array, *, batch: bool) -> tuple[Array, Array, Array]:
        """State after a step, whether a contact was loaded in it, and 1 if it is not resolved."""
        split = SplitOfCoupledStep.of(self.rotor, self.plain, time, batch=batch)
        basis = split.basis.own
        w = unpacked(basis, split.joined(y))
        begin = split.at(jnp.zeros(()), w)
        seen = begin.read(w)
        branches = begin.ports.branches(seen)
        plain, now = one_lane((self.plain, time))
        end, loaded = plain.of_lanes(now, y[:, None], along(branches))
        after = split.joined(end[:, 0])
        finish = split.at(split.h, unpacked(basis, after))
        ends = (
            begin.crossing(branches, seen),
            finish.crossing(branches, finish.read(finish.w)),
        )
        done = split.complete(jnp.zeros(()), (split.joined(y), after), branches, ends)
        return split.apart(done.y), loaded[0] | (done.tries > 0), done.unresolved
