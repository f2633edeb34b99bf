"""Parts of a scene: what the shaft and its effects add to the equations of motion."""

from collections.abc import Callable, Iterable, Sequence
from typing import Any, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from ..core.blocks import Blocks, Load
from ..core.quantities import Scalar
from ..effects.base import (
    AbstractDamping,
    AbstractEffect,
    AbstractLinear,
    AbstractLoad,
    AbstractOverSpeed,
    AbstractUnbalance,
    Ends,
)
from ..effects.law import Clock
from ..effects.layout import coaxial_shafts
from ..effects.places import of_first_order
from ..scene import Scene
from ..shafts.cased import line_of
from ..shafts.line import AbstractLine
from ..shafts.virtual import VirtualLine
from .other_unbalance import OtherUnbalance
from .speed_tables import at_own_speed, clock_of, parts_with_tables, speed_of


Parts = dict[tuple[str, ...], Blocks]  # sums of blocks, by the names of the parts that add to them
_T = TypeVar("_T", Blocks, Load)


def assemble_blocks(scene: Scene, line: AbstractLine) -> Blocks:
    """Blocks of the shaft and of all effects, as they enter the equations of a line."""
    return sum(blocks_of_parts(scene, line).values(), Blocks())


def assemble_load(scene: Scene, line: AbstractLine, blocks: Blocks) -> Load:
    """All loads of a scene, as they enter the equations of a line."""
    every = lambda one: one.load(line_of(line, one.shaft), blocks)
    found = _of_groups(
        scene, [one for one in scene.of(AbstractLoad) if on_first(scene, one)], every
    )
    return sum(found.values(), Load())


def loads_of_others(scene: Scene, line: AbstractLine) -> tuple[OtherUnbalance, ...]:
    """Unbalance of every shaft but the first one, each with its own speed."""
    found = []
    for shaft in coaxial_shafts(scene.effects):
        loads = [one for one in scene.of(AbstractLoad) if one.shaft == shaft.name]
        own = line_of(line, shaft.name)
        load = sum((one.load(own, Blocks()) for one in loads), Load())
        if load.present not in ([], ["unbalance"]):
            raise ValueError(
                f"On the shaft {shaft.name!r} is a load other than unbalance ({', '.join(load.present)}); "
                "only the first shaft of a scene can have it."
            )
        if load.unbalance is not None:
            found.append(OtherUnbalance(shaft.clock, load.unbalance, shaft.name))
    return tuple(found)


def excess_gyroscopic(scene: Scene, line: AbstractLine) -> Array | None:
    """`Sum speed_k G_k` of the shafts whose speed is not only a multiple of that of the first one."""
    found = []
    for shaft in coaxial_shafts(scene.effects):
        if shaft.speed is not None:
            own = line_of(line, shaft.name)
            effects = [one for one in scene.of(AbstractLinear) if one.shaft == shaft.name]
            blocks = (at_own_speed(scene, one).blocks(own) for one in effects)
            block = sum(blocks, Blocks()).gyroscopic
            found += [] if block is None else [shaft.speed * block]
    return sum(found[1:], found[0]) if found else None


def _of_first(scene: Scene, line: AbstractLine) -> AbstractLine:
    """The line as that of the first shaft, whichever is observed."""
    return line_of(line, scene.name) if scene.shafts else line


def on_first(scene: Scene, effect: AbstractEffect) -> bool:
    """Whether an effect sits on the first shaft of a scene, or on none."""
    return effect.shaft in (None, scene.name)


def unbalances(scene: Scene, line: AbstractLine, blocks: Blocks) -> tuple[list[Array], list[Array]]:
    """Columns of all unbalance, and what each is multiplied by, where an effect keeps that apart.

    Lanes of other eccentricities share what is computed of the columns.
    """
    loads = [one for one in scene.of(AbstractLoad) if on_first(scene, one)]
    line = _of_first(scene, line)
    alone = [one for one in loads if type(one).load is AbstractUnbalance.load]
    columns, amounts = [line.column(one.at) for one in alone], [one.amount for one in alone]
    others = [one for one in loads if type(one).load is not AbstractUnbalance.load]
    rest = sum((one.load(line, blocks) for one in others), Load()).unbalance
    if rest is not None:
        columns.append(rest)
        amounts.append(jnp.ones(()))
    return columns, amounts


def blocks_of_parts(scene: Scene, line: AbstractLine) -> Parts:
    """Blocks of the shaft and of every group of effects."""
    parts = _linear_parts(scene, line)
    dampings = scene.of(AbstractDamping)
    if not dampings:
        return parts
    owners = of_first_order(scene.effects)
    for one in dampings:
        if owners and one.undamped:
            raise ValueError(
                f"A {one.kind} is by modes of the rotor without damping, but the {owners[0].kind} has "
                "coordinates of first order; take another damping, such as InternalDamping."
            )
    blocks = motion = sum(parts.values(), Blocks())
    if isinstance(line, VirtualLine):
        motion = sum(_linear_parts(scene, line.line).values(), Blocks())
    of = lambda one: one.damping(line_of(line, one.shaft), blocks, motion)
    found = {(scene.name_of(one),): of(one) for one in dampings}
    return parts | found


def _linear_parts(scene: Scene, line: AbstractLine) -> Parts:
    """Blocks of the shaft and of every group of linear effects."""
    beside: dict[str, Any] = {one.name: one for one in coaxial_shafts(scene.effects)}

    def blocks(effect: AbstractLinear) -> Blocks:
        found = at_own_speed(scene, effect).blocks(line_of(line, effect.shaft))
        if (own := beside.get(effect.shaft or "")) is None:
            return found
        return found.of_shaft(own.ratio, own.speed)

    effects = _of_groups(scene, scene.of(AbstractLinear), blocks)
    return {("the shaft",): scene.shaft.blocks(_of_first(scene, line))} | effects


class OverSpeed(eqx.Module):
    """Blocks of a scene at any speed, with all that does not depend on it computed once."""

    constant: Blocks  # of all parts without tables
    # Effects of equal structure, the clocks of their tables, and their ends
    groups: tuple[tuple[AbstractOverSpeed, Clock | None, Ends], ...]

    @classmethod
    def of(cls, scene: Scene, line: AbstractLine, parts: Parts) -> "OverSpeed | None":
        """Blocks of a scene whose parts are known at one speed.

        None without tables, or where a damping depends on all blocks together.
        """
        tabled = parts_with_tables(scene)
        if not tabled or scene.of(AbstractDamping):
            return None
        names = set(map(scene.name_of, tabled))
        constant = sum((own for part, own in parts.items() if names.isdisjoint(part)), Blocks())
        ends_of = lambda effect: effect.ends_on(line_of(line, effect.shaft))
        groups = map(_stack, _groups([(own, clock_of(scene, own)) for own in tabled]))
        return cls(constant, tuple((*own, _of_each(ends_of, own[0])) for own in groups))

    def blocks_at(self, speed: Scalar) -> Blocks:
        """Blocks at a speed [rad/s]; NaN where a table of coefficients has no value."""

        def read(effect: AbstractOverSpeed, clock: Clock | None, ends: Ends) -> Blocks:
            return effect.at_speed(speed_of(clock, speed)).blocks_between(ends)

        every = (_summed(_of_each(read, *group)) for group in self.groups)
        return sum(every, self.constant)


def _of_groups(
    scene: Scene, effects: Sequence[AbstractEffect], of: Callable[[Any], _T]
) -> dict[tuple[str, ...], _T]:
    """Sums over groups of effects of equal structure, which are traced once, by their names.

    So a machine of fifty discs and ten tables compiles as fast as one of two discs and a table.
    """
    return {tuple(map(scene.name_of, own)): _sum(own, of) for own in _groups(effects)}


def _groups(effects: Sequence[Any]) -> Iterable[list[Any]]:
    """Effects of equal structure together."""
    groups: dict[Any, list[AbstractEffect]] = {}
    for effect in effects:
        leaves, structure = jax.tree.flatten(effect)
        alone = () if all(map(eqx.is_array_like, leaves)) else (id(effect),)  # has a function, say
        groups.setdefault((structure, *map(np.shape, leaves), *alone), []).append(effect)
    return groups.values()


def _stack(effects: list[Any]) -> Any:
    """Effects of equal structure as one whose numbers have a leading axis."""
    return jax.tree.map(lambda *leaves: jnp.stack(leaves), *effects)


def _of_each(of: Callable, *stacks: Any) -> Any:
    """Results of a function for every member of stacks, along a leading axis."""
    if jax.tree.leaves(stacks[0])[0].shape[0] > 1:
        return eqx.filter_vmap(of)(*stacks)
    found = of(*jax.tree.map(lambda leaf: leaf[0], stacks))
    return jax.tree.map(lambda leaf: leaf[None], found)


def _sum(effects: list[AbstractEffect], of: Callable[[Any], _T]) -> _T:
    """Sum of what every effect of a group gives."""
    if len(effects) == 1:
        return of(effects[0])
    return _summed(eqx.filter_vmap(of)(_stack(effects)))


def _summed(every: _T) -> _T:
    return jax.tree.map(lambda leaf: leaf.sum(0), every)
