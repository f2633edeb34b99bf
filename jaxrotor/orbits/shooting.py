"""Shooting: a periodic motion as the root of what it misses after a period.

    R(-turn) flow(x, T) = x,    f . (x - guess) = 0 where T is unknown

`R` turns the plane of whirl; `f` is the direction of motion in the guess.
"""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Complex, Float

from ..analysis.floquet import multipliers_of
from ..core.plane import plane
from ..core.quantities import Scalar
from ..equations.pencil import steady_response
from ..equations.stationary_frame import Motion
from ..equations.system import System
from ..motion.base import Plan, RevolutionSamples
from ..motion.revolutions import March, Outcome
from ..solvers.exponential import Exponential


STILL = 1e-6  # of the state in a radian: slower is rest


class Seen(NamedTuple):
    """What is kept of an orbit, by time."""

    displacement: Complex[Array, "... T s"]  # [m]
    velocity: Complex[Array, "... T s"]  # [m/s]
    contact_force: Complex[Array, "... T k"] | None  # [N]

    @classmethod
    def of(cls, orbit: RevolutionSamples) -> "Seen":
        return cls(orbit.displacement, orbit.velocity, orbit.contact_force)


class Shooting(eqx.Module):
    """What a state misses after a period, all real; `n` complex coordinates are `m = 4 n` numbers.

    The unknown `x` is the state, `(q, dq/dtheta)` over `size`, and where the period is one the span of
    the guess is to be multiplied by.
    """

    system: System
    plan: Plan
    stations: Float[Array, " s"]
    rate: Scalar  # [rad/s]
    span: Scalar  # of the guess [rad], of a revolution where the period is given
    turn: Scalar  # [rad]
    size: Scalar  # [m]
    guess: Float[Array, " m"]
    along: Float[Array, " m"] | None  # None: the period is given
    revolutions: int = eqx.field(static=True)

    @classmethod
    def about(
        cls,
        system: System,
        plan: Plan,
        stations: Float[Array, " s"],
        rate: Scalar,
        span: Scalar,
        turn: Scalar,
        start: tuple[Complex[Array, " n"], Complex[Array, " n"]],
        revolutions: int | None,
    ) -> "Shooting":
        """The problem near a start (q, velocity); of so many `revolutions`, or of its own period."""
        if revolutions is None:  # nothing tells one instant from another
            system = without_unbalance(system)
        moved = (part for part in steady_response(system) if part is not None)
        size = jnp.max(jnp.abs(jnp.concatenate([start[0], start[1] / rate, *moved])))
        size = jax.lax.stop_gradient(jnp.where(size > 0, size, 1.0))
        parts = system, plan, stations, rate, span, turn, size
        plain = cls(*parts, jnp.zeros(4 * system.n), None, revolutions or 1)
        guess = jax.lax.stop_gradient(plain.encode(*start))
        along = None
        if revolutions is None:
            along = jax.lax.stop_gradient(plain.direction(guess))
        return cls(*parts, guess, along, revolutions or 1)

    @property
    def first(self) -> Float[Array, " a"]:
        """The unknowns of the guess."""
        return self.guess if self.along is None else jnp.append(self.guess, 1.0)

    def encode(self, q: Complex[Array, " n"], velocity: Complex[Array, " n"]) -> Float[Array, " m"]:
        """State of coordinates [m] and velocities [m/s]."""
        state = jnp.concatenate([q, velocity / self.rate]) / self.size
        return jnp.concatenate([state.real, state.imag])

    def decode(self, x: Array) -> tuple[Complex[Array, " n"], Complex[Array, " n"]]:
        """Coordinates [m] and velocities [m/s] of a state."""
        real, imag = jnp.split(self.size * x[: self.guess.size], 2)
        q, rates = jnp.split(jax.lax.complex(real, imag), 2)
        return q, self.rate * rates

    def march(self, x: Array) -> March:
        """The motion, revolution by revolution or period by period."""
        return March.of(self.system, self.plan, self.rate, self.stations, self.length(x))

    def length(self, x: Array) -> Scalar:
        """Of a revolution, or of a period of its own [rad]."""
        return self.span if self.along is None else self.span * x[-1]

    def gap(self, x: Array) -> tuple[Float[Array, " a"], tuple[Seen, Outcome]]:
        """What the unknowns miss, over `size`, and the motion on the way, revolution by revolution."""
        march, state = self.march(x), x[: self.guess.size]
        keep = lambda carry, orbit: (carry, Seen.of(orbit))
        y = march.form.encode(*self.decode(x))
        (y, _, outcome), orbit = march.collect(y, None, keep, self.revolutions)
        back = jnp.exp(-1j * self.turn)
        q, velocity = march.form.decode(y)
        change = self.encode(back * q, back * velocity) - state
        if self.along is not None:
            change = jnp.append(change, self.along @ (state - self.guess))
        return change, (orbit, outcome)

    def direction(self, x: Array) -> Float[Array, " m"]:
        """Of motion in a state, of unit length; not a number at rest."""
        q, velocity = self.decode(x)
        state = jnp.stack([q, velocity / self.rate])
        motion = Motion(self.system, self.rate)
        field = motion(jnp.zeros(()), plane(state, axis=1))
        q, rates = field[:, 0] + 1j * field[:, 1]
        moved = self.encode(q, self.rate * rates)
        length = jnp.linalg.norm(moved)
        return moved / jnp.where(length > STILL * jnp.linalg.norm(x), length, jnp.nan)

    def multipliers(
        self, x: Array, jacobian: Float[Array, "a a"]
    ) -> tuple[Complex[Array, " r"], Scalar | None]:
        """Of the map with its symmetry removed, largest first; of a free period that of time as well.

        Along the motion the map moves nothing: `J f = f`, so `J` of the rest is what is across `f`.
        """
        m = self.guess.size
        jacobian = jacobian[:m, :m] + jnp.eye(m)
        trivial = None
        if self.along is not None:
            along = self.direction(x)
            trivial = along @ jacobian @ along
            first = jnp.where(along[0] < 0, -1.0, 1.0)
            normal = along.at[0].add(first)  # of the mirror that takes the first axis to it
            mirror = jnp.eye(m) - jnp.outer(normal, normal) * 2 / (normal @ normal)
            jacobian = (mirror @ jacobian @ mirror)[1:, 1:]
        values = multipliers_of(jacobian)
        return values[jnp.argsort(-jnp.abs(values))], trivial


def differentiable(solver: Any, system: System) -> Exponential:
    """The solver, refused where its steps do not know the jumps of their own derivative."""
    if not isinstance(solver, Exponential):
        raise ValueError(f"`solver` of an orbit must be Exponential(..), but is {solver!r}.")
    if not solver.located and any(law.kinked for port in system.ports for law in port.laws):
        raise ValueError(
            "Derivatives of a motion against sharp stops take located steps; give "
            "Exponential(.., located=True), or stops with `blend` and `slip`."
        )
    return solver


class Shot(NamedTuple):
    """What there is to know of a trial."""

    missed: Float[Array, " a"]
    jacobian: Float[Array, "a a"]
    seen: Seen
    outcome: Outcome


@eqx.filter_jit
def shoot(x: Float[Array, " a"], shooting: Shooting) -> Shot:
    """A trial, by one pass with all tangents."""
    push = lambda tangent: jax.jvp(shooting.gap, (x,), (tangent,), has_aux=True)
    missed, jacobian, more = jax.vmap(push, out_axes=(None, -1, None))(jnp.eye(x.size))
    return Shot(missed, jacobian, *more)


@eqx.filter_custom_jvp
def missed(x: Float[Array, " a"], shooting: Shooting) -> tuple[Float[Array, " a"], Shot]:
    """What unknowns miss, linear in their changes once the Jacobian is known, and the trial.

    Loops of as many turns as they need cannot be linearised, which root finders ask for. The trial
    has no derivative, see `again`.
    """
    shot = shoot(x, shooting)
    return shot.missed, shot


@missed.def_jvp
def _missed_jvp(primals, tangents):
    (x, shooting), (along, change) = primals, tangents
    shot = shoot(x, shooting)
    moved = jnp.zeros_like(x) if along is None else shot.jacobian @ along
    if jax.tree.leaves(change):
        moved = moved + eqx.filter_jvp(lambda s: s.gap(x)[0], (shooting,), (change,))[1]
    return (shot.missed, shot), (moved, jax.tree.map(_no_tangent, shot))


@eqx.filter_custom_jvp
def again(x: Float[Array, " a"], shooting: Shooting, shot: Shot) -> Shot:
    """A trial of these unknowns that is known already; repeated for its derivative alone."""
    del x, shooting
    return shot


@again.def_jvp
def _again_jvp(primals, tangents):
    (x, shooting, shot), (along, change, _) = primals, tangents
    return shot, eqx.filter_jvp(shoot, (x, shooting), (along, change))[1]


def _no_tangent(leaf: Array) -> Array | None:
    return jnp.zeros_like(leaf) if eqx.is_inexact_array(leaf) else None


def without_unbalance(system: System) -> System:
    """The system without unbalance, there or not."""
    absent = lambda part: part is None
    return eqx.tree_at(lambda s: s.load.unbalance, system, None, is_leaf=absent)
