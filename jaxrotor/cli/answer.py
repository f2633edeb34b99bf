"""Answer: what a command prints on stdout, for people or as JSON."""

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Annotated, Any

import numpy as np
import typer


AsJson = Annotated[bool, typer.Option("--json", help="Print JSON on stdout and nothing else.")]


def print_json(answer: Mapping[str, Any]) -> None:
    """Print valid JSON: arrays as lists, complex numbers as re and im, what is not finite as null."""
    typer.echo(json.dumps(_plain(answer), indent=2, allow_nan=False))


def print_table(
    rows: Iterable[Sequence[str]], heads: Sequence[str] = (), numbers: Sequence[int] = ()
) -> None:
    """Print rows of text under their heads; the columns in `numbers` to the right."""
    from rich import box
    from rich.console import Console
    from rich.table import Table

    rows = list(rows)
    if not rows and not heads:
        return
    table = Table(box=box.SIMPLE_HEAD if heads else None, show_header=bool(heads), pad_edge=False)
    for i in range(len(rows[0]) if rows else len(heads)):
        justify = "right" if i in numbers else "left"
        table.add_column(heads[i] if heads else "", justify=justify, overflow="fold")
    for row in rows:
        table.add_row(*row)
    Console(markup=False, highlight=False, emoji=False).print(table)


def written(paths: Sequence[str]) -> list[tuple[str, str]]:
    """Rows of a table that name the files of a run."""
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
    """A row of a table that says what is assumed of a scene, or none."""
    return [("note", assumption)] if assumption else []


def note_large(radius: float, length: float) -> None:
    """A note on stderr where a motion has left the theory of small deflections."""
    if radius > length / 10:
        typer.echo(
            f"Note: the largest radius, {radius:.3g} m, exceeds a tenth of the shaft's length, "
            f"{length:.3g} m, so the theory of small deflections no longer holds.",
            err=True,
        )
