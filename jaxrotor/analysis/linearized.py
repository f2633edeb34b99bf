"""Linearized: static positions of shafts in their bearings, and scenes that are linear about them."""

from typing import Any

import jax.numpy as jnp
import numpy as np

from ..core.quantities import known
from ..effects import Crack, MagneticBearing, RollingBearing
from ..effects.film import AbstractFluid
from ..equations.pencil import check_axes, frame, unequal_parts
from ..equations.speed_tables import check_tables
from ..equations.system import assemble
from ..scene import Scene
from .films import StaticPositions, film_positions, support_of
from .magnetic import MagneticPositions, magnetic_positions, with_linear_bearings
from .rolling import RollingPositions, freeze_of, rolling_positions


BEARINGS = (AbstractFluid, RollingBearing, MagneticBearing)  # linear about a static position


def static_positions(
    scene: Scene, speeds: Any = None
) -> StaticPositions | RollingPositions | MagneticPositions:
    """`K q = loads + Sum column F(row q, 0, Omega)`: the rotor at rest in its bearings, under weight.

    The equilibrium in films and seals is that of the whole rotor, also where its bearings share the load
    by its stiffness, and the coefficients are the exact Jacobian of the film there. Newton's method
    starts from the loads that the weight puts on the bearings, each in the position that bears it.

    In rolling bearings the rotor rests where `linear` of each has the cage: "frozen" at its `angle`, or
    "mean", the mean of all such positions while the cages, all together, turn by the angle between two
    balls, at 256 angles: where a ball begins to bear in between, the error of a stiffness is about 1e-4.

    In magnetic bearings nothing depends on the speed. A controller with `ki` brings its sensor back to
    the centre, one without lets the shaft sag.

    Args:
        scene: a rotor with a `JournalBearing`, `SqueezeFilm` or `Seal`, with a `RollingBearing`, or with a
            `MagneticBearing`.
        speeds: one or more speeds [rad/s], by default that of the scene.

    Returns:
        `StaticPositions` in films, `RollingPositions` in rolling bearings, `MagneticPositions` in magnetic
        ones, with first derivatives by all parameters.

    Raises:
        ValueError: if the scene has no such bearing, or several kinds, has unequal axes that turn, or no
            static position was found, as at rest, where a film bears nothing and a Support must, in a
            rolling bearing without a load, or of one ball under load, or in a magnetic bearing in
            saturation; or `linear` of a rolling bearing is None.
    """
    speeds = jnp.atleast_1d(jnp.asarray(scene.spin.speed if speeds is None else speeds, float))
    kind = _kind_of(scene)
    check_tables(scene, speeds)
    system = assemble(scene)
    if frame(system.blocks) == "rotating":
        raise ValueError(
            f"Axes of {unequal_parts(system, 'rotating')} turn with the shaft, so the rotor under weight "
            "has no static position; simulate it in time."
        )
    check_axes(system, "There is no static position", "simulate it in time")
    if kind is RollingBearing:
        return rolling_positions(scene, system, speeds)
    if kind is MagneticBearing:
        return magnetic_positions(scene, system)
    return film_positions(scene, system, speeds)


def _kind_of(scene: Scene) -> type:
    """Kind of bearings that a static position is of; raises unless a scene has one of these kinds."""
    kinds = [kind for kind in BEARINGS if scene.of(kind)]
    if not kinds:
        raise ValueError(
            "The scene has no oil film, no seal and no rolling or magnetic bearing; add one, such as a "
            "JournalBearing, or take the scene as it is."
        )
    if len(kinds) > 1:
        raise ValueError(
            "Static positions are those of films and seals, of rolling bearings or of magnetic ones, but "
            "the scene has more than one kind; put a Support in place of the others, or simulate it in "
            "time."
        )
    return kinds[0]


def linearized(scene: Scene, speeds: Any = None) -> Scene:
    """The scene with a linear part in place of each film, rolling or magnetic bearing.

    It is a `Support`, or a `LinearMagneticBearing` with the same controller. Its coefficients are those
    about the static position: at the speed of the scene, or tables over `speeds`, between which they are
    interpolated (see `Support`) and outside of which they are refused. Those of magnetic bearings are the
    same at any speed.

    Args:
        scene: a rotor as of `static_positions`.
        speeds: two or more speeds [rad/s] of the scene's sense in ascending order, as nodes of the
            tables; None: that of the scene. The tables hold for this sense of rotation alone.

    Returns:
        The scene, whose other effects are the same. The coefficients of a film without viscosity are zero.
        Of rolling bearings, which have stiffness alone, `assumption` says where their cages are.

    Raises:
        ValueError: as `static_positions`, or the speeds are not two or more in ascending order, or the
            scene turns backward and they are not negative.
    """
    if speeds is not None and (np.ndim(speeds) != 1 or np.size(speeds) < 2):
        raise ValueError(
            f"`speeds` must be two or more in ascending order, but is {speeds}; at one speed give "
            "`linearized(scene.at_speed(speed))`."
        )
    sense = scene.spin.sense
    turning = any(film.turning for film in scene.of(AbstractFluid))
    if turning and speeds is not None and known(speeds) and known(sense):
        least, most = np.min(speeds), np.max(speeds)
        if sense < 0 <= most:
            raise ValueError(
                "The cross-coupling of a film follows the rotation, and this scene turns backward, so "
                f"`speeds` must be negative, but the highest is {most:g} rad/s; take those of "
                "its sense, or give `scene.at_speed(..)` a positive speed."
            )
        if least < 0 < most:
            raise ValueError(
                "The cross-coupling of a film changes its sign with the rotation, so `speeds` must be of "
                f"one sense, but are from {least:g} to {most:g} rad/s; take one scene for each sense."
            )
    found = static_positions(scene, speeds)
    if isinstance(found, MagneticPositions):
        return with_linear_bearings(scene, found)
    kind = AbstractFluid if isinstance(found, StaticPositions) else RollingBearing
    bearings = scene.of(kind)
    effects = []
    for effect in scene.effects:
        if not isinstance(effect, kind):
            effects.append(effect)
            continue
        j = next(i for i, one in enumerate(bearings) if one is effect)
        damping = found.damping[:, j] if isinstance(found, StaticPositions) else None
        own = found.stiffness[:, j], damping
        effects.append(support_of(effect, None if speeds is None else found.speeds, *own))
    if isinstance(found, StaticPositions):
        return scene.of_parts(*effects)
    assumption = "; ".join(filter(None, [scene.assumption, found.assumption]))
    return Scene(scene.shaft, *effects, spin=scene.spin, assumption=assumption, name=scene.name)


def check_linear(scene: Scene, speeds: Any = None) -> None:
    """Raise if a scene has parts without linear coefficients, such as films, or tables lack a speed."""
    films = scene.of(AbstractFluid)
    if films:
        names = ", ".join(scene.name_of(film) for film in films)
        raise ValueError(
            f"Films and seals ({names}) have linear coefficients about a static position only; give "
            "this analysis `jaxrotor.linearized(scene)`, or `linearized(scene, speeds)` over several "
            "speeds."
        )
    if bearings := scene.of(RollingBearing):
        freeze_of(scene)
        names = ", ".join(scene.name_of(bearing) for bearing in bearings)
        raise ValueError(
            f"Rolling bearings ({names}) are linear about a static position only; give this analysis "
            "`jaxrotor.linearized(scene)`."
        )
    if bearings := scene.of(MagneticBearing):
        names = ", ".join(scene.name_of(bearing) for bearing in bearings)
        raise ValueError(
            f"Magnetic bearings ({names}) are linear about a static position only; give this analysis "
            "`jaxrotor.linearized(scene)`."
        )
    if cracks := scene.of(Crack):
        names = ", ".join(scene.name_of(crack) for crack in cracks)
        raise ValueError(
            f"Cracks ({names}) breathe as the shaft turns, so the rotor has no constant stiffness; take "
            "`jaxrotor.periodic`, whose multipliers tell of stability, beside "
            '`jaxrotor.harmonic_balance`; or take the crack as closed, `scene.without("cracks")`.'
        )
    check_tables(scene, speeds)
