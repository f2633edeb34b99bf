"""Films: static positions of shafts in their oil films and seals, and linear coefficients there."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Bool, Complex, Float

from ..core import linalg
from ..core.compiled import compiled_quickly
from ..core.extremes import larger
from ..core.quantities import Scalar, known
from ..core.tables import RPM, notebook_table
from ..effects import RollingBearing, Seal, Support
from ..effects.film import AbstractFluid, AbstractFluidLaw
from ..effects.law import Beside, Now
from ..equations.port import Port
from ..equations.stationary_frame import check_not_turning
from ..equations.system import System
from ..scene import Scene
from .equilibrium import (
    double,
    linear_part,
    numbered,
    of_each,
    parts_of,
    port_forces_at_rest,
    with_slopes,
)


STIFF = 1e6  # springs that hold journals in place, over the stiffness of their films
MOST = 60  # steps of Newton's method


class StaticPositions(eqx.Module):
    """Positions of `f` journals at rest in their films at `k` speeds, and the linear film there.

    `F = -stiffness dq - damping dq.` of small motions `q = (x, y)` about the position.
    """

    speeds: Float[Array, " k"]  # [rad/s]
    position: Complex[Array, "k f"]  # of the journal from the centre of its bush [m]
    eccentricity: Float[Array, "k f"]  # over the clearance
    load: Complex[Array, "k f"]  # of the rotor on the film [N]
    stiffness: Float[Array, "k f 2 2"]  # [N/m]
    damping: Float[Array, "k f 2 2"]  # [N s/m]
    films: tuple[str, ...] = eqx.field(static=True)  # names of the bearings

    @property
    def attitude(self) -> Float[Array, "k f"]:
        """Angle [rad] from the load to the position, positive in the sense of x to y."""
        return jnp.angle(self.position * jnp.conj(self.load))

    def _repr_html_(self) -> str:
        rows = [
            (name, speed, speed * RPM, self.eccentricity[k, j], abs(self.load[k, j]))
            for k, speed in enumerate(np.asarray(self.speeds))
            for j, name in enumerate(self.films)
        ]
        heads = ("film", "speed [rad/s]", "[rpm]", "eccentricity", "load [N]")
        return notebook_table("Static positions in films and seals", heads, rows)


def film_positions(scene: Scene, system: System, speeds: Float[Array, " k"]) -> StaticPositions:
    """Rest of a scene in its oil films and seals, see `jaxrotor.static_positions`."""
    films = numbered(scene, AbstractFluid)
    check_not_turning(system, "A static position", "simulate it in time")
    position, load, stiffness, damping = _at_speeds(system, films, speeds)
    if known(position) and not np.isfinite(position).all():
        k = int(np.argmin(np.isfinite(position).all(axis=1)))
        raise ValueError(
            f"No static position in the films was found at {float(speeds[k]):g} rad/s: a film bears "
            "nothing at rest and has no stiffness if its journal does not turn; take higher speeds, less "
            "load, or add a Support."
        )
    gaps = jnp.stack([film.clearance for film in films.values()])
    return StaticPositions(
        speeds=speeds,
        position=position,
        eccentricity=jnp.abs(position) / gaps,
        load=load,
        stiffness=stiffness,
        damping=damping,
        films=tuple(scene.name_of(film) for film in films.values()),
    )


def film_support(film: AbstractFluid, load: ArrayLike, speeds: Any) -> Support:
    """Linear `Support` of one film under a given load, by the exact Jacobian at its static position.

    Args:
        film: a `JournalBearing` or `Seal`.
        load: complex force of the rotor on the film, `x + i y` [N], such as `-1j * weight`.
        speeds: a speed [rad/s], or two or more ascending ones as nodes of tables.

    Returns:
        The support at the station of the film.

    Raises:
        ValueError: if the film has no position that bears the load.
    """
    nodes = jnp.atleast_1d(jnp.asarray(speeds, float))
    position, _, stiffness, damping = _under_load(film, jnp.asarray(load, complex), nodes)
    if known(position) and not np.isfinite(position).all():
        raise ValueError(
            "No position in the film bears the load; a film bears nothing at rest or if its journal does "
            "not turn: take higher speeds, or less load."
        )
    return support_of(film, nodes if np.ndim(speeds) else None, stiffness[:, 0], damping[:, 0])


@compiled_quickly
def _at_speeds(system: System, films: dict[int, AbstractFluid], speeds: Float[Array, " k"]):
    """Positions in the bush, loads, stiffness and damping of all films at every speed."""
    return jax.vmap(lambda speed: _positions(_Balance.of(system.at_speed(speed), films)))(speeds)


@compiled_quickly
def _under_load(film: AbstractFluid, load: Complex[Array, ""], speeds: Float[Array, " k"]):
    """Position in the bush, load, stiffness and damping at every speed."""
    return jax.vmap(lambda speed: _positions(_Balance.under_load(film, load, speed)))(speeds)


def support_of(
    bearing: AbstractFluid | RollingBearing,
    speeds: Array | None,
    stiffness: Float[Array, "k 2 2"],
    damping: Any,
) -> Support:
    """A support with coefficients at `k` speeds, or at one where `speeds` is None."""
    numbers: dict[str, Any] = {}
    given = [("k", stiffness), *([] if damping is None else [("c", damping)])]
    for letter, matrix in given:
        for i, j, axes in ((0, 0, "xx"), (0, 1, "xy"), (1, 0, "yx"), (1, 1, "yy")):
            numbers[letter + axes] = matrix[:, i, j] if speeds is not None else matrix[0, i, j]
    turning = bearing.turning if isinstance(bearing, AbstractFluid) else False
    over = None if bearing.shaft is None else "first"
    sense = {} if speeds is None else {"speeds": speeds, "one_sense": turning, "speeds_of": over}
    if isinstance(bearing, Seal):
        numbers["mxx"] = bearing.inertia
    where: dict[str, Any] = {"at": bearing.at, "on": bearing.on, "shaft": bearing.shaft}
    return Support(**where, **sense, **numbers)


# === equilibrium


class _Balance(eqx.Module):
    """`matrix x - load - Sum column F(row x) = 0` of coordinates `x = (Re q, Im q)` at rest."""

    matrix: Float[Array, "n2 n2"]
    load: Float[Array, " n2"]
    ports: tuple[Port, ...]
    laws: tuple[AbstractFluidLaw, ...]
    rows: Float[Array, "f n"]  # read the displacements of the journals
    columns: Float[Array, "n f"]
    speed: Scalar  # of the first shaft [rad/s]
    speeds: Float[Array, "f 2"]  # of the shaft in each film, and of what it stands on [rad/s]

    @classmethod
    def of(cls, system: System, films: dict[int, AbstractFluid]) -> "_Balance":
        """Balance of a rotor at its speed."""
        matrix, load = linear_part(system)
        speed = jnp.asarray(system.spin.speed)
        return cls._of(matrix, load, system.ports, films, list(map(system.port_of, films)), speed)

    @classmethod
    def _of(cls, matrix, load, ports, films, own: list[Port], speed: Scalar) -> "_Balance":
        """Balance of films, each with its `own` port."""
        rows, columns = (
            jnp.stack([getattr(port, side) for port in own]) for side in ("row", "column")
        )
        laws = tuple(film.law() for film in films.values())
        rotations = [port.own(Now(speed)) for port in own]
        still = lambda now: 0 * speed if now.beside is None else now.beside.speed
        speeds = jnp.stack([jnp.stack([now.speed, still(now)]) for now in rotations])
        return cls(matrix, load, ports, laws, rows, columns.T, speed, speeds)

    @classmethod
    def under_load(cls, film: AbstractFluid, load: Complex[Array, ""], speed: Scalar) -> "_Balance":
        """Balance of a journal under a load."""
        one, law = jnp.ones(1), film.law()
        port = Port(one, one, film.at, (jax.tree.map(lambda leaf: jnp.asarray(leaf)[None], law),))
        zero, load = jnp.zeros((2, 2)), parts_of(load[None])
        return cls._of(zero, load, (port,), {0: film}, [port], speed)

    def residual(self, x: Array) -> tuple[Float[Array, " n2"], Float[Array, "n2 n2"]]:
        """Force that is not balanced, and its derivative."""
        values, slopes = port_forces_at_rest(self.ports, Now(self.speed), x)
        return self.matrix @ x - self.load - values, self.matrix - slopes

    def places(self, x: Array) -> Float[Array, "f 2"]:
        """Displacements of the journals [m]."""
        return jnp.stack([double(row) @ x for row in self.rows])

    def eccentricities(self, x: Array) -> Float[Array, " f"]:
        """Distances of the journals from the centres of their bushes, over the clearances."""
        distance = lambda law, place: linalg.norm(law.eccentricity(place))
        return of_each(distance, self.laws, self.places(x))

    def guess(self) -> Float[Array, " n2"]:
        """Every journal in the position that bears the load which a spring in place of its film carries.

        Where the loads follow from equilibrium alone, it is near the position that is sought.
        """
        centres = jnp.stack([law.x + 1j * law.y for law in self.laws])
        springs = of_each(
            lambda law, speeds: law.spring(law.carried(_now(speeds))), self.laws, self.speeds
        )

        def held(springs: Array, places: Array) -> Float[Array, " n2"]:
            """Position on springs that are without force in some places."""
            pull = (self.columns * springs) @ self.rows
            matrix = self.matrix + linalg.block_diag(pull, pull)
            return linalg.solve(matrix, self.load + parts_of(self.columns @ (springs * places)))

        x, y = (self.places(held(springs, centres))).T
        loads = springs * (x + 1j * y - centres)
        place = lambda law, load, speeds: law.place(load, law.carried(_now(speeds)))
        places = of_each(place, self.laws, loads, self.speeds)
        return held(STIFF * springs, centres + places)


def _now(speeds: Float[Array, "2"]) -> Now:
    """Rotation of a shaft in a film, and of what it stands on."""
    return Now(speeds[0], beside=Beside(speeds[1], None))


def _positions(balance: _Balance):
    """Positions in the bushes, loads, stiffness and damping of all films; NaN where there are none."""
    free = jax.lax.stop_gradient
    x, good = _newton(free(balance))
    # One more step, which has the derivatives by the implicit function theorem.
    residual, jacobian = balance.residual(x)
    x = jnp.where(good, x - linalg.solve(free(jacobian), residual), jnp.nan)

    def film(law: AbstractFluidLaw, place: Array, speeds: Array) -> tuple[Array, ...]:
        force = lambda motion: law(motion[:2], motion[2:], _now(speeds))
        own, slopes = with_slopes(force, jnp.append(place, jnp.zeros(2)))
        position = place - jnp.stack([law.x, law.y])
        vectors = position[0] + 1j * position[1], -own[0] - 1j * own[1]
        return *vectors, -slopes[:, :2], -slopes[:, 2:]

    return of_each(film, balance.laws, balance.places(x), balance.speeds)


def _newton(balance: _Balance) -> tuple[Float[Array, " n2"], Bool[Array, ""]]:
    """A root by Newton's method, and whether it was found.

    A step is shortened so that no journal covers more than seven tenths of what is left to its wall.
    """
    start = balance.guess()

    def too_far(state):
        share, x, change, before = state
        after = 1 - balance.eccentricities(x + share * change)
        return (share > 1e-6) & ~jnp.all(after >= 0.3 * before)

    def step(state):
        count, x, at, *_ = state
        residual, jacobian = balance.residual(x)
        change = -linalg.solve(jacobian, residual)
        shorten = lambda state: (state[0] / 2, *state[1:])
        share, *_ = jax.lax.while_loop(too_far, shorten, (jnp.ones(()), x, change, 1 - at))
        x = x + share * change
        moved = linalg.norm(share * change) / (linalg.norm(x) + jnp.finfo(x.dtype).tiny)
        now = balance.eccentricities(x)
        return count + 1, x, now, larger(jnp.max(jnp.abs(now - at)), moved), share

    def unfinished(state):
        count, _, _, size, _ = state
        return (count < MOST) & (size > 1e-11)

    ones = jnp.ones(())
    state = jnp.zeros((), int), start, balance.eccentricities(start), jnp.inf * ones, ones
    _, x, now, size, share = jax.lax.while_loop(unfinished, step, state)
    return x, (size < 1e-8) & (share == 1) & jnp.all(now < 1)
