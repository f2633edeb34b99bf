"""Flexible shaft: a beam by collocation of its Green's function."""

from typing import Literal

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..blocks import Blocks
from ..materials import Material, steel
from ..quantities import Scalar, positive, real
from .collocation import SpectralLine
from .greens import CantileverKernel
from .line import AbstractLine, AbstractShaft
from .trapezoid import TrapezoidLine


class FlexibleShaft(AbstractShaft):
    """Clamped-free Euler-Bernoulli shaft with rotary inertia, round and uniform.

        z(x) + .. = - Int G(x,s) m z.. ds - Int dG/ds(x,s) (J z'.. - i Omega P z'.) ds + loads

    `m = rho A` mass, `J = rho I` diametral and `P = polar_ratio J` polar inertia per length; `G`
    the clamped-free Green's function. `rule="spectral"`: `nodes` unknowns on each span between
    stations, exponential convergence; `rule="trapezoid"`: `nodes` equal cells with displacement and
    slope at each, second order, as published. Source: Azarov, Gouskov, Panovko (2023), eqs. (6), (9).
    """

    length: Scalar = positive("length [m]")
    diameter: Scalar = positive("diameter [m]")
    material: Material = eqx.field(default_factory=steel)
    polar_ratio: Scalar = real("polar_ratio [1]", default=2.0)
    nodes: int = eqx.field(default=8, static=True)
    rule: Literal["spectral", "trapezoid"] = eqx.field(default="spectral", static=True)
    rotary_inertia: bool = eqx.field(default=True, static=True)

    def __check_init__(self):
        if self.rule not in ("spectral", "trapezoid"):
            raise ValueError(f"`rule` must be 'spectral' or 'trapezoid', but is {self.rule!r}.")
        if self.rule == "trapezoid" and not self.rotary_inertia:
            raise ValueError(
                "The trapezoidal rule has slopes for coordinates, which without `rotary_inertia` have "
                'no mass; keep it, or take rule="spectral".'
            )
        least = 2 if self.rule == "spectral" else 1
        if isinstance(self.nodes, bool) or not isinstance(self.nodes, int):
            raise ValueError(f"`nodes` must be a whole number, but is {self.nodes!r}.")
        if self.nodes < least or (self.rule == "spectral" and self.nodes > 24):
            raise ValueError(
                f"`nodes` must be {least} to 24 (any number from 1 for the trapezoidal rule), but is "
                f"{self.nodes}; more accuracy on a long shaft comes from more spans."
            )

    @property
    def rigidity(self) -> Scalar:
        """Bending stiffness `EI` [N m^2]."""
        return self.material.youngs_modulus * self._second_moment

    @property
    def mass_per_length(self) -> Scalar:
        """`rho A` [kg/m]."""
        return self.material.density * jnp.pi * self.diameter**2 / 4

    @property
    def _second_moment(self) -> Scalar:
        return jnp.pi * self.diameter**4 / 64

    def reason_against(self, at: float) -> str | None:
        length = float(self.length)
        if 0 <= at <= length * (1 + 1e-12):
            return None
        return f"is off the shaft; `at [m]` must be between 0 and the shaft's length, {length:g} m"

    def seen(self, points: int) -> Float[Array, " x"]:
        return jnp.linspace(0.0, self.length, points)

    def breaks(self, stations: tuple[float, ...]) -> tuple[int, ...]:
        if self.rule == "trapezoid":
            return ()
        # Stations this close count as one: shorter spans cost more digits than the break gains.
        shortest = 0.002 * float(self.length)
        chosen, last = [], 0.0
        for index in np.argsort(stations, kind="stable"):
            at = stations[index]
            if at - last >= shortest and float(self.length) - at >= shortest:
                chosen.append(int(index))
                last = at
        return tuple(chosen)

    def line(self, breaks: tuple[Scalar, ...]) -> AbstractLine:
        kernel = CantileverKernel(self.rigidity)
        if self.rule == "trapezoid":
            return TrapezoidLine(kernel, self.length, self.nodes)
        ends = jnp.stack([jnp.zeros_like(self.length), *breaks, self.length])
        return SpectralLine(kernel, ends, self.nodes)

    def blocks(self, line: AbstractLine) -> Blocks:
        inertia = self.mass_per_length * line.forces_along()
        gyroscopic = None
        if self.rotary_inertia:
            couples = self.material.density * self._second_moment * line.couples_along()
            inertia = inertia + couples
            gyroscopic = self.polar_ratio * couples
        return Blocks(
            inertia=inertia,
            gyroscopic=gyroscopic,
            stiffness=line.stiffness,
            weight=self.mass_per_length * line.load_along(),
        )
