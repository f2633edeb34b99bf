"""Provenance: what data say of where they are from."""

import importlib.metadata
from collections.abc import Hashable, Iterable

from ..core.pilot import Pilot
from ..scene import Scene


BRANCHES = ("up", "down")  # ways through the values of a parameter that states are carried along


def ensemble_of(dims: Iterable[Hashable]) -> tuple[str, ...]:
    """Dimensions that tell lanes of equal parameters apart: starting states, and the way there."""
    return tuple(dim for dim in map(str, dims) if dim.startswith("start.") or dim == "branch")


def chosen(pilots: tuple[Pilot, ...]) -> dict[str, str]:
    """Attributes that tell what was chosen by pilots."""
    return {"chosen": "; ".join(map(str, pilots))} if pilots else {}


def assumed(scene: Scene) -> dict[str, str]:
    """The attribute that says what is assumed of a scene, or none."""
    return {"assumption": scene.assumption} if scene.assumption else {}


def versions() -> str:
    """Versions of the packages a result depends on."""
    names = ("jaxrotor", "jax", "diffrax", "equinox")
    return " ".join(f"{name} {importlib.metadata.version(name)}" for name in names)
