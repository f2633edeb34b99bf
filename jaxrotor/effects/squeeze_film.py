"""Squeeze film: a damper whose oil film is squeezed by a ring that does not turn."""

from typing import ClassVar

import equinox as eqx

from ..core.checks import check_counts
from ..core.quantities import Scalar, nonnegative, positive, real
from .film import AbstractFilm


class SqueezeFilm(AbstractFilm):
    """Squeeze film damper, the film of a `JournalBearing` whose journal does not turn.

        zeta = z / c,   u = zeta. / |zeta.|,   k0 = mu R L^3 / c^2
        F = -k0 |zeta.| Int_{-pi/2}^{pi/2} cos(phi) u e^(i phi) / (1 - Re(zeta* u e^(i phi)))^3 dphi

    Its ring, of radius `R`, moves with the shaft at `at` but is kept from turning, as by a squirrel cage;
    a `Support` beside it is the cage. On a circular orbit of relative radius `e` about the centre at the
    rate w, with `s^2 = 1 - e^2`, the film has the stiffness `2 k0 w e / (c s^4)` and the damping
    `pi k0 / (2 c s^3)`; a full film (`cavitated=False`) has no stiffness and twice the damping.
    `viscosity`, `clearance`, `offset`, `angle`, `blend` and `modes` are those of a `JournalBearing`; with
    `modes` its ends are open and its length is finite.
    Source: Friswell et al. (2010), Dynamics of Rotating Machines; Booker (1965).
    """

    kind: ClassVar[str] = "squeeze_film"
    plural: ClassVar[str] = "squeeze_films"
    turning: ClassVar[bool] = False

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
    modes: int = eqx.field(default=0, static=True)  # of the pressure along the film; 0: short

    def __check_init__(self):
        check_counts(0, modes=self.modes)
