"""Scene whose nodes serve all values of some of its parameters."""

from collections.abc import Iterable

from ..scene import Scene
from ..shafts.line import NODES


def with_shared_nodes(scene: Scene, paths: Iterable[str]) -> Scene:
    """The scene for all values of the parameters at some `paths`, which one program serves.

    Stations and the shaft decide nodes that are "auto"; where one of these varies, every span has 8.
    """
    decides = any(path.startswith("shaft.") or path.endswith(".at") for path in paths)
    varies = decides and getattr(scene.shaft, "nodes", None) == "auto"
    return scene.with_nodes(NODES) if varies else scene
