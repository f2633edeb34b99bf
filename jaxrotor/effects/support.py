"""Elastic support of a shaft: a bearing given by its stiffness and damping."""

from collections.abc import Iterator
from typing import Any, ClassVar, Literal

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import ArrayLike

from ..core.blocks import Blocks
from ..core.extremes import bounded
from ..core.pchip import INTERPOLATIONS
from ..core.plane import plane
from ..core.quantities import (
    Scalar,
    Series,
    Tabled,
    Taken,
    check,
    is_table,
    known,
    nonnegative,
    real,
    series,
    with_values,
)
from ..shafts.cased import ends, slope_ends
from ..shafts.line import AbstractLine
from .base import AbstractOverSpeed, AbstractUnequal, Deviator, Ends
from .coefficients import (
    AXES,
    COEFFICIENTS,
    LETTERS,
    DeviatorLaw,
    Parts,
    check_tables,
    check_whole,
    is_zero,
    vanishing,
)


SPEEDS = ("first", "sum", "difference")
_MEANS = ("stiffness", "anisotropy", "angle", "cross_stiffness")
_MEANS += ("damping", "damping_anisotropy", "damping_angle", "cross_damping")


class Support(AbstractUnequal, AbstractOverSpeed):
    """Linear bearing, `F = -k q - c q.` with `k = [[kxx, kxy], [kyx, kyy]]` and `q = (x, y)`.

    There are two ways to give it. The first is by coefficients, as in a bearing report: `kxx`, `kxy`, ..
    `cyy`, or `stiffness` and `damping` as 2 by 2 matrices, which are stored as coefficients. `kxx` alone
    means `kyy = kxx`, `cxx` alone `cyy = cxx`; `kxy` and `kyx` are given both or neither. The second is by
    means and axes, with `z = x + i y`:

        F = -(k + i cross_stiffness) z - k anisotropy exp(2 i angle) z* - (same of c) z.

    The stiffness is then `k (1 + anisotropy)` along the axis at `angle` (None: the x axis) and
    `k (1 - anisotropy)` across it. Damping is analogous, with the axis at `damping_angle` (None: that of
    the stiffness). `cross_stiffness` rotates the force ahead of the displacement; a negative value drives
    forward whirl. Both ways describe the same bearing: `k = (kxx + kyy) / 2`,
    `cross_stiffness = (kyx - kxy) / 2`, `k anisotropy exp(2 i angle) = (kxx - kyy + i kxy + i kyx) / 2`.
    A support that is known to be isotropic when it is built, or changed by `scene.replace`, has no
    anisotropic part in the equations. A direct stiffness may be negative, as of a seal or of magnetic
    pull, which drive the shaft off its axis.

    Each coefficient `kxx` .. `cyy` is a number, or a table of its values at the `speeds` of rotation, as
    of a film, at `|Omega|` unless they begin below 0 or are for `one_sense`. Between the nodes it is the
    shape-preserving cubic of each table (PCHIP), with a continuous first derivative, or with
    `interpolation="linear"` a straight line, whose derivative at a node is that above it. A speed
    outside the nodes is refused, or NaN where it is traced; with `hold=True` coefficients are constant
    there. Tables belong to a support that does not turn. With `frequencies` in place of `speeds` they
    are over the frequency of whirl, as of a seal: each root has the coefficients at its own `|Im
    lambda|`. With both, each table has a row for every speed and a column for every frequency; it is
    read at the speed first. Of several shafts `speeds` are those of the shaft at `at`. Between two of them
    `speeds_of` says whose: "difference" is `Omega_at - Omega_on`, as of balls, "sum" is `Omega_at +
    Omega_on`, as of an oil film. "first" is that of the first shaft of the scene, anywhere.

    `mxx` is the added mass of a seal, the same along x and y: `F = -m z..`, without weight.
    `angular_stiffness` and `angular_damping` hold the slope: `L = -k_a z' - c_a z'.`.
    A support stands on the ground, or `on` the `Casing` of a name: `q` is then the displacement relative
    to the casing, which gets the opposite force. `of` names a casing that it holds, in place of a
    station `at`. A casing does not tilt, so to the slope it is the ground.
    With `rotating=True` the axes of the bearing and its damper turn with the shaft, so the damping is
    internal: `z. - i Omega z` in place of `z.`. None means absent.
    Source: Klochkov, eqs. (1), (6), (7); Friswell et al. (2010).
    """

    kind: ClassVar[str] = "support"
    plural: ClassVar[str] = "supports"
    holds_shaft: ClassVar[bool] = True

    at: Scalar = nonnegative("at [m]", default=None)
    stiffness: Scalar = real("stiffness [N/m]", default=None, matrix=True)
    damping: Scalar = nonnegative("damping [N s/m]", default=None, matrix=True)
    anisotropy: Scalar = real("anisotropy [1]", default=None)
    damping_anisotropy: Scalar = real("damping_anisotropy [1]", default=None)
    angle: Scalar = real("angle [rad]", default=None)
    damping_angle: Scalar = real("damping_angle [rad]", default=None)
    cross_stiffness: Scalar = real("cross_stiffness [N/m]", default=None)
    cross_damping: Scalar = real("cross_damping [N s/m]", default=None)
    kxx: Tabled = real("kxx [N/m]", default=None, table=True)
    kxy: Tabled = real("kxy [N/m]", default=None, table=True)
    kyx: Tabled = real("kyx [N/m]", default=None, table=True)
    kyy: Tabled = real("kyy [N/m]", default=None, table=True, taken=Taken("kxx", "kxx"))
    cxx: Tabled = real("cxx [N s/m]", default=None, table=True)
    cxy: Tabled = real("cxy [N s/m]", default=None, table=True)
    cyx: Tabled = real("cyx [N s/m]", default=None, table=True)
    cyy: Tabled = real("cyy [N s/m]", default=None, table=True, taken=Taken("cxx", "cxx"))
    speeds: Series = series("speeds [rad/s]", ascending=True, default=None)
    frequencies: Series = series(
        "frequencies [rad/s]", ascending=True, nonnegative=True, default=None
    )
    hold: bool = eqx.field(
        default=False, static=True
    )  # whether tables are constant beyond the ends
    one_sense: bool = eqx.field(
        default=False, static=True
    )  # whether tables over `speeds` hold for the sense of these alone
    interpolation: Literal["pchip", "linear"] = eqx.field(default="pchip", static=True)
    # Of several shafts, whose speed `speeds` are; None: of the shaft at `at`
    speeds_of: Literal["first", "sum", "difference"] | None = eqx.field(default=None, static=True)
    mxx: Scalar = nonnegative("mxx [kg]", default=None)
    angular_stiffness: Scalar = real("angular_stiffness [N m/rad]", default=None)
    angular_damping: Scalar = nonnegative("angular_damping [N m s/rad]", default=None)
    rotating: bool = eqx.field(default=False, static=True)
    on: str | None = eqx.field(default=None, static=True)  # name of a casing; None: the ground
    of: str | None = eqx.field(default=None, static=True)  # name of a casing; None: the shaft
    vanishing: tuple[str, ...] = eqx.field(init=False, static=True)  # parts known to be zero
    synchronous: bool = eqx.field(init=False, static=True)  # whirls as it rotates

    def __post_init__(self):
        super().__post_init__()
        for name, letter in LETTERS.items():
            value = getattr(self, name)
            if isinstance(value, list | tuple) or np.ndim(value) > 1:
                self._store_matrix(value, name, letter)
        self.vanishing = tuple(self._vanishing())
        self.synchronous = False

    def __check_init__(self):
        own = {name: getattr(self, name) for name in COEFFICIENTS}
        given = [name for name, value in own.items() if value is not None]
        means = [name for name in _MEANS if getattr(self, name) is not None]
        self._check_ends()
        if self.interpolation not in INTERPOLATIONS:
            raise ValueError(
                f"`interpolation` must be 'pchip' or 'linear', but is {self.interpolation!r}."
            )
        check_tables(self._tables, self.speeds, self.frequencies, self.rotating)
        if self.speeds_of not in (None, *SPEEDS):
            raise ValueError(
                f"`speeds_of` must be one of {SPEEDS} or None, but is {self.speeds_of!r}."
            )
        if self.speeds_of and self.speeds is None:
            raise ValueError("`speeds_of` belongs to tables over `speeds [rad/s]`; leave it out.")
        if given and means:
            raise ValueError(
                f"`{given[0]}` and `{means[0]}` belong to two different ways to describe a support; give "
                "coefficients (kxx, kxy, kyx, kyy, cxx, cxy, cyx, cyy, or both matrices), or means and "
                "axes (stiffness, damping, anisotropy, ..)."
            )
        if self.stiffness is None and self.kxx is None:
            raise ValueError(
                "A support needs a stiffness; give `kxx [N/m]`, and kyy if it differs, kxy and kyx, or "
                "`stiffness [N/m]`; 0 if it has none."
            )
        check_whole(own)
        direct = [self.cxx, self.cxx if self.cyy is None else self.cyy]
        if self.cxx is not None and all(map(known, direct)) and self.frequencies is None:
            # Over whirl, damping may be of either sign.
            least = np.min(sum(map(np.asarray, direct)))
            label = "cxx + cyy [N s/m]"
            check(least, label, lambda x: x >= 0, "must not be negative")
        for name in ("damping_anisotropy [1]", "cross_damping [N s/m]"):
            if self.damping is None and getattr(self, name.partition(" ")[0]) is not None:
                raise ValueError(
                    f"`{name}` goes with `damping [N s/m]`; give that too, 0 if there is none."
                )
        for axis, (share, *others) in {
            "angle": ("anisotropy", "damping_anisotropy"),
            "damping_angle": ("damping_anisotropy",),
        }.items():
            if getattr(self, axis) is not None and all(
                getattr(self, name) is None for name in (share, *others)
            ):
                raise ValueError(f"`{axis} [rad]` belongs to `{share} [1]`; give both or neither.")

    def _check_ends(self) -> None:
        """Raise unless the support has one end that moves and another one to stand on."""
        if (self.at is None) == (self.of is None):
            raise ValueError(
                "A support holds the shaft at a station, `at [m]`, or a casing by its name, `of`; give "
                "one of the two, and by `on` the name of a casing on which it stands."
            )
        if self.of is None:
            return
        if self.on == self.of:
            raise ValueError(f"The casing {self.of!r} cannot stand on itself; leave out `on`.")
        if self.rotating or not (self.angular_stiffness is None and self.angular_damping is None):
            raise ValueError(
                f"A casing does not turn or tilt, but the support of {self.of!r} is `rotating`, or has "
                "`angular_stiffness [N m/rad]` or `angular_damping [N m s/rad]`; leave these out."
            )

    @property
    def _tables(self) -> dict[str, Any]:
        """Coefficients that are tables, by their names."""
        own = {name: getattr(self, name) for name in COEFFICIENTS}
        return {name: value for name, value in own.items() if is_table(value)}

    @property
    def reason_between(self) -> str | None:
        if self.speeds is None or self.speeds_of is not None:
            return None
        return (
            'and its tables need `speeds_of`: "difference" of both, as of balls, "sum", as of a film, or '
            '"first", that of the first shaft'
        )

    def at_speed(self, speed: ArrayLike) -> "Support":
        there = self if self.speeds is None else self._at(self.read_at(speed), "speeds")
        return there.at_whirl(jnp.abs(jnp.asarray(speed))) if self.synchronous else there

    def at_whirl(self, frequency: ArrayLike) -> "Support":
        return self if self.frequencies is None else self._at(frequency, "frequencies")

    def _at(self, place: ArrayLike, over: str) -> "Support":
        """The support with its coefficients at a place of the tables over "speeds" or "frequencies"."""
        tables = self._tables
        place, nodes = jnp.asarray(place, float), jnp.asarray(getattr(self, over))
        if self.hold:
            place = bounded(place, nodes[0], nodes[-1])
        axis = 0 if over == "speeds" else -1
        values = jnp.stack([jnp.moveaxis(table, axis, -1) for table in tables.values()])
        read = INTERPOLATIONS[self.interpolation]
        found = read(place, nodes, values.reshape(-1, nodes.size)).reshape(values.shape[:-1])
        numbers: dict[str, Any] = dict(zip(tables, found, strict=True))
        dropped = {over: None} | ({"speeds_of": None} if over == "speeds" else {})
        return with_values(self, **dropped, **numbers)

    def refreshed(self) -> "Support":
        """Copy whose `vanishing` parts are derived from its current values."""
        return with_values(self, vanishing=tuple(self._vanishing()))

    @property
    def mean_stiffness(self) -> Tabled:
        """Mean stiffness `(kxx + kyy) / 2` [N/m], of a table at its nodes."""
        return self._parts("stiffness").mean

    @property
    def direct(self) -> tuple[Tabled, Tabled]:
        """Direct stiffnesses kxx and kyy [N/m], of a table at its nodes."""
        kxx, _, _, kyy = self._parts("stiffness").matrix
        return kxx, kyy

    @property
    def coefficients(self) -> dict[str, Tabled]:
        """All of `kxx` .. `kyy` [N/m] and `cxx` .. `cyy` [N s/m], whichever way they were given."""
        own = [value for name in LETTERS for value in self._parts(name).matrix]
        return dict(zip(COEFFICIENTS, own, strict=True))

    @property
    def turns_section(self) -> bool:
        return type(self) is not Support or self._holds_slope

    @property
    def _holds_slope(self) -> bool:
        return self.angular_stiffness is not None or self.angular_damping is not None

    def ends_on(self, line: AbstractLine) -> Ends:
        displaced = ends(line, self.at if self.of is None else self.of, self.on)
        if not self._holds_slope:
            return Ends(*displaced)
        return Ends(*displaced, *slope_ends(line, self.at, self.on))

    def blocks_between(self, ends: Ends) -> Blocks:
        force = jnp.outer(ends.column, ends.row)
        spring, damper = (
            {part: value if value is None else value * force for part, value in own.items()}
            for own in map(self._present, LETTERS)
        )
        stiffness, damping = spring["mean"], damper["mean"]
        if ends.slope_row is not None and ends.couple_column is not None:
            couple = jnp.outer(ends.couple_column, ends.slope_row)
            if self.angular_stiffness is not None:
                stiffness = (
                    0.0 if stiffness is None else stiffness
                ) + self.angular_stiffness * couple
            if self.angular_damping is not None:
                damping = (0.0 if damping is None else damping) + self.angular_damping * couple
        frame = "rotating" if self.rotating else "fixed"
        return Blocks(
            inertia=None if self.mxx is None else self.mxx * force,
            stiffness=stiffness,
            damping=damping,
            circulatory=damping if self.rotating else None,
            skew_stiffness=spring["cross"],
            skew_damping=damper["cross"],
            skew_circulatory=damper["cross"] if self.rotating else None,
            **{
                f"{frame}_stiffness": spring["deviator"],
                f"{frame}_damping": damper["deviator"],
            },
        )

    def deviator(self, line: AbstractLine) -> Deviator | None:
        parts = [self._present(name)["deviator"] for name in LETTERS]
        if self.rotating or parts == [None, None]:
            return None
        law = DeviatorLaw(*(None if part is None else plane(part + 0j) for part in parts))
        return Deviator(*self.ends_on(line)[:2], law)

    def _present(self, name: str) -> dict[str, Any]:
        """Parts of the stiffness or the damping, None where they are known to be zero."""
        parts = self._parts(name)._asdict()
        return {
            part: None if f"{name} {part}" in self.vanishing else value
            for part, value in parts.items()
        }

    def _store_matrix(self, matrix: Any, name: str, letter: str) -> None:
        """Store a matrix as its coefficients."""
        if any(getattr(self, letter + axes) is not None for axes in AXES):
            raise ValueError(
                f"`{name}` is a matrix of {letter}xx, {letter}xy, {letter}yx and {letter}yy, which are "
                "given too; leave out one of them."
            )
        own = np if all(map(known, jax.tree.leaves(matrix))) else jnp
        try:
            matrix = own.asarray(matrix, float)
        except (TypeError, ValueError):
            raise ValueError(
                f"`{name}` must be a number or a 2 by 2 matrix of numbers, but is {matrix!r}."
            ) from None
        if matrix.shape != (2, 2):
            raise ValueError(
                f"`{name}` must be a 2 by 2 matrix, [[{letter}xx, {letter}xy], [{letter}yx, "
                f"{letter}yy]], but has shape {matrix.shape}."
            )
        for axes, value in zip(AXES, matrix.ravel(), strict=True):
            setattr(self, letter + axes, value)
        setattr(self, name, None)

    def _vanishing(self) -> Iterator[str]:
        """Names of the parts of `_parts` that are known to be zero, such as "stiffness cross"."""
        for name in LETTERS:
            own = self._matrix(name)
            if any(value is not None for value in own):
                cross, deviator = vanishing(*own)
            else:
                share = self.anisotropy if name == "stiffness" else self.damping_anisotropy
                cross, deviator = is_zero(getattr(self, f"cross_{name}")), is_zero(share)
            yield from [f"{name} cross"] * cross
            yield from [f"{name} deviator"] * deviator

    def _matrix(self, name: str) -> list[Any]:
        """The coefficients xx, xy, yx and yy that are given, the others None."""
        return [getattr(self, LETTERS[name] + axes) for axes in AXES]

    def _parts(self, name: str) -> Parts:
        """Parts of the stiffness or the damping, whichever way they were given."""
        own = self._matrix(name)
        if own[0] is not None:
            return Parts.of_matrix(*own)
        if name == "stiffness":
            share, angle = self.anisotropy, self.angle
        else:
            share = self.damping_anisotropy
            angle = self.angle if self.damping_angle is None else self.damping_angle
        mean, deviator = getattr(self, name), None
        if mean is not None and share is not None:
            deviator = mean * share * jnp.exp(2j * (0.0 if angle is None else angle))
        return Parts(mean, getattr(self, f"cross_{name}"), deviator)
