"""Magnetic: static positions of shafts in magnetic bearings, and the linear bearings about them."""

import dataclasses
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float

from ..core import linalg
from ..core.compiled import compiled_quickly
from ..core.quantities import known, with_values
from ..core.tables import notebook_table
from ..effects import LinearMagneticBearing, MagneticBearing
from ..effects.base import AbstractContact
from ..effects.law import Now
from ..effects.magnetic_bearing import MagneticLaw
from ..equations.port import Port, port_forces, rates_of_states
from ..equations.system import System
from ..scene import Scene
from ..shafts.cased import ends, line_of
from .equilibrium import double, linear_part, with_slopes


MOST = 60  # steps of Newton's method
SHORTEST = 1e-3  # share of such a step, below which it is not shortened


class MagneticPositions(eqx.Module):
    """Position of a shaft at rest in its `f` magnetic bearings, and the linear bearings there.

    `F = current_factor di + position_factor dx` of small changes along each of both axes.
    """

    position: Complex[Array, " f"]  # of the shaft in the bearing [m]
    load: Complex[Array, " f"]  # of the rotor on the bearing [N]
    current: Float[Array, "f 2"]  # of each axis beside the bias [A]
    current_factor: Float[Array, "f 2"]  # k_i [N/A]
    position_factor: Float[Array, "f 2"]  # k_s [N/m]
    bearings: tuple[str, ...] = eqx.field(static=True)  # names

    def _repr_html_(self) -> str:
        rows = [
            (
                name,
                "first" if axis == 0 else "second",
                *(
                    part[j, axis]
                    for part in (self.current, self.current_factor, self.position_factor)
                ),
                abs(self.position[j]),
            )
            for j, name in enumerate(self.bearings)
            for axis in (0, 1)
        ]
        heads = "bearing", "axis", "current [A]", "k_i [N/A]", "k_s [N/m]", "displacement [m]"
        return notebook_table("Static positions in magnetic bearings", heads, rows)


def magnetic_positions(scene: Scene, system: System) -> MagneticPositions:
    """Rest of a scene in its magnetic bearings, see `jaxrotor.static_positions`."""
    bearings = scene.of(MagneticBearing)
    names = tuple(scene.name_of(bearing) for bearing in bearings)
    moving = lambda law: (law.states or law.clock) and not isinstance(law, MagneticLaw)
    if others := system.laws_with(moving):
        raise ValueError(
            f"A static position is for forces that stand still, but those of {others} turn or have "
            "states; simulate it in time."
        )
    contacts = scene.of(AbstractContact)
    counts = [len(contact.law().states) for contact in contacts]
    first = np.cumsum([0, *counts])[:-1]
    mine = [isinstance(contact, MagneticBearing) for contact in contacts]
    found, good = _at_rest(system, bearings, tuple(int(k) for k in first[mine]))
    if known(good) and not good:
        raise ValueError(
            f"No static position of the rotor in {', '.join(names)} was found; take less load, or a "
            "controller with `ki`."
        )
    for j, limit in enumerate(bearing.limit for bearing in bearings):
        if limit is None or not (known(found[2]) and known(limit)):
            continue
        most = float(np.abs(np.asarray(found[2][j])).max())
        if most >= float(limit):
            raise ValueError(
                f"At rest {names[j]} would need a current of {most:.4g} A, but its `limit [A]` is "
                f"{float(limit):g}: in saturation the loop is open, so the bearing neither bears the load "
                "nor is linear about a position. Take less load, or a larger `limit` and `bias`."
            )
    return MagneticPositions(*found, bearings=names)


def with_linear_bearings(scene: Scene, found: MagneticPositions) -> Scene:
    """The scene with the linear bearing about its position in place of each magnetic one."""
    effects = []
    for effect in scene.effects:
        if not isinstance(effect, MagneticBearing):
            effects.append(effect)
            continue
        name = scene.name_of(effect)
        j = found.bearings.index(name)
        current, position = found.current_factor[j], found.position_factor[j]
        shared = {field.name for field in dataclasses.fields(LinearMagneticBearing)}
        shared &= {field.name for field in dataclasses.fields(effect)}
        across: dict[str, Any] = {}
        if not (known(position) and bool(position[0] == position[1] and current[0] == current[1])):
            across = {"current_across": current[1], "position_across": position[1]}
        effects.append(
            LinearMagneticBearing(
                **{key: getattr(effect, key) for key in shared},
                name=name,
                current_factor=current[0],
                position_factor=position[0],
                **across,
            )
        )
    return scene.of_parts(*effects)


class _Rest(eqx.Module):
    """Forces that are not balanced, and rates of states, of a rotor at rest."""

    matrix: Float[Array, "n2 n2"]
    load: Float[Array, " n2"]
    rows: Float[Array, "p 2 n2"]
    columns: Float[Array, "p n2 2"]
    ports: tuple[Port, ...]
    count: int = eqx.field(static=True)  # of the states

    @classmethod
    def of(cls, system: System) -> "_Rest":
        """That of a system, whose coils have no limits, so that a solution exists."""
        unlimited = lambda law: (
            with_values(law, limit=None) if isinstance(law, MagneticLaw) else law
        )
        ports = tuple(
            dataclasses.replace(port, laws=tuple(map(unlimited, port.laws)))
            for port in system.ports
        )
        rows = jnp.stack([double(port.row) for port in ports])
        columns = jnp.stack([double(port.column).T for port in ports])
        return cls(*linear_part(system), rows, columns, ports, system.state_count)

    def motions(self, u: Array) -> tuple[Array, Array, Now]:
        """Displacements and velocities of the ports, and what all laws are given."""
        x, states = jnp.split(u, [self.load.size])
        place = self.rows @ x
        return place, 0 * place, Now(jnp.zeros(()), state=states)

    def residual(self, u: Array) -> Array:
        """Forces [N] in the equations, then rates of all states."""
        place, still, now = self.motions(u)
        forces = port_forces(self.ports, place.T, still.T, now).T
        found = self.matrix @ u[: self.load.size] - self.load
        found = found - jnp.einsum("pnk,pk->n", self.columns, forces)
        if not self.count:
            return found
        return jnp.append(found, rates_of_states(self.ports, place, still, now))


@compiled_quickly
def _at_rest(
    system: System, bearings: tuple[MagneticBearing, ...], first: tuple[int, ...]
) -> tuple[tuple[Array, ...], Array]:
    """Fields of `MagneticPositions`, and whether a position was found.

    `first` are the places of their first states.
    """
    rest, free = _Rest.of(system), jax.lax.stop_gradient
    u, good = _newton(free(rest))
    # One more step, which has the derivatives by the implicit function theorem.
    residual, jacobian = with_slopes(rest.residual, u)
    u = jnp.where(good, u - linalg.solve(free(jacobian), residual), jnp.nan)
    x, states = jnp.split(u, [rest.load.size])
    parts = []
    for bearing, k in zip(bearings, first, strict=True):
        law = with_values(bearing.law(), limit=None)
        line = line_of(system.line, bearing.shaft)
        read = lambda at, line=line, on=bearing.on: double(ends(line, at, on)[0]) @ x
        sensor = None if bearing.sensor is None else (read(bearing.sensor), jnp.zeros(2))
        now = Now(jnp.zeros(()), state=states[k : k + len(law.states)], sensor=sensor)
        parts.append(_of_bearing(law, read(bearing.at), now))
    return jax.tree.map(lambda *leaves: jnp.stack(leaves), *parts), good


def _of_bearing(law: MagneticLaw, place: Array, now: Now) -> tuple[Array, ...]:
    """Fields of `MagneticPositions` of one bearing."""
    still, along = jnp.zeros(2), law.turned(place, 1.0)
    current, one = law.current(place, still, now), jnp.ones(2)
    _, by_place = jax.jvp(lambda x: law.pull(x, current), (along,), (one,))
    _, by_current = jax.jvp(lambda i: law.pull(along, i), (current,), (one,))
    force = law(place, still, now)
    position, load = place[0] + 1j * place[1], -force[0] - 1j * force[1]
    return position, load, current, by_current, by_place


def _newton(rest: _Rest) -> tuple[Array, Array]:
    """A root by Newton's method from the centre, and whether it was found.

    Steps are halved while the shaft would pass a coil, or the residual over the Jacobian would grow.
    """

    def step(state):
        count, u, _ = state
        residual, jacobian = with_slopes(rest.residual, u)
        change = -linalg.solve(jacobian, residual)
        size = linalg.norm(change)

        def worse(share):
            ahead = linalg.solve(jacobian, rest.residual(u + share * change))
            return (share > SHORTEST) & ~(linalg.norm(ahead) < size)

        share = jax.lax.while_loop(worse, lambda share: share / 2, jnp.ones(()))
        moved = share * size / (linalg.norm(u) + jnp.finfo(u.dtype).tiny)
        return count + 1, u + share * change, jnp.where(size > 0, moved, 0.0)

    def unfinished(state):
        count, _, moved = state
        return (count < MOST) & (moved > 1e-13)

    zero = jnp.zeros(rest.load.size + rest.count)
    state = jnp.zeros((), int), zero, jnp.inf * jnp.ones(())
    _, u, moved = jax.lax.while_loop(unfinished, step, state)
    return u, (moved < 1e-8) & jnp.all(jnp.isfinite(u))
