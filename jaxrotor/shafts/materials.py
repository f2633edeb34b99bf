"""Materials of shafts."""

from ..core.quantities import Scalar, positive
from ..core.representation import AbstractPart


class Material(AbstractPart):
    """Linear elastic material: Young's modulus `E`, density `rho`, and `G`, needed for shear only."""

    youngs_modulus: Scalar = positive("youngs_modulus [Pa]")
    density: Scalar = positive("density [kg/m^3]")
    shear_modulus: Scalar = positive("shear_modulus [Pa]", default=None)


def steel() -> Material:
    """Structural steel.

    Returns:
        Material with `E = 2.1e11 Pa`, `rho = 7850 kg/m^3`, `nu = E / 2G - 1 = 0.3`.
    """
    return Material(youngs_modulus=2.1e11, density=7850.0, shear_modulus=2.1e11 / 2.6)


NAMED = {"steel": steel}
