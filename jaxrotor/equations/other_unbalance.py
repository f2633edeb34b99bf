"""Unbalance of the shafts beside the first one: a load at another clock."""

from collections.abc import Sequence
from typing import Any, ClassVar, cast

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Complex

from ..core.plane import cosine_and_sine
from ..core.quantities import Number, Scalar
from ..effects.law import AbstractSmoothLaw, Clock, Hardness, Now, Plane
from .port import Port


class OtherUnbalance(eqx.Module):
    """`(Omega_k^2 - i Omega_k.) column exp(i theta_k)` of a shaft, by its clock."""

    clock: Clock
    column: Complex[Array, " r"]
    name: str = eqx.field(static=True)  # of the shaft

    def ports(self) -> list[Port]:
        """Ports by which it acts in time, one for each part of a complex column that is there."""
        parts = [(self.column.real, 0.0), (self.column.imag, jnp.pi / 2)]
        return [
            Port(
                jnp.zeros(column.size),
                column,
                jnp.zeros(()),
                (jax.tree.map(lambda leaf: leaf[None], UnbalanceLaw(jnp.asarray(phase))),),
                clock=self.clock,
            )
            for column, phase in parts
        ]


def force_of(
    shaft: str, others: Sequence[OtherUnbalance], speed: Scalar
) -> Complex[Array, " r"] | None:
    """`Omega_k^2 column` of a shaft beside the first one, by the speed of that; None: it has none."""
    loads = [one.clock.speed(speed) ** 2 * one.column for one in others if one.name == shaft]
    return loads[0] if loads else None


class UnbalanceLaw(AbstractSmoothLaw):
    """`(Omega^2 - i Omega.) exp(i (theta + phase))` [1/s^2], whatever the motion."""

    clock: ClassVar = "turns"

    phase: Scalar  # [rad]

    @property
    def elementwise(self) -> bool:
        return True

    def __call__(self, displacement: Plane, velocity: Plane, now: Now) -> Plane:
        del velocity
        cos, sin = cosine_and_sine(cast(Any, now.angle) + self.phase)
        square, rise = now.speed**2, 0.0 if now.acceleration is None else now.acceleration
        force = [square * cos + rise * sin, square * sin - rise * cos]
        return jnp.stack(force) + 0 * displacement

    def torque(self, force: Plane, displacement: Plane, velocity: Plane, now: Now) -> Number:
        return 0 * displacement[0]

    def hardness(self) -> Hardness:
        zero = jnp.zeros_like(self.phase)
        return Hardness(zero, zero, jnp.zeros(2), zero)
