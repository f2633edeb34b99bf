"""Scene whose nodes serve all values of some of its parameters."""

from collections.abc import Iterable

from ..scene import Scene
from ..shafts.line import NODES


def with_shared_nodes(scene: Scene, paths: Iterable[str]) -> Scene:
    """The scene for all values of the parameters at some `paths`, which one program serves.

    Stations and the shaft decide nodes that are "auto"; where one of these varies, every span has 8.
    """
    owners = ("shaft.", "shafts.", "coaxial_shaft.", "coaxial_shafts.")
    turning = (
        ".ratio",
        ".speed",
        ".phase",
    )  # of a shaft beside the first one, which move no station
    decides = [path for path in paths if path.startswith(owners) or path.endswith(".at")]
    decides = [path for path in decides if not path.endswith(turning)]
    automatic = any(getattr(own.shaft, "nodes", None) == "auto" for own in scene.placed())
    return scene.with_nodes(NODES) if decides and automatic else scene
