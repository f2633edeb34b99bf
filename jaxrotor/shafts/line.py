"""What every shaft model offers: its elastic line in `n` coordinates, as linear forms."""

import abc
from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float

from ..core.blocks import Blocks
from ..core.quantities import Scalar, known
from ..core.representation import AbstractPart
from .influence import Influence


POINTS = 20  # Gauss points a span: the product of two polynomials of 24 nodes and a cubic

PerLength = Scalar | Float[Array, "#spans"]  # uniform, or a value for each span


class AbstractLine(eqx.Module):
    """Elastic line `z(x) = row(x) . q` of a shaft in `n` complex coordinates `q`.

    The equations of motion are written for the same `n` coordinates; a force `F` at station `x`
    enters them as `column(x) F` and a couple `L` (turning the tangent, positive with the slope) as
    `couple_column(x) L`. In a variational model a column is its row; in collocation it is not,
    so an effect that uses both works on every shaft.
    """

    anisotropy: eqx.AbstractVar[Scalar | None]  # mu: stiffness (1 + mu), (1 - mu) of turning axes

    @property
    @abc.abstractmethod
    def breaks(self) -> Float[Array, " breaks"]:
        """Stations between which rows are smooth, both ends of the shaft included [m]."""

    @property
    @abc.abstractmethod
    def stiffness(self) -> Float[Array, "n n"]:
        """The shaft's own elastic stiffness in the equations."""

    @property
    @abc.abstractmethod
    def bending_stiffness(self) -> Float[Array, "n n"]:
        """The part of `stiffness` in proportion to `EI`: all but that of shear."""

    @property
    @abc.abstractmethod
    def strain_energy(self) -> Float[Array, "n n"]:
        """Twice the strain energy as a quadratic form: `stiffness` as forces on the coordinates."""

    @property
    @abc.abstractmethod
    def bending_energy(self) -> Float[Array, "n n"]:
        """The same of `bending_stiffness`."""

    @property
    def rotating_stiffness(self) -> Complex[Array, "n n"] | None:
        """What two unequal principal stiffnesses add in the axes of the shaft, see `Blocks`."""
        return None if self.anisotropy is None else self.anisotropy * (self.bending_stiffness + 0j)

    @abc.abstractmethod
    def row(self, at: Scalar) -> Float[Array, " n"]:
        """Displacement at station `at` [m] as a linear form of the coordinates."""

    @abc.abstractmethod
    def slope_row(self, at: Scalar) -> Float[Array, " n"]:
        """Slope `dz/dx` at station `at` [m] as a linear form of the coordinates."""

    @abc.abstractmethod
    def column(self, at: Scalar) -> Float[Array, " n"]:
        """What a unit force at station `at` [m] adds to the equations."""

    @abc.abstractmethod
    def couple_column(self, at: Scalar) -> Float[Array, " n"]:
        """What a unit couple at station `at` [m] adds to the equations."""

    @abc.abstractmethod
    def forces_along(self, per_length: PerLength) -> Float[Array, "n n"]:
        """`Int column(s) per_length(s) row(s) ds`: a force per length, times displacement."""

    @abc.abstractmethod
    def couples_along(self, per_length: PerLength) -> Float[Array, "n n"]:
        """`Int couple_column(s) per_length(s) slope_row(s) ds`: a couple per length, times slope."""

    @abc.abstractmethod
    def load_along(self, per_length: PerLength) -> Float[Array, " n"]:
        """`Int column(s) per_length(s) ds`: a force per length."""


def gauss_points(breaks: Float[Array, " breaks"]) -> tuple[Array, Array]:
    """Stations and weights (spans, g) of an integral along a shaft."""
    points, weights = np.polynomial.legendre.leggauss(POINTS)
    half = jnp.diff(breaks)[:, None] / 2
    return breaks[:-1, None] + half * (1 + points), half * weights


def strain_energy(line: AbstractLine, rigidity: Callable) -> Float[Array, "n n"]:
    """`Int EI z''^2 dx` as a quadratic form of the coordinates."""
    x, weights = (part.ravel() for part in gauss_points(line.breaks))
    bent = jax.vmap(jax.jacfwd(line.slope_row))(x)
    return jnp.einsum("x,xn,xm->nm", weights * rigidity(x), bent, bent)


class AbstractShaft(AbstractPart):
    """A shaft: the straight elastic or rigid body everything else sits on."""

    has_mass: eqx.AbstractClassVar[bool]  # of its own, so that every coordinate has some
    length: eqx.AbstractVar[Scalar]

    @abc.abstractmethod
    def reason_against(self, at: float) -> str | None:
        """Why nothing can sit at a known station `at` [m], or None where it can."""

    @abc.abstractmethod
    def seen(self, points: int) -> Float[Array, " x"]:
        """Stations [m], about `points` of them, along which its shapes are drawn."""

    @property
    @abc.abstractmethod
    def stations(self) -> tuple[Scalar, ...]:
        """Stations of its own [m], such as constraints and steps of diameter."""

    @abc.abstractmethod
    def spans(self, stations: tuple[float, ...]) -> tuple[int, ...]:
        """Which of the known `stations` [m], its own before those of effects, end a smooth stretch.

        Ascending along the shaft, from its start to its end; -1 stands for no station there.
        """

    @abc.abstractmethod
    def resolution(
        self, stations: tuple[float, ...], spans: tuple[int, ...], held: int
    ) -> tuple[int, ...]:
        """Nodes of every span, between the known `stations` [m] that `spans` lists.

        `held` counts the stations at which effects hold the shaft: the more, the shorter its waves.
        """

    @abc.abstractmethod
    def line(
        self, stations: tuple[Scalar, ...], spans: tuple[int, ...], resolution: tuple[int, ...]
    ) -> AbstractLine:
        """The elastic line, smooth between the stations that `spans` lists, of `resolution` nodes each."""

    @abc.abstractmethod
    def blocks(self, line: AbstractLine) -> Blocks:
        """The bare shaft's own matrices."""

    @abc.abstractmethod
    def influence(self) -> Influence | None:
        """Influence lines of its constraints, displacement before slope; None where it has none."""


def off_shaft(shaft: AbstractShaft, at: float) -> str | None:
    """Why nothing can sit beyond the ends of a shaft; None between them."""
    length = float(shaft.length)
    if 0 <= at <= length * (1 + 1e-12):
        return None
    return f"is off the shaft; `at [m]` must be between 0 and the shaft's length, {length:g} m"


def check_ratio(anisotropy: Scalar | None) -> None:
    """Refuse two stiffnesses of which one is not positive."""
    if anisotropy is not None and known(anisotropy) and abs(float(anisotropy)) >= 1:
        raise ValueError(
            f"`anisotropy [1]` must be between -1 and 1, but is {float(anisotropy):g}."
        )
