"""Journal bearing: a plain cylindrical bearing with an oil film."""

from typing import ClassVar

import equinox as eqx

from ..core.checks import check_counts
from ..core.quantities import Scalar, nonnegative, positive, real
from .film import AbstractFilm


class JournalBearing(AbstractFilm):
    """Plain bearing with an oil film, `p > 0` on the half circle towards which the film moves.

        zeta = z / c,   w = zeta. - i Omega zeta / 2,   u = w / |w|,   k0 = mu R L^3 / c^2
        F = -k0 |w| Int_{-pi/2}^{pi/2} cos(phi) u e^(i phi) / (1 - Re(zeta* u e^(i phi)))^3 dphi

    `z` is the displacement of the journal from the centre of its bush, which is at `offset` along
    `angle` from the axis, mu the `viscosity`, `R` the `radius`, `L` the `length`, `c` the radial
    `clearance`, and `s^2 = 1 - |zeta|^2`. The film exerts the torque
    `T = -2 pi mu R^3 L Omega / (c s) - Im(z* F) / 2` on the shaft. `cavitated=False` is the full
    (Sommerfeld) film, which bears negative pressure.

    The force is exact at any eccentricity below 1, in the centre and at rest; it has no bound near the
    wall, and is NaN at the wall. Its derivative jumps where `w = 0` off the centre; `blend` [1/s] smooths
    this, with a relative error of the order `blend^2 / |w|^2`, and still dissipates.

    This is the short film, whose oil flows along the bearing only. It bears too much where it is long: at
    L/D = 1/2 and eccentricity 0.6 by about a third, at L/D = 1 several times as much. With `modes`, 1 or
    more, it is a film of finite length: Reynolds' equation is separated by cosines along the bearing, and
    for so many of them the oil flows round the journal, too,

        (H^3 P')' - (b / Lambda)^2 H^3 P = 6 g / (b Lambda)^2,   b = (j - 1/2) pi,   Lambda = L / D

    with `H = 1 - Re(zeta* e^(i phi))` and `g = -Re(w* e^(i phi))`. Two modes have the load within 0.4 % of
    a film in two dimensions up to an eccentricity of 0.9 at L/D = 1, one of them within 5 %.

    Between two shafts, where the bush is that `on` which it stands, `w` has the sum of both speeds for
    `Omega`, so that equal counter-rotation squeezes the film alone; the shear in `T` has their difference.
    The other shaft feels `-T - Im(z* F)`.

    Linear analyses need coefficients about a static position, see `jaxrotor.linearized`.
    Source: Ocvirk (1952); Capone (1991); Friswell et al. (2010); modes: Reynolds' equation, separated.
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
    # Name of a casing, or of another shaft; None: the ground
    on: str | None = eqx.field(default=None, static=True)
    modes: int = eqx.field(default=0, static=True)  # of the pressure along the film; 0: short

    def __check_init__(self):
        check_counts(0, modes=self.modes)
