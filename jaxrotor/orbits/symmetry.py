"""Symmetry: the rotations that leave a scene as it is.

scene rotated by phi = scene:  k_i = k_j, .., angle_i + phi = angle_j for contacts i, j

A ring or a film about the axis of the shaft stays as it is by every rotation.

A scene without unbalance is also unchanged by a shift in time.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..core.plane import plane
from ..core.quantities import Scalar, known
from ..effects.base import AbstractContact
from ..equations.system import System
from ..scene import Scene


SAME = 1e-9  # relative difference of parts that count as equal


def symmetry_defects(scene: Scene, system: System, turn: Scalar) -> Float[Array, " d"]:
    """Relative changes of a scene by a rotation and a shift in time; zeros where it stays as it is.

    Differentiable: a parameter that breaks the symmetry has a nonzero derivative here.
    """
    load, blocks, speed = system.load, system.blocks, system.spin.speed
    at_rest = known(speed) and not float(speed)
    once, twice = jnp.exp(1j * turn) - 1, jnp.exp(2j * turn) - 1
    # By what each part changes: unbalance and axes that turn, by some shift in time.
    cases = [
        (load.unbalance, 0.0 if at_rest else 1.0),
        (load.constant, once),
        (load.carried, once),
        (load.twice, 1.0),
        (load.carried_twice, 1.0),
        (blocks.fixed_stiffness, twice),
        (blocks.fixed_damping, twice),
        (blocks.rotating_stiffness, twice if at_rest else 1.0),
        (blocks.rotating_damping, twice if at_rest else 1.0),
    ]
    parts = [jnp.zeros(1)]
    for part, change in cases:
        if part is not None:  # as x and y: the absolute value of zero would have no derivative
            parts.append(_relative(plane(change * part).ravel(), part))
    groups: dict = {}
    for contact in scene.of(AbstractContact):
        if contact.eccentric is not None:
            parts.append(_relative(contact.eccentric * plane(once), contact.eccentric))
            continue
        groups.setdefault(jax.tree.structure(contact), []).append(contact)
    for alike in groups.values():
        angle = jnp.stack([contact.angle for contact in alike])
        facing = [eqx.tree_at(lambda c: c.angle, contact, jnp.zeros(())) for contact in alike]
        tables = [jnp.stack(leaves) for leaves in zip(*map(jax.tree.leaves, facing), strict=True)]
        differs = [_relative(table[:, None] - table, table) for table in tables]
        ahead = angle[:, None] + turn - angle
        differs.append(ahead - 2 * jnp.pi * jnp.round(ahead / (2 * jnp.pi)))
        apart = sum(jnp.abs(part) for part in differs)
        place = jnp.arange(angle.size), jnp.argmin(jax.lax.stop_gradient(apart), axis=1)
        parts += [part[place] for part in differs]
    return jnp.concatenate(parts)


def _relative(part: Array, whole: Array | None = None) -> Array:
    """A part over the largest of the whole, which is not differentiated; by 1 where that is 0."""
    scale = jax.lax.stop_gradient(jnp.max(jnp.abs(part if whole is None else whole), initial=0.0))
    return part / jnp.where(scale > 0, scale, 1.0)


def symmetry_order(scene: Scene, system: System) -> int:
    """The largest `N` such that a rotation by `2 pi / N` leaves a scene of known values as it is."""
    for count in range(len(scene.of(AbstractContact)), 1, -1):
        defects = symmetry_defects(scene, system, jnp.asarray(2 * jnp.pi / count))
        if float(jnp.max(jnp.abs(defects))) < SAME:
            return count
    return 1


@jax.custom_jvp
def nan_unless_symmetric(turn: Scalar, defects: Float[Array, " d"]) -> Scalar:
    """The turn, or NaN if it does not leave the scene as it is.

    Its derivative by a parameter that breaks the symmetry is NaN, too.
    """
    return jnp.where(jnp.max(jnp.abs(defects)) < SAME, turn, jnp.nan)


@nan_unless_symmetric.defjvp
def _nan_unless_symmetric_jvp(primals, tangents):
    turn, by = tangents
    return nan_unless_symmetric(*primals), jnp.where(jnp.all(by == 0), turn, jnp.nan)
