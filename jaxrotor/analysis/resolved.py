"""Scene with automatic nodes for as many roots as are asked for."""

import math

import jax

from ..core.quantities import known, with_values
from ..effects.places import count_held
from ..scene import Scene
from ..shafts import FlexibleShaft


def resolved(scene: Scene, count: int | None) -> Scene:
    """Scene whose automatic nodes are as many as its slowest `count` roots need, see `nodes_needed`.

    A shaft stays as it is where its `nodes` are a number, or it is condensed or traced; all do where all
    roots are asked for (None), and for up to four roots, for which scenes are built.
    """
    if count is None or count <= 4:
        return scene
    layouts = []
    for own, layout in zip(scene.placed(), scene.layouts, strict=True):
        shaft, stations = own.shaft, own.known_stations
        decided = stations is not None and all(map(known, jax.tree.leaves(shaft)))
        automatic = decided and not layout.attached
        if automatic and isinstance(shaft, FlexibleShaft) and shaft.nodes == "auto":
            held, modes = count_held(own.effects), math.ceil(count / 2)
            needed = shaft.resolution(stations or (), layout.spans, held, modes)
            layout = layout._replace(resolution=needed)
        layouts.append(layout)
    same = tuple(layouts) == scene.layouts
    return scene if same else with_values(scene, layouts=tuple(layouts))
