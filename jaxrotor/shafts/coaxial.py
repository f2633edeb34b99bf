"""Elastic lines of several shafts on one axis, whose coordinates follow each other."""

import dataclasses

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..core.quantities import Scalar
from .line import AbstractLine, PerLength


class CoaxialLine(AbstractLine):
    """`z_k(x) = (0 .. row_k(x - start_k) .. 0) . q` of shaft k, `x` along the common axis.

    It is read as the line of one of its shafts, by default the first. `of` reads it as that of another
    one, in the same coordinates.
    """

    lines: tuple[AbstractLine, ...]
    starts: tuple[Scalar, ...]  # station of the left end of every shaft [m]
    names: tuple[str, ...] = eqx.field(static=True)
    anisotropy: Scalar | None
    own: int = eqx.field(static=True, default=0)  # number of the shaft whose line this is

    def of(self, name: str) -> "CoaxialLine":
        """The line of the shaft of a name."""
        own = self.names.index(name)
        return dataclasses.replace(self, own=own, anisotropy=self.lines[own].anisotropy)

    @property
    def breaks(self) -> Float[Array, " breaks"]:
        return self.starts[self.own] + self._line.breaks

    def restoring(self, bending: bool) -> Float[Array, "n n"]:
        return self._placed(self._line.restoring(bending))

    def energy(self, bending: bool) -> Float[Array, "n n"]:
        return self._placed(self._line.energy(bending))

    def form(self, at: Scalar, derivative: int) -> Float[Array, " n"]:
        return self._placed(self._line.form(at - self.starts[self.own], derivative))

    def term(self, at: Scalar, derivative: int) -> Float[Array, " n"]:
        return self._placed(self._line.term(at - self.starts[self.own], derivative))

    def along(self, per_length: PerLength, derivative: int) -> Float[Array, "n n"]:
        return self._placed(self._line.along(per_length, derivative))

    def load_along(self, per_length: PerLength) -> Float[Array, " n"]:
        return self._placed(self._line.load_along(per_length))

    @property
    def _line(self) -> AbstractLine:
        return self.lines[self.own]

    def _placed(self, block: Array) -> Array:
        sizes = [line.row(line.breaks[0]).size for line in self.lines]
        around = sum(sizes[: self.own]), sum(sizes[self.own + 1 :])
        return jnp.pad(block, [around] * block.ndim)
