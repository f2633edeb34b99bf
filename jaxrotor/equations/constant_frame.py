"""Constant frame: the equations of an unequal rotor in the axes where their coefficients are constant.

    Y' = A Y + B F,   Y = [x, y, x', y'],   ' = d/dtheta

Bearings of unequal stiffness leave the coefficients constant in fixed axes, a shaft of two stiffnesses
in axes that turn with it. All is real: the two axes no longer make one complex coordinate.
"""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Complex, Float, Inexact

from ..core import linalg
from ..core.blocks import Load
from ..core.compiled import compiled_quickly
from ..core.quantities import Scalar
from ..effects.law import Now
from .clocks import Clocks
from .massless_coordinates import Condensed, Massless
from .pencil import Pencil, check_axes, frame, isotropic, steady_response
from .stationary_frame import Motion
from .system import System


WORST_GAIN = 0.6  # of a remainder: above it a rotor is integrated unless Exponential() is named


def in_constant_axes(system: System) -> System:
    """The system in axes of constant coefficients; the same one where it has such axes anyway.

    Where some unequal axes stand still and others turn, these are the turning ones. What is unequal
    beside them is a remainder that acts through ports, in fixed axes `F = -k z* - c z.*`.
    """
    if frame(system.blocks) != "periodic":
        return system
    if not system.deviators:
        check_axes(
            system,
            "No axes have constant coefficients, as exponential steps need, and not all forces along the "
            "fixed ones act by constant numbers at single stations,",
            "leave `solver` out, or name a diffrax solver such as `solver=diffrax.Kvaerno5()`",
        )
    means = dataclasses.replace(system.blocks, fixed_damping=None, fixed_stiffness=None)
    ports, count = (*system.ports, *system.deviators), len(system.deviators)
    return dataclasses.replace(system, blocks=means, ports=ports, deviators=(), remainder=count)


@compiled_quickly
def loop_gain(system: System) -> Scalar:
    """Gain of the remainder of a system `in_constant_axes`: of an anisotropic bearing its anisotropy.

    It is `|D^(1/2) rows K^-1 columns D^(1/2)|`, with the moduli `D` of the unequal stiffnesses and the
    stiffness `K` of the rotor without them.
    """
    ports, still, axes = system.ports[-system.remainder :], jnp.zeros(2), jnp.eye(2)
    rows = jnp.kron(axes, jnp.stack([port.row for port in ports]))
    columns = jnp.kron(axes, jnp.stack([port.column for port in ports], axis=1))
    flexibility = rows @ linalg.solve(of_axes(Pencil.of(system.at_speed(0.0))).stiffness, columns)
    now = Now(system.spin.speed)
    force = lambda z, port: port.forces(z, still, now).sum(0)
    slope = lambda port: jax.jacfwd(force)(still, port)
    moduli = jnp.stack([linalg.spectral_norm(slope(port)) for port in ports])
    roots = jnp.sqrt(jnp.tile(moduli, 2))
    return linalg.spectral_norm(roots[:, None] * flexibility * roots)


class ConstantFrame(eqx.Module):
    """Real first-order equations of a system, and their exact steady response.

        steady(theta) = still + cos(theta) cos_part + sin(theta) sin_part

    In fixed axes `x + i y = q`; in turning axes `x + i y = q exp(-i s theta)`. Unbalance is constant
    in turning axes, and weight turns backward there. Parts that no load makes are None.
    """

    matrix: Float[Array, "k k"]  # of Y, or of the part of it that `condensed` keeps
    drive: Float[Array, "k p2"] | None  # by [Re F, Im F] of all ports, in these axes
    still: Float[Array, " n4"] | None
    cos: Float[Array, " n4"] | None
    sin: Float[Array, " n4"] | None
    rate: Scalar  # [rad/s]
    turn: Scalar | None  # s: the axes turn by s theta; None: they are fixed
    condensed: Condensed | None = None  # where there are coordinates without mass
    clocks: Clocks | None = None  # of the other shafts, which add to the steady response

    @classmethod
    def of(cls, system: System, rate: Scalar) -> "ConstantFrame":
        """The equations of a system whose revolution takes `2 pi / rate` seconds."""
        pencil, speed, load = of_axes(Pencil.of(system)), system.spin.speed, system.load
        turns = frame(system.blocks) == "rotating"
        if system.massless is None:
            (matrix, drive), condensed = _first_order(system, pencil, rate), None
        else:
            condensed = _condensed(system, system.massless, pencil, rate)
            matrix, drive = condensed.matrix, condensed.drive
        steady, whirling = load.still_force(speed), load.unbalance_force(speed)
        if turns:
            steady, whirling = whirling, steady
        still = cos = sin = None
        if steady is not None:
            place = pencil.response(jnp.zeros(()), _in_axes(steady) + 0j).real
            still = jnp.concatenate([place, jnp.zeros_like(place)])
        if whirling is not None:
            way = -1.0 if turns else 1.0  # weight, seen from turning axes, turns backward
            force = jnp.concatenate([whirling, -1j * whirling])
            if (twice := load.twice_force(speed)) is not None:  # it turns forward in turning axes
                force = force + jnp.concatenate([twice.conj(), 1j * twice.conj()])
            amplitude = pencil.response(way * speed, force)
            state = jnp.concatenate([amplitude, 1j * way * speed / rate * amplitude])
            cos, sin = state.real, -way * jnp.sign(speed) * state.imag
            if turns:  # weight stands still beside a rotor at rest
                rest = jnp.where(speed == 0, cos, 0.0)
                still, cos = rest if still is None else still + rest, cos - rest
        turn = speed / rate if turns else None

        def respond(rho: Scalar, force: Array) -> tuple[Array, Array]:
            amplitude = pencil.response(rate * rho, jnp.concatenate([force, -1j * force]))
            state = jnp.concatenate([amplitude, 1j * rho * amplitude])
            return state.real, -state.imag

        clocks = Clocks.of(system, rate, respond, 0.0 if turn is None else turn)
        return cls(matrix, drive, still, cos, sin, rate, turn, condensed, clocks)

    @property
    def steady(self) -> Float[Array, " n4"]:
        """The steady response at `theta = 0`."""
        parts = [part for part in (self.still, self.cos) if part is not None]
        whole = self.matrix if self.condensed is None else self.condensed.lift
        return sum(parts, start=jnp.zeros(whole.shape[0]))

    def state(self, q: Complex[Array, " n"], velocity: Complex[Array, " n"]) -> Float[Array, " n4"]:
        """State at `theta = 0` of coordinates [m] and their velocities [m/s] in fixed axes."""
        drift = velocity / self.rate
        if self.turn is not None:
            drift = drift - 1j * self.turn * q
        return jnp.concatenate([_in_axes(q), _in_axes(drift)])

    def coordinates(self, state: Float[Array, " n4"]) -> tuple[Array, Array]:
        """Coordinates [m] and velocities [m/s] in fixed axes of a state at `theta = 0`."""
        x, y, dx, dy = jnp.split(state, 4)
        q, drift = x + 1j * y, dx + 1j * dy
        if self.turn is not None:
            drift = drift + 1j * self.turn * q
        return q, self.rate * drift

    def output(self, rows: Float[Array, "s n"]) -> Float[Array, "s4 n4"]:
        """Output matrix: `[Re, Im]` of displacement and absolute velocity of stations, in these axes."""
        zero, rate = jnp.zeros_like(rows), self.rate * rows
        if self.turn is None:
            along, across = [zero, zero, rate, zero], [zero, zero, zero, rate]
        else:
            carried = self.turn * rate
            along, across = [zero, -carried, rate, zero], [carried, zero, zero, rate]
        return jnp.block([[rows, zero, zero, zero], along, [zero, rows, zero, zero], across])


def _first_order(system: System, pencil: Pencil, rate: Scalar) -> tuple[Array, Array | None]:
    """`A` and `B` of the equations of coordinates that all have mass."""
    n, inertia = system.n, pencil.inertia
    low = -linalg.solve(inertia, jnp.concatenate([pencil.stiffness, pencil.damping], 1))
    low = low.at[:, : 2 * n].divide(rate**2).at[:, 2 * n :].divide(rate)
    high = jnp.concatenate([jnp.zeros((2 * n, 2 * n)), jnp.eye(2 * n)], axis=1)
    drive = None
    if system.ports:
        columns = jnp.stack([port.column for port in system.ports], axis=1)
        columns = linalg.solve(system.blocks.inertia, columns) / rate**2
        both = jnp.kron(jnp.eye(2), columns)
        drive = jnp.concatenate([jnp.zeros_like(both), both])
    return jnp.concatenate([high, low]), drive


def _condensed(system: System, massless: Massless, pencil: Pencil, rate: Scalar) -> Condensed:
    """The equations without the coordinates that have no mass, by the angle of revolution."""
    parts = pencil.inertia, pencil.damping / rate, pencil.stiffness / rate**2
    columns = None
    if system.ports:
        columns = jnp.stack([port.column for port in system.ports], axis=1) / rate**2
        columns = jnp.kron(jnp.eye(2), columns)
    return Condensed.of(parts, columns, massless)


def linear_matrix(system: System, rate: Scalar) -> Inexact[Array, "m m"]:
    """`A` of the linear equations without loads and balls: complex where all axes are equal, else real."""
    system = dataclasses.replace(in_constant_axes(system), races=())
    if isotropic(system.blocks) and system.massless is None:
        return Motion(dataclasses.replace(system, ports=()), rate, loads=False).matrix()
    unloaded = dataclasses.replace(system, load=Load(), others=())
    return ConstantFrame.of(unloaded, rate).matrix


def steady_amplitudes(system: System) -> list[Array]:
    """Displacements [m] that make up the steady response: its constant and its harmonic parts."""
    system = in_constant_axes(system)
    if isotropic(system.blocks):
        return [part for part in steady_response(system) if part is not None]
    axes = ConstantFrame.of(system, jnp.ones(()))
    parts = (axes.still, axes.cos, axes.sin)
    return [part[: 2 * system.n] for part in parts if part is not None]


def of_axes(pencil: Pencil) -> Pencil:
    """The pencil in real unknowns `(x, y)`."""
    if pencil.paired:
        return pencil.along_axes
    real = lambda z: jnp.block([[z.real, -z.imag], [z.imag, z.real]])
    return Pencil(real(pencil.inertia), real(pencil.damping), real(pencil.stiffness))


def _in_axes(z: Complex[Array, " n"]) -> Float[Array, " n2"]:
    return jnp.concatenate([z.real, z.imag])
