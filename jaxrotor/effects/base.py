"""Capabilities of effects: the classes through which the equations of motion see them.

A new effect is one class in one file. It inherits one or more of these classes and uses the rows and
columns of `AbstractLine`.
"""

import abc
from collections.abc import Callable
from typing import Any, ClassVar, NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Complex, Float

from ..core.blocks import Blocks, Load
from ..core.quantities import Scalar, Series
from ..core.representation import AbstractPart
from ..shafts.line import AbstractLine, AbstractShaft
from .law import AbstractLaw, Clock


class AbstractEffect(AbstractPart):
    """Effect on or around a shaft; `kind` names it in scene files and parameter paths."""

    kind: eqx.AbstractClassVar[str]
    plural: eqx.AbstractClassVar[str]
    holds_shaft: ClassVar[bool] = (
        False  # whether it holds the shaft at its station, always or in contact
    )
    strains: ClassVar[bool] = False  # whether it damps the strain of the shaft
    along_shaft: ClassVar[bool] = False  # whether it acts all along a shaft
    # Whether its force depends on the speed of one shaft, so that it is none between two:
    by_speed: ClassVar[bool] = False

    # Name of the shaft it sits on, in a scene of several; `at=("hp", 0.3)` gives it, too:
    shaft: str | None = eqx.field(default=None, static=True, kw_only=True)

    def __post_init__(self):
        at: Any = getattr(self, "at", None)
        if isinstance(at, tuple | list) and len(at) == 2 and isinstance(at[0], str):
            self.shaft, self.at = at

    @property
    def turns_section(self) -> bool:
        """Whether it may act on the slope at its station."""
        return True

    @property
    def reason_between(self) -> str | None:
        """Why it cannot be between two shafts as it is, and what to do; None: it can."""
        return None


class AbstractLinear(AbstractEffect):
    """Effect that adds linear blocks to the equations of motion."""

    @abc.abstractmethod
    def blocks(self, line: AbstractLine) -> Blocks:
        """Blocks of this effect."""


class Ends(NamedTuple):
    """Rows and columns of what an effect acts on, see `AbstractLine`; those of the slope may be absent."""

    row: Float[Array, " n"]
    column: Float[Array, " r"]
    slope_row: Float[Array, " n"] | None = None
    couple_column: Float[Array, " r"] | None = None


class AbstractOverSpeed(AbstractLinear):
    """Linear effect whose coefficients may be tables over the speed of rotation or over whirl.

    The equations at a speed contain `at_speed(speed).blocks(line)`, those of a motion that whirls
    `at_speed(speed).at_whirl(frequency).blocks(line)`.
    """

    speeds: eqx.AbstractVar[Series | None]  # nodes of the tables [rad/s]; None: there are none
    frequencies: eqx.AbstractVar[Series | None]  # those over the frequency of whirl [rad/s]
    hold: eqx.AbstractVar[bool]  # whether coefficients are constant beyond the nodes
    one_sense: eqx.AbstractVar[bool]  # whether `speeds` are those of one sense of rotation
    synchronous: eqx.AbstractVar[bool]  # whether a whirl has the frequency of rotation
    # Whose speed `speeds` are, of several shafts: "first", "sum" or "difference"; None: of its own
    speeds_of: eqx.AbstractVar[str | None]

    @property
    def nodes_over_speed(self) -> tuple[Series, ...]:
        """Nodes [rad/s] of all tables that are read at the speed of rotation."""
        read = (self.speeds, self.frequencies if self.synchronous else None)
        return tuple(nodes for nodes in read if nodes is not None)

    @property
    def nodes_over_whirl(self) -> Series | None:
        """Nodes [rad/s] of tables that are read at a frequency of whirl; None: there are none."""
        return None if self.synchronous else self.frequencies

    def read_at(self, speed: ArrayLike) -> Scalar:
        """Where tables over the speed are read: at `|Omega|`, unless their nodes tell the senses apart."""
        speed = jnp.asarray(speed, float)
        return jnp.where(self._signed(self.speeds), speed, jnp.abs(speed))

    def in_sense(self, sense: ArrayLike) -> list[Series]:
        """`nodes_over_speed` as speeds in one sense, ascending; those of the other are negative."""
        back = lambda nodes: self._signed(nodes) & (jnp.asarray(sense) < 0)
        return [jnp.where(back(nodes), -nodes[::-1], nodes) for nodes in self.nodes_over_speed]

    def _signed(self, nodes: Series | None) -> Any:
        """Whether nodes are speeds of either sense, not magnitudes."""
        if nodes is None or nodes is not self.speeds:
            return False
        return True if self.one_sense else nodes[0] < 0

    def blocks(self, line: AbstractLine) -> Blocks:
        return self.blocks_between(self.ends_on(line))

    @abc.abstractmethod
    def ends_on(self, line: AbstractLine) -> Ends:
        """Where the effect acts, which does not depend on the speed."""

    @abc.abstractmethod
    def blocks_between(self, ends: Ends) -> Blocks:
        """Blocks of this effect, from `ends_on` of its line."""

    @abc.abstractmethod
    def at_speed(self, speed: ArrayLike) -> "AbstractOverSpeed":
        """The effect with its coefficients at a speed [rad/s] in place of tables over it."""

    @abc.abstractmethod
    def at_whirl(self, frequency: ArrayLike) -> AbstractLinear:
        """The effect with its coefficients at a frequency of whirl [rad/s] in place of tables over it."""


class AbstractDamping(AbstractEffect):
    """Effect that damps the rotor in proportion to the inertia and stiffness that other parts give it."""

    undamped: ClassVar[bool] = False  # whether it takes modes of the rotor without any damping

    @abc.abstractmethod
    def damping(self, line: AbstractLine, blocks: Blocks, motion: Blocks) -> Blocks:
        """Blocks of this effect.

        `blocks` are those of the shaft and of all linear effects, with the rows of `line`. `motion` are
        the same in the equations of motion; they differ where the rows of `line` are virtual work.
        """


class AbstractLoad(AbstractEffect):
    """Effect that adds a load: constant, synchronous or at twice the angle of rotation, see `Load`."""

    @abc.abstractmethod
    def load(self, line: AbstractLine, blocks: Blocks) -> Load:
        """Load of this effect; `blocks` are those of the whole scene, as weight depends on all masses."""


class AbstractUnbalance(AbstractLoad):
    """Load `amount (Omega^2 - i Omega.) exp(i theta)` at one station."""

    at: eqx.AbstractVar[Scalar]  # station [m]
    since: eqx.AbstractVar[Scalar | None]  # time at which it appears [s]; None: it is always there

    @abc.abstractmethod
    def by(self, time: float) -> "AbstractUnbalance":
        """The same as it is from a time [s] on: without `since`, and zero unless it has appeared."""

    @property
    @abc.abstractmethod
    def amount(self) -> Complex[Array, ""]:
        """`m e exp(i phase)` [kg m]."""

    def load(self, line: AbstractLine, blocks: Blocks) -> Load:
        del blocks
        return Load(unbalance=self.amount * line.column(self.at))


class OwnPort(NamedTuple):
    """Port of one contact: its law has `row q` as displacement, and `column F` enters the equations."""

    row: Float[Array, " n"]
    column: Float[Array, " r"]
    law: AbstractLaw


class AbstractContact(AbstractEffect):
    """Effect with a nonlinear law of displacement and velocity at a station.

    Rotating the law by an angle is the same as adding the angle to `angle`. A contact stands on the
    ground, or `on` the `Casing` of a name: its law is then one of the motion relative to the casing, which
    gets the opposite force. Its law is given the motion at a second station, too, where its class has that
    in a field `sensor` [m].
    """

    holds_shaft: ClassVar[bool] = True
    rebounds: ClassVar[bool] = False  # whether the shaft rebounds from it, as from a stop
    walled: ClassVar[bool] = False  # whether it has no force at a wall to which the shaft may come

    at: eqx.AbstractVar[Scalar]
    angle: eqx.AbstractVar[Scalar]  # direction from the axis to the contact [rad]
    on: eqx.AbstractVar[str | None]  # name of a casing; None: the ground

    @property
    def turns_section(self) -> bool:
        return isinstance(self, AbstractLinear | AbstractLoad)  # by another capability

    @property
    def eccentric(self) -> Scalar | None:
        """Distance of its centre from the axis [m], of a law that is the same all round it; else None."""
        return None

    @property
    def hinged(self) -> bool:
        """Whether it is a hinge of a flexible shaft."""
        return False

    @property
    def own_port(self) -> "Callable[[AbstractLine], OwnPort] | None":
        """Its port on a line, where it reads and acts on other than its station; None: it does not."""
        return None

    @abc.abstractmethod
    def law(self) -> AbstractLaw:
        """Law of the contact, with quantities that are constant in time computed in advance."""


class AbstractBodies(AbstractEffect):
    """Effect with `b` bodies that roll around the shaft at station `at`, each at its own angle `phi`.

    k m R phi.. = push - m Im(exp(-i phi) z..) + (k - 1) m R Omega..        of the body
    F = -m d^2/dt^2 R exp(i phi)                                            on the shaft

    `push` is the sum of all forces along the race: drag, weight and contact between bodies. Arrays of
    bodies may have lanes last, and the parameters with them.
    """

    at: eqx.AbstractVar[Scalar]
    race_radius: eqx.AbstractVar[Scalar]  # R [m]
    rolling: eqx.AbstractVar[Scalar]  # k = 1 + J / (m r^2) of a body of radius r [1]
    places: eqx.AbstractVar[int]  # number b of places for bodies
    ball_radius: eqx.AbstractVar[Scalar | None]  # r [m], if bodies touch

    @property
    def turns_section(self) -> bool:
        return isinstance(self, AbstractLinear | AbstractLoad)  # by another capability

    @property
    @abc.abstractmethod
    def masses(self) -> Float[Array, "b ..."]:
        """Mass of every body [kg]; zero for an empty place."""

    @abc.abstractmethod
    def drag(self, rate: Float[Array, "b ..."]) -> Float[Array, "b ..."]:
        """Drag along the race [N] by the rate relative to the shaft [rad/s]; it reacts on the shaft."""


class Deviator(NamedTuple):
    """Unequal part of an effect along axes fixed in space, as a law at one station."""

    row: Float[Array, " n"]  # reads the displacement
    column: Float[Array, " r"]  # term of a unit force in the equations
    law: AbstractLaw


class AbstractUnequal(AbstractLinear):
    """Linear effect at one station that may be unequal along axes fixed in space.

    Where other axes turn with the shaft, steps in time apply the unequal part as a force at its station.
    """

    @abc.abstractmethod
    def deviator(self, line: AbstractLine) -> Deviator | None:
        """The unequal part of what `blocks` gives to fixed axes; None if it is absent."""


class AbstractCasing(AbstractEffect):
    """Body beside the shaft with a coordinate of its own, that other effects name."""

    name: eqx.AbstractVar[str]


class AbstractCoaxial(AbstractLinear):
    """Shaft on the axis of the first one, with a speed `ratio Omega + speed`."""

    name: eqx.AbstractVar[str]
    body: eqx.AbstractVar[AbstractShaft]
    ratio: eqx.AbstractVar[Scalar]
    speed: eqx.AbstractVar[Scalar | None]  # [rad/s]; None: zero
    start: eqx.AbstractVar[Scalar]  # station of its left end on the common axis [m]
    phase: eqx.AbstractVar[Scalar | None]  # its angle at t = 0 [rad]; None: zero

    @property
    def clock(self) -> Clock:
        """Speed and angle by those of the first shaft."""
        return Clock(self.ratio, self.speed, self.phase)


class AbstractOwnCoordinates(AbstractLinear):
    """Linear effect with coordinates of its own, of first order: they have damping and no mass.

    `row_of(line, name)` reads one, and `column_of(line, name)` is the term of its equation.
    """

    name: eqx.AbstractVar[str]  # which no other such effect of a scene has

    @property
    @abc.abstractmethod
    def own(self) -> tuple[str, ...]:
        """Names of its coordinates, each beginning with its own name."""


class AbstractBetween(AbstractEffect):
    """Effect that acts between the bodies of a race."""

    @abc.abstractmethod
    def between(
        self,
        angle: Float[Array, " b"],
        rate: Float[Array, " b"],
        race: AbstractBodies,
    ) -> Float[Array, " b"]:
        """Force along the race [N] on every body, by the angles [rad] and rates [rad/s]."""

    @abc.abstractmethod
    def duration(self, mass: Scalar) -> Scalar:
        """Duration [s] of an impact of a body of inertia `mass` [kg] along the race: limits the steps."""
