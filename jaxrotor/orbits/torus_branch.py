"""Torus branch: tori as one parameter of a scene changes, followed around its folds.

residual(x, s) = 0   of harmonic balance,   t . (u - u_k - h t) = 0,   u = (x, s)
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jaxtyping import Array, Bool, Float

from ..analysis.observed import Places
from ..core.compiled import QUICKLY
from ..core.outcome import Outcome
from ..core.progress import progress as bar
from ..core.quantities import Scalar
from ..core.tables import notebook_table
from ..equations.shared_nodes import with_shared_nodes
from ..equations.system import assemble, port_groups
from ..scene import Scene
from .balance import Balance
from .bifurcations import root_between
from .branch import AbstractBranch
from .corrector import Point, StepError, Unknowns, newton
from .disturbances import growth_along
from .parameter_range import AbstractRanged, ParameterRange, own, range_of
from .predictor import Predictor
from .torus import Torus, torus_near
from .tracer import Found, Tracer


TOLERANCE = 1e-10  # of a torus that is looked at again


class TorusFold(eqx.Module):
    """A fold of a branch of tori, where a stable and an unstable one meet."""

    kind: str = eqx.field(static=True)  # "fold"
    value: float = eqx.field(static=True)  # of the parameter
    place: float = eqx.field(static=True)  # between which points: 2.3 is after point 2
    radius_min: Float[np.ndarray, " s"]  # [m]
    radius_max: Float[np.ndarray, " s"]  # [m]


class TorusProblem(AbstractRanged):
    """`residual(x, s) = 0` of the harmonics of a torus, and of a parameter of its scene."""

    scene: Scene
    places: Places
    size: Scalar  # unit of the displacements of the ports [m]
    parameters: tuple[ParameterRange, ...]
    harmonics: tuple[int, ...] = eqx.field(static=True)
    samples: tuple[int, ...] = eqx.field(static=True)
    along: tuple[int, int] = eqx.field(static=True)  # revolutions and steps of disturbances

    def balance(self, s: Float[Array, " p"]) -> Balance:
        """The equations at a place of the parameter."""
        scene = self.scene.put({self.parameters[0].path: self.values(s)[0]})
        system = assemble(scene, port_groups(self.scene))
        balance = Balance.of(system, self.harmonics, 1, self.samples)
        return eqx.tree_at(lambda one: one.size, balance, self.size)


class TorusTrial(NamedTuple):
    """The residual of a trial and what comes with it."""

    residual: Float[Array, " a"]
    jacobian: Float[Array, "a b"]  # by x and s
    direction: Float[Array, " a"]  # zero: no angle of a torus is free
    outcome: Outcome


class TorusCorrector(NamedTuple):
    """Newton's method for the unknowns of a torus and its parameter, see `Corrector`."""

    problem: TorusProblem
    tolerance: float
    max_iterations: int

    def point(self, guess: Unknowns, normal: Unknowns, anchor: Any, forward: Unknowns) -> Point:
        """The point of the branch in the plane through a guess; its tangent points along `forward`."""
        evaluate = lambda u: jax.tree.map(np.asarray, _evaluate(self.problem, jnp.asarray(u)))
        u, trial, count = newton(evaluate, guess, normal, self.tolerance, self.max_iterations)
        try:
            last = np.append(np.zeros(u.size - 1), 1.0)
            along = np.linalg.solve(np.vstack([trial.jacobian, forward]), last)
        except np.linalg.LinAlgError:
            raise StepError("two branches of tori meet") from None
        return Point(u, along / np.linalg.norm(along), trial, count)


class TorusBranch(AbstractBranch):
    """`N` tori along a branch, at `s` stations, and the folds between them."""

    values: Float[np.ndarray, " N"]  # of the parameter, SI
    radius_min: Float[np.ndarray, "N s"]  # [m] over all angles
    radius_max: Float[np.ndarray, "N s"]
    exponents: Float[np.ndarray, " N"]  # growth of the fastest small disturbance [1/s]
    points: tuple[TorusFold, ...]  # its folds
    # Folds that were detected but not located: after which point, of which kind.
    unlocated: tuple[tuple[int, str], ...] = eqx.field(static=True)
    reasons: tuple[str, str] = eqx.field(static=True)  # why it ends, at its first and last point
    unknowns: Float[np.ndarray, "N b"]
    curve: TorusProblem

    @property
    def stable(self) -> Bool[np.ndarray, " N"]:
        """Whether small disturbances die out."""
        return self.exponents < 0

    def torus(self, number: int) -> Torus:
        """The torus at a point of the branch."""
        problem, u = self.curve, jnp.asarray(self.unknowns[number])
        scene = self.scene.replace({self.path: float(self.values[number])})
        sizes = problem.harmonics, problem.samples
        ports = problem.balance(u[-1:]).decode(u[:-1])
        settings = optx.Dogleg(TOLERANCE, TOLERANCE), TOLERANCE, 20
        return torus_near(scene, problem.places, ports, sizes, settings, problem.along, True)

    def _repr_html_(self) -> str:
        rows = [(p.kind, p.value, p.radius_max.max()) for p in self.points]
        return notebook_table(str(self), ("point", self.path, "largest radius [m]"), rows)

    def __str__(self) -> str:
        values = self.values
        lines = [
            f"Branch of {values.size} tori, {self.path} from {values[0]:.6g} to {values[-1]:.6g} "
            f"[{self.scene.unit(self.path)}], {int(self.stable.sum())} stable"
        ]
        lines += [f"  {point.kind} at {point.value:.9g}" for point in self.points]
        return "\n".join([*lines, *self.remarks])


def branch_of_tori(
    first: Torus,
    path: str,
    between: Sequence[float],
    travel: tuple[str, float, float, int],
    tolerance: float,
    max_iterations: int,
    progress: bool | None,
    along: tuple[int, int] = (100, 64),
) -> TorusBranch:
    """The tori near a torus as one parameter changes, see `continue_`; `travel` are its steps."""
    direction, step, max_step, max_points = travel
    scene = with_shared_nodes(first.scene, [path])
    parameter = range_of(scene, path, between, "between")
    problem = TorusProblem(
        scene=scene,
        places=Places.of(
            first.scene, list(zip(first.observed, first.stations.tolist(), strict=True))
        ),
        size=jnp.max(jnp.abs(first.ports)),
        parameters=(parameter,),
        harmonics=first.harmonics,
        samples=first.samples,
        along=along,
    )
    place = parameter.place(own(scene, path))
    x = problem.balance(jnp.asarray([place])).encode(first.ports)
    u = np.append(np.asarray(x), place)
    corrector = TorusCorrector(problem, tolerance, max_iterations)
    normal = np.append(np.zeros(x.size), 1.0)
    try:
        start = corrector.point(u, normal, None, normal)
    except StepError as error:
        raise RuntimeError(f"The torus cannot be continued in `{path}`: {error}.") from None

    def search(last: Point, point: Point) -> Found:
        slope = lambda one: float(one.tangent[-1])
        if slope(last) * slope(point) >= 0:
            return Found([], [])
        try:
            fraction, fold = root_between(corrector, last, point, slope)
        except StepError:
            return Found([], ["fold"])
        return Found([_Fold(fraction, fold)], [])

    tracer = Tracer(
        problem, Predictor(corrector, max_step), step, max_points, search, ("branch", "torus")
    )
    with bar(progress, tracer.longest(direction), f"continuing in {path}", "points") as tick:
        points, found, lost, reasons = tracer.both(start, direction, tick)
    looks = [_look(problem, jnp.asarray(point.u)) for point in points]
    low, high, exponents = (np.stack([np.asarray(one[k]) for one in looks]) for k in range(3))
    folds = []
    for after, one in found:
        radii = _look(problem, jnp.asarray(one.point.u))[:2]
        value = float(problem.values(one.point.u)[0])
        folds.append(TorusFold("fold", value, after + one.fraction, *map(np.asarray, radii)))
    unknowns = np.stack([point.u for point in points])
    values = np.array([float(problem.values(one)[0]) for one in unknowns])
    return TorusBranch(
        values=values,
        radius_min=low,
        radius_max=high,
        exponents=exponents,
        points=tuple(folds),
        unlocated=tuple(lost),
        reasons=reasons,
        unknowns=unknowns,
        curve=problem,
    )


class _Fold(NamedTuple):
    fraction: float
    point: Point


@eqx.filter_jit(**QUICKLY)
def _evaluate(problem: TorusProblem, u: Float[Array, " b"]) -> TorusTrial:
    x, s = u[:-1], u[-1:]
    balance = problem.balance(s)
    of_place = lambda s: problem.balance(s).residual(x)
    residual, by_place = jax.jvp(of_place, (s,), (jnp.ones(1),))
    jacobian = jnp.concatenate([balance.jacobian(x), by_place[:, None]], axis=1)
    return TorusTrial(residual, jacobian, jnp.zeros_like(x), Outcome.good())


@eqx.filter_jit(**QUICKLY)
def _look(problem: TorusProblem, u: Float[Array, " b"]) -> tuple[Array, Array, Scalar]:
    """Least and largest radius at the stations [m], and the exponent [1/s]."""
    balance = problem.balance(u[-1:])
    ports = balance.decode(u[:-1])
    q = balance.coordinates(balance.forces(ports))
    seen = balance.sampled(q @ problem.places.rows(balance.system.line).T)
    radius = jnp.abs(seen)
    exponent, _ = growth_along(balance, ports, *problem.along)
    return radius.min(axis=0), radius.max(axis=0), exponent
