"""Exact motion of a linear rotor at constant speed, at any times."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float, Inexact

from ..core.quantities import Scalar
from ..equations.constant_frame import ConstantFrame
from ..equations.fixed_axes import FixedAxes
from ..equations.pencil import steady_response
from ..equations.system import System
from ..solvers.basis import ModalBasis, SlotBasis, packed, unpacked
from ..solvers.phi import phi_dense


NEAR = 1e-6  # distance of a load's frequency from a root, over the rate, that counts as resonance


def has_steady_motion(system: System, values: np.ndarray, rate: float) -> bool:
    """Whether no load excites an undamped mode at its frequency; `values` are roots over `rate`."""
    frequencies = [] if system.load.constant is None else [0.0]
    if system.load.unbalance is not None:
        frequencies.append(float(system.spin.speed) / rate)
    return all(np.abs(1j * one - values).min() > NEAR for one in frequencies)


def exact_motion(
    system: System,
    basis: ModalBasis | SlotBasis | None,
    rate: Scalar,
    times: Float[Array, " T"],
    begin: tuple[Array, Array],
    angle: Scalar,
    *,
    even: bool,
) -> tuple[Complex[Array, "T n"], Complex[Array, "T n"]]:
    """`Y = steady(t) + exp(A t) (Y_0 - steady(0))`: coordinates and their rates, at all times from 0 on.

    Without a modal basis it is advanced from time to time, of one distance if they are `even`.
    """
    axes = FixedAxes.of(system, rate)
    steady = _steady(system, axes)
    phases = angle + system.spin.speed * times
    deviation = axes.state(*begin) - steady(phases[0])
    if basis is None:
        states = _by_exponentials(axes.matrix, rate * jnp.diff(times), deviation, even=even)
    else:
        states = _by_modes(basis, rate * times, deviation)
    return jax.vmap(lambda state, phase: axes.coordinates(state + steady(phase)))(states, phases)


def _by_modes(basis: ModalBasis | SlotBasis, times: Float[Array, " T"], begin: Array) -> Array:
    """`V exp(L t) V^-1 Y`: free motion at all times."""
    amplitudes = basis.inverse @ begin

    def at(time: Scalar) -> Array:
        flow, _ = basis.flow(time, jnp.zeros((amplitudes.size, 0), amplitudes.dtype), 0)
        return unpacked(basis, basis.propagator(flow)(packed(amplitudes)))

    return jax.vmap(at)(times) @ basis.vectors.T


def _by_exponentials(
    matrix: Inexact[Array, "m m"], lengths: Float[Array, " l"], begin: Array, *, even: bool
) -> Array:
    """Free motion at first and after each length of time, by one exponential if they are `even`."""
    flow = lambda length: phi_dense(length * matrix, jnp.zeros((begin.size, 0), begin.dtype), 0)[0]
    whole = flow(jnp.mean(lengths)) if even else None

    def one(state: Array, length: Scalar) -> tuple[Array, Array]:
        state = (flow(length) if whole is None else whole) @ state
        return state, state

    return jnp.concatenate([begin[None], jax.lax.scan(one, begin, lengths)[1]])


def _steady(system: System, axes: FixedAxes):
    """State of the steady response by the angle of rotation."""
    speed = system.spin.speed
    if axes.equal:
        still, whirling = steady_response(system)
        none = jnp.zeros(system.n, complex)
        rest = none if still is None else still + none
        rest = axes.state(rest, none)
        if whirling is None:
            return lambda phase: rest
        whirl = axes.state(whirling, 1j * speed * whirling)
        return lambda phase: rest + whirl * jnp.exp(1j * phase)
    frame = ConstantFrame.of(system, axes.rate)
    rest = jnp.zeros(frame.matrix.shape[0]) if frame.still is None else frame.still
    if frame.cos is None or frame.sin is None:
        return lambda phase: rest
    along, ahead = frame.cos, jnp.sign(speed) * frame.sin
    return lambda phase: rest + jnp.cos(phase) * along + jnp.sin(phase) * ahead
