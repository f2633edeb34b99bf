"""Discs, casings and supports from the elements of ROSS on the shaft and beside it."""

import functools
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from ...effects import Casing, Disc, Support
from ..units import SceneError, refuse
from .coefficients import Coefficients, coefficients, is_bearing
from .file import Element, Notes, station


_SLOW = 0.3  # omega C / K up to which two in series damp nearly as in slow motions


def discs(elements: Sequence[Element], places: dict[int, float], notes: Notes) -> Iterator[Disc]:
    """Discs from disk elements, and from point masses on the shaft."""
    for element in elements:
        if _is_disc(element):
            if element.kind != "DiskElement":
                notes.add(f"{element.kind} is taken as a disc", element)
            inertia = (element.number(key, "kg m^2") for key in ("Id", "Ip"))
            yield _made(
                element, Disc, station(element, places), element.number("m", "kg"), *inertia
            )
        elif element.kind == "PointMass" and element.node in places:
            yield _made(element, Disc, station(element, places), _mass(element, notes))


def _is_disc(element: Element) -> bool:
    """Whether an element is a disc, or has a moment of inertia."""
    return element.kind == "DiskElement" or not element.table.keys().isdisjoint(("Id", "Ip"))


def casings(elements: Sequence[Element], places: dict[int, float]) -> dict[int, str]:
    """Names of casings by their nodes: point masses beside the shaft that a bearing holds or stands on."""
    bearings = [element for element in elements if is_bearing(element)]
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
    """Supports from bearings and seals of a scene at a speed [rad/s].

    `names` are those of casings by their nodes.
    """
    bearings = [element for element in elements if is_bearing(element)]
    of_ground = {e.node: e for e in bearings if e.node not in places and e.node not in names}
    known = ("ShaftElement", "PointMass")
    for element in elements:
        if element.kind not in known and not is_bearing(element) and not _is_disc(element):
            notes.add(f"{element.kind} is left out", element)
    for element in bearings:
        if element.node not in places and element.node not in names:
            continue
        ends: dict[str, Any] = {"of": names.get(element.node)}
        if element.node in places:
            ends = {"at": station(element, places)}
        own = coefficients(element, speed, notes)
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
            other = coefficients(below, speed, notes)
            now = [each.at(np.array([speed])) for each in (own, other)]
            own = _series(element, own, other, notes)
            notes.add(
                "bearing and its support are taken as one, in series, with the damping of slow motions "
                "(omega C << K of either)",
                element,
            )
            ratio = max(speed * np.linalg.norm(c[0] @ np.linalg.inv(k[0]), 2) for k, c in now)
            if ratio > _SLOW:
                notes.add(
                    f"damping of a bearing and its support in series is too high at the speed of the "
                    f"scene, where omega C / K is {ratio:.2g}",
                    element,
                )
        if own.stiffness.any() or own.damping.any() or own.mass:
            yield _made(element, Support, **ends, **own.of_support)


def _series(element: Element, one: Coefficients, other: Coefficients, notes: Notes) -> Coefficients:
    """Coefficients of two in series: `Z = (Z1^-1 + Z2^-1)^-1`, `Z = K + s C`, to order s.

    Of tables they are computed at the nodes of all, where these have a range in common. Those over the
    frequency of whirl are taken at synchronous whirl.
    """
    every = one.speeds, one.frequencies, other.speeds, other.frequencies
    given = [nodes for nodes in every if nodes is not None]
    if one.frequencies is not None or other.frequencies is not None:
        notes.add("coefficients over whirl frequency are those of synchronous whirl", element)
    if one.mass or other.mass:
        notes.add("inertia of a bearing and its support in series (mxx, ..) is left out", element)
    speeds = None
    if given:
        low, high = max(nodes[0] for nodes in given), min(nodes[-1] for nodes in given)
        if low >= high:
            refuse(
                element.path, "and its support must have tables with a range of speeds in common."
            )
        joined = functools.reduce(np.union1d, given)
        speeds = joined[(joined >= low) & (joined <= high)]
    parts = [each.at(np.zeros(1) if speeds is None else speeds) for each in (one, other)]
    try:
        soft = [np.linalg.inv(stiffness) for stiffness, _ in parts]
        stiffness = np.linalg.inv(soft[0] + soft[1])
    except np.linalg.LinAlgError:
        refuse(element.path, "and its support must have stiffness along both axes.")
    loss = sum(a @ c @ a for a, (_, c) in zip(soft, parts, strict=True))
    damping = stiffness @ loss @ stiffness
    if {one.interpolation, other.interpolation} == {"linear", "pchip"} and given:
        notes.add(
            "tables in series, one linear and one by PCHIP, are interpolated by PCHIP", element
        )
    kind = one.interpolation if one.interpolation == other.interpolation else "pchip"
    implied = "kc" if one.implied == other.implied == "kc" else ""
    return Coefficients(speeds, None, stiffness[:, None], damping[:, None], kind, implied=implied)


def _made(element: Element, build: Any, *values: Any, **named: Any) -> Any:
    """Result of `build(*values, **named)`, with the path of the element in the message of an error."""
    try:
        with np.errstate(over="ignore"):  # infinite values are refused by `build`
            return build(*values, **named)
    except ValueError as error:
        raise SceneError(f"{element.path}: {error}") from None
