"""Rolling: static positions of shafts in rolling bearings, and their stiffness there."""

import dataclasses
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float

from ..core import linalg
from ..core.compiled import compiled_quickly
from ..core.extremes import largest
from ..core.quantities import Scalar, known, with_values
from ..core.tables import RPM, notebook_table
from ..effects import RollingBearing
from ..effects.law import Now
from ..effects.rolling_bearing import RollingLaw
from ..equations.port import Port
from ..equations.system import System
from ..scene import Scene
from .equilibrium import (
    double,
    linear_part,
    numbered,
    of_each,
    port_forces_at_rest,
    with_slopes,
)


ANGLES = 256  # of the cage in a pass, over which a mean is taken
LEVELS, NARROWER = 8, 0.05  # blends, and each over the one before
MOST = 60  # steps of Newton's method at each
LOOSE = (
    1e9  # compliance of the rotor at a bearing over that of its balls, above which nothing holds it
)


class RollingPositions(eqx.Module):
    """Positions of `f` shafts at rest in their rolling bearings at `k` speeds, and the stiffness there.

    `F = -stiffness dq` of small motions `q = (x, y)` about the position, with the cage as `linear` has it:
    "frozen" at its `angle`, or "mean", means of all three over a pass of the cage.
    """

    speeds: Float[Array, " k"]  # [rad/s]
    position: Complex[Array, "k f"]  # of the inner race from the centre of the outer one [m]
    load: Complex[Array, "k f"]  # of the rotor on the bearing [N]
    stiffness: Float[Array, "k f 2 2"]  # [N/m]
    bearings: tuple[str, ...] = eqx.field(static=True)  # names
    linear: str = eqx.field(static=True)  # "frozen" or "mean"

    @property
    def assumption(self) -> str:
        """Sentence on the cages, which a linearized scene has as its `assumption`."""
        if self.linear == "mean":
            return "rolling bearings have their mean stiffness over a pass of the cage"
        return "cages of rolling bearings stand at their angle"

    def _repr_html_(self) -> str:
        rows = [
            (name, speed, speed * RPM, abs(self.position[k, j]), abs(self.load[k, j]))
            for k, speed in enumerate(np.asarray(self.speeds))
            for j, name in enumerate(self.bearings)
        ]
        heads = ("bearing", "speed [rad/s]", "[rpm]", "displacement [m]", "load [N]")
        return notebook_table(f"Static positions in rolling bearings, {self.linear}", heads, rows)


def freeze_of(scene: Scene) -> str:
    """The `linear` of all rolling bearings of a scene; raises unless they name one, the same."""
    bearings = scene.of(RollingBearing)
    named = {bearing.linear for bearing in bearings}
    names = ", ".join(scene.name_of(bearing) for bearing in bearings)
    choices = 'the cage at its `angle` ("frozen") or the mean over a pass of the cage ("mean")'
    if None in named:
        raise ValueError(
            f"Rolling bearings ({names}) turn with their cages, so they have neither a static position "
            f"nor a stiffness unless `linear` of each names one: {choices}."
        )
    if len(named) > 1:
        raise ValueError(
            f"Rolling bearings ({names}) must all have the same `linear`, but some have {choices}."
        )
    return named.pop()


def rolling_positions(scene: Scene, system: System, speeds: Float[Array, " k"]) -> RollingPositions:
    """Rest of a scene in its rolling bearings, see `jaxrotor.static_positions`."""
    linear, bearings = freeze_of(scene), numbered(scene, RollingBearing)
    names = tuple(scene.name_of(bearing) for bearing in bearings.values())
    turning = lambda law: law.states or law.clock and not isinstance(law, RollingLaw)
    if others := system.laws_with(turning):
        raise ValueError(
            f"A static position is for forces that stand still, but those of {others} turn or have "
            "states; simulate it in time."
        )
    shares = (np.arange(ANGLES) + 0.5) / ANGLES if linear == "mean" else np.zeros(1)
    length = jnp.asarray(scene.shaft.length)
    found, loose, carries = _at_speeds(system, bearings, length, speeds, jnp.asarray(shares))
    position, load, stiffness = found
    if known(position) and not np.isfinite(position).all():
        k, j = np.argwhere(~np.isfinite(np.asarray(position)))[0]
        j = int(np.argmax(loose[k])) if np.any(loose[k]) else int(j)
        raise ValueError(f"{_why(bool(loose[k, j]), bool(carries[k, j]), names[j])} {_CURE}")
    return RollingPositions(speeds, position, load, stiffness, bearings=names, linear=linear)


_CURE = "take another load, a negative `gap` or, at one angle of the cage, another `angle`."


def _why(loose: bool, carries: bool, name: str) -> str:
    """Why there is no rest at a bearing."""
    if not loose:
        return f"No static position of the rotor in {name} was found;"
    if not carries:
        return (
            f"The static position is singular: no ball of {name} bears a load, so the shaft may rest "
            "anywhere in its gap;"
        )
    return (
        f"The static position is singular: a single ball of {name} bears the load, and nothing holds the "
        "shaft across it, which would jump from one of the neighbours to the other;"
    )


@compiled_quickly
def _at_speeds(
    system: System,
    bearings: dict[int, RollingBearing],
    length: Scalar,
    speeds: Float[Array, " k"],
    shares: Float[Array, " a"],
) -> tuple[tuple[Array, Array, Array], Array, Array]:
    """Positions, loads and stiffness at every speed, means over the cage; where none holds, and bears."""

    def at(speed: Array) -> Any:
        rest = _Rest.of(system.at_speed(speed), bearings, length)
        found, loose, carries = jax.vmap(lambda share: _positions(rest.turned(share)))(shares)
        return jax.tree.map(lambda x: x.mean(0), found), loose.any(0), carries.all(0)

    return jax.vmap(at)(speeds)


def _begun(speed: Scalar) -> Now:
    """Rotation of the first shaft at t = 0."""
    return Now(speed, jnp.zeros(()), time=jnp.zeros(()))


class _Rest(eqx.Module):
    """A rotor at rest: its linear equations, its ports, and where its rolling bearings are."""

    matrix: Float[Array, "n2 n2"]
    load: Float[Array, " n2"]
    ports: tuple[Port, ...]
    laws: tuple[RollingLaw, ...]
    rows: Float[Array, "f n"]  # read the displacements of the shafts in the bearings
    columns: Float[Array, "n f"]
    length: Scalar  # of the shaft [m]
    speed: Scalar

    @classmethod
    def of(cls, system: System, bearings: dict[int, RollingBearing], length: Scalar) -> "_Rest":
        own = list(map(system.port_of, bearings))
        rows, columns = jnp.stack([p.row for p in own]), jnp.stack([p.column for p in own], axis=1)
        speed = jnp.asarray(system.spin.speed)
        # A law is given the angles of the shafts at t = 0 by its port, so here as a part of its own
        laws = []
        for port, bearing in zip(own, bearings.values(), strict=True):
            law, now = bearing.law(), port.own(_begun(speed))
            laws.append(with_values(law, phase=law.cage(now)))
        return cls(*linear_part(system), system.ports, tuple(laws), rows, columns, length, speed)

    def _with_laws(self, change: Callable[[RollingLaw], RollingLaw]) -> "_Rest":
        """The same with other laws of rolling, those of ports as well, which are stacks of laws."""
        own = lambda law: change(law) if isinstance(law, RollingLaw) else law
        ports = [dataclasses.replace(p, laws=tuple(map(own, p.laws))) for p in self.ports]
        return dataclasses.replace(self, ports=tuple(ports), laws=tuple(map(own, self.laws)))

    def turned(self, share: Array) -> "_Rest":
        """The same with all cages turned by a share of the angle between two balls."""

        def turn(law: RollingLaw) -> RollingLaw:
            return with_values(law, phase=law.phase + share * 2 * np.pi / law.balls)

        return self._with_laws(turn)

    def blended(self, width: Array) -> "_Rest":
        """The same with bearings that are smoothed over a width [m]."""

        def blend(law: RollingLaw) -> RollingLaw:
            own = 0.0 if law.blend is None else law.blend
            smooth = jnp.sqrt(own**2 + width**2) * jnp.ones_like(law.gap)
            return with_values(law, blend=smooth)

        return self._with_laws(blend)

    def residual(self, x: Array) -> tuple[Float[Array, " n2"], Float[Array, "n2 n2"]]:
        """Force that is not balanced, and its derivative, with cages at the angle 0 of rotation."""
        now = _begun(self.speed)
        values, slopes = port_forces_at_rest(self.ports, now, x)
        return self.matrix @ x - self.load - values, self.matrix - slopes

    def places(self, x: Array) -> Float[Array, "f 2"]:
        """Displacements of the shafts in their bearings [m]."""
        return jnp.stack([double(row) @ x for row in self.rows])

    def guess(self) -> tuple[Float[Array, " n2"], Scalar]:
        """Position on springs in place of the bearings, and the largest displacement in one [m].

        Each spring is as stiff as a ball that is pressed in by a millionth of the shaft's length.
        """
        reference = 1e-6 * self.length
        stiff = lambda law: law.stiffness * law.power * reference ** (law.power - 1)
        springs = of_each(stiff, self.laws)
        pull = (self.columns * springs) @ self.rows
        x = linalg.solve(self.matrix + linalg.block_diag(pull, pull), self.load)
        loads = springs * jnp.hypot(*self.places(x).T)

        def reach(law: RollingLaw, load: Array) -> Array:
            some = law.stiffness > 0
            depth = (load / jnp.where(some, law.stiffness, 1.0)) ** (1 / law.power)
            return jnp.abs(law.gap) + jnp.where(some, depth, 0.0)

        most = jnp.max(of_each(reach, self.laws, loads))
        return x, jnp.where(most > 0, most, reference)


def _positions(rest: _Rest) -> tuple[tuple[Array, Array, Array], Array, Array]:
    """Positions, loads, stiffness; whether nothing holds a shaft in each, and whether each bears a load.

    Smoothed bearings hold the rotor everywhere, so Newton's method goes from wide blends to narrow ones.
    """
    free = jax.lax.stop_gradient
    still = free(rest)
    start, reach = still.guess()
    widths = reach * NARROWER ** jnp.arange(LEVELS)
    level = lambda x, width: (_newton(still.blended(width), x), None)
    x, _ = jax.lax.scan(level, start, widths)
    # One more step, which has the derivatives by the implicit function theorem.
    residual, jacobian = rest.residual(x)
    change = -linalg.solve(free(jacobian), residual)
    good = linalg.norm(free(change)) <= 1e-6 * (linalg.norm(x) + reach)
    x = x + change
    both = linalg.block_diag(rest.columns, rest.columns)
    yields = free(linalg.solve(jacobian, both)).reshape(2, -1, 2, len(rest.laws))
    compliance = jnp.stack(
        [jnp.einsum("n,anb->ab", row, yields[..., j]) for j, row in enumerate(rest.rows)]
    )
    now = _begun(rest.speed)

    def bearing(law: RollingLaw, place: Array) -> tuple[Array, ...]:
        own, slopes = with_slopes(lambda place: law(place, jnp.zeros(2), now), place)
        position, load = place[0] + 1j * place[1], -own[0] - 1j * own[1]
        depth = jnp.abs(law.gap) + jnp.hypot(*free(place))
        return position, load, -slopes, law.power * law.stiffness * depth ** (law.power - 1)

    *found, stiff = of_each(bearing, rest.laws, rest.places(x))
    narrow = widths[-1]
    scale = linalg.norm(still.load) + jnp.sum(
        of_each(lambda law: law.stiffness * narrow**law.power, still.laws)
    )
    settled = linalg.norm(still.blended(narrow).residual(free(x - change))[0]) <= 1e-6 * scale
    loose = settled & ~(stiff * largest(jnp.abs(compliance).reshape(-1, 4).T) < LOOSE)
    carries = largest(jnp.abs(found[2]).reshape(-1, 4).T) * LOOSE > stiff
    good = good & ~jnp.any(loose)
    return jax.tree.map(lambda x: jnp.where(good, x, jnp.nan), tuple(found)), loose, carries


def _newton(rest: _Rest, start: Float[Array, " n2"]) -> Float[Array, " n2"]:
    """A root by Newton's method, whose steps are halved until they lessen the residual."""

    def step(state):
        count, x, residual, jacobian, _ = state
        change = -linalg.solve(jacobian, residual)

        def trial(share):
            return share, *rest.residual(x + share * change)

        def worse(tried):
            share, value, _ = tried
            return (share > 1e-3) & ~(linalg.norm(value) < linalg.norm(residual))

        halve = lambda tried: trial(tried[0] / 2)
        share, residual, jacobian = jax.lax.while_loop(worse, halve, trial(jnp.ones(())))
        moved = share * linalg.norm(change) / (linalg.norm(x) + jnp.finfo(x.dtype).tiny)
        return count + 1, x + share * change, residual, jacobian, moved

    def unfinished(state):
        count, *_, moved = state
        return (count < MOST) & (moved > 1e-12)

    state = jnp.zeros((), int), start, *rest.residual(start), jnp.inf * jnp.ones(())
    return jax.lax.while_loop(unfinished, step, state)[1]
