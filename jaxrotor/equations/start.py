"""Starting states of a motion."""

import abc

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Complex, Float

from ..core.quantities import Scalar, known, nonnegative, real
from ..core.representation import AbstractPart
from .system import System


class AbstractStart(AbstractPart):
    """State in which a motion begins, at angle of revolution zero."""

    @abc.abstractmethod
    def state(
        self, system: System, at: Scalar
    ) -> tuple[Complex[Array, " n"], Complex[Array, " n"]]:
        """Coordinates [m] and velocities [m/s]; `at` [m] is the observed station."""


class AtRest(AbstractStart):
    """Straight and still: `z = 0`, `z. = 0`."""

    def state(self, system: System, at: Scalar):
        del at
        return jnp.zeros(system.n, complex), jnp.zeros(system.n, complex)


class Whirl(AbstractStart):
    """Bent by a force at the observed station and whirling: `z = radius e^(i angle)`, `z. = i rate z`.

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
        # While traced: the caller sees a motion that is not finite, and calls this again to raise.
        shape = shape / jnp.where(held, jnp.nan, there)
        q = self.radius * jnp.exp(1j * self.angle) * shape
        return q, 1j * self.rate * q


class Continued(AbstractStart):
    """State at the end of another run: `simulate(scene, 10, start=response.end)`."""

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
    """Angles of the bodies of one race, relative to the shaft."""

    angle: Float[Array, "*T b"]  # psi = phi - theta [rad]
    rate: Float[Array, "*T b"]  # [rad/s]


class Launch(eqx.Module):
    """State in which a run begins.

    `balls` has an entry for every race; None spreads them evenly. `speed`, unless None, is the first
    speed of a `Drive`, and must be that of a `SpeedProfile` at its `time`; a `ConstantSpeed` jumps to
    its own. To continue with another profile, take `dataclasses.replace(run.end, time=0.0)`.
    """

    shaft: AbstractStart = eqx.field(default_factory=AtRest)
    angle: Scalar = real("angle [rad]", default=0.0)
    balls: tuple[Balls, ...] | None = None
    speed: Scalar = real("speed [rad/s]", default=None)
    time: Scalar = real("time [s]", default=0.0)  # of the profile at which the run begins
    stopped: Bool[Array, ""] = eqx.field(
        default=False, converter=jnp.asarray
    )  # and never starts again
