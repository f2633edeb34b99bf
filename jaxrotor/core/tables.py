"""Tables: rows of text as HTML, for reports and for what notebooks show of a result."""

import html
from collections.abc import Sequence
from typing import Any

import numpy as np


MOST = 24  # rows a notebook shows of a result
RPM = 30 / np.pi  # of a rad/s


def html_table(
    rows: Sequence[Sequence[str]], heads: Sequence[str] = (), numbers: Sequence[int] = ()
) -> str:
    """Rows under their heads; the columns in `numbers` to the right."""
    head = "".join(f"<th>{html.escape(text)}</th>" for text in heads)
    lines = [f"<tr>{head}</tr>"] if heads else []
    for row in rows:
        cells = (
            f'<td class="number" style="text-align: right">{html.escape(text)}</td>'
            if column in numbers
            else f'<td style="text-align: left">{html.escape(text)}</td>'
            for column, text in enumerate(row)
        )
        lines.append(f"<tr>{''.join(cells)}</tr>")
    return "<table>\n" + "\n".join(lines) + "\n</table>"


def notebook_table(
    caption: str, heads: Sequence[str], rows: Sequence[Sequence[Any]], most: int = MOST
) -> str:
    """What a notebook shows of a result: a sentence, and a table of texts and numbers.

    Of many rows the first and the last; texts stand to the left.
    """
    told = [[_cell(one) for one in row] for row in rows]
    if len(told) > most:
        half, left_out = most // 2, len(told) - 2 * (most // 2)
        told = [*told[:half], [f".. {left_out} more ..", *[""] * (len(heads) - 1)], *told[-half:]]
    right = [i for i in range(len(heads)) if not any(isinstance(row[i], str) for row in rows)]
    said = "<br/>".join(map(html.escape, caption.split("\n")))
    table = html_table(told, heads, right) if told else ""
    return f"<div><p>{said}</p>\n{table}</div>"


def _cell(value: Any) -> str:
    """A text as it is, a number with six digits."""
    if value is None or isinstance(value, str):
        return value or ""
    return f"{np.asarray(value).item() + 0.0:.6g}"  # no -0
