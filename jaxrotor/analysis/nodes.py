"""Number of nodes that a flexible shaft needs."""

import math

import numpy as np

from ..core.pilot import Pilot, refined
from ..core.quantities import with_values
from ..scene import Scene
from ..shafts import FlexibleShaft
from .modal import roots


SPECTRAL = (4, 6, 8, 10, 12, 16, 20)
CELLS = (5, 10, 20, 40, 80)


def chosen_nodes(scene: Scene, tolerance: float | int = 1e-6, count: int = 6) -> Pilot:
    """Nodes per span at which the slowest `count` roots have converged.

        |lambda_k(nodes) - lambda_k(next fewer nodes)| <= tolerance max_j |lambda_j|

    `scene.with_nodes(chosen_nodes(scene).setting)` uses them. Contact excites higher modes: choose a
    smaller tolerance or more roots there.

    Args:
        scene: a rotor with a FlexibleShaft, at its own speed.
        tolerance: relative difference allowed.
        count: number of roots compared.

    Returns:
        `Pilot` with the number of nodes as its setting.

    Raises:
        ValueError: the tolerance is not positive.
    """
    rule = getattr(scene.shaft, "rule", "spectral")

    def answer(nodes: int) -> np.ndarray | None:
        found = np.asarray(roots(scene.with_nodes(nodes), count))
        return found if found.size == count else None

    return refined("nodes", answer, SPECTRAL if rule == "spectral" else CELLS, tolerance)


def resolved(scene: Scene, count: int) -> Scene:
    """Scene whose automatic nodes are as many as its slowest `count` roots need, see `nodes_needed`.

    It is the same where the shaft has a number of nodes or is condensed, and for four roots.
    """
    shaft = scene.shaft
    if not isinstance(shaft, FlexibleShaft) or shaft.nodes != "auto" or scene.attached:
        return scene
    every = [(getattr(effect, "at", None), effect.holds_shaft) for effect in scene.effects]
    placed = [(float(at), holds) for at, holds in every if at is not None]
    stations = (*map(float, shaft.stations), *(at for at, _ in placed))
    held = len({at for at, holds in placed if holds})
    modes = max(2, math.ceil(count / 2))
    needed = shaft.resolution(stations, scene.spans, held, modes)
    return with_values(scene, resolution=needed)
