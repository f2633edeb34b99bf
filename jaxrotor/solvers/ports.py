"""Ports: inputs and outputs of the linear rotor at contacts, in coordinates that are advanced exactly.

    w' = A w + B f(C w + steady(theta)),   w = state less the exact steady response

See docs/concepts/ports.md.
"""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float, Inexact

from ..core.lanes import per_lane
from ..core.quantities import Scalar
from ..effects.law import Now, States
from ..equations.clocks import Clocks
from ..equations.constant_frame import ConstantFrame
from ..equations.massless_coordinates import Condensed
from ..equations.pencil import Pencil, steady_response
from ..equations.port import Law, Port, actual, forces_and_rates
from ..equations.stationary_frame import Motion
from ..equations.system import System
from .basis import (
    Basis,
    Count,
    Dense,
    Rotation,
    SlotRotation,
    as_real,
    packed,
    unpacked,
)
from .feedthrough import force_through
from .form import AbstractForm
from .reading import Phase, Reading
from .step import AbstractRotor, Step
from .tableau import Flows, phase_at, phase_rate, tableau_of


class Contacts(eqx.Module):
    """Input and output matrices of the ports of a scene with contact."""

    output_matrix: Inexact[Array, "p2 m"]  # C, (4p, m) in a real basis
    input_matrix: Inexact[Array, "m p"]  # B, (m, 2p) in a real basis
    reading: Reading
    through: Float[Array, "s f"] | None = None  # D, (4p, 2p), of ports without mass


class PortField(eqx.Module):
    """`dy/dtheta = A y + B f`, `f = f(C y + steady + D f)`, all real; a vector field for diffrax.

    `D` is None where all ports have mass, so that their motion follows from the state alone.
    """

    motion: Motion
    generator: Float[Array, "m2 m2"]
    input_matrix: Float[Array, "m2 p2"] | None
    reading: Reading | None
    through: Float[Array, "p4 p2"] | None = None

    def __call__(self, theta: Scalar, y: Array, args: None = None) -> Array:
        del args
        rate = self.generator @ y
        if self.reading is not None and self.input_matrix is not None:
            phase = phase_at(theta, self.reading.rates)
            force = self.forces_of(lambda: phase, self.reading(theta, y))
            rate = rate + self.input_matrix @ self.reading.turned(lambda: phase, force)
        return rate

    def through_at(self, phase: Phase) -> Float[Array, "p4 p2 ..."] | None:
        """`D` along fixed axes."""
        if self.through is None or self.reading is None:
            return None
        return self.reading.around(phase, self.through)

    def forces_of(
        self,
        phase: Phase,
        seen: Float[Array, "p4 ..."],
        law: Law = actual,
        states: States | None = None,
    ) -> Float[Array, "f ..."]:
        """`[Re, Im]` of the port forces from displacement and velocity of the ports without them.

        The rates of the states of laws follow where states are given; then all ports have mass.
        """
        through, now = self.through_at(phase), self.motion.of_laws(phase, states)
        parts = self.motion.ports, now
        if through is None:
            return forces_of_lanes(*parts, seen, law)
        yielding = lambda every, seen: _through(every[0], every[1], seen, every[2])
        every = parts, through, law
        return yielding(every, seen) if seen.ndim == 1 else per_lane(yielding, every, seen)


@eqx.filter_jit
def _through(
    parts: tuple[tuple[Port, ...], Now],
    through: Float[Array, "p4 p2"],
    seen: Float[Array, " p4"],
    law: Law,
) -> Float[Array, " p2"]:
    return force_through(lambda seen: _forces(parts, seen, law), seen, through)


def take_lanes(ports: tuple[Port, ...]) -> bool:
    """Whether the laws of all ports are called once for all lanes."""
    return all(law.takes_lanes for port in ports for law in port.laws)


def forces_of_lanes(
    ports: tuple[Port, ...], now: Now, seen: Float[Array, "p4 ..."], law: Law = actual
) -> Float[Array, "f ..."]:
    """`[Re, Im]` of the forces of all ports, from displacement and velocity, in one or all lanes.

    Where `now` has states of laws, their rates per second follow.
    Elementwise laws are called once for all lanes. Without the barriers the compiler computes what a
    stage reads, and its forces, once for each of their uses: 70 in place of 36 ns a lane-step of order 2.
    """
    parts = ports, now
    if seen.ndim == 1:
        return _forces(parts, seen, law)
    if not take_lanes(ports):
        return per_lane(lambda every, seen: _forces(every[0], seen, every[1]), (parts, law), seen)
    if seen.shape[-1] == 1:
        return _forces(parts, seen, law)
    return jax.lax.optimization_barrier(_forces(parts, jax.lax.optimization_barrier(seen), law))


@eqx.filter_jit  # traced once a program
def _forces(
    parts: tuple[tuple[Port, ...], Now], seen: Float[Array, "p4 ..."], law: Law
) -> Float[Array, "f ..."]:
    (ports, now), motion = parts, seen.reshape(2, 2, -1, *seen.shape[1:])
    forces, rates = forces_and_rates(ports, motion[:, 0], motion[:, 1], now, law)
    forces = forces.reshape(-1, *seen.shape[1:])
    return forces if rates is None else jnp.concatenate([forces, rates])


class YieldingReading(eqx.Module):
    """Reading of stations, some of which yield at once to the forces of the ports.

    d = C y + steady + D f,   v = rate dd/dtheta
    """

    stations: Reading
    through: Float[Array, "s4 p2"]
    field: PortField

    def __call__(self, theta: Scalar, y: Array) -> Float[Array, " s4"]:
        return self._at(phase_at(theta, self.stations.rates), y)

    def of_lanes(self, phase: Float[Array, "c2 ..."], y: Float[Array, "m2 ..."]) -> Array:
        """Readings of one or all lanes, by cosine and sine of the angle of revolution."""
        if y.ndim == 1:
            return self._at(phase, y)
        read = lambda parts, y: parts[0]._at(parts[1], y)
        return per_lane(read, (self, phase.reshape(len(phase), -1)), y)

    def _at(self, phase: Float[Array, " c2"], y: Array) -> Float[Array, " s4"]:
        field, stations = self.field, self.stations
        ports, enters = field.reading, field.input_matrix
        assert ports is not None and enters is not None

        def seen(phase: Array, y: Array) -> tuple[Array, Array]:
            at = lambda: phase
            read = lambda of: of.fixed(at, of.matrix @ y + of.steady(phase))
            force = field.forces_of(at, read(ports))
            return read(stations) + stations.around(at, self.through) @ force, force

        _, force = seen(phase, y)
        rate = field.generator @ y + enters @ ports.turned(lambda: phase, force)
        ahead = phase_rate(phase, stations.rates)
        (now, _), (rates, _) = jax.jvp(seen, (phase, y), (ahead, rate))
        place, speed = (part.reshape(2, 2, -1)[:, 0] for part in (now, field.motion.rate * rates))
        return jnp.stack([place, speed], axis=1).ravel()


class PortForm(AbstractForm, AbstractRotor):
    """`y = [Re w, Im w]`: deviation from the exact steady response, in a basis of `A`.

    Where the axes are unequal, `w` is real, in the `axes` that make the coefficients constant.
    """

    motion: Motion
    basis: Basis
    contacts: Contacts | None
    stations: Reading | YieldingReading
    steady: Inexact[Array, " m"]  # at theta = 0, without what other clocks add
    axes: ConstantFrame | None = None  # None: one complex coordinate serves both axes
    clocks: Clocks | None = None  # of states

    @classmethod
    def along_axes(cls, axes: ConstantFrame, motion: Motion, rows: Array, basis: Basis):
        """Form of the motion of a rotor with unequal axes, with stations `rows` (s, n) to read."""
        parts = axes.still, axes.cos, axes.sin
        condensed = axes.condensed
        vectors = basis.vectors if condensed is None else condensed.lift @ basis.vectors
        feed = None if condensed is None else condensed.feed

        def reading(output: Array) -> Reading:
            still, cos, sin = (None if part is None else output @ part for part in parts)
            clocks = axes.clocks and axes.clocks.seen(output)
            return Reading(output @ vectors, still, cos, sin, axes.turn, clocks)

        contacts = None
        if axes.drive is not None and motion.rows is not None:
            output = axes.output(motion.rows)
            forced = basis.inverse @ axes.drive
            through = None if feed is None else output @ feed
            contacts = Contacts(output @ vectors, forced, reading(output), through)
        output = axes.output(rows)
        form = cls(motion, basis, contacts, reading(output), axes.steady, axes, axes.clocks)
        if feed is None:
            return form
        yielding = YieldingReading(reading(output), output @ feed, form.field)
        return dataclasses.replace(form, stations=yielding)

    @classmethod
    def build(cls, system: System, motion: Motion, rows: Array, basis: Basis):
        """Form of a system's motion, with stations `rows` (s, n) to read."""
        still, whirling = steady_response(system)
        if still is not None:
            still = jnp.concatenate([still, jnp.zeros_like(still)])
        if whirling is not None:
            whirling = jnp.concatenate([whirling, 1j * motion.s * whirling])
        contacts = None
        clocks = Clocks.of(system, motion.rate, _whirl_of(system, motion.rate))
        if motion.columns is not None and motion.rows is not None:
            forced = jnp.concatenate([0 * motion.columns, motion.columns])
            output = _output(motion, motion.rows)
            contacts = Contacts(
                output @ basis.vectors,
                basis.inverse @ forced,
                _reading(motion, output, basis, still, whirling, clocks),
            )
        stations = _reading(motion, _output(motion, rows), basis, still, whirling, clocks)
        steady = sum(
            (part for part in (still, whirling) if part is not None), 0 * basis.vectors[:, 0]
        )
        return cls(motion, basis, contacts, stations, steady, clocks=clocks)

    @property
    def field(self) -> PortField:
        generator, contacts = as_real(self.basis.matrix()), self.contacts
        if contacts is None:
            return PortField(self.motion, generator, None, None)
        enters = as_real(contacts.input_matrix)
        return PortField(self.motion, generator, enters, contacts.reading, contacts.through)

    @property
    def output(self) -> Inexact[Array, "s m"] | None:
        """Output matrix of the ports."""
        return None if self.contacts is None else self.contacts.output_matrix

    @property
    def input(self) -> Inexact[Array, "m p"] | None:
        """Input matrix of the ports."""
        return None if self.contacts is None else self.contacts.input_matrix

    @property
    def load_matrix(self) -> Float[Array, "m2 l"]:
        """That of no loads, as a state is the deviation from the response to them."""
        return jnp.zeros((as_real(self.basis.vectors).shape[1], 0))

    def step(self, order, h, forcing, *, once=False) -> Step:
        """A step of `h` [rad]."""
        assert self.output is not None and self.input is not None
        flows = Flows.of(order, self.basis, self.input, h)
        return Step(tableau_of(self.basis, self.output, flows, h, once=once), forcing)

    @property
    def _begin(self) -> Inexact[Array, " m"]:
        """The whole steady response at `theta = 0`."""
        return self.steady if self.clocks is None else self.steady + self.clocks.cos.sum(0)

    def encode(self, q, velocity):
        if self.axes is not None:
            state = self.axes.state(q, velocity)
        else:
            state = jnp.concatenate([q, velocity / self.motion.rate])
        moved = state - self._begin
        if self.axes is not None and self.axes.condensed is not None:
            moved = moved[np.asarray(self.axes.condensed.kept)]
        return packed(self.basis.inverse @ moved)

    def decode(self, y):
        moved = self.basis.vectors @ unpacked(self.basis, y)
        if self.axes is not None and self.axes.condensed is not None:
            moved = self._whole(self.axes.condensed, moved, y)
        state = moved + self._begin
        if self.axes is not None:
            return self.axes.coordinates(state)
        q, rate = jnp.split(state, 2)
        return q, self.motion.rate * rate

    def _whole(self, condensed: Condensed, moved: Array, y: Array) -> Array:
        """Deviation of all coordinates and their rates at `theta = 0`, by that of those that are kept."""
        whole, field = condensed.lift @ moved, self.field
        if condensed.feed is None or field.reading is None:
            return whole
        zero = jnp.zeros(())
        force = field.forces_of(lambda: phase_at(zero), field.reading(zero, y))
        return whole + condensed.feed @ force

    def read(self, theta, y):
        return self.stations(theta, y).reshape(2, 2, -1)

    def free_propagator(self, span: Scalar) -> Rotation | SlotRotation | Dense:
        """Propagator over an angle of revolution without contact."""
        nothing = jnp.zeros((self.basis.vectors.shape[1], 0), self.basis.vectors.dtype)
        flow, _ = self.basis.flow(span, nothing, 0)
        return self.basis.propagator(flow)

    def advance_free(self, y: Array, revolutions: Count) -> Array:
        """State after whole revolutions without contact, in closed form."""
        return packed(self.basis.advance_free(revolutions, unpacked(self.basis, y)))


def _whirl_of(system: System, rate: Scalar):
    """Cosine and sine parts of the state of a whirl at `rho` times the rate under a force."""

    def respond(rho: Scalar, force: Array) -> tuple[Array, Array]:
        amplitude = Pencil.of(system).response(rate * rho, force)
        state = jnp.concatenate([amplitude, 1j * rho * amplitude])
        return state, 1j * state

    return respond


def _output(motion: Motion, rows: Float[Array, "s n"]) -> Float[Array, "s2 n2"]:
    """Output matrix of displacement and velocity of stations, on `(q, dq/dtheta)`."""
    zero = jnp.zeros_like(rows)
    return jnp.block([[rows, zero], [zero, motion.rate * rows]])


def _reading(motion: Motion, output, basis, still, whirling, clocks) -> Reading:
    """Reading of the deviation in a basis, with the steady response."""
    matrix = as_real(output @ basis.vectors)
    offset = None if still is None else _stack(output @ still)
    clocks = clocks and clocks.seen(output, _stack)
    if whirling is None:
        return Reading(matrix, offset, None, None, clocks=clocks)
    whirl = output @ whirling
    turned = _stack(whirl), _stack(1j * motion.s * whirl)
    return Reading(matrix, offset, *turned, clocks=clocks)


def _stack(z: Complex[Array, " a"]) -> Float[Array, " a2"]:
    return jnp.concatenate([z.real, z.imag])
