"""A motor of limited torque that turns the rotor."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike

from ..core.quantities import Scalar, Series, known, nonnegative, positive, real, series
from .base import AbstractSpin, Turning as Turning, check_same_length
from .riccati import riccati


class Drive(AbstractSpin):
    """Motor and resistance: `I Omega. = M0 - k1 Omega - k2 Omega^2 - M_C sgn Omega + M(Omega)`.

    `odd`: the drag is `k2 Omega |Omega|`, against either sense; else `k2 Omega^2` to the letter.
    `M(Omega)` is a table, straight between its speeds and held beyond them. `feedback`: unbalance,
    weight, friction of contact and what turns with the shaft, internal damping and unequal axes, act on
    the rotation too. `stops`: a rotor that comes to rest stays, whatever torque acts then.
    Source: course project "Dynamic reactions in the bearings of a rotor", eqs. (1), (11).
    """

    speed: Scalar = real("speed [rad/s]")
    torque: Scalar = real("torque [N m]")
    slope: Scalar | None = real("slope [N m s]", default=None)
    drag: Scalar | None = nonnegative("drag [N m s^2]", default=None)
    odd: bool = eqx.field(default=False, static=True)
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

    def moment(self, speed: ArrayLike, sense: ArrayLike | None = None) -> Array:
        """Torque [N m] of motor and resistance at a speed, or at many [rad/s].

        Coulomb friction is against `sense`, by default that of the speed: one that is kept lets a run
        pass through zero speed without a jump, to find when it did.
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
            moment = moment + jnp.interp(speed, self.table_speeds, self.table_torques)
        return moment

    def inertia(self, polar: Scalar | None) -> Scalar:
        """What is turned [kg m^2]: the drive's own `polar`, else that of the scene."""
        polar = polar if self.polar is None else self.polar
        if polar is None:
            raise ValueError("A drive turns an inertia; give `polar [kg m^2]`.")
        if known(polar) and not float(polar) > 0:
            raise ValueError(
                f"A drive turns an inertia above zero, but that of the scene is {float(polar):g} kg m^2; "
                "give discs a `polar`, or the drive itself."
            )
        return polar

    def after(self, time: Scalar, speed: Scalar | None) -> "Drive":
        del time
        if speed is None:
            return self
        return eqx.tree_at(lambda spin: spin.speed, self, jnp.asarray(speed, float))

    @property
    def can_stop(self) -> bool:
        """Whether the rotor may come to rest and stay."""
        return self.stops or self.coulomb is not None

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
