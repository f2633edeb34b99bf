"""Massless shaft: elasticity only, everything on it at one station."""

from typing import Literal

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..blocks import Blocks
from ..quantities import Scalar, nonnegative, positive, real
from .influence import Influence
from .line import AbstractLine, AbstractShaft


class MasslessLine(AbstractLine):
    """`q = (z, [z'], [z_0])`: displacement and slope at the station, displacement of both ends."""

    elasticity: Float[Array, "n n"]
    anisotropy: Scalar | None
    length: Scalar
    elastic_ends: bool = eqx.field(static=True)
    tilts: bool = eqx.field(static=True)

    @property
    def breaks(self) -> Float[Array, " breaks"]:
        return jnp.stack([jnp.zeros_like(self.length), self.length])

    @property
    def stiffness(self) -> Float[Array, "n n"]:
        return self.elasticity

    def row(self, at: Scalar) -> Float[Array, " n"]:
        unit = jnp.eye(self.elasticity.shape[0])
        if not self.elastic_ends:
            return unit[0]
        end = (at == 0) | (at == self.length)
        return jnp.where(end, unit[-1], unit[0])

    def slope_row(self, at: Scalar) -> Float[Array, " n"]:
        del at
        size = self.elasticity.shape[0]
        return jnp.eye(size)[1] if self.tilts else jnp.zeros(size)

    def column(self, at: Scalar) -> Float[Array, " n"]:
        return self.row(at)

    def couple_column(self, at: Scalar) -> Float[Array, " n"]:
        return self.slope_row(at)

    def forces_along(self, per_length):
        return _refuse_length(per_length)

    def couples_along(self, per_length):
        return _refuse_length(per_length)

    def load_along(self, per_length):
        return _refuse_length(per_length)


def _refuse_length(per_length):
    del per_length
    raise ValueError(
        "A massless shaft is known at one station only, so nothing can be spread along it; put "
        "damping at the station (DiscDamping)."
    )


class MasslessShaft(AbstractShaft):
    """`F = k11 z + k12 z'`, `L = k12 z + k22 z'` at the station `at`; no slope without k12, k22.

    `anisotropy` mu: stiffness `(1 + mu)` of the given along an axis that turns with the shaft and
    `(1 - mu)` across it. `damping` h: viscous force `h (z. - i Omega z)` between the station and the
    ends. `ends="elastic"`: both ends move alike and each end needs a Support at 0 or at the length.
    Sources: Brysin, Nikiforov (2019), eq. (1); Klochkov, eqs. (1), (4)-(7).
    """

    length: Scalar = positive("length [m]")
    at: Scalar = nonnegative("at [m]")
    k11: Scalar = positive("k11 [N/m]")
    k12: Scalar = real("k12 [N]", default=None)
    k22: Scalar = positive("k22 [N m]", default=None)
    anisotropy: Scalar = real("anisotropy [1]", default=None)
    damping: Scalar = nonnegative("damping [N s/m]", default=None)
    ends: Literal["rigid", "elastic"] = eqx.field(default="rigid", static=True)

    def __check_init__(self):
        if self.ends not in ("rigid", "elastic"):
            raise ValueError(f"`ends` must be 'rigid' or 'elastic', but is {self.ends!r}.")
        if (self.k12 is None) != (self.k22 is None):
            raise ValueError("`k12 [N]` and `k22 [N m]` belong together; give both or neither.")

    @classmethod
    def clamped_free(cls, length, rigidity, at, **options) -> "MasslessShaft":
        """Clamped at 0 and free at `length` [m]; `rigidity` E I [N m^2].

        `k11 = 12 EI / a^3`, `k12 = -6 EI / a^2`, `k22 = 4 EI / a`, a = at. Source: eq. (7).
        """
        k11, k12, k22 = 12 / at**3, -6 / at**2, 4 / at
        return cls(length, at, k11 * rigidity, k12 * rigidity, k22 * rigidity, **options)

    @classmethod
    def clamped_pinned(cls, length, rigidity, at, **options) -> "MasslessShaft":
        """Clamped at 0 and pinned at `length` [m]; `rigidity` E I [N m^2].

        `k11 = 3 EI (a^3 + 4 b^3) / (a^3 b^3)`, `k12 = -3 EI (2 b^2 - a^2) / (a^2 b^2)`,
        `k22 = EI (3 l + b) / (a b)`, a = at, b = l - a. Source: eq. (10).
        """
        a, b = at, length - at
        k11 = 3 * (a**3 + 4 * b**3) / (a**3 * b**3)
        k12 = -3 * (2 * b**2 - a**2) / (a**2 * b**2)
        k22 = (3 * length + b) / (a * b)
        return cls(length, at, k11 * rigidity, k12 * rigidity, k22 * rigidity, **options)

    def reason_against(self, at: float) -> str | None:
        places = [float(self.at), *([0.0, float(self.length)] if self.ends == "elastic" else [])]
        if any(abs(at - place) <= 1e-12 * float(self.length) for place in places):
            return None
        has = ", ".join(f"{place:g} m" for place in places)
        return f"is not at a station of the massless shaft; it has: {has}"

    def seen(self, points: int) -> Float[Array, " x"]:
        del points
        return jnp.atleast_1d(self.at)

    @property
    def stations(self) -> tuple[Scalar, ...]:
        return ()

    def spans(self, stations: tuple[float, ...]) -> tuple[int, ...]:
        del stations
        return ()

    def line(self, stations: tuple[Scalar, ...], spans: tuple[int, ...]) -> MasslessLine:
        del stations, spans
        elasticity = jnp.reshape(self.k11, (1, 1))
        if self.k12 is not None:
            elasticity = jnp.array([[self.k11, self.k12], [self.k12, self.k22]])
        relative = self._relative()
        return MasslessLine(
            elasticity=relative.T @ elasticity @ relative,
            anisotropy=self.anisotropy,
            length=self.length,
            elastic_ends=self.ends == "elastic",
            tilts=self.k12 is not None,
        )

    def blocks(self, line: AbstractLine) -> Blocks:
        viscous = None
        if self.damping is not None:
            stretch = self._relative()[0]
            viscous = self.damping * jnp.outer(stretch, stretch)
        return Blocks(
            stiffness=line.stiffness,
            rotating_stiffness=line.rotating_stiffness,
            damping=viscous,
            circulatory=viscous,
        )

    def influence(self) -> Influence | None:
        if self.ends == "rigid":
            raise ValueError(
                "A massless shaft is known by its stiffness at one station, which does not tell how its "
                'rigid ends share the load; take `ends="elastic"` with a Support at each.'
            )
        return None

    def _relative(self) -> Float[Array, "k n"]:
        """Displacement (less that of the ends) and slope from the coordinates."""
        own = jnp.eye(1 if self.k12 is None else 2)
        return jnp.concatenate([own, -own[:, :1]], axis=1) if self.ends == "elastic" else own
