"""Turbine variants: thirty rotors of a printed table, with an assumed layout."""

import csv
import importlib.resources
import re
from typing import NamedTuple

import jax.numpy as jnp

from ..effects import Disc
from ..scene import Scene
from ..shafts import Constraint, RigidShaft
from ..spins.drive import Drive
from .units import refuse, show


NAME = "turbine-variants"
CHAIN = "chain"
LAYOUTS = (CHAIN, "example31")
_COLUMNS = (
    *("variant", "m1_kg", "m2_kg", "R1_m", "R2_m", "O1C1_mm", "alpha_rad", "a_m", "b_m", "c_m"),
    *("M0T_100Nm", "k1_Nms", "k2T_1e-2Nms2", "omega0_rad_s", "tau_s", "note"),
)
_SECOND = ("m2_kg", "R2_m", "c_m")  # cells of the second wheel: all or none


class Variant(NamedTuple):
    """Row of the table, in SI units; if there is one wheel, it has both the offset and the tilt."""

    number: int
    masses: tuple[float, ...]  # masses of the wheels [kg]
    radii: tuple[float, ...]  # radii of the wheels [m]
    offset: float  # offset of wheel 1 [m]
    tilt: float  # tilt of the last wheel [rad]
    distances: tuple[float, ...]  # a, b, and with two wheels c [m]
    torque: float  # [N m]
    slope: float  # [N m s]
    drag: float  # [N m s^2]
    speed: float  # initial speed [rad/s]
    duration: float  # duration of the run [s]
    note: str  # remark on doubtful cells, which are used as printed

    def scene(self, layout: str = CHAIN) -> Scene:
        """Scene of the rotor, of first order in offset and tilt, as in the source.

        The figures with the positions of wheels and bearings are lost, so a layout is assumed. The angle
        between offset and tilt is not known either: here the offset is along x, and the product of
        inertia of the tilt adds to that of the offset.

        Args:
            layout: "chain" is A -a- wheel 1 -b- wheel 2 -c- B; "example31" is that of the worked example,
                A at 0, wheel 1 at a, B at b, wheel 2 at b + c.

        Raises:
            ValueError: If there is no such layout.
        """
        wheels, bearing = self._places(layout)
        last = len(wheels) - 1
        discs = []
        for i, at in enumerate(wheels):
            wrong = {"offset": self.offset} if i == 0 else {}
            if i == last:
                wrong |= {"tilt": self.tilt, "tilt_axis": -jnp.pi / 2}
            discs.append(Disc.thin(at, self.masses[i], self.radii[i], exact=False, **wrong))
        shaft = RigidShaft(max(*wheels, bearing), (Constraint(0.0), Constraint(bearing)))
        drive = Drive(self.speed, self.torque, self.slope, self.drag)
        return Scene(shaft, *discs, spin=drive, assumption=self._assumption(layout))

    def title(self, layout: str = CHAIN) -> str:
        """Title with the assumed layout, and with the remark on doubtful cells."""
        note = f"; {self.note}" if self.note else ""
        return f"Turbine rotor, variant {self.number} ({self._assumption(layout)}{note})"

    def _assumption(self, layout: str) -> str:
        """Assumption that every result must state."""
        self._places(layout)
        return f"layout assumed: {layout}"

    def _places(self, layout: str) -> tuple[list[float], float]:
        """Stations of the wheels, and of bearing B [m]."""
        if layout not in LAYOUTS:
            known = " or ".join(map(repr, LAYOUTS))
            raise ValueError(f"`layout` must be {known}, but is {layout!r}.")
        a, b, *rest = self.distances
        if layout == "example31":
            return [a, *(b + c for c in rest)], b
        return [a, *(a + b for _ in rest)], a + b + sum(rest)


def variants() -> dict[int, Variant]:
    """Rotors of the table of the source.

    Returns:
        Rows by their number, from 1 to 30.

    Source: course project "Dynamic reactions in the bearings of a rotor", Table 13.
    """
    file = importlib.resources.files("jaxrotor") / "scenes" / f"{NAME}.csv"
    return read(file.read_text("utf-8"))


def variant(row: int) -> Variant:
    """Row of the table with the number `row`."""
    table = variants()
    if type(row) is not int or row not in table:
        raise ValueError(f"`row` must be a whole number from 1 to {max(table)}, but is {row!r}.")
    return table[row]


def read(text: str) -> dict[int, Variant]:
    """Rows of a table in CSV; a cell is a decimal number, or empty if the value is absent."""
    rows = list(csv.reader(text.splitlines()))
    if not rows or tuple(rows[0]) != _COLUMNS:
        refuse(NAME, f"must have the columns {', '.join(_COLUMNS)}.")
    table = {}
    for line, cells in enumerate(rows[1:], start=2):
        if len(cells) != len(_COLUMNS):
            refuse(
                f"{NAME}: line {line}", f"must have {len(_COLUMNS)} cells, but has {len(cells)}."
            )
        row = _row(dict(zip(_COLUMNS, cells, strict=True)), f"{NAME}: line {line}")
        if row.number in table:
            refuse(f"{NAME}: line {line}", f"is another variant {row.number}.")
        table[row.number] = row
    return table


def _row(cells: dict[str, str], path: str) -> Variant:
    single = all(cells[key] == "" for key in _SECOND)
    used = [key for key in _COLUMNS[:-1] if not (single and key in _SECOND)]
    value = {key: _number(cells[key], f"{path}, {key}") for key in used}
    pick = lambda *keys: tuple(value[key] for key in keys if key in value)
    return Variant(
        number=int(value["variant"]),
        masses=pick("m1_kg", "m2_kg"),
        radii=pick("R1_m", "R2_m"),
        offset=1e-3 * value["O1C1_mm"],
        tilt=value["alpha_rad"],
        distances=pick("a_m", "b_m", "c_m"),
        torque=100 * value["M0T_100Nm"],
        slope=value["k1_Nms"],
        drag=1e-2 * value["k2T_1e-2Nms2"],
        speed=value["omega0_rad_s"],
        duration=value["tau_s"],
        note=cells["note"],
    )


def _number(cell: str, path: str) -> float:
    if not re.fullmatch(r"[0-9]+(\.[0-9]+)?", cell):
        refuse(path, f"must be a number such as 0.15, but is {show(cell)}.")
    return float(cell)
