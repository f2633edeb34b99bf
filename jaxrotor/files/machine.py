"""Machine around a rotor: running range, probes, close clearances and stages, as a standard asks for."""

import os
import tomllib
from typing import Literal

import equinox as eqx
import numpy as np

from ..core.quantities import Scalar, Series, as_tuple, nonnegative, positive, series
from ..core.representation import AbstractPart
from ..core.tables import RPM
from .shipped import text_of
from .toml_reader import built
from .units import refuse


COEFFICIENTS = {"centrifugal": 3.0, "axial": 1.5}  # B of Wachel's and of Alford's formula
KINDS = tuple(COEFFICIENTS)
TABLE = "machine"  # of a scene file


class Probe(AbstractPart):
    """Probe of displacement; its reading is taken as the major axis of the orbit at its station."""

    at: Scalar = nonnegative("at [m]")
    name: str = eqx.field(default="", static=True)

    @property
    def label(self) -> str:
        """Its name, by default with its station."""
        return self.name or f"probe at {float(self.at):.4g} m"


class Clearance(AbstractPart):
    """Close clearance, as of a seal: the smallest running clearance on the diameter."""

    at: Scalar = nonnegative("at [m]")
    diametral: Scalar = positive("diametral [m]")
    name: str = eqx.field(default="", static=True)

    @property
    def label(self) -> str:
        """Its name, by default with its station."""
        return self.name or f"clearance at {float(self.at):.4g} m"


class Stage(AbstractPart):
    """Impeller or blade row whose flow drives forward whirl: `q = B P R / (D H N)`.

    `P / N`, with `N` in rad/s, is its torque, `D` the diameter of the impeller or the pitch diameter of
    the blades, `H` the smallest width of diffuser or impeller exit or the effective height of the blades.
    A centrifugal stage has `B = 3` and `R`, the density at its discharge over that at its suction. An
    axial one has `B = 1.5` and no `R`. Without `at` it acts at the middle of the bearing span.
    Source: API RP 684 (2005), SP6.8.5.6, where `C = 9.55` turns rpm into rad/s; Wachel, von Nimitz (1981);
    Alford (1965).
    """

    power: Scalar = nonnegative("power [W]")
    diameter: Scalar = positive("diameter [m]")
    width: Scalar = positive("width [m]")
    density_ratio: Scalar = positive("density_ratio [1]", default=None)
    kind: Literal["centrifugal", "axial"] = eqx.field(default="centrifugal", static=True)
    at: Scalar = nonnegative("at [m]", default=None)
    name: str = eqx.field(default="", static=True)

    def __check_init__(self):
        if self.kind not in KINDS:
            raise ValueError(f"`kind` must be one of {KINDS}, but is {self.kind!r}.")
        if (self.kind == "centrifugal") == (self.density_ratio is None):
            raise ValueError(
                "A centrifugal stage needs `density_ratio [1]`, the density at its discharge over that at "
                "its suction; an axial one has none."
            )

    @property
    def label(self) -> str:
        """Its name, by default its kind."""
        return self.name or f"{self.kind} stage"

    def cross_coupling(self, speed: float | int) -> float:
        """Anticipated cross-coupled stiffness q [N/m] at a speed [rad/s]."""
        ratio = 1.0 if self.density_ratio is None else float(self.density_ratio)
        torque = float(self.power) / abs(float(speed))
        return COEFFICIENTS[self.kind] * torque * ratio / float(self.diameter * self.width)


class Machine(AbstractPart):
    """Data of a machine that are not of its rotor: speeds, bearings, probes, clearances, stages.

    Speeds are magnitudes. `slowest` and `fastest` are the minimum operating and the maximum continuous
    speed, `trip` is by default 5 % above. `rated` is by default `fastest`; the power of a stage is that
    at this speed. `bearings` are the stations of the two journal bearings, by default those of the scene,
    where it has two. `couplings` are stations of half couplings, each outside of the bearings.
    `gas_density` is the mean of suction and discharge. `name` is in the title of a report.
    """

    slowest: Scalar = positive("slowest [rad/s]")
    fastest: Scalar = positive("fastest [rad/s]")
    trip: Scalar = positive("trip [rad/s]", default=None)
    rated: Scalar = positive("rated [rad/s]", default=None)
    bearings: Series = series("bearings [m]", ascending=True, nonnegative=True, default=None)
    probes: tuple[Probe, ...] = eqx.field(default=(), converter=as_tuple)
    clearances: tuple[Clearance, ...] = eqx.field(default=(), converter=as_tuple)
    stages: tuple[Stage, ...] = eqx.field(default=(), converter=as_tuple)
    couplings: Series = series("couplings [m]", nonnegative=True, least=1, default=None)
    gas_density: Scalar = nonnegative("gas_density [kg/m^3]", default=None)
    name: str = eqx.field(default="", static=True)

    def __check_init__(self):
        for name, kind in (("probes", Probe), ("clearances", Clearance), ("stages", Stage)):
            members = getattr(self, name)
            if not isinstance(members, tuple) or not all(isinstance(m, kind) for m in members):
                raise ValueError(f"`{name}` must be a list of {kind.__name__}, but is {members!r}.")
        if not self.slowest <= self.fastest <= self.highest:
            speeds = (float(self.slowest), float(self.fastest), self.highest)
            raise ValueError(
                "`slowest`, `fastest` and `trip [rad/s]` must be in this order, but are "
                f"{', '.join(f'{RPM * one:.5g}' for one in speeds)} rpm; a number without a unit is in "
                'rad/s, so write "7000 rpm" where that is meant.'
            )
        if not self.slowest <= self.rated_speed <= self.fastest:
            raise ValueError(
                "`rated [rad/s]` must be from `slowest` to `fastest`, but is "
                f"{RPM * self.rated_speed:.5g} rpm; give the speed of the rated power."
            )
        if self.bearings is not None and np.size(self.bearings) != 2:
            raise ValueError(
                f"`bearings [m]` must be the stations of two bearings, but has {np.size(self.bearings)}."
            )

    @property
    def highest(self) -> float:
        """Trip speed [rad/s]."""
        return float(1.05 * self.fastest if self.trip is None else self.trip)

    @property
    def rated_speed(self) -> float:
        """Speed of the rated power [rad/s]."""
        return float(self.fastest if self.rated is None else self.rated)

    @property
    def cross_couplings(self) -> list[float]:
        """Anticipated cross-coupled stiffness of each stage [N/m], at the rated speed."""
        return [stage.cross_coupling(self.rated_speed) for stage in self.stages]

    @property
    def anticipated(self) -> float:
        """Sum Q_A of `cross_couplings` [N/m]."""
        return sum(self.cross_couplings, start=0.0)


def machine(name_or_path: str | os.PathLike[str]) -> Machine:
    """The `[machine]` table of a scene file, with its probes, clearances and stages.

    Args:
        name_or_path: path of a file, or name of a shipped scene.

    Returns:
        `Machine`.

    Raises:
        SceneError: the file cannot be read, has no such table, or this is no machine.
    """
    text, source = text_of(name_or_path)
    try:
        document = tomllib.loads(text)
    except ValueError as error:
        refuse(source, f"is not valid TOML: {error}.")
    if TABLE not in document:
        refuse(
            source,
            "has no [machine]; a lateral analysis needs its slowest and fastest speed and its probes, see "
            "docs/scene-files.md.",
        )
    return built(Machine, document[TABLE], f"{source}: {TABLE}", "machine")
