"""Lent stiffness: the linear equations hold a journal that floats in its film.

    F = -k z - c z. + (F + k z + c z.)

Exponential steps propagate the deviation from the rest position of the linear rotor, and a rotor that
only films hold has none. So films lend it their damping about the centre, and that times the speed as a
stiffness; what is left of their forces stays at the ports. The motion is the same. So do bearings whose
balls pass and laws with states, such as magnetic bearings, by a stiffness that holds the inertia at their
station at the speed of rotation; and the latter by a damping.
"""

import dataclasses

import jax.numpy as jnp

from ..core import linalg
from ..core.blocks import Blocks
from .port import Port
from .system import System


def with_lent_films(system: System) -> System:
    """The system whose steep laws lend stiffness and damping; laws that repeat or have states, stiffness.

    One without such laws, or whose ports lend already, is returned as it is. At standstill there is no
    speed, so films lend damping alone, and laws with states their own stiffness.
    """
    ports = tuple(_lending(port, system) for port in system.ports)
    blocks = system.blocks
    for port, before in zip(ports, system.ports, strict=True):
        if port.lent is not None and before.lent is None:
            across = jnp.outer(port.column, port.row)
            stiffness, damping = port.lent
            blocks = blocks + Blocks(stiffness=stiffness * across, damping=damping * across)
    return dataclasses.replace(system, ports=ports, blocks=blocks)


def _lending(port: Port, system: System) -> Port:
    """The port with what its laws lend."""
    films = tuple(law for law in port.laws if law.steep)
    turning = system.repeats and any(law.clock == "turns" for law in port.laws)
    if port.lent is not None or not (films or turning or port.places):
        return port
    if not films:
        # Any value serves. That of a bearing would depend on its load, and there may be no gap.
        yielding = port.row @ linalg.solve(system.blocks.inertia, port.column)
        speed = jnp.abs(system.spin.speed)
        stiffness, damping = speed**2 / yielding, jnp.zeros(())
        if (
            port.places
        ):  # undamped, a mass that they alone hold would be in resonance with its unbalance
            stiffness = jnp.where(speed > 0, stiffness, port.hardness()[0])
            damping = speed / yielding
        return dataclasses.replace(port, lent=jnp.stack([stiffness, damping]))
    damping = dataclasses.replace(port, laws=films).hardness()[1]
    return dataclasses.replace(
        port, lent=jnp.stack([damping * jnp.abs(system.spin.speed), damping])
    )
