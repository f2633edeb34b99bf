"""Mass properties of a rigid rotor: mass, centre of mass, inertia tensor, first moments of unbalance."""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Complex, Float

from ..core.quantities import Scalar
from ..effects import Disc
from ..effects.layout import check_one_shaft
from ..scene import Scene
from ..shafts import FlexibleShaft
from .balancing import first_moments


class MassProperties(NamedTuple):
    """Mass properties of a rigid rotor in its own axes; the third is the axis of rotation."""

    mass: Scalar  # [kg]
    centre: Float[Array, "3"]  # x, y and station of the centre of mass [m]
    tensor: Float[Array, "3 3"]  # [kg m^2], off-diagonal: products of inertia with minus sign
    unbalance: Complex[Array, ""]  # u = Sum m (x + i y) [kg m]
    product: Complex[Array, ""]  # J = I_xz + i I_yz [kg m^2]


def mass_properties(scene: Scene, about: ArrayLike = 0.0) -> MassProperties:
    """`T = Sum R I_0 R^T + m (r^2 E - r r^T)`, `u = Sum m (x + i y)`, `J = -(T_xz + i T_yz)`.

    The sums run over all discs. A disc with `exact` false counts to first order: `sin(tilt) ~ tilt`, and
    its offset adds no inertia about the axis. `Unbalance` enters u, J and the centre of mass.

    Args:
        scene: a rotor whose shaft has no mass of its own.
        about: station [m] of the point on the axis that the tensor and J refer to.

    Returns:
        `MassProperties`. Dynamic reactions vanish where u and J do. Differentiable.

    Raises:
        ValueError: the shaft is flexible, or there is no disc.

    Source: course project of `turbine-run-up`, eqs. (3)-(7), with its errata 6 to 10 and 15.
    """
    check_one_shaft(scene.shafts, "`mass_properties`")
    if isinstance(scene.shaft, FlexibleShaft):
        raise ValueError(
            "A flexible shaft bends and has mass of its own; `mass_properties` is for a RigidShaft."
        )
    discs = scene.of(Disc)
    if not discs:
        raise ValueError("A rigid shaft has no mass; put a disc on it.")
    u, j = first_moments(scene, about)
    mass = sum((disc.mass for disc in discs), jnp.zeros(()))
    moment = sum((disc.mass * disc.at for disc in discs), jnp.zeros(()))
    tensor = sum((_tensor(disc, about) for disc in discs), jnp.zeros((3, 3)))
    return MassProperties(mass, jnp.stack([u.real, u.imag, moment]) / mass, tensor, u, j)


def _tensor(disc: Disc, about: ArrayLike) -> Float[Array, "3 3"]:
    """Inertia tensor of a disc about a point on the axis."""
    z, one = jnp.array([0.0, 0.0, 1.0]), jnp.eye(3)
    axis = jnp.outer(z, z)
    if disc.tilt is not None:
        lean = jnp.array([jnp.sin(disc.tilt_axis), -jnp.cos(disc.tilt_axis), 0.0])
        if disc.exact:
            normal = jnp.cos(disc.tilt) * z + jnp.sin(disc.tilt) * lean
            axis = jnp.outer(normal, normal)
        else:
            axis = axis + disc.tilt * (jnp.outer(z, lean) + jnp.outer(lean, z))
    diametral, polar = disc.inertia or (jnp.zeros(()), jnp.zeros(()))
    tensor = diametral * one + (polar - diametral) * axis
    arm = jnp.asarray(disc.at - about) * z
    if disc.offset is not None:
        angle = disc.offset_angle
        arm = arm + disc.offset * jnp.array([jnp.cos(angle), jnp.sin(angle), 0.0])
    shift = disc.mass * ((arm @ arm) * one - jnp.outer(arm, arm))
    return tensor + (shift if disc.exact else shift * (1 - jnp.outer(z, z)))
