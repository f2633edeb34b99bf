"""Constant speed of rotation."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import ArrayLike

from ..core.quantities import Scalar, known, real
from .base import AbstractSpin, Turning as Turning, sense_of


class ConstantSpeed(AbstractSpin):
    """Constant speed: `theta(t) = Omega t`."""

    speed: Scalar = real("speed [rad/s]")

    @property
    def given(self) -> bool:
        return True

    @property
    def sense(self) -> Scalar:
        return sense_of(self.speed)

    def turning(self, time: ArrayLike, polar: Scalar | None = None) -> Turning:
        del polar
        time = jnp.asarray(time, float)
        speed = jnp.broadcast_to(self.speed, time.shape)
        return Turning(self.speed * time, speed, jnp.zeros_like(time))

    def after(self, time: Scalar, speed: Scalar | None) -> "ConstantSpeed":
        del time, speed
        return self


def constant(speed: ArrayLike) -> ConstantSpeed:
    """`ConstantSpeed` with a speed [rad/s] that is not checked, so compiled programs have no check."""
    value = np.asarray(speed, float) if known(speed) else speed
    return eqx.tree_at(lambda spin: spin.speed, ConstantSpeed(0.0), jnp.asarray(value, float))
