"""System: the equations of motion of a scene. See docs/concepts/ports.md for its ports."""

import dataclasses
from collections.abc import Callable, Iterable, Iterator
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Bool, Float

from ..core.blocks import Blocks, Load
from ..core.compiled import compiled_quickly
from ..core.quantities import Scalar, known
from ..effects.base import (
    AbstractBetween,
    AbstractBodies,
    AbstractContact,
    AbstractUnequal,
)
from ..effects.law import AbstractLaw, Clock, Now, States
from ..effects.layout import coaxial_shafts
from ..effects.places import of_first_order
from ..scene import Scene
from ..shafts.cased import ends, line_of
from ..shafts.line import AbstractLine
from ..spins.base import AbstractSpin
from ..spins.constant import constant
from .massless_coordinates import Massless
from .other_unbalance import OtherUnbalance
from .parts import (
    OverSpeed,
    Parts,
    assemble_blocks,
    assemble_load,
    blocks_of_parts,
    loads_of_others,
)
from .port import Port, count_of, of_all, of_each
from .rigid_motions import unheld
from .speed_tables import has_tables, within_tables, without_still_tables


LEAST_DIGITS = 1e-4  # relative error up to which equations determine their unknowns


class Race(eqx.Module):
    """One station where bodies roll round the shaft: reads `row . q`, adds `column F`."""

    row: Float[Array, " n"]
    column: Float[Array, " n"]
    at: Scalar  # [m]
    bodies: AbstractBodies


class System(eqx.Module):
    """`M q.. + (C - i Omega G) q. + (K - i Omega H) q = loads + Sum_ports column F(row q, row q.)`.

    `q` are `n` complex coordinates `x + i y` of an isotropic rotor. An absent block is None. Where
    coefficients depend on the speed, the blocks are those at the speed of the spin at t = 0.
    """

    line: AbstractLine
    blocks: Blocks
    load: Load
    ports: tuple[Port, ...]
    races: tuple[Race, ...]
    between: tuple[AbstractBetween, ...]  # forces between the bodies of every race
    spin: AbstractSpin
    n: int = eqx.field(static=True)  # number of complex coordinates
    members: tuple[int, ...] = eqx.field(static=True)  # index of each law's contact in the scene
    owners: tuple[tuple[str, str], ...] = eqx.field(static=True)  # (block, part that adds to it)
    massless: Massless | None = eqx.field(static=True, default=None)  # that steps eliminate
    # Unequal fixed axes as ports; none where no axes turn, or some spread over the shaft or have tables:
    deviators: tuple[Port, ...] = ()
    remainder: int = eqx.field(static=True, default=0)  # how many of the last `ports` are such
    tabled: Scene | None = None  # the scene, where coefficients depend on the speed
    free: bool = eqx.field(static=True, default=False)  # in a rigid motion, see `unheld`
    over_speed: OverSpeed | None = None  # see there
    # Unbalance of the shafts beside the first one; in time it acts by further ports, no contacts:
    others: tuple[OtherUnbalance, ...] = ()
    # Of the shaft whose turns are the revolutions of a motion; None: the first one
    counted: Clock | None = None
    # Whether laws by "turns" repeat in a revolution of the motion, see `AbstractLaw.period`:
    repeats: bool = eqx.field(static=True, default=False)

    @property
    def steep(self) -> bool:
        """Whether a law has no bound, so that steps need an error estimate, see `AbstractLaw`."""
        return any(law.steep for port in self.ports for law in port.laws)

    @property
    def coupled(self) -> bool:
        """Whether balls, states of laws, or a rotation not known in time are part of the motion."""
        return bool(self.races) or bool(self.state_count) or not self.spin.given

    def owners_of(self, *what: str) -> str:
        """Names of the parts that add to some blocks, are a "contact" or have "bodies", as a phrase."""
        return phrase(dict.fromkeys(part for block, part in self.owners if block in what))

    def at_speed(self, speed: ArrayLike) -> "System":
        """The same rotor at a constant speed, with its coefficients there."""
        spin = constant(speed)
        return dataclasses.replace(self, spin=spin, blocks=self.blocks_at(spin.speed))

    @eqx.filter_jit  # traced once a program
    def blocks_at(self, speed: Scalar) -> Blocks:
        """Blocks at a speed [rad/s]; NaN where a table of coefficients has no value."""
        if self.tabled is None:
            return self.blocks
        if self.over_speed is None:
            return assemble_blocks(self.tabled.at_speed(speed), self.line)
        return self.over_speed.blocks_at(speed)

    @property
    def at_rest(self) -> "System":
        """The same rotor at rest, with coefficients at the lowest speed of tables that begin above."""
        rest = constant(jnp.zeros(()))
        return dataclasses.replace(self, spin=rest, blocks=self.blocks_within(rest.speed))

    def blocks_within(self, speed: Scalar) -> Blocks:
        """Blocks at a speed [rad/s], or at the nearer end of the tables."""
        return self.blocks_at(speed if self.tabled is None else within_tables(self.tabled, speed))

    def covers(self, speed: Scalar) -> Bool[Array, ""]:
        """Whether all tables of coefficients have values at a speed [rad/s]."""
        inside = True if self.tabled is None else within_tables(self.tabled, speed) == speed
        return jnp.asarray(inside)

    @property
    def clocks(self) -> set[str]:
        """Clocks that laws ask for, see `AbstractLaw`."""
        return {law.clock for port in self.ports for law in port.laws if law.clock}

    @property
    def state_count(self) -> int:
        """Number of states of all laws."""
        return sum(len(port.places) for port in self.ports)

    @property
    def state_units(self) -> tuple[str, ...]:
        """Units of the states of all laws, contact by contact of the scene."""
        places, units = [], []
        for port in self.ports:
            places += port.places
            units += [
                state.partition(" [")[2]
                for stack in port.laws
                for state in stack.states * count_of(stack)
            ]
        return tuple(units[i] for i in np.argsort(places))

    def begin(self) -> States:
        """States of all laws at the start of a motion, contact by contact of the scene."""
        return of_all(self.ports, [port.begin() for port in self.ports])

    def laws_with(self, test: Callable[[AbstractLaw], Any]) -> str:
        """Names of the contacts whose laws pass a test, as a phrase."""
        stacks = [stack for port in self.ports for stack in port.laws]
        passed = [test(stack) for stack in stacks for _ in range(count_of(stack))]
        contacts = [part for block, part in self.owners if block == "contact"]
        # Ports of unequal axes follow, which are no contacts; linear equations have no ports left.
        numbers = sorted(i for i, good in zip(self.members, passed, strict=False) if good)
        beside = any(passed[len(self.members) :])
        return phrase([*(contacts[i] for i in numbers), *["unbalance of another shaft"] * beside])

    def port_of(self, contact: int) -> Port:
        """The port of a contact, by its number in the scene."""
        lasts = np.cumsum([sum(map(count_of, port.laws)) for port in self.ports])
        place = self.members.index(contact)
        return self.ports[int(np.searchsorted(lasts, place, side="right"))]

    def contact_forces(
        self, displacement: Array, velocity: Array, now: Now
    ) -> Float[Array, "k 2 ..."]:
        """Force of each contact of the scene, in its order, from the motion (p, 2) of the ports.

        Elementwise laws take the motion of several lanes, (p, 2, lanes).
        """
        own = of_each(self.ports, now, displacement, velocity)
        motions = zip(self.ports, displacement, velocity, own, strict=True)
        return jnp.concatenate([port.forces(d, v, own) for port, d, v, own in motions])[self._order]

    def clearances(self, displacement: Array) -> Float[Array, " k"]:
        """Distance of each contact of the scene until it acts [m], arguments as in `contact_forces`."""
        found = [port.clearances(displacement[i]) for i, port in enumerate(self.ports)]
        return jnp.concatenate(found)[self._order]

    @property
    def _order(self) -> Array:
        """Laws in the order of the scene's contacts."""
        return jnp.asarray(sorted(range(len(self.members)), key=self.members.__getitem__), int)


def assemble(scene: Scene, together: tuple[tuple[int, ...], ...] | None = None) -> System:
    """Equations of motion of a scene, by one program for all scenes of the same structure.

    Args:
        scene: rotor to assemble.
        together: groups of contacts, by their number in the scene, that share a port; by default
            contacts at one station, where their stations are known.

    Returns:
        The equations as a `System`.
    """
    own = without_still_tables(scene)
    system = _assembled(own, port_groups(scene) if together is None else together)
    return dataclasses.replace(system, free=True) if unheld(scene) else system


@compiled_quickly
def _assembled(scene: Scene, together: tuple[tuple[int, ...], ...]) -> System:
    line = scene.line()
    parts = blocks_of_parts(scene, line)
    blocks = sum(parts.values(), Blocks())
    contacts = scene.of(AbstractContact)
    lines = [line_of(line, one.shaft) for one in contacts]
    owned = {i: one.own_port(lines[i]) for i, one in enumerate(contacts) if one.own_port}
    every = [owned[i].law if i in owned else one.law() for i, one in enumerate(contacts)]
    beside: dict[str | None, Any] = {o.name: o.clock for o in coaxial_shafts(scene.effects)}
    check_clocks(scene, beside, every)
    stood_on = {scene.name: Clock(jnp.ones(()), None)} | beside if beside else {}
    first = np.cumsum([0, *(len(law.states) for law in every)])
    ports, members = [], []
    for group in together:
        stacks: dict = {}
        for i in group:
            stacks.setdefault(jax.tree.structure(every[i]), []).append(i)
        own = [i for stack in stacks.values() for i in stack]
        at, on = contacts[group[0]].at, contacts[group[0]].on
        at = jnp.zeros(()) if at is None else at
        own_port = owned.get(group[0])
        row, column = ends(lines[group[0]], at, on) if own_port is None else own_port[:2]
        laws = tuple(_stack([every[i] for i in stack]) for stack in stacks.values())
        places = tuple(int(k) for i in own for k in range(first[i], first[i + 1]))
        clocks = {"clock": beside.get(contacts[group[0]].shaft), "beside": stood_on.get(on)}
        ports.append(Port(row, column, at, laws, on=on, places=places, **clocks))
        members += own
    for i, group in enumerate(together):  # sensors: ports without laws, which follow all others
        sensor, on = sensor_of(contacts[group[0]]), contacts[group[0]].on
        if sensor is not None:
            ports[i] = dataclasses.replace(ports[i], reads=len(ports))
            row, column = ends(lines[group[0]], sensor, on)
            ports.append(Port(row, 0 * column, sensor, (), on=on))
    others = loads_of_others(scene, line)
    if scene.in_time:
        ports += [port for one in others for port in one.ports()]
        others = ()
    races = []
    for b in scene.of(AbstractBodies):
        own = line_of(line, b.shaft)
        races.append(Race(own.row(b.at), own.column(b.at), b.at, b))
    return System(
        line,
        blocks,
        assemble_load(scene, line, blocks),
        tuple(ports),
        tuple(races),
        scene.of(AbstractBetween),
        scene.spin,
        line.stiffness.shape[0],
        tuple(members),
        tuple(_owners(scene, parts)),
        deviators=tuple(_deviators(scene, line, parts)),
        tabled=scene if has_tables(scene) else None,
        over_speed=OverSpeed.of(scene, line, parts),
        others=others,
    )


def check_clocks(scene: Scene, beside: Any, laws: list[AbstractLaw]) -> None:
    """Raise if a law by the angle of a revolution, or balls, are on a shaft beside the first one."""
    pairs = zip(scene.of(AbstractContact), laws, strict=True)
    turning = [one for one, law in pairs if law.clock == "revolution" and one.shaft in beside]
    for effect in [*turning, *(one for one in scene.of(AbstractBodies) if one.shaft in beside)]:
        raise ValueError(
            f"The {scene.name_of(effect)} turns with the shaft {effect.shaft!r}, but only with the first "
            f"one, {scene.name!r}, are such parts known; name that shaft first."
        )


def _deviators(scene: Scene, line: AbstractLine, parts: Parts) -> Iterator[Port]:
    """See `System.deviators`."""
    effects = {scene.name_of(effect): effect for effect in scene.of(AbstractUnequal)}
    present = [
        (part, block) for own, sums in parts.items() for part in own for block in sums.present
    ]
    turning = any(block.startswith("rotating_") for _, block in present)
    spread = any(block.startswith("fixed_") and part not in effects for part, block in present)
    if turning and not spread and not has_tables(scene):
        found = (effect.deviator(line_of(line, effect.shaft)) for effect in effects.values())
        yield from (
            Port(one.row, one.column, jnp.zeros(()), (_stack([one.law]),)) for one in found if one
        )


def _owners(scene: Scene, parts: Parts) -> Iterator[tuple[str, str]]:
    """Names of blocks, "contact" and "bodies", each with a part of the scene that adds to it."""
    present = {part: sums.present for own, sums in parts.items() for part in own}
    for part in sorted(present, key=["the shaft", *map(scene.name_of, scene.effects)].index):
        yield from ((block, part) for block in present[part])
    for what, kind in (("contact", AbstractContact), ("bodies", AbstractBodies)):
        yield from ((what, scene.name_of(effect)) for effect in scene.of(kind))


def structure(scene: Scene, together: tuple[tuple[int, ...], ...] | None = None) -> System:
    """Blocks, loads and ports of a scene as shapes alone, without the cost of `assemble`."""
    own = without_still_tables(scene)
    return _assembled.shapes(own, port_groups(scene) if together is None else together)


def state_names(scene: Scene) -> dict[str, str]:
    """Units of the states of all laws by their names, contact by contact: `worn_stops.0.depth` in m."""
    found = {}
    for contact in scene.of(AbstractContact):
        law = eqx.filter_eval_shape(lambda contact: contact.law(), contact)
        for name, _, unit in (state.removesuffix("]").partition(" [") for state in law.states):
            found[f"{scene.name_of(contact)}.{name}"] = unit or "1"
    return found


def phrase(names: Iterable[str]) -> str:
    """Names as a phrase: "a, b and c"."""
    names = list(names)
    return " and ".join(filter(None, [", ".join(names[:-1]), *names[-1:]]))


def has_massless(scene: Scene, system: System | None = None) -> bool | None:
    """Whether some coordinates of a scene have no inertia; None where that is traced.

    `system` are its equations, where they are at hand. Raises where a combined motion of coordinates
    with inertia has none.
    """
    if all(own.shaft.has_mass for own in scene.placed()):
        return bool(of_first_order(scene.effects))
    system = assemble(scene) if system is None else system
    inertia = system.blocks.inertia
    if not system.n:  # a rigid axis held fast, which rotates only
        return False
    if inertia is None:
        return True
    if not known(inertia):
        return None
    massive = np.diag(inertia) > 0
    sizes = np.sqrt(np.diag(inertia)[massive])
    scaled = np.asarray(inertia)[np.ix_(massive, massive)] / np.outer(sizes, sizes)
    if sizes.size and np.linalg.cond(scaled) * np.finfo(scaled.dtype).eps > LEAST_DIGITS:
        raise ValueError(
            "The parts on the shaft give it no inertia against one of its motions; give a Disc a "
            "`diametral` moment of inertia, or put another one elsewhere."
        )
    return not massive.all()


def polar_inertia(scene: Scene) -> Scalar | None:
    """Moment of inertia of a scene's shaft and discs about the axis [kg m^2]; None without any."""
    return assemble(scene).blocks.polar


def port_groups(scene: Scene) -> tuple[tuple[int, ...], ...]:
    """Groups of contacts of a scene that act at one station, on the same casing if any, and share a port.

    What reads no displacement at its station, as a hinge, has a port of its own.
    Stations are the same if they are one traced value, or known and equal. Contacts with separately
    traced stations have ports of their own, so that a derivative by one station moves that contact alone.
    Contacts with other sensors have ports of their own, too.
    """
    groups: list[tuple[AbstractContact, list[int]]] = []

    def same(a: Any, b: Any) -> bool:
        if a is None or b is None:
            return a is b
        return a is b or known(a) and known(b) and float(a) == float(b)

    for i, contact in enumerate(scene.of(AbstractContact)):
        for first, group in groups:
            alone = contact.own_port or first.own_port
            alike = same(contact.at, first.at) and same(sensor_of(contact), sensor_of(first))
            if not alone and contact.on == first.on and contact.shaft == first.shaft and alike:
                group.append(i)
                break
        else:
            groups.append((contact, [i]))
    return tuple(tuple(group) for _, group in groups)


def sensor_of(contact: AbstractContact) -> Scalar | None:
    """Station of the sensor of a contact [m]; None: its law reads where it acts."""
    return getattr(contact, "sensor", None)


def _stack(laws: list[AbstractLaw]) -> AbstractLaw:
    return jax.tree.map(lambda *leaves: jnp.stack(leaves), *laws)
