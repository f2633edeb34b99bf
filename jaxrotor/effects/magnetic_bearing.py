"""Active magnetic bearing: two pairs of coils, whose currents a controller sets by a sensor."""

from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array

from ..core.extremes import bounded
from ..core.quantities import Number, Scalar, Series, known, nonnegative, positive, real, series
from .base import AbstractContact
from .controller import Controller, check_controller
from .law import AbstractLaw, Branch, Hardness, Now, Plane, States


class MagneticBearing(AbstractContact):
    """Two pairs of coils along axes at `angle` and at right angles to it, driven in differential mode.

        F = constant (((bias + i) / (gap - x))^2 - ((bias - i) / (gap + x))^2)        along each axis
        q. = y,   filter f. = y - f,   u = -(kp y + ki q + kd (y - f) / filter)
        lag i. = u - i,   with u between -limit and limit

    `x` is the displacement at `at`, `y` that at the `sensor`, by default the same station. Each axis has
    a controller of its own, all alike. A part that is absent has no state: without `ki` there is no `q`,
    without `filter` the velocity is read in place of `(y - f) / filter`, without `lag` the current is the
    wanted one, and without `limit` it has no bound. States are currents, `integral = ki q` and
    `filtered = kd f / filter`.

    A lead compensator `k (1 + a p) / (1 + b p)` is `kp = k`, `kd = k (a - b)`, `filter = b`. Any other
    controller is given by the coefficients of `-u / y` in falling powers of `p`, [A] over [m] and s.

    The force has no bound as the rotor nears a coil, and is NaN at the gap and beyond: a stop must be
    nearer. It acts radially, so it has no torque. About the centre it is `k_i i + k_s x`, with
    `k_i = 4 constant bias / gap^2` and the negative stiffness `k_s = k_i bias / gap`; `linearized` has
    both at the static position. Steps in time must follow `filter` and `lag`.
    Source: Schweitzer, Maslen (2009), Magnetic Bearings, chapters 2 to 4; limits: ISO 14839-3.
    """

    kind: ClassVar[str] = "magnetic_bearing"
    plural: ClassVar[str] = "magnetic_bearings"
    by_speed: ClassVar[bool] = True
    walled: ClassVar[bool] = True

    at: Scalar = nonnegative("at [m]")
    constant: Scalar = nonnegative("constant [N m^2/A^2]")  # of a pair of coils [N m^2/A^2]
    bias: Scalar = positive("bias [A]")
    gap: Scalar = positive("gap [m]")
    kp: Scalar | None = real("kp [A/m]", default=None)
    ki: Scalar | None = positive("ki [A/(m s)]", default=None)
    kd: Scalar | None = real("kd [A s/m]", default=None)
    filter: Scalar | None = positive("filter [s]", default=None)  # time of the derivative [s]
    lag: Scalar | None = positive("lag [s]", default=None)  # of the amplifier [s]
    limit: Scalar | None = positive("limit [A]", default=None)
    angle: Scalar = real("angle [rad]", default=0.0)
    sensor: Scalar | None = nonnegative("sensor [m]", default=None)  # station [m]; None: `at`
    # Coefficients of a controller of one's own:
    numerator: Series | None = series("numerator [1]", least=1, default=None)
    denominator: Series | None = series("denominator [1]", least=1, default=None)
    on: str | None = eqx.field(default=None, static=True)  # name of a casing; None: the ground

    def __check_init__(self):
        check_controller(self, self.bias / self.gap)
        if self.limit is None or not (known(self.limit) and known(self.bias)):
            return
        if float(self.limit) > float(self.bias):
            raise ValueError(
                f"`limit [A]` must not be above the `bias [A]`, {float(self.bias):g}, since the coil that "
                f"lets go would then pull again, but is {float(self.limit):g}."
            )

    def law(self) -> "MagneticLaw":
        cos, sin = jnp.cos(self.angle), jnp.sin(self.angle)
        own = self.constant, self.bias, self.gap, self.lag, self.limit
        return MagneticLaw(cos, sin, *own, Controller.of(self))


class MagneticLaw(AbstractLaw):
    """Law of a `MagneticBearing`, with its axes and its controller computed once."""

    cos: Scalar
    sin: Scalar
    constant: Scalar  # [N m^2/A^2]
    bias: Scalar  # [A]
    gap: Scalar  # [m]
    lag: Scalar | None  # [s]
    limit: Scalar | None  # [A]
    controller: Controller

    @property
    def elementwise(self) -> bool:
        return True

    @property
    def states(self) -> tuple[str, ...]:
        """States of the controller and of the amplifier, each along both axes."""
        names = [*self.controller.names, *["current [A]"] * (self.lag is not None)]
        return tuple(name.replace(" [", f"_{axis} [") for name in names for axis in "xy")

    def __call__(self, displacement: Plane, velocity: Plane, now: Now) -> Plane:
        return self._force(displacement, self.current(displacement, velocity, now))

    def along(self, branch: Branch, displacement: Plane, velocity: Plane, now: Now) -> Plane:
        now = now._replace(branch=branch)
        return self._force(displacement, self.current(displacement, velocity, now))

    def rates(self, force: Plane, displacement: Plane, velocity: Plane, now: Now) -> States:
        place, speed, x = self._read(displacement, velocity, now)
        found = self.controller.rates(x, place)
        if self.lag is not None:
            wanted = self._within(self.controller.command(x, place, speed), now.branch)
            found = jnp.concatenate([found, ((wanted - self._states(now)[-1]) / self.lag)[None]])
        return found.reshape(-1, *found.shape[2:])

    def current(self, displacement: Plane, velocity: Plane, now: Now) -> Plane:
        """Current of each axis beside the bias [A]."""
        if self.lag is not None:
            return self._states(now)[-1]
        place, speed, x = self._read(displacement, velocity, now)
        return self._within(self.controller.command(x, place, speed), now.branch)

    def pull(self, place: Plane, current: Plane) -> Plane:
        """Force along each axis [N], by the displacement along it and its current."""
        near, far = self.gap - place, self.gap + place
        inside = (near > 0) & (far > 0)
        near, far = jnp.where(inside, near, 1.0), jnp.where(inside, far, 1.0)
        force = ((self.bias + current) / near) ** 2 - ((self.bias - current) / far) ** 2
        return jnp.where(inside, self.constant * force, jnp.nan)

    def turned(self, vector: Plane, sense: float) -> Plane:
        """A vector along the axes of the bearing (sense 1), or one along them back in x and y (-1)."""
        x, y = vector
        sin = sense * self.sin
        return jnp.stack([self.cos * x + sin * y, self.cos * y - sin * x])

    def _force(self, displacement: Plane, current: Plane) -> Plane:
        return self.turned(self.pull(self.turned(displacement, 1.0), current), -1.0)

    def _states(self, now: Now) -> Array:
        """All states, of both axes each."""
        count = len(self.states)
        state = jnp.zeros(count) if now.state is None else now.state
        return state.reshape(-1, 2, *state.shape[1:])

    def _read(self, displacement: Plane, velocity: Plane, now: Now) -> tuple[Plane, Plane, Array]:
        """Displacement and velocity at the sensor along the axes, and the states of the controller."""
        place, speed = (displacement, velocity) if now.sensor is None else now.sensor
        x = self._states(now)[: len(self.controller.names)]
        return self.turned(place, 1.0), self.turned(speed, 1.0), x

    def _within(self, wanted: Plane, branch: Branch | None) -> Plane:
        """The wanted current within the limit, or by the formula of a branch."""
        if self.limit is None:
            return wanted
        if branch is None:
            return bounded(wanted, -self.limit, self.limit)
        above, below = branch[:2] > 0, branch[2:] > 0
        return jnp.where(above, self.limit, jnp.where(below, -self.limit, wanted))

    def torque(self, force: Plane, displacement: Plane, velocity: Plane, now: Now) -> Number:
        return jnp.zeros(())

    @property
    def factors(self) -> tuple[Number, Number]:
        """Force per ampere [N/A] and negative stiffness [N/m] about the centre."""
        per_ampere = 4 * self.constant * self.bias / self.gap**2
        return per_ampere, per_ampere * self.bias / self.gap

    def hardness(self) -> Hardness:
        """Stiffness and damping about the centre, as if the current followed at once."""
        per_ampere, _ = self.factors
        g = 0.0 if self.controller.g is None else self.controller.g
        zero = jnp.zeros_like(per_ampere)
        stiffness, damping = per_ampere * jnp.abs(self.controller.d), per_ampere * jnp.abs(g)
        return Hardness(stiffness, damping + zero, jnp.zeros(2), zero)

    @property
    def kinked(self) -> bool:
        return self.limit is not None

    def branch(self, displacement: Plane, velocity: Plane, now: Now) -> Branch:
        if self.limit is None:
            return jnp.zeros(0)
        return 1.0 * (self._beyond(displacement, velocity, now, self.limit) > 0)

    def margins(self, branch: Branch, displacement: Plane, velocity: Plane, now: Now) -> Branch:
        if self.limit is None:
            return jnp.zeros(0)
        return (2 * branch - 1) * self._beyond(displacement, velocity, now, self.limit)

    def _beyond(self, displacement: Plane, velocity: Plane, now: Now, limit: Number) -> Branch:
        """How far the wanted currents are above the limit, then how far below the negative one [A]."""
        place, speed, x = self._read(displacement, velocity, now)
        wanted = self.controller.command(x, place, speed)
        return jnp.concatenate([wanted - limit, -limit - wanted])

    def clearance(self, displacement: Plane) -> Number:
        """That of a law that always acts."""
        return -jnp.inf * jnp.ones(())
