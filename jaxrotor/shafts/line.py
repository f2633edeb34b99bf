"""Base classes of shafts and of their elastic lines, as linear forms of `n` coordinates."""

import abc
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float

from ..core.blocks import Blocks
from ..core.quantities import Scalar, known
from ..core.representation import AbstractPart
from .constraint import Motion
from .influence import Influence
from .polynomials import nodes_of_spans


POINTS = 27  # Gauss points per span: exact for two polynomials of 24 nodes and two slopes
NODES = 8  # per span of a shaft, where they cannot be decided by need

PerLength = Scalar | Float[Array, "#spans"]  # uniform, or one value per span
Attached = tuple[tuple[int, bool], ...]  # number of a station, and whether a couple acts there
# Whether displacement and slope are, for every end of the spans
Held = tuple[tuple[bool, bool], ...]


class AbstractLine(eqx.Module):
    """Elastic line `z(x) = row(x) . q` of a shaft in `n` complex coordinates `q`.

    The equations of motion are written for the same `n` coordinates. A force `F` at station `x` enters
    them as `column(x) F`, and a couple `L` (positive in the sense of the slope) as `couple_column(x) L`.
    In equations of virtual work columns equal rows; in those of deflections they do not. An effect that
    uses rows and columns therefore works on every shaft.
    There are `r = n` equations, or one for each of `r` virtual displacements.
    """

    # mu: bending stiffness (1 + mu), (1 - mu) in rotating axes
    anisotropy: eqx.AbstractVar[Scalar | None]

    @property
    @abc.abstractmethod
    def breaks(self) -> Float[Array, " breaks"]:
        """Stations between which rows are smooth, including both ends of the shaft [m]."""

    @abc.abstractmethod
    def restoring(self, bending: bool) -> Float[Array, "r n"]:
        """Elastic stiffness in the equations, or its part from bending alone, in proportion to `EI`."""

    @abc.abstractmethod
    def energy(self, bending: bool) -> Float[Array, "r n"]:
        """Twice the strain energy, or that in bending alone, as a quadratic form of the coordinates."""

    @property
    def stiffness(self) -> Float[Array, "r n"]:
        """Elastic stiffness of the shaft itself in the equations."""
        return self.restoring(bending=False)

    @property
    def rotating_stiffness(self) -> Complex[Array, "r n"] | None:
        """Anisotropic part of the stiffness in the axes of the shaft, see `Blocks`; None if isotropic."""
        if self.anisotropy is None:
            return None
        return self.anisotropy * (self.restoring(bending=True) + 0j)

    @abc.abstractmethod
    def form(self, at: Scalar, derivative: int) -> Float[Array, " n"]:
        """`row` (derivative 0) or `slope_row` (1) at a station."""

    @abc.abstractmethod
    def term(self, at: Scalar, derivative: int) -> Float[Array, " r"]:
        """`column` (derivative 0) or `couple_column` (1) at a station."""

    @abc.abstractmethod
    def along(self, per_length: PerLength, derivative: int) -> Float[Array, "r n"]:
        """`Int term(s) per_length(s) form(s) ds` of a derivative."""

    def row(self, at: Scalar) -> Float[Array, " n"]:
        """Displacement at station `at` [m] as a linear form of the coordinates."""
        return self.form(at, 0)

    def slope_row(self, at: Scalar) -> Float[Array, " n"]:
        """Slope `dz/dx` at station `at` [m] as a linear form of the coordinates."""
        return self.form(at, 1)

    def column(self, at: Scalar) -> Float[Array, " r"]:
        """Term of a unit force at station `at` [m] in the equations."""
        return self.term(at, 0)

    def couple_column(self, at: Scalar) -> Float[Array, " r"]:
        """Term of a unit couple at station `at` [m] in the equations."""
        return self.term(at, 1)

    def forces_along(self, per_length: PerLength) -> Float[Array, "r n"]:
        """`Int column(s) per_length(s) row(s) ds`: a force per length in proportion to displacement."""
        return self.along(per_length, 0)

    def couples_along(self, per_length: PerLength) -> Float[Array, "r n"]:
        """`Int couple_column(s) per_length(s) slope_row(s) ds`: a couple per length, by the slope."""
        return self.along(per_length, 1)

    @abc.abstractmethod
    def load_along(self, per_length: PerLength) -> Float[Array, " r"]:
        """`Int column(s) per_length(s) ds`: a given force per length."""


class AbstractSpectralLine(AbstractLine):
    """Line of polynomials on spans, by Galerkin's equations times the flexibility."""

    ends: eqx.AbstractVar[Float[Array, " ends"]]  # ends of the spans [m]
    degrees: eqx.AbstractVar[tuple[int, ...]]  # intervals between the nodes of each span
    held: eqx.AbstractVar[Held]

    @property
    @abc.abstractmethod
    def flexibility(self) -> Float[Array, "n n"]:
        """Coordinates due to generalized forces, with a support that is statically determinate if free."""

    @property
    @abc.abstractmethod
    def rigid_motions(self) -> Float[Array, "n r"] | None:
        """Rigid motions that the constraints allow; None if there are none."""

    @abc.abstractmethod
    def work_along(self, per_length: PerLength, derivative: int) -> Float[Array, "n n"]:
        """`Int row^T per_length row ds` of displacements (0) or slopes (1): Galerkin's equations."""

    @abc.abstractmethod
    def work_of_load(self, per_length: PerLength) -> Float[Array, " n"]:
        """`Int row per_length ds`."""

    @abc.abstractmethod
    def energy_in(self, share: Float[Array, " spans"]) -> Float[Array, "n n"]:
        """`energy` with a share of that of every span."""

    @abc.abstractmethod
    def deflection(self, force: Array) -> Array:
        """Terms in the equations of generalized forces, which are `row(x) F` for a force `F` at `x`."""

    @property
    @abc.abstractmethod
    def _places(self) -> np.ndarray:
        """Coordinate of every function of a span: (span, function); their number where it has none."""

    @property
    @abc.abstractmethod
    def _unconstrained(self) -> np.ndarray:
        """Indices of the displacements and slopes that no constraint holds: the coordinates."""

    def _assembled(self, local: Float[Array, "spans i j"]) -> Float[Array, "n n"]:
        """Sum of quadratic forms of the functions of every span, as one of the coordinates."""
        n, places = self._unconstrained.size, self._places
        every = jnp.zeros((n + 1, n + 1)).at[places[:, :, None], places[:, None, :]].add(local)
        return every[:n, :n]

    def _placed(self, local: Array, places: Any) -> Float[Array, " n"]:
        """Linear form of the coordinates, from its values for functions with these places."""
        n = self._unconstrained.size
        return jnp.zeros(n + 1).at[places].add(local)[:n]

    @property
    def breaks(self) -> Float[Array, " ends"]:
        return self.ends

    @property
    def nodes(self) -> Float[Array, " nodes"]:
        """Stations of the displacements, including held ones [m]."""
        return nodes_of_spans(self.degrees, self.ends)

    @property
    def _widths(self) -> Float[Array, " spans"]:
        return jnp.diff(self.ends)

    def term(self, at: Scalar, derivative: int) -> Float[Array, " n"]:
        return self.deflection(self.form(at, derivative))

    @eqx.filter_jit
    def along(self, per_length: PerLength, derivative: int) -> Float[Array, "n n"]:
        return self.deflection(self.work_along(per_length, derivative))

    @eqx.filter_jit
    def load_along(self, per_length: PerLength) -> Float[Array, " n"]:
        return self.deflection(self.work_of_load(per_length))


def gauss_points(breaks: Float[Array, " breaks"]) -> tuple[Array, Array]:
    """Gauss points and weights (spans, g) of an integral along a shaft."""
    points, weights = np.polynomial.legendre.leggauss(POINTS)
    half = jnp.diff(breaks)[:, None] / 2
    return breaks[:-1, None] + half * (1 + points), half * weights


class AbstractWorkLine(AbstractLine):
    """Line whose equations are those of virtual work: stiffness by energy, columns as rows."""

    def restoring(self, bending: bool) -> Float[Array, "n n"]:
        return self.energy(bending)

    def term(self, at: Scalar, derivative: int) -> Float[Array, " n"]:
        return self.form(at, derivative)


class RigidLine(AbstractWorkLine):
    """`z(x) = Sum_k q_k (a_k + b_k x)`: the rigid motions that the constraints allow."""

    motions: Float[Array, "n 2"]  # a [m] or [1] and b [1] or [1/m] of each coordinate
    length: Scalar
    anisotropy: None = None

    @property
    def breaks(self) -> Float[Array, " breaks"]:
        return jnp.stack([jnp.zeros_like(self.length), self.length])

    def energy(self, bending: bool) -> Float[Array, "n n"]:
        del bending
        return jnp.zeros((len(self.motions), len(self.motions)))

    def form(self, at: Scalar, derivative: int) -> Float[Array, " n"]:
        if derivative:
            return self.motions[:, 1]
        return self.motions @ jnp.stack([jnp.ones_like(at), at])

    def along(self, per_length: PerLength, derivative: int) -> Float[Array, "n n"]:
        length, density, slopes = self.length, jnp.reshape(per_length, ()), self.motions[:, 1]
        if derivative:
            return density * length * jnp.outer(slopes, slopes)
        moments = jnp.array([[length, length**2 / 2], [length**2 / 2, length**3 / 3]])
        return self.motions @ (density * moments) @ self.motions.T

    def load_along(self, per_length: PerLength) -> Float[Array, " n"]:
        along = jnp.stack([self.length, self.length**2 / 2])
        return self.motions @ (jnp.reshape(per_length, ()) * along)


class AbstractShaft(AbstractPart):
    """Shaft: the straight elastic or rigid body that carries all other parts."""

    has_mass: eqx.AbstractClassVar[bool]  # whether the shaft itself gives mass to every coordinate
    length: eqx.AbstractVar[Scalar]

    @abc.abstractmethod
    def reason_against(self, at: float) -> str | None:
        """Reason why nothing can be placed at a known station `at` [m]; None if it can."""

    @abc.abstractmethod
    def seen(self, points: int) -> Float[Array, " x"]:
        """About `points` stations [m] at which shapes of the shaft are drawn."""

    @property
    @abc.abstractmethod
    def stations(self) -> tuple[Scalar, ...]:
        """Stations of the shaft itself [m], such as constraints and steps of the diameter."""

    @property
    @abc.abstractmethod
    def rigid_motions(self) -> list[Motion]:
        """Rigid motions, for which the shaft does not bend and its constraints do not yield."""

    @abc.abstractmethod
    def spans(self, stations: tuple[float, ...]) -> tuple[int, ...]:
        """Indices of the known `stations` [m] that bound spans on which the line is smooth.

        `stations` are those of the shaft itself, then those of effects. The indices are ordered from the
        start of the shaft to its end; -1 stands for an end without a station.
        """

    @abc.abstractmethod
    def resolution(
        self, stations: tuple[float, ...], spans: tuple[int, ...], held: int
    ) -> tuple[int, ...]:
        """Number of nodes of every span between the known `stations` [m] that `spans` lists.

        `held` is the number of stations where effects hold the shaft; more of them mean shorter waves.
        """

    @abc.abstractmethod
    def attached(
        self, stations: tuple[float, ...], turned: tuple[bool, ...], resolution: tuple[int, ...]
    ) -> Attached:
        """Loads whose static deflections a condensed line has; none if it is not condensed.

        `turned` tells of every station of an effect whether that may act on the slope there.
        """

    @abc.abstractmethod
    def line(
        self,
        stations: tuple[Scalar, ...],
        spans: tuple[int, ...],
        resolution: tuple[int, ...],
        attached: Attached,
    ) -> AbstractLine:
        """Elastic line, smooth on the spans between the listed stations, of `resolution` nodes each."""

    @abc.abstractmethod
    def blocks(self, line: AbstractLine) -> Blocks:
        """Blocks of the shaft itself, without effects."""

    @abc.abstractmethod
    def influence(self) -> Influence | None:
        """Influence lines of the constraints, of displacement before slope; None without constraints."""


def off_shaft(shaft: AbstractShaft, at: float) -> str | None:
    """Reason why a station beyond the ends of a shaft is invalid; None between them."""
    length = float(shaft.length)
    if 0 <= at <= length * (1 + 1e-12):
        return None
    return f"is off the shaft; `at [m]` must be between 0 and the shaft's length, {length:g} m"


def check_ratio(anisotropy: Scalar | None) -> None:
    """Raise unless both principal stiffnesses are positive."""
    if anisotropy is not None and known(anisotropy) and abs(float(anisotropy)) >= 1:
        raise ValueError(
            f"`anisotropy [1]` must be between -1 and 1, but is {float(anisotropy):g}."
        )
