"""Materials: what a shaft is made of."""

import equinox as eqx

from .quantities import Scalar, positive


class Material(eqx.Module):
    """Linear elastic material of Young's modulus `E` and density `rho`."""

    youngs_modulus: Scalar = positive("youngs_modulus [Pa]")
    density: Scalar = positive("density [kg/m^3]")


def steel() -> Material:
    """Structural steel, `E = 2.1e11 Pa`, `rho = 7850 kg/m^3`."""
    return Material(youngs_modulus=2.1e11, density=7850.0)


NAMED = {"steel": steel}
