"""Document: headings, sentences, numbered tables and figures, as one HTML or PDF file."""

import html
import importlib.util
import io
import itertools
import os
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from string import Template
from typing import Any, NamedTuple

import matplotlib
from matplotlib import rc_context
from matplotlib.figure import Figure

from ..core.tables import FAIL, html_table
from ..files.draft import replacing
from .page import STYLE, inches
from .report import TEMPLATE, image


ENDINGS = (".html", ".pdf")
NO_PDF = (
    "Writing .pdf needs the package fpdf2, which is not installed; add it by `pip install fpdf2`, or "
    "write .html."
)
_DPI = 200
_FONT = "DejaVu"
_MARGIN, _WIDTH = 18.0, 174.0  # mm of an A4 page
_RED = (180, 30, 20)


class Heading(NamedTuple):
    """Heading of a section."""

    text: str


class Sentence(NamedTuple):
    """A paragraph."""

    text: str


class Table(NamedTuple):
    """Table below its caption; columns in `numbers` are aligned to the right, `FAIL` is red."""

    caption: str
    heads: Sequence[str]
    rows: Sequence[Sequence[str]]
    numbers: Sequence[int] = ()


class Picture(NamedTuple):
    """Figure above its caption: `draw(axes)` in new Axes of a size [mm]."""

    caption: str
    draw: Callable[[Any], Any]
    width: int = 170
    height: int = 90
    rows: int = 1
    columns: int = 1


Part = Heading | Sentence | Table | Picture
Paths = str | os.PathLike[str] | Sequence[str | os.PathLike[str]]


class _Drawn(NamedTuple):
    """PNG of a picture, with its height over its width."""

    caption: str
    png: bytes
    ratio: float


def write_document(paths: Paths, title: str, parts: Sequence[Part]) -> None:
    """Write a document to .html, .pdf or both; an existing file is replaced once the new one is complete.

    Args:
        paths: the file, or several, each of which ends in .html or .pdf; the latter needs
            `pip install 'jaxrotor[pdf]'`. Pictures are drawn once for all.
        title: heading of the document.
        parts: its parts in order; tables and figures are numbered.

    Raises:
        ValueError: an ending is another one, or the package for PDF is not installed.
    """
    targets = [Path(one) for one in ([paths] if isinstance(paths, str | os.PathLike) else paths)]
    for target in targets:
        if target.suffix not in ENDINGS:
            raise ValueError(f"A document ends in {' or '.join(ENDINGS)}, but is {target.name}.")
        if target.suffix == ".pdf" and not writes_pdf():
            raise ValueError(NO_PDF)
    drawn = list(_numbered(parts))
    for target in targets:
        with replacing(target) as draft:
            if target.suffix == ".html":
                draft.write_text(_html(title, drawn), "utf-8", newline="\n")
            else:
                draft.write_bytes(_pdf(title, drawn))


def writes_pdf() -> bool:
    """Whether the package that writes PDF is installed."""
    return importlib.util.find_spec("fpdf") is not None


def _numbered(parts: Sequence[Part]) -> Iterator[Heading | Sentence | Table | _Drawn]:
    """The parts, with "Table 3: " and "Figure 2: " before their captions, and pictures drawn."""
    tables, figures = itertools.count(1), itertools.count(1)
    for part in parts:
        if isinstance(part, Table):
            yield part._replace(caption=f"Table {next(tables)}: {part.caption}")
        elif isinstance(part, Picture):
            caption = f"Figure {next(figures)}: {part.caption}"
            yield _Drawn(caption, _png(part), part.height / part.width)
        else:
            yield part


def _png(picture: Picture) -> bytes:
    """PNG of a picture."""
    buffer = io.BytesIO()
    with rc_context(STYLE):
        size = inches(picture.width, picture.height)
        figure = Figure(figsize=size, dpi=_DPI, layout="constrained")
        picture.draw(figure.subplots(picture.rows, picture.columns, sharex=picture.columns == 1))
        figure.savefig(buffer, format="png")
    return buffer.getvalue()


def _html(title: str, parts: Sequence[Any]) -> str:
    lines = []
    for part in parts:
        match part:
            case Heading(text):
                lines.append(f"<h2>{html.escape(text)}</h2>")
            case Sentence(text):
                lines.append(f"<p>{html.escape(text)}</p>")
            case Table():
                lines.append(f"<h3>{html.escape(part.caption)}</h3>")
                lines.append(html_table(part.rows, part.heads, part.numbers))
            case _Drawn():
                lines.append(image(part.png, "png", part.caption))
    text = Template(TEMPLATE.read_text("utf-8"))
    return text.substitute(title=html.escape(title), body="\n".join(lines))


def _pdf(title: str, parts: Sequence[Any]) -> bytes:
    from fpdf import FPDF
    from fpdf.fonts import FontFace

    fonts = Path(matplotlib.get_data_path()) / "fonts" / "ttf"
    pdf = FPDF()
    pdf.set_title(title)
    pdf.set_margin(_MARGIN)
    pdf.add_font(_FONT, "", fonts / "DejaVuSans.ttf")
    pdf.add_font(_FONT, "B", fonts / "DejaVuSans-Bold.ttf")
    pdf.add_page()

    def text(size: int, words: str, style: str = "", after: int = 2) -> None:
        pdf.set_font(_FONT, style, size)
        pdf.multi_cell(0, 0.5 * size, words, align="L", new_x="LMARGIN", new_y="NEXT")
        pdf.ln(after)

    text(15, title, "B", 4)
    for part in parts:
        match part:
            case Heading(words):
                if pdf.get_y() > 0.8 * pdf.h:
                    pdf.add_page()
                text(12, words, "B")
            case Sentence(words):
                text(9, words)
            case _Drawn():
                height = _WIDTH * part.ratio
                if pdf.get_y() + height + 12 > pdf.h - _MARGIN:
                    pdf.add_page()
                pdf.image(io.BytesIO(part.png), w=_WIDTH, h=height)
                text(8, part.caption, after=4)
            case Table():
                if pdf.get_y() > 0.85 * pdf.h:
                    pdf.add_page()
                text(8, part.caption, "B", 1)
                pdf.set_font(_FONT, "", 7)
                failed = FontFace(color=_RED, emphasis="BOLD")
                aligned = ["RIGHT" if k in part.numbers else "LEFT" for k in range(len(part.heads))]
                widths = _widths(part)
                options: Any = {"text_align": aligned, "col_widths": widths, "line_height": 4.0}
                with pdf.table(borders_layout="HORIZONTAL_LINES", **options) as table:
                    table.row(list(part.heads))
                    for cells in part.rows:
                        row = table.row()
                        for cell in cells:
                            row.cell(cell, style=failed if cell == FAIL else None)
                pdf.ln(4)
    return bytes(pdf.output())


def _widths(table: Table) -> list[int]:
    """Relative widths of the columns: that of the longest text, within bounds."""
    columns = zip(table.heads, *table.rows, strict=True)
    return [min(max(6, *map(len, column)) + 2, 60) for column in columns]
