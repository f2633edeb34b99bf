"""Resilience: the smallest impulse that takes a rotor from one motion to another."""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Complex, Float
from scipy.optimize import minimize_scalar

from ..core import linalg
from ..core.checks import check_counts
from ..core.progress import waiting
from ..core.quantities import Scalar
from ..equations.system import port_groups
from ..motion.revolutions import March, revolution_rate
from ..scene import Scene
from ..solvers.exponential import Exponential
from .edge import Edge
from .orbit import PeriodicOrbit
from .periodic import periodic
from .shooting import plan_of
from .two_motions import LANES, TwoMotions


LARGEST = 4.0  # impulse up to which is searched, over that which gives the speed of the other orbit
SHARP = 1e-9  # width of the interval of an impulse, over its size
SAME = 1e-6  # change of the size that is rounding, relative to it
TURNED = 1e-3  # error of the angle of the smallest impulse [rad], with whose square its size errs


class Resilience(eqx.Module):
    """The smallest impulse that changes a motion."""

    impulse: Complex[Array, ""]  # x + i y [N s], at the begin of a revolution
    angles: Float[np.ndarray, " d"]  # directions along which it was sought [rad]
    sizes: Float[
        np.ndarray, " d"
    ]  # smallest impulses along them [N s], infinite where there is none
    orbit: PeriodicOrbit  # the motion that is left
    edge: PeriodicOrbit  # the orbit on the boundary, near which the rotor comes
    revolutions: int = eqx.field(static=True)  # from the impulse until it is nearest to it
    at: float | int = eqx.field(static=True)  # station that is struck [m]
    solver: Exponential = eqx.field(static=True)  # of its runs

    def __str__(self) -> str:
        angle = round(float(np.degrees(np.angle(self.impulse))), 6) + 0.0
        return (
            f"The smallest impulse that changes the motion is {abs(complex(self.impulse)):.6g} N s at "
            f"{angle:.4g} degrees, at {self.at:g} m;\nof {self.sizes.size} directions "
            f"{np.isfinite(self.sizes).sum()} have one."
        )

    def size(self, scene: Scene) -> Scalar:
        """Size of the smallest impulse [N s], for derivatives by the values of the scene.

            g(|J|) = l (P^N(a + B J) - e) = 0,    d|J| = -dg / g'

        `P` is the map of a revolution, `a` the motion that is left, `e` the orbit on the boundary, `l` the
        left vector of its unstable multiplier, `B` the change of velocities by a unit impulse. Turning
        the impulse changes `g` to second order, as it is the smallest.

        Args:
            scene: the scene of `orbit`, of which some values are traced.

        Returns:
            The size, differentiable in forward mode. Not a number in a scene of other values, whose
            impulse is sought anew.
        """
        size, own = jnp.abs(self.impulse), self.orbit.scene
        left = _left_vector(_march(own, self.edge.steps, self.solver, self.at), self.edge)
        beyond = lambda size, scene: (
            left @ self._miss(scene, size * self.impulse / abs(self.impulse))
        )
        base, slope = jax.jvp(lambda size: beyond(size, own), (size,), (jnp.ones_like(size),))
        change = (beyond(size, scene) - base) / slope
        return size - jnp.where(jnp.abs(change) < SAME * size, change, jnp.nan)

    def _miss(self, scene: Scene, impulse: Array) -> Float[Array, " x"]:
        """State after the impulse and the revolutions, less that of the orbit on the boundary."""
        left, reached = (_near(scene, one, self.solver) for one in (self.orbit, self.edge))
        march = _march(scene, self.edge.steps, self.solver, self.at)
        turn = jnp.stack([impulse.real, impulse.imag])
        push = _unit(march) * jax.lax.complex(*turn)
        begin = _real(eqx.tree_at(lambda one: one.start.velocity, left, left.start.velocity + push))
        return _mapped(march, begin, self.revolutions) - _real(reached)


def _near(scene: Scene, orbit: PeriodicOrbit, solver: Exponential) -> PeriodicOrbit:
    """The orbit of a scene near one of another scene."""
    steps = {"revolutions": orbit.revolutions, "steps_per_revolution": orbit.steps}
    return periodic(scene, orbit, solver=solver, progress=False, **steps)


def _march(scene: Scene, steps: int, solver: Exponential, at: Any) -> March:
    """March of a scene, whose values may be traced."""
    (scene, stations), together = scene.to_simulate(at, in_time=False), port_groups(scene)
    plan = plan_of(solver, together, steps, contacts=False)
    return March.build(scene, plan, revolution_rate(scene, None), stations[:1])


def resilience(
    orbit: PeriodicOrbit,
    edge: Edge,
    at: float | int | None = None,
    *,
    directions: int = 24,
    revolutions: int = 200,
    solver: Exponential | None = None,
    progress: bool | None = None,
) -> Resilience:
    """The smallest impulse at a station that takes a rotor from its motion to another.

        z.(0) = z._a + M^-1 b J,    min |J|: the motion does not come back

    In each direction, the smallest impulse is sought up to one that gives four times the speed of the
    orbit on the boundary, by sixteen steps; of a change that is taken back within one of them nothing is
    seen. The best direction is then turned until its impulse is the smallest.

    Args:
        orbit: the motion, stable, of a number of revolutions. The impulse is that at the begin of one;
            for another phase turn the unbalance by its `phase`.
        edge: of this motion and the one that it would change to, as `jr.edge` finds it.
        at: station that is struck [m]; by default the one observed.
        directions: number of directions, equally spaced.
        revolutions: after which it is decided where a motion leads, as in `edge`.
        solver: as in `edge`.
        progress: whether to show after two seconds that the search is running.

    Returns:
        A `Resilience`; its `size(scene)` has derivatives by the values of the scene.

    Raises:
        ValueError: if an argument is out of its range or the orbit is not stable.
        RuntimeError: if no impulse of this size changes the motion.
    """
    check_counts(directions=directions, revolutions=revolutions)
    if not bool(orbit.stable):
        raise ValueError("`orbit` must be stable, as disturbances of another grow by themselves.")
    solver = Exponential(4, located=True) if solver is None else solver
    with waiting(progress, "smallest impulse"):
        runs = _leaving(orbit, edge, revolutions, solver, at)
        angles = 2 * np.pi * np.arange(directions) / directions
        kicks = _Kicks.of(runs, orbit, edge.orbit)
        sizes = kicks.sizes(angles)
        if not np.isfinite(sizes).any():
            raise RuntimeError(
                f"No impulse of up to {kicks.largest:.5g} N s at {kicks.at:g} m changes the motion; "
                "strike another station."
            )
        best, width = angles[sizes.argmin()], 2 * np.pi / directions
        ends = {"bounds": (best - width, best + width), "options": {"xatol": TURNED}}
        size = lambda angle: np.nan_to_num(kicks.bracket(angle, kicks.largest)[1], nan=np.inf)
        turned: Any = minimize_scalar(size, method="bounded", **ends)
        low, high = kicks.bracket(best, sizes.min())
        angle = best
        if turned.fun < high:
            angle = turned.x
            low, high = kicks.bracket(angle, kicks.largest)
        beside = runs.beside(*kicks.struck([low, high], angle)).mean(axis=1)
        near = linalg.norm(beside - runs.state_of(edge.orbit.start), axis=-1)
        return Resilience(
            impulse=jnp.asarray(high * np.exp(1j * angle)),
            angles=angles,
            sizes=sizes,
            orbit=orbit,
            edge=edge.orbit,
            revolutions=int(near.argmin()),
            at=kicks.at,
            solver=solver,
        )


def _leaving(
    orbit: PeriodicOrbit, edge: Edge, revolutions: int, solver: Exponential, at: Any
) -> TwoMotions:
    """The motion of an orbit, and that to which the other side of the edge leads."""
    try:
        return TwoMotions.of(
            orbit.scene, orbit, edge.sides[1], revolutions, edge.orbit.steps, solver, at
        )
    except ValueError:
        return TwoMotions.of(
            orbit.scene, orbit, edge.sides[0], revolutions, edge.orbit.steps, solver, at
        )


class _Kicks(NamedTuple):
    """Impulses on a rotor in its motion, and where they lead."""

    runs: TwoMotions
    state: Float[Array, " m"]  # of the motion
    unit: Float[Array, "2 m"]  # change of it by 1 N s along x and y
    largest: float  # impulse that is tried [N s]
    at: float  # station [m]

    @classmethod
    def of(cls, runs: TwoMotions, orbit: PeriodicOrbit, edge: PeriodicOrbit) -> "_Kicks":
        march = runs.march
        unit, state = _unit(march), runs.state_of(orbit.start)
        q, velocity = orbit.start.q, orbit.start.velocity
        changed = [march.encode(q, velocity + turn * unit) - state for turn in (1.0, 1j)]
        row = march.system.line.row(march.stations[0])
        speed = jnp.abs(row @ (edge.start.velocity - velocity))
        rate = 2 * jnp.pi / edge.period * (edge.revolutions or 1)
        speed = speed + rate * jnp.abs(row @ (edge.start.q - q))
        largest = float(LARGEST * speed / jnp.abs(row @ unit))
        return cls(runs, state, jnp.stack(changed), largest, float(march.stations[0]))

    def struck(self, sizes: Any, angle: Any) -> Float[Array, "k m"]:
        """States after impulses of some sizes along some angles."""
        sizes, angle = np.broadcast_arrays(np.asarray(sizes), angle)
        ways = np.stack([sizes * np.cos(angle), sizes * np.sin(angle)], axis=-1)
        return self.state + jnp.asarray(ways) @ self.unit

    def leave(self, sizes: Any, angles: Any) -> Bool[np.ndarray, "..."]:
        """Whether impulses change the motion."""
        sizes, angles = np.broadcast_arrays(sizes, angles)
        return (self.runs.ends(self.struck(sizes.ravel(), angles.ravel())) > 0).reshape(sizes.shape)

    def sizes(self, angles: Float[np.ndarray, " d"]) -> Float[np.ndarray, " d"]:
        """Smallest impulses that change the motion, to a part in `LANES^2`, infinite without one."""
        low, high = np.zeros_like(angles), np.full_like(angles, self.largest)
        for _ in range(2):
            low, high = self._narrowed(low, high, angles)
        return np.where(np.isnan(high), np.inf, high)

    def bracket(self, angle: float, high: float) -> tuple[float, float]:
        """Impulses along an angle of which the first, by a relative `SHARP` smaller, changes nothing."""
        ends, along = np.array([[0.0], [high]]), np.array([angle])
        while np.diff(ends, axis=0) > SHARP * ends[1]:
            ends = np.stack(self._narrowed(*ends, along))
        return float(ends[0, 0]), float(ends[1, 0])

    def _narrowed(self, low: Any, high: Any, angles: Any) -> tuple[np.ndarray, np.ndarray]:
        """Neighbours of `LANES` equal parts between which the motion changes first, NaN without any."""
        every = low + (high - low) * np.linspace(0.0, 1.0, LANES + 1)[:, None]
        leave = self.leave(np.nan_to_num(every[1:]), angles)
        first, lane = leave.argmax(axis=0), np.arange(angles.size)
        changed = leave[first, lane]
        ends = every[first, lane], every[first + 1, lane]
        return np.where(changed, ends[0], np.nan), np.where(changed, ends[1], np.nan)


def _unit(march: March) -> Complex[Array, " n"]:
    """Change of velocities by an impulse of 1 N s along x at the station of a march."""
    system = march.system
    return linalg.solve(system.blocks.inertia, system.line.column(march.stations[0]) + 0j)


def _left_vector(march: March, orbit: PeriodicOrbit) -> Float[Array, " x"]:
    """Left vector of the unstable multiplier of an orbit, of its state as real numbers."""
    state = _real(orbit)
    map_ = lambda x: _mapped(march, x, orbit.revolutions or 1)
    values, vectors = np.linalg.eig(np.asarray(jax.jit(jax.jacfwd(map_))(state)).T)
    chosen = vectors[:, np.abs(values).argmax()]
    return jnp.asarray((chosen / chosen[np.abs(chosen).argmax()]).real)


def _real(orbit: PeriodicOrbit) -> Float[Array, " x"]:
    """Coordinates and velocities of the start of an orbit as real numbers."""
    q, velocity = orbit.start.q, orbit.start.velocity
    return jnp.concatenate([q.real, q.imag, velocity.real, velocity.imag])


def _mapped(march: March, state: Float[Array, " x"], revolutions: int) -> Float[Array, " x"]:
    """State after some revolutions, as real numbers."""
    a, b, c, d = jnp.split(state, 4)
    advance = lambda y, _: (march.advance(y)[0], None)
    y, _ = jax.lax.scan(advance, march.encode(a + 1j * b, c + 1j * d), None, length=revolutions)
    q, velocity = march.decode(y)[:2]
    return jnp.concatenate([q.real, q.imag, velocity.real, velocity.imag])
