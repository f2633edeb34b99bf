"""Seal: an annular gap full of a fluid that turns at a share of the speed."""

from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Complex

from ..core.blocks import Blocks
from ..core.quantities import Number, Scalar, nonnegative, positive, real
from ..shafts.cased import ends
from ..shafts.line import AbstractLine
from .base import AbstractLinear
from .film import NEAREST, AbstractFluid, AbstractFluidLaw, eccentricities_to, place_by
from .law import Hardness, Now, Plane


class Seal(AbstractFluid, AbstractLinear):
    """Annular seal, whose fluid is a spring, a damper and a mass in axes that turn at `q = tau Omega`.

        eps = |z| / clearance,   K, D = stiffness, damping (1 - eps^2)^-exponent
        tau = swirl (1 - eps)^swirl_exponent,   q = tau Omega
        F = -[K - inertia q^2 - i q D] z - [D - 2 i inertia q] z. - inertia z..,   T = -tau Im(z* F)

    `z` is the displacement of the shaft from the centre of the seal, which is at `offset` along `angle`
    from the axis. `swirl` is the mean speed of the fluid around the centred shaft over that of the
    shaft. An exponent that is absent makes its coefficient a constant.

    The `inertia` of the fluid is a mass at the station without weight or unbalance, part of the linear
    equations. The force of the contact, as it is observed, is the rest of `F`, and so is the torque: it
    lacks `tau inertia d/dt Im(z* z.)`, whose mean over a steady motion is zero for a constant tau.

    `q D` drives the shaft forward. Above an onset speed the centred shaft is unstable and whirls at about
    `tau Omega`, the fluid whirl. The force is exact at every eccentricity below 1 and is NaN beyond.
    Linear analyses need a static position, see `jaxrotor.linearized`.
    Source: Muszynska (1986, 1988); Bently, Hatch (2002), with all terms of the turning axes.
    """

    kind: ClassVar[str] = "seal"
    plural: ClassVar[str] = "seals"
    by_speed: ClassVar[bool] = True
    turning: ClassVar[bool] = True

    at: Scalar = nonnegative("at [m]")
    clearance: Scalar = positive("clearance [m]")
    stiffness: Scalar = nonnegative("stiffness [N/m]")
    damping: Scalar = nonnegative("damping [N s/m]")
    swirl: Scalar = nonnegative("swirl [1]")
    inertia: Scalar | None = nonnegative("inertia [kg]", default=None)
    exponent: Scalar | None = nonnegative("exponent [1]", default=None)
    swirl_exponent: Scalar | None = nonnegative("swirl_exponent [1]", default=None)
    offset: Scalar = nonnegative("offset [m]", default=0.0)
    angle: Scalar = real("angle [rad]", default=0.0)
    on: str | None = eqx.field(default=None, static=True)  # name of a casing; None: the ground

    @property
    def turns_section(self) -> bool:
        return False

    def blocks(self, line: AbstractLine) -> Blocks:
        if self.inertia is None:
            return Blocks()
        row, column = ends(line, self.at, self.on)
        return Blocks(inertia=self.inertia * jnp.outer(column, row))

    def law(self) -> "SealLaw":
        return SealLaw(*self.centre, film=self)


class SealLaw(AbstractFluidLaw):
    """Law of a `Seal`, without the force on the mass of its fluid."""

    x: Scalar  # centre of the seal [m]
    y: Scalar
    film: Seal

    @property
    def elementwise(self) -> bool:
        return True

    def __call__(self, displacement: Plane, velocity: Plane, now: Now) -> Plane:
        seal, zeta = self.film, self.eccentricity(displacement)
        harder, swirl = self._flow(zeta)
        x, y = seal.clearance * zeta
        q, damping = swirl * now.speed, harder * seal.damping
        stiffness, coriolis = harder * seal.stiffness, jnp.zeros(())
        if seal.inertia is not None:
            stiffness, coriolis = stiffness - seal.inertia * q**2, 2 * seal.inertia * q
        (vx, vy), across = velocity, q * damping
        ahead = -stiffness * x - across * y - damping * vx - coriolis * vy
        aside = -stiffness * y + across * x - damping * vy + coriolis * vx
        return jnp.stack([ahead, aside])

    def _flow(self, zeta: Plane) -> tuple[Number, Number]:
        """`(1 - eps^2)^-exponent` and `tau`; NaN at the wall and beyond."""
        seal, square = self.film, zeta[0] ** 2 + zeta[1] ** 2
        inside = square < 1
        harder, swirl = jnp.where(inside, 1.0, jnp.nan), seal.swirl
        if seal.exponent is not None:
            harder = harder * _raised(jnp.where(inside, 1 - square, 1.0), -seal.exponent)
        if seal.swirl_exponent is not None:
            # A length below all others makes derivatives in the centre finite.
            least = jnp.finfo(square.dtype).tiny ** (2 / 3)
            eps = jnp.sqrt(jnp.where(inside, square, 0.0) + least)
            swirl = swirl * _raised(1 - eps, seal.swirl_exponent)
        return harder, swirl

    def torque(self, force: Plane, displacement: Plane, velocity: Plane, now: Now) -> Number:
        zeta = self.eccentricity(displacement)
        across = zeta[0] * force[1] - zeta[1] * force[0]
        return -self._flow(zeta)[1] * self.film.clearance * across

    def hardness(self) -> Hardness:
        """Stiffness and damping about the centre."""
        seal = self.film
        zero = jnp.zeros_like(seal.stiffness)
        return Hardness(seal.stiffness, seal.damping, jnp.zeros(2), zero)

    def carried(self, now: Now) -> Number | float:
        return now.speed

    def spring(self, carried: Scalar) -> Scalar:
        return jnp.abs(self._stiffness(jnp.zeros(2), carried))

    def place(self, load: Complex[Array, ""], carried: Scalar) -> Complex[Array, ""]:
        e = eccentricities_to(NEAREST)
        forces = (
            -self.film.clearance * jnp.asarray(e) * self._stiffness(jnp.stack([e, 0 * e]), carried)
        )
        return self.film.clearance * place_by(load, e, forces)

    def _stiffness(self, zeta: Plane, speed: Scalar) -> Complex[Array, "..."]:
        """`K - inertia q^2 - i q D` of a shaft at rest."""
        seal, (harder, swirl) = self.film, self._flow(zeta)
        q = swirl * speed
        mass = 0.0 if seal.inertia is None else seal.inertia
        return jax.lax.complex(harder * seal.stiffness - mass * q**2, -q * harder * seal.damping)


def _raised(base: Number, exponent: Number) -> Number:
    """`base^exponent` of positive numbers.

    Lanes take an exponential and a logarithm by vectors, and a power one by one: 109 in place of 146 ns a
    lane-step of a mass in a seal.
    """
    return jnp.exp(exponent * jnp.log(base))
