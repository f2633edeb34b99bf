"""Columns: a table below its row of names, whose columns have units."""

import contextlib
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from ..units import SceneError, quantity, refuse, show
from .numerals import decimal_mark, number
from .sheet import Sheet, sheets


class Quantity(NamedTuple):
    """Quantity of a column: its unit in SI, None of a text, and the names that it may have."""

    unit: str | None
    names: Sequence[str]  # in small letters and digits alone


class Head(NamedTuple):
    """Head of a column that is read."""

    key: str
    text: str
    place: int
    unit: str | None  # as it is written; None: none is


_IMPLIED = {"rpm": "rpm"}  # units of columns that are named after them
_EXAMPLES = {"rad/s": "rpm", "N/m": "lbf/in", "N s/m": "lbf*s/in", "m": "mm", "Pa": "psi"}
_TURNS = {  # units of a speed, as they are written for revolutions
    **dict.fromkeys(("1/min", "min-1", "min^-1", "r/min", "u/min", "rev/min", "cpm"), "rpm"),
    **dict.fromkeys(("hz", "rev/s", "rps"), "turn/s"),
}
_CASED = {"n": "N", "kn": "kN", "pa": "Pa", "kpa": "kPa", "mpa": "MPa", "gpa": "GPa"}  # "N*S/M"
_POWERS = str.maketrans("⁰¹²³⁴⁻", "01234-")


class Table(NamedTuple):
    """Columns of a table, each with a cell for every row."""

    source: str
    names: str  # of all columns, for error messages
    lines: list[int]  # numbers of the rows in the file
    heads: dict[str, Head]
    cells: dict[str, list[Any]]
    mark: str  # the decimal mark

    def path(self, key: str, row: int) -> str:
        """Place of a cell, for error messages."""
        return f"{self.source}: row {self.lines[row]}, column {self.heads[key].text}"

    def numbers(self, key: str, unit: str) -> np.ndarray:
        """Numbers of a column in a unit of SI."""
        return np.array([self._number(key, row, unit) for row in range(len(self.lines))])

    def _number(self, key: str, row: int, unit: str) -> float:
        cell, path, own = self.cells[key][row], self.path(key, row), self.heads[key].unit
        text = None
        if isinstance(cell, str):
            text = number(cell, self.mark)
        elif isinstance(cell, int | float) and not isinstance(cell, bool):
            text = repr(cell)
        if cell is None:
            refuse(path, "is empty; every row of the table needs a value there, 0 if it is none.")
        if text is None:
            refuse(
                path,
                f"must be a number, but is {show(cell)}; correct it, or leave an empty row before notes.",
            )
        return quantity(text if own is None else f"{text} {own}", unit, path)

    @property
    def size(self) -> int:
        """Number of rows."""
        return len(self.lines)

    def without_units(self, quantities: Mapping[str, Quantity]) -> list[str]:
        """A sentence on the columns that are read in SI because nothing gives their units."""
        bare = {
            head.text: unit
            for key, head in self.heads.items()
            if head.unit is None and (unit := quantities[key].unit) not in (None, "1")
        }
        units = ", ".join(dict.fromkeys(map(str, bare.values())))
        return [f"no unit is given for {', '.join(bare)}, read in {units}"] if bare else []


def read_table(
    path: str | os.PathLike[str],
    sheet: str | None,
    quantities: Mapping[str, Quantity],
    needed: Sequence[str],
    noun: str,
) -> tuple[Table, Sheet]:
    """Table of a file with columns of some quantities, of which some are needed, and its sheet."""
    found = sheets(path, sheet)
    keys = {k: {head.key for head in heads_of(one, quantities)[1]} for k, one in enumerate(found)}
    whole = [k for k, own in keys.items() if {*needed} <= own]
    if len(names := dict.fromkeys(found[k].source for k in whole)) > 1:
        several = f"has several tables of a {noun}, {', '.join(names)}; name one by `sheet`."
        refuse(os.fspath(path), several)
    width = lambda k: max(map(len, found[k].rows), default=0)
    best = found[max(whole or keys, key=lambda k: (len(keys[k]), width(k)))]
    return table_in(best, quantities, needed, noun), best


def table_in(
    sheet: Sheet, quantities: Mapping[str, Quantity], needed: Sequence[str], noun: str
) -> Table:
    """Table of a sheet, see `read_table`."""
    row, found = heads_of(sheet, quantities)
    heads: dict[str, Head] = {}
    here = f"{sheet.source}: row {row + 1}"
    for head in found:
        if head.key in heads:
            both = f"{show(heads[head.key].text)} and {show(head.text)}"
            refuse(here, f"names {both}, which are one quantity; delete one of these columns.")
        heads[head.key] = head
    if missing := [key for key in needed if key not in heads]:
        wanted = ", ".join(quantities[key].names[0] for key in needed)
        refuse(
            here,
            f"has no column {quantities[missing[0]].names[0]}; a table of a {noun} needs {wanted}, but "
            f"this has {_named(sheet, row)}.",
        )
    return _below(sheet, row, heads, quantities)


def _named(sheet: Sheet, row: int) -> str:
    """Cells of a row of names, for error messages."""
    cells = sheet.rows[row] if sheet.rows else []
    return ", ".join(show(cell) for cell in cells if cell is not None) or "none"


def heads_of(sheet: Sheet, quantities: Mapping[str, Quantity]) -> tuple[int, list[Head]]:
    """The row of a sheet with the most names of columns, and these; the first row if there are none."""
    words = {name: key for key, one in quantities.items() for name in one.names}
    rows = [[*_heads(row, words)] for row in sheet.rows] or [[]]
    best = max(range(len(rows)), key=lambda row: len({head.key for head in rows[row]}))
    return best, rows[best]


def _heads(row: Sequence[Any], words: Mapping[str, str]) -> Iterator[Head]:
    """Heads of columns that are known, such as "Kxx", "K_xx (N/m)", "kxx / N/m" and "Speed rpm"."""
    for place, cell in enumerate(row):
        if not isinstance(cell, str):
            continue
        bracket = re.fullmatch(r"([^\[(]*?)[\s/,_]*[\[(](.*)[\])]", cell, re.DOTALL)
        cuts = [(cell[: m.start()], cell[m.end() :]) for m in re.finditer(r"[\s_,/]+|$", cell)]
        for name, unit in [bracket.groups()] if bracket else reversed(cuts):
            plain = re.sub(r"[\W_]+", "", name.lower())
            if plain in words and name.strip() != "W":  # a load, where w is a speed
                yield Head(words[plain], cell, place, unit.strip() or _IMPLIED.get(plain))
                break


def _below(
    sheet: Sheet, row: int, heads: dict[str, Head], quantities: Mapping[str, Quantity]
) -> Table:
    """Table below its row of heads, under which there may be a row of units."""
    body = list(_body(sheet, row, heads, quantities))
    line, units = row + 1, [None] * len(heads)
    if body and not any(map(_is_number, body[0][1])):
        line, units = body.pop(0)
    elif row and not any(
        head.unit for head in heads.values()
    ):  # programs have them above the names
        above = [_at(sheet.rows[row - 1], head) for head in heads.values()]
        known = [_unit(str(cell), quantities[key]) for cell, key in zip(above, heads, strict=True)]
        line, units = (row, above) if any(known) else (line, units)
    here = f"{sheet.source}: row {line}"
    pairs = zip(heads.items(), units, strict=True)
    heads = {key: head._replace(unit=head.unit or unit) for (key, head), unit in pairs}
    if not body:
        refuse(here, "is the last one of its table; give rows of numbers below it.")
    heads = {key: _with_unit(head, quantities[key], here) for key, head in heads.items()}
    _check_units(heads, quantities, here)
    cells = {key: [own[k] for _, own in body] for k, key in enumerate(heads)}
    table = Table(sheet.source, _named(sheet, row), [line for line, _ in body], heads, cells, ".")
    texts = [
        (table.path(key, k), cell)
        for key, own in cells.items()
        for k, cell in enumerate(own)
        if quantities[key].unit is not None and isinstance(cell, str)
    ]
    return table._replace(mark=decimal_mark(texts, sheet.separator in (",", "\t")))


def _body(
    sheet: Sheet, row: int, heads: dict[str, Head], quantities: Mapping[str, Quantity]
) -> Iterator[tuple[int, list[Any]]]:
    """Numbers of the rows below that of the heads, with their cells, up to the first empty row."""
    measured = [k for k, key in enumerate(heads) if quantities[key].unit is not None]
    begun, empty = False, 0
    for line, own in enumerate(sheet.rows[row + 1 :], row + 2):
        cells = [_at(own, head) for head in heads.values()]
        if all(cell is None for cell in cells):
            empty = empty or line * begun
        elif empty and all(_is_number(cells[k]) for k in measured):
            goes_on = f"is empty, but the table goes on in row {line}; delete the empty row."
            refuse(f"{sheet.source}: row {empty}", goes_on)
        elif not empty:
            if sheet.separator == "," and len(own) > len(sheet.rows[row]):
                refuse(
                    f"{sheet.source}: row {line}",
                    f"has {len(own)} cells below {len(sheet.rows[row])} names; if its commas are decimal, "
                    "write points, or separate the columns by semicolons.",
                )
            begun = True
            yield line, cells


def _at(row: Sequence[Any], head: Head) -> Any:
    """Cell of a row in the column of a head."""
    return row[head.place] if head.place < len(row) else None


def _is_number(cell: Any) -> bool:
    """Whether a cell is a number, or the text of one."""
    if isinstance(cell, str):
        return bool(number(cell, ".") or number(cell, ","))
    return isinstance(cell, int | float) and not isinstance(cell, bool)


def _with_unit(head: Head, of: Quantity, path: str) -> Head:
    """A head with its unit as `quantity` reads it; raises if that cannot be read."""
    if head.unit is None or of.unit in (None, "1") or head.unit in ("-", "1", "#"):
        return head._replace(unit=None)
    unit = _unit(str(head.unit), of)
    if unit is None:
        refuse(
            f"{path}, column {head.text}",
            f"has the unit {show(head.unit)}, which is unknown or none of this quantity; write "
            f"{' or '.join(filter(None, (of.unit, _EXAMPLES.get(str(of.unit)))))}.",
        )
    return head._replace(unit=unit)


def _unit(text: str, of: Quantity) -> str | None:
    """Unit of a quantity as `quantity` reads it, from a text as tables have it; None: there is none."""
    if of.unit == "rad/s":
        text = _TURNS.get(re.sub(r"[\s.()\[\]]", "", text.lower()), text)
    text = re.sub("[⁰¹²³⁴⁻]+", lambda power: f"^{power[0].translate(_POWERS)}", text)
    text = re.sub(r"[·•⋅×∙]|(?<=[a-zA-Z])[-.](?=[a-zA-Z])", "*", text.strip("[]() ."))
    text = re.sub(r"\b([kM]?N|lbf?)s\b", r"\1*s", text)
    text = re.sub(r"\b(k?m|mm|cm|in|ft|s)([234])\b", r"\1^\2", text)
    text = re.sub(r"\blbm\b", "lb", text)
    small = re.sub("[a-z]+", lambda word: _CASED.get(word[0], word[0]), text.lower())
    for one in (text, small):
        for pound in ("lb", "lbf"):  # a mass, or else a force
            with contextlib.suppress(SceneError):
                unit = re.sub(r"\blbs?\b", pound, one)
                quantity(f"1 {unit}", of.unit or "1", "")
                return unit
    return None


def _check_units(heads: dict[str, Head], quantities: Mapping[str, Quantity], path: str) -> None:
    """Raise if some columns have units, and others need one too."""
    own = [head for key, head in heads.items() if quantities[key].unit not in (None, "1")]
    given = next((head for head in own if head.unit is not None and head.key != "speed"), None)
    for head in own:
        if given is not None and head.unit is None:
            refuse(
                f"{path}, column {head.text}",
                f"has no unit, but {given.text} has {given.unit}; give each column its unit, or none.",
            )
