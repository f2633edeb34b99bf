"""Output: files of a run, all of them or none."""

import contextlib
import os
import shutil
import tempfile
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import typer

from ..files.toml import dumps
from ..results.provenance import assumed, versions
from ..scene import Scene


def draft_or_none(
    out: Path | None, names: Sequence[str], overwrite: bool
) -> contextlib.AbstractContextManager[Path | None]:
    """`draft`, or None where nothing is to be written."""
    return contextlib.nullcontext() if out is None else draft(out, names, overwrite)


@contextlib.contextmanager
def draft(
    out: Path, names: Sequence[str], overwrite: bool, *, unfinished: str = ""
) -> Iterator[Path]:
    """A hidden folder inside `out` to write into; in the end all that is in it moves to `out`.

    Files of `names` that are in `out` already are refused, or else replaced; others are left alone. Data
    are not put beside those of another command, but for what is left `unfinished` of this one. When
    anything goes wrong, Ctrl-C included, `out` is as it was before.
    """
    present = [out / name for name in names if os.path.lexists(out / name)]
    if present and not overwrite:
        raise ValueError(
            f"{present[0]} exists already; add --overwrite to replace it, or choose another --out."
        )
    if any(name.endswith(".zarr") for name in names):
        _check_own(out, {*names, unfinished})
    missing = [folder for folder in (out, *out.parents) if not folder.exists()]
    try:
        out.mkdir(parents=True, exist_ok=True)
        folder = Path(tempfile.mkdtemp(prefix=".draft-", dir=out))
        try:
            yield folder
            _publish(folder, out, present)
        finally:
            shutil.rmtree(folder, ignore_errors=True)
    except OSError as error:
        reason = error.strerror or error
        raise ValueError(f"{out} cannot be written ({reason}); choose another --out.") from None
    finally:
        for folder in missing:
            with contextlib.suppress(OSError):  # not empty, as it should be
                folder.rmdir()


def _check_own(out: Path, names: set[str]) -> None:
    """Raise where a folder holds the data of another command."""
    others = sorted(path.name for path in out.glob("*.zarr") if path.name not in names)
    if others:
        raise ValueError(
            f"{out} holds the data of another command ({', '.join(others)}); choose another --out."
        )


def _publish(folder: Path, out: Path, present: Sequence[Path]) -> None:
    """Move old files away and new ones in, or nothing."""
    new = sorted(folder.iterdir())
    old = folder / "replaced"
    old.mkdir()
    moves = [(path, old / path.name) for path in present]
    moves += [(path, out / path.name) for path in new]
    done = []
    try:
        for source, target in moves:
            source.rename(target)
            done.append((source, target))
    except BaseException:
        for source, target in reversed(done):
            target.rename(source)
        raise


def written_to(out: Path | None, names: Sequence[str]) -> list[str]:
    """Those of the files of a run that were written."""
    return [] if out is None else [str(out / name) for name in names if (out / name).exists()]


def labelled(parts: tuple[dict[str, Any], dict[str, Any]], title: str, scene: Scene) -> Any:
    """`xarray.Dataset` of variables and coordinates, with the scene and the versions that made it."""
    import xarray as xr  # a second, so only where data are written

    about = {"title": title, "scene": dumps(scene), **assumed(scene), "versions": versions()}
    return xr.Dataset(*parts, about)


def write_dataset(dataset: Any, path: Path) -> None:
    """An `xarray.Dataset` in Zarr format 2: there texts and consolidated metadata are standard."""
    dataset.to_zarr(path, zarr_format=2, consolidated=True)


def draw(
    path: Path, plot: Callable[[Any], Any], width: float | int, height: float | int, rows: int = 1
) -> None:
    """A picture [mm] of `plot(axes)`, without a window; one that cannot be drawn is a remark.

    The picture is a view of data that are already written: it must not cost them.
    """
    from ..plot import write

    try:
        write(path, plot, width, height, rows)
    except ValueError as error:
        typer.echo(f"{path.name} was not drawn: {error}", err=True)
