"""Plausibility: warnings of numbers that no machine has, mostly because of a wrong unit.

A length is compared with the length of the machine that fits its role, a mass with the mass of the rotor,
a speed with the other speeds and with what materials hold, a stiffness with the weight on it. Bounds are
close where the scale of the machine is known: for a shaft of a real material, and, ten times wider, where
masses, speeds or stiffnesses are those of a machine. A dimensionless scene, with values of order 1, gives
no warning.
"""

import dataclasses
import itertools
import math
from collections.abc import Iterator
from typing import Any, NamedTuple

from .caller import warn
from .doubt import RPM, Doubt, between, doubt, meant, times
from .machine import DENSITIES, MODULI, Found, Machine


HEAVIEST = 1e7  # [kg], five times the mass of the largest rotor of a hydro generator
FASTEST = 1e6  # [rad/s], ten times the speed of the fastest gas bearings
WIDEST = 8.0  # [m], twice the diameter of the shaft of the largest hydro generator
SLENDER = 1.5e3  # length over diameter: more than any shaft has
STRING = 1e5  # likewise of a string of drill pipes
BURST = 0.2  # speed at the surface over that of sound, sqrt(E / rho): any material bursts at less
RIM = 1.5e3  # [m/s], speed at a rim, or at a radius of gyration, which no disc survives
GRAVITY = 9.8  # [m/s^2]
SAG = 0.02  # over length: of a span of a shaft supported at both ends, under its discs
SOFT = 0.1  # stiffness of supports over that of the shaft, `48 E I / l^3`
GIVE = 0.02  # over diameter: how far supports softer than that give way under the weight
UNEQUAL = 300.0  # stiffness along one axis over that across it: more than any bearing has
GRADE = 4.0  # [m/s], distance of the centre of mass times speed: the coarsest grade of ISO 21940-11
# Polar over diametral moment of inertia: a thin disc has 2 before rounding, no body more
FLAT = 2.1
NARROW = 0.1  # radius of gyration of a disc over the diameter of the shaft: less than any has
HEAVY = 10.0  # times the mass of the rotor: larger than any unbalance
WEIGHT = 0.5  # share of the mass of the rotor below which an unbalance is a weight put on it
APART = 2.5  # factor between speeds of a machine that another unit explains
ENDS = (0.9, 3.0)  # highest speed of a table over that of the machine, where the unit explains it
LIGHT = (0.5, 30.0)  # the same in g/cm^3
SHEAR = (0.02, 1.0)  # shear modulus over Young's modulus


# Beginnings of the paths of a rotor that two supports alone hold, beside those of dampings.
_HELD_BY_TWO = ("shaft.", "spin", "disc", "unbalance", "support", "gravit")


class Role(NamedTuple):
    """Largest share that a length has of another one of the machine."""

    of: str  # "length" of the shaft, or "radius" of the same part
    close: float  # in a machine of known scale
    far: float  # in any scene
    usual: float  # up to which a unit is likely


_ACROSS = Role("length", 5.0, 20.0, 1.0)  # diameters, and radii of rims and races
ROLES = {
    "eccentricity": Role("length", 2.0, 20.0, 3e-3),
    "offset": Role("length", 0.05, 20.0, 3e-3),
    "gap": Role("length", 0.2, 20.0, 0.03),
    "blend": Role("length", 0.2, 20.0, 3e-3),
    "clearance": Role("radius", 0.2, 2.0, 0.02),
    "radius": Role("length", 2.0, 20.0, 1.0),
    "length": Role("length", 1.0, 20.0, 1.0),
    "start.radius": Role("length", 0.3, 20.0, 0.03),
}
# Of other units: in a machine of known scale, and in any scene
LARGEST = {"rad": (12.6, 12.6), "m/s^2": (300.0, 3000.0), "Pa s": (2.0, 30.0)}


class ImplausibleWarning(UserWarning):
    """A number of a scene is far outside the range of machines; its unit may be wrong."""


def warn_implausible(found: Found, part: str = "") -> None:
    """Warn of every implausible number, or of those of a part, at the line that called the package."""
    for sentence in (one for one in doubts(found) if one.startswith(f"`{part}" if part else "")):
        warn(sentence, ImplausibleWarning)


def doubts(found: Found) -> Iterator[str]:
    """A sentence on each implausible number, with the unit that may be meant.

    Args:
        found: every known parameter, in SI, by its path in the scene.

    Yields:
        Sentences, one for equal parts with the same number. A number that is doubted is no measure for
        others, and stiffness and weight are doubted only where nothing else is.
    """
    doubted: list[Doubt] = []
    for stage in (_Doubts.material, _Doubts.shaft, _Doubts.parts, _Doubts.speeds):
        paths = {one.path for one in doubted}
        machine = Machine({path: one for path, one in found.items() if path not in paths})
        doubted += stage(_Doubts(machine))
    groups: dict[Any, list[Doubt]] = {}
    for one in doubted:
        groups.setdefault(_group(one), []).append(one)
    for (kind, name, _), (one, *alike) in groups.items():
        yield str(one._replace(path=f"{kind}.{name}") if alike else one)
    if not doubted:
        yield from map(str, itertools.islice(_Doubts(Machine(found)).stiffness(), 1))


def _group(one: Doubt) -> tuple[str, str, float]:
    """Kind of part, name and value of a number."""
    return one.path.partition(".")[0], one.path.rpartition(".")[2], one.value


@dataclasses.dataclass
class _Doubts:
    """Doubts of the known numbers of a machine."""

    machine: Machine

    def material(self) -> Iterator[Doubt]:
        """Moduli and densities that are plausible in other units only."""
        for path, (density, unit, _) in self.machine.found.items():
            if unit != "kg/m^3":
                continue
            owner = path.removesuffix("density")
            modulus = self.machine.value(f"{owner}youngs_modulus")
            typed = 40 <= modulus <= 1e3 and 1.5 <= density <= 30  # both: GPa and g/cm^3
            light = between(density, LIGHT) and (between(modulus, MODULI) or typed)
            if light or (density > DENSITIES[1] and between(modulus, MODULI)):
                why = f"{'lighter' if light else 'heavier'} than what shafts are made of"
                yield doubt(path, density, unit, why, DENSITIES)
            if between(density, DENSITIES) or typed:
                likely = meant(modulus, "Pa", MODULI)
                if modulus < MODULI[0] and likely is not None:
                    yield Doubt(
                        f"{owner}youngs_modulus", modulus, "Pa", "softer than any shaft", *likely
                    )
            shear = self.machine.value(f"{owner}shear_modulus")
            bounds = (SHEAR[0] * modulus, SHEAR[1] * modulus)
            if shear < bounds[0] and between(modulus, MODULI) and meant(shear, "Pa", bounds):
                why = f"{times(modulus / shear)} below Young's modulus"
                yield doubt(f"{owner}shear_modulus", shear, "Pa", why, bounds)

    def shaft(self) -> Iterator[Doubt]:
        """Diameters too large for the length of the shaft, and a shaft too long for its diameter."""
        machine = self.machine
        wide = list(self._beyond(shaft=True))
        yield from wide
        most = STRING if machine.drills else SLENDER
        if not wide and most * machine.diameter < machine.length < math.inf:
            why = f"{times(machine.length / machine.diameter)} its diameter, {machine.diameter:g} m"
            yield doubt("shaft.length", machine.length, "m", why, (0.0, 300 * machine.diameter))

    def parts(self) -> Iterator[Doubt]:
        """Numbers of the parts on the shaft."""
        lengths = [*self._beyond()]
        yield from lengths
        paths = {one.path for one in lengths}
        yield from (one for one in self._unbalances() if one.path not in paths)
        yield from self._others()

    def _beyond(self, shaft: bool = False) -> Iterator[Doubt]:
        """Lengths of the shaft, or of parts, too large for the length that fits their role."""
        for path, (value, unit, _) in self.machine.found.items():
            owner, _, name = path.rpartition(".")
            if unit != "m" or name in ("at", "start") or path == "shaft.length":
                continue
            if path.endswith(".body.length"):  # a further shaft, which may be the longer one
                continue
            if path.startswith("shaft.") != shaft:
                continue
            kind = "eccentricity" if path.startswith("disc") and name == "offset" else name
            role = ROLES.get(path, ROLES.get(kind, _ACROSS))
            measures = [(self.machine.value(f"{owner}.radius"), "its radius", role.close, role.far)]
            if role.of == "length":
                measures = [(self.machine.length, "the length of the shaft", role.close, role.far)]
            if name == "gap" and (rim := self.machine.value(f"{owner}.rim_radius")):
                measures.append((rim, "the radius of the rim", 0.5, math.inf))
            for measure, of, close, far in measures:
                if abs(value) > min(far, self.machine.slack * close) * measure:
                    why = f"{times(abs(value) / measure)} {of}, {measure:g} m"
                    yield doubt(path, value, "m", why, (0.0, role.usual * measure))
                    break
            else:
                if shaft and self.machine.real and value > WIDEST:
                    yield doubt(path, value, "m", "wider than any shaft", (0.0, WIDEST))

    def _unbalances(self) -> Iterator[Doubt]:
        """Centres of mass too far from the axis, and unbalances heavier than the rotor."""
        machine = self.machine
        offsets = (
            (path, one.value, machine.mass, "m") for path, one in machine.of("disc", "offset")
        )
        moments = list(offsets)
        for path, (moment, unit, _) in machine.of("unbalance", "moment"):
            moments.append((path, moment, 1.0, unit))
        for path, (distance, unit, _) in machine.of("unbalance", "eccentricity"):
            mass = machine.value(place := f"{path.rpartition('.')[0]}.mass")
            if math.isfinite(machine.slack) and 0 < HEAVY * machine.mass < mass:
                why = f"{times(mass / machine.mass)} the mass of the rotor, {machine.mass:.3g} kg"
                yield doubt(place, mass, "kg", why, (0.0, machine.mass))
            else:
                moments.append((path, distance, mass, unit))
        for path, value, mass, unit in moments:
            if not machine.mass:
                continue
            share = min(mass / machine.mass, 1.0) if unit == "m" else 1 / machine.mass
            placed = 5.0 if unit == "m" and share < WEIGHT else 1.0  # a weight at a radius
            centre, slack = share * value, machine.slack * placed
            distance = value if unit == "m" else value / (machine.discs or machine.mass)
            if machine.eccentric(centre, distance):
                continue
            over = f"by which the centre of mass is {centre:.3g} m off the axis, "
            if centre > slack * 0.04 * machine.length:
                over += f"{times(centre / machine.length)} the length of the shaft, {machine.length:g} m"
            elif centre > slack * 0.1 * machine.diameter:
                ratio = times(centre / machine.diameter)
                over += f"{ratio} the diameter of the shaft, {machine.diameter:g} m"
            elif machine.real and centre * (speed := machine.speed) > placed * GRADE:
                if math.isinf(speed):
                    continue
                over += f"of grade G{1e3 * centre * abs(speed):.0f} at {speed:g} rad/s"
            else:
                continue
            usual = ROLES["eccentricity"].usual * machine.length / share
            yield doubt(path, value, unit, over, (0.0, usual))

    def _others(self) -> Iterator[Doubt]:
        """Masses, moments of inertia, angles, viscosities and accelerations that are too large."""
        for path, (value, unit, _) in self.machine.found.items():
            owner, _, name = path.rpartition(".")
            if unit == "kg" and value > HEAVIEST:
                yield doubt(path, value, unit, "heavier than any rotor", (0.0, HEAVIEST))
            elif (
                name == "ball_mass"
                and self.machine.slack < math.inf
                and 0 < self.machine.mass < value
            ):
                why = f"heavier than the rotor, {self.machine.mass:.3g} kg"
                yield doubt(path, value, unit, why, (0.0, self.machine.mass))
            elif unit == "kg m^2" and 0 < (mass := self.machine.value(f"{owner}.mass")) < math.inf:
                radius = math.sqrt(abs(value) / mass)
                flat = abs(value) / (self.machine.value(f"{owner}.diametral") or math.inf)
                if (
                    radius > min(20.0, self.machine.slack * 5.0) * self.machine.length
                    or flat > FLAT
                ):
                    why = f"with which the radius of gyration is {radius:.3g} m"
                    if flat > FLAT:
                        why = (
                            f"{times(flat)} `{owner}.diametral`, where no body has more than twice"
                        )
                    usual = min(mass * self.machine.length**2, FLAT * abs(value) / (flat or 1.0))
                    yield doubt(path, value, unit, why, (0.0, usual))
                elif (
                    self.machine.real
                    and name == "polar"
                    and 0 < radius < NARROW * self.machine.diameter < math.inf
                ):
                    why = f"with which the radius of gyration of `{path}` is {radius:.3g} m"
                    yield doubt(f"{owner}.mass", mass, "kg", why, (0.0, math.inf))
            elif abs(value) > LARGEST.get(unit, (math.inf,) * 2)[math.isinf(self.machine.slack)]:
                yield doubt(path, value, unit, "more than in any machine", (0.0, math.inf))

    def speeds(self) -> Iterator[Doubt]:
        """Speeds that no rotor or no material reaches, or that another unit brings to a table's."""
        for path, one in self.machine.found.items():
            if one.unit == "rad/s" and abs(one.value) > FASTEST:
                yield doubt(path, one.value, "rad/s", "faster than any rotor", (0.0, FASTEST))
                return
        for path in ("spin.speed", "spin.speeds"):
            speed = self.machine.value(path)
            for radius, of, most in self._radii():
                if FASTEST >= abs(speed) > most / radius:
                    why = f"{abs(speed) * radius:.3g} m/s at {of}"
                    yield doubt(path, speed, "rad/s", why, (0.0, FASTEST))
                    return
        yield from itertools.islice(self._apart(), 1)

    def _radii(self) -> Iterator[tuple[float, str, float]]:
        """Radii [m] of what turns, with the speed there [m/s] that no material survives."""
        if self.machine.real and math.isfinite(self.machine.diameter):
            most = BURST * math.sqrt(self.machine.modulus / self.machine.density)
            yield self.machine.diameter / 2, "the surface of the shaft", most
        if math.isinf(self.machine.slack):
            return
        for path, one in self.machine.found.items():
            owner, _, name = path.rpartition(".")
            mass = self.machine.value(f"{owner}.mass")
            if name == "rim_radius" and one.value:
                yield one.value, "the rim", RIM
            elif path.startswith("disc") and name == "polar" and 0 < mass < math.inf and one.value:
                yield math.sqrt(abs(one.value) / mass), "the radius of gyration of a disc", RIM

    def _apart(self) -> Iterator[Doubt]:
        """Speeds apart from those of a table, by the factor between rad/s and rpm."""
        drive = "spin.torque" in self.machine.found  # whose `speed` is that of the start
        ranges = {
            path: (abs(one.least), abs(one.value))
            for path, one in self.machine.found.items()
            if path.rpartition(".")[2] in ("speed", "speeds", "table_speeds")
            and not (drive and path == "spin.speed")
            and not path.startswith("coaxial_shaft")  # which has a speed of its own
        }
        for (path, one), (other, table) in itertools.permutations(ranges.items(), 2):
            if not path.startswith("spin.") or not one[1]:
                continue
            of = f"the {table[0]:g} to {table[1]:g} rad/s of `{other}`"
            if one[1] > APART * table[1] and RPM * one[1] <= table[1]:
                yield doubt(path, one[1], "rad/s", f"above {of}", (0.0, math.inf))
            elif APART * one[1] < table[0] <= one[1] / RPM or between(
                RPM * table[1] / one[1], ENDS
            ):
                why = f"{times(table[1] / one[1])} the largest of `{path}`, {one[1]:g} rad/s"
                yield doubt(other, table[1], "rad/s", why, (0.0, math.inf))

    def stiffness(self) -> Iterator[Doubt | str]:
        """Shafts, discs and supports that the weight bends or moves too far.

        The sag of a shaft supported at both ends is `m g l^3 / (48 E I)`, and less by `n^3` where what
        holds it cuts it into n spans; that of all supports is `m g / k`.
        """
        weight, length = GRAVITY * self.machine.mass, self.machine.length
        bent = (
            48 * self.machine.modulus * math.pi * self.machine.diameter**4 / 64 / length**3
        )  # [N/m]
        discs = dict(self.machine.of("disc", "mass"))
        holds = (
            path for path in self.machine.found if path.startswith(("support", "shaft.constraint"))
        )
        stations = {self.machine.value(path) for path in holds if path.endswith(".at")}
        spans = max(1, len(stations) - 1)
        hangs = self.machine.drills  # along its length
        if (
            not hangs
            and self.machine.real
            and GRAVITY * self.machine.discs > SAG * length * spans**3 * bent
        ):
            path = max(discs, key=lambda path: discs[path].value)
            sag = GRAVITY * self.machine.discs / (bent * length * spans**3)
            why = f"under which the shaft would sag by {100 * sag:.3g} % of its length"
            yield doubt(path, discs[path].value, "kg", why, (0.0, math.inf))
        k11 = self.machine.value("shaft.k11")
        if math.isfinite(self.machine.slack) and 1.0 < k11 < weight / (0.1 * length):
            why = f"by which the shaft would sag by {weight / k11:.3g} m"
            yield doubt("shaft.k11", k11, "N/m", why, (100 * weight / length, math.inf))
        supports: dict[str, float] = {}
        for path, (value, unit, _) in self.machine.found.items():
            owner, _, name = path.rpartition(".")
            if unit == "N/m" and path.startswith("support") and name in ("stiffness", "kxx", "kyy"):
                supports[owner] = max(abs(value), supports.get(owner, 0.0))
                other = abs(self.machine.value(f"{owner}.{'kyy' if name == 'kxx' else 'kxx'}"))
                if 1.0 < UNEQUAL * abs(value) < other < math.inf and math.isfinite(
                    self.machine.slack
                ):
                    why = f"{times(other / abs(value))} less than across it"
                    yield doubt(path, value, "N/m", why, (other / UNEQUAL, UNEQUAL * other))
        together = sum(supports.values())
        if together and not any(".constraints." in path for path in self.machine.found):
            least = weight / (length if self.machine.real else self.machine.slack * 0.02 * length)
            if self.machine.hung:
                least = weight / length
            elif self.machine.real:
                least = max(least, min(SOFT * bent, weight / (GIVE * self.machine.diameter)))
            if together < least:
                yield (
                    f"The supports, {together:g} N/m together, would give way by "
                    f"{weight / together:.3g} m under the weight of the rotor, {weight:.3g} N; check "
                    f"their unit (1 N/mm is 1000 N/m, 1 N/um is 1e6 N/m), and that of the masses."
                )
        yield from self._softer_of_two(supports, SOFT * bent)

    def _softer_of_two(self, supports: dict[str, float], least: float) -> Iterator[Doubt]:
        """The softer of two supports that alone hold a shaft, if its part of the weight moves it far.

        Its part is `Sum m g (x - x_other) / (x_own - x_other)`. Seals are soft beside bearings, so a third
        support is as it is.
        """
        machine = self.machine
        plain = all(path.startswith(_HELD_BY_TWO) or "damping" in path for path in machine.found)
        held = any(".constraints." in path or "angular" in path for path in machine.found)
        if not machine.real or not plain or held or machine.drills or len(supports) != 2:
            return
        (own, soft), (other, firm) = sorted(supports.items(), key=lambda one: one[1])
        here, there = (machine.value(f"{owner}.at") for owner in (own, other))
        if here == there or not 1.0 < UNEQUAL * soft < firm:
            return
        moment = (machine.mass - machine.discs) * (machine.length / 2 - there)
        for path, one in machine.of("disc", "mass"):
            moment += one.value * (machine.value(f"{path.removesuffix('mass')}at") - there)
        weight = GRAVITY * abs(moment / (here - there))
        if soft < min(least, weight / (GIVE * machine.diameter)):
            path = next(f"{own}.{k}" for k in ("kxx", "stiffness") if f"{own}.{k}" in machine.found)
            why = (
                f"by which it would give way by {weight / soft:.3g} m under its part of the weight, "
                f"{weight:.3g} N"
            )
            yield doubt(path, soft, "N/m", why, (firm / UNEQUAL, UNEQUAL * firm))
