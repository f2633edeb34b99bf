"""Mass unbalance."""

import re
from typing import Any, ClassVar

import jax.numpy as jnp

from ..core.blocks import Blocks, Load
from ..core.quantities import Scalar, check, nonnegative, real
from ..shafts.line import AbstractLine
from .base import AbstractLoad


_GRADE = re.compile(r"\s*G?\s*(\d+\.?\d*|\.\d+)\s*")


class Unbalance(AbstractLoad):
    """Centre of mass off the axis: `F = m e (Omega^2 - i Omega.) exp(i (theta + phase))`.

    Given by `mass` m and `eccentricity` e, or by their product, `moment` U = m e, as balancing
    machines print it; `from_grade` takes a grade of balance.
    Source: Azarov, Gouskov, Panovko (2023), force (3) of eq. (1), for constant speed.
    """

    kind: ClassVar[str] = "unbalance"
    plural: ClassVar[str] = "unbalances"

    at: Scalar = nonnegative("at [m]")
    mass: Scalar = nonnegative("mass [kg]", default=None)
    eccentricity: Scalar = nonnegative("eccentricity [m]", default=None)
    phase: Scalar = real("phase [rad]", default=0.0)
    moment: Scalar = nonnegative("moment [kg m]", default=None)

    def __check_init__(self):
        product = (self.mass is not None, self.eccentricity is not None)
        if any(product) if self.moment is not None else not all(product):
            raise ValueError(
                "An unbalance is given by `mass [kg]` and `eccentricity [m]`, or by `moment [kg m]`, "
                "their product; give one of the two ways whole."
            )

    @classmethod
    def from_grade(cls, grade: Any, mass, speed, at, phase=0.0) -> "Unbalance":
        """Unbalance that a grade of balance permits, `e = G / Omega`, so `U = m G / Omega`.

        Args:
            grade: "G6.3", or G in mm/s, 6.3.
            mass: of the rotor [kg].
            speed: of service [rad/s], not zero.
            at: station [m].
            phase: [rad].

        Source: ISO 21940-11:2016, eq. (7).
        """
        if isinstance(grade, str):
            match = _GRADE.fullmatch(grade)
            if match is None:
                raise ValueError(f"`grade` must be a grade such as 'G6.3', but is {grade!r}.")
            grade = float(match[1])
        grade = check(grade, "grade [mm/s]", lambda x: x > 0, "must be positive")
        speed = check(speed, "speed [rad/s]", lambda x: x != 0, "must not be zero")
        return cls(at, mass, 1e-3 * grade / jnp.abs(speed), phase)

    def load(self, line: AbstractLine, blocks: Blocks) -> Load:
        del blocks
        moment = self.mass * self.eccentricity if self.moment is None else self.moment
        return Load(unbalance=moment * jnp.exp(1j * self.phase) * line.column(self.at))
