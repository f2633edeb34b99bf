"""Cracked rotors, which have no constant coefficients."""

from ..effects import Crack
from ..scene import Scene


def check_uncracked(scene: Scene) -> None:
    """Raise if a scene has cracks, which breathe."""
    if cracks := scene.of(Crack):
        names = ", ".join(scene.name_of(crack) for crack in cracks)
        raise ValueError(
            f"Cracks ({names}) breathe as the shaft turns, so the rotor has no constant stiffness; take "
            "`jaxrotor.periodic`, whose multipliers tell of stability, beside "
            '`jaxrotor.harmonic_balance`; or take the crack as closed, `scene.without("cracks")`.'
        )
