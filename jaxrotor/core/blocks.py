"""Linear blocks: what shafts and effects add to the equations of motion."""

import dataclasses
from typing import Any

import equinox as eqx
from jaxtyping import Array, Complex, Float

from .quantities import Number, Scalar


class Blocks(eqx.Module):
    """`M q.. + (C - i Omega G) q. + (K - i Omega H) q`; a uniform acceleration `a` adds `weight a`.

    There is one row per coordinate (`r = n`), in the units of the equations, or one row per virtual
    displacement. None means that a block is absent and leaves no trace in the compiled program. Blocks
    of several parts are added. The further terms are:

    - cross-coupling: `i skew_damping q. + i skew_stiffness q`; a cross-coupled damper that turns with
      the shaft, `i skew_circulatory (q. - i Omega q)`, also adds `Omega skew_circulatory q`,
    - anisotropy in fixed axes: `fixed_damping q*. + fixed_stiffness q*`, with the conjugate `q*`,
    - anisotropy in axes that turn with the shaft, `q = r exp(i Omega t)`: the equations of `r` get
      `rotating_damping r*. + rotating_stiffness r*`,
    - weight on what turns with the shaft: `weight_twice a* exp(2 i theta)`,
    - `polar` [kg m^2]: the moment of inertia about the axis, needed where rotation is integrated,
    - hysteresis: `i eta_s hysteretic q`, where eta_s is +1 if the motion whirls faster than the shaft
      turns, else -1. It is defined for harmonic motions only.
    """

    inertia: Float[Array, "r n"] | None = None
    damping: Float[Array, "r n"] | None = None
    gyroscopic: Float[Array, "r n"] | None = None
    stiffness: Float[Array, "r n"] | None = None
    circulatory: Float[Array, "r n"] | None = None
    weight: Float[Array, " r"] | None = None
    weight_twice: Complex[Array, " r"] | None = None
    skew_damping: Float[Array, "r n"] | None = None
    skew_stiffness: Float[Array, "r n"] | None = None
    skew_circulatory: Float[Array, "r n"] | None = None
    fixed_damping: Complex[Array, "r n"] | None = None
    fixed_stiffness: Complex[Array, "r n"] | None = None
    rotating_damping: Complex[Array, "r n"] | None = None
    rotating_stiffness: Complex[Array, "r n"] | None = None
    hysteretic: Float[Array, "r n"] | None = None
    polar: Scalar | None = None

    def __add__(self, other: "Blocks") -> "Blocks":
        return Blocks(*(_add(getattr(self, name), getattr(other, name)) for name in _parts(self)))

    def of_shaft(self, ratio: Scalar, excess: Scalar | None) -> "Blocks":
        """These blocks of a shaft that turns at `ratio Omega + excess`, as of one that turns at `Omega`.

        None: an excess of zero. Raises where unequal axes turn with the shaft, or it has hysteresis.
        """
        if self.hysteretic is not None:
            raise ValueError(
                "HystereticDamping is known for scenes of one shaft alone; take InternalDamping."
            )
        if any(name.startswith("rotating_") for name in self.present):
            raise ValueError(
                "Unequal axes may turn with the first shaft of a scene alone; make those of the others "
                "equal, or name their shaft first."
            )
        scaled = lambda part, factor: None if part is None else factor * part
        own = dataclasses.replace(
            self,
            gyroscopic=scaled(self.gyroscopic, ratio),
            circulatory=scaled(self.circulatory, ratio),
            skew_circulatory=scaled(self.skew_circulatory, ratio),
            polar=scaled(self.polar, ratio**2),
        )
        if excess is None:
            return own
        return own + Blocks(
            skew_damping=scaled(self.gyroscopic, -excess),
            skew_stiffness=scaled(self.circulatory, -excess),
            stiffness=scaled(self.skew_circulatory, excess),
        )

    @property
    def present(self) -> list[str]:
        """Names of the blocks that are not absent."""
        return [name for name in _parts(self) if getattr(self, name) is not None]


class Load(eqx.Module):
    """External load; None means absent.

        constant + (Omega^2 + i Omega. / 2) carried
        + (Omega^2 - i Omega.) unbalance exp(i theta)
        + (twice + (Omega^2 - i Omega. / 2) carried_twice) exp(2 i theta)

    What adds a part at `2 theta`, or one that is `carried`, adds rotating blocks, too, if only zeros: both
    are known in the axes of the shaft, where a load at 0 and one at `2 theta` go round at `-Omega` and
    `Omega`. `gravity` is the acceleration due to gravity, for bodies that have coordinates of their own.
    `twist` is a torque `Im(twist exp(2 i theta))` on the shaft, beside those of the forces.
    """

    constant: Complex[Array, " r"] | None = None
    unbalance: Complex[Array, " r"] | None = None
    gravity: Complex[Array, ""] | None = None
    twice: Complex[Array, " r"] | None = None
    carried: Complex[Array, " r"] | None = None
    carried_twice: Complex[Array, " r"] | None = None
    twist: Complex[Array, ""] | None = None

    def __add__(self, other: "Load") -> "Load":
        return Load(*(_add(getattr(self, name), getattr(other, name)) for name in _parts(self)))

    def unbalance_force(
        self, speed: Number, acceleration: Number | None = None
    ) -> Complex[Array, "r ..."] | None:
        """`(Omega^2 - i Omega.) unbalance` in axes that rotate with the shaft; None where absent.

        Without `acceleration` the speed is constant.
        """
        if self.unbalance is None:
            return None
        return unbalance_factor(speed, acceleration) * self.unbalance

    @property
    def present(self) -> list[str]:
        """Names of the loads that are not absent."""
        return [name for name in _parts(self) if getattr(self, name) is not None]

    @property
    def steady(self) -> bool:
        """Whether there are loads other than unbalance."""
        return self.constant is not None or self.carried is not None

    def still_force(
        self, speed: Number, acceleration: Number | None = None
    ) -> Complex[Array, "r ..."] | None:
        """Load that stands still in fixed axes; None where absent."""
        if self.carried is None:
            return self.constant
        return _add(self.constant, _carried(speed, acceleration, 1) * self.carried)

    def twice_force(
        self, speed: Number, acceleration: Number | None = None
    ) -> Complex[Array, "r ..."] | None:
        """Load at twice the angle of rotation, by which it is divided here; None where absent."""
        if self.carried_twice is None:
            return self.twice
        return _add(self.twice, _carried(speed, acceleration, -1) * self.carried_twice)


def _carried(speed: Any, acceleration: Any, sense: int) -> Any:
    """`Omega^2 + sense i Omega. / 2`."""
    return speed**2 if acceleration is None else speed**2 + sense * 0.5j * acceleration


def unbalance_factor(speed: Any, acceleration: Any = None) -> Any:
    """`Omega^2 - i Omega.`, the force of a unit of unbalance; without `acceleration` at constant speed."""
    return speed**2 if acceleration is None else speed**2 - 1j * acceleration


def _parts(module: eqx.Module) -> list[str]:
    return [field.name for field in dataclasses.fields(module)]


def _add(a: Array | None, b: Array | None) -> Array | None:
    if a is None or b is None:
        return b if a is None else a
    return a + b
