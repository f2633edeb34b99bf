"""Grid: the lanes of a sweep in blocks, each one chunk of a program and of a store."""

import math
from collections.abc import Hashable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr


Block = dict[str, slice]
Chunk = Block | np.ndarray  # a block of the grid, or lanes by their numbers


def is_block(chunk: Chunk) -> bool:
    """Whether a chunk is a block, which has a place in the data set."""
    return isinstance(chunk, dict)


def block_shape(shape: Sequence[int], most: int, workers: int) -> tuple[int, ...]:
    """Shape of even blocks of at most `most` lanes.

    Blocks span the last axes whole, and there are enough of them to occupy all workers.
    """
    block, room = [1] * len(shape), most
    for axis in reversed(range(len(shape))):
        block[axis] = math.ceil(shape[axis] / math.ceil(shape[axis] / room))
        room //= block[axis]
        if block[axis] < shape[axis]:
            break
    count = math.prod(-(-n // b) for n, b in zip(shape, block, strict=True))
    for axis, size in enumerate(block):
        if count < workers and size > 1:
            block[axis] = math.ceil(size / min(size, math.ceil(workers / count)))
            break
    return tuple(block)


def blocks(sizes: Mapping[str, int], block: Sequence[int]) -> list[Block]:
    """All blocks of a grid; the last along an axis may be shorter."""
    counts = [-(-n // b) for n, b in zip(sizes.values(), block, strict=True)]
    parts = []
    for index in np.ndindex(*counts):
        ends = zip(sizes.items(), index, block, strict=True)
        parts.append({dim: slice(i * b, min((i + 1) * b, n)) for (dim, n), i, b in ends})
    return parts


def place_of(block: Block, dims: Iterable[Hashable]) -> tuple[slice, ...]:
    """Place of a block in an array of these dimensions, whole along those that the block does not cut."""
    return tuple(block.get(str(dim), slice(None)) for dim in dims)


class Gathered:
    """A data set in memory, put together from blocks by one thread at a time."""

    def __init__(
        self, coords: Mapping[str, Any], attrs: Mapping[str, Any], block: Mapping[str, int]
    ):
        self.coords, self.attrs, self.block = coords, dict(attrs), dict(block)
        self.whole = xr.Dataset()

    takes = staticmethod(is_block)

    def pending(self, blocks: list[Block]) -> list[Block]:
        """The blocks that are still to be computed: all of them."""
        return blocks

    def put(self, block: Block, part: xr.Dataset) -> None:
        """Copy a block to its place."""
        if not self.whole.data_vars:
            self.whole = whole_of(part, self.coords)
            self.whole.attrs = self.attrs
        for name, array in part.data_vars.items():
            self.whole[name].values[place_of(block, array.dims)] = array.values

    def finished(self) -> xr.Dataset:
        """The whole data set."""
        return self.whole

    def add(self, more: xr.Dataset, attrs: Mapping[str, Mapping[str, Any]]) -> None:
        """Add variables that were computed from all blocks, and attributes to those that exist."""
        self.whole = self.whole.assign(more.variables)
        for name, own in attrs.items():
            self.whole[name].attrs.update(own)


def whole_of(part: xr.Dataset, coords: Mapping[str, Any], *, empty: bool = False) -> xr.Dataset:
    """A data set over all `coords` (name: (dim, values, attributes)), with the variables of one block.

    Values are arbitrary; with `empty` they are NaN, or 0 of whole numbers, and take no memory.
    """
    sizes = {dim: len(values) for dim, values, _ in coords.values()}
    variables = {}
    for name, array in part.data_vars.items():
        shape = [sizes.get(str(dim), n) for dim, n in array.sizes.items()]
        none = np.nan if array.dtype.kind == "f" else 0
        make = np.broadcast_to if empty else lambda fill, shape: np.empty(shape, fill.dtype)
        values = make(np.array(none, array.dtype), shape)
        variables[name] = (array.dims, values, array.attrs)
    own = {name: array for name, array in part.coords.items() if name not in coords}
    return xr.Dataset(variables, {**coords, **own}, part.attrs)
