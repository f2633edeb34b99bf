"""Operating line of a machine of several shafts, and its critical speeds by the unbalance of one of them.

    w = Omega_k:  det( K + w (Sum c_j G_j - c_k / r_k Sum r_j G_j) - w^2 (M - Sum r_j G_j / r_k) ) = 0

`Omega_j = r_j Omega + c_j` are the speeds of the shafts and `G_j` their gyroscopic blocks. Where `c` is
not zero, `-w` is no solution with `w`. A shaft whose speed does not depend on `Omega` meets the roots at
speeds `Omega` of the first one: `det( K - c_k^2 M + c_k (Sum c_j G_j + Omega Sum r_j G_j) ) = 0`.
"""

from collections.abc import Sequence

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from ..core import linalg
from ..core.quantities import Scalar, known
from ..effects.base import AbstractCoaxial, AbstractOverSpeed
from ..equations.parts import excess_gyroscopic
from ..equations.pencil import Pencil, eigenvalues, unequal_parts
from ..equations.system import System
from ..scene import Scene
from .synchronous import families, filled, synchronous_of


class OperatingLine(eqx.Module):
    """`Omega_j = r_j Omega + c_j` of every shaft, and the shaft by which critical speeds are counted."""

    ratios: Float[Array, " j"]
    speeds: Float[Array, " j"]  # [rad/s]
    shafts: tuple[str, ...] = eqx.field(static=True)
    by: int = eqx.field(static=True)  # number of the shaft
    tied: bool = eqx.field(static=True)  # whether its speed depends on that of the first one

    @classmethod
    def of(cls, scene: Scene, by: str | None) -> "OperatingLine | None":
        """The line of a scene; None where it has one shaft. Raises unless `by` is one of its shafts."""
        check_shaft(by, scene.shafts)
        if not scene.shafts:
            return None
        beside = scene.of(AbstractCoaxial)
        number = 0 if by is None else scene.shafts.index(by)
        ratio = beside[number - 1].ratio if number else 1.0
        ratios = jnp.stack([jnp.ones(()), *(one.ratio for one in beside)])
        zero = jnp.zeros(())
        speeds = jnp.stack([zero, *(zero if s.speed is None else s.speed for s in beside)])
        tied = not known(ratio) or float(ratio) != 0
        if not tied and known(speeds) and float(speeds[number]) == 0:
            raise ValueError(
                f"The shaft {by!r} does not turn (its ratio and speed are zero), so its unbalance has no "
                "critical speed."
            )
        tables = scene.of(AbstractOverSpeed)
        if number and any(one.synchronous or one.nodes_over_whirl is not None for one in tables):
            raise ValueError(
                "Unbalance of another shaft than the first one whirls at another frequency than that at "
                "which tables over whirl are read; give their numbers at one frequency, "
                "`support.at_whirl(frequency)`."
            )
        return cls(ratios, speeds, scene.shafts, number, tied)

    def at(self, speeds: Float[Array, " c"]) -> Float[Array, "c j"]:
        """Speeds of all shafts [rad/s], by those of the shaft `by`, or of the first if it is not tied."""
        ratio, own = self.ratios[self.by], self.speeds[self.by]
        first = (speeds - own) / ratio if self.tied else speeds
        return first[:, None] * self.ratios + self.speeds

    def sense(self, first: Scalar) -> Scalar:
        """-1 where the shaft `by` turns backward while the first one has a speed [rad/s], else 1."""
        own = self.ratios[self.by] * first + self.speeds[self.by]
        return jnp.where(own < 0, -1.0, 1.0)


def check_shaft(by: str | None, shafts: Sequence[str]) -> None:
    """Raise unless `by` is the name of one of several shafts, or None."""
    if by is not None and by not in shafts:
        has = f"its shafts are {', '.join(shafts)}" if shafts else "it has one shaft"
        raise ValueError(f"`by` must be the name of a shaft of the scene, but is {by!r}; {has}.")


def check_first(scene: Scene, system: System, line: OperatingLine) -> None:
    """Raise unless unequal axes or tables leave critical speeds by the first shaft, from rest on."""
    if line.by or any(one.speed is not None for one in scene.of(AbstractCoaxial)):
        parts = "coefficients are tables over the speed"
        if system.tabled is None:
            parts = f"the axes of {unequal_parts(system)} are unequal"
        raise ValueError(
            "Critical speeds by another shaft than the first one, and along an operating line that does "
            "not begin at rest, are for a rotor that is the same along every axis and at every speed, but "
            f"{parts}; look at `jaxrotor.campbell(..).crossings(by=..)`."
        )


def whirls_by(
    scene: Scene, system: System, line: OperatingLine
) -> tuple[Float[Array, " c"], Int[Array, " c"]]:
    """Critical speeds by the unbalance of a shaft, and 0 of forward, 1 of backward whirl; unordered.

    Speeds are those of the shaft, in its sense, or of the first shaft where it is not tied to that.
    Infinite ones fill up.
    """
    ratio, own = line.ratios[line.by], line.speeds[line.by]
    part, blocks = filled(system, float), system.blocks
    excess = excess_gyroscopic(scene, system.line)
    sense = line.sense(system.spin.speed)
    if excess is None:
        scaled = lambda s: s.blocks.gyroscopic
        if blocks.gyroscopic is not None:
            system = eqx.tree_at(scaled, system, blocks.gyroscopic / ratio)
        found = [synchronous_of(*one)[0] for one in families(system)]
        family = jnp.repeat(jnp.arange(len(found)), found[0].size)
        speeds = jnp.concatenate(found)
        return jnp.where(jnp.isfinite(speeds), sense * speeds, jnp.inf), family
    stiffness, inertia, gyroscopic = map(
        part, (blocks.stiffness, blocks.inertia, blocks.gyroscopic)
    )
    if line.tied:
        slope = excess - own / ratio * gyroscopic
        found = [
            _quadratic(stiffness, s * slope, inertia - s * gyroscopic / ratio) for s in (1, -1)
        ]
        found = [jnp.where(jnp.sign(one) == sense, one, jnp.inf) for one in found]
    else:
        constant = stiffness - own**2 * inertia
        found = [_linear(constant + s * own * excess, s * own * gyroscopic) for s in (1, -1)]
    return jnp.concatenate(found), jnp.repeat(jnp.arange(2), found[0].size)


def _quadratic(stiffness: Array, slope: Array, inertia: Array) -> Float[Array, " c"]:
    """Every real `w` with `det( K + w A - w^2 N ) = 0`, as a root `i w` of a pencil; else infinite."""
    found = eigenvalues(Pencil(inertia, -1j * slope, stiffness + 0j))
    return _real(-1j * found)


def _linear(stiffness: Array, slope: Array) -> Float[Array, " c"]:
    """Every real `Omega` with `det( K + Omega A ) = 0`, where `A` may be of low rank; else infinite."""
    inverses = linalg.eigvals(linalg.solve(stiffness, -slope))
    sizes = jnp.abs(inverses)
    there = sizes > 1e-10 * jnp.max(sizes)
    return _real(jnp.where(there, 1 / jnp.where(there, inverses, 1.0), jnp.inf))


def _real(values: Array) -> Float[Array, " c"]:
    """Values that are real within rounding, others infinite."""
    finite = jnp.isfinite(values) & (jnp.abs(values) > 0)
    real = finite & (jnp.abs(values.imag) < 1e-6 * jnp.abs(values))
    return jnp.where(real, jnp.where(real, values, 1.0).real, jnp.inf)
