"""Number of nodes that a flexible shaft needs."""

import numpy as np

from ..core.pilot import Pilot, refined
from ..scene import Scene
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
