"""Numerals: texts of a table as numbers, by the decimal mark of the whole table."""

import re
from collections.abc import Iterable

from ..units import refuse


_NUMERAL = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eEdD][+-]?\d+)?", re.ASCII)
_MARKED = re.compile(r"[+-]?\d*[.,][\d.,]*([eEdD][+-]?\d+)?", re.ASCII)
_GROUPED = re.compile(r"[+-]?[1-9]\d{0,2}([.,])\d{3}(\1\d{3})*", re.ASCII)
_OTHER = {",": ".", ".": ","}
_GAP = re.compile(r"(?<=\d)[ \u00a0\u2009\u202f'\u2019](?=\d{3}(?!\d))", re.ASCII)  # of thousands


def closed(text: str) -> str:
    """A text without spaces or apostrophes between thousands, and with a plain minus."""
    return _GAP.sub("", text).replace("\N{MINUS SIGN}", "-")


def decimal_mark(cells: Iterable[tuple[str, str]], points: bool) -> str:
    """Decimal mark of a table, from its texts, each with its path for error messages.

    A mark is decimal unless three digits follow it, as in "1,500", which may be 1.5 or 1500. Where no
    text decides, commas are refused, and so are points unless `points` are known to be decimal.
    """
    sure: dict[str, tuple[str, str]] = {}
    doubtful: dict[str, tuple[str, str]] = {}
    for path, text in ((path, closed(text)) for path, text in cells):
        if not _MARKED.fullmatch(text):
            continue
        mark = max(_OTHER, key=text.rfind)
        if not _GROUPED.fullmatch(text):
            sure.setdefault(mark, (path, text))
        elif text.count(mark) > 1:
            sure.setdefault(_OTHER[mark], (path, text))
        else:
            doubtful.setdefault(mark, (path, text))
    if len(sure) > 1:
        (path, text), (there, other) = sure[","], sure["."]
        refuse(
            path,
            f"is {text!r}, with a decimal comma, but {there.rpartition(': ')[2]} is {other!r}, with a "
            "decimal point; write all numbers in one way.",
        )
    if sure:
        return next(iter(sure))
    if doubtful and not (points and "," not in doubtful):
        mark = "," if "," in doubtful else "."
        path, text = doubtful[mark]
        short, grouped = text.rstrip("0"), text.replace(mark, "")
        short += "0" * short.endswith(mark)
        refuse(
            path, f"is {text!r}, which may be a decimal or {grouped}; write {short} or {grouped}."
        )
    return "."


def number(text: str, mark: str) -> str | None:
    """Text of a number as Python reads it, from one with a decimal mark; None if it is no number."""
    other, text = re.escape(_OTHER[mark]), closed(text)
    if re.fullmatch(rf"[+-]?\d{{1,3}}({other}\d{{3}})+({re.escape(mark)}\d*)?", text, re.ASCII):
        text = re.sub(other, "", text)
    elif _OTHER[mark] in text:
        return None
    text = text.replace(mark, ".")
    return re.sub("[dD]", "e", text) if _NUMERAL.fullmatch(text) else None
