"""Store: blocks of a data set on disk as they are computed, so that what is done is never lost.

A folder in Zarr format, which `xarray.open_zarr` reads at any time. A block is one chunk of every
variable, each put in place whole, its `status` last: until then that is `not_computed`.
"""

import contextlib
import json
import os
import shutil
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
import zarr
import zarr.storage

from ..core.outcome import STATUS
from .grid import Block, place_of, whole_of


PENDING = STATUS.index("not_computed")
SHOWN = 60  # characters of a value in a refusal


class OtherSweepError(ValueError):
    """A folder holds another sweep, or values for others."""


class StoreError(RuntimeError):
    """A store that can no longer be written; its one sentence says why, and what is kept."""


@contextlib.contextmanager
def plainly(path: Path) -> Iterator[None]:
    """What is written to a store, or one sentence that says why it could not be."""
    try:
        yield
    except OSError as error:
        kept = path.exists()
        then = "done blocks are kept in it, and the same sweep goes on from there"
        raise StoreError(
            f"{path} cannot be written ({error.strerror or error}); "
            f"{then if kept else 'choose another place'}."
        ) from error


class Store:
    """Blocks of a data set in a folder, which the first of them begins; one thread at a time.

    Other processes may put other blocks: no two write the same file.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        coords: Mapping[str, Any],
        attrs: Mapping[str, Any],
        block: Mapping[str, int],
    ):
        self.path, self.coords, self.attrs = Path(path), coords, dict(attrs)
        self.block, self._met = dict(block), False
        if self.path.exists():
            self.block = self._check()
            self._met = True

    def __getstate__(self) -> dict[str, Any]:  # another process may work in another folder
        return self.__dict__ | {"path": self.path.absolute()}

    def pending(self, blocks: list[Block]) -> list[Block]:
        """Those that are still to be computed."""
        if not self.path.exists():
            return blocks
        status = self._open()["status"]
        missing = status.values == PENDING
        return [block for block in blocks if missing[place_of(block, status.dims)].any()]

    def put(self, block: Block, part: xr.Dataset) -> None:
        """Write a block; its status when all the rest is there."""
        last = ["status"]
        with plainly(self.path):
            self._meet(part)
            # Chunks are written whatever their values, so that one that is lost is missed.
            with zarr.config.set({"array.write_empty_chunks": True}):
                group = self._group()
                for name in [name for name in part.data_vars if name not in last] + last:
                    one = part[name]
                    group[str(name)][place_of(block, one.dims)] = one.values

    def finished(self) -> xr.Dataset:
        """All of it, read where it is looked at."""
        return self._open()

    def add(self, more: xr.Dataset, attrs: Mapping[str, Mapping[str, Any]]) -> None:
        """Variables found from all blocks, and attributes of those there are."""
        with plainly(self.path):
            self._forget([str(name) for name in more.variables])
            group = self._group()
            for name, about in attrs.items():
                group[name].attrs.update(about)
            said = more.assign_attrs(self.attrs)
            said.to_zarr(self.path, mode="a", zarr_format=2, consolidated=True)

    def _open(self) -> xr.Dataset:
        return xr.open_zarr(self.path, chunks=None)

    def _group(self) -> Any:
        return zarr.open_group(self.path, mode="r+", use_consolidated=False)

    def _meet(self, part: xr.Dataset) -> None:
        """Begin the folder, or see that the one there by now is of the same sweep."""
        if self._met:
            if not self.path.exists():
                raise StoreError(
                    f"{self.path} is gone: it was moved or deleted while the sweep ran."
                )
            return
        if not self.path.exists():
            self._begin(part)
        there = self._check()
        if any(there[dim] != size for dim, size in self.block.items()):
            raise StoreError(
                f"{self.path} was begun meanwhile by another run, in other blocks; run this again to "
                "help it."
            )
        self._met = True

    def _forget(self, names: list[str]) -> None:
        """Take variables out of what readers are told of, then away, also halves of them."""
        listed = self.path / ".zmetadata"
        about = json.loads(listed.read_text())
        kept = about["metadata"].items()
        about["metadata"] = {path: one for path, one in kept if path.partition("/")[0] not in names}
        draft = listed.with_suffix(".partial")
        draft.write_bytes(json.dumps(about).encode())
        draft.replace(listed)
        for name in names:
            shutil.rmtree(self.path / name, ignore_errors=True)

    def _begin(self, part: xr.Dataset) -> None:
        """The folder with all variables, nothing computed; there at once or not at all.

        It is written for the first lane and grown, which takes no time: what is not there is not
        computed, but for `status`, which says so.
        """
        first = {
            dim: (dim, values[:1] if dim in self.block else values, about)
            for dim, (_, values, about) in self.coords.items()
        }
        seed = whole_of(part, first, empty=True).assign_attrs(self.attrs)
        sizes = {dim: len(values) for dim, (_, values, _) in self.coords.items()}
        chunks = sizes | {str(dim): n for dim, n in seed.sizes.items()} | self.block
        encoding = {
            str(name): {"chunks": tuple(chunks[str(dim)] for dim in one.dims)}
            for name, one in seed.data_vars.items()
        } | {dim: {"chunks": (sizes[dim],)} for dim in self.block}
        files: dict[str, Any] = {}  # one after the other onto the disk: none comes after an error
        memory = zarr.storage.MemoryStore(files)
        seed.to_zarr(memory, zarr_format=2, consolidated=False, encoding=encoding)
        group: Any = zarr.open_group(memory, mode="r+", use_consolidated=False)
        for name, one in seed.variables.items():
            group[str(name)].resize([sizes.get(str(dim), n) for dim, n in one.sizes.items()])
        for dim in self.block:
            group[dim][:] = self.coords[dim][1]
        group["status"][:] = PENDING
        zarr.consolidate_metadata(memory, zarr_format=2)
        parent = self.path.absolute().parent
        parent.mkdir(parents=True, exist_ok=True)
        draft = Path(tempfile.mkdtemp(prefix=".begun-", dir=parent))
        try:
            inside = draft / self.path.name
            for name, content in files.items():
                (inside / name).parent.mkdir(parents=True, exist_ok=True)
                (inside / name).write_bytes(content.to_bytes())
            try:
                inside.rename(self.path)
            except OSError:
                if not self.path.exists():  # another process may have begun it meanwhile
                    raise
        finally:
            shutil.rmtree(draft, ignore_errors=True)

    def _check(self) -> dict[str, int]:
        """Refuse a folder that holds anything else; the size of its blocks."""
        try:
            there = self._open()
            status = there["status"]
        except (KeyError, ValueError, OSError):
            raise ValueError(
                f"{self.path} exists and is no store of a sweep; choose another."
            ) from None
        if status.dims != tuple(self.coords):
            is_, wanted = (
                ", ".join(f"`{dim}`" for dim in dims) for dims in (status.dims, self.coords)
            )
            raise OtherSweepError(
                f"{self.path} holds a sweep over {is_}, not over {wanted}; choose another store, or "
                "delete it."
            )
        for name, (dim, values, _) in self.coords.items():
            if name not in there.coords or not np.array_equal(there[name].values, values):
                raise OtherSweepError(
                    f"{self.path} holds a sweep over other values of `{dim}`; choose another store, or "
                    "delete it."
                )
        for name, value in self.attrs.items():
            if there.attrs.get(name) != value:
                texts = (" ".join(str(v).split()) for v in (there.attrs.get(name), value))
                is_, wanted = (text[:SHOWN] for text in texts)
                raise OtherSweepError(
                    f"{self.path} holds another sweep: its `{name}` is {is_!r}, not {wanted!r}; choose "
                    "another store, or delete it."
                )
        return dict(zip(map(str, status.dims), status.encoding["chunks"], strict=True))
