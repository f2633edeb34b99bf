"""Precision: arrays of a tree in float32, and back in float64."""

from typing import Any

import equinox as eqx
import jax
import numpy as np


SINGLE = {"float64": "float32", "complex128": "complex64"}
DOUBLE = {single: double for double, single in SINGLE.items()}


def single(tree: Any) -> Any:
    """The tree with all real and complex arrays of double precision in single precision."""
    return _cast(tree, SINGLE)


def double(tree: Any) -> Any:
    """The tree with all real and complex arrays of single precision in the double one, if jax has that."""
    return _cast(tree, DOUBLE) if jax.config.jax_enable_x64 else tree  # pyright: ignore


def _cast(tree: Any, types: dict[str, str]) -> Any:
    def of(leaf: Any) -> Any:
        name = np.dtype(leaf.dtype).name if eqx.is_array(leaf) else None
        return leaf.astype(types[name]) if name in types else leaf

    return jax.tree.map(of, tree)
