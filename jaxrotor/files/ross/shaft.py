"""Shaft as uniform rings, from the elements of ROSS along it and around each other."""

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from ...shafts import Step
from ...shafts.materials import Material
from ..units import refuse, show
from .file import Element, Notes, Table


_PIECES = 4  # number of uniform pieces of a tapered element
_SHORTEST = 0.0021  # least distance of steps, over the length of the shaft
_LEFT_OUT = {  # properties of a shaft element that are not carried over
    "axial_force": ("N", "axial force"),
    "torque": ("N m", "torque"),
    "alpha": ("1/s", "damping in proportion to mass (alpha)"),
    "beta": ("s", "damping in proportion to stiffness (beta)"),
}


class Ring(NamedTuple):
    """Uniform piece of a shaft."""

    length: float
    outer: float
    inner: float
    of: tuple[float, float, float]  # Young's modulus, density, shear modulus

    @property
    def bore(self) -> Any:
        """Inner diameter, None if the ring is solid."""
        return self.inner or None


def sections(
    elements: Sequence[Element], source: str, notes: Notes
) -> tuple[dict[int, float], list[Ring], bool, Table]:
    """Stations of the nodes, rings along the shaft, whether it is gyroscopic, and flags of the shaft."""
    own = [element for element in elements if element.kind == "ShaftElement"]
    for element in elements:
        if element.kind == "CouplingElement":
            refuse(
                element.path,
                "joins shafts by springs, but a scene has one shaft; save each rotor by itself.",
            )
    layers: dict[int, list[Element]] = {}
    for element in sorted(own, key=lambda element: element.node):
        layers.setdefault(element.node, []).append(element)
        if element.number("L", "m") <= 0:
            refuse(f"{element.path}.L", f"must be positive, but is {show(element.table['L'])}.")
        for key, (unit, text) in _LEFT_OUT.items():
            if element.number(key, unit, 0.0):
                notes.add(f"{text} is left out", element)
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
        notes.add("rotary inertia is added, which shear needs", own[0])
    gyroscopic = _flag(own, "gyroscopic", notes)
    if shear and any(e.table.get("shear_method_calc", "cowper") != "cowper" for e in own):
        notes.add("shear coefficient is that of Cowper in place of Hutchinson", own[0])
    return places, rings, gyroscopic, {"shear": shear, "rotary_inertia": rotary or shear}


def _flag(elements: Sequence[Element], key: str, notes: Notes) -> bool:
    """Value of a flag; True if elements differ."""
    said = [element.table.get(key, True) for element in elements]
    for value, element in zip(said, elements, strict=True):
        if not isinstance(value, bool):
            refuse(f"{element.path}.{key}", f"must be true or false, but is {show(value)}.")
        if not value and any(said):
            notes.add(f"{key} is taken into account all along the shaft", element)
    return any(said)


def _rings(layer: Sequence[Element], length: float, total: float, notes: Notes) -> list[Ring]:
    """Uniform pieces of the elements between two nodes, which surround each other."""
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
    materials = [_material(element) for element in layer]
    found = []
    for piece in range(pieces):
        share = (piece + 0.5) / pieces
        mean = lambda left, right, share=share: left + share * (right - left)
        rings = [
            Ring(length / pieces, mean(ol, orr), mean(il, ir), material)
            for (ol, orr, il, ir), material in zip(sides, materials, strict=True)
        ]
        for ring, element in zip(rings, layer, strict=True):
            if not 0 <= ring.inner < ring.outer:
                wanted = "must be positive and above the inner diameter"
                refuse(f"{element.path}.odl", f"{wanted}, but is {ring.outer:g}.")
        found.append(_combined(rings, layer[0], notes))
    if tapered:
        into = f"cut into {pieces} uniform ones" if pieces > 1 else "taken as a uniform one"
        error = _error_of_pieces(sides, [young for young, *_ in materials], pieces)
        notes.add(f"tapered element is {into}, whose flexibility is off by up to", layer[0], error)
    return found


def _error_of_pieces(sides: Any, young: Any, pieces: int) -> float:
    """Largest relative error of the flexibility `Int dx / EI` of uniform pieces of tapered layers."""
    nodes, weights = np.polynomial.legendre.leggauss(8)
    ends = np.reshape(sides, (-1, 2, 2, 1, 1))  # of outer and inner diameters, left and right
    ways = np.array([1.0, -1.0])  # outer less inner

    def rigidity(places: np.ndarray) -> np.ndarray:
        share = (np.arange(pieces)[:, None] + places) / pieces
        diameters = ends[:, :, 0] + share * (ends[:, :, 1] - ends[:, :, 0])
        return np.einsum("l,s,lspn->pn", young, ways, diameters**4)

    mean = (1 / rigidity((1 + nodes) / 2)) @ weights / 2
    return float(np.max(np.abs(rigidity(np.array([0.5]))[:, 0] * mean - 1)))


def _material(element: Element) -> tuple[float, float, float]:
    """Young's modulus, density and shear modulus of an element."""
    table = element.table.get("material")
    if not isinstance(table, dict):
        refuse(f"{element.path}.material", f"must be a table, but is {show(table)}.")
    made = Element("material", f"{element.path}.material", table)
    return made.number("E", "Pa"), made.number("rho", "kg/m^3"), made.number("G_s", "Pa")


def _combined(rings: Sequence[Ring], element: Element, notes: Notes) -> Ring:
    """Rings around each other as one; exact if they touch and have the same material."""
    rings = sorted(rings, key=lambda ring: ring.inner)
    outer, inner = max(ring.outer for ring in rings), rings[0].inner
    touch = all(a.outer == b.inner for a, b in zip(rings, rings[1:], strict=False))
    if len({ring.of for ring in rings}) == 1 and touch:
        return rings[0]._replace(outer=outer)
    area, second = (
        np.array([r.outer**k - r.inner**k for r in rings]) / (outer**k - inner**k) for k in (2, 4)
    )
    young, density, shear = np.array([ring.of for ring in rings]).T
    error = abs(float(density @ area) / float(density @ second) - 1)
    notes.add(
        "layers are taken as one ring of equal mass, bending and shear stiffness, whose rotary inertia is "
        "off by up to",
        element,
        error,
    )
    return Ring(
        rings[0].length,
        outer,
        inner,
        (float(young @ second), float(density @ area), float(shear @ area)),
    )


def merged(rings: Sequence[Ring], total: float, notes: Notes) -> list[Ring]:
    """Rings with equal neighbours joined, and with those that are too short joined to a neighbour."""
    found: list[Ring] = []
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
            text = "section shorter than 0.2 % of the shaft gets the diameter of its neighbour"
            notes.add(text, Element("", "", {"tag": f"{ring.length:g} m of {ring.outer:g} m"}))
    return found


def placed(first: Ring, rings: Sequence[Ring]) -> Iterator[tuple[float, Ring]]:
    """Rings after the first, each with the station where it begins."""
    at = first.length
    for ring in rings:
        yield at, ring
        at += ring.length


def step(at: float, ring: Ring, of: tuple[float, float, float]) -> Step:
    """Step to a ring, with its own material if that differs from the one given."""
    material = None if ring.of == of else Material(*ring.of)
    return Step(at, ring.outer, ring.bore, material)
