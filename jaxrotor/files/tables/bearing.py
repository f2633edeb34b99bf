"""Support from a table of the coefficients of a bearing or seal over the speed."""

import os
import re
from typing import Any

import numpy as np

from ...effects import Support
from ...effects.coefficients import AXES, COEFFICIENTS
from ..units import SceneError, refuse, show
from .columns import Quantity, Table, heads_of, read_table
from .sheet import Sheet


_UNITS = {"k": "N/m", "c": "N s/m", "m": "kg"}
_LETTERS = {"k": "k", "c": "cbd", "m": "m"}  # of damping in different countries
_SPEED = ("speed", "n", "rpm", "frequency", "freq", "omega", "w", "rotorspeed", "shaftspeed")
_SPEED += ("rotationspeed", "rotationalspeed", "spinspeed", "runningspeed", "ω")
_COEFFICIENT = re.compile(r"[a-z]_?(xx|xy|yx|yy)(?![a-z])", re.IGNORECASE)
_QUANTITIES = {
    "speed": Quantity("rad/s", _SPEED),
    **{
        f"{k}{axes}": Quantity(unit, tuple(f"{letter}{axes}" for letter in _LETTERS[k]))
        for k, unit in _UNITS.items()
        for axes in AXES
    },
}


def read_support(
    path: str | os.PathLike[str],
    at: Any = None,
    *,
    sheet: str | None = None,
    **others: Any,
) -> Support:
    """Support from a table of its coefficients over the speed, in CSV or Excel.

    A row has a speed and its coefficients, as bearing reports print them. Names of columns are read in
    any case, with or without a unit: `speed`, `rpm`, `frequency` or `omega`, and `Kxx`, `K_xx (N/m)`,
    `kxx [lbf/in]`, `CXX N*s/m` and so on; the units may also be in a row below. Where none are given they
    are SI, with speeds in rad/s. Other columns are not read. Titles may stand above the table, and notes
    below it behind an empty row. Numbers may have decimal commas where these do not separate the columns.
    A table without speeds has one row.

    Args:
        path: path of the file; `.xlsx` needs `pip install openpyxl`, `.xls` xlrd.
        at: station of the support [m].
        sheet: name of the sheet of Excel, where several have such a table.
        others: other arguments of `Support`, such as `hold=True` or `on="pedestal"`.

    Returns:
        The support, whose `speeds` and coefficients are those of the table.

    Raises:
        SceneError: If the file cannot be read; the sentence names its row and column.
        ValueError: If `Support` has no such argument, or one that contradicts the table.
    """
    if at is not None:
        others = {"at": at} | others
    try:
        return Support(**coefficients(path, sheet)[0], **others)
    except SceneError:
        raise
    except ValueError as error:
        raise SceneError(f"{os.fspath(path)}: {error}") from None


def coefficients(
    path: str | os.PathLike[str], sheet: str | None = None
) -> tuple[dict[str, Any], list[str]]:
    """Arguments of a support, from a table of coefficients, and a sentence if units are missing."""
    table, page = read_table(path, sheet, _QUANTITIES, ("kxx",), "bearing")
    _check_names(table, page)
    notes = table.without_units(_QUANTITIES)
    own = {key: table.numbers(key, str(_QUANTITIES[key].unit)) for key in table.heads}
    found = {key: values for key, values in own.items() if key in COEFFICIENTS}
    found |= _added_mass(table, own)
    if "speed" not in own:
        if table.size > 1:
            refuse(
                table.source,
                f"has {table.size} rows, but no column speed among {table.names}; add it, as speed [rpm].",
            )
        return {key: float(np.ravel(value)[0]) for key, value in found.items()}, notes
    speeds, head = own["speed"], table.heads["speed"]
    if head.text.lower() == "n" and head.unit is None:
        refuse(table.path("speed", 0), "needs a unit; name the column n [rpm], or n [rad/s].")
    if table.size == 1:
        refuse(
            table.path("speed", 0),
            "is the only speed; give two or more, or delete the column if coefficients do not change.",
        )
    for row, step in enumerate(np.diff(speeds), 1):
        if step <= 0:
            what = "is the speed of the row before" if step == 0 else "is below the row before"
            refuse(table.path("speed", row), f"{what}; give each speed once, in ascending order.")
    return {"speeds": speeds, **found}, notes


def _check_names(table: Table, sheet: Sheet) -> None:
    """Raise if a column that is not read has the name of a coefficient."""
    row, _ = heads_of(sheet, _QUANTITIES)
    read = [head.text for head in table.heads.values()]
    for cell in sheet.rows[row]:
        if isinstance(cell, str) and cell not in read and _COEFFICIENT.match(cell):
            refuse(
                f"{sheet.source}: row {row + 1}",
                f"has the column {show(cell)}, which is unknown; k is stiffness, c damping, m added mass.",
            )


def _added_mass(table: Table, own: dict[str, np.ndarray]) -> dict[str, float]:
    """Added mass of a support, which is one number, the same along x and y."""
    masses = {key: values for key, values in own.items() if key[0] == "m"}
    if not any(values.any() for values in masses.values()):
        return {}
    direct = np.array([masses[key] for key in ("mxx", "myy") if key in masses])
    cross = [masses[key] for key in ("mxy", "myx") if key in masses]
    if not direct.size or np.ptp(direct) or np.any(cross):
        key = next(key for key, values in masses.items() if values.any())
        refuse(
            f"{table.source}: column {table.heads[key].text}",
            "has added masses, but a support has one, the same at every speed, along x and y; delete the "
            "columns of masses, and give `mxx`.",
        )
    return {"mxx": float(direct[0, 0])}
