"""What every shaft model offers: its elastic line in `n` coordinates, as linear forms."""

import abc

import equinox as eqx
from jaxtyping import Array, Complex, Float

from ..blocks import Blocks
from ..quantities import Scalar


class AbstractLine(eqx.Module):
    """Elastic line `z(x) = row(x) . q` of a shaft in `n` complex coordinates `q`.

    The equations of motion are written for the same `n` coordinates; a force `F` at station `x`
    enters them as `column(x) F` and a couple `L` (turning the tangent, positive with the slope) as
    `couple_column(x) L`. In a variational model a column is its row; in collocation it is not,
    so an effect that uses both works on every shaft.
    """

    @property
    @abc.abstractmethod
    def stiffness(self) -> Float[Array, "n n"]:
        """The shaft's own elastic stiffness in the equations."""

    @property
    def rotating_stiffness(self) -> Complex[Array, "n n"] | None:
        """What two unequal principal stiffnesses add in the axes of the shaft, see `Blocks`."""
        return None

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
    def forces_along(self) -> Float[Array, "n n"]:
        """`Int column(s) row(s) ds`: a force per length proportional to displacement."""

    @abc.abstractmethod
    def couples_along(self) -> Float[Array, "n n"]:
        """`Int couple_column(s) slope_row(s) ds`: a couple per length proportional to slope."""

    @abc.abstractmethod
    def load_along(self) -> Float[Array, " n"]:
        """`Int column(s) ds`: a uniform unit force per length."""


class AbstractShaft(eqx.Module):
    """A shaft: the straight elastic or rigid body everything else sits on."""

    length: eqx.AbstractVar[Scalar]

    @abc.abstractmethod
    def reason_against(self, at: float) -> str | None:
        """Why nothing can sit at a known station `at` [m], or None where it can."""

    @abc.abstractmethod
    def seen(self, points: int) -> Float[Array, " x"]:
        """Stations [m], about `points` of them, along which its shapes are drawn."""

    @abc.abstractmethod
    def breaks(self, stations: tuple[float, ...]) -> tuple[int, ...]:
        """Which of the known `stations` [m] end a smooth stretch of the elastic line."""

    @abc.abstractmethod
    def line(self, breaks: tuple[Scalar, ...]) -> AbstractLine:
        """The elastic line, smooth between the inner stations `breaks` (ascending)."""

    @abc.abstractmethod
    def blocks(self, line: AbstractLine) -> Blocks:
        """The bare shaft's own matrices."""
