"""Coupled steps: a linear rotor exactly, and all that moves with it by the stages of the same step.

    w' = A w + B f(C w, x),   x' = g(C w, x)

`x` are the angle and the speed of a free spin, and the angles and rates of balls, the others beside the
rotor. They have no linear part in its basis, so that the stages of an exponential step are those of the
classical method of Runge and Kutta for them.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Bool, Float, Int

from ..core.quantities import Scalar
from ..equations.coupled import CoupledForces, Instant, Law, SpinAndBalls, actual
from .lanes import lanes_last, per_lane, product
from .varying_speed import RotorAtSpeed, VaryingStep


# Shares of the rates of earlier stages in a stage, and of all in the step, by order.
STAGES = {
    2: (((), (1.0,)), (0.5, 0.5)),
    4: (((), (0.5,), (0.0, 0.5), (0.0, 0.0, 1.0)), (1 / 6, 1 / 3, 1 / 3, 1 / 6)),
}


class Sizes(NamedTuple):
    """Numbers of the spin and the balls in a state, which are its last ones."""

    spin: int  # 1 where it is free, else 0
    bodies: int

    @property
    def total(self) -> int:
        """All numbers, those of the rates included."""
        return 2 * (self.spin + self.bodies)

    def named(self, x: Float[Array, " x"]) -> SpinAndBalls:
        """The spin and the balls by their numbers."""
        d, b = self.spin, self.bodies
        return SpinAndBalls(x[:d], x[d : 2 * d], x[2 * d : 2 * d + b], x[2 * d + b :])


class CoupledStep(eqx.Module):
    """A step of fixed size of a rotor and the others; all arrays may have lanes last."""

    plain: VaryingStep  # of the rotor alone
    forces: CoupledForces
    rate: Scalar  # [rad/s]
    order: int = eqx.field(static=True)
    sizes: "Sizes" = eqx.field(static=True)

    @classmethod
    def of(cls, rotor: RotorAtSpeed, forces: CoupledForces, order: int, h: Scalar) -> "CoupledStep":
        """The step of a rotor that has the stations of these forces."""
        bodies = sum(race.bodies.places for race in forces.system.races)
        plain = rotor.step(order, h, forces.system.ports)
        return cls(plain, forces, rotor.axes.rate, order, Sizes(int(forces.free), bodies))

    @property
    def reading(self) -> Float[Array, "p4 m2"]:
        """Reading of the ports on a state of the rotor."""
        return self.plain.reading

    @property
    def contact_stiffness_ratio(self) -> Float[Array, "k 2"]:
        """See `Tableau.contact_stiffness_ratio`; zero without contact."""
        return self.plain.contact_stiffness_ratio

    def several(
        self, begin: Scalar, steps: int, y: Float[Array, " y"], *, batch: bool
    ) -> tuple[Float[Array, " y"], Bool[Array, ""], Int[Array, ""]]:
        """State after some steps from a time on, and whether a contact was loaded at the start of one.

        No step is split, so none is unresolved.
        """

        def run(parts, y):
            step, times = parts

            def one(carry, time):
                y, touched = carry
                y, loaded = step.of_lanes(time, y)
                return (y, touched | loaded), None

            return jax.lax.scan(one, (y, jnp.zeros(y.shape[1], bool)), times)[0]

        parts = self, self.times(begin, steps)
        return *lanes_last(run, parts, y, batch=batch), jnp.zeros((), int)

    def times(self, begin: Scalar, steps: int) -> Float[Array, " steps"]:
        """Times at which some steps begin, the first at `begin` [s]."""
        return begin + jnp.arange(steps) * (self.plain.tableau.h / self.rate)

    def of_lanes(
        self, time: Array, y: Float[Array, "y lanes"], law: Law = actual
    ) -> tuple[Array, Array]:
        """States after a step from a time on, and whether a contact was loaded at its start.

        `law` gives the forces of the contacts.
        """
        tableau, count = self.plain.tableau, self.plain.tableau.weights.shape[0]
        w, x = y[:count], y[count:]
        inputs = tableau.weights.shape[1] // len(tableau.stages)
        within, ahead = STAGES[self.order]
        end = tableau.advance(w)
        free = jnp.split(product(tableau.outputs, w), len(tableau.times))
        if self.plain.load.shape[1]:  # weight
            end = end + self.plain.load[:, 0]
            loads = [part[:, 0] for part in self.plain.load_outputs]
            free = [free[0], *(one + more for one, more in zip(free[1:], loads, strict=True))]
        span = tableau.h / self.rate
        rates: list[Array] = []
        loaded: list[Array] = []

        def forces(stage: Array, number: int) -> Array:
            shares = within[len(rates)]
            now = x + span * sum((c * k for c, k in zip(shares, rates, strict=True) if c), 0 * x)
            at = Instant.of_step(time + tableau.times[number] * span, time + span / 2)
            found = lambda parts, seen: _found(parts, seen, self.sizes, law)
            both = per_lane(found, (self.forces, at), jnp.concatenate([stage, now]))
            rates.append(both[inputs:])
            if not loaded:
                halves = both[:inputs].reshape(2, -1, both.shape[-1])
                loaded.append(jnp.any(halves[:, : len(self.plain.ports)] != 0, axis=(0, 1)))
            return both[:inputs]

        end = end + tableau.increment(free, forces)
        x = x + span * sum(c * k for c, k in zip(ahead, rates, strict=True))
        return jnp.concatenate([end, x]), loaded[0]


@eqx.filter_jit
def _found(
    parts: tuple[CoupledForces, Instant],
    seen: Float[Array, " z"],
    sizes: Sizes,
    law: Law,
) -> Float[Array, " i"]:
    """`[Re, Im]` of the inputs, and the rates of the others per second, by stages and others."""
    forces, now = parts
    stage, x = jnp.split(seen, [seen.size - sizes.total])
    real, imag = jnp.split(stage, 2)
    found, rates = forces(now, jax.lax.complex(real, imag), sizes.named(x), law)
    return jnp.concatenate([found.real, found.imag, ravel_pytree(rates)[0]])
