"""Exact motion of a linear rotor at constant speed, at any times."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float, Inexact

from ..core.quantities import Scalar
from ..effects.law import Now
from ..equations.constant_frame import ConstantFrame
from ..equations.fixed_axes import FixedAxes
from ..equations.pencil import Pencil, isotropic, steady_response
from ..equations.system import System
from ..solvers.basis import ModalBasis, SlotBasis, packed, unpacked
from ..solvers.phi import phi_dense


NEAR = 1e-6  # distance of a load's frequency from a root, over the rate, that counts as resonance


def has_steady_motion(system: System, values: np.ndarray, rate: float) -> bool:
    """Whether no load excites an undamped mode at its frequency; `values` are roots over `rate`."""
    frequencies = [] if system.load.constant is None else [0.0]
    if system.load.unbalance is not None:
        frequencies.append(float(system.spin.speed) / rate)
    frequencies += [float(one.clock.speed(system.spin.speed)) / rate for one in system.others]
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
    steady = _steady(system, axes, angle + system.spin.speed * times, times)
    deviation = axes.state(*begin) - steady[0]
    if basis is None:
        states = _by_exponentials(axes.matrix, rate * jnp.diff(times), deviation, even=even)
    else:
        states = _by_modes(basis, rate * times, deviation)
    return jax.vmap(axes.coordinates)(states + steady)


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


def _steady(
    system: System, axes: FixedAxes, phases: Float[Array, " T"], times: Float[Array, " T"]
) -> Inexact[Array, "T m"]:
    """States of the steady response by the angles of rotation, and by the times of other shafts.

    Each is a sum of a few states, so that no sine is taken for every coordinate.
    """
    speed, one = system.spin.speed, jnp.ones_like(phases)
    parts: list[tuple[Array, Array]] = []  # values at all angles, and the state that they multiply
    if axes.equal:
        still, whirling = steady_response(system)
        none = jnp.zeros(system.n, complex)
        if still is not None:
            parts.append((one, axes.state(still + none, none)))
        if whirling is not None:
            parts.append((jnp.exp(1j * phases), axes.state(whirling, 1j * speed * whirling)))
    else:
        frame = ConstantFrame.of(system, axes.rate)
        if frame.still is not None:
            parts.append((one, frame.still))
        if frame.cos is not None and frame.sin is not None:
            parts += [(jnp.cos(phases), frame.cos), (jnp.sin(phases), jnp.sign(speed) * frame.sin)]
    for other in system.others:
        now: Any = other.clock.of(Now(speed, phases, time=times))
        ahead, back = _response(system, now.speed, now.speed**2 * other.column)
        total, apart = ahead + back, 1j * (ahead - back)
        parts += [
            (jnp.cos(now.angle), axes.state(total, now.speed * apart)),
            (jnp.sin(now.angle), axes.state(apart, -now.speed * total)),
        ]
    if not parts:
        return jnp.zeros((phases.size, axes.matrix.shape[0]), axes.matrix.dtype)
    values, states = (jnp.stack(each) for each in zip(*parts, strict=True))
    return values.T @ states


def _response(system: System, frequency: Scalar, force: Array) -> tuple[Array, Array]:
    """`q, b` of the motion `q exp(i w t) + b exp(-i w t)` under `force exp(i w t)`, along fixed axes."""
    pencil = Pencil.of(system)
    if isotropic(system.blocks):
        return pencil.response(frequency, force), jnp.zeros_like(force)
    q, b = jnp.split(pencil.response(frequency, jnp.concatenate([force, 0 * force])), 2)
    return q, b.conj()
