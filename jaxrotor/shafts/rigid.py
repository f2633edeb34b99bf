"""Rigid shaft: on a fixed axis, tilting about a pivot, or in elastic bearings."""

from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..core.blocks import Blocks
from ..core.quantities import Scalar, as_tuple, positive
from .constraint import Constraint
from .influence import Influence
from .line import AbstractLine, AbstractShaft, PerLength, off_shaft


class RigidLine(AbstractLine):
    """`z(x) = Sum_k q_k (a_k + b_k x)`: the rigid motions that the constraints allow."""

    motions: Float[Array, "n 2"]  # a [m] or [1] and b [1] or [1/m] of each coordinate
    length: Scalar
    anisotropy: None = None

    @property
    def breaks(self) -> Float[Array, " breaks"]:
        return jnp.stack([jnp.zeros_like(self.length), self.length])

    @property
    def stiffness(self) -> Float[Array, "n n"]:
        return jnp.zeros((len(self.motions), len(self.motions)))

    @property
    def bending_stiffness(self) -> Float[Array, "n n"]:
        return self.stiffness

    @property
    def strain_energy(self) -> Float[Array, "n n"]:
        return self.stiffness

    @property
    def bending_energy(self) -> Float[Array, "n n"]:
        return self.bending_stiffness

    def row(self, at: Scalar) -> Float[Array, " n"]:
        return self.motions @ jnp.stack([jnp.ones_like(at), at])

    def slope_row(self, at: Scalar) -> Float[Array, " n"]:
        del at
        return self.motions[:, 1]

    def column(self, at: Scalar) -> Float[Array, " n"]:
        return self.row(at)

    def couple_column(self, at: Scalar) -> Float[Array, " n"]:
        return self.slope_row(at)

    def forces_along(self, per_length: PerLength) -> Float[Array, "n n"]:
        length = self.length
        moments = jnp.array([[length, length**2 / 2], [length**2 / 2, length**3 / 3]])
        return self.motions @ (jnp.reshape(per_length, ()) * moments) @ self.motions.T

    def couples_along(self, per_length: PerLength) -> Float[Array, "n n"]:
        slopes = self.motions[:, 1]
        return jnp.reshape(per_length, ()) * self.length * jnp.outer(slopes, slopes)

    def load_along(self, per_length: PerLength) -> Float[Array, " n"]:
        along = jnp.stack([self.length, self.length**2 / 2])
        return self.motions @ (jnp.reshape(per_length, ()) * along)


class RigidShaft(AbstractShaft):
    """Straight massless axis `z(x) = z_0 + psi x`; the parts on it give it mass.

    The `constraints` determine the coordinates. Two pins or one clamp fix the axis (no coordinates), one
    pin is a pivot (tilt `psi`), and without constraints supports must hold `z_0` and `psi`.
    Sources: course project of `turbine-run-up`, Newton-Euler equations; Filimonikhin, Goncharov (2011),
    (2.1).
    """

    has_mass: ClassVar[bool] = False

    length: Scalar = positive("length [m]")
    constraints: tuple[Constraint, ...] = eqx.field(default=(), converter=as_tuple)

    def __check_init__(self):
        held = self.constraints
        if not isinstance(held, tuple) or not all(isinstance(one, Constraint) for one in held):
            raise ValueError(f"`constraints` must be a list of Constraint, but is {held!r}.")
        pins, guides = (sum(getattr(c, n) for c in held) for n in ("displacement", "slope"))
        if pins + guides > 2 or guides > 1:
            raise ValueError(
                "A rigid shaft has only two motions to hold, but `constraints` hold "
                f"{pins} displacements and {guides} slopes, so their reactions are not determined; give "
                "two pins or one clamp."
            )

    def reason_against(self, at: float) -> str | None:
        return off_shaft(self, at)

    def seen(self, points: int) -> Float[Array, " x"]:
        return jnp.linspace(0.0, self.length, points)

    @property
    def stations(self) -> tuple[Scalar, ...]:
        return tuple(one.at for one in self.constraints)

    def spans(self, stations: tuple[float, ...]) -> tuple[int, ...]:
        own = [float(at) for at in stations[: len(self.constraints)]]
        if len(own) == 2 and own[0] == own[1]:
            raise ValueError(f"Both constraints are at {own[0]:g} m; put the bearings apart.")
        return ()

    def resolution(
        self, stations: tuple[float, ...], spans: tuple[int, ...], held: int
    ) -> tuple[int, ...]:
        del stations, spans, held
        return ()

    def line(
        self, stations: tuple[Scalar, ...], spans: tuple[int, ...], resolution: tuple[int, ...]
    ) -> RigidLine:
        del stations, spans, resolution
        one, zero = jnp.ones_like(self.length), jnp.zeros_like(self.length)
        shift, tilt = jnp.stack([one, zero]), jnp.stack([zero, one])
        pins = [c.at for c in self.constraints if c.displacement]
        if len(pins) == 1:
            tilt = jnp.stack([-pins[0], one])
        motions = [] if pins else [shift]
        if len(pins) < 2 and not any(c.slope for c in self.constraints):
            motions.append(tilt)
        return RigidLine(
            motions=jnp.stack(motions) if motions else jnp.zeros((0, 2)), length=self.length
        )

    def blocks(self, line: AbstractLine) -> Blocks:
        return Blocks(stiffness=line.stiffness)

    def influence(self) -> Influence | None:
        return Influence.of(None, self.constraints, self.length)
