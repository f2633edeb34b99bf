"""How the shaft turns about its axis."""

import abc
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import equinox as eqx
from jaxtyping import Array, ArrayLike, Float

from ..core.quantities import Scalar, Series
from ..core.representation import AbstractPart


class Turning(NamedTuple):
    """Rotation at a time, or at many: each of the shape of the times."""

    angle: Float[Array, "*time"]  # theta [rad], 0 at t = 0
    speed: Float[Array, "*time"]  # Omega [rad/s]
    acceleration: Float[Array, "*time"]  # Omega. [rad/s^2]


class AbstractSpin(AbstractPart):
    """Law of rotation `theta(t)`, `theta(0) = 0`; positive spin turns x into y."""

    if TYPE_CHECKING:  # where an abstract variable would be an argument of every spin
        speed: ClassVar[Any]
    else:
        speed: eqx.AbstractVar[Scalar]  # at t = 0 [rad/s]

    @property
    @abc.abstractmethod
    def given(self) -> bool:
        """Whether the rotation is known without integration."""

    @property
    def kinks(self) -> Series | None:
        """Times at which the acceleration jumps [s]."""
        return None

    @abc.abstractmethod
    def turning(self, time: ArrayLike, polar: Scalar | None = None) -> Turning:
        """The rotation at times [s], zero or more, of a rotor of inertia `polar` [kg m^2]."""

    @abc.abstractmethod
    def after(self, time: Scalar, speed: Scalar | None) -> "AbstractSpin":
        """The law from `time` [s] on, of a rotor that has reached `speed` [rad/s] (None: its own)."""


def check_same_length(spin: AbstractSpin, *names: str) -> None:
    """Raise unless two series of a spin have equally many numbers."""
    one, two = (len(getattr(spin, name)) for name in names)
    if one != two:
        raise ValueError(
            f"`{names[0]}` and `{names[1]}` must be of one length, but have {one} and {two} numbers."
        )
