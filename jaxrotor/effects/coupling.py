"""Couplings of the shaft to a second line that is beside its axis."""

from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Complex

from ..core.blocks import Blocks, Load
from ..core.quantities import Scalar, known, nonnegative, number_or_nan, positive, real, with_values
from ..shafts.cased import column_of, ends, slope_ends
from ..shafts.line import AbstractLine
from .base import AbstractLinear, AbstractLoad


class Coupling(AbstractLinear, AbstractLoad):
    """Flexible coupling to a line that is `offset` in a direction fixed in space.

        F = k u + k anisotropy exp(2 i psi) u*,   psi = theta + angle
        T = -k anisotropy Im(exp(-2 i psi) u^2),   u = d + z_2 - z,   d = offset exp(i direction)

    F acts on the shaft at `at`, -F on the second line: its place `z_2` is that of the `Casing` of the name
    `on`, or 0 where that is None, of a line that is held. T is the torque on the shaft. The stiffness is
    `k (1 + anisotropy)` along the axis at `angle` from that of theta = 0, `k (1 - anisotropy)` across it.
    Moments by slopes are likewise, with `angular_stiffness` in place of k, for lines that are `tilt` out
    of parallel, in the direction `tilt_direction`; a casing does not tilt.

    So the misaligned rotor moves as `z_0 + z_2 exp(2 i theta)`, exactly: `jaxrotor.weight_response` has
    both. A coupling that is known to be the same along every axis has a steady force alone, and so no 2X.
    Where axes of bearings are unequal, too, integrate in time.
    Source: Lagrange's equations of the potential `k (|u|^2 + anisotropy Re(exp(-2 i psi) u^2)) / 2`.
    """

    kind: ClassVar[str] = "coupling"
    plural: ClassVar[str] = "couplings"
    by_speed: ClassVar[bool] = True
    holds_shaft: ClassVar[bool] = True

    at: Scalar = nonnegative("at [m]")
    stiffness: Scalar = nonnegative("stiffness [N/m]")  # k, the mean along all axes
    anisotropy: Scalar = real("anisotropy [1]", default=0.0)
    angle: Scalar = real("angle [rad]", default=0.0)  # of the stiffer axis at theta = 0
    offset: Scalar = nonnegative("offset [m]", default=0.0)  # of the second line
    direction: Scalar = real("direction [rad]", default=0.0)  # of the offset, from x to y
    angular_stiffness: Scalar | None = nonnegative("angular_stiffness [N m/rad]", default=None)
    tilt: Scalar = nonnegative("tilt [rad]", default=0.0)  # slope of the second line
    tilt_direction: Scalar = real("tilt_direction [rad]", default=0.0)
    on: str | None = eqx.field(default=None, static=True)  # name of a casing; None: a held line
    isotropic: bool = eqx.field(init=False, static=True)  # known to be so

    def __post_init__(self):
        super().__post_init__()
        self.isotropic = number_or_nan(self.anisotropy) == 0

    def __check_init__(self):
        if known(self.anisotropy) and abs(float(self.anisotropy)) > 1:
            raise ValueError(
                "`anisotropy [1]` of a coupling must be between -1 and 1, since its stiffness would be "
                f"negative along one axis, but is {float(self.anisotropy):g}."
            )
        if self.angular_stiffness is None and known(self.tilt) and float(self.tilt):
            raise ValueError(
                f"`tilt [rad]` of a coupling is {float(self.tilt):g}, but without `angular_stiffness "
                "[N m/rad]` it has no moment; give that too, or leave the tilt out."
            )

    def refreshed(self) -> "Coupling":
        """Copy whose flag `isotropic` is derived from its current values."""
        return with_values(self, isotropic=number_or_nan(self.anisotropy) == 0)

    @property
    def turns_section(self) -> bool:
        return self.angular_stiffness is not None

    @property
    def _unequal(self) -> Complex[Array, ""]:
        """Share of the stiffness that turns with the shaft."""
        return self.anisotropy * jnp.exp(2j * self.angle)

    def _springs(self, line: AbstractLine) -> list[tuple[Array, Array, Scalar, Array]]:
        """Row, column, stiffness and misalignment, of displacements and, if it holds them, of slopes."""
        out = self.offset * jnp.exp(1j * self.direction)
        found = [(*ends(line, self.at, self.on), self.stiffness, out)]
        if self.angular_stiffness is not None:
            slope = slope_ends(line, self.at, self.on)
            out = self.tilt * jnp.exp(1j * self.tilt_direction)
            found.append((*slope, self.angular_stiffness, out))
        return found

    def blocks(self, line: AbstractLine) -> Blocks:
        found = Blocks()
        for row, column, k, _ in self._springs(line):
            spring = k * jnp.outer(column, row)
            unequal = None if self.isotropic else self._unequal * spring
            found = found + Blocks(stiffness=spring, rotating_stiffness=unequal)
        return found

    def load(self, line: AbstractLine, blocks: Blocks) -> Load:
        del blocks
        found = Load()
        for _, column, k, d in self._springs(line):
            found = found + Load(constant=k * d * column)
            if not self.isotropic:
                turning = k * self._unequal * d.conj()
                found = found + Load(twice=turning * column, twist=turning * d.conj())
        return found


class OldhamCoupling(AbstractLinear, AbstractLoad):
    """Floating disc between two hubs that are `offset` in a direction fixed in space.

        c = (d + d* exp(2 i psi)) / 2,   psi = theta + angle,   d = offset exp(i direction)
        F = m (Omega^2 - i Omega. / 2) d* exp(2 i psi) -+ m (Omega^2 + i Omega. / 2) d

    The disc, of `mass` m, slides in a slot of the hub on the shaft, at psi, and in one across it of the
    other hub. So its centre c, here from the shaft, goes round twice a revolution. F acts on the hub at
    `at` with the upper sign, on the other one, `on` a `Casing` or held, with the lower one; of the weight
    W of the disc they carry `(W -+ W* exp(2 i psi)) / 2`. It holds no hub.

    The motion of the hubs is small beside the `offset`, so the disc's inertia against it is left out. A
    rotation that the rotor holds back is refused.
    Source: Lagrange's equations of a disc in two slots at right angles.
    """

    kind: ClassVar[str] = "oldham_coupling"
    plural: ClassVar[str] = "oldham_couplings"
    by_speed: ClassVar[bool] = True

    at: Scalar = nonnegative("at [m]")
    mass: Scalar = nonnegative("mass [kg]")  # of the floating disc
    offset: Scalar = positive("offset [m]")  # of the second line
    direction: Scalar = real("direction [rad]", default=0.0)  # of the offset, from x to y
    angle: Scalar = real("angle [rad]", default=0.0)  # of the slot of the shaft's hub at theta = 0
    on: str | None = eqx.field(default=None, static=True)  # name of a casing; None: a held line

    @property
    def turns_section(self) -> bool:
        return False

    def _sum_and_difference(self, line: AbstractLine) -> tuple[Array, Array]:
        """Terms of a force on both hubs, and of one on the other hub less one on the shaft's."""
        own = line.column(self.at)
        other = 0.0 * own if self.on is None else column_of(line, self.on)
        return own + other, other - own

    @property
    def _twice(self) -> Complex[Array, ""]:
        return jnp.exp(2j * self.angle)

    def blocks(self, line: AbstractLine) -> Blocks:
        both, apart = self._sum_and_difference(line)
        return Blocks(
            weight=self.mass / 2 * both,
            weight_twice=self.mass / 2 * self._twice * apart,
            rotating_stiffness=0j * jnp.outer(line.column(self.at), line.row(self.at)),
        )

    def load(self, line: AbstractLine, blocks: Blocks) -> Load:
        del blocks
        both, apart = self._sum_and_difference(line)
        moment = self.mass * self.offset * jnp.exp(1j * self.direction)
        return Load(carried=moment * apart, carried_twice=moment.conj() * self._twice * both)
