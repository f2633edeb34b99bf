"""What an effect may do: the capabilities the system knows about.

The core sees effects only through these classes. A new effect is one class in one file that takes
on one or more of them, written against the rows and columns of `AbstractLine`.
"""

import abc
from typing import ClassVar, NamedTuple

import equinox as eqx
from jaxtyping import Array, Float

from ..core.blocks import Blocks, Load
from ..core.quantities import Scalar
from ..core.representation import AbstractPart
from ..shafts.line import AbstractLine


Plane = Float[Array, " 2"]  # a vector (x, y) of the plane of whirl
Branch = Float[Array, " c"]  # of every condition of a law, 1 where it holds, else 0


class AbstractEffect(AbstractPart):
    """Anything on or around a shaft; `kind` names it in scene files and parameter paths."""

    kind: eqx.AbstractClassVar[str]
    plural: eqx.AbstractClassVar[str]
    holds_shaft: ClassVar[bool] = False  # at its station, always or while it touches


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


class Hardness(NamedTuple):
    """Stiffness and damping of a contact against a motion outward along a direction."""

    stiffness: Scalar  # [N/m]
    damping: Scalar  # [N s/m]
    direction: Plane  # of unit length


class AbstractLaw(eqx.Module):
    """Force on the shaft at one station as a function of its displacement and velocity there.

    A law with jumps or kinks also says which smooth branch holds, so that steps can end where it
    changes: `c` conditions, each 1 or 0. A smooth law has none.
    """

    @abc.abstractmethod
    def __call__(self, displacement: Plane, velocity: Plane, speed: Scalar) -> Plane:
        """Force [N] from displacement [m], velocity [m/s] and spin speed [rad/s]."""

    @abc.abstractmethod
    def torque(self, displacement: Plane, velocity: Plane, speed: Scalar) -> Scalar:
        """Torque on the shaft about its axis [N m], positive with positive spin."""

    @abc.abstractmethod
    def hardness(self) -> "Hardness":
        """What a contact opposes to a push: steps must be short beside it."""

    @property
    @abc.abstractmethod
    def kinked(self) -> bool:
        """Whether the force has jumps or kinks."""

    @abc.abstractmethod
    def branch(self, displacement: Plane, velocity: Plane, speed: Scalar) -> Branch:
        """The conditions as they stand; of a smooth law none, `zeros(0)`."""

    @abc.abstractmethod
    def along(self, branch: Branch, displacement: Plane, velocity: Plane, speed: Scalar) -> Plane:
        """Force [N] by the formula of a branch, whether or not it holds."""

    @abc.abstractmethod
    def margins(
        self, branch: Branch, displacement: Plane, velocity: Plane, speed: Scalar
    ) -> Branch:
        """Smooth, positive while a condition stays as the branch has it; infinite if no matter."""

    @abc.abstractmethod
    def clearance(self, displacement: Plane) -> Scalar:
        """Distance [m] that is left until it acts, below zero inside; -inf if it always acts."""


class AbstractContact(AbstractEffect):
    """Acts at a station through a nonlinear law of displacement and velocity.

    Its law turned by an angle is that of the same contact with the angle added to its own.
    """

    holds_shaft: ClassVar[bool] = True

    at: eqx.AbstractVar[Scalar]
    angle: eqx.AbstractVar[Scalar]  # that it faces [rad]

    @abc.abstractmethod
    def law(self) -> AbstractLaw:
        """The law, with everything constant in time worked out."""


class AbstractBodies(AbstractEffect):
    """Brings `b` point bodies that roll around the shaft at `at`, each at an angle `phi` of its own.

    k m R phi.. = push - m Im(exp(-i phi) z..) + (k - 1) m R Omega..        on the body
    F = -m d^2/dt^2 R exp(i phi)                                            on the shaft
    """

    at: eqx.AbstractVar[Scalar]
    race_radius: eqx.AbstractVar[Scalar]  # R [m]
    rolling: eqx.AbstractVar[Scalar]  # k = 1 + J / (m radius^2) of a body [1]
    places: eqx.AbstractVar[int]  # for bodies, b
    ball_radius: eqx.AbstractVar[Scalar | None]  # of a body [m], where bodies touch

    @property
    @abc.abstractmethod
    def masses(self) -> Float[Array, " b"]:
        """Mass of every body [kg]; zero for a place without one."""

    @abc.abstractmethod
    def drag(self, rate: Float[Array, " b"]) -> Float[Array, " b"]:
        """Force along the race [N] from the rate relative to the shaft [rad/s]; its reaction drives it."""


class AbstractBetween(AbstractEffect):
    """Acts between the bodies of one race."""

    @abc.abstractmethod
    def between(
        self,
        angle: Float[Array, " b"],
        rate: Float[Array, " b"],
        race: AbstractBodies,
    ) -> Float[Array, " b"]:
        """Force along the race [N] on every body of it from angles [rad] and rates [rad/s]."""

    @abc.abstractmethod
    def duration(self, mass: Scalar) -> Scalar:
        """Duration of an impact of a body that weighs `mass` along its race [s]: steps must be shorter."""
