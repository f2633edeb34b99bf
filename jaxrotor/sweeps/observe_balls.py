"""Observables of balls: their imbalance with the rotor, and whether they keep up with the shaft."""

from typing import ClassVar

import jax.numpy as jnp
import numpy as np

from .observable import AbstractObservable, Turn, Variable


class Imbalance(AbstractObservable):
    """Unbalance of rotor and balls together, `|u + Sum m R exp(i psi)|`: rms, and at the end."""

    needs_contact: ClassVar[bool] = False
    needs_balls: ClassVar[bool] = True
    paced = "any"

    def check(self, steps, contacts):
        del steps, contacts

    def start(self, contacts):
        return jnp.zeros(()), jnp.zeros(())

    def update(self, carry, turn: Turn):
        assert turn.bodies is not None, "checked before the run"
        size = jnp.abs(turn.bodies.imbalance)
        return (carry[0] + jnp.mean(size[1:] ** 2), size[-1]), None

    def report(self, carry, stored, count):
        square, end = carry
        return {
            "imbalance": Variable((), np.sqrt(square / count), "kg m", "rms imbalance"),
            "imbalance_end": Variable((), end, "kg m", "imbalance at the end"),
        }


class BallLag(AbstractObservable):
    """Mean rate of every ball from the shaft, `psi.`, zero for a ball that turns with it; mean speed."""

    needs_contact: ClassVar[bool] = False
    needs_balls: ClassVar[bool] = True
    paced = "any"

    def check(self, steps, contacts):
        del steps, contacts

    def start(self, contacts):
        return jnp.zeros(()), jnp.zeros(())

    def update(self, carry, turn: Turn):
        assert turn.bodies is not None, "checked before the run"
        assert turn.speed is not None, "balls are integrated in time"
        angle, mean = turn.bodies.angle, jnp.mean((turn.speed[1:] + turn.speed[:-1]) / 2)
        time, speed = carry
        return (time + turn.step * (len(angle) - 1), speed + mean), angle[-1] - angle[0]

    def report(self, carry, stored, count):
        time, speed = map(np.asarray, carry)
        lag = np.sum(stored, axis=1) / time[:, None]
        return {
            "ball_lag": Variable(("ball",), lag, "rad/s", "mean rate of a ball from the shaft"),
            "mean_speed": Variable((), speed / count, "rad/s", "mean speed of rotation"),
        }
