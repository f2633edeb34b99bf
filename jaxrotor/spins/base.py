"""How the shaft turns about its axis."""

import abc
from typing import TYPE_CHECKING, Any, ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike

from ..core.extremes import larger
from ..core.quantities import Scalar, Series, check, known, nonnegative, positive, real, series
from ..core.representation import AbstractPart
from .riccati import Turning as Turning, riccati


class AbstractSpin(AbstractPart):
    """Law of rotation `theta(t)`, `theta(0) = 0`; positive spin turns x into y."""

    if TYPE_CHECKING:  # where an abstract variable would be an argument of every spin
        speed: ClassVar[Any]
    else:
        speed: eqx.AbstractVar[Scalar]  # at t = 0 [rad/s]

    @property
    @abc.abstractmethod
    def given(self) -> bool:
        """Whether the rotation is known without integration."""

    @property
    def kinks(self) -> Series | None:
        """Times at which the acceleration jumps [s]."""
        return None

    @abc.abstractmethod
    def turning(self, time: ArrayLike, polar: Scalar | None = None) -> Turning:
        """The rotation at times [s], zero or more, of a rotor of inertia `polar` [kg m^2]."""

    @abc.abstractmethod
    def after(self, time: Scalar, speed: Scalar | None) -> "AbstractSpin":
        """The law from `time` [s] on, of a rotor that has reached `speed` [rad/s] (None: its own)."""


class ConstantSpeed(AbstractSpin):
    """Constant speed: `theta(t) = Omega t`."""

    speed: Scalar = real("speed [rad/s]")

    @property
    def given(self) -> bool:
        return True

    def turning(self, time: ArrayLike, polar: Scalar | None = None) -> Turning:
        del polar
        time = jnp.asarray(time, float)
        speed = jnp.broadcast_to(self.speed, time.shape)
        return Turning(self.speed * time, speed, jnp.zeros_like(time))

    def after(self, time: Scalar, speed: Scalar | None) -> "ConstantSpeed":
        del time, speed
        return self


def constant(speed: ArrayLike) -> ConstantSpeed:
    """`ConstantSpeed` of a speed [rad/s] as it is: no check in a compiled program."""
    return eqx.tree_at(lambda spin: spin.speed, ConstantSpeed(0.0), jnp.asarray(speed, float))


class SpeedProfile(AbstractSpin):
    """Given speed: `Omega(t)` straight from each time to the next, held before and after all.

    `theta(t) = Int_0^t Omega dt` exactly; at a time of the table the acceleration is the next one's.
    """

    times: Series = series("times [s]", ascending=True)
    speeds: Series = series("speeds [rad/s]")

    def __check_init__(self):
        _check_lengths(self, "times", "speeds")

    @classmethod
    def ramp(cls, start: ArrayLike, stop: ArrayLike, duration: ArrayLike) -> "SpeedProfile":
        """From speed `start` to `stop` [rad/s] in `duration` [s] at one acceleration, then held."""
        check(duration, "duration [s]", lambda x: x > 0, "must be positive")
        return cls([0.0, duration], [start, stop])

    @property
    def speed(self) -> Scalar:
        """Speed at t = 0 [rad/s]."""
        return jnp.interp(0.0, self.times, self.speeds)

    @property
    def given(self) -> bool:
        return True

    @property
    def kinks(self) -> Series:
        return self.times

    def turning(self, time: ArrayLike, polar: Scalar | None = None) -> Turning:
        del polar
        time = jnp.asarray(time, float)
        angle, speed, acceleration = self._since_first(time)
        return Turning(angle - self._since_first(jnp.zeros(()))[0], speed, acceleration)

    def after(self, time: Scalar, speed: Scalar | None) -> "SpeedProfile":
        """The same from `time` on; a rotor that has another speed then is refused."""
        later = eqx.tree_at(lambda spin: spin.times, self, self.times - time)
        if speed is None:
            return later
        there = later.speed
        jumps = abs(speed - there) > 1e-6 * larger(abs(speed), abs(there))
        sentence = "A run goes on in a profile where that has the speed the run ended with"
        if not known(jumps):
            return eqx.tree_at(lambda s: s.times, later, eqx.error_if(later.times, jumps, sentence))
        if jumps:
            raise ValueError(
                f"{sentence}, {float(speed):g} rad/s, but at {float(time):g} s it is {float(there):g} "
                "rad/s; give the launch the `time` of the profile at which to begin."
            )
        return later

    def _since_first(self, time):
        """Angle from the first time of the table on, speed, acceleration."""
        times, speeds = jnp.asarray(self.times), jnp.asarray(self.speeds)
        steps = jnp.diff(times)
        areas = jnp.cumsum(jnp.append(0.0, (speeds[1:] + speeds[:-1]) / 2 * steps))
        rates = jnp.concatenate([jnp.zeros(1), jnp.diff(speeds) / steps, jnp.zeros(1)])
        passed = jnp.searchsorted(times, time, side="right")
        last = larger(passed - 1, 0)
        t, rate = time - times[last], rates[passed]
        angle = areas[last] + (speeds[last] + rate * t / 2) * t
        return angle, speeds[last] + rate * t, rate


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
            _check_lengths(self, "table_speeds", "table_torques")

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


def _check_lengths(spin: AbstractSpin, *names: str) -> None:
    one, two = (len(getattr(spin, name)) for name in names)
    if one != two:
        raise ValueError(
            f"`{names[0]}` and `{names[1]}` must be of one length, but have {one} and {two} numbers."
        )
