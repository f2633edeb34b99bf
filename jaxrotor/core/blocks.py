"""Linear blocks: what shafts and effects add to the equations of motion."""

import dataclasses

import equinox as eqx
from jaxtyping import Array, Complex, Float

from .quantities import Scalar


class Blocks(eqx.Module):
    """`M q.. + (C - i Omega G) q. + (K - i Omega H) q`, a uniform acceleration `a` adding `weight a`.

    `r` = `n` rows in the equations' own units, one a coordinate, or `r` virtual works; None means absent
    and leaves no trace in the compiled program. Blocks add. Beyond these,

    - cross-coupling adds `i skew_damping q. + i skew_stiffness q`, and where its damper turns with the
      shaft, `i skew_circulatory (q. - i Omega q)`, also `Omega skew_circulatory q`,
    - what is not the same in x and y adds `fixed_damping q*. + fixed_stiffness q*` (q* conjugate),
    - the same in axes that turn with the shaft, `q = r exp(i Omega t)`, adds to the equations of `r`
      `rotating_damping r*. + rotating_stiffness r*`,
    - `polar` [kg m^2] is the moment of inertia about the axis, which a free rotation needs,
    - hysteresis adds `i eta_s hysteretic q`, where eta_s is +1 for a motion that whirls faster than
      the shaft turns and -1 for one that does not: it is known for harmonic motions only.
    """

    inertia: Float[Array, "r n"] | None = None
    damping: Float[Array, "r n"] | None = None
    gyroscopic: Float[Array, "r n"] | None = None
    stiffness: Float[Array, "r n"] | None = None
    circulatory: Float[Array, "r n"] | None = None
    weight: Float[Array, " r"] | None = None
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

    @property
    def present(self) -> list[str]:
        """Names of the blocks that are not absent."""
        return [name for name in _parts(self) if getattr(self, name) is not None]


class Load(eqx.Module):
    """External load `constant + (Omega^2 - i Omega.) unbalance exp(i theta)`; None means absent.

    `gravity` is the acceleration behind weight, for bodies that have coordinates of their own.
    """

    constant: Complex[Array, " r"] | None = None
    unbalance: Complex[Array, " r"] | None = None
    gravity: Complex[Array, ""] | None = None

    def __add__(self, other: "Load") -> "Load":
        return Load(*(_add(getattr(self, name), getattr(other, name)) for name in _parts(self)))

    def unbalance_force(
        self, speed: Scalar, acceleration: Scalar | None = None
    ) -> Complex[Array, " r"] | None:
        """`(Omega^2 - i Omega.) unbalance` in axes that rotate with the shaft; None where absent.

        Without `acceleration` the speed is constant.
        """
        if self.unbalance is None:
            return None
        factor = speed**2 if acceleration is None else speed**2 - 1j * acceleration
        return factor * self.unbalance


def _parts(module: eqx.Module) -> list[str]:
    return [field.name for field in dataclasses.fields(module)]


def _add(a: Array | None, b: Array | None) -> Array | None:
    if a is None or b is None:
        return b if a is None else a
    return a + b
