"""What an effect may do: the three capabilities the system knows about.

The core sees effects only through these classes. A new effect is one class in one file that takes
on one or more of them, written against the rows and columns of `AbstractLine`.
"""

import abc

import equinox as eqx
from jaxtyping import Array, Float

from ..blocks import Blocks, Load
from ..quantities import Scalar
from ..shafts.line import AbstractLine


Plane = Float[Array, " 2"]  # a vector (x, y) of the plane of whirl


class AbstractEffect(eqx.Module):
    """Anything on or around a shaft; `kind` names it in scene files and parameter paths."""

    kind: eqx.AbstractClassVar[str]
    plural: eqx.AbstractClassVar[str]


class AbstractLinear(AbstractEffect):
    """Adds to the linear blocks."""

    @abc.abstractmethod
    def blocks(self, line: AbstractLine) -> Blocks:
        """The blocks this effect adds."""


class AbstractLoad(AbstractEffect):
    """Adds a constant or synchronous load."""

    @abc.abstractmethod
    def load(self, line: AbstractLine, blocks: Blocks) -> Load:
        """The load, given all linear blocks (weight needs the masses of others)."""


class AbstractLaw(eqx.Module):
    """Force on the shaft at one station as a function of its displacement and velocity there."""

    @abc.abstractmethod
    def __call__(self, displacement: Plane, velocity: Plane, speed: Scalar) -> Plane:
        """Force [N] from displacement [m], velocity [m/s] and spin speed [rad/s]."""


class AbstractContact(AbstractEffect):
    """Acts at a station through a nonlinear law of displacement and velocity."""

    at: eqx.AbstractVar[Scalar]

    @abc.abstractmethod
    def law(self) -> AbstractLaw:
        """The law, with everything constant in time worked out."""
