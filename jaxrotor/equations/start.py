"""Starting states of a motion."""

import abc
import dataclasses
import functools
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Complex, Float

from ..core import linalg
from ..core.doubt import Known
from ..core.parameters import follow
from ..core.plausibility import warn_implausible
from ..core.quantities import Scalar, known, nonnegative, quantity_units, real
from ..core.representation import AbstractPart
from ..effects.law import States
from ..scene import Scene
from .system import System


WHOLE = 1e-9  # distance of an angle from whole revolutions [rad] that is rounding


class AbstractStart(AbstractPart):
    """State in which a motion begins, at angle of revolution zero but for a `Launch`."""

    @abc.abstractmethod
    def state(
        self, system: System, at: Scalar
    ) -> tuple[Complex[Array, " n"], Complex[Array, " n"]]:
        """Coordinates [m] and velocities [m/s]; `at` [m] is the observed station."""


class AtRest(AbstractStart):
    """Straight and still: `z = 0`, `z. = 0`."""

    def state(self, system: System, at: Scalar):
        del at
        return jnp.zeros(system.n, complex), jnp.zeros(system.n, complex)


class Whirl(AbstractStart):
    """Bent by a force at the observed station and whirling: `z = radius e^(i angle)`, `z. = i rate z`.

    `rate` 0 releases the bent shaft from rest; a negative rate starts a backward whirl.
    """

    radius: Scalar = nonnegative("radius [m]")
    rate: Scalar = real("rate [rad/s]", default=0.0)
    angle: Scalar = real("angle [rad]", default=0.0)

    def state(self, system: System, at: Scalar):
        shape = linalg.solve(system.blocks.stiffness, system.line.column(at))
        there = system.line.row(at) @ shape
        held = jnp.abs(there) <= 1e-9 * jnp.max(jnp.abs(shape))
        if known(held) and bool(held):
            raise ValueError(
                "A whirl cannot start at a station that is held fast; observe another with `at`."
            )
        # While traced: the caller sees a motion that is not finite, and calls this again to raise.
        shape = shape / jnp.where(held, jnp.nan, there)
        q = self.radius * jnp.exp(1j * self.angle) * shape
        return q, 1j * self.rate * q


class Continued(AbstractStart):
    """Coordinates and velocities of the shaft, such as those at the end of another motion."""

    q: Complex[Array, " n"]
    velocity: Complex[Array, " n"]

    def state(self, system: System, at: Scalar):
        del at
        if self.q.size != system.n:
            raise ValueError(
                f"The start has {self.q.size} coordinates, but the scene {system.n}: continue a run "
                "in a scene with the same spans and nodes."
            )
        return self.q, self.velocity


class Balls(eqx.Module):
    """Angles of the bodies of one race, relative to the shaft."""

    angle: Float[Array, "*T b"]  # psi = phi - theta [rad]
    rate: Float[Array, "*T b"]  # [rad/s]


def _checked_balls(balls: Any) -> Any:
    """Balls of a launch as a tuple; raise unless they are some."""
    if balls is None:
        return None
    if not isinstance(balls, list | tuple) or not all(isinstance(one, Balls) for one in balls):
        raise ValueError(
            f"`balls` must be a `Balls` for every race, or None to spread them, but is {balls!r:.200}."
        )
    return tuple(balls)


class Launch(AbstractStart):
    """State in which a motion begins: that of the shaft, the angle of rotation, balls, states of laws.

    `balls` has an entry for every race; None spreads them evenly. `speed`, unless None, is the first
    speed of a `Drive`, and must be that of a `SpeedProfile` at its `time`; a `ConstantSpeed` jumps to
    its own. To continue with another profile, take `dataclasses.replace(run.end, time=0.0)`.
    """

    shaft: AbstractStart = eqx.field(default_factory=AtRest)
    angle: Scalar = real("angle [rad]", default=0.0)
    balls: tuple[Balls, ...] | None = eqx.field(default=None, converter=_checked_balls)
    speed: Scalar = real("speed [rad/s]", default=None)
    time: Scalar = real("time [s]", default=0.0)  # of the profile at which the motion begins
    stopped: Bool[Array, ""] = eqx.field(
        default=False, converter=jnp.asarray
    )  # and never starts again
    # Of laws, contact by contact of the scene; None: as they begin
    states: Float[Array, " s"] | None = eqx.field(
        default=None, converter=lambda own: None if own is None else jnp.asarray(own, float)
    )

    @classmethod
    def of(cls, start: AbstractStart | None) -> "Launch":
        """A start as a launch, at angle zero unless it is one; None is at rest."""
        if start is None:
            return _at_rest(jax.dtypes.canonicalize_dtype(float))
        return start if isinstance(start, Launch) else cls(start)

    def state(self, system: System, at: Scalar):
        return self.shaft.state(system, at)

    @property
    def q(self) -> Complex[Array, " n"]:
        """Coordinates of the shaft at the end of a motion [m]."""
        return self._end.q

    @property
    def velocity(self) -> Complex[Array, " n"]:
        """Velocities of the shaft at the end of a motion [m/s]."""
        return self._end.velocity

    @property
    def _end(self) -> Continued:
        if not isinstance(self.shaft, Continued):
            raise AttributeError(f"{self.shaft!r} has no coordinates without a scene.")
        return self.shaft

    def whole(self) -> bool | None:
        """Whether a revolution begins here; None while the angle is traced."""
        if not known(self.angle):
            return None
        return bool(abs(np.exp(1j * float(self.angle)) - 1) < WHOLE)


@functools.cache
def _at_rest(dtype: Any) -> Launch:
    """The launch from rest with numbers of a type, built once as short runs would wait for it."""
    del dtype
    with jax.ensure_compile_time_eval():
        return Launch()


def numbers_of(start: AbstractStart) -> dict[str, str]:
    """Units of the numbers of a start by their paths, `radius` or `balls.0.angle.2` for example."""
    units = dict(quantity_units(start))
    if not isinstance(start, Launch):
        return units
    found = {name: unit for name, unit in units.items() if getattr(start, name) is not None}
    found |= {f"shaft.{name}": unit for name, unit in numbers_of(start.shaft).items()}
    for race, balls in enumerate(start.balls or ()):
        for name, unit in {"angle": "rad", "rate": "rad/s"}.items():
            path = f"balls.{race}.{name}"
            found[path] = unit
            found |= {f"{path}.{i}": unit for i in range(np.size(getattr(balls, name)))}
    return found


def address(path: str) -> tuple[list[Any], Any]:
    """Attribute names and indices that lead to a part of a start, and the one of its number."""
    *parents, last = (int(word) if word.isdigit() else word for word in path.split("."))
    return parents, last


def put_number(start: AbstractStart, path: str, value: Any) -> AbstractStart:
    """The start with another number at a path of `numbers_of`, not checked; `balls.0.angle` sets all."""
    parents, last = address(path)
    if isinstance(last, int):
        leaf = lambda start: follow(start, parents)
        return eqx.tree_at(leaf, start, jnp.asarray(leaf(start)).at[last].set(value))
    leaf = lambda start: getattr(follow(start, parents), last)
    return eqx.tree_at(leaf, start, jnp.full(np.shape(leaf(start)), value))


def checked_start(start: Any, scene: Scene | None = None) -> AbstractStart:
    """The starting state, by default at rest; raises unless it is one, warns if it is implausible."""
    start = AtRest() if start is None else start
    if not isinstance(start, AbstractStart):
        raise ValueError(
            f"`start` must be a start such as Whirl(7e-3, rate=75.0) or `motion.end`, but is {start!r}."
        )
    shaft = start.shaft if isinstance(start, Launch) else start
    numbers = {} if scene is None else scene.known_values()
    if isinstance(shaft, Whirl) and known(shaft.radius) and numbers:
        radius = float(shaft.radius)
        warn_implausible(numbers | {"start.radius": Known(radius, "m", radius)}, "start.")
    return start


def check_states(states: Array, count: int) -> None:
    """Raise unless a start has as many states as the laws of its scene."""
    if states.shape != (count,):
        raise ValueError(
            f"`states` of the start must have the shape ({count},), one for each state of the laws of "
            f"the scene, but have {states.shape}; take `motion.end` of the same scene, or leave "
            "them out."
        )


def states_of(start: AbstractStart, system: System) -> States:
    """States of laws in a start, by default those at the begin of a motion."""
    given = start.states if isinstance(start, Launch) else None
    return system.begin() if given is None else given


def is_whole(start: AbstractStart) -> bool:
    """Whether a start is that of the shaft alone and, unless its angle is traced, at whole revolutions."""
    return not isinstance(start, Launch) or (not start.balls and start.whole() is not False)


def shaft_of(start: AbstractStart, what: str, states: int = 0) -> AbstractStart:
    """State of the shaft in a start; raises where `what`, which begins at angle zero, cannot take it.

    While the angle is traced, a state at any other angle becomes NaN. A scene whose laws have `states`
    keeps those of the start.
    """
    if not isinstance(start, Launch):
        return start
    if start.states is not None and states:
        check_states(start.states, states)
        bare = dataclasses.replace(start, states=None)
        return Launch(shaft_of(bare, what), states=start.states)
    if start.states is not None:
        raise ValueError(
            f"{what} takes no states of laws, but the start has {start.states.size}; leave them out."
        )
    if start.balls:
        raise ValueError(
            f"{what} takes no balls, but the start has {len(start.balls)} races of them."
        )
    if start.whole() is False:
        raise ValueError(
            f"{what} begins at angle zero, but the start is at {float(start.angle):g} rad of rotation; "
            "end the motion before it after whole revolutions."
        )
    if start.whole() is None:
        zero = jnp.abs(jnp.exp(1j * start.angle) - 1) < WHOLE
        return jax.tree.map(lambda leaf: jnp.where(zero, leaf, jnp.nan), start.shaft)
    return start.shaft
