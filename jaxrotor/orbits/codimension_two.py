"""Points of codimension two: where a curve of bifurcations meets a second condition.

    cusp                     d^2 residual (y, y) = 0, `y` the null vector of a fold
    1:1 resonance            a second multiplier 1, or the angle of a pair becomes 0
    1:2 resonance            a second multiplier -1, or the angle of a pair becomes pi
    1:3, 1:4 resonance       the angle of a pair is 2 pi / 3, pi / 2
    fold-flip, ..            two conditions of one parameter hold at once

Each is the root of a test function along the curve, and where its sign changes between two points the
root in between is computed.

Source: Kuznetsov (2004), Elements of Applied Bifurcation Theory, sections 9.1, 10.3.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Complex, Float

from .bifurcations import Bifurcation, is_at, pair_products, root_between
from .bordered import Trial, pair_near
from .corrector import StepError, Unknowns, jacobian_at_own_phase
from .problem import Evaluation


KINDS = (
    "cusp",
    "1:1 resonance",
    "1:2 resonance",
    "1:3 resonance",
    "1:4 resonance",
    "fold-flip",
    "fold-neimark-sacker",
    "flip-neimark-sacker",
    "double neimark-sacker",
    "grazing-fold",
    "grazing-flip",
    "grazing-neimark-sacker",
)

Multipliers = Complex[np.ndarray, " _"]
TestFunction = Callable[[Any], float]  # of a `PointOfCurve`


class PointOfCurve(NamedTuple):
    """A point of a curve of bifurcations."""

    u: Unknowns
    tangent: Unknowns  # of unit length, in the direction of travel
    trial: Trial
    iterations: int

    @property
    def evaluation(self) -> Evaluation:
        return self.trial.evaluation

    @property
    def anchor(self) -> Any:
        return self.trial.anchor


def points_between(
    corrector: Any, kind: str, a: PointOfCurve, b: PointOfCurve
) -> tuple[list[Bifurcation], list[str]]:
    """Points of codimension two between two neighbours, in order, and the kinds not located."""
    found, lost = [], []
    for name, (test, second) in _tests(kind).items():
        if np.sign(test(a)) * np.sign(test(b)) >= 0:
            continue
        try:
            fraction, point = root_between(corrector, a, b, test)
        except StepError:
            lost.append(name)
            continue
        if second is None or is_at(second, other_multipliers(kind, point)):
            found.append(Bifurcation(name, None, fraction, point))
        else:  # multipliers jumped, as where contact begins
            lost.append(name)
    return sorted(found, key=lambda one: one.fraction), lost


def _tests(kind: str) -> dict[str, tuple[TestFunction, str | None]]:
    """Test functions along a curve of a kind; with the kind of the second bifurcation, if it is one."""
    all_ = lambda point: np.asarray(point.evaluation.multipliers)
    others = lambda point: other_multipliers(kind, point)
    crossing = {
        "fold": lambda point: float(np.prod(1 - others(point)).real),
        "flip": lambda point: float(np.prod(1 + others(point)).real),
        "neimark-sacker": lambda point: pair_products(others(point)),
    }
    if kind == "grazing":
        return {f"grazing-{second}": (test, second) for second, test in crossing.items()}
    if kind == "fold":
        return {
            "cusp": (lambda point: bend(point.trial), None),
            "1:1 resonance": (lambda point: _characteristic_slope(all_(point), 1.0), None),
            "fold-flip": (crossing["flip"], "flip"),
            "fold-neimark-sacker": (crossing["neimark-sacker"], "neimark-sacker"),
        }
    if kind == "flip":
        return {
            "1:2 resonance": (lambda point: _characteristic_slope(all_(point), -1.0), None),
            "fold-flip": (crossing["fold"], "fold"),
            "flip-neimark-sacker": (crossing["neimark-sacker"], "neimark-sacker"),
        }
    at = lambda cosine: (
        lambda point: pair_near(all_(point), point.anchor.angle)[0] / 2 - cosine,
        None,
    )
    return {
        "1:1 resonance": at(1.0),
        "1:2 resonance": at(-1.0),
        "1:3 resonance": at(-0.5),
        "1:4 resonance": at(0.0),
        "fold-neimark-sacker": (crossing["fold"], "fold"),
        "flip-neimark-sacker": (crossing["flip"], "flip"),
        "double neimark-sacker": (crossing["neimark-sacker"], "neimark-sacker"),
    }


def bend(trial: Trial) -> float:
    """Derivative of the equation of a fold along its null vector, whose root is a cusp."""
    right = trial.anchor.right[:, 0]
    return float(trial.slope[: right.size] @ right)


def _characteristic_slope(multipliers: Multipliers, value: float) -> float:
    """Derivative at a multiplier of the characteristic polynomial, zero where it is a double one."""
    off = value - multipliers
    return float(sum(np.prod(np.delete(off, i)) for i in range(off.size)).real)


def other_multipliers(kind: str, point: PointOfCurve) -> Multipliers:
    """The multipliers without those on the unit circle by which a curve of a kind is defined."""
    multipliers, angle = np.asarray(point.evaluation.multipliers), point.anchor.angle
    if kind == "grazing":
        return multipliers
    if kind == "neimark-sacker":
        total, product = pair_near(multipliers, angle)
        root = np.sqrt(complex(total**2 - 4 * product))
        critical = [(total + root) / 2, (total - root) / 2]
    else:
        critical = [np.exp(1j * angle)]
    for value in critical:
        multipliers = np.delete(multipliers, np.argmin(np.abs(multipliers - value)))
    return multipliers


def side_of(kind: str, point: PointOfCurve, count: int = 2) -> Float[np.ndarray, "2"]:
    """Direction across a curve in the plane of the places of its parameters, see `BifurcationCurve.side`.

    Of a fold with the residual `F`, null vectors `y` and `z`, and a small `h`:

        F(x + h y, s + ds) = 0:    z . F_s ds + h^2 z . F_xx(y, y) / 2 = 0

    Elsewhere `g`, the equation of the curve, changes along the orbits by `g_s - g_x F_x^-1 F_s`.
    """
    jacobian, slope = jacobian_at_own_phase(point.evaluation), point.trial.slope
    by_state, by_place = jacobian[:, :-count], jacobian[:, -count:]
    anchor = point.anchor
    if kind == "fold":
        across = np.sign(bend(point.trial)) * (anchor.left[:, 0] @ by_place)
    else:
        across = (
            slope[-count:] - slope[:-count] @ np.linalg.lstsq(by_state, by_place, rcond=None)[0]
        )
        if kind == "flip":
            across = -across * np.sign(anchor.left[:, 0] @ anchor.right[:, 0])
        elif kind == "neimark-sacker":
            across = -across
    return across / np.linalg.norm(across)
