"""Exact motion of a linear rotor at constant speed, at any times."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float

from ..core.quantities import Scalar
from ..equations.constant_frame import ConstantFrame
from ..equations.fixed_axes import FixedAxes
from ..equations.pencil import steady_response
from ..equations.system import System
from ..solvers.basis import ModalBasis, SlotBasis, packed, unpacked


NEAR = 1e-6  # distance of a load's frequency from a root, over the rate, that counts as resonance


def has_steady_motion(system: System, values: np.ndarray, rate: float) -> bool:
    """Whether no load excites an undamped mode at its frequency; `values` are roots over `rate`."""
    frequencies = [] if system.load.constant is None else [0.0]
    if system.load.unbalance is not None:
        frequencies.append(float(system.spin.speed) / rate)
    return all(np.abs(1j * one - values).min() > NEAR for one in frequencies)


def exact_motion(
    system: System,
    basis: ModalBasis | SlotBasis,
    rate: Scalar,
    times: Float[Array, " T"],
    begin: tuple[Array, Array],
    angle: Scalar,
) -> tuple[Complex[Array, "T n"], Complex[Array, "T n"]]:
    """`Y = steady(t) + exp(A t) (Y_0 - steady(0))`: coordinates and their rates, at all times."""
    axes = FixedAxes.of(system, rate)
    steady = _steady(system, axes)
    phase = lambda time: angle + system.spin.speed * time
    deviation = basis.inverse @ (axes.state(*begin) - steady(phase(0.0)))

    def at(time: Scalar) -> tuple[Array, Array]:
        nothing = jnp.zeros((deviation.size, 0), deviation.dtype)
        flow, _ = basis.flow(rate * time, nothing, 0)
        there = unpacked(basis, basis.propagator(flow)(packed(deviation)))
        return axes.coordinates(basis.vectors @ there + steady(phase(time)))

    return jax.vmap(at)(times)


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
