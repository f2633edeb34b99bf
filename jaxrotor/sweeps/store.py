"""Store: blocks of a data set on disk as soon as they are computed, so that a stopped sweep resumes.

A store is a folder in Zarr format, which `xarray.open_zarr` reads at any time. A block is one chunk of
every variable; each file is put in place whole, that of `status` last, which is `not_computed` until
then. `docs/concepts/stores.md` describes how it is begun, resumed and shared by processes.
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
from .grid import Block, is_block, place_of, whole_of


PENDING = STATUS.index("not_computed")
SHOWN = 60  # characters of a value in a message


class OtherSweepError(ValueError):
    """The folder of a store holds another sweep, or one over other values."""


class StoreError(RuntimeError):
    """A store can no longer be written; the message says why, and what is kept."""


@contextlib.contextmanager
def explained_errors(path: Path) -> Iterator[None]:
    """Errors of the operating system, as a `StoreError` that says why and what is kept."""
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
    """A data set in a folder, put together from blocks by one thread at a time.

    The first block begins the folder. Other processes may put other blocks: no two write the same file.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        coords: Mapping[str, Any],
        attrs: Mapping[str, Any],
        block: Mapping[str, int],
    ):
        self.path, self.coords, self.attrs = Path(path), coords, dict(attrs)
        self.block, self._checked = dict(block), False
        if self.path.exists():
            self.block = self._check()
            self._checked = True

    def __getstate__(self) -> dict[str, Any]:  # another process may run in another folder
        return self.__dict__ | {"path": self.path.absolute()}

    takes = staticmethod(is_block)

    def pending(self, blocks: list[Block]) -> list[Block]:
        """The blocks that are still to be computed."""
        if not self.path.exists():
            return blocks
        status = self._open()["status"]
        pending = status.values == PENDING
        return [block for block in blocks if pending[place_of(block, status.dims)].any()]

    def put(self, block: Block, part: xr.Dataset) -> None:
        """Write a block: its status when all else is written."""
        last = ["status"]
        with explained_errors(self.path):
            self._begin_or_check(part)
            # Chunks are written whatever their values, so that a lost one is noticed.
            with zarr.config.set({"array.write_empty_chunks": True}):
                group = self._group()
                for name in [name for name in part.data_vars if name not in last] + last:
                    array = part[name]
                    group[str(name)][place_of(block, array.dims)] = array.values

    def finished(self) -> xr.Dataset:
        """The whole data set, whose values are read when they are used."""
        return self._open()

    def add(self, more: xr.Dataset, attrs: Mapping[str, Mapping[str, Any]]) -> None:
        """Add variables that were computed from all blocks, and attributes to those that exist."""
        with explained_errors(self.path):
            self._remove([str(name) for name in more.variables])
            group = self._group()
            for name, own in attrs.items():
                group[name].attrs.update(own)
            more = more.assign_attrs(self.attrs)
            more.to_zarr(self.path, mode="a", zarr_format=2, consolidated=True)

    def _open(self) -> xr.Dataset:
        return xr.open_zarr(self.path, chunks=None)

    def _group(self) -> Any:
        return zarr.open_group(self.path, mode="r+", use_consolidated=False)

    def _begin_or_check(self, part: xr.Dataset) -> None:
        """Begin the folder, or check that another process has begun the same sweep in it."""
        if self._checked:
            if not self.path.exists():
                raise StoreError(
                    f"{self.path} is gone: it was moved or deleted while the sweep ran."
                )
            return
        if not self.path.exists():
            self._begin(part)
        sizes = self._check()
        if any(sizes[dim] != size for dim, size in self.block.items()):
            raise StoreError(
                f"{self.path} was begun meanwhile by another run, in other blocks; run this again to "
                "join it."
            )
        self._checked = True

    def _remove(self, names: list[str]) -> None:
        """Remove variables from the metadata that readers use, then their files, complete or not."""
        file = self.path / ".zmetadata"
        content = json.loads(file.read_text())
        entries = content["metadata"].items()
        content["metadata"] = {
            path: entry for path, entry in entries if path.partition("/")[0] not in names
        }
        draft = file.with_suffix(".partial")
        draft.write_bytes(json.dumps(content).encode())
        draft.replace(file)
        for name in names:
            shutil.rmtree(self.path / name, ignore_errors=True)

    def _begin(self, part: xr.Dataset) -> None:
        """Begin the folder with all variables and nothing computed: there at once or not at all."""
        files = self._files_of_nothing_computed(part)
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

    def _files_of_nothing_computed(self, part: xr.Dataset) -> dict[str, Any]:
        """Contents by file name of a store in which nothing is computed.

        The store is written for the first lane and then enlarged, which takes no time: a chunk that
        has no file is not computed. Only `status` has files, which say so.
        """
        first = {
            name: (dim, values[:1] if dim in self.block else values, attrs)
            for name, (dim, values, attrs) in self.coords.items()
        }
        seed = whole_of(part, first, empty=True).assign_attrs(self.attrs)
        sizes = {dim: len(values) for dim, values, _ in self.coords.values()}
        cut = {name: dim for name, (dim, _, _) in self.coords.items() if dim in self.block}
        chunks = sizes | {str(dim): n for dim, n in seed.sizes.items()} | self.block
        encoding = {
            str(name): {"chunks": tuple(chunks[str(dim)] for dim in array.dims)}
            for name, array in seed.data_vars.items()
        } | {name: {"chunks": (sizes[dim],)} for name, dim in cut.items()}
        # Through memory, because files are then written to disk one by one: none comes after an error.
        files: dict[str, Any] = {}
        memory = zarr.storage.MemoryStore(files)
        seed.to_zarr(memory, zarr_format=2, consolidated=False, encoding=encoding)
        group: Any = zarr.open_group(memory, mode="r+", use_consolidated=False)
        for name, array in seed.variables.items():
            group[str(name)].resize([sizes.get(str(dim), n) for dim, n in array.sizes.items()])
        for name in cut:
            group[name][:] = self.coords[name][1]
        group["status"][:] = PENDING
        zarr.consolidate_metadata(memory, zarr_format=2)
        return files

    def _check(self) -> dict[str, int]:
        """Size of the blocks in the folder; raise unless it holds this sweep."""
        try:
            stored = self._open()
            status = stored["status"]
        except (KeyError, ValueError, OSError):
            raise ValueError(
                f"{self.path} exists and is no store of a sweep; choose another."
            ) from None
        own = tuple(dict.fromkeys(dim for dim, _, _ in self.coords.values()))
        if status.dims != own:
            present, wanted = (", ".join(f"`{dim}`" for dim in dims) for dims in (status.dims, own))
            raise OtherSweepError(
                f"{self.path} holds a sweep over {present}, not over {wanted}; choose another store, or "
                "delete it."
            )
        for name, (dim, values, _) in self.coords.items():
            if name not in stored.coords or not np.array_equal(stored[name].values, values):
                raise OtherSweepError(
                    f"{self.path} holds a sweep over other values of `{dim}`; choose another store, or "
                    "delete it."
                )
        for name, value in self.attrs.items():
            if stored.attrs.get(name) != value:
                texts = (" ".join(str(v).split()) for v in (stored.attrs.get(name), value))
                present, wanted = (text[:SHOWN] for text in texts)
                raise OtherSweepError(
                    f"{self.path} holds another sweep: its `{name}` is {present!r}, not {wanted!r}; "
                    "choose another store, or delete it."
                )
        return dict(zip(map(str, status.dims), status.encoding["chunks"], strict=True))
