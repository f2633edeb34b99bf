"""Massless shaft: an elastic shaft that carries everything at one station."""

from typing import Any, ClassVar, Literal

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..core.blocks import Blocks
from ..core.quantities import Scalar, check, known, nonnegative, positive, real
from .constraint import Motion
from .influence import Influence
from .line import AbstractLine, AbstractShaft, AbstractWorkLine, Attached, check_ratio


class MasslessLine(AbstractWorkLine):
    """`q = (z, [z'], [z_0])`: displacement and slope at the station, common displacement of the ends."""

    elasticity: Float[Array, "n n"]
    anisotropy: Scalar | None
    length: Scalar
    elastic_ends: bool = eqx.field(static=True)
    tilts: bool = eqx.field(static=True)

    @property
    def breaks(self) -> Float[Array, " breaks"]:
        return jnp.stack([jnp.zeros_like(self.length), self.length])

    def energy(self, bending: bool) -> Float[Array, "n n"]:
        del bending
        return self.elasticity

    def form(self, at: Scalar, derivative: int) -> Float[Array, " n"]:
        unit = jnp.eye(self.elasticity.shape[0])
        if derivative:
            return unit[1] if self.tilts else jnp.zeros(len(unit))
        if not self.elastic_ends:
            return unit[0]
        end = coincide(at, 0.0, self.length) | coincide(at, self.length, self.length)
        return jnp.where(end, unit[-1], unit[0])

    def along(self, per_length, derivative=0):
        del per_length, derivative
        raise ValueError(
            "A massless shaft is known at one station only, so nothing can be distributed along it; put "
            "damping at the station (DiscDamping)."
        )

    def load_along(self, per_length):
        return self.along(per_length)


def coincide(at: Scalar | float, place: Scalar | float, length: Scalar | float) -> Array | bool:
    """Whether two stations of a shaft are the same up to rounding."""
    return abs(at - place) <= 1e-12 * length


class MasslessShaft(AbstractShaft):
    """`F = k11 z + k12 z'`, `L = k12 z + k22 z'` at the station `at`.

    Without `k12` and `k22` the slope is left out. `anisotropy` mu: the stiffness is `(1 + mu)` times the
    given one along an axis that turns with the shaft, and `(1 - mu)` times across it. `damping` h:
    viscous force `h (z. - i Omega z)` between the station and the ends. `ends="elastic"`: both ends have
    the same displacement, and each needs a Support, at 0 and at the length.
    Sources: Brysin, Nikiforov (2019), eq. (1); Klochkov, eqs. (1), (4)-(7).
    """

    has_mass: ClassVar[bool] = False

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
        check_ratio(self.anisotropy)
        self._check_place()
        self._check_definite()

    def _check_place(self):
        if not (known(self.at) and known(self.length)):
            return
        at, length = float(self.at), float(self.length)
        at_end = coincide(at, 0.0, length) or coincide(at, length, length)
        if at > length and not at_end:
            raise ValueError(f"`at [m]` must be on the shaft (0 to {length:g}), but is {at:g}.")
        if at_end and self.ends == "elastic":
            raise ValueError(
                f"`at [m]` must be between the elastic ends (0 and {length:g}), but is {at:g}."
            )

    def _check_definite(self):
        k11, k12, k22 = self.k11, self.k12, self.k22
        if k12 is None or k22 is None or not all(map(known, (k11, k12, k22))):
            return
        k11, k12, k22 = float(k11), float(k12), float(k22)
        if k12**2 > k11 * k22 * (1 + 1e-12):
            raise ValueError(
                "`k12 [N]` squared must not exceed k11 k22, else the stiffness is not positive, but k12 "
                f"is {k12:g}, k11 {k11:g} and k22 {k22:g}."
            )

    @classmethod
    def clamped_free(cls, length, rigidity, at, **options) -> "MasslessShaft":
        """Shaft clamped at 0, free at its end: `k11 = 12 EI / a^3`, `k12 = -6 EI / a^2`, `k22 = 4 EI / a`.

        Args:
            length: length [m].
            rigidity: bending stiffness E I [N m^2].
            at: station a [m].
            options: other fields of the shaft.

        Raises:
            ValueError: If `at` is not positive, or is beyond the end.

        Source: Brysin, Nikiforov (2019), eq. (7).
        """
        at = _positive(at, "at [m]")
        k11, k12, k22 = 12 / at**3, -6 / at**2, 4 / at
        return cls(length, at, k11 * rigidity, k12 * rigidity, k22 * rigidity, **options)

    @classmethod
    def clamped_pinned(cls, length, rigidity, at, **options) -> "MasslessShaft":
        """Shaft clamped at 0, pinned at its end: `k11 = 3 EI (a^3 + 4 b^3) / (a^3 b^3)`.

        `k12 = -3 EI (2 b^2 - a^2) / (a^2 b^2)`, `k22 = EI (3 l + b) / (a b)`, b = l - a.

        Args:
            length: length l [m].
            rigidity: bending stiffness E I [N m^2].
            at: station a [m].
            options: other fields of the shaft.

        Raises:
            ValueError: If `at` is not between 0 and `length`.

        Source: Brysin, Nikiforov (2019), eq. (10).
        """
        a = _positive(at, "at [m]")
        b = _positive(length - a, "length - at [m]")
        k11 = 3 * (a**3 + 4 * b**3) / (a**3 * b**3)
        k12 = -3 * (2 * b**2 - a**2) / (a**2 * b**2)
        k22 = (3 * length + b) / (a * b)
        return cls(length, at, k11 * rigidity, k12 * rigidity, k22 * rigidity, **options)

    def reason_against(self, at: float) -> str | None:
        places = [float(place) for place in self._places]
        if any(coincide(at, place, float(self.length)) for place in places):
            return None
        has = ", ".join(f"{place:g} m" for place in places)
        rigid = ', and its ends do not move without `ends = "elastic"`' * (self.ends == "rigid")
        return f"is not at a station of the massless shaft; it has: {has}{rigid}"

    def seen(self, points: int) -> Float[Array, " x"]:
        del points
        return jnp.atleast_1d(self.at)

    @property
    def stations(self) -> tuple[Scalar, ...]:
        return ()

    @property
    def rigid_motions(self) -> list[Motion]:
        return [(1.0, 0.0)] if self.ends == "elastic" else []

    def spans(self, stations: tuple[float, ...]) -> tuple[int, ...]:
        if self.ends == "elastic":
            length = float(self.length)
            for end in (0.0, length):
                if not any(coincide(at, end, length) for at in stations):
                    raise ValueError(
                        f"A massless shaft on elastic ends needs a Support at 0 m and at {length:g} m, "
                        f"but nothing is at {end:g} m."
                    )
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
    ) -> MasslessLine:
        del spans, resolution
        elasticity = jnp.reshape(self.k11, (1, 1))
        if self.k12 is not None:
            elasticity = jnp.array([[self.k11, self.k12], [self.k12, self.k22]])
        placed = [[coincide(at, place, self.length) for place in self._places] for at in stations]
        # `Scene.put` may have moved a station or changed the length of the shaft.
        elasticity = eqx.error_if(
            elasticity,
            ~jnp.all(jnp.any(jnp.array(placed, bool).reshape(-1, len(self._places)), axis=1)),
            "A part on a massless shaft must stay at a station of the shaft; change the `at [m]` and "
            "`length [m]` of the shaft together with the `at [m]` of the part.",
        )
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
            column, row = line.column(self.at), line.row(self.at)
            if self.ends == "elastic":
                end = jnp.zeros_like(self.length)
                column, row = column - line.column(end), row - line.row(end)
            viscous = self.damping * jnp.outer(column, row)
        return Blocks(
            stiffness=line.stiffness,
            rotating_stiffness=line.rotating_stiffness,
            damping=viscous,
            circulatory=viscous,
        )

    def influence(self) -> Influence | None:
        if self.ends == "rigid":
            raise ValueError(
                "The stiffness of a massless shaft at one station does not determine how its rigid ends "
                'share the load; take `ends="elastic"` with a Support at each.'
            )
        return None

    @property
    def _places(self) -> tuple[Scalar | float, ...]:
        """Stations that the shaft has [m]."""
        return (self.at, 0.0, self.length) if self.ends == "elastic" else (self.at,)

    def _relative(self) -> Float[Array, "k n"]:
        """Displacement relative to the ends, and slope, from the coordinates."""
        own = jnp.eye(1 if self.k12 is None else 2)
        return jnp.concatenate([own, -own[:, :1]], axis=1) if self.ends == "elastic" else own


def _positive(value: Any, label: str) -> Scalar:
    return check(value, label, lambda x: x > 0, "must be positive")
