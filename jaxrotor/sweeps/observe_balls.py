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
    """Mean rate of every ball from the shaft, `psi.`; zero for a ball that turns with it."""

    needs_contact: ClassVar[bool] = False
    needs_balls: ClassVar[bool] = True
    paced = "any"

    def check(self, steps, contacts):
        del steps, contacts

    def start(self, contacts):
        return jnp.zeros(())

    def update(self, carry, turn: Turn):
        assert turn.bodies is not None, "checked before the run"
        angle = turn.bodies.angle
        return carry + turn.step * (len(angle) - 1), angle[-1] - angle[0]

    def report(self, carry, stored, count):
        lag = np.sum(stored, axis=1) / np.asarray(carry)[:, None]
        return {"ball_lag": Variable(("ball",), lag, "rad/s", "mean rate of a ball from the shaft")}
