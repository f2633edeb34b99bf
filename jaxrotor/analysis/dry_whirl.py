"""Dry whirl: circular whirl that the friction of a ring sustains without unbalance."""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Complex, Float

from ..core import linalg
from ..core.checks import check_counts
from ..core.compiled import compiled_quickly
from ..core.quantities import Scalar, known
from ..core.tables import notebook_table
from ..effects import AnnularStator
from ..effects.rub import smoothed_sign
from ..equations.pencil import Pencil, eigenvalues
from ..equations.start import Continued
from ..equations.system import System, assemble
from ..scene import Scene
from .linearized import check_linear
from .ring import RotorInRing, polished, ring_of, sorted_roots


PLACES = 8  # whirls that a result has room for
POINTS = 65  # in an interval of rates in which the least friction is sought
GOLDEN = 80  # steps of the golden section
CREEPING = 12  # iterations for the slip of a rim that rolls by a smoothed law


class DryWhirl(eqx.Module):
    """Dry whirls `z = radius exp(i rate t)` of a rotor, `k` of them, from the fastest backward one on.

    Where traced they fill `count` places, NaN where there is none.
    """

    rate: Float[Array, " k"]  # w [rad/s]
    radius: Float[Array, " k"]  # at the ring [m]
    normal_force: Float[Array, " k"]  # [N]
    slip: Float[Array, " k"]  # Omega R + w radius, zero where the rim rolls by the sharp law [m/s]
    needed: Float[Array, " k"]  # friction in force, of the sign of the slip [1]
    rolling: Bool[Array, " k"]  # whether friction is not saturated
    roots: Complex[Array, "k m"]  # in turning axes, without that of the phase; largest growth first
    coordinates: Complex[Array, "k n"]  # at time 0 [m]
    least_friction: Scalar  # below it there is no backward whirl at this speed; NaN for none [1]
    least_friction_rate: Scalar  # rate of the whirl that needs it [rad/s]

    def _repr_html_(self) -> str:
        columns = {
            "rim": ["rolls" if one else "slips" for one in np.asarray(self.rolling).tolist()],
            "rate [rad/s]": self.rate,
            "radius [m]": self.radius,
            "normal force [N]": self.normal_force,
            "friction": self.needed,
            "growth [1/s]": self.growth,
        }
        places = np.flatnonzero(self.exists)
        rows = [[column[i] for column in columns.values()] for i in places]
        return notebook_table("Dry whirl", list(columns), rows)

    @property
    def exists(self) -> Bool[Array, " k"]:
        """Whether there is a whirl in a place."""
        return jnp.isfinite(self.rate)

    @property
    def growth(self) -> Float[Array, " k"]:
        """Largest real part of the roots [1/s]."""
        return self.roots[:, 0].real

    @property
    def stable(self) -> Bool[Array, " k"]:
        """Whether it exists and small motions about it decay."""
        return self.exists & (self.growth < 0)

    @property
    def least_rim_speed(self) -> Float[Array, " k"]:
        """Surface speed `-w radius` of the rim at which it would roll in this whirl [m/s].

        A whirl of a slipping rim exists above it. Its rate depends on the speed of the rotor only by
        gyroscopic moments and by damping that turns with the shaft.
        """
        return -self.rate * self.radius

    def start(self, which: int = 0) -> Continued:
        """State on a whirl, from which to simulate or seek an orbit.

        Args:
            which: index of the whirl.

        Returns:
            A start for `jaxrotor.simulate`, `periodic` and the like.
        """
        q = self.coordinates[which]
        return Continued(q, 1j * self.rate[which] * q)


def dry_whirl(scene: Scene, count: int = PLACES) -> DryWhirl:
    """`g / N + 1 / k + H(w) (1 + i s) = 0`: circular whirls in a ring by friction, without unbalance.

    `H(w)` is the receptance of the rotor at the ring for a force that turns at `w`, negative for whirl
    from y to x, which is backward unless the speed is negative. The imaginary part gives the friction
    `s` that a whirl needs, `-Im H / Re H`. Either the rim slips, `s = f sgn V`, or it rolls,
    `V = Omega R + w rho = 0` and `|s| <= f`. Both are polynomials in `w` of which all roots are
    computed, so nothing is scanned. Without unbalance every full rub is one of these; bouncing is not.

    With the `slip` of the ring, friction is `f s(V / slip)`: a rim that rolls creeps by the slip that its
    friction needs, and a whirl slips where that exceeds the width. What creeps is sought from the rate at
    which it would roll: a second creeping whirl of nearly saturated friction is not found. `blend` has no
    effect; the whirl is right where the depth exceeds it. Of several shafts `Omega` is the speed of the
    one in the ring, less that of one around it.

    Args:
        scene: a rotor that is the same along every axis, in one `AnnularStator` on its axis; its
            unbalance is left out.
        count: number of whirls that are kept.

    Returns:
        `DryWhirl`, differentiable. Whirls of a slipping rim where the friction needed falls with `|w|`
        are unstable always; `roots` tell the rest.

    Raises:
        ValueError: the scene has another contact, unequal axes, weight, balls or hysteretic damping,
            the ring has an offset or no stiffness, or `count` is not a whole number of at least 1.

    Source: Black (1968), J. Mech. Eng. Sci. 10, pp. 1-12, with the receptance of backward whirl.
    """
    check_counts(count=count)
    ring = ring_of(scene, "A dry whirl")
    check_linear(scene)
    found = _dry_whirl(assemble(scene), ring, count)
    if not known(found.rate):
        return found
    there = np.asarray(found.exists)
    shared = ("least_friction", "least_friction_rate")
    own = lambda whirls: [value for name, value in vars(whirls).items() if name not in shared]
    return eqx.tree_at(own, found, [jnp.asarray(np.asarray(part)[there]) for part in own(found)])


@compiled_quickly
def _dry_whirl(system: System, ring: AnnularStator, count: int) -> DryWhirl:
    # A reversed rotor is solved as its mirror image, y for -y, so that w < 0 is against the spin.
    rotor = RotorInRing.of(system, ring)
    sense = rotor.sense
    mirrored = lambda z: jax.lax.complex(z.real, sense * z.imag)
    of = lambda rotor: (*jax.tree.leaves(rotor.pencil), rotor.rim)
    rotor = eqx.tree_at(of, rotor, (*map(mirrored, of(rotor)[:-1]), sense * rotor.rim))
    slipping = jax.lax.map(lambda sign: _slipping(rotor, sign), jnp.array([1.0, -1.0]))
    every = jax.tree.map(lambda a, b: jnp.concatenate([*a, b]), slipping, _rolling(rotor))
    order = jnp.argsort(jnp.where(every.exists, every.rate, jnp.inf))[:count]
    some = jax.tree.map(lambda part: part[order], every)
    motion = map(mirrored, jax.lax.map(lambda one: _motion(rotor, one), some))
    friction, rate = _least_friction(rotor)
    found = sense * some.rate, some.radius, some.normal, sense * some.slip, sense * some.friction
    masked: Any = [jnp.where(some.exists, part, jnp.nan) for part in found]
    both: Any = [jnp.where(some.exists[:, None], part, jnp.nan) for part in motion]
    parts: Any = *masked, some.rolling & some.exists, *both, friction, sense * rate
    return DryWhirl(*parts)


class _Whirls(NamedTuple):
    """Candidates of whirls."""

    rate: Array
    radius: Array
    normal: Array
    slip: Array
    friction: Array  # in force, of the sign of the slip
    rolling: Array
    exists: Array


class _Contact(NamedTuple):
    """State of the contact in a whirl of a given rate."""

    needed: Scalar
    radius: Scalar
    normal: Scalar
    slip: Scalar
    pressed: Bool[Array, ""]

    @classmethod
    def at(cls, rotor: RotorInRing, rate: Scalar) -> "_Contact":
        """From the dynamic stiffness `D = 1 / H`: `N / rho = -Re D`, `needed = Im D / Re D`."""
        ring, stiff = rotor.ring, 1 / rotor.receptance(rate)
        share = -stiff.real / ring.stiffness
        pressed = (share > 0) & (share < 1)
        share = jnp.where(pressed, share, 0.5)
        radius = ring.gap / (1 - share)
        slip = rotor.rim + rate * radius
        return cls(stiff.imag / stiff.real, radius, ring.stiffness * share * radius, slip, pressed)


def _motion(rotor: RotorInRing, one: _Whirls) -> tuple[Array, Array]:
    """Roots and coordinates of a whirl, not a number where it does not exist."""
    ring, n = rotor.ring, rotor.row.size
    slope = 0.0
    if ring.slip is not None:
        slope = ring.friction * jax.grad(smoothed_sign)(one.slip / ring.slip) / ring.slip
    state = one.rate, one.normal, one.friction
    kinds = [
        lambda: jnp.full(4 * n, jnp.nan, complex),
        lambda: sorted_roots(rotor.linearised(*state, slope), neutral=True),
        lambda: sorted_roots(rotor.rolling(*state), neutral=True),
    ]
    locked = one.rolling if ring.slip is None else jnp.zeros_like(one.rolling)
    roots = jax.lax.switch(jnp.where(one.exists, 1 + locked, 0), kinds)
    force = -one.normal * (1 + 1j * one.friction)
    return roots, rotor.pencil.response(one.rate, force * rotor.column)


# === candidates: purely imaginary eigenvalues of bordered pencils


def _slipping(rotor: RotorInRing, sign: Scalar) -> _Whirls:
    """Whirls with saturated friction, of a slip of the given sign."""
    ring = rotor.ring
    friction = sign * ring.friction
    push: Any = 1 + 1j * friction
    rates, real = _real_rates(_bordered(rotor, push, -push.conjugate()))

    def one(guess: Scalar):
        rate, good = polished(lambda w: _angle(push * rotor.receptance(w)), guess)
        contact = _Contact.at(rotor, rate)
        width = 0.0 if ring.slip is None else ring.slip
        return rate, contact, good & contact.pressed & (sign * contact.slip > width)

    found: Any = jax.vmap(one)(rates)
    rate, contact, good = found
    good = _once(rate, good & real)
    shared = jnp.full_like(rate, friction), jnp.zeros_like(good)
    return _Whirls(rate, contact.radius, contact.normal, contact.slip, *shared, good)


def _rolling(rotor: RotorInRing) -> _Whirls:
    """Whirls with a rim that rolls, or creeps where the law is smoothed."""
    ring = rotor.ring
    rim = rotor.rim
    rates, real = _real_rates(_double_bordered(rotor, rim, ring.gap))

    def one(guess: Scalar):
        stiff = lambda w: (1 / rotor.receptance(w)).real / ring.stiffness
        rate, good = polished(lambda w: rim * (1 + stiff(w)) + w * ring.gap, guess)
        contact = _Contact.at(rotor, rate)
        good = good & contact.pressed & (jnp.abs(contact.needed) <= ring.friction)
        if ring.slip is not None:
            rate, good = _creeping(rotor, rate, good)
            contact = _Contact.at(rotor, rate)
        return rate, contact, good & contact.pressed

    found: Any = jax.vmap(one)(rates)
    rate, contact, good = found
    slip = jnp.zeros_like(rate) if ring.slip is None else contact.slip
    shared = contact.needed, jnp.ones_like(good)
    good = _once(rate, good & real)
    return _Whirls(rate, contact.radius, contact.normal, slip, *shared, good)


def _creeping(rotor: RotorInRing, rate: Scalar, good: Array) -> tuple[Scalar, Array]:
    """Rate at which the smoothed friction is what the whirl needs, from that of a rim that rolls.

    `f s(u) = needed(w)`, `slip u = V(w)` by Newton's method, with u kept where s has a slope.
    """
    ring: Any = rotor.ring
    share = jnp.where(good, _Contact.at(rotor, rate).needed / ring.friction, 0.0)
    width = 1 - 1e-9

    def gap(w, u):
        contact = _Contact.at(rotor, w)
        short = jnp.where(good, ring.friction * smoothed_sign(u) - contact.needed, u)
        return jnp.stack([short, jnp.where(good, contact.slip / ring.slip - u, w - rate)])

    def newton(_, state):
        unknowns, _, _ = state
        matrix = jax.jacfwd(lambda x: gap(x[0], x[1]))(unknowns)
        change = linalg.solve(matrix, gap(*unknowns))
        unknowns = unknowns - change
        return unknowns.at[1].set(jnp.clip(unknowns[1], -width, width)), change, matrix

    start = jnp.stack([rate, share / 2])
    found = jax.lax.fori_loop(0, CREEPING, newton, (start, start, jnp.eye(2)))
    unknowns, change, matrix = jax.lax.stop_gradient(found)
    found = unknowns - linalg.solve(matrix, gap(*unknowns))
    return found[0], good & (jnp.abs(change[0]) <= 1e-9 * jnp.abs(found[0]))


def _angle(value: Array) -> Scalar:
    """Imaginary part relative to the size: zero where a number is real."""
    return value.imag / jax.lax.stop_gradient(jnp.abs(value))


def _real_rates(pencil: Pencil) -> tuple[Float[Array, " c"], Bool[Array, " c"]]:
    """Rates `w` of the eigenvalues `i w` of a pencil, and whether these are purely imaginary."""
    found = jax.lax.stop_gradient(eigenvalues(jax.lax.stop_gradient(pencil)))
    there = jnp.isfinite(found) & (jnp.abs(found) > 0)
    rate = jnp.where(there, found.imag, 1.0)
    return rate, there & (jnp.abs(found.real) <= 1e-5 * jnp.abs(rate))


def _once(rate: Float[Array, " c"], good: Bool[Array, " c"]) -> Bool[Array, " c"]:
    """Mask without repeated rates, which Newton's method may reach from several guesses."""
    same = jnp.abs(rate[:, None] - rate) <= 1e-7 * jnp.abs(rate)
    before = jnp.tril(jnp.ones_like(same), -1)
    return good & ~jnp.any(same & before & good, axis=1)


def _mirrored(rotor: RotorInRing) -> Pencil:
    """`P(i w)` and its conjugate, as a pencil of `lambda = i w`."""
    own = rotor.pencil
    pair = lambda a, b: linalg.block_diag(a, b)
    return Pencil(
        pair(own.inertia, own.inertia.conj()),
        pair(own.damping, -own.damping.conj()),
        pair(own.stiffness, own.stiffness.conj()),
    )


def _bordered(rotor: RotorInRing, first: Array, second: Array) -> Pencil:
    """Pencil that is singular where `first H(w) + second H(w)* = 0`."""
    own, n = _mirrored(rotor), rotor.row.size
    column = jnp.concatenate([rotor.column, rotor.column])[:, None]
    row = jnp.concatenate([first * rotor.row, second * rotor.row])[None]
    wide = lambda block: jnp.pad(block, ((0, 1), (0, 1)))
    stiffness = jnp.block([[own.stiffness, column], [row, jnp.zeros((1, 1))]])
    assert stiffness.shape == (2 * n + 1, 2 * n + 1)
    return Pencil(wide(own.inertia), wide(own.damping), stiffness)


def _double_bordered(rotor: RotorInRing, rim: Scalar, gap: Scalar | float) -> Pencil:
    """Pencil that is singular where `rim (k + Re D(w)) + w k gap = 0`, with `D = 1 / H`.

    Its unknowns are the motions by forces `f` and `f'` that displace the ring by `s`, `D = f / s`.
    """
    own, n, stiff = _mirrored(rotor), rotor.row.size, rotor.ring.stiffness
    none, column, row = jnp.zeros(n), -stiff * rotor.column, rotor.row
    columns = jnp.stack([jnp.concatenate([column, none]), jnp.concatenate([none, column])], axis=1)
    rows = jnp.stack([jnp.concatenate([row, none]), jnp.concatenate([none, row])])
    border = jnp.zeros((3, 3)).at[:2, 2].set(-1.0)
    border = border.at[2].set(jnp.stack([rim / 2, rim / 2, rim]))
    stiffness = jnp.block(
        [
            [own.stiffness, columns, jnp.zeros((2 * n, 1))],
            [jnp.concatenate([rows, jnp.zeros((1, 2 * n))]), border],
        ]
    )
    wide = lambda block: jnp.pad(block, ((0, 3), (0, 3)))
    return Pencil(wide(own.inertia), wide(own.damping).at[-1, -1].add(-1j * gap), stiffness)


# === least friction


def _least_friction(rotor: RotorInRing) -> tuple[Scalar, Scalar]:
    """The least of `needed(w)` over the backward whirls that press the ring, and its rate.

    These rates form intervals that end where `Re H = 0` or where the whirl is unbounded, `Re D = -k`.
    """
    bounds = [_bordered(rotor, jnp.asarray(1 + 0j), jnp.asarray(1 + 0j))]
    bounds.append(_double_bordered(rotor, jnp.ones(()), 0.0))
    rates = [jnp.where(real & (w < 0), w, 0.0) for w, real in map(_real_rates, bounds)]
    ends = jnp.sort(jnp.concatenate(rates))
    still = jax.lax.stop_gradient(rotor)
    low, high = ends[:-1], ends[1:]
    shares = (1 - jnp.cos(jnp.pi * jnp.linspace(0.0, 1.0, POINTS))) / 2

    def needed(w: Scalar) -> Scalar:
        contact = _Contact.at(still, jnp.where(w < 0, w, -1.0))
        return jnp.where((w < 0) & contact.pressed, contact.needed, jnp.inf)

    grid = low[:, None] + shares * (high - low)[:, None]
    values = jax.lax.map(jax.vmap(needed), grid)
    best = jnp.argmin(jnp.where(jnp.isnan(values), jnp.inf, values))
    part, place = jnp.divmod(best, POINTS)
    near = lambda step: grid[part, jnp.clip(place + step, 0, POINTS - 1)]

    def narrow(ends, _):
        a, b = ends
        first, second = b - 0.6180339887498949 * (b - a), a + 0.6180339887498949 * (b - a)
        pair: Any = jax.vmap(needed)(jnp.stack([first, second]))
        left = pair[0] < pair[1]
        return (jnp.where(left, a, first), jnp.where(left, second, b)), None

    (a, b), _ = jax.lax.scan(narrow, (near(-1), near(1)), length=GOLDEN)
    rate = jax.lax.stop_gradient((a + b) / 2)
    # At an end of the interval the rate moves with it; in between the least value has no slope.
    edge = lambda w: (1 / rotor.receptance(w)).real / rotor.ring.stiffness + 1
    there, good = polished(edge, jnp.where(rate < 0, rate, -1.0))
    at_edge = good & (jnp.abs(there - rate) <= 1e-6 * jnp.abs(rate))
    rate = jnp.where(at_edge, there, rate)
    stiff = 1 / rotor.receptance(jnp.where(rate < 0, rate, -1.0))
    exists = jnp.any(jnp.isfinite(values))
    found = stiff.imag / stiff.real, rate
    friction, rate = (jnp.where(exists, part, jnp.nan) for part in found)
    return friction, rate
