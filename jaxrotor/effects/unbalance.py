"""Mass unbalance of a rotor."""

import re
from typing import Any, ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Complex

from ..core.quantities import Scalar, check, nonnegative, real, with_values
from .base import AbstractUnbalance


_GRADE = re.compile(r"\s*G?\s*(\d+\.?\d*|\.\d+)\s*")


class Unbalance(AbstractUnbalance):
    """Centre of mass off the axis: `F = m e (Omega^2 - i Omega.) exp(i (theta + phase))`.

    It is given by `mass` m and `eccentricity` e, or by their product, the `moment` U = m e that balancing
    machines show. `from_grade` computes it from a balance quality grade.

    `since` is the time [s] at which it appears in a motion, as by a lost blade. The run is joined of runs
    up to then and on from there, so that the jump is exact by any solver. What is steady, such as a
    response or an orbit, has it always.
    Source: Azarov, Gouskov, Panovko (2023), force (3) of eq. (1), for constant speed.
    """

    kind: ClassVar[str] = "unbalance"
    plural: ClassVar[str] = "unbalances"

    at: Scalar = nonnegative("at [m]")
    mass: Scalar = nonnegative("mass [kg]", default=None)
    eccentricity: Scalar = nonnegative("eccentricity [m]", default=None)
    phase: Scalar = real("phase [rad]", default=0.0)
    moment: Scalar = nonnegative("moment [kg m]", default=None)
    since: Scalar = nonnegative("since [s]", default=None)

    def __check_init__(self):
        product = (self.mass is not None, self.eccentricity is not None)
        if any(product) if self.moment is not None else not all(product):
            raise ValueError(
                "An unbalance needs either `mass [kg]` and `eccentricity [m]`, or their product, the "
                "`moment [kg m]`; give one of the two."
            )

    @property
    def turns_section(self) -> bool:
        return type(self) is not Unbalance

    @classmethod
    def from_grade(cls, grade: Any, mass, speed, at, phase=0.0) -> "Unbalance":
        """Unbalance that a balance quality grade permits, `e = G / Omega`, so `U = m G / Omega`.

        Args:
            grade: the grade, "G6.3", or its G [mm/s], 6.3.
            mass: mass of the rotor [kg].
            speed: service speed [rad/s], not zero.
            at: station [m].
            phase: phase of the unbalance [rad].

        Raises:
            ValueError: If `grade` is not a grade or not positive, or `speed` is zero.

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

    def by(self, time: float) -> "Unbalance":
        if self.since is None:
            return self
        amount = "mass" if self.moment is None else "moment"
        gone = {} if float(self.since) <= time else {amount: jnp.zeros(())}
        return with_values(self, since=None, **gone)

    @property
    def amount(self) -> Complex[Array, ""]:
        moment = self.mass * self.eccentricity if self.moment is None else self.moment
        return moment * jnp.exp(1j * self.phase)
