"""Starting states of a motion."""

import abc

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Complex, Float

from ..core.quantities import Scalar, known, nonnegative, real
from ..core.representation import AbstractPart
from .system import System


class AbstractStart(AbstractPart):
    """Where a motion begins, at revolution angle zero."""

    @abc.abstractmethod
    def state(
        self, system: System, at: Scalar
    ) -> tuple[Complex[Array, " n"], Complex[Array, " n"]]:
        """Coordinates [m] and velocities [m/s]; `at` is the observed station."""


class AtRest(AbstractStart):
    """Straight and still: `z = 0`, `z. = 0`."""

    def state(self, system: System, at: Scalar):
        del at
        return jnp.zeros(system.n, complex), jnp.zeros(system.n, complex)


class Whirl(AbstractStart):
    """Bent as by a force at the observed station and whirling: `z = radius e^(i angle)`, `z. = i rate z`.

    `rate` 0 releases the bent shaft from rest; a negative rate starts a backward whirl.
    """

    radius: Scalar = nonnegative("radius [m]")
    rate: Scalar = real("rate [rad/s]", default=0.0)
    angle: Scalar = real("angle [rad]", default=0.0)

    def state(self, system: System, at: Scalar):
        shape = jnp.linalg.solve(system.blocks.stiffness, system.line.column(at))
        there = system.line.row(at) @ shape
        held = jnp.abs(there) <= 1e-9 * jnp.max(jnp.abs(shape))
        if known(held) and bool(held):
            raise ValueError(
                "A whirl cannot start at a station that is held fast; observe another with `at`."
            )
        # Not known yet: whoever finds that the motion is not finite asks again.
        shape = shape / jnp.where(held, jnp.nan, there)
        q = self.radius * jnp.exp(1j * self.angle) * shape
        return q, 1j * self.rate * q


class Continued(AbstractStart):
    """A state that another run ended with: `simulate(scene, 10, start=response.end)`."""

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
    """Bodies of one race, seen from the shaft."""

    angle: Float[Array, "*T b"]  # psi = phi - theta [rad]
    rate: Float[Array, "*T b"]  # [rad/s]


class Launch(eqx.Module):
    """State a run begins with.

    `balls` has an entry for every race; None spreads them evenly. `speed` other than None is what a
    `Drive` begins with, and what a `SpeedProfile` must have at its `time`; a `ConstantSpeed` jumps to
    its own. To go on with another profile, `dataclasses.replace(run.end, time=0.0)`.
    """

    shaft: AbstractStart = eqx.field(default_factory=AtRest)
    angle: Scalar = real("angle [rad]", default=0.0)
    balls: tuple[Balls, ...] | None = None
    speed: Scalar = real("speed [rad/s]", default=None)
    time: Scalar = real("time [s]", default=0.0)  # of a profile, at which the run begins
    stopped: Bool[Array, ""] = eqx.field(default=False, converter=jnp.asarray)  # for good
