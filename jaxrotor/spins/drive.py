"""Drive: a motor of limited torque, and resistance to rotation."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike

from ..core.lanes import per_lane
from ..core.quantities import (
    Number,
    Scalar,
    Series,
    known,
    nonnegative,
    positive,
    real,
    series,
)
from .base import AbstractSpin, Turning as Turning, check_same_length, sense_of
from .riccati import riccati


class Drive(AbstractSpin):
    """Motor and resistance: `I Omega. = M0 - k1 Omega - k2 Omega^2 - M_C sgn Omega + M(Omega)`.

    `torque` M0, `slope` k1, `drag` k2, `coulomb` M_C, `polar` I. With `odd` the drag is
    `k2 Omega |Omega|`, which opposes rotation in either sense; else it is `k2 Omega^2`, which drives at
    Omega < 0, and is refused where the rotor begins or runs backward unless `odd` is False. `M(Omega)` is
    a table, linear between its speeds and constant beyond them. With `feedback`
    the forces on the rotor act on its rotation too: unbalance, weight, friction in contacts, internal
    damping and unequal stiffness of the shaft. With `stops` a rotor that comes to rest stays at rest,
    whatever the torque.
    Source: course project "Dynamic reactions in the bearings of a rotor", eqs. (1), (11).
    """

    speed: Scalar = real("speed [rad/s]")
    torque: Scalar = real("torque [N m]")
    slope: Scalar | None = real("slope [N m s]", default=None)
    drag: Scalar | None = nonnegative("drag [N m s^2]", default=None)
    odd: bool | None = eqx.field(default=None, static=True)
    coulomb: Scalar | None = nonnegative("coulomb [N m]", default=None)
    table_speeds: Series | None = series("table_speeds [rad/s]", ascending=True, default=None)
    table_torques: Series | None = series("table_torques [N m]", default=None)
    polar: Scalar | None = positive("polar [kg m^2]", default=None)  # None: that of the scene
    feedback: bool = eqx.field(default=False, static=True)
    stops: bool = eqx.field(default=False, static=True)

    def __check_init__(self):
        if (self.table_speeds is None) != (self.table_torques is None):
            raise ValueError(
                "`table_speeds [rad/s]` and `table_torques [N m]` belong together; give both or neither."
            )
        if self.table_speeds is not None:
            check_same_length(self, "table_speeds", "table_torques")
        if known(self.sense):
            self.check_drag(self.sense)

    def check_drag(self, speeds: ArrayLike) -> None:
        """Raise if the drag drives the rotor at one of known speeds, and that is not said to be meant."""
        driven = self.driven_back(speeds)
        if known(driven) and driven:
            raise ValueError(
                "`drag [N m s^2]` would drive this rotor, which turns backward from "
                f"{float(self.speed):g} rad/s under {float(self.torque):g} N m; give `odd = true`, with "
                "which it opposes either sense, or `odd = false` if `k2 Omega^2` is meant to the letter."
            )

    def driven_back(self, speeds: ArrayLike) -> ArrayLike:
        """Whether the drag drives the rotor at one of some speeds, and that is not said to be meant."""
        if self.drag is None or self.odd is not None:
            return False
        return (self.drag > 0) & jnp.any(jnp.asarray(speeds) < 0)

    def moment(self, speed: ArrayLike, sense: ArrayLike | None = None) -> Array:
        """Torque of motor and resistance.

        Args:
            speed: speed of rotation, one or many [rad/s], or that of every lane, where the parameters
                have lanes last.
            sense: sign of the speed that Coulomb friction opposes, by default that of `speed`. A fixed
                sense keeps the torque smooth at zero speed, so that the time of standstill can be found.

        Returns:
            The torque [N m], of the shape of `speed`.
        """
        speed = jnp.asarray(speed, float)
        moment = jnp.broadcast_to(self.torque, speed.shape)
        if self.slope is not None:
            moment = moment - self.slope * speed
        if self.drag is not None:
            moment = moment - self.drag * speed * (jnp.abs(speed) if self.odd else speed)
        if self.coulomb is not None:
            moment = moment - self.coulomb * (jnp.sign(speed) if sense is None else sense)
        if self.table_speeds is not None and self.table_torques is not None:
            table = self.table_speeds, self.table_torques
            of = lambda table, speed: jnp.interp(speed, *table)
            moment += of(table, speed) if table[0].ndim == 1 else per_lane(of, table, speed)
        return moment

    def inertia(self, polar: Number | None) -> Number:
        """Moment of inertia that the drive accelerates [kg m^2]: its own `polar`, else the scene's."""
        polar = polar if self.polar is None else self.polar
        if polar is None:
            raise ValueError(
                "A drive needs a moment of inertia, but neither it nor the scene has one; give `polar "
                "[kg m^2]`."
            )
        if known(polar) and not float(polar) > 0:
            raise ValueError(
                f"A drive needs a positive moment of inertia, but that of the scene is {float(polar):g} "
                "kg m^2; give `polar [kg m^2]` to the discs or to the drive."
            )
        return polar

    def after(self, time: Scalar, speed: Scalar | None) -> "Drive":
        del time
        if speed is None:
            return self
        return eqx.tree_at(lambda spin: spin.speed, self, jnp.asarray(speed, float))

    @property
    def can_stop(self) -> bool:
        """Whether the rotor can come to rest and stay at rest."""
        return self.stops or self.coulomb is not None

    @property
    def sense(self) -> Scalar:
        """The sense of the first speed or, from rest, of the torque there."""
        return sense_of(jnp.where(self.speed == 0, self.moment(0.0, 0.0), self.speed))

    @property
    def given(self) -> bool:
        smooth = self.table_speeds is None and self.coulomb is None
        even = self.drag is None or not self.odd
        return smooth and even and not self.feedback and not self.stops

    def turning(self, time: ArrayLike, polar: Scalar | None = None) -> Turning:
        if not self.given:
            raise ValueError(
                "The rotation under a drive with a table, Coulomb friction, odd drag, feedback or a "
                "stop has no closed form; use `jaxrotor.run_up`."
            )
        polar = self.inertia(polar)
        none = jnp.zeros(())
        slope, drag = (none if part is None else part for part in (self.slope, self.drag))
        return riccati(time, polar, self.torque, slope, drag, self.speed)
