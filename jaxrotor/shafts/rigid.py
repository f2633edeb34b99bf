"""Rigid shaft: on a fixed axis, tilting about a pivot, or in elastic bearings."""

from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..core.blocks import Blocks
from ..core.quantities import Scalar, as_tuple, positive
from .constraint import Constraint, Motion, motions_left
from .influence import Influence
from .line import AbstractLine, AbstractShaft, Attached, RigidLine as RigidLine, off_shaft


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

    @property
    def rigid_motions(self) -> list[Motion]:
        return motions_left(self.constraints)

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

    def attached(
        self, stations: tuple[float, ...], turned: tuple[bool, ...], resolution: tuple[int, ...]
    ) -> Attached:
        return ()

    def line(
        self,
        stations: tuple[Scalar, ...],
        spans: tuple[int, ...],
        resolution: tuple[int, ...],
        attached: Attached,
    ) -> RigidLine:
        del stations, spans, resolution
        motions = jnp.array(self.rigid_motions, float).reshape(-1, 2)
        return RigidLine(motions=motions, length=self.length)

    def blocks(self, line: AbstractLine) -> Blocks:
        return Blocks(stiffness=line.stiffness)

    def influence(self) -> Influence | None:
        return Influence.of(None, self.constraints, self.length)
