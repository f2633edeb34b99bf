"""Tables in HTML, for reports and for the display of results in notebooks."""

import html
from collections.abc import Sequence
from typing import Any

import numpy as np


MOST = 24  # rows of a result to show in a notebook
RPM = 30 / np.pi  # rpm in one rad/s
FAIL = "FAIL"  # text of a cell that says that a demand is not met


def html_table(
    rows: Sequence[Sequence[str]], heads: Sequence[str] = (), numbers: Sequence[int] = ()
) -> str:
    """Table with `heads` above its `rows`; columns listed in `numbers` are aligned to the right.

    Cells of the text `FAIL` have the class "fail".
    """
    head = "".join(f"<th>{html.escape(text)}</th>" for text in heads)
    lines = [f"<tr>{head}</tr>"] if heads else []
    for row in rows:
        cells = (
            f'<td{_class_of(text, column in numbers)} style="text-align: '
            f'{"right" if column in numbers else "left"}">{html.escape(text)}</td>'
            for column, text in enumerate(row)
        )
        lines.append(f"<tr>{''.join(cells)}</tr>")
    return "<table>\n" + "\n".join(lines) + "\n</table>"


def _class_of(text: str, number: bool) -> str:
    """Attribute of a cell with its class, if it has one."""
    name = "fail" if text == FAIL else "number" if number else ""
    return f' class="{name}"' if name else ""


def notebook_table(
    caption: str, heads: Sequence[str], rows: Sequence[Sequence[Any]], most: int = MOST
) -> str:
    """HTML of a result in a notebook: a caption, and a table of texts and numbers.

    Of more than `most` rows the first and the last are shown. Columns with texts are aligned to the left.
    """
    texts = [[_cell(one) for one in row] for row in rows]
    if len(texts) > most:
        half, left_out = most // 2, len(texts) - 2 * (most // 2)
        texts = [
            *texts[:half],
            [f".. {left_out} more ..", *[""] * (len(heads) - 1)],
            *texts[-half:],
        ]
    right = [i for i in range(len(heads)) if not any(isinstance(row[i], str) for row in rows)]
    sentence = "<br/>".join(map(html.escape, caption.split("\n")))
    table = html_table(texts, heads, right) if texts else ""
    return f"<div><p>{sentence}</p>\n{table}</div>"


def largest_rows(names: Any, sizes: Any, *beside: Any) -> list[tuple]:
    """Rows of names: the largest number in the column of each, and what stands `beside` it."""
    sizes = np.asarray(sizes)
    places = np.argmax(sizes, axis=0).tolist()
    pairs = enumerate(zip(names, places, strict=True))
    return [(name, sizes[k, i], *(column[k] for column in beside)) for i, (name, k) in pairs]


def _cell(value: Any) -> str:
    """A text as it is, a number with six digits."""
    if value is None or isinstance(value, str):
        return value or ""
    return f"{np.asarray(value).item() + 0.0:.6g}"  # no -0
