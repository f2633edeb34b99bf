"""Contacts: what the stops of a motion do, in numbers and as rows of a table."""

from typing import Any

import jax
import numpy as np

from ..effects import AbstractContact
from ..scene import Scene
from .answer import Rows


def contacts_of(motion: Any, skip: int = 0) -> list[dict[str, Any]]:
    """Share of time in contact and largest force of each contact, less `skip` samples at the start."""
    return [{"duty": np.mean(f > 0), "peak_force": f.max()} for f in _forces(motion, skip)]


def contact_rows(motion: Any, skip: int = 0) -> Rows:
    """Name of each contact, share of time in contact and largest force, less `skip` samples at the start.

    Contacts that differ in nothing but their angle, as a ring of stops, share a row: they touch while any
    of them does.
    """
    forces, rows = _forces(motion, skip), []
    for group in _equal_but_for_angle(motion.scene):
        own = forces[group]  # (g, T)
        name = f"contact {group[0]}"
        if len(group) > 1:
            whole = group == list(range(group[0], group[-1] + 1))
            which = f"{group[0]} to {group[-1]}" if whole else ", ".join(map(str, group))
            name = f"contacts {which}"
        duty = np.mean((own > 0).any(axis=0))
        rows.append((name, f"{duty:.2%} of the time, up to {own.max():.5g} N"))
    return rows


def _equal_but_for_angle(scene: Scene) -> list[list[int]]:
    """Numbers of the contacts of a scene, those together that differ in their angle alone."""
    groups: dict[Any, list[int]] = {}
    for number, contact in enumerate(scene.of(AbstractContact)):
        leaves, structure = jax.tree_util.tree_flatten_with_path(contact)
        values = [
            (path, np.asarray(leaf).tolist())
            for path, leaf in ((jax.tree_util.keystr(path), leaf) for path, leaf in leaves)
            if path != ".angle"
        ]
        groups.setdefault((structure, repr(values)), []).append(number)
    return list(groups.values())


def _forces(motion: Any, skip: int) -> np.ndarray:
    """Magnitudes [N] (k, T) of contact forces of a `TimeHistory`, less `skip` samples at the start."""
    force = motion.contact_force
    return np.zeros((0, 0)) if force is None else np.abs(np.asarray(force)[skip:]).T
