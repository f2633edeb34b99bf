"""Coefficients of bearings and seals of ROSS, numbers or tables over the speed of rotation.

Files of ROSS 2 call the speeds of a table `frequency`, those of ROSS 3 `speed`; there `frequency` is that
of the whirl, and a table over both has a row for every speed.
"""

from typing import Any, NamedTuple

import numpy as np

from ..units import quantity, refuse, show
from .file import Element, Notes


_AXES = ("xx", "xy", "yx", "yy")
_UNITS = {"k": "N/m", "c": "N s/m", "m": "kg"}


class Coefficients(NamedTuple):
    """Matrices [[xx, xy], [yx, yy]] at `w` speeds, or one of each that holds at all."""

    speeds: np.ndarray | None  # (w,) [rad/s]
    stiffness: np.ndarray  # (w, 2, 2) [N/m]
    damping: np.ndarray  # (w, 2, 2) [N s/m]

    def at(self, speeds: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Stiffness and damping at speeds (v,), beyond the ends as there."""
        matrices = self.stiffness, self.damping
        if self.speeds is None:
            both = [np.broadcast_to(one, (speeds.size, 2, 2)) for one in matrices]
        else:
            within = np.clip(speeds, self.speeds[0], self.speeds[-1])
            both = [_interpolated(self.speeds, one, within) for one in matrices]
        return both[0], both[1]

    @property
    def of_support(self) -> dict[str, Any]:
        """Arguments of a support: a coefficient that is the same at every speed is a number."""
        found: dict[str, Any] = {}
        for letter, matrix in zip("kc", (self.stiffness, self.damping), strict=True):
            if letter == "c" and not matrix.any():
                continue
            for axes, values in zip(_AXES, matrix.reshape(-1, 4).T, strict=True):
                found[letter + axes] = values if np.ptp(values) else values[0]
        if any(np.ndim(value) for value in found.values()):
            found |= {"speeds": self.speeds, "hold": True}
        return found


def _interpolated(nodes: np.ndarray, values: np.ndarray, at: Any) -> np.ndarray:
    """Values at a place by PCHIP along the first axis."""
    from scipy.interpolate import PchipInterpolator

    return np.asarray(PchipInterpolator(nodes, values, axis=0)(at))


def coefficients(element: Element, speed: float, notes: Notes) -> Coefficients:
    """Coefficients of a bearing or seal; notes tell what is changed in a scene at a speed [rad/s]."""
    planar = {letter + axes: unit for letter, unit in _UNITS.items() for axes in _AXES}
    axial = {f"{letter}zz": _UNITS[letter] for letter in "kc"}
    found = {key: _numbers(element, key, unit) for key, unit in (planar | axial).items()}
    if any(found[key].any() for key in planar if key[0] == "m"):
        notes.add("inertia of a bearing or seal (mxx, ..) is left out", element)
    if any(found[key].any() for key in axial):
        notes.add("axial stiffness and damping are left out", element)
    own = {key: values for key, values in found.items() if key in planar and key[0] != "m"}
    speeds = None
    if any(values.size > 1 for values in own.values()):
        speeds, own = _over_speed(element, own, notes)
    both = [np.stack(np.broadcast_arrays(*(own[l + a] for a in _AXES)), axis=1) for l in "kc"]
    stiffness, damping = (one.reshape(-1, 2, 2) for one in np.broadcast_arrays(*both))
    if speeds is None or not (np.ptp(stiffness, axis=0).any() or np.ptp(damping, axis=0).any()):
        return Coefficients(None, stiffness[:1], damping[:1])
    if not speeds[0] <= speed <= speeds[-1]:
        ends = f"{speeds[0]:g} to {speeds[-1]:g} rad/s"
        notes.add(f"coefficients for {ends} are taken at the nearer end", element)
    if element.version < 3:
        notes.add(
            "coefficients that depend on speed are interpolated by PCHIP, as by ROSS 3", element
        )
    return Coefficients(speeds, stiffness, damping)


def _numbers(element: Element, key: str, unit: str) -> np.ndarray:
    """Values of a coefficient, (1,), (w,) or (w, f)."""
    missing = element.table.get(f"{key[0]}xx", 0.0) if key[1:] == "yy" else 0.0
    given, path = element.table.get(key, missing), f"{element.path}.{key}"
    rows = given if isinstance(given, list) else [given]
    if not rows:
        refuse(path, f"must be a number or a list of numbers, but is {show(given)}.")
    if not any(isinstance(row, list) for row in rows):
        return np.array([quantity(one, unit, path) for one in rows])
    if not all(isinstance(row, list) and len(row) == len(rows[0]) for row in rows) or not rows[0]:
        refuse(path, f"must be a list of rows of equal length, but is {show(given)}.")
    return np.array([[quantity(one, unit, path) for one in row] for row in rows])


def _over_speed(
    element: Element, own: dict[str, np.ndarray], notes: Notes
) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Speeds of a table, and every coefficient at these, or the number that holds at all."""
    key = "frequency"
    if element.version >= 3 and element.table.get("speed") is not None:
        key = "speed"
    wide = any(values.ndim > 1 for values in own.values())
    rows = max(len(values) for values in own.values())
    speeds = _nodes(element, key, rows)
    for name, values in own.items():
        if values.size > 1 and len(values) != rows:
            wanted = f"must be a list of {rows} numbers, as many as other coefficients have"
            refuse(f"{element.path}.{name}", f"{wanted}, but has {len(values)}.")
    if key == "frequency" and element.version >= 3:
        notes.add(
            "coefficients that depend on whirl frequency are taken as those over speed", element
        )
    if not wide:
        return speeds, own
    columns = {values.shape[1] for values in own.values() if values.ndim > 1}
    if key != "speed" or len(columns) > 1:
        refuse(element.path, "must have tables over `speed` and `frequency` of one shape.")
    whirl = _nodes(element, "frequency", columns.pop())
    notes.add("coefficients over speed and whirl frequency are those of synchronous whirl", element)
    at = np.clip(speeds, whirl[0], whirl[-1])
    for name, values in own.items():
        if values.ndim > 1:
            rows_of = zip(values, at, strict=True)
            own[name] = np.array([_interpolated(whirl, row, one) for row, one in rows_of])
    return speeds, own


def _nodes(element: Element, key: str, count: int) -> np.ndarray:
    """Ascending nodes of a table."""
    given, path = element.table.get(key), f"{element.path}.{key}"
    if not isinstance(given, list) or len(given) != count:
        wanted = "must be a list of as many numbers as the coefficients"
        refuse(path, f"{wanted}, but is {show(given)}.")
    nodes = np.array([quantity(value, "rad/s", path) for value in given])
    if (np.diff(nodes) <= 0).any():
        refuse(path, f"must be ascending, but is {show(given)}.")
    return nodes
