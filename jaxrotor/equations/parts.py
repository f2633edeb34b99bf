"""Parts of a scene: what the shaft and its effects add to the equations of motion."""

from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from ..core.blocks import Blocks, Load
from ..effects.base import AbstractDamping, AbstractEffect, AbstractLinear, AbstractLoad
from ..scene import Scene
from ..shafts.line import AbstractLine
from ..shafts.virtual import VirtualLine
from .speed_tables import at_own_speed


Parts = dict[tuple[str, ...], Blocks]  # sums of blocks, by the names of the parts that add to them
_T = TypeVar("_T", Blocks, Load)


def assemble_blocks(scene: Scene, line: AbstractLine) -> Blocks:
    """Blocks of the shaft and of all effects, as they enter the equations of a line."""
    return sum(blocks_of_parts(scene, line).values(), Blocks())


def assemble_load(scene: Scene, line: AbstractLine, blocks: Blocks) -> Load:
    """All loads of a scene, as they enter the equations of a line."""
    found = _of_groups(scene, scene.of(AbstractLoad), lambda effect: effect.load(line, blocks))
    return sum(found.values(), Load())


def blocks_of_parts(scene: Scene, line: AbstractLine) -> Parts:
    """Blocks of the shaft and of every group of effects."""
    parts = _linear_parts(scene, line)
    dampings = scene.of(AbstractDamping)
    if not dampings:
        return parts
    blocks = motion = sum(parts.values(), Blocks())
    if isinstance(line, VirtualLine):
        motion = sum(_linear_parts(scene, line.line).values(), Blocks())
    found = {(scene.name_of(one),): one.damping(line, blocks, motion) for one in dampings}
    return parts | found


def linear_blocks(scene: Scene, line: AbstractLine, effects: Sequence[AbstractLinear]) -> Parts:
    """Blocks of every group of some linear effects of a scene, at its speed."""
    return _of_groups(scene, effects, lambda effect: at_own_speed(scene, effect).blocks(line))


def _linear_parts(scene: Scene, line: AbstractLine) -> Parts:
    """Blocks of the shaft and of every group of linear effects."""
    effects = linear_blocks(scene, line, scene.of(AbstractLinear))
    return {("the shaft",): scene.shaft.blocks(line)} | effects


def _of_groups(
    scene: Scene, effects: Sequence[AbstractEffect], of: Callable[[Any], _T]
) -> dict[tuple[str, ...], _T]:
    """Sums over groups of effects of equal structure, which are traced once, by their names.

    So a machine of fifty discs and ten tables compiles as fast as one of two discs and a table.
    """
    groups: dict[Any, list[AbstractEffect]] = {}
    for effect in effects:
        leaves, structure = jax.tree.flatten(effect)
        groups.setdefault((structure, *map(np.shape, leaves)), []).append(effect)
    return {tuple(map(scene.name_of, own)): _sum(own, of) for own in groups.values()}


def _sum(effects: list[AbstractEffect], of: Callable[[Any], _T]) -> _T:
    """Sum of what every effect of a group gives."""
    if len(effects) == 1:
        return of(effects[0])
    stack = jax.tree.map(lambda *leaves: jnp.stack(leaves), *effects)
    return jax.tree.map(lambda every: every.sum(0), eqx.filter_vmap(of)(stack))
