"""Answer: output of a command on stdout, as tables or as JSON."""

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Annotated, Any

import numpy as np
import typer


AsJson = Annotated[bool, typer.Option("--json", help="Print JSON on stdout and nothing else.")]


def print_json(answer: Mapping[str, Any]) -> None:
    """Print valid JSON: arrays as lists, complex numbers as re and im, infinity and NaN as null."""
    typer.echo(json.dumps(_plain(answer), indent=2, allow_nan=False))


def print_table(
    rows: Iterable[Sequence[str]], heads: Sequence[str] = (), numbers: Sequence[int] = ()
) -> None:
    """Print rows of text under their heads, with the columns in `numbers` right-aligned."""
    from rich import box
    from rich.console import Console
    from rich.table import Table

    rows = list(rows)
    if not rows and not heads:
        return
    table = Table(box=box.SIMPLE_HEAD if heads else None, show_header=bool(heads), pad_edge=False)
    for i in range(len(rows[0]) if rows else len(heads)):
        justify = "right" if i in numbers else "left"
        whole = i == 0 and bool(heads)  # names, such as paths, to be copied
        head = heads[i] if heads else ""
        table.add_column(head, justify=justify, overflow="fold", no_wrap=whole)
    for row in rows:
        table.add_row(*row)
    Console(markup=False, highlight=False, emoji=False).print(table)


def written(paths: Sequence[str]) -> list[tuple[str, str]]:
    """Table rows that name the files written by a run."""
    return [("written" if i == 0 else "", path) for i, path in enumerate(paths)]


def _plain(value: Any) -> Any:
    match value:
        case None | bool() | int() | str():
            return value
        case float():
            return float(value) if math.isfinite(value) else None
        case complex():
            return {"re": _plain(value.real), "im": _plain(value.imag)}
        case Mapping():
            return {str(key): _plain(item) for key, item in value.items()}
        case list() | tuple():
            return [_plain(item) for item in value]
        case _:
            return _plain(np.asarray(value).tolist())


def assumed(assumption: str) -> list[tuple[str, str]]:
    """Table row with the assumption of a scene; no row if there is none."""
    return [("note", assumption)] if assumption else []


def note_large(radius: float, length: float) -> None:
    """Print a note on stderr if a motion exceeds the theory of small deflections."""
    if radius > length / 10:
        typer.echo(
            f"Note: the largest radius, {radius:.3g} m, exceeds a tenth of the shaft's length, "
            f"{length:.3g} m, so the theory of small deflections no longer holds.",
            err=True,
        )
