"""Static reduction of a rotor to one station of a massless shaft."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..core import linalg
from ..core.compiled import compiled_quickly
from ..core.quantities import Scalar, check, known
from ..effects.layout import check_one_shaft
from ..effects.places import of_first_order
from ..equations.pencil import check_alike
from ..equations.system import System, assemble
from ..scene import Scene
from ..shafts import MasslessShaft
from .forced import ending_span
from .linearized import check_linear


class Reduction(eqx.Module):
    """Stiffness, mass and inertia of a rotor at one station, from its static deflections."""

    shaft: MasslessShaft
    mass: Scalar  # [kg], equal kinetic energy of the deflection under a force at the station
    condensed: Float[Array, "2 2"]  # mass matrix condensed to displacement [m] and slope [rad]


def reduction(scene: Scene, at) -> Reduction:
    """Static reduction to displacement and slope at one station: `k = F^-1`, `m = Int m(s) x(s)^2 ds`.

    `F` is the flexibility under force and couple at the station; `x` is the deflection under a force
    there, divided by its value there. Mass and inertia of shaft and discs count. `mass` keeps the first
    frequency to some per cent. `condensed` keeps the kinetic energy of both deflections, but its second
    frequency is far too high (about twice): for a second coordinate take the transverse inertia
    from `inertia_from_frequency`.

    Args:
        scene: a rotor held by supports or constraints, the same along every axis; its speed and
            damping do not matter.
        at: station [m]; a span is made to end there, as in `forced_response`.

    Returns:
        `Reduction`: equivalent massless shaft, mass and condensed mass matrix. Differentiable.

    Raises:
        ValueError: the axes are unequal, the station cannot move or has no slope, nothing holds the
            rotor, or controllers of magnetic bearings do.

    Source: Brysin, Nikiforov (2019), eqs. (7)-(10).
    """
    check_one_shaft(scene.shafts, "`reduction`")
    check_linear(scene)
    if owners := of_first_order(scene.effects):
        names = ", ".join(map(scene.name_of, owners))
        raise ValueError(
            f"A reduction is by the stiffness of the rotor, but that of {names} comes from controllers; "
            "put a Support in place of each."
        )
    (at,) = scene.stations(at)
    length = scene.shaft.length
    flexibility, moved, condition = _static(assemble(ending_span(scene, at)), at)
    obstacles = {
        "is free to move as a rigid body": ~(condition < 1e12),
        "has no slope": flexibility[1, 1] <= 0,
        "is held": flexibility[0, 0] <= 1e-12 * length**2 * flexibility[1, 1],
    }
    for why, there in obstacles.items():
        if known(there) and there:
            raise ValueError(f"The rotor cannot be reduced to {float(at):g} m, where it {why}.")
    k = linalg.inv(flexibility)
    shaft = MasslessShaft(length, at, k[0, 0], (k[0, 1] + k[1, 0]) / 2, k[1, 1])
    condensed = k @ moved @ k
    mass = moved[0, 0] / flexibility[0, 0] ** 2
    return Reduction(shaft, mass, (condensed + condensed.T) / 2)


@compiled_quickly
def _static(system: System, at: Scalar) -> tuple[Array, Array, Scalar]:
    """Flexibility under force and couple, `Int m x_i x_j ds` of both deflections, condition number.

    The integral is the response at the station to the inertia forces of a deflection, since the
    flexibility is symmetric.
    """
    line, blocks = system.line, system.blocks
    check_alike(system, "A single reduction", "reduce each axis by itself")
    rows = jnp.stack([line.row(at), line.slope_row(at)])
    columns = jnp.stack([line.column(at), line.couple_column(at)], axis=1)
    inertia = jnp.zeros_like(line.stiffness) if blocks.inertia is None else blocks.inertia
    stiffness = line.stiffness if blocks.stiffness is None else blocks.stiffness
    bent = linalg.solve(stiffness, columns)
    moved = rows @ linalg.solve(stiffness, inertia @ bent)
    return rows @ bent, moved, linalg.cond(stiffness)


def inertia_from_frequency(shaft: MasslessShaft, mass, frequency) -> Scalar:
    """`I = (k22 / w^2) (w^2 - K11 / m) / (w^2 - k11 / m)`, `K11 = k11 - k12^2 / k22`.

    Args:
        shaft: a shaft with slope, that is, with `k12` and `k22`.
        mass: mass at its station [kg].
        frequency: second natural frequency `w` of the rotor at rest, measured or computed [rad/s].

    Returns:
        Transverse inertia [kg m^2] that gives the reduced rotor this frequency. Its relative error is
        about 2.7 times that of the frequency. Differentiable.

    Raises:
        ValueError: the shaft has no slope, mass or frequency is not positive, or the frequency is not
            above the pole `sqrt(k11 / m)`, below which no inertia gives it.

    Source: Brysin, Nikiforov (2019), from eq. (4).
    """
    if shaft.k12 is None or shaft.k22 is None:
        raise ValueError("The shaft has no slope at its station; give it k12 and k22.")
    positive = lambda value, label: check(value, label, lambda x: x > 0, "must be positive")
    mass, frequency = positive(mass, "mass [kg]"), positive(frequency, "frequency [rad/s]")
    pole = jnp.sqrt(shaft.k11 / mass)
    low = frequency <= pole
    if known(low) and low:
        raise ValueError(
            f"`frequency [rad/s]` must exceed sqrt(k11 / m) = {float(pole):g}, the frequency with the "
            f"slope held, but is {float(frequency):g}; give the second natural frequency."
        )
    message = "`frequency [rad/s]` must exceed sqrt(k11 / m), the frequency with the slope held."
    square = eqx.error_if(frequency, low, message) ** 2
    condensed = shaft.k11 - shaft.k12**2 / shaft.k22
    return shaft.k22 / square * (square - condensed / mass) / (square - shaft.k11 / mass)
