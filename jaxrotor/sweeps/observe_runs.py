"""Observables of runs along times: the largest distance, its envelope, and whether a drive hangs."""

from typing import ClassVar

import jax.numpy as jnp
import numpy as np

from ..core.quantities import Scalar, positive
from .observable import AbstractObservable, AbstractStored, Turn, Variable


class Peak(AbstractObservable):
    """Largest distance from the centre at the samples of a run, with its time and speed."""

    needs_contact: ClassVar[bool] = False
    paced = "times"

    def check(self, steps, contacts):
        del steps, contacts

    def start(self, contacts):
        zero = jnp.zeros(())
        return -jnp.inf + zero, zero, zero

    def update(self, carry, turn: Turn):
        assert turn.time is not None and turn.speed is not None, "checked before the run"
        radius = jnp.abs(turn.z[1:])
        top = jnp.argmax(radius)
        now = radius[top], turn.time[1:][top], turn.speed[1:][top]
        larger = ~(now[0] <= carry[0])  # so that NaN is kept
        return tuple(jnp.where(larger, new, old) for new, old in zip(now, carry, strict=True)), None

    def report(self, carry, stored, count):
        radius, time, speed = carry
        return {
            "peak": Variable((), radius, "m", "largest radius at the samples of the run"),
            "peak_time": Variable((), time, "s", "time of the largest radius"),
            "peak_speed": Variable((), speed, "rad/s", "speed at the largest radius"),
        }


class Capture(AbstractObservable):
    """Whether the speed at the last sample is below a critical speed, at which the drive hangs.

    A drive that has passed and coasts down counts as captured, too.
    """

    needs_contact: ClassVar[bool] = False
    paced = "times"
    critical: Scalar = positive("critical [rad/s]")

    def check(self, steps, contacts):
        del steps, contacts

    def start(self, contacts):
        return jnp.zeros(())

    def update(self, carry, turn: Turn):
        assert turn.speed is not None, "checked before the run"
        return turn.speed[-1], None

    def report(self, carry, stored, count):
        below = np.where(np.isfinite(carry), np.abs(carry) < np.asarray(self.critical), np.nan)
        long_name = "whether the speed at the end is below the critical one"
        return {
            "captured": Variable((), below, "1", long_name),
            "end_speed": Variable((), carry, "rad/s", "speed at the end"),
        }


class Envelope(AbstractStored):
    """Largest distance from the centre at the samples of every window, and the speed at its end."""

    paced = "times"

    def update(self, carry, turn: Turn):
        assert turn.time is not None and turn.speed is not None, "checked before the run"
        return carry, jnp.stack([jnp.max(jnp.abs(turn.z[1:])), turn.speed[-1], turn.time[-1]])

    def report(self, carry, stored, count):
        times = np.reshape(stored[..., 2], (-1, count))[0]  # those of all lanes
        return {
            "envelope": Variable(("window",), stored[..., 0], "m", "largest radius of a window"),
            "speed": Variable(("window",), stored[..., 1], "rad/s", "speed at the end of a window"),
            "window": Variable(("window",), times, "s", "time at the end of a window"),
        }
