"""Journal bearing: a plain cylindrical bearing with a short oil film."""

from typing import ClassVar

import equinox as eqx

from ..core.quantities import Scalar, nonnegative, positive, real
from .film import AbstractFilm


class JournalBearing(AbstractFilm):
    """Plain bearing with a short oil film, `p > 0` on the half circle towards which the film moves.

        zeta = z / c,   w = zeta. - i Omega zeta / 2,   u = w / |w|,   k0 = mu R L^3 / c^2
        F = -k0 |w| Int_{-pi/2}^{pi/2} cos(phi) u e^(i phi) / (1 - Re(zeta* u e^(i phi)))^3 dphi

    `z` is the displacement of the journal from the centre of its bush, which is at `offset` along
    `angle` from the axis, mu the `viscosity`, `R` the `radius`, `L` the `length`, `c` the radial
    `clearance`, and `s^2 = 1 - |zeta|^2`. The film exerts the torque
    `T = -2 pi mu R^3 L Omega / (c s) - Im(z* F) / 2` on the shaft. `cavitated=False` is the full
    (Sommerfeld) film, which bears negative pressure.

    The force is exact at any eccentricity below 1, in the centre and at rest; it has no bound near the
    wall, and is NaN at the wall. Its derivative jumps where `w = 0` off the centre; `blend` [1/s] smooths
    this, with a relative error of the order `blend^2 / |w|^2`, and still dissipates. The short film (p
    quadratic along the bearing) bears too much where it is long: at L/D = 1/2 and eccentricity 0.6 by
    about a third, at L/D = 1 several times as much.

    Linear analyses need coefficients about a static position, see `jaxrotor.linearized`.
    Source: Ocvirk (1952); Capone (1991); Friswell et al. (2010).
    """

    kind: ClassVar[str] = "journal_bearing"
    plural: ClassVar[str] = "journal_bearings"
    turning: ClassVar[bool] = True

    at: Scalar = nonnegative("at [m]")
    viscosity: Scalar = nonnegative("viscosity [Pa s]")
    radius: Scalar = positive("radius [m]")
    length: Scalar = positive("length [m]")
    clearance: Scalar = positive("clearance [m]")
    offset: Scalar = nonnegative("offset [m]", default=0.0)
    angle: Scalar = real("angle [rad]", default=0.0)
    blend: Scalar | None = positive("blend [1/s]", default=None)
    cavitated: bool = eqx.field(default=True, static=True)  # half of the film is under pressure
    on: str | None = eqx.field(default=None, static=True)  # name of a casing; None: the ground
