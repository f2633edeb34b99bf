"""Elastic line of shafts with further coordinates beside it: casings, and those of other effects."""

import dataclasses
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float

from ..core.quantities import Scalar
from .coaxial import CoaxialLine
from .line import AbstractLine, PerLength, gauss_points
from .virtual import VirtualLine


class CasedLine(AbstractLine):
    """`z(x) = (row(x), 0) . q` on the shaft, `z_k = (0 .. 1 .. 0) . q` of a casing; these come last.

    A force on a casing enters its own equation as it is. Effects may have coordinates of their own, which
    come between the two.
    """

    line: AbstractLine  # of the shaft alone, or of several
    names: tuple[str, ...] = eqx.field(static=True)  # of the coordinates beside the shaft
    anisotropy: Scalar | None

    @property
    def breaks(self) -> Float[Array, " breaks"]:
        return self.line.breaks

    def restoring(self, bending: bool) -> Float[Array, "n n"]:
        return self._padded(self.line.restoring(bending))

    def energy(self, bending: bool) -> Float[Array, "n n"]:
        return self._padded(self.line.energy(bending))

    def form(self, at: Scalar, derivative: int) -> Float[Array, " n"]:
        return self._padded(self.line.form(at, derivative))

    def term(self, at: Scalar, derivative: int) -> Float[Array, " n"]:
        return self._padded(self.line.term(at, derivative))

    def along(self, per_length: PerLength, derivative: int) -> Float[Array, "n n"]:
        return self._padded(self.line.along(per_length, derivative))

    def load_along(self, per_length: PerLength) -> Float[Array, " n"]:
        return self._padded(self.line.load_along(per_length))

    def beside(self, name: str) -> Float[Array, " n"]:
        """Coordinate of a name as a linear form, and the term of a unit force on it."""
        own = self.line.row(self.breaks[0]).size
        return jnp.zeros(own + len(self.names)).at[own + self.names.index(name)].set(1.0)

    def _padded(self, block: Array) -> Array:
        return jnp.pad(block, [(0, len(self.names))] * block.ndim)


def line_of(line: AbstractLine, shaft: str | None) -> AbstractLine:
    """The line as that of the shaft of a name, where there are several; None: as it is."""
    return line if shaft is None else _with_shafts(line, lambda lines: lines.of(shaft))


def from_own_end(line: AbstractLine) -> AbstractLine:
    """The line of one of several shafts with stations from its left end on."""
    zero = lambda lines: dataclasses.replace(lines, starts=(jnp.zeros(()),) * len(lines.starts))
    return _with_shafts(line, zero)


def _with_shafts(line: AbstractLine, changed: Callable[[CoaxialLine], CoaxialLine]) -> AbstractLine:
    """The line with those of its shafts changed."""
    if isinstance(line, CoaxialLine):
        return changed(line)
    assert isinstance(line, CasedLine | VirtualLine), "a scene knows the shafts that its parts name"
    own = _with_shafts(line.line, changed)
    if isinstance(line, CasedLine):
        return dataclasses.replace(line, line=own, anisotropy=own.anisotropy)
    return VirtualLine.galerkin(own) if line.strained else dataclasses.replace(line, line=own)


def shafts_of(line: AbstractLine) -> tuple[str, ...]:
    """Names of the shafts of a line; none where there is one shaft."""
    while isinstance(line, CasedLine | VirtualLine):
        line = line.line
    return line.names if isinstance(line, CoaxialLine) else ()


def row_of(line: AbstractLine, place: Scalar | str) -> Float[Array, " n"]:
    """Displacement as a linear form, at a station [m] or of a casing or another coordinate by its name."""
    return line.row(place) if not isinstance(place, str) else _cased(line).beside(place)


def column_of(line: AbstractLine, place: Scalar | str) -> Float[Array, " r"]:
    """Term of a unit force in the equations, at a station [m] or on a casing by its name.

    Of virtual displacements only those of Galerkin's equations move a casing.
    """
    if not isinstance(place, str):
        return line.column(place)
    if isinstance(line, VirtualLine) and not line.strained:
        return 0.0 * line.column(line.breaks[0])
    return row_of(line, place)


def ends(
    line: AbstractLine, place: Scalar | str, on: str | None
) -> tuple[Float[Array, " n"], Float[Array, " r"]]:
    """Row and column of a place relative to what has a name: a casing, or another shaft at this station.

    None: to the ground.
    """
    row, column = row_of(line, place), column_of(line, place)
    if on is None:
        return row, column
    there: Scalar | str = on
    if on in shafts_of(line):
        line, there = line_of(line, on), place
    return row - row_of(line, there), column - column_of(line, there)


def slope_ends(
    line: AbstractLine, at: Scalar, on: str | None
) -> tuple[Float[Array, " n"], Float[Array, " r"]]:
    """The same of the slope; casings, which do not tilt, are as the ground."""
    row, column = line.slope_row(at), line.couple_column(at)
    if on not in shafts_of(line):
        return row, column
    other = line_of(line, on)
    return row - other.slope_row(at), column - other.couple_column(at)


def _cased(line: AbstractLine) -> CasedLine:
    """The line with coordinates beside it that a line is, or that a virtual one is of."""
    while isinstance(line, VirtualLine):
        line = line.line
    assert isinstance(line, CasedLine), "a scene knows the coordinates that its parts name"
    return line


@eqx.filter_jit
def _rows(
    line: AbstractLine, x: Float[Array, " p"]
) -> tuple[Float[Array, "p n"], Float[Array, "p n"]]:
    """Rows of the displacements and of the slopes at stations."""
    return jax.vmap(line.row)(x), jax.vmap(line.slope_row)(x)


def same_shape(
    q: Complex[Any, " n"], line: AbstractLine, finer: AbstractLine
) -> Complex[np.ndarray, " m"]:
    """Coordinates on a finer line, with the same ends of spans, of the shape that `q` has on a line."""
    x = gauss_points(finer.breaks)[0].ravel()
    length = finer.breaks[-1]

    def rows(one: AbstractLine) -> np.ndarray:
        moved, turned = _rows(one, x)
        found = [moved, length * turned]
        if isinstance(one, CasedLine):
            found += [one.beside(name)[None] for name in one.names]
        return np.concatenate(found)

    return np.linalg.lstsq(rows(finer), rows(line) @ np.asarray(q))[0]
