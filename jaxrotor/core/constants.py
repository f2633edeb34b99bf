"""Constants: numbers that decide the structure of a program, so that they are compiled into it."""

import dataclasses
from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array


@dataclasses.dataclass(frozen=True)
class Constant:
    """Values of an array as a static argument, equal for equal values."""

    values: bytes
    kind: str
    shape: tuple[int, ...]

    @classmethod
    def of(cls, array: Any) -> "Constant":
        """The constant of a known array."""
        known = np.asarray(array)
        return cls(known.tobytes(), known.dtype.str, known.shape)

    @property
    def array(self) -> Array:
        """The array, whose values are known within a trace, too."""
        values = np.frombuffer(self.values, self.kind).reshape(self.shape)
        with jax.ensure_compile_time_eval():
            return jnp.asarray(values)


def with_constants(tree: Any, arrays: Sequence[Any]) -> Any:
    """The tree with constants in place of those of its leaves that are one of the arrays.

    Entries that are not arrays, such as None, are passed over. An array must be a leaf of the tree,
    not one of equal values.
    """
    chosen = {id(one) for one in arrays if isinstance(one, Array | np.ndarray)}
    if missing := chosen - set(map(id, jax.tree.leaves(tree))):
        raise LookupError(
            f"{len(missing)} of {len(chosen)} arrays that decide the structure of a program are not "
            f"leaves of its {type(tree).__name__}, so they would be traced; list arrays that it holds."
        )
    return jax.tree.map(lambda leaf: Constant.of(leaf) if id(leaf) in chosen else leaf, tree)


def with_arrays(tree: Any) -> Any:
    """The tree with arrays in place of its constants."""
    return jax.tree.map(lambda leaf: leaf.array if isinstance(leaf, Constant) else leaf, tree)
