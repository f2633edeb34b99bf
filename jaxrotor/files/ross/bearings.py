"""Discs, casings and supports from the elements of ROSS on the shaft and beside it."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from ...effects import Casing, Disc, Support
from ..units import SceneError, quantity, refuse, show
from .file import Element, Notes, station


_SLOW = 0.3  # omega C / K up to which two in series damp nearly as in slow motions
_AXES = ("xx", "xy", "yx", "yy")
_STIFFNESS, _DAMPING = ("k", "N/m"), ("c", "N s/m")


def discs(elements: Sequence[Element], places: dict[int, float], notes: Notes) -> Iterator[Disc]:
    """Discs from disk elements, and from point masses on the shaft."""
    for element in elements:
        if "Id" in element.table and "Ip" in element.table:
            if element.kind != "DiskElement":
                notes.add(f"{element.kind} is taken as a disc", element)
            inertia = (element.number(key, "kg m^2") for key in ("Id", "Ip"))
            yield _made(
                element, Disc, station(element, places), element.number("m", "kg"), *inertia
            )
        elif element.kind == "PointMass" and element.node in places:
            yield _made(element, Disc, station(element, places), _mass(element, notes))


def casings(elements: Sequence[Element], places: dict[int, float]) -> dict[int, str]:
    """Names of casings by their nodes: point masses beside the shaft that a bearing holds or stands on."""
    bearings = [element for element in elements if "kxx" in element.table]
    links = [e for e in bearings if e.table.get("n_link") is not None]
    held = {e.node for e in bearings} | {e.count("n_link") for e in links}
    found: dict[int, str] = {}
    for element in elements:
        if element.kind == "PointMass" and element.node in held.difference(places, found):
            taken = element.name in found.values()
            found[element.node] = f"{element.name} {element.node}" if taken else element.name
    return found


def housed(
    elements: Sequence[Element], names: dict[int, str], places: dict[int, float], notes: Notes
) -> Iterator[Casing]:
    """Casings with the point masses at their nodes."""
    masses = [element for element in elements if element.kind == "PointMass"]
    for node, name in names.items():
        own = [element for element in masses if element.node == node]
        yield _made(own[0], Casing, name, sum(_mass(element, notes) for element in own))
    for element in masses:
        if element.node not in places and element.node not in names:
            notes.add("mass that no bearing holds is left out", element)


def _mass(element: Element, notes: Notes) -> float:
    """Mass of a point mass, the mean of those along x and y."""
    along, across = (element.number(key, "kg") for key in ("mx", "my"))
    if along != across:
        notes.add("mass that differs along x and y is replaced by its mean", element)
    return (along + across) / 2


def supports(
    elements: Sequence[Element],
    places: dict[int, float],
    names: dict[int, str],
    speed: float,
    notes: Notes,
) -> Iterator[Support]:
    """Supports from bearings and seals, with their coefficients at a speed [rad/s].

    `names` are those of casings by their nodes.
    """
    bearings = [element for element in elements if "kxx" in element.table]
    of_ground = {e.node: e for e in bearings if e.node not in places and e.node not in names}
    known = ("ShaftElement", "PointMass")
    for element in elements:
        if element.kind not in known and not {"kxx", "Ip"} & element.table.keys():
            notes.add(f"{element.kind} is left out", element)
    for element in bearings:
        if element.node not in places and element.node not in names:
            continue
        ends: dict[str, Any] = {"of": names.get(element.node)}
        if element.node in places:
            ends = {"at": station(element, places)}
        stiffness, damping = _coefficients(element, speed, notes)
        link = None if element.table.get("n_link") is None else element.count("n_link")
        if link in names:
            ends["on"] = names[link]
        elif link is not None:
            below = of_ground.get(link)
            if below is None:
                refuse(
                    f"{element.path}.n_link",
                    "must be the node of another bearing, on the ground; a scene has one shaft.",
                )
            own, other = (stiffness, damping), _coefficients(below, speed, notes)
            stiffness, damping = _series(element, own, other)
            notes.add(
                "bearing and its support are taken as one, in series, with the damping of slow motions "
                "(omega C << K of either)",
                element,
            )
            ratio = max(speed * np.linalg.norm(c @ np.linalg.inv(k), 2) for k, c in (own, other))
            if ratio > _SLOW:
                notes.add(
                    f"damping of a bearing and its support in series is too high at the speed of the "
                    f"scene, where omega C / K is {ratio:.2g}",
                    element,
                )
        if stiffness.any() or damping.any():
            ends |= {"stiffness": stiffness, "damping": damping if damping.any() else None}
            yield _made(element, Support, **ends)


def _coefficients(element: Element, speed: float, notes: Notes) -> tuple[np.ndarray, np.ndarray]:
    """Matrices of stiffness and damping, [[xx, xy], [yx, yy]], at a speed."""
    stiffness, damping, mass = (
        np.array([_value(element, letter + axes, unit, speed, notes) for axes in _AXES])
        for letter, unit in (_STIFFNESS, _DAMPING, ("m", "kg"))
    )
    if mass.any():
        notes.add("inertia of a bearing or seal (mxx, ..) is left out", element)
    if any(_value(element, key, unit, speed, notes) for key, unit in _axial().items()):
        notes.add("axial stiffness and damping are left out", element)
    return stiffness.reshape(2, 2), damping.reshape(2, 2)


def _axial() -> dict[str, str]:
    """Axial coefficients with their units."""
    return {f"{letter}zz": unit for letter, unit in (_STIFFNESS, _DAMPING)}


def _value(element: Element, key: str, unit: str, speed: float, notes: Notes) -> float:
    """Coefficient at a speed, interpolated if the file has a table."""
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
            f"coefficients for {at[0]:g} to {at[-1]:g} rad/s are taken at the nearer end", element
        )
    notes.add("coefficients that depend on speed are taken at the speed of the scene", element)
    spline = UnivariateSpline(at, numbers, k=min(3, len(at) - 1), s=0)
    return float(np.asarray(spline(min(max(speed, at[0]), at[-1]))))


def _series(
    element: Element,
    one: tuple[np.ndarray, np.ndarray],
    other: tuple[np.ndarray, np.ndarray],
) -> tuple[np.ndarray, np.ndarray]:
    """Stiffness and damping of two in series: `Z = (Z1^-1 + Z2^-1)^-1`, `Z = K + s C`, to order s."""
    try:
        soft = [np.linalg.inv(stiffness) for stiffness, _ in (one, other)]
        stiffness = np.linalg.inv(sum(soft))
    except np.linalg.LinAlgError:
        refuse(element.path, "and its support must have stiffness along both axes.")
    loss = sum(a @ c @ a for a, (_, c) in zip(soft, (one, other), strict=True))
    return stiffness, stiffness @ loss @ stiffness


def _made(element: Element, build: Any, *values: Any, **named: Any) -> Any:
    """Result of `build(*values, **named)`, with the path of the element in the message of an error."""
    try:
        with np.errstate(over="ignore"):  # infinite values are refused by `build`
            return build(*values, **named)
    except ValueError as error:
        raise SceneError(f"{element.path}: {error}") from None
