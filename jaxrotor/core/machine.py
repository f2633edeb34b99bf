"""Measures of a machine, from the numbers of its scene that are known."""

import dataclasses
import functools
import math
from collections.abc import Iterable, Iterator, Mapping

from .doubt import Known, between


MODULI = (1e9, 2e12)  # [Pa], range of materials for shafts
DENSITIES = (500.0, 3e4)  # [kg/m^3], range of materials for shafts
DRILLING = (30.0, 0.4)  # [rad/s], [m]: largest speed and diameter of a string of drill pipes
SWINGS = (9.0, 28.0)  # [rad/s], range of frequencies of what hangs on springs
SLOW = 200.0  # [rad/s], largest speed of exciters and of drums
DRUMS = 45.0  # [rad/s], largest frequency of a drum on springs
HUNG = (3e3, 40.0)  # [kg]: largest mass of what hangs so, and length over diameter of its shaft
ON_PURPOSE = 12.0  # [m/s], largest distance of their centre of mass times speed
ECCENTRIC = (0.35, 2.0)  # distance of an eccentric mass over the radius of gyration of its disc
FAR = 0.3  # distance of the centre of mass over the length of the shaft: more than any has


Found = Mapping[str, Known]  # each known parameter by its path


@dataclasses.dataclass
class Machine:
    """Length, masses, speed and kind of a machine, infinite where they are not known."""

    found: Found

    @functools.cached_property
    def length(self) -> float:
        """Length of the shaft [m]."""
        return self.value("shaft.length")

    @functools.cached_property
    def diameter(self) -> float:
        """The largest of the sections of the shaft [m], infinite if none is known."""
        own = [
            one.value
            for path, one in self.found.items()
            if path.startswith("shaft.") and path.endswith(".diameter")
        ]
        return max(own, default=math.inf)

    @functools.cached_property
    def real(self) -> bool:
        """Whether the shaft is of a material that exists."""
        return between(self.modulus, MODULI) and between(self.density, DENSITIES)

    @functools.cached_property
    def slack(self) -> float:
        """Factor of close bounds: infinite in a scene that may be dimensionless."""
        if self.real:
            return 1.0
        if "shaft.material.density" in self.found:
            return math.inf
        held = (one for path, one in self.found.items() if path.startswith(("shaft", "support")))
        known = self.discs >= 20.0 or largest(self.found.values(), "rad/s") >= 100.0
        return 10.0 if known or largest(held, "N/m") >= 1e5 else math.inf

    @functools.cached_property
    def mass(self) -> float:
        """Mass of the discs and of the shaft, its largest section taken all along [kg]."""
        shaft = self.density * math.pi * self.diameter**2 / 4 * self.length
        return self.discs + (shaft if math.isfinite(shaft) else 0.0)

    @property
    def discs(self) -> float:
        """Mass of the discs [kg]."""
        return sum((one.value for _, one in self.of("disc", "mass")), 0.0)

    @property
    def modulus(self) -> float:
        """Young's modulus of the shaft [Pa]."""
        return self.value("shaft.material.youngs_modulus")

    @property
    def density(self) -> float:
        """Density of the shaft [kg/m^3]."""
        return self.value("shaft.material.density")

    def value(self, path: str) -> float:
        """A number by its path, infinite if it is not known."""
        return self.found[path].value if path in self.found else math.inf

    def of(self, kind: str, name: str) -> Iterator[tuple[str, Known]]:
        """Path and number of a name in every part of a kind."""
        for path, one in self.found.items():
            if path.partition(".")[0] in (kind, f"{kind}s") and path.rpartition(".")[2] == name:
                yield path, one

    @property
    def speed(self) -> float:
        """Speed [rad/s], of a profile its largest one."""
        speed = self.value("spin.speed")
        return abs(self.value("spin.speeds") if math.isinf(speed) else speed)

    @property
    def drills(self) -> bool:
        """Whether the shaft may be a string of drill pipes: hollow, thin, and slowly turning."""
        hollow = 0 < self.value("shaft.inner_diameter") < math.inf
        return hollow and 0 < self.speed <= DRILLING[0] and self.diameter <= DRILLING[1]

    @functools.cached_property
    def hung(self) -> bool:
        """Whether the rotor, with its casings if there are any, hangs on springs of low frequency.

        With damping above the critical one their stiffness is in doubt.
        """
        casings = sum(one.value for _, one in self.of("casing", "mass"))
        grounded = lambda path: not (casings and f"{path.rpartition('.')[0]}.at" in self.found)
        total = lambda *names: sum(
            abs(one.value)
            for name in names
            for path, one in self.of("support", name)
            if grounded(path)
        )
        stiffness, mass = total("stiffness", "kxx"), self.mass + casings
        if math.isinf(self.slack) or mass > HUNG[0] or self.length > HUNG[1] * self.diameter:
            return False
        lowest, highest = SWINGS[0], DRUMS if self.speed <= SLOW else SWINGS[1]
        damping = total("damping", "cxx")
        return (
            lowest**2 * mass <= stiffness <= highest**2 * mass
            and damping**2 <= 4 * stiffness * mass
        )

    def eccentric(self, centre: float, distance: float) -> bool:
        """Whether a large unbalance is meant: that of an exciter, or of a drum that hangs on springs.

        Args:
            centre: distance of the centre of mass of the rotor from the axis [m].
            distance: distance of the eccentric mass from the axis [m].
        """
        if centre * self.speed > ON_PURPOSE or centre > FAR * self.length:
            return False
        if self.hung or self.speed > SLOW:
            return self.hung
        sizes = []
        for path, one in self.of("disc", "mass"):
            polar = self.value(f"{path.removesuffix('mass')}polar")
            if one.value and polar and math.isfinite(polar):
                sizes.append(math.sqrt(abs(polar) / one.value))
        return any(between(distance / size, ECCENTRIC) for size in sizes)


def largest(numbers: Iterable[Known], unit: str) -> float:
    """The largest magnitude of the numbers in a unit, 0 if there is none."""
    return max((abs(one.value) for one in numbers if one.unit == unit), default=0.0)
