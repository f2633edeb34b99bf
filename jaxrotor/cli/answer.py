"""Answer: output of a command on stdout, as tables or as JSON."""

import json
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, NamedTuple

import typer

from ..core.plain import plain


AsJson = Annotated[bool, typer.Option("--json", help="Print JSON on stdout and nothing else.")]
Rows = list[tuple[str, str]]  # names and values


class Table(NamedTuple):
    """Rows of text under their heads, with the columns in `numbers` right-aligned."""

    rows: Sequence[Sequence[str]]
    heads: Sequence[str] = ()
    numbers: Sequence[int] = ()


def give(as_json: bool, facts: Mapping[str, Any], *shown: str | Table | Rows) -> None:
    """Print an answer: all its facts as JSON, else what is `shown` of them, sentences and tables.

    Tables without rows are left out.
    """
    if as_json:
        print_json(facts)
        return
    for part in shown:
        if isinstance(part, str):
            typer.echo(part)
        else:
            _print_table(part if isinstance(part, Table) else Table(part))


def print_json(answer: Mapping[str, Any]) -> None:
    """Print valid JSON, see `plain`."""
    typer.echo(json.dumps(plain(answer), indent=2, allow_nan=False))


def _print_table(table: Table) -> None:
    from rich import box
    from rich.console import Console
    from rich.table import Table as Printed

    rows, heads, numbers = table
    if not rows:
        return
    printed = Printed(
        box=box.SIMPLE_HEAD if heads else None, show_header=bool(heads), pad_edge=False
    )
    for i in range(len(rows[0])):
        justify = "right" if i in numbers else "left"
        whole = i == 0 and bool(heads)  # names, such as paths, to be copied
        head = heads[i] if heads else ""
        printed.add_column(head, justify=justify, overflow="fold", no_wrap=whole)
    for row in rows:
        printed.add_row(*row)
    Console(markup=False, highlight=False, emoji=False).print(printed)


def filled(rows: Mapping[str, Any]) -> Rows:
    """Table rows by their names, without those that have no text."""
    return [(name, text) for name, text in rows.items() if text]


def written(paths: Sequence[str]) -> Rows:
    """Table rows that name the files written by a run."""
    return [("written" if i == 0 else "", path) for i, path in enumerate(paths)]


def assumed(assumption: str) -> Rows:
    """Table row with the assumption of a scene; no row if there is none."""
    return filled({"note": assumption})


def note(sentence: str) -> None:
    """Print a note on stderr."""
    typer.echo(f"Note: {sentence}", err=True)


def note_large(radius: float, length: float) -> None:
    """Print a note on stderr if a motion exceeds the theory of small deflections."""
    if radius > length / 10:
        note(
            f"the largest radius, {radius:.3g} m, exceeds a tenth of the shaft's length, {length:.3g} m, "
            "so the theory of small deflections no longer holds."
        )
