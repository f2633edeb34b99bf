"""Grid: the lanes of a sweep in blocks, each one chunk of a program and of a store."""

import math
from collections.abc import Hashable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr


Block = dict[str, slice]


def block_shape(shape: Sequence[int], most: int, workers: int) -> tuple[int, ...]:
    """Even blocks of at most `most` lanes, of whole last axes, and enough of them to busy all workers."""
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
    """All blocks of a grid, the last of an axis maybe shorter."""
    counts = [-(-n // b) for n, b in zip(sizes.values(), block, strict=True)]
    found = []
    for index in np.ndindex(*counts):
        ends = zip(sizes.items(), index, block, strict=True)
        found.append({dim: slice(i * b, min((i + 1) * b, n)) for (dim, n), i, b in ends})
    return found


def place_of(block: Block, dims: Iterable[Hashable]) -> tuple[slice, ...]:
    """Where a block is in an array of these dimensions, whole along those that it does not cut."""
    return tuple(block.get(str(dim), slice(None)) for dim in dims)


class Gathered:
    """Blocks of a data set, gathered in memory; one thread at a time."""

    def __init__(
        self, coords: Mapping[str, Any], attrs: Mapping[str, Any], block: Mapping[str, int]
    ):
        self.coords, self.attrs, self.block = coords, dict(attrs), dict(block)
        self.whole = xr.Dataset()

    def pending(self, blocks: list[Block]) -> list[Block]:
        """Those that are still to be computed: all."""
        return blocks

    def put(self, block: Block, part: xr.Dataset) -> None:
        """Keep a block."""
        if not self.whole.data_vars:
            self.whole = whole_of(part, self.coords)
            self.whole.attrs = self.attrs
        for name, one in part.data_vars.items():
            self.whole[name].values[place_of(block, one.dims)] = one.values

    def finished(self) -> xr.Dataset:
        """All of it."""
        return self.whole

    def add(self, more: xr.Dataset, attrs: Mapping[str, Mapping[str, Any]]) -> None:
        """Variables found from all blocks, and attributes of those there are."""
        self.whole = self.whole.assign(more.variables)
        for name, about in attrs.items():
            self.whole[name].attrs.update(about)


def whole_of(part: xr.Dataset, coords: Mapping[str, Any], *, empty: bool = False) -> xr.Dataset:
    """A data set as large as `coords` (dim: (dim, values, attributes)), made like one of its blocks.

    Values are any; `empty` ones are NaN, or 0 of whole numbers, and take no memory.
    """
    sizes = {dim: len(values) for dim, (_, values, _) in coords.items()}
    variables = {}
    for name, one in part.data_vars.items():
        shape = [sizes.get(str(dim), n) for dim, n in one.sizes.items()]
        none = np.nan if one.dtype.kind == "f" else 0
        make = np.broadcast_to if empty else lambda fill, shape: np.empty(shape, fill.dtype)
        values = make(np.array(none, one.dtype), shape)
        variables[name] = (one.dims, values, one.attrs)
    own = {name: one for name, one in part.coords.items() if name not in coords}
    return xr.Dataset(variables, {**coords, **own}, part.attrs)
