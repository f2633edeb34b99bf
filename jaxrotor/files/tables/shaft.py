"""Shaft from a table of its elements: lengths, diameters and materials."""

import itertools
import os
from collections.abc import Mapping
from typing import Any

import numpy as np

from ...shafts import FlexibleShaft
from ...shafts.materials import NAMED, Material, steel
from ..ross.file import Element, Notes
from ..ross.shaft import merged, placed, sections, step
from ..units import SceneError, refuse, show
from .columns import Quantity, Table, heads_of, read_table, table_in
from .sheet import Sheet


_SIDES = {"l": "left", "r": "right"}
_DIAMETERS = {"od": ("outer", "outside", "external"), "id": ("inner", "inside", "internal")}


def _names(key: str) -> tuple[str, ...]:
    """Names of the column of a diameter: "od", "outer diameter", and of a side "od left", "odl"."""
    words, side = _DIAMETERS[key[:2]], _SIDES.get(key[2:], "")
    both = (key[:2], *(f"{word}diameter" for word in words))
    if not side:
        return (*both, *(("diameter",) if key == "od" else ("bore", "borediameter")))
    return (key, *itertools.chain(*((f"{name}{side}", f"{side}{name}") for name in both)))


_QUANTITIES = {
    "L": Quantity("m", ("length", "l", "elementlength")),
    **{key: Quantity("m", _names(key)) for key in ("od", "odl", "odr", "id", "idl", "idr")},
    "material": Quantity(None, ("material", "matnum", "matno")),
    "E": Quantity("Pa", ("e", "youngsmodulus", "elasticmodulus", "modulusofelasticity")),
    "G_s": Quantity("Pa", ("g", "gs", "shearmodulus")),
    "nu": Quantity("1", ("nu", "poisson", "poissonratio", "poissonsratio")),
    "rho": Quantity("kg/m^3", ("rho", "density")),
    "n": Quantity("1", ("n", "elemnum")),
    "sub": Quantity("1", ("selmnum",)),
    "axial_force": Quantity("N", ("axialforce", "axial")),
    "torque": Quantity("N m", ("torque",)),
    "shear_effects": Quantity("1", ("sheareffects", "shear")),
    "rotary_inertia": Quantity("1", ("rotaryinertia",)),
    "gyroscopic": Quantity("1", ("gyroscopic",)),
}
_FLAGS = ("shear_effects", "rotary_inertia", "gyroscopic")
_STEEL = "material is steel, since the table names none"
_WORDS = dict.fromkeys(("true", "yes", "1"), True) | dict.fromkeys(("false", "no", "0"), False)
_MATERIALS = {
    "name": Quantity(None, ("matno", "material", "name")),
    "rho": Quantity("kg/m^3", ("rhoa", "rho", "density")),
    "E": Quantity("Pa", ("ea", "e")),
    "G_s": Quantity("Pa", ("ga", "g", "gs")),
}


def read_shaft(
    path: str | os.PathLike[str],
    *,
    sheet: str | None = None,
    materials: Mapping[str, Material] | None = None,
    **others: Any,
) -> tuple[FlexibleShaft, tuple[str, ...]]:
    """Shaft from a table of its elements from left to right, in CSV or Excel.

    A row has a length, the diameters at both ends of an element and its material. Names of columns are
    read in any case, with or without a unit, as in `read_support`: `length` or `L`; `odl`, `od_left` or
    `outer diameter left [mm]`, the same of `odr`, `idl`, `idr`, and `od` and `id` where both ends are
    equal; without an inner diameter the shaft is solid. A material is a name, or columns `rho`, `E` and
    `G` or `nu`; without them it is steel. A number of a material is that of a table in the same sheet with
    `matno`, `rhoa`, `ea` and `ga`, as in the sheets `Model` of ROSS and of XLTRC. Elements of equal `n` or
    `elemnum` surround each other. Where no units are given all numbers are SI, and a sentence says so.

    The shaft deforms in shear, and is gyroscopic, unless columns `shear_effects`, `rotary_inertia` or
    `gyroscopic` are false. Tapers become up to four uniform elements, and sleeves a part of the shaft, as
    in `from_ross`.

    Args:
        path: path of the file; `.xlsx` needs `pip install openpyxl`, `.xls` xlrd.
        sheet: name of the sheet of Excel, where several have such a table.
        materials: materials by their names in the table, beside `"steel"`.
        others: other arguments of `FlexibleShaft`, such as `constraints`.

    Returns:
        The shaft, and a sentence on everything that was changed, assumed or left out, with its rows.

    Raises:
        SceneError: If the file cannot be read; the sentence names its row and column.
        ValueError: If `FlexibleShaft` has no such argument, or one that contradicts the table.
    """
    table, page = read_table(path, sheet, _QUANTITIES, ("L",), "shaft")
    elements, notes = _elements(table, page, materials or {}), Notes()
    places, rings, gyroscopic, flags = sections(elements, table.source, notes)
    first, *rest = merged(rings, places[max(places)], notes)
    try:
        shaft = FlexibleShaft(
            places[max(places)],
            first.outer,
            Material(*first.of),
            polar_ratio=2.0 if gyroscopic else 0.0,
            inner_diameter=first.bore,
            steps=tuple(step(at, ring, first.of) for at, ring in placed(first, rest)),
            **flags,
            **others,
        )
    except ValueError as error:
        raise SceneError(f"{table.source}: {error}") from None
    taken = [] if table.heads.keys() & {"material", "E"} else [_STEEL]
    return shaft, (*table.without_units(_QUANTITIES), *taken, *notes)


def _elements(table: Table, sheet: Sheet, materials: Mapping[str, Material]) -> list[Element]:
    """Elements of a shaft as those of ROSS."""
    columns: dict[str, Any] = {"n": _nodes(table), "L": table.numbers("L", "m")}
    columns |= _diameters(table) | {"material": _materials(table, sheet, materials)}
    for key in ("axial_force", "torque"):
        if key in table.heads:
            columns[key] = table.numbers(key, str(_QUANTITIES[key].unit))
    for key in _FLAGS:
        if key in table.heads:
            columns[key] = [_flag(table, key, row) for row in range(table.size)]
    rows = [
        {key: _plain(column[row]) for key, column in columns.items()} for row in range(table.size)
    ]
    for row, own in enumerate(rows):
        for key, least in {"L": 0.0, "odl": own["idl"], "odr": own["idr"]}.items():
            if own[key] <= least:
                what = f"must be above {'the inner diameter, ' * (least > 0)}{least:g} m"
                refuse(table.path(_head(table, key), row), f"{what}, but is {own[key]:g} m.")
    named = [f"row {line}" for line in table.lines]
    return [
        Element("ShaftElement", f"{table.source}: {name}", own | {"tag": name})
        for name, own in zip(named, rows, strict=True)
    ]


def _plain(value: Any) -> Any:
    return value.item() if isinstance(value, np.generic) else value


def _nodes(table: Table) -> list[int]:
    """Number of the node at the left of each element; those that surround each other have the same."""
    keys = [key for key in ("n", "sub") if key in table.heads]
    if "n" not in keys:
        return list(range(table.size))
    own = np.stack([table.numbers(key, "1") for key in keys], axis=1)
    return np.unique(own, axis=0, return_inverse=True)[1].ravel().tolist()


def _diameters(table: Table) -> dict[str, np.ndarray]:
    """Diameters at both ends of all elements [m]; without inner ones they are solid."""
    found = {}
    for key in (f"{kind}{side}" for kind in _DIAMETERS for side in _SIDES):
        kind, head = key[:2], _head(table, key)
        if head in table.heads:
            found[key] = table.numbers(head, "m")
        elif kind == "id" and not any(one in table.heads for one in ("idl", "idr")):
            found[key] = np.zeros(table.size)
        else:
            refuse(
                table.source,
                f"has no column {key}; a shaft needs {kind}, or {kind}l and {kind}r, but there are "
                f"{table.names}.",
            )
    return found


def _head(table: Table, key: str) -> str:
    """Key of the column that has the diameter at one end, which may be that of both ends."""
    return key if key in table.heads else key[:2] if key[:2] in _DIAMETERS else key


def _flag(table: Table, key: str, row: int) -> bool:
    """Truth value of a cell: true, false, yes, no, 1 or 0."""
    cell = table.cells[key][row]
    word = str(cell).lower().removesuffix(".0")
    if word not in _WORDS:
        refuse(table.path(key, row), f"must be true or false, or 1 or 0, but is {show(cell)}.")
    return _WORDS[word]


def _materials(table: Table, sheet: Sheet, given: Mapping[str, Material]) -> list[dict[str, float]]:
    """Materials of all elements, as those of ROSS."""
    if any(key in table.heads for key in ("E", "rho", "G_s", "nu")):
        return _moduli(table, "nu" if "nu" in table.heads else "G_s")
    if "material" not in table.heads:
        return [_made(steel())] * table.size
    known = {name: _made(make()) for name, make in NAMED.items()}
    known |= _numbered(sheet) | {name: _made(one) for name, one in given.items()}
    found = []
    for row, cell in enumerate(table.cells["material"]):
        name = f"{cell:g}" if isinstance(cell, int | float) else str(cell)
        name = name if name in known else name.lower()
        if name not in known:
            refuse(
                table.path("material", row),
                f"is {show(cell)}, which is none of the materials {', '.join(known)}; give it in "
                "`materials`, or give columns E, rho and G.",
            )
        if known[name]["G_s"] is None:
            refuse(
                table.path("material", row),
                f"is {name!r}, which has no `shear_modulus [Pa]`; give it one, for shear of the shaft.",
            )
        found.append(known[name])
    return found


def _moduli(table: Table, last: str) -> list[dict[str, float]]:
    """Materials by columns of their own."""
    own = {}
    for key in ("E", "rho", last):
        if key not in table.heads:
            refuse(
                table.source,
                f"has no column {key.removesuffix('_s')}; a material needs E, rho, and G or nu, but there "
                f"are {table.names}.",
            )
        own[key] = table.numbers(key, str(_QUANTITIES[key].unit))
    if last == "nu":
        own["G_s"] = own["E"] / (2 * (1 + own.pop("nu")))
    return [dict(zip(own, map(float, row), strict=True)) for row in zip(*own.values(), strict=True)]


def _numbered(sheet: Sheet) -> dict[str, dict[str, float]]:
    """Materials of a table in the sheet of the shaft, by their numbers or names."""
    if {*_MATERIALS} > {head.key for head in heads_of(sheet, _MATERIALS)[1]}:
        return {}
    table = table_in(sheet, _MATERIALS, tuple(_MATERIALS), "material")
    numbers = {k: table.numbers(k, str(one.unit)) for k, one in _MATERIALS.items() if one.unit}
    names = [
        f"{one:g}" if isinstance(one, int | float) else str(one) for one in table.cells["name"]
    ]
    return {
        name: {k: float(own[row]) for k, own in numbers.items()} for row, name in enumerate(names)
    }


def _made(material: Material) -> dict[str, Any]:
    """A material as those of ROSS."""
    shear = material.shear_modulus
    return {
        "E": float(material.youngs_modulus),
        "rho": float(material.density),
        "G_s": None if shear is None else float(shear),
    }
