"""Branch: orbits that follow each other as a parameter changes, and what happens on the way."""

import dataclasses
import math
from collections.abc import Sequence

import equinox as eqx
import numpy as np
from jaxtyping import Bool, Complex, Float, Int

from ..core.tables import notebook_table
from ..scene import Scene
from .bifurcations import KINDS, Found, least
from .corrector import Corrector, LostError, Point, Unknowns
from .curve import Curve, Gauge, Look
from .periodic import PeriodicOrbit


OFFSETS = (3e-3, 1e-3, 3e-4, 1e-4, 3e-5)  # of the state: how far off a flip its branch is sought


class BranchPoint(eqx.Module):
    """A bifurcation on a branch: fold, flip, neimark-sacker, branching or grazing."""

    kind: str = eqx.field(static=True)
    value: float = eqx.field(static=True)  # of the parameter
    contact: int | None = eqx.field(static=True)  # of the scene, that is grazed
    place: float = eqx.field(static=True)  # among the points of the branch
    whirl_rate: float = eqx.field(static=True)  # [1]
    radius_min: Float[np.ndarray, " s"]  # [m]
    radius_max: Float[np.ndarray, " s"]  # [m]
    multipliers: Complex[np.ndarray, " r"]  # largest first
    unknowns: Float[np.ndarray, " b"]  # by which its branch knows it

    @property
    def angle(self) -> float:
        """Of the multiplier nearest to the unit circle [rad], from 0 to pi."""
        nearest = np.argmin(np.abs(np.abs(self.multipliers) - 1))
        return abs(float(np.angle(self.multipliers[nearest])))


class Branch(eqx.Module):
    """Orbits along `N` points of a branch, at `s` stations, and the bifurcations between them."""

    values: Float[np.ndarray, " N"]  # of the parameter, SI
    period: Float[np.ndarray, " N"]  # [s]
    turn: Float[np.ndarray, " N"]  # [rad] in a period, whole turns included
    whirl_rate: Float[np.ndarray, " N"]  # turn / (period Omega) [1]
    radius_min: Float[np.ndarray, "N s"]  # [m] at the samples
    radius_max: Float[np.ndarray, "N s"]
    clearance: Float[np.ndarray, "N k"]  # least of every contact [m]; -inf if it always acts
    multipliers: Complex[np.ndarray, "N r"]  # largest first
    trivial: Float[np.ndarray, " N"] | None  # multiplier along a motion without unbalance
    unresolved: Int[np.ndarray, " N"]  # steps whose changes of contact were not located
    iterations: Int[np.ndarray, " N"]  # of the corrector
    points: tuple[BranchPoint, ...]
    unlocated: tuple[tuple[int, str], ...] = eqx.field(
        static=True
    )  # after which point, of which kind
    reasons: tuple[str, str] = eqx.field(static=True)  # why it ends, at its first and last point
    unknowns: Float[np.ndarray, "N b"]
    curve: Curve
    tolerance: float = eqx.field(static=True)
    max_iterations: int = eqx.field(static=True)

    @property
    def path(self) -> str:
        """Of the parameter."""
        return self.curve.path

    @property
    def scene(self) -> Scene:
        """Of the orbit that the branch was begun with."""
        return self.curve.scene

    @property
    def stable(self) -> Bool[np.ndarray, " N"]:
        """Whether every multiplier is inside the unit circle."""
        return np.all(np.abs(self.multipliers) < 1, axis=1)

    def of(self, kind: str) -> tuple[BranchPoint, ...]:
        """The bifurcations of a kind."""
        if kind not in KINDS:
            raise ValueError(f"`kind` must be one of {', '.join(KINDS)}, but is {kind!r}.")
        return tuple(point for point in self.points if point.kind == kind)

    def orbit(self, where: "int | BranchPoint") -> PeriodicOrbit:
        """The orbit at a point of the branch, by its number, or at a bifurcation."""
        return self.curve.orbit(self._at(where), self.look(where))

    def look(self, where: "int | BranchPoint") -> Look:
        """All that is known of the orbit there, with the Jacobian."""
        u = self._at(where)
        return self._corrector.look(u, _gauge(self.curve, u))

    def doubled(self, flip: BranchPoint) -> PeriodicOrbit:
        """An orbit of twice the period on the branch that begins at a flip, near it.

            x = x* + h v,   M v = -v

        Its derivative by the parameter is zero at the flip, so that is sought near by instead. What is
        found can be continued like any other.
        """
        kind = flip.kind if isinstance(flip, BranchPoint) else type(flip).__name__
        if kind != "flip":
            raise ValueError(f"`flip` must be a point of the kind 'flip', but is a {kind}.")
        u, seen = flip.unknowns, self.look(flip)
        m = seen.direction.size
        along = np.linalg.svd(seen.jacobian[:m, :m] + 2 * np.eye(m))[2][-1]
        row = np.append(along, np.zeros(u.size - m))
        twice = self._corrector._replace(curve=_twice(self.curve))
        gauge = Gauge(u[:m], seen.direction)
        for offset in OFFSETS:
            off = offset * float(np.linalg.norm(u[:m]))
            guess = u + off * row
            try:
                point = twice.point(guess, row, gauge, row)
            except LostError:
                continue
            if np.linalg.norm(point.u - guess) < 0.3 * off:
                return twice.curve.orbit(point.u, point.look, point.iterations)
        raise RuntimeError(
            f"No orbit of twice the period was found near the flip at {self.path} = {flip.value:.9g}; "
            "continue with more steps, or a smaller `tolerance`."
        )

    def _at(self, where: "int | BranchPoint") -> Unknowns:
        return where.unknowns if isinstance(where, BranchPoint) else self.unknowns[where]

    @property
    def _corrector(self) -> Corrector:
        return Corrector(self.curve, self.tolerance, self.max_iterations)

    def _repr_html_(self) -> str:
        first, *rest = str(self).split("\n")
        told = [line.strip() for line in rest[len(self.points) :]]
        rows = [(p.kind, p.value, p.whirl_rate, p.radius_max.max(), p.contact) for p in self.points]
        heads = ("point", self.path, "whirl rate", "largest radius [m]", "contact")
        return notebook_table("\n".join([first, *told]), heads, rows)

    def __str__(self) -> str:
        values, turns = self.values, np.flatnonzero(np.diff(np.sign(np.diff(self.values)))) + 1
        way = " to ".join(f"{values[k]:.6g}" for k in (0, *turns, values.size - 1))
        lines = [
            f"Branch of {values.size} orbits, {self.path} from {way} [{self.scene.unit(self.path)}], "
            f"{int(self.stable.sum())} stable"
        ]
        lines += [f"  {self._told(point)}" for point in self.points]
        lines += [
            f"  {kind} not located between {self.values[k]:.6g} and {self.values[k + 1]:.6g}"
            for k, kind in self.unlocated
        ]
        lines += [f"  begins: {self.reasons[0]}", f"  ends: {self.reasons[1]}"]
        return "\n".join(lines)

    def _told(self, point: BranchPoint) -> str:
        found = f"{point.kind} at {point.value:.9g}"
        if point.contact is not None:
            found += f", contact {point.contact}"
        if point.kind == "neimark-sacker":
            found += f", at {math.degrees(point.angle):.6g} degrees"
        return found


def branch_of(
    corrector: Corrector,
    points: Sequence[Point],
    found: Sequence[tuple[int, Found]],
    lost: Sequence[tuple[int, str]],
    reasons: tuple[str, str],
) -> Branch:
    """The branch of points in their order, with what was found after the first of each pair."""
    curve, looks = corrector.curve, [point.look for point in points]
    each = lambda name: np.array([getattr(look, name) for look in looks])
    whirl = each("turn") / (each("period") * each("speed"))
    radius = [_radius(curve, look) for look in looks]
    unknowns = np.stack([point.u for point in points])
    return Branch(
        values=np.array([_value(curve, u) for u in unknowns]),
        period=each("period"),
        turn=each("turn"),
        whirl_rate=whirl,
        radius_min=np.stack([low for low, _ in radius]),
        radius_max=np.stack([high for _, high in radius]),
        clearance=np.stack([least(look) for look in looks]),
        multipliers=each("multipliers"),
        trivial=None if looks[0].trivial is None else each("trivial"),
        unresolved=np.array([int(look.outcome.unresolved) for look in looks]),
        iterations=np.array([point.iterations for point in points]),
        points=tuple(_branch_point(curve, after, one) for after, one in found),
        unlocated=tuple(lost),
        reasons=reasons,
        unknowns=unknowns,
        curve=curve,
        tolerance=corrector.tolerance,
        max_iterations=corrector.max_iterations,
    )


def _branch_point(curve: Curve, after: int, found: Found) -> BranchPoint:
    look = found.point.look
    low, high = _radius(curve, look)
    return BranchPoint(
        found.kind,
        _value(curve, found.point.u),
        found.contact,
        after + found.share,
        float(look.turn / (look.period * look.speed)),
        low,
        high,
        np.asarray(look.multipliers),
        found.point.u,
    )


def _value(curve: Curve, u: Unknowns) -> float:
    return float(curve.value(u[-1]))


def _radius(curve: Curve, look) -> tuple[np.ndarray, np.ndarray]:
    radius = np.abs(look.seen.displacement[:, : curve.stations.size])
    return radius.min(axis=0), radius.max(axis=0)


def _gauge(curve: Curve, u: Unknowns) -> Gauge:
    """Any, of a state that is an orbit's already."""
    m = u.size - (2 if curve.revolutions is None else 1)
    return Gauge(u[:m], np.zeros(m))


def _twice(curve: Curve) -> Curve:
    """The same with twice the period."""
    if curve.revolutions is not None:
        return dataclasses.replace(curve, revolutions=2 * curve.revolutions)
    plan = dataclasses.replace(
        curve.plan, steps=2 * curve.plan.steps, max_steps=2 * curve.plan.steps
    )
    images = 1 if curve.images == 1 else curve.images // math.gcd(curve.images, 2)
    turn = 2 * curve.turn
    return dataclasses.replace(curve, plan=plan, span=2 * curve.span, turn=turn, images=images)
