"""Magnetic bearing about a static position: a linear force whose controller has coordinates of its own."""

from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Complex, Float

from ..core.blocks import Blocks
from ..core.quantities import Scalar, Series, nonnegative, positive, real, series
from ..shafts.cased import column_of, ends, row_of
from ..shafts.line import AbstractLine
from .base import AbstractOwnCoordinates
from .controller import Controller, check_controller


class LinearMagneticBearing(AbstractOwnCoordinates):
    """`F = current_factor i + position_factor x` of each axis, with the controller of a `MagneticBearing`.

    `x` is the displacement at `at` and `i` the current, which follows from the displacement at the
    `sensor` by `kp`, `ki`, `kd`, `filter` and `lag`, or by `numerator`, `denominator` and `lag`, as there.
    `current_across` and `position_across` are the factors along the second axis, at right angles to
    `angle`; if they are absent, both axes are alike. States of the controllers are coordinates of the
    rotor, of first order: they have damping and no mass. `jaxrotor.linearized` makes such a bearing of
    each `MagneticBearing`.
    Source: Schweitzer, Maslen (2009), Magnetic Bearings, chapter 4.
    """

    kind: ClassVar[str] = "linear_magnetic_bearing"
    plural: ClassVar[str] = "linear_magnetic_bearings"
    by_speed: ClassVar[bool] = True
    holds_shaft: ClassVar[bool] = True

    at: Scalar = nonnegative("at [m]")
    current_factor: Scalar = real("current_factor [N/A]")  # k_i
    position_factor: Scalar = real("position_factor [N/m]")  # k_s, positive: it pulls outward
    kp: Scalar | None = real("kp [A/m]", default=None)
    ki: Scalar | None = real("ki [A/(m s)]", default=None)
    kd: Scalar | None = real("kd [A s/m]", default=None)
    filter: Scalar | None = positive("filter [s]", default=None)  # time of the derivative [s]
    lag: Scalar | None = positive("lag [s]", default=None)  # of the amplifier [s]
    angle: Scalar = real("angle [rad]", default=0.0)
    sensor: Scalar | None = nonnegative("sensor [m]", default=None)  # station [m]; None: `at`
    current_across: Scalar | None = real("current_across [N/A]", default=None)
    position_across: Scalar | None = real("position_across [N/m]", default=None)
    # Coefficients of a controller of one's own:
    numerator: Series | None = series("numerator [1]", least=1, default=None)
    denominator: Series | None = series("denominator [1]", least=1, default=None)
    on: str | None = eqx.field(default=None, static=True)  # name of a casing; None: the ground
    name: str = eqx.field(default="magnetic_bearing", static=True)  # of its coordinates

    def __check_init__(self):
        check_controller(self, None)

    @property
    def turns_section(self) -> bool:
        return False

    @property
    def own(self) -> tuple[str, ...]:
        names = [*Controller.of(self).names, *["current [A]"] * (self.lag is not None)]
        return tuple(f"{self.name}.{one.partition(' [')[0]}" for one in names)

    def blocks(self, line: AbstractLine) -> Blocks:
        controller, (row, column) = Controller.of(self), ends(line, self.at, self.on)
        place, _ = ends(line, self.at if self.sensor is None else self.sensor, self.on)
        states, into = self._own(line)
        count = len(controller.names)
        force = jnp.outer(column, row)
        mean, unequal = self._factors("position")
        found = Blocks(stiffness=-mean * force)
        if unequal is not None:
            found += Blocks(fixed_stiffness=-unequal * force)
        if self.own:
            change = jnp.ones(count)
            if self.lag is not None:
                change = jnp.append(change, self.lag)
            found += Blocks(damping=(into * change) @ states)
        if count:
            found += Blocks(stiffness=-into[:, :count] @ controller.a @ states[:count])
        # i = -c x - .. of a current without lag, and lag i. + i = -c x - .. of one with it
        exits = controller.c @ states[:count]
        if self.lag is None:
            found += self._forced(column, -exits)
        else:
            found += self._forced(column, states[-1])
            found += Blocks(stiffness=jnp.outer(into[:, -1], states[-1] + exits))
        return found + by_reading(self.entries(line), place)

    def entries(self, line: AbstractLine) -> Blocks:
        """Columns of `blocks` by which the reading of the sensor enters the equations, and its rate."""
        controller, (_, into) = Controller.of(self), self._own(line)
        column, count = ends(line, self.at, self.on)[1], len(controller.names)
        g = controller.g
        found = Blocks(stiffness=-(into[:, :count] @ controller.b)[:, None]) if count else Blocks()
        one = jnp.ones(1)
        if self.lag is None:
            found += self._forced(column, -controller.d * one)
            return found if g is None else found + self._forced(column, -g * one, "damping")
        lagging = into[:, -1:]
        found += Blocks(stiffness=controller.d * lagging)
        return found if g is None else found + Blocks(damping=g * lagging)

    def _forced(self, column: Array, current: Array, block: str = "stiffness") -> Blocks:
        """Blocks of the force by a current, a linear form of the coordinates or of their rates."""
        mean, unequal = self._factors("current")
        force = jnp.outer(column, current)
        found = Blocks(**{block: -mean * force})
        return found if unequal is None else found + Blocks(**{f"fixed_{block}": -unequal * force})

    def _own(self, line: AbstractLine) -> tuple[Float[Array, "c n"], Float[Array, "r c"]]:
        """Rows of its own coordinates, and the columns of their equations."""
        place, column = ends(line, self.at, self.on)
        rows = [row_of(line, name) for name in self.own]
        columns = [column_of(line, name) for name in self.own]
        if not rows:
            return jnp.zeros((0, place.size)), jnp.zeros((column.size, 0))
        return jnp.stack(rows), jnp.stack(columns, axis=1)

    def _factors(self, name: str) -> tuple[Scalar, Complex[Array, ""] | None]:
        """Mean of a factor over both axes, and its unequal part `f` of a force `f z*`, if there is one."""
        along, across = getattr(self, f"{name}_factor"), getattr(self, f"{name}_across")
        if across is None:
            return along, None
        return (along + across) / 2, (along - across) / 2 * jnp.exp(2j * self.angle)


def by_reading(entries: Blocks, row: Float[Array, " n"]) -> Blocks:
    """Blocks of a reading by a linear form of the coordinates, from the columns by which it enters."""
    found = {name: getattr(entries, name) * row for name in entries.present}
    return Blocks(**found)
