"""Rigid motions of a rotor that nothing holds.

    E' K E = Sum over effects of e' k e,   e(x) = (1, x / l) on the shaft, 1 on a casing

Of the rigid motions that its constraints allow, a rotor is free in those that are null vectors of this
matrix, along x and y. The elasticity of the shaft is not part of it, so that a soft support holds a stiff
shaft.
"""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..core.blocks import Blocks
from ..core.compiled import compiled_quickly
from ..core.quantities import Scalar, known, value_of, with_values
from ..effects.base import (
    AbstractCasing,
    AbstractCoaxial,
    AbstractContact,
    AbstractLinear,
    AbstractOverSpeed,
    AbstractUnequal,
)
from ..effects.places import names_beside
from ..scene import Scene
from ..shafts.cased import CasedLine, line_of
from ..shafts.coaxial import CoaxialLine
from ..shafts.constraint import Motion
from ..shafts.line import AbstractLine, AbstractShaft, RigidLine
from .speed_tables import at_own_speed


SINGULAR = 1e-13  # relative stiffness below which a motion is free
CURE = 'give the shaft `constraints`, for instance [{at = "0 m", holds = "clamp"}], or supports'


def check_held(scene: Scene, what: str, contact: bool = False) -> None:
    """Raise if the rotor is free; the message says that `what` needs one that is held.

    With `contact` it may also be held by contacts, such as stops and films.
    """
    touched = any(part.holds_shaft for part in scene.of(AbstractContact))
    free = "" if contact and touched else unheld(scene)
    if free:
        raise ValueError(f"{what} needs a rotor that is held, but {free}; {CURE}.")


def check_constant_load(scene: Scene, frequency: Scalar | float) -> None:
    """Raise at frequency zero if the rotor is free, as a constant load moves it without bound."""
    if frequency == 0:
        check_held(scene, "The response at frequency zero")


def unheld(scene: Scene) -> str:
    """A clause that says in which rigid motion a rotor without contact is free; "" where it is held.

    Where values are traced, or coefficients are over the frequency of whirl, the number of springs counts.
    """
    if not _motions(scene) and not scene.of(AbstractCasing) or _surely_held(scene):
        return ""
    tables = scene.of(AbstractOverSpeed)
    if all(one.speeds is None for one in tables):
        scene = with_values(scene, spin=None)  # of which no coefficient is read, traced or not
    leaves = jax.tree.leaves(scene)
    if not all(map(known, leaves)) or any(one.frequencies is not None for one in tables):
        return "it can move as a rigid body" if _too_few(scene) else ""
    with jax.ensure_compile_time_eval():  # also inside a program
        stiffness = np.asarray(_restraint(scene))
    if not np.isfinite(stiffness).all():  # beyond the tables
        return ""
    _, sizes, ways = np.linalg.svd(stiffness)
    null = ways[sizes <= SINGULAR * sizes[0]]
    return _described(scene, null) if len(null) else ""


def _motions(scene: Scene) -> list[Motion]:
    """Rigid motions of all shafts."""
    return [motion for own in scene.placed() for motion in own.shaft.rigid_motions]


def _on_shafts(scene: Scene) -> list[AbstractLinear]:
    """Linear effects that are no shafts."""
    return [one for one in scene.of(AbstractLinear) if not isinstance(one, AbstractCoaxial)]


def _surely_held(scene: Scene) -> bool:
    """Whether springs at enough stations hold a rotor without casings: the usual case, told at once."""
    motions = scene.shaft.rigid_motions
    springs: tuple[Any, ...] = scene.of(AbstractUnequal)
    if (
        scene.of(AbstractCasing)
        or scene.shafts
        or not all(map(known, jax.tree.leaves((motions, springs))))
    ):
        return False
    held = {float(one.at) for one in springs if _resists(one)}
    if len(motions) == 2:
        return len(held) > 1
    ((a, b),) = motions
    return any(abs(float(a) + float(b) * at) > 1e-6 * float(scene.shaft.length) for at in held)


def _too_few(scene: Scene) -> bool:
    """Whether there are fewer springs, each against one displacement or tilt, than rigid motions."""
    springs: tuple[Any, ...] = scene.of(AbstractUnequal)
    count = len(springs) + sum(one.angular_stiffness is not None for one in springs)
    if count >= len(_motions(scene)) + len(scene.of(AbstractCasing)):
        return False
    others = [one for one in _on_shafts(scene) if not isinstance(one, AbstractUnequal)]
    of_each = lambda line: [one.blocks(line_of(line, one.shaft)) for one in others]
    shapes = eqx.filter_eval_shape(of_each, _line(scene))
    return not any("stiffness" in name for blocks in shapes for name in blocks.present)


def _resists(spring: Any) -> bool:
    """Whether a support resists displacements along every axis, by its mean or its coefficients.

    Of tables the smallest direct and the largest cross stiffness count.
    """
    number = lambda value: np.asarray(0.0 if value is None else value)
    if spring.kxx is None:
        return bool(number(spring.stiffness) > 0 and abs(number(spring.anisotropy)) < 1)
    least = [number(spring.kxx).min(), number(value_of(spring, "kyy")).min()]
    cross = np.abs(number(spring.kxy) + number(spring.kyx)).max()
    return bool(min(least) > 0 and cross < 2 * np.sqrt(np.prod(least)))


@compiled_quickly
def _restraint(scene: Scene) -> Float[Array, "m m"]:
    """Stiffness of all effects against the rigid motions along x, then along y."""
    line = _line(scene)
    parts = (
        at_own_speed(scene, part).blocks(line_of(line, part.shaft)) for part in _on_shafts(scene)
    )
    blocks, zero = sum(parts, Blocks()), jnp.zeros(line.stiffness.shape, complex)
    own, skew, fixed, turning = (
        zero if block is None else zero + block
        for block in (
            blocks.stiffness,
            blocks.skew_stiffness,
            blocks.fixed_stiffness,
            blocks.rotating_stiffness,
        )
    )
    equal, unequal = own + 1j * skew, fixed + turning
    ahead, across = equal + unequal, equal - unequal
    return jnp.block([[ahead.real, -across.imag], [ahead.imag, across.real]])


def _line(scene: Scene) -> AbstractLine:
    """The shafts as rigid ones, with what is beside it, in coordinates of unit displacements."""
    every = scene.placed()
    lines = [_rigid_line(own.shaft) for own in every]
    line: AbstractLine = lines[0]
    if scene.shafts:
        starts = tuple(jnp.asarray(own.start) for own in every)
        line = CoaxialLine(lines=tuple(lines), starts=starts, names=scene.shafts, anisotropy=None)
    beside = names_beside(scene.effects)
    return CasedLine(line=line, names=beside, anisotropy=None) if beside else line


def _rigid_line(shaft: AbstractShaft) -> RigidLine:
    length, motions = shaft.length, jnp.array(shaft.rigid_motions, float).reshape(-1, 2)
    sizes = jnp.abs(motions) @ jnp.stack([jnp.ones_like(length), length])
    return RigidLine(motions=motions / sizes[:, None], length=length)


def _described(scene: Scene, null: np.ndarray) -> str:
    """The free motions, null vectors of `_restraint`, in words."""
    if len(null) == null.shape[1] and len(_motions(scene)) >= 2:
        return "nothing holds it"
    along = [bool(np.abs(part).max() > 1e-6) for part in np.split(null, 2, axis=1)]
    axis = "" if all(along) else f" along {'xy'[along.index(True)]}"
    return f"it can move as a rigid body{axis}"
