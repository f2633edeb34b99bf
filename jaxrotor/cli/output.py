"""Output: files of a run, written all or none."""

import contextlib
import os
import shutil
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import typer

from ..files.toml import dumps
from ..results.provenance import assumed, versions
from ..scene import Scene
from . import answer
from .axis_units import stored


class Files(NamedTuple):
    """Data and pictures of a run that are written in a folder `out`, or not where that is None."""

    out: Path | None
    names: Sequence[str]  # the first is that of the data
    units: Mapping[str, Any]  # in which they are drawn, see `axis_units`
    draft: Path  # folder in which they are until all are written

    def data(self, dataset: Any) -> None:
        """Write the data of the run."""
        write_dataset(dataset, self.draft / self.names[0], self.units)

    def picture(
        self, name: str, plot: Callable[[Any], Any], width: int, height: int, rows: int = 1
    ) -> None:
        """Write a picture [mm] of `plot(axes)`, see `draw`."""
        draw(self.draft / name, plot, width, height, rows, self.units)

    @property
    def written(self) -> list[str]:
        """Paths of the files that were written."""
        return written_to(self.out, self.names)

    @property
    def rows(self) -> answer.Rows:
        """Table rows that name these files."""
        return answer.written(self.written)


@contextlib.contextmanager
def files_in(
    out: Path | None, names: Sequence[str], overwrite: bool, units: Mapping[str, Any]
) -> Iterator[Files]:
    """`Files` of names in a folder, moved there at the end; see `draft`."""
    with (
        contextlib.nullcontext(Path(os.devnull))
        if out is None
        else draft(out, names, overwrite) as folder
    ):
        yield Files(out, names, units, folder)


@contextlib.contextmanager
def draft(
    out: Path, names: Sequence[str], overwrite: bool, *, unfinished: str = ""
) -> Iterator[Path]:
    """A hidden folder inside `out` to write into; its files are moved to `out` at the end.

    Existing files of `names` are replaced with `overwrite` and an error without; other files are left
    alone. Data are not written beside those of another command; the `unfinished` store of this
    command may be there. After any error, Ctrl-C included, `out` is as it was before.
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
            with contextlib.suppress(OSError):  # folders with files stay
                folder.rmdir()


@contextlib.contextmanager
def draft_of(file: Path, overwrite: bool) -> Iterator[Path]:
    """Draft of one file, whose name is printed once it is written."""
    with draft(file.parent, [file.name], overwrite) as folder:
        yield folder / file.name
    typer.echo(f"Written: {file}.")


def _check_own(out: Path, names: set[str]) -> None:
    """Raise if a folder holds the data of another command."""
    others = sorted(path.name for path in out.glob("*.zarr") if path.name not in names)
    if others:
        raise ValueError(
            f"{out} holds the data of another command ({', '.join(others)}); choose another --out."
        )


def _publish(folder: Path, out: Path, present: Sequence[Path]) -> None:
    """Move old files away and new ones in; undo all of it if a move fails."""
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
    """Paths of the files of a run that were written."""
    return [] if out is None else [str(out / name) for name in names if (out / name).exists()]


def labelled(
    variables: Mapping[str, Any], coordinates: Mapping[str, Any], title: str, scene: Scene
) -> Any:
    """`xarray.Dataset` of variables and coordinates, with the scene and the software versions."""
    import xarray as xr  # takes a second, so only where data are written

    about = {"title": title, "scene": dumps(scene), **assumed(scene), "versions": versions()}
    return xr.Dataset(variables, coordinates, about)


def write_dataset(dataset: Any, path: Path, units: Mapping[str, Any]) -> None:
    """Write a dataset in Zarr format 2, where texts and consolidated metadata are standard.

    It keeps the units in which it is drawn and written, see `axis_units`.
    """
    dataset.assign_attrs(stored(units)).to_zarr(path, zarr_format=2, consolidated=True)


def draw(
    path: Path,
    plot: Callable[[Any], Any],
    width: float | int,
    height: float | int,
    rows: int = 1,
    units: Mapping[str, Any] | None = None,
) -> None:
    """Write a picture [mm] of `plot(axes)`, without a window; report on stderr if it cannot be drawn.

    Speeds and lengths are drawn in `units`, see `axis_units`.

    An error would discard the data, which are already written.
    """
    from ..plot import units as drawn_in, write

    try:
        with drawn_in(**units or {}):
            write(path, plot, width, height, rows)
    except ValueError as error:
        typer.echo(f"{path.name} was not drawn: {error}", err=True)
