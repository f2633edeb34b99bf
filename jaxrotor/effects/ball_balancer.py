"""Ball balancer: balls that roll in a race and balance the rotor, and contact between them."""

from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..core.blocks import Blocks
from ..core.checks import check_counts
from ..core.quantities import Scalar, known, nonnegative, positive
from ..shafts.line import AbstractLine
from .base import AbstractBetween, AbstractBodies, AbstractLinear


class BallBalancer(AbstractBodies, AbstractLinear):
    """One row of balls in a race that turns with the shaft, with viscous drag.

        k m R phi.. + h R (phi. - Omega) = -m Im(exp(-i phi) z..) + (k - 1) m R Omega..

    `rolling` k is 7/5 for a ball, 3/2 for a roller and 1 for a pendulum. `race_radius` R is the radius
    of the circle of ball centres. `in_use` of the `places` hold a ball, by default all, so that rows
    with different numbers of balls can be mapped over. The shaft carries the mass of the balls.
    `ball_radius` is needed only if balls touch (`BallContact`).
    Source: Filimonikhin, Goncharov (2011), eqs. (2.1), (2.2); the term with Omega.. is added here.
    """

    kind: ClassVar[str] = "ball_balancer"
    plural: ClassVar[str] = "ball_balancers"

    at: Scalar = nonnegative("at [m]")
    ball_mass: Scalar = positive("ball_mass [kg]")
    race_radius: Scalar = positive("race_radius [m]")
    drag_coefficient: Scalar = nonnegative("drag_coefficient [kg/s]")
    rolling: Scalar = positive("rolling [1]", default=1.4)
    in_use: Scalar = nonnegative("in_use [1]", default=None)
    ball_radius: Scalar = positive("ball_radius [m]", default=None)
    places: int = eqx.field(default=2, static=True)

    def __check_init__(self):
        check_counts(places=self.places)
        ball, race = self.ball_radius, self.race_radius
        if ball is not None and known(ball) and known(race) and ball >= race:
            raise ValueError(
                f"`ball_radius [m]` must be below `race_radius [m]`, {float(race):g}, but is "
                f"{float(ball):g}."
            )

    @property
    def masses(self) -> Float[Array, "b ..."]:
        each = jnp.arange(self.places).reshape(-1, *[1] * jnp.ndim(self.ball_mass))
        masses = self.ball_mass + 0.0 * each
        return masses if self.in_use is None else jnp.where(each < self.in_use, masses, 0.0)

    def drag(self, rate: Float[Array, "b ..."]) -> Float[Array, "b ..."]:
        return -self.drag_coefficient * self.race_radius * rate

    def blocks(self, line: AbstractLine) -> Blocks:
        column, mass = line.column(self.at), jnp.sum(self.masses)
        return Blocks(inertia=mass * jnp.outer(column, line.row(self.at)), weight=mass * column)


class BallContact(AbstractBetween):
    """Contact between balls: `N = k g + d g.` while `g > 0` and `N > 0`.

    The penetration is `g = R (2 arcsin(r / R) - |angle|)`, with the angle between two balls, the race
    radius R and the `ball_radius` r. The force acts between all pairs of balls in every race. Without
    it balls pass through one another, as in Filimonikhin, Goncharov (2011).
    Source: this package, after the normal force of a limiter.
    """

    kind: ClassVar[str] = "ball_contact"
    plural: ClassVar[str] = "ball_contacts"

    stiffness: Scalar = nonnegative("stiffness [N/m]")
    damping: Scalar = nonnegative("damping [N s/m]", default=0.0)

    def between(self, angle, rate, race):
        if race.ball_radius is None:
            raise ValueError(
                "Contact between balls needs their size; give every BallBalancer its `ball_radius [m]`."
            )
        radius, present = race.race_radius, 1.0 * (race.masses > 0)
        ahead = angle[None] - angle[:, None]
        ahead = jnp.arctan2(jnp.sin(ahead), jnp.cos(ahead))  # from -pi to pi
        side = jnp.where(ahead >= 0, 1.0, -1.0)
        pitch = 2 * jnp.arcsin(race.ball_radius / radius)
        depth = radius * (pitch - jnp.abs(ahead))
        closing = -radius * side * (rate[None] - rate[:, None])
        force = self.stiffness * depth + self.damping * closing
        others = (1 - np.eye(len(angle))).reshape(*2 * [len(angle)], *[1] * (angle.ndim - 1))
        pairs = present[None] * present[:, None] * others
        return -jnp.sum(pairs * side * jnp.where((depth > 0) & (force > 0), force, 0.0), axis=1)

    def duration(self, mass: Scalar) -> Scalar:
        stiff = self.stiffness > 0
        return jnp.where(
            stiff, jnp.pi * jnp.sqrt(mass / (2 * jnp.where(stiff, self.stiffness, 1.0))), jnp.inf
        )
