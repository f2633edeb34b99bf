"""Observable: a quantity that a sweep keeps of a motion, one revolution or window of a run at a time.

An observable receives each of them once and stores no trajectory. `update` runs inside the compiled
sweep; `report` turns its results, with lanes in front, into named variables.
"""

import abc
import dataclasses
from collections.abc import Mapping
from typing import Any, ClassVar, Literal, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Complex, Float

from ..core.plane import angle, square
from ..core.quantities import Number
from ..motion.base import Bodies, Window


class Variable(NamedTuple):
    """A reported array: dimensions behind the lanes, values, unit and long name."""

    dims: tuple[str, ...]
    values: np.ndarray
    units: str
    long_name: str


class Turn(eqx.Module):
    """A kept revolution or window at the observed station, its first and last samples included.

    All arrays but `number` have a last axis of lanes where lanes are observed together, see `rows`.
    """

    z: Complex[Array, "T ..."]  # displacement [m], T = steps + 1
    velocity: Complex[Array, "T ..."]  # [m/s]
    contact_force: Complex[Array, "T k ..."] | None  # [N]
    number: Array  # number of this revolution, from 0
    step: Number  # length of a step [s]
    s: Number  # sign of the spin
    count: int = eqx.field(static=True)  # revolutions kept
    time: Float[Array, "T ..."] | None = None  # since the start of a run [s]; None in revolutions
    speed: Float[Array, "T ..."] | None = None  # of rotation [rad/s]; None in revolutions
    bodies: Bodies | None = None  # balls; None: there are none
    states: Float[Array, "T x ..."] | None = None  # of laws; None: there are none

    @classmethod
    def of(cls, window: Window, number: Array, count: int) -> "Turn":
        """The revolution or window at the first of the sampled stations."""
        z, velocity = window.displacement[:, 0], window.velocity[:, 0]
        seen = z, velocity, window.contact_force, number
        pace = window.step, window.sense, count, window.time, window.speed
        return cls(*seen, *pace, window.bodies, window.states)

    def in_centre(self) -> Bool[Array, "T ..."]:
        """Whether a sample is in the centre, or passes through it to within rounding."""
        rounding = jnp.finfo(self.velocity.real.dtype).eps
        return square(self.z) <= rounding * self.step**2 * square(self.velocity)

    def turned(self) -> Float[Array, "S ..."]:
        """Change of the polar angle `arg z` in every step [rad]."""
        return angle(self.z[1:] * jnp.conj(self.z[:-1]))


class AbstractObservable(eqx.Module):
    """A quantity that is kept of each revolution, and how it is reported."""

    needs_contact: eqx.AbstractClassVar[bool]
    # Whether `update` takes lanes along a last axis, or one without it; a subclass says it again:
    rows: ClassVar[bool] = False
    needs_balls: ClassVar[bool] = False
    needs_states: ClassVar[bool] = False
    paced: ClassVar[Literal["any", "revolutions", "times"]] = "revolutions"  # in what it is defined

    @abc.abstractmethod
    def check(self, steps: int, contacts: int) -> None:
        """Raise `ValueError` unless so many steps a revolution and contacts can be observed."""

    @abc.abstractmethod
    def start(self, contacts: int) -> Any:
        """The carry before the first revolution of a scene with so many contacts."""

    @abc.abstractmethod
    def update(self, carry: Any, turn: Turn) -> tuple[Any, Any]:
        """The carry after a revolution, and the arrays that are stored of this revolution."""

    @abc.abstractmethod
    def report(self, carry: Any, stored: Any, count: int) -> Mapping[str, Variable]:
        """Variables by name, from the last carry (lanes, ..) and what was stored.

        Stored arrays are (lanes, revolutions, ..); `count` is the number of revolutions.
        """


def updated(one: AbstractObservable, carry: Any, turn: Turn) -> tuple[Any, Any]:
    """`one.update(carry, turn)`, of one lane or of all along a last axis."""
    if turn.z.ndim == 1 or "rows" in vars(type(one)) and one.rows:
        return one.update(carry, turn)
    number = jnp.broadcast_to(turn.number, turn.z.shape[1:])
    every = dataclasses.replace(turn, number=number)
    return jax.vmap(one.update, in_axes=-1, out_axes=-1)(carry, every)


class AbstractStored(AbstractObservable):
    """A quantity that is stored of each revolution or window, whatever was before it."""

    needs_contact: ClassVar[bool] = False

    def check(self, steps: int, contacts: int) -> None:
        del steps, contacts

    def start(self, contacts: int) -> None:
        return None
