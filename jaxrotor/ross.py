"""ROSS: rotors as ROSS writes them, read into scenes."""

import json
import os
import tomllib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from .effects import Disc, Support
from .materials import Material
from .scene import Scene
from .shafts import FlexibleShaft, Step
from .spin import ConstantSpeed
from .units import SceneError, quantity, refuse, show


Table = dict[str, Any]

_PIECES = 4  # uniform ones in place of a tapered element
_SHORTEST = 0.0021  # of the length of the shaft: what a step must be away from the next
_COORDINATES = 48  # nodes of all spans together, about
_SLOW = 0.3  # omega C / K up to which springs in series hide little of a damper
_AXES = ("xx", "xy", "yx", "yy")
_STIFFNESS, _DAMPING = ("k", "N/m"), ("c", "N s/m")
_LEFT_OUT = {  # of a shaft element
    "axial_force": ("N", "axial force"),
    "torque": ("N m", "torque"),
    "alpha": ("1/s", "damping in proportion to mass (alpha)"),
    "beta": ("s", "damping in proportion to stiffness (beta)"),
}


class _Element(NamedTuple):
    """One element of the file."""

    kind: str  # the class that wrote it
    path: str  # of its table, for error messages
    table: Table

    @property
    def name(self) -> str:
        """Its tag, as one line."""
        words = " ".join(str(self.table.get("tag") or self.kind).split())
        return "".join(letter for letter in words if letter.isprintable())

    @property
    def node(self) -> int:
        return self.count("n")

    def count(self, key: str) -> int:
        """A number of a node."""
        value = self.table.get(key)
        if isinstance(value, bool) or not isinstance(value, int | float) or value != value // 1:
            refuse(f"{self.path}.{key}", f"must be a whole number, but is {show(value)}.")
        return int(value)

    def number(self, key: str, unit: str, default: float | None = None) -> float:
        value = self.table.get(key, default)
        if value is None:
            refuse(f"{self.path}.{key}", f"is missing; a {self.kind} needs it.")
        return quantity(value, unit, f"{self.path}.{key}")


class _Ring(NamedTuple):
    """A uniform piece of shaft."""

    length: float
    outer: float
    inner: float
    of: tuple[float, float, float]  # Young's modulus, density, shear modulus

    @property
    def bore(self) -> Any:
        """Inner diameter, None of a solid shaft."""
        return self.inner or None


class _Notes:
    """What was not carried over, each with the elements that had it."""

    def __init__(self) -> None:
        self.found: dict[str, list[str]] = {}

    def add(self, text: str, element: _Element) -> None:
        names = self.found.setdefault(text, [])
        if element.name not in names:
            names.append(element.name)

    def __iter__(self) -> Iterator[str]:
        for text, names in self.found.items():
            more = f" and {len(names) - 1} more" if len(names) > 1 else ""
            yield f"{text}: {names[0]}{more}"


def from_ross(
    path: str | os.PathLike[str], speed: float | int, nodes: int | None = None
) -> tuple[Scene, tuple[str, ...]]:
    """Scene of a rotor that ROSS has written by `Rotor.save`, a .toml or .json file.

    Elements of shafts become one `FlexibleShaft` without constraints, with shear and rotary inertia as
    theirs and a `Step` where sections change; disks `Disc`, point masses on the shaft too; bearings
    and seals `Support`, of all eight coefficients. A table of coefficients by frequency gives those at
    the speed, by cubic interpolation, or at its nearer end. A tapered element becomes up to four
    uniform ones, layers of sleeves one ring. A bearing on a flexible support becomes one of the two in
    series, `K^-1 = K1^-1 + K2^-1`, `C = K (K1^-1 C1 K1^-1 + K2^-1 C2 K2^-1) K`, without the support's
    mass: of motions slow enough for `omega C << K` of either; of faster ones, as on a squeeze film, its
    damping is too high. Axial and torsional motion, axial force, torque and damping of the shaft are
    not carried over. Written for files of ROSS 2.3.

    Args:
        path: the file.
        speed: constant speed of the scene [rad/s], not negative; the file has none.
        nodes: of every span of the shaft; by default 8 of few, and fewer of many, down to 3.

    Returns:
        The scene, and a sentence on each thing that was changed or left out, with its elements.
    """
    source, speed = os.fspath(path), quantity(speed, "rad/s", "speed")
    if speed < 0:
        wanted = "must not be negative, as coefficients in the file are those of positive rotation"
        refuse("speed", f"{wanted}, but is {speed:g} rad/s.")
    elements, notes = _elements(source), _Notes()
    places, rings, gyroscopic, flags = _shaft(elements, source, notes)
    total = places[max(places)]
    effects = [*_discs(elements, places, notes), *_supports(elements, places, speed, notes)]
    shaft, *steps = _merged(rings, total, notes)
    ends = [0.0, total, *(at for at, _ in _placed(shaft, steps)), *(float(e.at) for e in effects)]
    spans = len({round(at / total, 4) for at in ends}) - 1
    left_out = tuple(notes)
    said = f"less what could not be carried over from {Path(source).name}" if left_out else ""
    try:
        line = FlexibleShaft(
            total,
            shaft.outer,
            Material(*shaft.of),
            polar_ratio=2.0 if gyroscopic else 0.0,
            nodes=min(8, max(3, _COORDINATES // spans)) if nodes is None else nodes,
            inner_diameter=shaft.bore,
            steps=tuple(_step(at, ring, shaft.of) for at, ring in _placed(shaft, steps)),
            constraints=(),
            **flags,
        )
        scene = Scene(line, *effects, spin=ConstantSpeed(speed), assumption=said)
    except ValueError as error:
        raise SceneError(f"{source}: {error}") from None
    return scene, left_out


# === the file


def _elements(source: str) -> list[_Element]:
    try:
        text = Path(source).read_bytes().decode("utf-8-sig")
        document = json.loads(text) if source.lower().endswith(".json") else tomllib.loads(text)
    except (OSError, ValueError, RecursionError) as error:
        reason = getattr(error, "strerror", None) or error
        refuse(source, f"cannot be read ({reason}); give a file that ROSS has written.")
    tables = document.items() if isinstance(document, dict) else ()
    found = [
        _Element(name.partition("_")[0], f"{source}: {name}", table)
        for name, table in tables
        if isinstance(table, dict) and name != "parameters" and not name.startswith("_")
    ]
    if not any(element.kind == "ShaftElement" for element in found):
        refuse(source, "has no shaft elements; give a file that ROSS has written by `Rotor.save`.")
    return found


def _at(element: _Element, places: dict[int, float]) -> float:
    if element.node not in places:
        refuse(
            f"{element.path}.n", f"must be a node of the shaft, but is {show(element.table['n'])}."
        )
    return places[element.node]


# === shaft


def _shaft(
    elements: Sequence[_Element], source: str, notes: _Notes
) -> tuple[dict[int, float], list[_Ring], bool, Table]:
    """Stations of the nodes, rings along the shaft, whether it is gyroscopic, and its flags."""
    own = [element for element in elements if element.kind == "ShaftElement"]
    for element in elements:
        if element.kind == "CouplingElement":
            refuse(
                element.path,
                "joins shafts by springs, but a scene has one shaft; save each rotor by itself.",
            )
    layers: dict[int, list[_Element]] = {}
    for element in sorted(own, key=lambda element: element.node):
        layers.setdefault(element.node, []).append(element)
        if element.number("L", "m") <= 0:
            refuse(f"{element.path}.L", f"must be positive, but is {show(element.table['L'])}.")
        for key, (unit, text) in _LEFT_OUT.items():
            if element.number(key, unit, 0.0):
                notes.add(f"{text} left out", element)
    first = min(layers)
    if sorted(layers) != list(range(first, first + len(layers))):
        refuse(source, "has shaft elements that do not make one line; save each rotor by itself.")
    places, rings = {first: 0.0}, []
    total = sum(element[0].number("L", "m") for element in layers.values())
    for node, layer in layers.items():
        length = layer[0].number("L", "m")
        places[node + 1] = places[node] + length
        rings += _rings(layer, length, total, notes)
    given = {key: _flag(own, key, notes) for key in ("shear_effects", "rotary_inertia")}
    shear, rotary = given.values()
    if shear and not rotary:
        notes.add("rotary inertia added, which shear needs", own[0])
    gyroscopic = _flag(own, "gyroscopic", notes)
    if shear and any(e.table.get("shear_method_calc", "cowper") != "cowper" for e in own):
        notes.add("shear coefficient by Cowper in place of Hutchinson", own[0])
    return places, rings, gyroscopic, {"shear": shear, "rotary_inertia": rotary or shear}


def _flag(elements: Sequence[_Element], key: str, notes: _Notes) -> bool:
    """What elements say of a flag; of several answers yes."""
    said = [element.table.get(key, True) for element in elements]
    for value, element in zip(said, elements, strict=True):
        if not isinstance(value, bool):
            refuse(f"{element.path}.{key}", f"must be true or false, but is {show(value)}.")
        if not value and any(said):
            notes.add(f"{key} taken into account all along the shaft", element)
    return any(said)


def _rings(layer: Sequence[_Element], length: float, total: float, notes: _Notes) -> list[_Ring]:
    """Uniform pieces of the elements between two nodes, one around the other."""
    for element in layer:
        if element.number("L", "m") != length:
            wanted = "must be that of the element which it surrounds"
            refuse(f"{element.path}.L", f"{wanted}, but is {show(element.table['L'])}.")
    sides = [
        [element.number(f"{of}{side}", "m") for of in ("od", "id") for side in "lr"]
        for element in layer
    ]
    tapered = any(
        left != right for ol, orr, il, ir in sides for left, right in [(ol, orr), (il, ir)]
    )
    pieces = max(1, min(_PIECES, int(length / (_SHORTEST * total)))) if tapered else 1
    if tapered:
        into = f"cut into {pieces} uniform ones" if pieces > 1 else "taken as a uniform one"
        notes.add(f"tapered element {into}", layer[0])
    materials = [_material(element) for element in layer]
    found = []
    for piece in range(pieces):
        share = (piece + 0.5) / pieces
        mean = lambda left, right, share=share: left + share * (right - left)
        rings = [
            _Ring(length / pieces, mean(ol, orr), mean(il, ir), material)
            for (ol, orr, il, ir), material in zip(sides, materials, strict=True)
        ]
        for ring, element in zip(rings, layer, strict=True):
            if not 0 <= ring.inner < ring.outer:
                wanted = "must be positive and above the inner diameter"
                refuse(f"{element.path}.odl", f"{wanted}, but is {ring.outer:g}.")
        found.append(_one(rings, layer[0], notes))
    return found


def _material(element: _Element) -> tuple[float, float, float]:
    table = element.table.get("material")
    if not isinstance(table, dict):
        refuse(f"{element.path}.material", f"must be a table, but is {show(table)}.")
    made = _Element("material", f"{element.path}.material", table)
    return made.number("E", "Pa"), made.number("rho", "kg/m^3"), made.number("G_s", "Pa")


def _one(rings: Sequence[_Ring], element: _Element, notes: _Notes) -> _Ring:
    """Rings around each other as one: exact where they touch and are of one material."""
    rings = sorted(rings, key=lambda ring: ring.inner)
    outer, inner = max(ring.outer for ring in rings), rings[0].inner
    touch = all(a.outer == b.inner for a, b in zip(rings, rings[1:], strict=False))
    if len({ring.of for ring in rings}) == 1 and touch:
        return rings[0]._replace(outer=outer)
    notes.add("layers taken as one ring of equal mass, bending and shear stiffness", element)
    area, second = (
        np.array([r.outer**k - r.inner**k for r in rings]) / (outer**k - inner**k) for k in (2, 4)
    )
    young, density, shear = np.array([ring.of for ring in rings]).T
    return _Ring(
        rings[0].length,
        outer,
        inner,
        (float(young @ second), float(density @ area), float(shear @ area)),
    )


def _merged(rings: Sequence[_Ring], total: float, notes: _Notes) -> list[_Ring]:
    """Rings of different sections: equal neighbours as one, those too short for one with the last."""
    found: list[_Ring] = []
    for ring in rings:
        if found and found[-1][1:] == ring[1:]:
            found[-1] = ring._replace(length=found[-1].length + ring.length)
        else:
            found.append(ring)
    short = [k for k, ring in enumerate(found) if ring.length < _SHORTEST * total]
    for k in reversed(short):
        if len(found) > 1:
            ring, other = found.pop(k), max(0, k - 1)
            found[other] = found[other]._replace(length=found[other].length + ring.length)
            text = "section shorter than 0.2 % of the shaft given the diameter of its neighbour"
            notes.add(text, _Element("", "", {"tag": f"{ring.length:g} m of {ring.outer:g} m"}))
    return found


def _placed(first: _Ring, rings: Sequence[_Ring]) -> Iterator[tuple[float, _Ring]]:
    """Rings after the first, with the stations where they begin."""
    at = first.length
    for ring in rings:
        yield at, ring
        at += ring.length


def _step(at: float, ring: _Ring, of: tuple[float, float, float]) -> Step:
    material = None if ring.of == of else Material(*ring.of)
    return Step(at, ring.outer, ring.bore, material)


# === what sits on it


def _discs(elements: Sequence[_Element], places: dict[int, float], notes: _Notes) -> Iterator[Disc]:
    for element in elements:
        if "Id" in element.table and "Ip" in element.table:
            if element.kind != "DiskElement":
                notes.add(f"{element.kind} taken for a disc", element)
            inertia = (element.number(key, "kg m^2") for key in ("Id", "Ip"))
            yield _made(element, Disc, _at(element, places), element.number("m", "kg"), *inertia)
        elif element.kind == "PointMass":
            along, across = (element.number(key, "kg") for key in ("mx", "my"))
            if element.node not in places:
                notes.add("mass of a flexible support left out", element)
                continue
            if along != across:
                notes.add("mass that differs along x and y taken as their mean", element)
            yield _made(element, Disc, _at(element, places), (along + across) / 2)


def _supports(
    elements: Sequence[_Element], places: dict[int, float], speed: float, notes: _Notes
) -> Iterator[Support]:
    bearings = [element for element in elements if "kxx" in element.table]
    of_ground = {e.node: e for e in bearings if e.node not in places}
    known = ("ShaftElement", "PointMass")
    for element in elements:
        if element.kind not in known and not {"kxx", "Ip"} & element.table.keys():
            notes.add(f"{element.kind} left out", element)
    for element in bearings:
        if element.node not in places:
            continue
        stiffness, damping = _coefficients(element, speed, notes)
        if element.table.get("n_link") is not None:
            below = of_ground.get(element.count("n_link"))
            if below is None:
                refuse(
                    f"{element.path}.n_link",
                    "must be the node of another bearing, on the ground; a scene has one shaft.",
                )
            own, other = (stiffness, damping), _coefficients(below, speed, notes)
            stiffness, damping = _series(element, own, other)
            notes.add(
                "bearing and its support taken as one, in series, with the damping of slow motions "
                "(omega C << K of either)",
                element,
            )
            ratio = max(speed * np.linalg.norm(c @ np.linalg.inv(k), 2) for k, c in (own, other))
            if ratio > _SLOW:
                notes.add(
                    f"damping of a bearing and its support in series too high at the speed of the scene, "
                    f"where omega C / K is {ratio:.2g}",
                    element,
                )
        if stiffness.any() or damping.any():
            matrices = (stiffness, damping if damping.any() else None)
            yield _made(element, Support.from_matrices, _at(element, places), *matrices)


def _coefficients(element: _Element, speed: float, notes: _Notes) -> tuple[np.ndarray, np.ndarray]:
    """Stiffness and damping [xx, xy; yx, yy] at a speed."""
    stiffness, damping, mass = (
        np.array([_value(element, letter + axes, unit, speed, notes) for axes in _AXES])
        for letter, unit in (_STIFFNESS, _DAMPING, ("m", "kg"))
    )
    if mass.any():
        notes.add("inertia of a bearing or seal (mxx, ..) left out", element)
    if any(_value(element, key, unit, speed, notes) for key, unit in _axial().items()):
        notes.add("axial stiffness and damping left out", element)
    return stiffness.reshape(2, 2), damping.reshape(2, 2)


def _axial() -> dict[str, str]:
    return {f"{letter}zz": unit for letter, unit in (_STIFFNESS, _DAMPING)}


def _value(element: _Element, key: str, unit: str, speed: float, notes: _Notes) -> float:
    """A coefficient at a speed."""
    missing = element.table.get(f"{key[0]}xx", 0.0) if key[1:] == "yy" else 0.0
    given, path = element.table.get(key, missing), f"{element.path}.{key}"
    values = given if isinstance(given, list) else [given]
    numbers = [quantity(value, unit, path) for value in values]
    if len(numbers) == 1:
        return numbers[0]
    frequency = element.table.get("frequency")
    if not isinstance(frequency, list) or not numbers or len(frequency) != len(numbers):
        wanted = "must be a list of as many numbers as the coefficients"
        refuse(f"{element.path}.frequency", f"{wanted}, but is {show(frequency)}.")
    at = [quantity(value, "rad/s", f"{element.path}.frequency") for value in frequency]
    if any(b <= a for a, b in zip(at, at[1:], strict=False)):
        refuse(f"{element.path}.frequency", f"must be ascending, but is {show(frequency)}.")
    if len(set(numbers)) == 1:
        return numbers[0]
    from scipy.interpolate import UnivariateSpline

    if not at[0] <= speed <= at[-1]:
        notes.add(
            f"coefficients for {at[0]:g} to {at[-1]:g} rad/s taken at the nearer end", element
        )
    notes.add("coefficients that depend on speed taken at the speed of the scene", element)
    spline = UnivariateSpline(at, numbers, k=min(3, len(at) - 1), s=0)
    return float(np.asarray(spline(min(max(speed, at[0]), at[-1]))))


def _series(
    element: _Element,
    one: tuple[np.ndarray, np.ndarray],
    other: tuple[np.ndarray, np.ndarray],
) -> tuple[np.ndarray, np.ndarray]:
    """`Z = (Z1^-1 + Z2^-1)^-1` of `Z = K + s C`, to first order in s."""
    try:
        soft = [np.linalg.inv(stiffness) for stiffness, _ in (one, other)]
        stiffness = np.linalg.inv(sum(soft))
    except np.linalg.LinAlgError:
        refuse(element.path, "and its support must have stiffness along both axes.")
    loss = sum(a @ c @ a for a, (_, c) in zip(soft, (one, other), strict=True))
    return stiffness, stiffness @ loss @ stiffness


def _made(element: _Element, build: Any, *values: Any) -> Any:
    try:
        with np.errstate(over="ignore"):  # what is not finite is refused
            return build(*values)
    except ValueError as error:
        raise SceneError(f"{element.path}: {error}") from None
