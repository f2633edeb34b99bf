"""Normal form: what a flip or a Neimark-Sacker point leads to, by derivatives of the period map.

    flip             w -> -w + b w^3             b = p . (C(q, q, q) + 3 B(q, (1 - A)^-1 B(q, q))) / 6
    Neimark-Sacker   w -> e^ia w (1 + d |w|^2)   d = e^-ia p . (C(q, q, q*) + 2 B(q, (1 - A)^-1 B(q, q*))
                                                     + B(q*, (e^2ia - A)^-1 B(q, q))) / 2

`A`, `B`, `C` are the first, second and third derivatives of the map in the orbit, `A q = mu q` and
`p A = mu p` with the critical multiplier `mu`, `|q| = 1`, `p . q = 1`. Of an orbit of unknown period the
map is that of the plane across the motion.

Source: Kuznetsov (2004), Elements of Applied Bifurcation Theory, section 5.4.
"""

from typing import Any, NamedTuple

import equinox as eqx
import numpy as np

from ..equations.system import state_names
from .bifurcations import touches
from .branch import Branch, BranchPoint, check_point
from .corrector import Corrector, Unknowns
from .problem import Evaluation


DISTANCES = (0.1, 2e-2, 4e-3, 1e-3, 2.5e-4, 6e-5)  # of differences, of the state
ROUNDING = 1e-13  # of the derivative of the map
RESONANT = 1e-3  # distance of a power of the multiplier from 1 at which the form has other terms
RETURNS = 4  # of Newton's method for the instant of return, from that of the orbit
HINT = "compute a branch on either side of it and look which of its orbits are stable"


class NormalForm(eqx.Module):
    """Whether stable or unstable motions begin at a flip or a Neimark-Sacker point."""

    kind: str = eqx.field(static=True)
    # `b` of a flip, the real part of `d` of a Neimark-Sacker point [1/m^2]
    coefficient: float = eqx.field(static=True)
    error: float = eqx.field(static=True)  # of the coefficient, by half the distance of differences

    @property
    def supercritical(self) -> bool | None:
        """Whether the motions that begin are stable where no other multiplier is outside.

        None where the error leaves the sign of the coefficient open.
        """
        if abs(self.coefficient) <= self.error:
            return None
        return (self.coefficient > 0) == (self.kind == "flip")

    def __str__(self) -> str:
        said = {True: "supercritical", False: "subcritical", None: "of unknown side"}
        return (
            f"{said[self.supercritical]} {self.kind}, coefficient {self.coefficient:.6g} +- "
            f"{self.error:.1g} 1/m^2"
        )


def normal_form(branch: Branch, point: BranchPoint) -> NormalForm:
    """The coefficient `b` of a flip, or `Re d` of a Neimark-Sacker point, which tells what begins there.

        w -> -w + b w^3,   w -> e^ia w (1 + d |w|^2)   of a disturbance `w q`, or `w q + w* q*`

    Where `b > 0`, or `Re d < 0`, the point is supercritical: orbits of twice the period, or motions of
    two frequencies, begin on the side where the orbit is unstable, and are stable. Else they are
    unstable, on the other side. Third derivatives of the map are differences of its Jacobian.

    Args:
        branch: result of `continue_` or `switch`.
        point: one of its flips or Neimark-Sacker points.

    Returns:
        A `NormalForm`. The critical eigenvector `q` has the norm 1 m over coordinates and velocities, the
        velocities over the speed.

    Raises:
        ValueError: if `point` is of another kind, or of another branch.
        RuntimeError: if the map is not smooth within the differences, as where a contact grazes nearby,
            or the multiplier is at a resonance of order 1 to 4, where it does not decide.

    Source: Kuznetsov (2004), Elements of Applied Bifurcation Theory, section 5.4.
    """
    check_point(branch, point, ("flip", "neimark-sacker"), "of which there are normal forms")
    named = f"The {point.kind} at {branch.path} = {point.value:.9g}"
    for order in range(1, 5) if point.kind == "neimark-sacker" else ():
        if abs(np.exp(1j * order * point.angle) - 1) < RESONANT:
            raise RuntimeError(
                f"{named} is at a 1:{order} resonance, where its coefficient does not decide; {HINT}."
            )
    period_map = PeriodMap.of(branch, point)
    matrix = period_map.jacobian(np.zeros_like(period_map.state))
    assert matrix is not None
    q, p = _critical(branch, matrix, point)
    size = float(np.linalg.norm(period_map.state))
    forms, unit = [], float(branch.curve.size[0]) ** 2
    for distance in DISTANCES:
        steps = distance * size, distance * size / 2
        found = [_coefficient(period_map, matrix, q, p, h) for h in steps]
        if None not in found:
            coarse, fine = np.array(found) / unit
            rounding = ROUNDING * np.linalg.norm(p) / steps[1] ** 2 / unit
            value, error = fine + (fine - coarse) / 3, abs(fine - coarse) / 3 + rounding
            forms.append(NormalForm(point.kind, float(value), float(error)))
    if not forms:
        raise RuntimeError(
            f"{named} has no normal form: contact changes within {DISTANCES[-1]:g} of the state beside "
            f"the orbit, so that the map is not smooth there; {HINT}."
        )
    return min(forms, key=lambda form: form.error)


class PeriodMap(NamedTuple):
    """The state a period after a state near an orbit; of an unknown period, on the plane across it."""

    corrector: Corrector
    u: Unknowns  # of the orbit
    across: np.ndarray  # (m,), normal of the plane; zero where the period is given
    counts: dict[int, int]  # how often the orbit touches every contact

    @classmethod
    def of(cls, branch: Branch, point: BranchPoint) -> "PeriodMap":
        seen = branch.look(point)
        return cls(branch.corrector, point.unknowns, np.asarray(seen.direction), _counts(seen))

    @property
    def state(self) -> np.ndarray:
        """The state of the orbit."""
        return self.u[: self.across.size]

    def jacobian(self, change: np.ndarray) -> np.ndarray | None:
        """Derivative of the map beside the orbit; None where contacts are not touched as in the orbit."""
        m, u = self.across.size, self.u.copy()
        u[:m] += change
        trial = self._evaluated(u)
        if self.across.any():
            for _ in range(RETURNS):
                ahead = trial.residual[:m] + u[:m] - self.state
                u[m] -= (self.across @ ahead) / (self.across @ trial.jacobian[:m, m])
                trial = self._evaluated(u)
        if _counts(trial) != self.counts:
            return None
        matrix = np.asarray(trial.jacobian)[:m, :m] + np.eye(m)
        if self.across.any():
            along = trial.jacobian[:m, m]
            matrix -= np.outer(along, self.across @ matrix) / (self.across @ along)
        return matrix

    def _evaluated(self, u: Unknowns) -> Evaluation:
        return self.corrector.evaluate(u, self.corrector.problem.any_phase(u))


def _counts(evaluation: Evaluation) -> dict[int, int]:
    return {k: count for k, (count, _) in touches(evaluation).items()}


def _critical(
    branch: Branch, matrix: np.ndarray, point: BranchPoint
) -> tuple[np.ndarray, np.ndarray]:
    """Right and left eigenvector of the critical multiplier."""
    wanted = -1.0 if point.kind == "flip" else np.exp(1j * point.angle)
    nearest = []
    for one in (matrix, matrix.T):
        values, vectors = np.linalg.eig(one)
        vector: Any = vectors[:, np.argmin(np.abs(values - wanted))]
        nearest.append(vector.real if point.kind == "flip" else vector)
    q, p = nearest
    q = q / np.linalg.norm(q[: q.size - len(state_names(branch.scene))])
    return q, p / (p @ q)


def _coefficient(
    period_map: PeriodMap, matrix: np.ndarray, q: Any, p: Any, h: float
) -> float | None:
    """`b` or `Re d` by differences over `h` of the derivative; None where the map is not smooth."""
    parts: Any = (q.real, 1.0), (q.imag, 1j)
    turning, unit = np.iscomplexobj(q), np.eye(len(matrix))
    first: Any = 0.0
    second: Any = 0.0
    for along, factor in parts[: 1 + turning]:
        ahead, back = (period_map.jacobian(sign * h * along) for sign in (1, -1))
        if ahead is None or back is None:
            return None
        first = first + factor * (ahead - back) / (2 * h)  # B(q, .)
        second = second + (ahead - 2 * matrix + back) / h**2  # C(q, q*, .)
    bent = np.linalg.solve(unit - matrix, first @ q.conj())
    if not turning:
        return float(p @ (second @ q + 3 * first @ bent)) / 6
    turn = p @ matrix @ q / abs(p @ matrix @ q)
    twice = np.linalg.solve(turn**2 * unit - matrix, first @ q)
    whole = p @ (second @ q + 2 * first @ bent + first.conj() @ twice)
    return float((whole / turn).real) / 2
