"""Balancing of rigid rotors: corrections in two planes, and the residual unbalance that is permitted."""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Complex, Float

from ..core.blocks import Blocks
from ..core.extremes import bounded, largest
from ..core.quantities import Scalar, check, known
from ..effects import AbstractLinear, Support
from ..effects.layout import check_one_shaft
from ..equations.parts import assemble_load
from ..equations.speed_tables import at_own_speed
from ..scene import Scene
from ..shafts import FlexibleShaft, MasslessShaft, RigidShaft
from ..shafts.virtual import VirtualLine


GRADES = (0.4, 1.0, 2.5, 6.3, 16.0, 40.0, 100.0, 250.0, 630.0, 1600.0, 4000.0)  # [mm/s]


class FirstMoments(NamedTuple):
    """`F_B = (J / z_B) (i Omega. - Omega^2)`: the moments that set a rigid rotor's bearing forces.

    `F_B` is the dynamic force at a bearing B, z_B from the bearing at z = 0, in the axes of the rotor.
    """

    unbalance: Complex[Array, ""]  # u = Sum m (x + i y) [kg m]
    product: Complex[Array, ""]  # J = Sum m (x + i y) z = I_xz + i I_yz [kg m^2]


class Grade(NamedTuple):
    """Balance quality grade `G = |U| Omega / m`."""

    value: Scalar  # G [mm/s]
    standard: Scalar  # smallest standard grade not below it [mm/s], infinite above the last


# === rigid rotors


def first_moments(scene: Scene, about: ArrayLike = 0.0) -> FirstMoments:
    """`u = Sum m e exp(i phase)`, `J = Sum m e exp(i phase) z` plus the couples of tilted discs.

    The sums include everything fixed to the shaft; the shaft itself is taken as straight.

    Args:
        scene: the rotor.
        about: station z [m] that J refers to.

    Returns:
        `FirstMoments` u [kg m] and J [kg m^2] in the axes of the rotor. Differentiable.

    Raises:
        ValueError: If the scene has several shafts.

    Source: Newton-Euler equations of a rigid rotor, eqs. (3), (9) of `turbine-run-up`.
    """
    check_one_shaft(scene.shafts, "`first_moments`")
    line = VirtualLine.resultant(scene.line(), jnp.asarray(about, float))
    found = assemble_load(scene, line, Blocks()).unbalance
    return FirstMoments(*(jnp.zeros(2, complex) if found is None else found))


def total_mass(scene: Scene) -> Scalar:
    """Total mass [kg] of shaft, discs and balls.

    Args:
        scene: the rotor.

    Returns:
        Mass [kg]. Differentiable.

    Raises:
        ValueError: If the scene has several shafts.
    """
    check_one_shaft(scene.shafts, "`total_mass`")
    return _weights(scene)[0]


def centre_of_mass(scene: Scene) -> Scalar:
    """`Int z dm / m`: station of the centre of mass of shaft, discs and balls.

    Args:
        scene: the rotor.

    Returns:
        Station [m]. Differentiable.

    Raises:
        ValueError: If the scene has several shafts.
    """
    check_one_shaft(scene.shafts, "`centre_of_mass`")
    mass, moment = _weights(scene)
    return moment / mass


def bearing_stations(scene: Scene) -> Float[Array, " b"]:
    """Stations where a constraint or support holds the displacement.

    Args:
        scene: the rotor, not traced.

    Returns:
        Stations [m], ascending, without repeats.

    Raises:
        ValueError: If the scene has several shafts.
    """
    check_one_shaft(scene.shafts, "`bearing_stations`")
    shaft = scene.shaft
    if isinstance(shaft, MasslessShaft):  # any supports are at its ends
        held = [0.0, shaft.length]
    else:
        own = shaft.constraints if isinstance(shaft, FlexibleShaft | RigidShaft) else ()
        held = [one.at for one in own if one.displacement]
        bearings = [one for one in scene.of(Support) if one.of is None]
        held += [one.at for one in bearings if float(jnp.max(one.mean_stiffness)) > 0]
    return jnp.asarray(sorted({float(at) for at in held}))


def _weights(scene: Scene) -> Float[Array, "2"]:
    """Mass [kg] and first moment of mass about z = 0 [kg m]."""
    line = VirtualLine.resultant(scene.line(), jnp.zeros(()))
    parts = [scene.shaft, *scene.of(AbstractLinear)]
    weights = [at_own_speed(scene, part).blocks(line).weight for part in parts]
    return sum((weight for weight in weights if weight is not None), start=jnp.zeros(2))


def rigid_correction(
    unbalance: ArrayLike, product: ArrayLike, planes: ArrayLike
) -> Complex[Array, "2"]:
    """`u + c1 + c2 = 0`, `J + c1 z1 + c2 z2 = 0`: no dynamic reaction, at any speed.

    Args:
        unbalance: u [kg m], complex in the axes of the rotor.
        product: J [kg m^2], complex product of inertia about the plane z = 0.
        planes: z1, z2 [m], two different stations.

    Returns:
        Corrections `m r exp(i angle)` [kg m] to add. Differentiable.

    Raises:
        ValueError: `planes` are not two stations, or are equal.

    Source: course project "Dynamic reactions in the bearings of a rotor", eq. (8).
    """
    u, j = jnp.asarray(unbalance), jnp.asarray(product)
    z = jnp.asarray(planes, float)
    if z.shape != (2,):
        raise ValueError(f"`planes [m]` must be two stations, but has shape {z.shape}.")
    if known(z) and z[0] == z[1]:
        raise ValueError(f"`planes [m]` must be two different stations, but both are {z[0]:g}.")
    return jnp.stack([j - u * z[1], u * z[0] - j]) / (z[1] - z[0]) + 0j


def rigid_residual(
    unbalance: ArrayLike, product: ArrayLike, planes: ArrayLike, corrections: ArrayLike
) -> FirstMoments:
    """`u + Sum c`, `J + Sum c z`: first moments that remain after `p` corrections.

    Args:
        unbalance: u [kg m], complex in the axes of the rotor.
        product: J [kg m^2], complex product of inertia about the plane z = 0.
        planes: z [m], (p,).
        corrections: c [kg m], complex, (p,).

    Returns:
        `FirstMoments` of the corrected rotor. Differentiable.
    """
    u, j, c = (jnp.asarray(part, complex) for part in (unbalance, product, corrections))
    return FirstMoments(u + jnp.sum(c), j + jnp.sum(c * jnp.asarray(planes, float)))


# === ISO 21940-11


def permissible_unbalance(grade: ArrayLike, mass: ArrayLike, speed: ArrayLike) -> Scalar:
    """`U_per = G m / Omega` [kg m].

    Args:
        grade: G [mm/s], as in G 6.3.
        mass: mass of the rotor [kg].
        speed: highest service speed [rad/s].

    Returns:
        Permissible residual unbalance [kg m]. Differentiable.

    Raises:
        ValueError: grade or mass is not positive, or the speed is zero.

    Source: ISO 21940-11:2016, eq. (7).
    """
    grade = check(grade, "grade [mm/s]", lambda x: x > 0, "must be positive")
    mass = check(mass, "mass [kg]", lambda x: x > 0, "must be positive")
    speed = check(speed, "speed [rad/s]", lambda x: x != 0, "must not be zero")
    return 1e-3 * grade * mass / jnp.abs(speed)


def allocated_unbalance(
    permissible: ArrayLike, centre: ArrayLike, bearings: ArrayLike
) -> Float[Array, "2"]:
    """`U_A = U_per L_B / L`, `U_B = U_per L_A / L`, clipped to the limits of the standard.

    With the centre of mass between the bearings each gets 0.3 to 0.7 of U_per, else 0.3 to 1.3.

    Args:
        permissible: U_per [kg m].
        centre: station of the centre of mass [m].
        bearings: stations of the bearings A, B [m], different.

    Returns:
        Permissible residual unbalance [kg m] in the planes of A and B. Differentiable.

    Raises:
        ValueError: both bearings are at one station.

    Source: ISO 21940-11:2016, clause 7 (ISO 1940-1:2003, 7.2).
    """
    a, b = jnp.asarray(bearings, float)
    if known(a) and known(b) and a == b:
        raise ValueError(f"`bearings [m]` must be two different stations, but both are {a:g}.")
    share = (b - centre) / (b - a)
    outside = (share < 0) | (share > 1)
    parts = jnp.abs(jnp.stack([share, 1 - share]))
    return jnp.asarray(permissible, float) * bounded(parts, 0.3, jnp.where(outside, 1.3, 0.7))


def balance_grade(unbalance: ArrayLike, mass: ArrayLike, speed: ArrayLike) -> Grade:
    """`G = |U| Omega / m`, and the smallest grade of the standard that it meets.

    Args:
        unbalance: U [kg m], a magnitude or complex.
        mass: mass of the rotor [kg].
        speed: highest service speed [rad/s].

    Returns:
        `Grade` [mm/s]. Its `value` is differentiable.

    Raises:
        ValueError: the mass is not positive.

    Source: ISO 21940-11:2016, Table 1.
    """
    mass = check(mass, "mass [kg]", lambda x: x > 0, "must be positive")
    value = 1e3 * jnp.abs(jnp.asarray(unbalance)) * jnp.abs(jnp.asarray(speed, float)) / mass
    steps = jnp.asarray([*GRADES, jnp.inf])
    return Grade(value, steps[jnp.searchsorted(steps, value * (1 - 1e-9))])


def bearing_grade(
    unbalance: ArrayLike,
    product: ArrayLike,
    mass: ArrayLike,
    centre: ArrayLike,
    bearings: ArrayLike,
    speed: ArrayLike,
) -> Grade:
    """`G = max |U_k| Omega / (m share_k)` of static and couple unbalance, in the planes of the bearings.

    `share_k = U_k,per / U_per` is that of `allocated_unbalance`: at grade G neither bearing exceeds its
    share. The grade does not depend on the planes in which the rotor is corrected.

    Args:
        unbalance: u [kg m], complex.
        product: J [kg m^2], complex, about the plane z = 0.
        mass: mass of the rotor [kg].
        centre: station of the centre of mass [m].
        bearings: stations of the bearings A, B [m], different.
        speed: highest service speed [rad/s].

    Returns:
        `Grade` [mm/s]. Its `value` is differentiable.

    Raises:
        ValueError: both bearings are at one station, or the mass is not positive.

    Source: ISO 21940-11:2016, clause 7 and Table 1.
    """
    loads = jnp.abs(rigid_correction(unbalance, product, bearings))
    shares = allocated_unbalance(1.0, centre, bearings)
    return balance_grade(largest(loads / shares), mass, speed)
