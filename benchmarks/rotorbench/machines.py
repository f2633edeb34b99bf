"""Machines as plain numbers, which all three programs read from the scene files in `machines/`.

The standard library and NumPy alone are imported here, because the environment of ROSS reads it, too.
Every number in these files is in SI units.
"""

import tomllib
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np


FOLDER = Path(__file__).parent / "machines"
AXES = ("xx", "xy", "yx", "yy")
COARSEST = 16  # about as many elements a shaft has in the coarsest mesh


class Stretch(NamedTuple):
    """A uniform piece of shaft between two stations [m], with its outer and inner diameter [m]."""

    start: float
    stop: float
    diameter: float
    inner: float


class Bearing(NamedTuple):
    """A bearing at a station [m], `F = -k q - c q.`; `k` [N/m] and `c` [N s/m] are 2 by 2.

    With `turns`, its damper turns with the shaft: `q.` is then that in turning axes.
    """

    at: float
    k: np.ndarray
    c: np.ndarray
    turns: bool
    on: str | None  # name of a casing


class Machine:
    """A rotor of a scene file in `machines/`.

    Args:
        name: of the file, without its ending.
    """

    def __init__(self, name: str):
        self.path = FOLDER / f"{name}.toml"
        self.scene: dict[str, Any] = tomllib.loads(self.path.read_text())

    def varied(self, over: dict[str, Any], value: float) -> "Machine":
        """The machine with a value, times the factor of each, as coefficients of some of its supports."""
        other, factors = Machine(self.path.stem), {**over}
        for k in factors.pop("supports"):
            other.parts("supports")[k].update({key: x * value for key, x in factors.items()})
        return other

    def parts(self, kind: str) -> list[dict[str, Any]]:
        """Effects of a kind, as `discs`."""
        return self.scene.get(kind, [])

    @property
    def shaft(self) -> dict[str, Any]:
        return self.scene["shaft"]

    @property
    def speed(self) -> float:
        return self.scene["spin"]["speed"]

    @property
    def material(self) -> tuple[float, float, float]:
        """Young's modulus [Pa], density [kg/m^3] and shear modulus [Pa], infinite without shear."""
        made = self.shaft["material"]
        shear = made.get("shear_modulus", np.inf) if self.shaft.get("shear") else np.inf
        return made["youngs_modulus"], made["density"], shear

    @property
    def pins(self) -> list[float]:
        return [one["at"] for one in self.shaft["constraints"] if one["holds"] == "pin"]

    def stretches(self) -> list[Stretch]:
        """Pieces between all stations where something changes or acts."""
        shaft = self.shaft
        steps = shaft.get("steps", [])
        named = ("discs", "supports", "unbalances", "annular_stators")
        stations = {one["at"] for kind in named for one in self.parts(kind) if "at" in one}
        marks = sorted({0.0, shaft["length"], *stations, *(step["at"] for step in steps)})
        pieces = []
        for start, stop in zip(marks[:-1], marks[1:], strict=True):
            last = [shaft, *(step for step in steps if step["at"] <= start)][-1]
            pieces.append(Stretch(start, stop, last["diameter"], last.get("inner_diameter", 0.0)))
        return pieces

    def elements(self, cut: int) -> list[Stretch]:
        """A mesh of all stretches, of about `cut` times the coarsest number of elements."""
        length = self.shaft["length"]
        mesh = []
        for piece in self.stretches():
            span = piece.stop - piece.start
            count = cut * max(1, round(COARSEST * span / length))
            ends = [piece.start + span * k / count for k in range(count)] + [piece.stop]
            mesh += [
                piece._replace(start=a, stop=b) for a, b in zip(ends[:-1], ends[1:], strict=True)
            ]
        return mesh

    def bearings(self, speed: float = 0.0) -> list[Bearing]:
        """Bearings of the shaft with their numbers at a speed [rad/s]; tables are linear in between."""
        return [self._bearing(one, speed) for one in self.parts("supports") if "at" in one]

    def held(self, casing: str) -> Bearing:
        """What holds a casing on the ground."""
        (one,) = (one for one in self.parts("supports") if one.get("of") == casing)
        return self._bearing({**one, "at": np.nan}, 0.0)

    def _bearing(self, one: dict[str, Any], speed: float) -> Bearing:
        at_speed = lambda x: np.interp(speed, one["speeds"], x) if isinstance(x, list) else x
        numbers = [
            np.array([at_speed(one.get(letter + axes, 0.0)) for axes in AXES]).reshape(2, 2)
            for letter in "kc"
        ]
        return Bearing(one["at"], *numbers, one.get("rotating", False), one.get("on"))
