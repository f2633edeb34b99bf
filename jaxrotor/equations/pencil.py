"""Pencil of the linear equations, a quadratic in the growth rate, in axes of constant coefficients.

See docs/concepts/frames.md for the axes.
"""

import functools
from typing import Any, Literal

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Complex, Float, Inexact

from ..core import linalg
from ..core.blocks import Blocks
from ..core.extremes import larger
from ..core.quantities import Scalar
from .slowest import UNIT, slowest
from .system import System


Frame = Literal["fixed", "rotating", "periodic"]

ROUNDING = 1e-9  # relative to a root: a part or a distance this small counts as zero
BESIDE = 0.83  # shift to slow roots, over the estimate of the first natural frequency


def is_rounding(part: Any, root: Any) -> Any:
    """Whether a part of a root, or its distance from another, is zero within rounding."""
    return abs(part) <= ROUNDING * abs(root)


def isotropic(blocks: Blocks) -> bool:
    """Whether the equations are the same along every axis."""
    return not (_has(blocks, "fixed") or _has(blocks, "rotating"))


def frame(blocks: Blocks) -> Frame:
    """Axes in which the equations have constant coefficients; "periodic" where none do."""
    if _has(blocks, "rotating"):
        return "periodic" if _has(blocks, "fixed") else "rotating"
    return "fixed"


def _has(blocks: Blocks, axes: str) -> bool:
    return any(getattr(blocks, name) is not None for name in _unequal(axes))


def _unequal(*axes: str) -> list[str]:
    """Names of the blocks of unequal axes."""
    return [f"{one}_{name}" for one in axes for name in ("damping", "stiffness")]


def unequal_parts(system: System, *axes: str) -> str:
    """Names of the parts with unequal axes, "fixed" or "rotating" ones; by default all."""
    return system.owners_of(*_unequal(*(axes or ("fixed", "rotating"))))


def check_alike(system: System, what: str, instead: str) -> None:
    """Raise unless all axes are equal; the message says that `what` needs it, and to do `instead`."""
    if not isotropic(system.blocks):
        raise ValueError(
            f"{what} is for a rotor that is the same along every axis, but the axes of "
            f"{unequal_parts(system)} are unequal; {instead}."
        )


def check_axes(system: System, what: str, instead: str) -> None:
    """Raise unless there are axes of constant coefficients.

    The message goes on from `what`, a clause such as "There are no roots", and ends with `instead`.
    """
    if frame(system.blocks) == "periodic":
        still, turning = (unequal_parts(system, axes) for axes in ("fixed", "rotating"))
        raise ValueError(
            f"{what} where some unequal axes stand still ({still}) and others turn with the shaft "
            f"({turning}); {instead}."
        )


def check_circular(system: System) -> None:
    """Raise if there is hysteresis and whirl is not circular."""
    if system.blocks.hysteretic is not None and not isotropic(system.blocks):
        raise ValueError(
            f"Hysteretic damping ({system.owners_of('hysteretic')}) is defined for circular whirl only, "
            f"but the rotor is not the same along every axis ({unequal_parts(system)}); use "
            "InternalDamping in its place."
        )


def check_moves(system: System) -> None:
    """Raise if the axis is held fast, or nothing has a mass."""
    if not system.n:
        raise ValueError(
            "The rotor has nothing that moves but its angle, since its axis is held fast, so it has no "
            "whirl; use `jaxrotor.run_up` and `jaxrotor.reactions`."
        )
    if system.blocks.inertia is None:
        raise ValueError("The rotor has no mass, so it has no motion of its own; add a Disc.")


class Pencil(eqx.Module):
    """`P(lambda) = lambda^2 M + lambda C + K` of a motion `exp(lambda t)`, all linear forces included.

    An isotropic system has `n` complex coordinates `q = x + i y` in the fixed frame. Otherwise the
    unknowns are the pair `(q, q*)`, `m = 2n`, in the fixed frame or, where the unequal axes rotate with
    the shaft, in the rotating frame. `M` is never inverted: in a flexible shaft it has the eigenvalues
    of the flexibility, so that an inverse would cost the lowest modes their digits; besides,
    coordinates without mass are allowed.
    """

    inertia: Inexact[Array, "m m"]
    damping: Inexact[Array, "m m"]
    stiffness: Inexact[Array, "m m"]
    paired: bool = eqx.field(static=True, default=False)  # whether the unknowns are (q, q*)

    @classmethod
    def mean(cls, system: System, whirl: Scalar | int = 0) -> "Pencil":
        """Pencil of the isotropic part of a system: `n` coordinates in the fixed frame."""
        blocks, speed = system.blocks, system.spin.speed
        check_moves(system)
        zero = jnp.zeros((system.n, system.n), complex)
        part = lambda block: zero if block is None else block
        inertia = zero + part(blocks.inertia)
        damping = part(blocks.damping) + 1j * (
            part(blocks.skew_damping) - speed * part(blocks.gyroscopic)
        )
        elastic = part(blocks.stiffness) + speed * part(blocks.skew_circulatory)
        stiffness = elastic + 1j * (
            part(blocks.skew_stiffness)
            - speed * part(blocks.circulatory)
            + whirl * part(blocks.hysteretic)
        )
        return cls(inertia, damping, stiffness)

    @classmethod
    def of(cls, system: System, whirl: Scalar | int = 0) -> "Pencil":
        """Pencil of a system; `whirl` +1 or -1 adds the hysteresis of a faster or slower whirl."""
        blocks, speed = system.blocks, system.spin.speed
        own = cls.mean(system, whirl)
        if isotropic(blocks):
            return own
        axes = frame(blocks)
        check_axes(system, "There are no roots", "look at `jaxrotor.floquet_multipliers`")
        check_circular(system)
        inertia, damping, stiffness = own.inertia, own.damping, own.stiffness
        if axes == "rotating":
            stiffness = stiffness + 1j * speed * damping - speed**2 * inertia
            damping = damping + 2j * speed * inertia
        zero = jnp.zeros_like(inertia)
        part = lambda block: zero if block is None else block
        pair = lambda own, other: jnp.block([[own, other], [other.conj(), own.conj()]])
        return cls(
            pair(inertia, zero),
            pair(damping, part(getattr(blocks, f"{axes}_damping"))),
            pair(stiffness, part(getattr(blocks, f"{axes}_stiffness"))),
            paired=True,
        )

    @property
    def along_axes(self) -> "Pencil":
        """The pencil with pairs written as real unknowns `(x, y)`, `q = x + i y`: solved much faster."""
        if not self.paired:
            return self
        inertia, damping, stiffness = self.inertia, self.damping, self.stiffness
        return Pencil(_along_axes(inertia), _along_axes(damping), _along_axes(stiffness))

    @property
    def rate(self) -> Scalar:
        """Estimate of the first natural frequency [rad/s], by which time is scaled; 1 without stiffness.

        Each equation is divided by its stiffness, so that a stiff one without mass has no weight.
        """
        stiff = jnp.max(jnp.abs(self.stiffness), axis=1, keepdims=True)
        scaled = jnp.where(stiff > 0, self.inertia / jnp.where(stiff > 0, stiff, 1.0), 0.0)
        size = linalg.norm(scaled)
        return jax.lax.stop_gradient(1 / jnp.sqrt(jnp.where(size > 0, size, 1.0)))

    @property
    def shift(self) -> Scalar:
        """Shift [rad/s] to slow roots; of one mass beside its root `sqrt(-K / M)` where K < 0."""
        return self.rate if self.inertia.shape[0] > 2 else BESIDE * self.rate

    def at(self, root: Complex[Array, ""]) -> Complex[Array, "m m"]:
        """`P(root)`."""
        return root**2 * self.inertia + root * self.damping + self.stiffness

    def dynamic(self, frequency: Scalar) -> Complex[Array, "m m"]:
        """Dynamic stiffness `P(i frequency)`."""
        return self.stiffness + 1j * frequency * self.damping - frequency**2 * self.inertia

    def response(self, frequency: Scalar, force: Complex[Array, " m"]) -> Complex[Array, " m"]:
        """`q` of the steady motion `q exp(i frequency t)` under `force exp(i frequency t)`."""
        return linalg.solve(self.dynamic(frequency), force)

    def inverse(self, shift: Scalar) -> Inexact[Array, "m2 m2"]:
        """`(A - shift)^-1` of `(q, q.) = A (q, q.)`: its eigenvalues are `1 / (lambda - shift)`.

        Zero eigenvalues are those of coordinates without mass. The time of `q.` is scaled by the shift.
        """
        m = self.inertia.shape[0]
        inertia, damping = shift**2 * self.inertia, shift * self.damping
        fixed = self.stiffness + damping + inertia
        upper = -linalg.solve(fixed, jnp.concatenate([damping + inertia, inertia], axis=1))
        lower = upper.at[:, :m].add(jnp.eye(m))
        return jnp.concatenate([upper, lower]) / shift

    def near(self, shift: Scalar) -> Inexact[Array, "m m2"]:
        """`-P^-1 (shift P', shift^2 M UNIT)` at a shift: `P` near it, as `slowest` takes it."""
        inertia, damping = shift**2 * self.inertia, shift * self.damping
        fixed = self.stiffness + damping + inertia
        right = jnp.concatenate([damping + 2 * inertia, UNIT * inertia], axis=1)
        return linalg.solve(-fixed, right)


def eigenvalues(pencil: Pencil, count: int | None = None) -> Complex[Array, " m2"]:
    """All `lambda` with `det P(lambda) = 0`, unsorted; infinite for coordinates without mass.

    With a `count` only so many of the slowest are computed, and some others.
    """
    own = pencil.along_axes
    return _eigenvalues(count, own.inertia, own.damping, own.stiffness)


def moving_eigenvalues(
    pencil: Pencil, change: Pencil, count: int
) -> tuple[Complex[Array, " k"], Complex[Array, " k"], Complex[Array, "k m2"]]:
    """The slowest eigenvalues and some others, their changes with a change of the pencil, and vectors.

    `d lambda = -y dP x / (y P' x)`, with left vectors `y` to some digits, see `slowest`. Equal eigenvalues
    get the mean of their changes; close to a defective pair, whose vectors coincide, the result has few
    digits or is not finite. See `root_changes` for exact derivatives of single roots.
    """
    own, moved = pencil.along_axes, change.along_axes
    shift, m = own.shift, own.inertia.shape[0]
    found = slowest(own.near(shift), count, left=True)
    values = _values(found.values / shift, shift)
    finite = jnp.isfinite(values)
    roots = jnp.where(finite, values, 0.0)
    assert found.left is not None and found.right is not None
    right = found.right[:m]
    ends = found.left[:, :m].T  # left vectors of the pencil, times `P(shift)`
    near = own.stiffness + shift * own.damping + shift**2 * own.inertia
    parts = [ends] if jnp.iscomplexobj(near) else [ends.real, ends.imag]
    solved = linalg.solve(near.T, jnp.concatenate(parts, axis=1))
    left = solved if len(parts) == 1 else jax.lax.complex(*jnp.split(solved, 2, axis=1))
    way = lambda block: jnp.sum(left * (block @ right), axis=0)
    slopes = 2 * roots * way(own.inertia) + way(own.damping)
    changes = roots**2 * way(moved.inertia) + roots * way(moved.damping) + way(moved.stiffness)
    rates = jnp.where(finite, -changes / jnp.where(finite, slopes, 1.0), 0.0)
    same = finite & (jnp.abs(roots[:, None] - roots) <= ROUNDING * jnp.abs(roots)[:, None])
    same = same | jnp.eye(values.size, dtype=bool)
    changes = (same @ rates) / jnp.sum(same, axis=1)
    return values, changes, _in_halves(pencil, right.T)


def eigenvectors(
    pencil: Pencil, count: int | None = None
) -> tuple[Complex[Array, " m2"], Complex[Array, "m2 m"]]:
    """Eigenvalues and their vectors `q`, one a row, of any scale; with a `count` like `eigenvalues`.

    Derivatives of vectors are those of simple roots; vectors of equal roots are held constant.
    """
    own = pencil.along_axes
    values, vectors = _eigenvectors(count, own.inertia, own.damping, own.stiffness)
    return values, _in_halves(pencil, vectors)


def _in_halves(pencil: Pencil, vectors: Complex[Array, "k m2"]) -> Complex[Array, "k m2"]:
    """Vectors of `(x, y)` as those of `(x + i y, x - i y)`, if the pencil is of pairs."""
    if not pencil.paired:
        return vectors
    x, y = jnp.split(vectors, 2, axis=1)
    return jnp.concatenate([x + 1j * y, x - 1j * y], axis=1)


def _along_axes(pair: Complex[Array, "m m"]) -> Float[Array, "m m"]:
    """`A q + B q*` of `q = x + i y` as real equations of `(x, y)`."""
    n = pair.shape[0] // 2
    ahead, across = pair[:n, :n] + pair[:n, n:], pair[:n, :n] - pair[:n, n:]
    return jnp.block([[ahead.real, -across.imag], [ahead.imag, across.real]])


@functools.partial(jax.custom_jvp, nondiff_argnums=(0,))
def _eigenvalues(count, inertia, damping, stiffness):
    pencil = Pencil(inertia, damping, stiffness)
    shift = pencil.shift
    if count is not None:
        found = slowest(pencil.near(shift), count, right=False)
        return _values(found.values / shift, shift)
    return _values(linalg.eigvals(pencil.inverse(shift)), shift)


@functools.partial(jax.custom_jvp, nondiff_argnums=(0,))
def _eigenvectors(count, inertia, damping, stiffness):
    pencil = Pencil(inertia, damping, stiffness)
    shift = pencil.shift
    if count is not None:
        found = slowest(pencil.near(shift), count)
        assert found.right is not None
        return _values(found.values / shift, shift), found.right[: inertia.shape[0]].T
    inverses, vectors = linalg.eig(pencil.inverse(shift))
    return _values(inverses, shift), vectors[: inertia.shape[0]].T


@_eigenvectors.defjvp
def _eigenvectors_jvp(count, primals, tangents):
    """`P dx + P' x d lambda = -dP x` with `dx` orthogonal to `x`."""
    values, vectors = _eigenvectors(count, *primals)
    pencil, change = Pencil(*primals), Pencil(*tangents)
    simple = jnp.isfinite(values) & ~_twice(values, pencil)

    def one(case):
        root, vector, simple = case
        slope = (2 * root * pencil.inertia + pencil.damping) @ vector
        upper = jnp.concatenate([pencil.at(root), slope[:, None]], axis=1)
        bordered = jnp.concatenate([upper, jnp.append(vector.conj(), 0.0)[None]])
        right = jnp.append(-change.at(root) @ vector, 0.0)
        moved = linalg.solve(jnp.where(simple, bordered, jnp.eye(right.size)), right)[:-1]
        return jnp.where(simple, moved, 0.0)

    moved = jax.vmap(one)((jnp.where(simple, values, 0.0), vectors, simple))
    return (values, vectors), (root_changes(values, pencil, change), moved)


def _values(inverses: Complex[Array, " m2"], shift: Scalar) -> Complex[Array, " m2"]:
    infinite = jnp.abs(inverses) * shift < 1e-10
    return jnp.where(infinite, jnp.inf, shift + 1 / jnp.where(infinite, 1.0, inverses))


@_eigenvalues.defjvp
def _eigenvalues_jvp(count, primals, tangents):
    values = _eigenvalues(count, *primals)
    return values, root_changes(values, Pencil(*primals), Pencil(*tangents))


def root_changes(
    roots: Complex[Array, " k"], pencil: Pencil, change: Pencil
) -> Complex[Array, " k"]:
    """`d lambda = -y dP x / (y P' x)`, with `x` and `y` the right and left null vectors of `P(lambda)`.

    Two equal roots with two vectors get the mean of their derivatives; equal roots that share one
    vector have no derivative, and the result is not finite there.
    """
    finite = jnp.isfinite(roots)

    def one(case):
        root, twice = case
        u, _, v = linalg.svd(pencil.at(root))
        left, right = u[:, -2:].conj().T, v[-2:].conj().T
        slope = left @ (2 * root * pencil.inertia + pencil.damping) @ right
        moved = left @ change.at(root) @ right
        simple = -moved[-1, -1] / slope[-1, -1]
        double = -jnp.trace(linalg.solve(jnp.where(twice, slope, jnp.eye(slope.shape[0])), moved))
        return jnp.where(twice, double / 2, simple)

    cases = jnp.where(finite, roots, 0.0), _twice(roots, pencil)
    return jnp.where(finite, jax.vmap(one)(cases), 0.0)


def _twice(roots: Complex[Array, " k"], pencil: Pencil) -> Bool[Array, " k"]:
    """Whether another root is equal, judged by the roots: singular values span too many scales."""
    if pencil.inertia.shape[0] == 1:  # equal roots share the one vector
        return jnp.zeros(roots.shape, bool)
    floor, finite = pencil.rate, jnp.isfinite(roots)
    distances = jnp.abs(roots[:, None] - jnp.where(finite, roots, 0.0))
    distances = jnp.sort(jnp.where(finite, distances, jnp.inf), axis=1)
    return finite & (distances[:, 1] <= ROUNDING * larger(jnp.abs(roots), floor))


def steady_response(system: System) -> tuple[Array | None, Array | None]:
    """`q = still + whirling exp(i Omega t)` of an isotropic system; a part without its load is None."""
    pencil, speed = Pencil.of(system), system.spin.speed
    constant, unbalance = system.load.constant, system.load.unbalance_force(speed)
    still = None if constant is None else pencil.response(jnp.zeros(()), constant)
    whirling = None if unbalance is None else pencil.response(speed, unbalance)
    return still, whirling
