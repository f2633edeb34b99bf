"""Annular rub: the synchronous whirl of a rotor that slides along its ring all the way round."""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Complex, Float

from ..core import linalg
from ..core.compiled import compiled_quickly
from ..core.quantities import Scalar, known
from ..core.roots import implicit_root, sign_change
from ..core.tables import notebook_table
from ..effects import AnnularStator
from ..equations.other_unbalance import force_of
from ..equations.pencil import eigenvalues
from ..equations.start import Continued
from ..equations.system import System, assemble
from ..scene import Scene
from ..spins.base import sense_of
from .linearized import check_linear
from .operating_line import OperatingLine
from .ring import RotorInRing, ring_of, sorted_roots


class AnnularRub(eqx.Module):
    """Full rubs at `k` speeds, upper branch first; NaN where a branch does not exist.

    Without contact the rotor whirls by `free`, which is possible where that is within the gap.
    """

    speeds: Float[Array, " k"]  # Omega [rad/s]
    rates: Float[Array, " k"]  # of whirl, Omega of the shaft whose unbalance acts [rad/s]
    gap: Scalar  # [m]
    free: Complex[Array, " k"]  # displacement without force of the ring, at rotation angle 0 [m]
    free_growth: Float[Array, " k"]  # largest real part of the roots without contact [1/s]
    normal_force: Float[Array, "k 2"]  # [N]
    displacement: Complex[Array, "k 2"]  # relative to the ring, at rotation angle 0 [m]
    roots: Complex[Array, "k 2 m"]  # in turning axes [rad/s]; largest growth first
    coordinates: Complex[Array, "k 2 n"]  # at rotation angle 0 [m]
    # Speeds at which the free whirl grows up to the gap or falls to it [rad/s]
    onsets: Float[Array, " o"]
    folds: Float[Array, " f"]  # speeds at which both branches merge [rad/s]
    fold_radius: Float[Array, " f"]  # [m]

    def _repr_html_(self) -> str:
        rows = [
            (self.speeds[i], name, self.radius[i, j], self.normal_force[i, j], self.growth[i, j])
            for i in range(self.speeds.size)
            for j, name in enumerate(("upper", "lower"))
            if bool(self.exists[i, j])
        ]
        heads = ("speed [rad/s]", "branch", "radius [m]", "normal force [N]", "growth [1/s]")
        return notebook_table("Synchronous full rub", heads, rows)

    @property
    def radius(self) -> Float[Array, "k 2"]:
        """Radius of the whirl at the ring [m]."""
        return jnp.abs(self.displacement)

    @property
    def phase(self) -> Float[Array, "k 2"]:
        """Lead of the whirl at the ring over the rotation of the shaft whose unbalance acts [rad]."""
        return jnp.angle(self.displacement)

    @property
    def growth(self) -> Float[Array, "k 2"]:
        """Largest real part of the roots [1/s]."""
        return self.roots[..., 0].real

    @property
    def exists(self) -> Bool[Array, "k 2"]:
        """Whether there is a full rub of this branch."""
        return jnp.isfinite(self.normal_force)

    @property
    def stable(self) -> Bool[Array, "k 2"]:
        """Whether it exists and small motions about it decay."""
        return self.exists & (self.growth < 0)

    def start(self, case: int = 0, branch: int = 0) -> Continued:
        """State on the orbit at a rotation angle of zero, from which to simulate or seek an orbit.

        Args:
            case: index of the speed, which the scene of the motion must have.
            branch: 0 for the upper branch, 1 for the lower.

        Returns:
            A start for `jaxrotor.simulate`, `periodic` and the like.
        """
        q = self.coordinates[case, branch]
        return Continued(q, 1j * self.rates[case] * q)


def annular_rub(scene: Scene, speeds=None, by: str | None = None) -> AnnularRub:
    """`|g + N q| = |z_free|`, `q = 1/k + H (1 + i f)`: synchronous full rubs, without time stepping.

    `H` is the receptance of the rotor at the ring for a force that turns with the shaft, with that of the
    casing on which the ring may stand, and `z_free` its unbalance response without the ring. The equation
    is quadratic in the normal force `N`, so two rubs may coexist; they merge where
    `|z_free| |q| = g |Im q|`, the fold. The damping of the ring does not act in a circular whirl, but on
    small motions about it. The sharp law is taken: `blend` and `slip` of the ring have no effect here, as
    they have none where depth and slip exceed them. Of several shafts the unbalance of one whirls the
    rotor at its speed, and that of the others is left out; `V` has the speed of the shaft in the ring,
    and a rub exists where it has the sign of that of the rim at the gap.

    Args:
        scene: a rotor that is the same along every axis, in one `AnnularStator` on its axis.
        speeds: one or more speeds [rad/s], by default the scene's own. Onsets and folds are found
            between neighbours, each to rounding. Of several shafts those of the first one.
        by: name of the shaft whose unbalance acts, where there are several, by default the first one.

    Returns:
        `AnnularRub`, differentiable but at onsets and folds themselves, whose speeds are differentiable.
        Where traced, onsets and folds have a place for every interval, NaN where there is none.

    Raises:
        ValueError: the scene has another contact, unequal axes, weight, balls or hysteretic damping, or
            the ring has an offset or no stiffness.

    Source: Black (1968), J. Mech. Eng. Sci. 10, pp. 1-12.
    """
    ring = ring_of(scene, "A full rub")
    check_linear(scene, speeds)
    cases = jnp.atleast_1d(jnp.asarray(scene.spin.speed if speeds is None else speeds, float))
    line = OperatingLine.of(scene, by)
    found = _annular_rub(assemble(scene), ring, line, cases)
    if not (known(found.onsets) and known(found.folds)):
        return found
    ends = lambda found: (found.onsets, found.folds, found.fold_radius)
    finite = [jnp.asarray(part[np.isfinite(part)]) for part in map(np.asarray, ends(found))]
    return eqx.tree_at(ends, found, tuple(finite))


@compiled_quickly
def _annular_rub(
    system: System, ring: AnnularStator, line: OperatingLine | None, speeds: Float[Array, " k"]
) -> AnnularRub:
    rotor = system, ring, line

    def at(speed: Scalar) -> "_Synchronous":
        return _Synchronous.of(*rotor, speed)

    def one(speed: Scalar):
        whirl = at(speed)
        return (
            whirl.rate,
            whirl.free,
            jnp.max(_finite(eigenvalues(whirl.rotor.pencil).real)),
            *jax.vmap(whirl.branch)(jnp.array([1.0, -1.0])),
        )

    rates, *found = jax.lax.map(one, speeds)
    onsets, _ = _crossings(lambda one: one.beyond, rotor, speeds)
    folds, merges = _crossings(lambda one: one.discriminant, rotor, speeds)
    # Where the discriminant vanishes with a negative force, no branch in contact ends.
    force = jax.lax.map(lambda speed: at(speed).merged, jnp.where(merges, folds, speeds[0]))
    folds = jnp.where(force >= 0, folds, jnp.nan)
    radius = jnp.where(force >= 0, ring.gap + force / ring.stiffness, jnp.nan)
    parts: Any = rates, ring.gap, *found, onsets, folds, radius
    return AnnularRub(speeds, *parts)


def _finite(values: Array) -> Array:
    return jnp.where(jnp.isfinite(values), values, -jnp.inf)


class _Synchronous(eqx.Module):
    """Responses at one speed that determine the full rubs there."""

    rotor: RotorInRing
    whole: Complex[Array, " n"]  # response to the unbalance [m]
    unit: Complex[Array, " n"]  # response to a unit force at the ring [m/N]
    free: Complex[Array, ""]  # z_free [m]
    compliance: Complex[Array, ""]  # q [m/N]
    rate: Scalar  # of the whirl [rad/s]
    friction: Scalar  # of the sign of the slip

    @classmethod
    def of(
        cls, system: System, ring: AnnularStator, line: OperatingLine | None, speed: Scalar
    ) -> "_Synchronous":
        system = system.at_speed(speed)
        rotor, rate = RotorInRing.of(system, ring), speed
        if line is not None:
            rate = line.ratios[line.by] * speed + line.speeds[line.by]
        if line is None or not line.by:
            force = system.load.unbalance_force(speed)
        else:
            force = force_of(line.shafts[line.by], system.others, speed)
        force = jnp.zeros(system.n, complex) if force is None else force
        both = jnp.stack([force, rotor.column + 0j], axis=1)
        whole, unit = linalg.solve(rotor.pencil.dynamic(rate), both).T
        friction = ring.friction * sense_of(rotor.rim + rate * ring.gap)
        compliance = 1 / ring.stiffness + rotor.row @ unit * (1 + 1j * friction)
        return cls(rotor, whole, unit, rotor.row @ whole, compliance, rate, friction)

    @property
    def beyond(self) -> Scalar:
        """`|z_free|^2 - g^2`: positive where the free whirl would cross the ring [m^2]."""
        return jnp.abs(self.free) ** 2 - self.rotor.ring.gap**2

    @property
    def discriminant(self) -> Scalar:
        """`(|z_free| |q|)^2 - (g Im q)^2` over `|q|^2`: negative where there is no full rub [m^2]."""
        q = self.compliance
        size = q.real**2 + q.imag**2
        return jnp.abs(self.free) ** 2 - (self.rotor.ring.gap * q.imag) ** 2 / size

    @property
    def merged(self) -> Scalar:
        """Normal force midway between the branches, and of both where they merge [N]."""
        q = self.compliance
        return -self.rotor.ring.gap * q.real / (q.real**2 + q.imag**2)

    def branch(self, sign: Scalar):
        """Normal force, displacement at the ring, roots and coordinates of a branch."""
        ring, q = self.rotor.ring, self.compliance
        size = q.real**2 + q.imag**2
        under = self.discriminant
        root = jnp.sqrt(jnp.where(under > 0, under, 1.0) * size)
        normal = self.merged + sign * root / size
        slip = self.rotor.rim + self.rate * (ring.gap + normal / ring.stiffness)
        exists = (under > 0) & (normal >= 0) & (slip * self.friction >= 0)
        held = jnp.where(exists, normal, 0.0)
        ahead = self.free / (ring.gap + jnp.where(exists, normal, 1.0) * q)
        coordinates = self.whole - self.unit * held * (1 + 1j * self.friction) * ahead
        motion = self.rotor.linearised(self.rate, held, self.friction)
        roots = sorted_roots(motion, neutral=False)
        displacement = (ring.gap + held / ring.stiffness) * ahead
        found = normal, displacement, roots, coordinates
        return tuple(jnp.where(exists, part, jnp.nan) for part in found)


def _crossings(
    measure: Callable[[_Synchronous], Scalar],
    rotor: tuple[System, AnnularStator, OperatingLine | None],
    speeds: Float[Array, " k"],
) -> tuple[Float[Array, " i"], Bool[Array, " i"]]:
    """Zeros of a measure between neighbouring speeds, NaN where it has none, and where it has some."""
    own = lambda speed: measure(_Synchronous.of(*rotor, speed))
    still, speeds = jax.lax.stop_gradient((rotor, speeds))
    held = lambda speed: measure(_Synchronous.of(*still, speed))
    values = jax.lax.map(held, speeds)
    pairs = [jnp.stack([part[:-1], part[1:]], axis=1) for part in (speeds, values)]
    order = jnp.argsort(pairs[0], axis=1)  # speeds may descend
    ends, at_ends = (jnp.take_along_axis(pair, order, axis=1) for pair in pairs)
    changes = (at_ends[:, 0] < 0) != (at_ends[:, 1] < 0)

    def zero(ends: Array, at_ends: Array) -> Scalar:
        return sign_change(held, *ends, *at_ends, rises=at_ends[0] < 0)

    one = lambda case: jax.lax.cond(case[0], zero, lambda ends, _: ends[0], *case[1:])
    found = jax.lax.map(one, (changes, ends, at_ends))
    found = jax.lax.map(lambda root: implicit_root(own, root), found)
    return jnp.where(changes, found, jnp.nan), changes
