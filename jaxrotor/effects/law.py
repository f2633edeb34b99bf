"""Law: the force on the shaft at a station, by the motion there, the rotation and its own states."""

import abc
from typing import Any, ClassVar, Literal, NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..core.quantities import Number, Scalar


Plane = Float[Array, "2 ..."]  # vector (x, y) in the plane of whirl, of one motion or of lanes
Branch = Float[Array, "c ..."]  # for every condition of a law 1 if it holds, else 0
States = Float[Array, "s ..."]  # states of a law, or their rates


class Hardness(NamedTuple):
    """Stiffness and damping of a contact for an outward motion along a direction, and its friction."""

    stiffness: Scalar  # [N/m]
    damping: Scalar  # [N s/m]
    direction: Plane  # unit vector; zero where it is the same along every direction
    friction: Scalar  # coefficient [1]


class Beside(NamedTuple):
    """Rotation of a shaft on which a contact of another one stands."""

    speed: Number  # [rad/s]
    angle: Number | None  # [rad]; None: its law has no `clock`


class Now(NamedTuple):
    """Speed, angle, states and a sensor, on which a law may depend beside the motion at its station."""

    speed: Number  # of rotation [rad/s]
    angle: Number | None = None  # of its `clock` [rad]; None: it has none
    state: States | None = None  # its own `states`; None: it has none
    sensor: tuple[Plane, Plane] | None = None  # motion at its contact's `sensor`; None: it has none
    branch: Branch | None = None  # that its `rates` follow; None: the one of the motion
    acceleration: Number | None = None  # of rotation [rad/s^2]; None: zero
    time: Number | None = None  # [s], along times
    beside: Beside | None = None  # of the shaft on which it stands; None: it stands on none


class Clock(eqx.Module):
    """`Omega_k = ratio Omega + excess`, `theta_k = ratio theta + excess t + phase` of a shaft."""

    ratio: Number
    excess: Number | None  # [rad/s]; None: zero
    phase: Number | None = None  # [rad]; None: zero

    def speed(self, first: Number) -> Number:
        """Its speed [rad/s] by that of the first shaft."""
        own = self.ratio * first
        return own if self.excess is None else own + self.excess

    def of(self, now: Now) -> Now:
        """Speed, angle and states for laws on this shaft, by those for laws on the first one."""
        angle, acceleration = now.angle, now.acceleration
        if angle is not None:
            angle = self.ratio * angle
            if self.excess is not None:  # by revolutions there is no time, and no law asks for it
                angle = None if now.time is None else angle + self.excess * now.time
            if angle is not None and self.phase is not None:
                angle = angle + self.phase
        if acceleration is not None:
            acceleration = self.ratio * acceleration
        return now._replace(speed=self.speed(now.speed), angle=angle, acceleration=acceleration)


class AbstractLaw(eqx.Module):
    """Force on the shaft at a station as a function of the displacement and velocity there.

    A law with jumps or kinks consists of smooth branches. `c` conditions, each 1 or 0, determine the
    branch, so that steps in time can end where it changes. A smooth law has no conditions.

    A law may have `states` of its own, whose `rates` are integrated with the motion; a solver with an
    error estimate controls them to 1e-10 of their units. It may read the motion at another station, the
    `sensor` of its contact. It may depend on the angle of rotation. By the
    `clock` "revolution" that angle is within a revolution, from 0 to 2 pi, so that motions by whole
    revolutions have it exactly: forces and margins are then to be periodic functions of it. By "turns"
    it counts all turns, as `TimeHistory.angle` does, for what turns at another ratio. Where such a law
    states the `period` after which it repeats, periodic orbits give it the angle within that.
    """

    steep: ClassVar[bool] = False  # whether it has no bound, so that steps need an error estimate
    states: ClassVar[tuple[str, ...]] = ()  # names with units, such as "wear [m]"
    clock: ClassVar[Literal["revolution", "turns"] | None] = None  # None: no angle is given

    def __init_subclass__(cls, **options: Any):
        super().__init_subclass__(**options)
        if cls.clock not in (None, "revolution", "turns"):
            raise ValueError(
                f'`clock` of {cls.__name__} must be "revolution", "turns" or None, but is {cls.clock!r}.'
            )
        if not isinstance(cls.states, tuple | property):
            raise ValueError(
                f'`states` of {cls.__name__} must be a tuple of texts such as ("wear [m]",), but is '
                f"{cls.states!r}."
            )

    @property
    def elementwise(self) -> bool:
        """Whether all methods compute element by element, for lanes along a last axis as for one motion.

        It holds for the class that defines it alone: a law that inherits from it says it again.
        Its numbers then have a last axis, too, of as many lanes or of one. Only `x, y = displacement` and
        arithmetic of numbers are elementwise; sums over an array or products of matrices are not. Other
        laws are mapped over the lanes, which takes about twice the time.
        """
        return False

    @property
    def period(self) -> Number | None:
        """Angle of the shaft [rad] after which the force repeats; None: none is known, or none is needed.

        A law by "turns" may state its own.
        """
        return 2 * jnp.pi * jnp.ones(()) if self.clock == "revolution" else None

    @property
    def takes_lanes(self) -> bool:
        """Whether the law's own class says that it is `elementwise`."""
        return self.elementwise and "elementwise" in vars(type(self))

    @abc.abstractmethod
    def __call__(self, displacement: Plane, velocity: Plane, now: Now) -> Plane:
        """Force [N] from displacement [m], velocity [m/s] and what is given `now`."""

    def begin(self) -> States:
        """Its states at the start of a motion, by default zero."""
        return jnp.zeros(len(self.states))

    def rates(self, force: Plane, displacement: Plane, velocity: Plane, now: Now) -> States:
        """Rates of its states per second, by its force [N] and the motion there.

        Rates with kinks of their own follow `now.branch` where it is given, as located steps do.
        """
        raise NotImplementedError(f"{type(self).__name__} has `states`, so it needs their `rates`.")

    @abc.abstractmethod
    def torque(self, force: Plane, displacement: Plane, velocity: Plane, now: Now) -> Number:
        """Torque on the shaft about its axis [N m], positive in the sense of positive spin.

        `force` is that of the law, or of one of its branches.
        """

    @abc.abstractmethod
    def hardness(self) -> "Hardness":
        """Stiffness and damping of the contact, which limit the length of steps in time; friction."""

    @property
    @abc.abstractmethod
    def kinked(self) -> bool:
        """Whether the force has jumps or kinks."""

    @abc.abstractmethod
    def branch(self, displacement: Plane, velocity: Plane, now: Now) -> Branch:
        """Conditions in the current state; `zeros(0)` for a smooth law."""

    @abc.abstractmethod
    def along(self, branch: Branch, displacement: Plane, velocity: Plane, now: Now) -> Plane:
        """Force [N] by the formula of a branch, whether or not its conditions hold."""

    @abc.abstractmethod
    def margins(self, branch: Branch, displacement: Plane, velocity: Plane, now: Now) -> Branch:
        """Smooth functions, positive while a condition keeps its value; infinite where it is inactive."""

    @abc.abstractmethod
    def clearance(self, displacement: Plane) -> Number:
        """Distance [m] to contact, negative in contact; -inf for a law that always acts.

        It is that at the start, and at angle 0, of a law that has states or turns.
        """


class AbstractSmoothLaw(AbstractLaw):
    """Law that acts everywhere by one formula, so there is no branch and no clearance."""

    @property
    def kinked(self) -> bool:
        return False

    def branch(self, displacement: Plane, velocity: Plane, now: Now) -> Branch:
        return jnp.zeros(0)

    def along(self, branch: Branch, displacement: Plane, velocity: Plane, now: Now) -> Plane:
        return self(displacement, velocity, now)

    def margins(self, branch: Branch, displacement: Plane, velocity: Plane, now: Now) -> Branch:
        return jnp.zeros(0)

    def clearance(self, displacement: Plane) -> Number:
        return -jnp.inf * jnp.ones(())
