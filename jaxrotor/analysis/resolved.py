"""Scene with automatic nodes for as many roots as are asked for."""

import math

import jax

from ..core.quantities import known, with_values
from ..scene import Scene
from ..shafts import FlexibleShaft


def resolved(scene: Scene, count: int | None) -> Scene:
    """Scene whose automatic nodes are as many as its slowest `count` roots need, see `nodes_needed`.

    It is the same where `shaft.nodes` is a number, the shaft is condensed or traced, or all roots are
    asked for (None); and for up to four roots, for which scenes are built.
    """
    shaft = scene.shaft
    if count is None or count <= 4 or not isinstance(shaft, FlexibleShaft) or shaft.nodes != "auto":
        return scene
    every = [(getattr(effect, "at", None), effect.holds_shaft) for effect in scene.effects]
    placed = [(at, holds) for at, holds in every if at is not None]
    decides = jax.tree.leaves((shaft, [at for at, _ in placed]))
    if scene.attached or not all(map(known, decides)):
        return scene
    stations = tuple(float(at) for at in (*shaft.stations, *(at for at, _ in placed)))
    held = len({float(at) for at, holds in placed if holds})
    needed = shaft.resolution(stations, scene.spans, held, math.ceil(count / 2))
    return scene if needed == scene.resolution else with_values(scene, resolution=needed)
