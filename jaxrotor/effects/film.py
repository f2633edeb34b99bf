"""Film: forces of a fluid film between a journal and its bush."""

import abc
from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex

from ..core.quantities import Number, Scalar
from .base import AbstractContact
from .film_pressure import centred_share, film_integrals
from .law import AbstractSmoothLaw, Hardness, Now, Plane


SERIES = 0.1  # below this `t - arctan t` is summed as a series
NEAREST = 1e-4  # root of 1 - eccentricity^2 up to which a film is sought to bear its load
NEAREST_FINITE = 0.1  # likewise of a film of finite length
PLACES = 400  # eccentricities among which that position is sought


class AbstractFluid(AbstractContact):
    """Fluid in the annular gap around a shaft, which acts always, and linearly about a position alone."""

    walled: ClassVar[bool] = True

    turning: eqx.AbstractClassVar[bool]  # whether the shaft rotates in the fluid

    clearance: eqx.AbstractVar[Scalar]  # radial, c [m]
    offset: eqx.AbstractVar[Scalar]  # of the centre of the gap from the axis [m]

    @property
    def eccentric(self) -> Scalar:
        return self.offset

    @property
    def centre(self) -> tuple[Scalar, Scalar]:
        """Centre of the gap [m]."""
        return self.offset * jnp.cos(self.angle), self.offset * jnp.sin(self.angle)

    @abc.abstractmethod
    def law(self) -> "AbstractFluidLaw":
        """Law of the fluid, with the centre of its gap computed once."""


class AbstractFluidLaw(AbstractSmoothLaw):
    """Law of a fluid in an annular gap; the force is NaN where the gap is closed and beyond."""

    x: eqx.AbstractVar[Scalar]  # centre of the gap [m]
    y: eqx.AbstractVar[Scalar]
    film: eqx.AbstractVar[AbstractFluid]

    def eccentricity(self, displacement: Plane) -> Plane:
        """`zeta`, displacement of the shaft in the gap over the clearance."""
        centre = jnp.stack(jnp.broadcast_arrays(self.x, self.y))
        return (displacement - centre) / self.film.clearance

    @abc.abstractmethod
    def carried(self, now: Now) -> Number | float | None:
        """Speed of a shaft in a bush at rest that would carry the fluid as it is carried [rad/s].

        None: nothing carries it.
        """

    @abc.abstractmethod
    def spring(self, carried: Scalar) -> Scalar:
        """Stiffness [N/m] about the centre, by which a load is shared before its position is known."""

    @abc.abstractmethod
    def place(self, load: Complex[Array, ""], carried: Scalar) -> Complex[Array, ""]:
        """Position in the gap [m] that bears a load, to some digits."""


def eccentricities_to(nearest: float) -> np.ndarray:
    """Eccentricities from the centre on, dense near the wall, to `1 - e^2 = nearest^2`."""
    s = np.geomspace(1.0, nearest, PLACES)
    return np.sqrt((1 - s) * (1 + s))


def place_by(
    load: Complex[Array, ""], eccentricities: np.ndarray, forces: Complex[Array, " e"]
) -> Complex[Array, ""]:
    """Eccentricity that bears a load, by the forces [N] at positive real ones, in ascending order."""
    size, forces = jnp.abs(load), -forces
    eccentricity = jnp.interp(size, jnp.abs(forces), eccentricities)
    attitude = jnp.interp(eccentricity, eccentricities, jnp.angle(forces))
    return eccentricity * load / jnp.where(size > 0, size, 1.0) * jnp.exp(-1j * attitude)


class AbstractFilm(AbstractFluid):
    """Oil film around a journal, which has no stiffness but about a static position."""

    viscosity: eqx.AbstractVar[Scalar]  # mu [Pa s]
    radius: eqx.AbstractVar[Scalar]  # R [m]
    length: eqx.AbstractVar[Scalar]  # L [m]
    blend: eqx.AbstractVar[Scalar | None]  # delta [1/s]
    cavitated: eqx.AbstractVar[bool]  # whether only half of the film is under pressure
    modes: eqx.AbstractVar[int]  # modes of the pressure along the film; 0: the short film

    def law(self) -> "FilmLaw":
        return FilmLaw(*self.centre, film=self)


class FilmLaw(AbstractFluidLaw):
    """`F = -k0 |w| Int cos(phi) u e^(i phi) / (1 - a cos phi - b sin phi)^3 dphi` of a short film.

    The integral goes over the half circle around `u = w / |w|` that is under pressure, `zeta = z / c`,
    `w = zeta. - i Omega zeta / 2`, `a = Re(zeta u*)`, `b = Im(zeta u*)`, `k0 = mu R L^3 / c^2`. A film of
    finite length has `F = -k0 Int p e^(i phi) dphi`, see `film_integrals`. At the wall and beyond the
    force is NaN. It is continuous: its derivative alone jumps, where the film does not move, so there are
    no branches.
    """

    steep: ClassVar[bool] = True

    x: Scalar  # centre of the bush [m]
    y: Scalar
    film: AbstractFilm

    @property
    def elementwise(self) -> bool:
        return not self.film.modes  # a finite film has modes along its length

    @property
    def scale(self) -> Number:
        """`k0 = mu R L^3 / c^2` [N s]."""
        film = self.film
        return film.viscosity * film.radius * film.length**3 / film.clearance**2

    @property
    def slenderness(self) -> Number:
        """Length over diameter."""
        return self.film.length / (2 * self.film.radius)

    def carried(self, now: Now) -> Number | float | None:
        """`Omega`, or the sum of both; the ring of a damper turns with what it stands on."""
        if now.beside is None:
            return now.speed if self.film.turning else None
        return now.beside.speed + (now.speed if self.film.turning else now.beside.speed)

    def spring(self, carried: Scalar) -> Scalar:
        return self.scale / self.film.clearance * jnp.abs(carried)

    def place(self, load: Complex[Array, ""], carried: Scalar) -> Complex[Array, ""]:
        """That of a film at rest, which bears nothing, is on the farthest circle."""
        e = eccentricities_to(NEAREST_FINITE if self.film.modes else NEAREST)
        zero = np.zeros_like(e)
        still = jnp.stack([e, zero], axis=1), jnp.stack([zero, -e / 2], axis=1)  # at a speed of 1
        along, across = jax.vmap(self.resistance)(*still).T
        forces = -self.scale * jnp.abs(carried) * (along + 1j * jnp.sign(carried) * across)
        return self.film.clearance * place_by(load, e, forces)

    def __call__(self, displacement: Plane, velocity: Plane, now: Now) -> Plane:
        zeta, rate = self.eccentricity(displacement), velocity / self.film.clearance
        if (carried := self.carried(now)) is not None:
            rate = rate - carried / 2 * jnp.stack([-zeta[1], zeta[0]])
        return -self.scale * self.resistance(zeta, rate)

    def resistance(self, zeta: Plane, w: Plane) -> Plane:
        """`-F / k0` [1/s]; NaN at the wall and beyond."""
        square = zeta[0] ** 2 + zeta[1] ** 2
        inside = square < 1
        s2 = jnp.where(inside, 1 - square, 1.0)
        if self.film.modes:
            force = self._finite(jnp.where(inside, zeta, 0.0), w, s2)
        elif self.film.cavitated:
            force = _half(zeta, w, s2, self.film.blend)
        else:
            force = _full(zeta, w, s2)
        return jnp.where(inside, force, jnp.nan)

    def _finite(self, zeta: Plane, w: Plane, s2: Number) -> Plane:
        """`I(w) / 2 + |w|^2 (I_half(u) - I(u) / 2) / rho`, where the half film is under pressure."""
        film = self.film
        whole, half = film_integrals(zeta, w, s2, self.slenderness, film.modes)
        if not film.cavitated:
            return whole
        square = w[0] ** 2 + w[1] ** 2
        moves = square > 0
        smooth = 0.0 if film.blend is None else film.blend**2
        speed = jnp.sqrt(jnp.where(moves, square, 1.0))
        rho = jnp.sqrt(jnp.where(moves, square + smooth, 1.0))
        even = half - whole / speed / 2
        return whole / 2 + jnp.where(moves, square / rho, 0.0) * even

    def torque(self, force: Plane, displacement: Plane, velocity: Plane, now: Now) -> Number:
        """`T = -2 pi mu R^3 L Omega / (c s) - Im(z* F) / 2` with Couette shear all round.

        `Omega` is the speed past the bush. The ring of a damper does not turn in it, and what holds it
        takes the moment.
        """
        film = self.film
        if not film.turning:
            return jnp.zeros(())
        x, y = zeta = self.eccentricity(displacement)
        square = zeta[0] ** 2 + zeta[1] ** 2
        s = jnp.sqrt(jnp.where(square < 1, 1 - square, jnp.nan))
        shear = 2 * jnp.pi * film.viscosity * film.radius**3 * film.length / film.clearance
        past = now.speed if now.beside is None else now.speed - now.beside.speed
        return -shear * past / s - film.clearance * (x * force[1] - y * force[0]) / 2

    def hardness(self) -> Hardness:
        """Damping of the centred journal: a short half film has `pi k0 / (2 c)`. There is no stiffness."""
        damping = jnp.pi * self.scale / self.film.clearance
        if self.film.modes:
            damping = damping * centred_share(self.slenderness)
        zero = jnp.zeros_like(damping)
        return Hardness(zero, damping / 2 if self.film.cavitated else damping, jnp.zeros(2), zero)


def _half(zeta: Plane, w: Plane, s2: Number, blend: Number | None) -> Plane:
    """`3 zeta (m s + q A) / s^5 + w A / s^3 - i w b / (s^2 (1 - b^2))`, with `q = Re(zeta w*)`.

    `A = atan2(s, -a)`, `a = q / rho`, `b = Im(zeta w*) / rho`, `m = |w|^2 / rho`, where
    `rho^2 = |w|^2 + blend^2`. As the journal leaves the wall, `m s + q A` is a small difference, which is
    then summed as a series.
    """
    s = jnp.sqrt(s2)
    square = w[0] ** 2 + w[1] ** 2
    smooth = 0.0 if blend is None else blend**2
    moves = square + smooth > 0
    rho = jnp.sqrt(jnp.where(moves, square + smooth, 1.0))
    q, p = zeta[0] * w[0] + zeta[1] * w[1], zeta[1] * w[0] - zeta[0] * w[1]
    a, b = (jnp.where(moves, part / rho, 0.0) for part in (q, p))
    mean = jnp.where(moves, square / rho, 0.0)
    angle = jnp.arctan2(s, -a)
    leaves = moves & (s < -SERIES * a)
    t = jnp.where(leaves, s / jnp.where(leaves, -a, 1.0), 0.0)
    small = -q * _tangent_defect(t) - s * smooth / rho
    radial = jnp.where(leaves, small, mean * s + q * angle)
    across = b / (s2 * (s2 + a**2 + (1 - s2) * jnp.where(moves, smooth / rho**2, 0.0)))
    turned = jnp.stack([-w[1], w[0]])
    return 3 * zeta * radial / (s2**2 * s) + w * angle / (s2 * s) - turned * across


def _full(zeta: Plane, w: Plane, s2: Number) -> Plane:
    """`pi (3 zeta Re(zeta w*) / s^5 + w / s^3)`."""
    q = zeta[0] * w[0] + zeta[1] * w[1]
    return jnp.pi * (3 * zeta * q / s2 + w) / (s2 * jnp.sqrt(s2))


def _tangent_defect(t: Number) -> Number:
    """`t - arctan t` of a small `t`, without cancellation."""
    square, total = t * t, jnp.zeros_like(t)
    for k in range(8, 0, -1):
        total = (-1) ** (k + 1) / (2 * k + 1) + square * total
    return t * square * total
