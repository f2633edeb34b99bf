"""Sheet: cells of a table file, of CSV or of a workbook of Excel, row by row."""

import contextlib
import csv
import importlib.util
import io
import os
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from ...core.checks import suggest
from ..units import refuse


_SEPARATORS = (";", "\t", ",")


class Sheet(NamedTuple):
    """Rows of cells, which are texts, numbers, truth values, or None if they are empty."""

    source: str  # name of the file, with that of the sheet, for error messages
    rows: list[list[Any]]
    separator: str | None = None  # of CSV


def sheets(path: str | os.PathLike[str], name: str | None) -> list[Sheet]:
    """Sheets of a workbook, or that of a `name`; of CSV one for each separator that it may have."""
    source, file = os.fspath(path), Path(path)
    if not os.path.isfile(file):
        beside = [one.name for one in file.parent.glob("*") if one.is_file()]
        near = suggest(file.name, beside)
        refuse(source, f"is not a file{near}; give the path of a table in CSV or Excel.")
    if file.suffix.lower() in _EXCEL:
        return _of_workbook(file, source, name)
    if name is not None:
        refuse(source, f"is no workbook of Excel, so it has no sheet {name!r}; leave out `sheet`.")
    text = _text(file, source)
    try:
        rows = {k: list(csv.reader(io.StringIO(text, ""), delimiter=k)) for k in _SEPARATORS}
    except csv.Error as error:
        refuse(source, f"is not valid CSV ({error}); save the table anew.")
    return [Sheet(source, list(map(_cells, own)), one) for one, own in rows.items()]


def _text(file: Path, source: str) -> str:
    """Text of a file; one that is not in UTF is in the encoding of Windows."""
    try:
        content = file.read_bytes()
    except OSError as error:
        refuse(source, f"cannot be read ({error.strerror or error}); give a table in CSV or Excel.")
    if content.startswith((b"\xff\xfe", b"\xfe\xff")):
        return content.decode("utf-16", "replace")
    if b"\0" in content:
        refuse(source, "is no text; save the table as CSV, or in a workbook that ends in .xlsx.")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("cp1252", "replace")


def _of_workbook(file: Path, source: str, name: str | None) -> list[Sheet]:
    """Sheets of a workbook, or that of a `name`."""
    needed, read = _EXCEL[file.suffix.lower()]
    if importlib.util.find_spec(needed) is None:
        refuse(
            source,
            f"needs the package {needed}, which is not installed; add it by `pip install {needed}`, or "
            "save the table as CSV.",
        )
    try:
        with warnings.catch_warnings():  # of parts of a workbook that are no cells
            warnings.simplefilter("ignore")
            rows = dict(read(file))
    except Exception as error:  # those of the packages, of zipfile and of the XML in a workbook
        refuse(source, f"cannot be read as a workbook of Excel ({error}); save it anew as .xlsx.")
    if not rows or name not in (None, *rows):
        names = ", ".join(map(repr, rows)) or "none"
        refuse(source, f"has no sheet {name or 'of cells'!r}; its sheets are {names}.")
    return [
        Sheet(f"{source} [{one}]", list(map(_cells, own)))
        for one, own in rows.items()
        if name in (None, one)
    ]


def _of_openpyxl(file: Path) -> Iterator[tuple[str, list[list[Any]]]]:
    """Names and rows of the sheets of a workbook in XML."""
    import openpyxl

    book = openpyxl.load_workbook(file, read_only=True, data_only=True)
    with contextlib.closing(book):
        for page in book.worksheets:
            page.reset_dimensions()  # a stray cell far off would widen every row
            yield page.title, [list(row) for row in page.iter_rows(values_only=True)]


def _of_xlrd(file: Path) -> Iterator[tuple[str, list[list[Any]]]]:
    """Names and rows of the sheets of an older workbook."""
    import xlrd

    def value(cell: Any) -> Any:
        if cell.ctype == xlrd.XL_CELL_DATE:
            return xlrd.xldate_as_datetime(cell.value, book.datemode)
        if cell.ctype == xlrd.XL_CELL_ERROR:
            return xlrd.error_text_from_code[cell.value]
        return bool(cell.value) if cell.ctype == xlrd.XL_CELL_BOOLEAN else cell.value

    with xlrd.open_workbook(str(file), logfile=io.StringIO(), ragged_rows=True) as book:
        for page in book.sheets():
            yield page.name, [list(map(value, page.row(row))) for row in range(page.nrows)]


_EXCEL = {
    ".xlsx": ("openpyxl", _of_openpyxl),
    ".xlsm": ("openpyxl", _of_openpyxl),
    ".xls": ("xlrd", _of_xlrd),
}


def _cells(row: list[Any]) -> list[Any]:
    """Cells of a row without spaces around texts; those at its end that are empty are left out."""
    cells = [(cell.strip() or None) if isinstance(cell, str) else cell for cell in row]
    while cells and cells[-1] is None:
        cells.pop()
    return cells
