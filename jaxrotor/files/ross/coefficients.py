"""Coefficients of bearings and seals of ROSS, numbers or tables over the speed and the whirl frequency.

Files of ROSS 2 call the speeds of a table `frequency`, those of ROSS 3 `speed`; there `frequency` is that
of the whirl, and a table over both has a row for every speed.
"""

from typing import Any, NamedTuple

import numpy as np

from ...effects.coefficients import AXES, COEFFICIENTS, check_whole
from ..units import SceneError, quantity, refuse, show
from .file import Element, Notes


_UNITS = {"k": "N/m", "c": "N s/m", "m": "kg"}


class Coefficients(NamedTuple):
    """Matrices [[xx, xy], [yx, yy]] at `w` speeds by `f` frequencies of whirl, one where none is given."""

    speeds: np.ndarray | None  # (w,) [rad/s]; None: the same at every speed
    frequencies: np.ndarray | None  # (f,) [rad/s]; None: the same at every frequency
    stiffness: np.ndarray  # (w, f, 2, 2) [N/m]
    damping: np.ndarray  # (w, f, 2, 2) [N s/m]
    interpolation: str = "pchip"  # between the nodes of tables, or "linear"
    mass: float = 0.0  # added mass, the same along x and y [kg]
    implied: str = ""  # letters of the matrices whose yy the file leaves out, so that it is xx

    def at(self, speeds: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Stiffness and damping (v, 2, 2) of synchronous whirl at speeds (v,), as at the ends beyond."""
        stiffness, damping = (
            np.stack([self._synchronous(one, speed) for speed in speeds])
            for one in (self.stiffness, self.damping)
        )
        return stiffness, damping

    def _synchronous(self, matrices: np.ndarray, speed: float) -> np.ndarray:
        for nodes in (self.speeds, self.frequencies):
            if nodes is None:
                matrices = matrices[0]
            else:
                at = np.clip(speed, nodes[0], nodes[-1])
                matrices = _interpolated(self.interpolation, nodes, matrices, at)
        return matrices

    @property
    def of_support(self) -> dict[str, Any]:
        """Arguments of a support: a coefficient that is the same everywhere is a number.

        What the file leaves out is left out, so that `kyy` follows a `kxx` that is changed later.
        """
        found: dict[str, Any] = {}
        given = {"speeds": self.speeds, "frequencies": self.frequencies}
        shape = [nodes.size for nodes in given.values() if nodes is not None]
        for letter, matrix in zip("kc", (self.stiffness, self.damping), strict=True):
            if letter == "c" and not matrix.any():
                continue
            same = letter in self.implied and np.array_equal(matrix[..., 0, 0], matrix[..., 1, 1])
            own = AXES[:3] if same else AXES
            for axes, values in zip(own, matrix.reshape(-1, 4).T, strict=False):
                found[letter + axes] = values.reshape(shape) if np.ptp(values) else values[0]
        if any(np.ndim(value) for value in found.values()):
            found |= given | {"hold": True, "interpolation": self.interpolation}
        return found | ({"mxx": self.mass} if self.mass else {})


def _interpolated(kind: str, nodes: np.ndarray, values: np.ndarray, at: Any) -> np.ndarray:
    """Values at a place by a kind of interpolation along the first axis."""
    from scipy.interpolate import PchipInterpolator, interp1d

    of = PchipInterpolator if kind == "pchip" else interp1d
    return np.asarray(of(nodes, values, axis=0)(at))


def is_bearing(element: Element) -> bool:
    """Whether an element has coefficients of a bearing or seal."""
    return not element.table.keys().isdisjoint(COEFFICIENTS)


def coefficients(element: Element, speed: float, notes: Notes) -> Coefficients:
    """Coefficients of a bearing or seal; notes tell what is changed in a scene at a speed [rad/s]."""
    if element.table.get("kxx") is None:
        refuse(f"{element.path}.kxx", "is missing; a bearing or seal needs it, 0 if it has none.")
    try:
        check_whole(element.table)
    except ValueError as error:
        raise SceneError(f"{element.path}: {error}") from None
    planar = {letter + axes: unit for letter, unit in _UNITS.items() for axes in AXES}
    axial = {f"{letter}zz": _UNITS[letter] for letter in _UNITS}
    found = {key: _numbers(element, key, unit) for key, unit in (planar | axial).items()}
    masses = np.concatenate([found["mxx"].ravel(), found["myy"].ravel()])
    mass = max(float(masses.mean()), 0.0)
    if np.ptp(masses) or found["mxy"].any() or found["myx"].any() or masses.min() < 0:
        told = f"inertia of a bearing or seal is {mass:.4g} kg, the mean of mxx and myy or 0"
        notes.add(told, element)
    if any(found[key].any() for key in axial):
        notes.add("axial stiffness, damping and inertia are left out", element)
    own = {key: values for key, values in found.items() if key in planar and key[0] != "m"}
    nodes = _nodes_of(element, own)
    every = np.stack(np.broadcast_arrays(*own.values()))
    for axis, name in enumerate(("speed", "frequency"), 1):
        if nodes[name] is not None and not np.ptp(every, axis=axis).any():
            nodes[name], every = None, np.take(every, [0], axis)
    matrices = np.moveaxis(every, 0, -1).reshape(*every.shape[1:], 2, 2, 2)
    speeds = nodes["speed"]
    if speeds is not None and not speeds[0] <= speed <= speeds[-1]:
        ends = f"{speeds[0]:g} to {speeds[-1]:g} rad/s"
        notes.add(f"coefficients for {ends} are taken at the nearer end", element)
    tabled = any(one is not None for one in nodes.values())
    kind = element.table.get("interpolation")
    if tabled and kind not in (None, "pchip", "linear"):
        notes.add(f"interpolation by {show(kind)} is replaced by PCHIP", element)
    elif speeds is not None and element.version < 3 and kind is None:
        notes.add(
            "coefficients that depend on speed are interpolated by PCHIP, as by ROSS 3", element
        )
    kind = "linear" if kind == "linear" else "pchip"
    implied = "".join(letter for letter in "kc" if element.table.get(f"{letter}yy") is None)
    return Coefficients(
        speeds, nodes["frequency"], matrices[:, :, 0], matrices[:, :, 1], kind, mass, implied
    )


def _numbers(element: Element, key: str, unit: str) -> np.ndarray:
    """Values of a coefficient, (1,), (w,) or (w, f)."""
    names = [key, *[f"{key[0]}xx"] * (key[1:] == "yy")]
    values = (element.table.get(name) for name in names)
    given: Any = next((one for one in values if one is not None), 0.0)
    path = f"{element.path}.{key}"
    rows = given if isinstance(given, list) else [given]
    if not rows:
        refuse(path, f"must be a number or a list of numbers, but is {show(given)}.")
    if not any(isinstance(row, list) for row in rows):
        return np.array([quantity(one, unit, path) for one in rows])
    if not all(isinstance(row, list) and len(row) == len(rows[0]) for row in rows) or not rows[0]:
        refuse(path, f"must be a list of rows of equal length, but is {show(given)}.")
    return np.array([[quantity(one, unit, path) for one in row] for row in rows])


def _nodes_of(element: Element, own: dict[str, np.ndarray]) -> dict[str, np.ndarray | None]:
    """Nodes of tables over "speed" and "frequency" of whirl; coefficients become arrays (w, f)."""
    nodes: dict[str, np.ndarray | None] = {"speed": None, "frequency": None}
    rows = max(len(values) for values in own.values())
    if rows > 1 or any(values.ndim > 1 for values in own.values()):
        key = "frequency"
        if element.version >= 3 and element.table.get("speed") is not None:
            key = "speed"
        columns = {values.shape[1] for values in own.values() if values.ndim > 1}
        if columns and (key != "speed" or len(columns) > 1):
            refuse(element.path, "must have tables over `speed` and `frequency` of one shape.")
        nodes["frequency" if element.version >= 3 and key == "frequency" else "speed"] = _nodes(
            element, key, rows
        )
        if columns:
            nodes["frequency"] = _nodes(element, "frequency", columns.pop())
    along = -1 if nodes["speed"] is None and nodes["frequency"] is not None else 0
    for name, values in own.items():
        if values.size > 1 and len(values) != rows:
            wanted = f"must be a list of {rows} numbers, as many as other coefficients have"
            refuse(f"{element.path}.{name}", f"{wanted}, but has {len(values)}.")
        if values.ndim == 1:
            own[name] = values[None] if along else values[:, None]
    return nodes


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
