"""Unbalance cases: where a standard puts an unbalance to excite a mode, and how much."""

from collections.abc import Iterator
from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ...core.quantities import Scalar
from ...core.tables import RPM
from ...effects import AbstractLinear, Disc, Unbalance
from ...equations.speed_tables import at_own_speed
from ...files.machine import Machine
from ...scene import Scene
from ...shafts.virtual import VirtualLine
from ..balancing import centre_of_mass, total_mass
from ..critical import critical_speeds
from ..modal import Modes, modes
from .critical_map import own_stiffness, sprung


RESIDUAL = 6.35e-3  # kg m rpm/kg: 6350 W / N in g mm
FAST = 25_000.0  # rpm from which the residual unbalance is that of this speed
TWICE = 2.0  # residual unbalances that are applied
HIGHEST = 1.5  # times the maximum continuous speed: modes above are not excited
MODES = 3  # shapes of each kind of whirl that place an unbalance, at most
_POINTS = 201
_SAME = 0.05  # of the length: cases of one kind nearer than this are one
OVERHUNG = 0.25  # share of the mass outside of one bearing from which a rotor is overhung
_LESS = 0.5  # of the deflection outside, below which a shape of one sign is not excited between
_FLAT = 0.99  # of the largest deflection, from which the station nearest to the middle counts
_BOTH = 0.2  # of the largest deflection between the bearings, from which the other sign counts


class UnbalanceCase(NamedTuple):
    """Unbalances `2 U_r` of one case, each of the mass W that the standard takes."""

    name: str  # "mid-span", "quarter-span", "overhung" or "coupling", with a number from the second on
    critical: float  # undamped critical speed whose shape placed it [rad/s], NaN where none did
    stations: tuple[float, ...]  # [m]
    masses: tuple[float, ...]  # W [kg]
    moments: tuple[float, ...]  # [kg m]

    @property
    def unbalances(self) -> list[Unbalance]:
        """Unbalances of the case; a second one is opposite to the first."""
        placed = zip(self.stations, self.moments, strict=True)
        return [Unbalance(at, moment=u, phase=np.pi * k) for k, (at, u) in enumerate(placed)]

    def on(self, scene: Scene) -> Scene:
        """The scene with the unbalance of this case and no other one."""
        others = (one for one in scene.effects if not isinstance(one, Unbalance))
        return scene.of_parts(*others, *self.unbalances)


def residual_unbalance(mass: float | int, speed: float | int) -> float:
    """`U_r = 6350 W / N` g mm: residual unbalance [kg m]; from 25 000 rpm on `W / 3.937` g mm.

    Args:
        mass: W [kg], the static load of a journal or the overhung mass.
        speed: maximum continuous speed N [rad/s].

    Returns:
        Unbalance [kg m].

    Source: API RP 684 (2005), SP6.8.2.7.
    """
    return RESIDUAL * mass / min(RPM * abs(speed), FAST)


def journal_loads(scene: Scene, bearings: Float[np.ndarray, "2"]) -> tuple[float, float]:
    """`W_1 = m (z_2 - z_c) / (z_2 - z_1)`: masses [kg] that two bearings carry at rest.

    Args:
        scene: the rotor; seals are taken to carry nothing.
        bearings: stations z_1, z_2 [m] of the bearings.

    Returns:
        `W_1, W_2` [kg], negative where a bearing is lifted by an overhung mass.
    """
    first, last = bearings.tolist()
    mass, centre = float(total_mass(scene)), float(centre_of_mass(scene))
    left = mass * (last - centre) / (last - first)
    return left, mass - left


def overhung_masses(scene: Scene, bearings: Float[np.ndarray, "2"]) -> tuple[float, float]:
    """Masses [kg] of shaft and discs outside of each of two bearings, left and right."""
    first, last = bearings.tolist()

    def outside(x: Scalar) -> Float[Array, "2"]:
        return jnp.stack([1.0 * (x < first), 1.0 * (x > last)])

    line = VirtualLine(line=scene.line(), shapes=outside, slopes=lambda x: jnp.zeros(2))
    parts = [scene.shaft, *scene.of(AbstractLinear)]
    weights = [at_own_speed(scene, part).blocks(line).weight for part in parts]
    left, right = sum((one for one in weights if one is not None), start=jnp.zeros(2)).tolist()
    return left, right


def unbalance_cases(
    scene: Scene, machine: Machine, bearings: Float[np.ndarray, "2"], shapes: Modes | None = None
) -> list[UnbalanceCase]:
    """Cases by the shapes of the undamped rotor, `critical_modes`, and one for each coupling.

    Where a shape has one sign between the bearings, the unbalance is at its largest deflection there,
    of `W_1 + W_2`. Where it has several, two opposite ones are at the largest deflections of either
    sign there, of `W_1` and `W_2`. Where a shape is larger outside of the bearings than between, there
    is one outside, too, of the overhung mass, at the heaviest disc there or else at the largest
    deflection; a case between them by a shape of one sign that is less than half as large there is
    left out. So is an overhung one where a coupling has it. A quarter of the mass outside of one
    bearing has an unbalance at its heaviest disc in any case.
    Source: API RP 684 (2005), SP6.8.2.7 and its figure of typical shapes.
    """
    fastest = float(machine.fastest)
    shapes = critical_modes(scene, machine, bearings) if shapes is None else shapes
    loads = journal_loads(scene, bearings)
    overhung = overhung_masses(scene, bearings)
    ends = [] if machine.couplings is None else np.asarray(machine.couplings).tolist()
    coupled = (("coupling", at, _outside(at, bearings, overhung)) for at in ends)
    couplings = [_case(name, np.nan, [at], [mass], fastest) for name, at, mass in coupled]
    cases: list[UnbalanceCase] = []
    apart = _SAME * float(scene.shaft.length)
    for case in _by_shapes(scene, shapes, bearings, fastest, loads, overhung):
        alike = [one for one in cases if one.name.partition(" ")[0] == case.name]
        same = alike + (couplings if case.name == "overhung" else [])
        if not any(np.allclose(case.stations, one.stations, rtol=0, atol=apart) for one in same):
            number = f" {len(alike) + 1}" if alike else ""
            cases.append(case._replace(name=case.name + number))
    for at, mass, side in _heavy_ends(scene, bearings, overhung):
        if not any(_same_side(one.stations[0], side, bearings) for one in cases + couplings):
            cases.append(_case("overhung", np.nan, [at], [mass], fastest))
    return cases + couplings


def _heavy_ends(
    scene: Scene, bearings: np.ndarray, overhung: tuple[float, float]
) -> Iterator[tuple[float, float, float]]:
    """Station of the heaviest disc and mass outside of a bearing, where a large share of the rotor is."""
    for mass, end in zip(overhung, (0.0, float(scene.shaft.length)), strict=True):
        at = _heaviest(scene, end, bearings)
        if at is not None and is_overhung(scene, mass):
            yield at, mass, end


def is_overhung(scene: Scene, mass: float) -> bool:
    """Whether a mass outside of one bearing is a large share of the rotor."""
    return mass > OVERHUNG * float(total_mass(scene))


def _heaviest(scene: Scene, end: float, bearings: np.ndarray) -> float | None:
    """Station of the heaviest disc outside of the same bearing as an end; None where there is none."""
    side = [disc for disc in scene.of(Disc) if _same_side(float(disc.at), end, bearings)]
    return float(max(side, key=lambda disc: float(disc.mass)).at) if side else None


def _by_shapes(
    scene: Scene,
    shapes: Modes,
    bearings: np.ndarray,
    fastest: float,
    loads: tuple[float, float],
    overhung: tuple[float, float],
) -> Iterator[UnbalanceCase]:
    """Cases of the shape at each critical speed."""
    stations = np.asarray(shapes.stations)
    for k, speed in enumerate(np.imag(shapes.values).tolist()):
        deflection = _deflection(shapes, k)
        inside = (stations >= bearings[0]) & (stations <= bearings[1])
        sizes = np.abs(deflection)
        most, beyond = sizes[inside].max(), sizes[~inside].max(initial=0.0)
        within = np.flatnonzero(inside)
        if min(deflection[within].max(), -deflection[within].min()) > _BOTH * most:
            ends = sorted(float(stations[within[end]]) for end in _ends(deflection[within]))
            yield _case("quarter-span", speed, ends, list(loads), fastest)
        elif most > _LESS * beyond:
            largest = stations[inside & (sizes >= _FLAT * most)]
            top = float(largest[np.abs(largest - bearings.mean()).argmin()])
            yield _case("mid-span", speed, [top], [sum(loads)], fastest)
        if beyond > most:
            top = float(stations[sizes.argmax()])
            disc, mass = _heaviest(scene, top, bearings), _outside(top, bearings, overhung)
            yield _case("overhung", speed, [top if disc is None else disc], [mass], fastest)


def _same_side(at: float, other: float, bearings: np.ndarray) -> bool:
    """Whether two stations are outside of the same bearing."""
    low, high = bearings.tolist()
    return max(at, other) < low or min(at, other) > high


def _ends(deflection: np.ndarray) -> tuple[int, int]:
    """Indices of the largest deflections of either sign."""
    return int(deflection.argmax()), int(deflection.argmin())


def _outside(at: float, bearings: np.ndarray, overhung: tuple[float, float]) -> float:
    """Mass [kg] outside of the bearing that is nearer to a station outside of both."""
    if bearings[0] <= at <= bearings[1]:
        raise ValueError(
            f"A coupling is outside of the bearings, {bearings[0]:g} and {bearings[1]:g} m, but is at "
            f"{at:g} m; leave it out."
        )
    return overhung[0] if at < bearings[0] else overhung[1]


def _case(
    name: str, critical: float, stations: list[float], masses: list[float], fastest: float
) -> UnbalanceCase:
    moments = tuple(TWICE * residual_unbalance(abs(mass), fastest) for mass in masses)
    return UnbalanceCase(name, critical, tuple(stations), tuple(masses), moments)


def critical_modes(scene: Scene, machine: Machine, bearings: Float[np.ndarray, "2"]) -> Modes:
    """Shapes of the undamped rotor at its critical speeds, of springs as stiff as the bearings are.

    They are those up to 1.5 times the maximum continuous speed, at which the springs are read, or else
    the first one; three at most of each kind of whirl, without backward ones.
    """
    fastest = float(machine.fastest)
    rotor = sprung(scene, bearings, own_stiffness(scene, bearings, fastest))
    found = critical_speeds(rotor, MODES)
    speeds = [
        s for s, kind in zip(found.speeds.tolist(), found.kinds, strict=True) if kind != "backward"
    ]
    within = [speed for speed in speeds if abs(speed) <= HIGHEST * fastest] or speeds[:1]
    return _stacked([_mode_at(rotor, speed) for speed in within])


def _mode_at(rotor: Scene, speed: float) -> Modes:
    """The mode that whirls at a critical speed."""
    found = modes(rotor.at_speed(speed), points=_POINTS)
    return of_modes(found, [int(np.abs(np.asarray(found.values) - 1j * speed).argmin())])


def of_modes(found: Modes, chosen: Any) -> Modes:
    """Those modes of several that are at some indices."""
    own = [jnp.asarray(np.asarray(part)[chosen]) for part in _rows(found)]
    return eqx.tree_at(_rows, found, own)


def _stacked(each: list[Modes]) -> Modes:
    """Modes of several speeds as those of one, which is the first."""
    parts = [jnp.concatenate(rows) for rows in zip(*map(_rows, each), strict=True)]
    return eqx.tree_at(_rows, each[0], parts)


def _rows(found: Modes) -> list[Any]:
    """Parts of `Modes` that have one row a mode."""
    every = (found.values, found.shapes, found.counter, found.shares)
    return [part for part in every if part is not None]


def _deflection(shapes: Modes, k: int) -> np.ndarray:
    """Deflections along the direction of the largest one."""
    ahead = np.asarray(shapes.shapes[k])
    behind = 0 * ahead if shapes.counter is None else np.asarray(shapes.counter[k]).conj()
    top = (np.abs(ahead) + np.abs(behind)).argmax()
    turn = np.exp(0.5j * (np.angle(behind[top]) - np.angle(ahead[top])))  # to the major axis there
    own = ahead * turn + behind / turn
    return (own * own[top].conj()).real / abs(own[top])
