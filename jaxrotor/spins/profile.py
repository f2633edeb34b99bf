"""Speed profile: the speed of rotation as a table over time."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import ArrayLike

from ..core.extremes import larger
from ..core.quantities import Scalar, Series, check, known, series
from .base import AbstractSpin, Turning as Turning, check_same_length, sense_of


class SpeedProfile(AbstractSpin):
    """Given speed `Omega(t)`, linear between the times of a table and constant outside of it.

    The angle `theta(t) = Int_0^t Omega dt` is exact. At a time of the table the acceleration is that of
    the interval after it.
    """

    times: Series = series("times [s]", ascending=True)
    speeds: Series = series("speeds [rad/s]")

    def __check_init__(self):
        check_same_length(self, "times", "speeds")

    @classmethod
    def ramp(cls, start: ArrayLike, stop: ArrayLike, duration: ArrayLike) -> "SpeedProfile":
        """Profile from speed `start` to `stop` [rad/s] in `duration` [s], then constant.

        Raises:
            ValueError: If a value is not a finite number, or `duration` is not positive.
        """
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
    def sense(self) -> Scalar:
        """The sense of the fastest speed of the table."""
        speeds = jnp.asarray(self.speeds)
        return sense_of(speeds[jnp.argmax(jnp.abs(speeds))])

    @property
    def kinks(self) -> Series:
        return self.times

    def turning(self, time: ArrayLike, polar: Scalar | None = None) -> Turning:
        del polar
        time = jnp.asarray(time, float)
        angle, speed, acceleration = self._since_first(time)
        return Turning(angle - self._since_first(jnp.zeros(()))[0], speed, acceleration)

    def after(self, time: Scalar, speed: Scalar | None) -> "SpeedProfile":
        """The profile with t = 0 at `time`; raises if the rotor has another speed at that time."""
        with jax.ensure_compile_time_eval():  # within a trace, too, known kinks stay known
            later = eqx.tree_at(lambda spin: spin.times, self, self.times - time)
        if speed is None:
            return later
        there = later.speed
        jumps = abs(speed - there) > 1e-6 * larger(abs(speed), abs(there))
        sentence = (
            "A run can continue in a profile only where the profile has the final speed of the run"
        )
        if not known(jumps):
            return eqx.tree_at(lambda s: s.times, later, eqx.error_if(later.times, jumps, sentence))
        if jumps:
            raise ValueError(
                f"{sentence}, {float(speed):g} rad/s, but at {float(time):g} s it is {float(there):g} "
                "rad/s; give the launch the `time` of the profile at which it begins."
            )
        return later

    def _since_first(self, time):
        """Angle since the first time of the table, speed and acceleration."""
        times, speeds = jnp.asarray(self.times), jnp.asarray(self.speeds)
        steps = jnp.diff(times)
        areas = jnp.cumsum(jnp.append(0.0, (speeds[1:] + speeds[:-1]) / 2 * steps))
        rates = jnp.concatenate([jnp.zeros(1), jnp.diff(speeds) / steps, jnp.zeros(1)])
        passed = jnp.searchsorted(times, time, side="right")
        last = larger(passed - 1, 0)
        t, rate = time - times[last], rates[passed]
        angle = areas[last] + (speeds[last] + rate * t / 2) * t
        return angle, speeds[last] + rate * t, rate
