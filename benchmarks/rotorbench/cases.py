"""The cases: what `cases.toml` and `references.toml` say, and the errors of answers.

The standard library and NumPy alone are imported here, because the environment of ROSS reads it, too.
"""

import tomllib
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np


FOLDER = Path(__file__).parent
FOUND_BY_VALUE = (
    "roots",
    "critical speeds",
    "Campbell diagram",
    "roots over a parameter",
    "critical speeds over a parameter",
)  # their values are found in any order, beside others
SCALED = ("response", "history")  # errors are relative to the largest value


class Case(NamedTuple):
    """A question about a machine, with where its reference numbers come from."""

    name: str
    question: str
    source: str
    machine: str
    ask: dict[str, Any] = {}
    jaxrotor: list[int] = [0]  # settings: nodes a span or steps a revolution; 0 where there is none
    scipy: list[
        float
    ] = []  # tolerances, 0 where there is none; without them meshes are the settings
    without_ross: str = ""  # why ROSS cannot answer
    beside: list[float] = []  # what another code or print has, of roots the imaginary parts


def cases() -> list[Case]:
    """All cases, in the order of the file."""
    return [Case(**one) for one in tomllib.loads((FOLDER / "cases.toml").read_text())["case"]]


def references() -> dict[str, np.ndarray]:
    """Reference numbers by case; roots are complex."""
    stored = tomllib.loads((FOLDER / "references.toml").read_text())
    return {name: complex_of(value) for name, value in stored.items()}


def complex_of(values: Any) -> np.ndarray:
    """Numbers of nested lists, in which a table of `re` and `im` is a complex one."""
    made = lambda v: complex(v["re"], v["im"]) if isinstance(v, dict) else v
    each = lambda v: [each(one) for one in v] if isinstance(v, list) else made(v)
    return np.array(each(values))


def plain(found: Any) -> Any:
    """Numbers as nested lists that JSON takes, complex ones as tables."""
    found = np.asarray(found)
    made = lambda v: {"re": v.real, "im": v.imag} if isinstance(v, complex) else v
    each = lambda v: [each(one) for one in v] if isinstance(v, list) else made(v)
    return each(found.tolist())


def speeds_of(ask: dict[str, Any]) -> np.ndarray:
    """Speeds [rad/s] of a response or of a Campbell diagram, equally spaced."""
    return np.linspace(*ask["within"], ask.get("speeds", ask["count"]))


def values_of(ask: dict[str, Any]) -> np.ndarray:
    """Values of a parameter, equally spaced or in equal ratios between powers of ten."""
    if "powers" in ask:
        return np.logspace(*ask["powers"], ask["points"])
    return np.linspace(*ask["between"], ask["points"])


def error(case: Case, answers: list[np.ndarray], exact: np.ndarray) -> float:
    """Largest relative error of an answer, or of what two meshes tend to.

    Args:
        case: the case.
        answers: one, or those of a mesh and of one of half its length.
        exact: the reference numbers.
    """
    taken = [_chosen(case, np.asarray(one), exact) for one in answers]
    found = taken[0] if len(taken) == 1 else (4 * taken[1] - taken[0]) / 3
    scale = np.abs(exact).max() if case.question in SCALED else np.abs(exact)
    return float(np.max(np.abs(found - exact) / scale))


def _chosen(case: Case, found: np.ndarray, exact: np.ndarray) -> np.ndarray:
    """The values that are compared: of roots and critical speeds the nearest ones."""
    if case.question not in FOUND_BY_VALUE:
        return found
    if np.iscomplexobj(found):
        found = found.real + 1j * np.abs(found.imag)
    if exact.ndim == 2:  # by speed or by another parameter
        pairs = zip(found, exact, strict=True)
        near = lambda row, own: row[np.argmin(np.abs(row[:, None] - own), axis=0)]
        return np.array([near(np.asarray(row), own) for row, own in pairs])
    return found[np.argmin(np.abs(found[:, None] - exact), axis=0)]
