"""Rolling bearing: balls or rollers that a cage carries round between two races."""

from typing import Any, ClassVar, Literal, cast

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from ..core.checks import check_counts
from ..core.extremes import larger
from ..core.lanes import computed_once, reduced
from ..core.plane import cosine_and_sine
from ..core.quantities import Number, Scalar, at_least, known, nonnegative, positive, real
from .base import AbstractContact
from .law import AbstractSmoothLaw, Hardness, Now, Plane


FEWEST = 3  # balls that hold a shaft along every direction
FREEZES = ("frozen", "mean")
PRESSED = 1e-6  # how deep a ball is pressed in at least, for `hardness` [m]


class RollingBearing(AbstractContact):
    """Deep groove or roller bearing, whose balls press the races by Hertz's law and turn with the cage.

        phi_j = angle + (r_i + r_o outer_speed) theta + 2 pi j / balls,   r_i = R_i / (R_i + R_o) = 1 - r_o
        d_j = Re(z e^(-i phi_j)) - gap
        F = -stiffness Sum (d_j)_+^exponent e^(i phi_j),   T = -r_i Im(z* F)

    `z` is the displacement of the inner race, which turns with the shaft by `theta`, from the outer one.
    Where that sits `on` another shaft, which turns by `theta_2`, the cage turns by `r_i theta + r_o
    theta_2`, and that shaft feels `T_2 = -r_o Im(z* F)`. Balls roll, so that the cage turns at `r_i` of
    the speed; only the ratio of `inner_radius` to `outer_radius`, those of the races, enters. The outer
    race turns at `outer_speed` times the speed of the shaft; where this is negative it may stop the cage.
    `angle` is that of ball 0 at `theta = 0`. `gap` is the clearance on one side, half of what catalogues
    give as radial clearance; a negative one is a
    preload. `exponent` is 10/9 for rollers. If it is absent, it is 3/2, as for balls, and the force takes
    roots in place of powers, which is ten times as fast in lanes of a sweep.

    Rolling is a gear: the shaft feels the torque `T`, and what drives the outer race, outside of the
    scene, feels `-r_o Im(z* F)`. Both together and the force do work only on the elastic energy
    `stiffness Sum (d_j)_+^(exponent + 1) / (exponent + 1)`.

    `linear` is for `jaxrotor.static_positions` and `jaxrotor.linearized`: "frozen" has the cage at its
    `angle`, "mean" takes the mean over a pass of the cage by `2 pi / balls`. Both refuse None.

    Where a ball begins to bear, the force has a continuous derivative and no second one, and at an
    exponent of 1 a kink. Such a touch costs an error of the order `h^(exponent + 1)` of the step `h`, so
    5/2 for balls, whatever the order of the steps, and also if they are located, as no formula changes.
    `blend` [m] takes `(d + sqrt(d^2 + blend^2)) / 2` for `(d)_+`, which is smooth; some force then acts
    in the gap.
    Source: Fukata et al. (1985); Tiwari, Gupta, Prakash (2000); the torque: virtual work of rolling.
    """

    kind: ClassVar[str] = "rolling_bearing"
    plural: ClassVar[str] = "rolling_bearings"

    at: Scalar = nonnegative("at [m]")
    balls: int = cast(Any, eqx.field)(static=True)  # number of balls or rollers
    stiffness: Scalar = nonnegative("stiffness [N/m^n]")  # of one ball between both races [N/m^n]
    gap: Scalar = real("gap [m]")
    inner_radius: Scalar = positive("inner_radius [m]")
    outer_radius: Scalar = positive("outer_radius [m]")
    exponent: Scalar | None = at_least("exponent [1]", 1.0, default=None)  # 3/2 if absent
    angle: Scalar = real("angle [rad]", default=0.0)
    outer_speed: Scalar = real("outer_speed [1]", default=0.0)
    blend: Scalar | None = positive("blend [m]", default=None)
    # Name of a casing, or of the shaft of the outer race; None: the ground
    on: str | None = eqx.field(default=None, static=True)
    # "frozen" or "mean", the cage of a static position; None: none is assumed
    linear: Literal["frozen", "mean"] | None = eqx.field(default=None, static=True)

    def __check_init__(self):
        check_counts(FEWEST, balls=self.balls)
        if self.linear not in (None, *FREEZES):
            raise ValueError(f'`linear` must be "frozen", "mean" or None, but is {self.linear!r}.')

    @property
    def reason_between(self) -> str | None:
        if known(self.outer_speed) and float(self.outer_speed) == 0:
            return None
        return "whose speeds are those of its races; leave `outer_speed [1]` out"

    def law(self) -> "RollingLaw":
        inner = self.inner_radius / (self.inner_radius + self.outer_radius)
        return RollingLaw(
            inner=inner,
            rate=inner + (1 - inner) * self.outer_speed,
            phase=self.angle,
            stiffness=self.stiffness,
            exponent=self.exponent,
            gap=self.gap,
            blend=self.blend,
            pressed=larger(jnp.abs(self.gap), PRESSED),
            balls=self.balls,
        )


class RollingLaw(AbstractSmoothLaw):
    """Law of a `RollingBearing`, with the rate of its cage computed once."""

    clock: ClassVar = "turns"

    inner: Scalar  # rate of the cage between races of which the outer one stands, over the speed
    rate: Scalar  # of the cage over the speed of the shaft
    phase: Scalar  # angle of ball 0 at the angle 0 [rad]
    stiffness: Scalar  # [N/m^n]
    exponent: Scalar | None  # None: 3/2
    gap: Scalar  # [m]
    blend: Scalar | None  # [m]
    pressed: Scalar  # how deep a ball is pressed in for `hardness` [m]
    balls: int = eqx.field(static=True)

    @property
    def elementwise(self) -> bool:
        return True

    @property
    def period(self) -> Scalar:
        """A pass, `2 pi / (balls |rate|)`; infinite where the cage stands."""
        return 2 * jnp.pi / (self.balls * jnp.abs(self.rate))

    @property
    def power(self) -> Scalar:
        """Exponent of the law, 3/2 where it is absent."""
        return jnp.full_like(self.stiffness, 1.5) if self.exponent is None else self.exponent

    def cage(self, now: Now) -> Number:
        """Angle of ball 0 [rad]."""
        if now.beside is None:
            return self.rate * cast(Any, now.angle) + self.phase
        outer = (1 - self.inner) * cast(Any, now.beside.angle)
        return self.inner * cast(Any, now.angle) + outer + self.phase

    def __call__(self, displacement: Plane, velocity: Plane, now: Now) -> Plane:
        x, y = displacement
        cage = self.cage(now)
        cos, sin = computed_once(jnp.stack(cosine_and_sine(cage)))
        # One sine and cosine serve all balls, along a first axis: lanes remain the last.
        apart = 2 * np.pi / self.balls * np.arange(self.balls)
        apart = apart.reshape(-1, *(1,) * max(jnp.ndim(x), jnp.ndim(cage)))
        ahead, aside = (jnp.asarray(part(apart), cos.dtype) for part in (np.cos, np.sin))
        cos, sin = cos * ahead - sin * aside, sin * ahead + cos * aside
        load = self.stiffness * self._compressed(cos * x + sin * y - self.gap)
        return -jnp.stack([reduced(jnp.add, load * part) for part in (cos, sin)])

    def _compressed(self, depth: Number) -> Number:
        """`(d)_+^n` of compressions `d` [m], with a derivative at zero, too."""
        inside = depth > 0
        if self.blend is not None:  # one form on each side, so that no difference cancels
            far = jnp.where(inside, depth, -depth) + jnp.sqrt(depth**2 + self.blend**2)
            return self._raised(jnp.where(inside, far / 2, self.blend**2 / (2 * far)))
        return jnp.where(inside, self._raised(jnp.where(inside, depth, 1.0)), 0.0)

    def _raised(self, depth: Number) -> Number:
        """`d^n` of positive compressions."""
        return depth * jnp.sqrt(depth) if self.exponent is None else depth**self.exponent

    def torque(self, force: Plane, displacement: Plane, velocity: Plane, now: Now) -> Number:
        return -self.inner * (displacement[0] * force[1] - displacement[1] * force[0])

    def hardness(self) -> Hardness:
        """Stiffness of a ball that is pressed in as deep as the gap; without a gap, of half of all balls.

        That of Hertz's law grows with the load, which a law does not know. A ball is pressed in by at
        least a micrometre, as by ordinary loads. At a displacement of twice the gap the stiffness is
        rather too high, so that steps are rather too short.
        """
        bearing = jnp.where(self.gap > 0, 1.0, self.balls / 2)
        stiffness = bearing * self.power * self.stiffness * self.pressed ** (self.power - 1)
        return Hardness(
            stiffness, jnp.zeros_like(stiffness), jnp.zeros(2), jnp.zeros_like(stiffness)
        )
