"""Capabilities of effects: the classes through which the equations of motion see them.

A new effect is one class in one file. It inherits one or more of these classes and uses the rows and
columns of `AbstractLine`.
"""

import abc
from collections.abc import Callable, Sequence
from typing import Any, ClassVar, NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Float

from ..core.blocks import Blocks, Load
from ..core.checks import suggest
from ..core.quantities import Scalar, Series, known
from ..core.representation import AbstractPart
from ..shafts.line import AbstractLine, AbstractShaft
from ..shafts.massless import coincide
from .law import AbstractLaw


class AbstractEffect(AbstractPart):
    """Effect on or around a shaft; `kind` names it in scene files and parameter paths."""

    kind: eqx.AbstractClassVar[str]
    plural: eqx.AbstractClassVar[str]
    holds_shaft: ClassVar[bool] = (
        False  # whether it holds the shaft at its station, always or in contact
    )
    strains: ClassVar[bool] = False  # whether it damps the strain of the shaft

    @property
    def turns_section(self) -> bool:
        """Whether it may act on the slope at its station."""
        return True


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
    """Effect that adds a constant or synchronous load."""

    @abc.abstractmethod
    def load(self, line: AbstractLine, blocks: Blocks) -> Load:
        """Load of this effect; `blocks` are those of the whole scene, as weight depends on all masses."""


class OwnPort(NamedTuple):
    """Port of one contact: its law has `row q` as displacement, and `column F` enters the equations."""

    row: Float[Array, " n"]
    column: Float[Array, " r"]
    law: AbstractLaw


class AbstractContact(AbstractEffect):
    """Effect with a nonlinear law of displacement and velocity at a station.

    Rotating the law by an angle is the same as adding the angle to `angle`. A contact stands on the
    ground, or `on` the `Casing` of a name: its law is then one of the motion relative to the casing, which
    gets the opposite force. Its law is given the motion at a second station,
    too, where its class has that in a field `sensor` [m].
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

    `push` is the sum of all forces along the race: drag, weight and contact between bodies.
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
    def masses(self) -> Float[Array, " b"]:
        """Mass of every body [kg]; zero for an empty place."""

    @abc.abstractmethod
    def drag(self, rate: Float[Array, " b"]) -> Float[Array, " b"]:
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


# === casings


def check_casings(effects: tuple[AbstractEffect, ...]) -> None:
    """Raise unless casings have names of their own, and each is held by a part that names it.

    Effects with coordinates of their own have names of their own, too.
    """
    owners = of_first_order(effects)
    for effect in owners:
        if sum(other.name == effect.name for other in owners) > 1:
            raise ValueError(
                f"Two parts with coordinates of their own have the name {effect.name!r}; give each "
                f"{effect.kind} a `name` of its own."
            )
    names = [effect.name for effect in effects if isinstance(effect, AbstractCasing)]
    for name in names:
        if names.count(name) > 1:
            raise ValueError(f"Two casings have the name {name!r}; give each a name of its own.")
    parts = [(effect, getattr(effect, key, None)) for effect in effects for key in ("of", "on")]
    parts = [(effect, name) for effect, name in parts if name is not None]
    for _, name in parts:
        check_casing(name, names)
    held = [name for effect, name in parts if not isinstance(effect, AbstractContact)]
    for name in names:
        if name not in held:
            raise ValueError(
                f"Nothing holds the casing {name!r}; give it a Support by `of`, and the shaft one by `on`."
            )


def of_first_order(effects: tuple[AbstractEffect, ...]) -> list[AbstractOwnCoordinates]:
    """Effects that have coordinates of their own."""
    return [one for one in effects if isinstance(one, AbstractOwnCoordinates) and one.own]


def names_beside(effects: tuple[AbstractEffect, ...]) -> tuple[str, ...]:
    """Names of the coordinates beside the shaft: own ones of effects, then those of casings."""
    own = [name for one in of_first_order(effects) for name in one.own]
    return *own, *(one.name for one in effects if isinstance(one, AbstractCasing))


def check_casing(name: str, names: Sequence[str]) -> None:
    """Raise unless a casing has a name."""
    if name not in names:
        there = f"the scene has: {', '.join(names)}" if names else "the scene has none"
        raise ValueError(f"There is no casing {name!r}{suggest(str(name), names)}; {there}.")


# === stations


def count_held(effects: tuple[AbstractEffect, ...]) -> int:
    """Number of stations where effects hold the shaft, always or while in contact."""
    held = (getattr(effect, "at", None) for effect in effects if effect.holds_shaft)
    return len({float(at) for at in held if at is not None})


def check_sensors(shaft: AbstractShaft, effects: tuple[AbstractEffect, ...]) -> None:
    """Raise if a sensor is where nothing can be placed on the shaft."""
    for effect in effects:
        sensor = getattr(effect, "sensor", None)
        if sensor is None or not (known(sensor) and known(shaft.length)):
            continue
        if (reason := shaft.reason_against(float(sensor))) is not None:
            raise ValueError(f"The sensor of a {effect.kind} at {float(sensor):g} m {reason}.")


def check_yield(shaft: AbstractShaft, effects: tuple[AbstractEffect, ...]) -> None:
    """Raise if a sensor is off the shaft, or a support where a constraint holds what it acts on."""
    check_sensors(shaft, effects)
    pins = [one for one in getattr(shaft, "constraints", ()) if one.displacement]
    for effect in effects:
        at, on = getattr(effect, "at", None), getattr(effect, "on", None)
        linear = effect.holds_shaft and not isinstance(effect, AbstractContact)
        if at is None or on is not None or not linear or effect.turns_section:
            continue
        for pin in pins:
            if coincide(float(at), float(pin.at), float(shaft.length)):
                raise ValueError(
                    f"The {effect.kind} at {float(at):g} m has no effect, since a {pin.holds} of the "
                    "shaft holds the displacement there; leave one of both out."
                )


# === hinges


def has_hinges(effects: tuple[AbstractEffect, ...]) -> bool:
    """Whether an effect is a hinge of the shaft."""
    return any(isinstance(one, AbstractContact) and one.hinged for one in effects)


def check_hinges(
    shaft: AbstractShaft,
    effects: tuple[AbstractEffect, ...],
    spans: Sequence[int],
    stations: Sequence[float],
) -> None:
    """Raise unless spans between known `stations` [m] meet at every hinge, and nothing resists it."""
    if not has_hinges(effects):
        return
    length, number, ends = float(shaft.length), [], [stations[k] for k in spans[1:-1]]
    for effect in effects:
        if not isinstance(effect, AbstractContact) or not effect.hinged:
            continue
        name = f"The {effect.kind} at {float(effect.at):g} m"
        at = [k for k, end in enumerate(ends) if coincide(float(effect.at), end, length)]
        if not at:
            raise ValueError(
                f"{name} bends the shaft, but no spans of it meet there; place it in a FlexibleShaft of "
                "spectral rule, between its ends and off other parts by 0.2 % of its length or not at all."
            )
        number += at
        for one in getattr(shaft, "constraints", ()):
            if one.slope and coincide(float(one.at), float(effect.at), length):
                raise ValueError(
                    f"{name} is where a {one.holds} of the shaft holds its slope; move one of them."
                )
        if getattr(shaft, "anisotropy", None) is not None:
            raise ValueError(f"{name} needs a round shaft; leave `shaft.anisotropy` out.")
        for one in effects:
            if one.strains:
                raise ValueError(
                    f"{name} has a jump of slope, which is no strain of the material, so the "
                    f"{one.kind} would damp it wrongly; take ExternalDamping, ModalDamping or a "
                    "DiscDamping in its place."
                )
    number.sort()
    if any(after - one < 2 for one, after in zip(number, number[1:], strict=False)):
        raise ValueError(
            "Two hinges of the shaft, as by cracks with `compliance`, need another station between them; "
            "put a Disc of zero mass there, or move one of them."
        )
