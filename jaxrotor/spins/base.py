"""Base class of the laws of rotation of the shaft about its axis."""

import abc
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Float

from ..core.quantities import Scalar, Series
from ..core.representation import AbstractPart


class Turning(NamedTuple):
    """Rotation at one time or many: each field has the shape of the times."""

    angle: Float[Array, "*time"]  # theta [rad], 0 at t = 0
    speed: Float[Array, "*time"]  # Omega [rad/s]
    acceleration: Float[Array, "*time"]  # Omega. [rad/s^2]


class AbstractSpin(AbstractPart):
    """Law of rotation `theta(t)`, `theta(0) = 0`; positive spin turns x into y."""

    if TYPE_CHECKING:  # to type checkers an abstract variable would be an argument of every spin
        speed: ClassVar[Any]
    else:
        speed: eqx.AbstractVar[Scalar]  # at t = 0 [rad/s]

    @property
    @abc.abstractmethod
    def given(self) -> bool:
        """Whether the rotation is known in advance, without integration."""

    @property
    @abc.abstractmethod
    def sense(self) -> Scalar:
        """-1 of a rotor that turns y into x, else +1: the sense in which analyses choose speeds."""

    @property
    def kinks(self) -> Series | None:
        """Times at which the acceleration jumps [s]."""
        return None

    @abc.abstractmethod
    def turning(self, time: ArrayLike, polar: Scalar | None = None) -> Turning:
        """Rotation at times `time` >= 0 [s] of a rotor with polar moment of inertia `polar` [kg m^2]."""

    @abc.abstractmethod
    def after(self, time: Scalar, speed: Scalar | None) -> "AbstractSpin":
        """The law with t = 0 at `time` [s], where the rotor has `speed` [rad/s]; None: that of the law."""


def sense_of(speed: ArrayLike) -> Float[Array, "*speeds"]:
    """-1 where a speed is negative, else +1."""
    return jnp.where(jnp.asarray(speed) < 0, -1.0, 1.0)


def check_same_length(spin: AbstractSpin, *names: str) -> None:
    """Raise unless two tables of a spin have the same number of values."""
    one, two = (len(getattr(spin, name)) for name in names)
    if one != two:
        raise ValueError(
            f"`{names[0]}` and `{names[1]}` must be of one length, but have {one} and {two} numbers."
        )
