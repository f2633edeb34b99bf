"""Shooting: the difference between a state and itself one period later, whose root is an orbit.

    R(-turn) flow(x, T) = x,    n . (x - guess) = 0 where T is unknown

`R` rotates the plane of whirl. The second equation is the phase condition; `n` is the direction of
motion in the guess.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import diffrax as dfx
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jaxtyping import Array, Complex, Float

from ..analysis.floquet import multipliers_of
from ..core import linalg
from ..core.plane import plane
from ..core.quantities import Scalar
from ..equations.clocks import turns_of
from ..equations.constant_frame import steady_amplitudes
from ..equations.lent import with_lent_films
from ..equations.start import AtRest
from ..equations.stationary_frame import Motion
from ..equations.system import System
from ..motion.base import Plan, Window
from ..motion.revolutions import March, Outcome
from ..solvers.exponential import Exponential
from .memory import state_in


STILL = 1e-6  # of the state, per radian: a motion slower than this counts as rest


class OrbitSamples(NamedTuple):
    """Displacement, velocity, contact forces and states of laws of an orbit at `T` times."""

    displacement: Complex[Array, "... T s"]  # [m]
    velocity: Complex[Array, "... T s"]  # [m/s]
    contact_force: Complex[Array, "... T k"] | None  # [N]
    states: Float[Array, "... T x"] | None  # None: the scene has none

    @classmethod
    def of(cls, samples: Window) -> "OrbitSamples":
        return cls(samples.displacement, samples.velocity, samples.contact_force, samples.states)


class Shooting(eqx.Module):
    """The residual `R(-turn) flow(x, T) - x` in real numbers.

    `n` complex coordinates and `k` states of laws make `m = 4 n + k` real numbers. The unknown `x` is the
    state `(q, dq/dtheta)` and those of the laws over `size`; where the period is unknown, one more number
    multiplies the span of the guess.
    """

    system: System
    plan: Plan
    stations: Float[Array, " s"]
    rate: Scalar  # [rad/s]
    span: Scalar  # of the guess [rad]; of a revolution where the period is given
    turn: Scalar  # [rad]
    size: Float[Array, " m"]  # [m], and in the units of the states
    guess: Float[Array, " m"]
    normal: Float[Array, " m"] | None  # of the phase condition; None: the period is given
    revolutions: int = eqx.field(static=True)

    @classmethod
    def near(
        cls,
        system: System,
        plan: Plan,
        stations: Float[Array, " s"],
        rate: Scalar,
        span: Scalar,
        turn: Scalar,
        start: tuple[Complex[Array, " n"], Complex[Array, " n"], Float[Array, " k"]],
        revolutions: int | None,
    ) -> "Shooting":
        """The problem near a start, see `encode`; with `revolutions=None` the period is unknown."""
        if revolutions is None:  # the equations must be autonomous
            system = without_unbalance(system)
        system = with_lent_films(system)
        # The rest position of a rotor that films alone hold says nothing of its size.
        lent = any(port.lent is not None for port in system.ports)
        steady = [] if lent else steady_amplitudes(system)
        size = jnp.max(jnp.abs(jnp.concatenate([start[0], start[1] / rate, *steady])))
        size = jax.lax.stop_gradient(jnp.where(size > 0, size, 1.0))
        size = sizes_of(system, size, jnp.ones_like(start[2]))
        parts = system, plan, stations, rate, span, turn
        known = jnp.zeros_like(size), None, revolutions or 1
        if system.clocks or system.state_count:  # they may move a rotor from rest that has no load
            trial = jax.lax.stop_gradient((parts, size, start))
            size = _size_of(cls(*trial[0], trial[1], *known), trial[2])
        parts = *parts, size
        plain = cls(*parts, *known)
        guess = jax.lax.stop_gradient(plain.encode(*start))
        normal = None
        if revolutions is None:
            normal = jax.lax.stop_gradient(plain.direction(guess))
        return cls(*parts, guess, normal, revolutions or 1)

    @property
    def first(self) -> Float[Array, " a"]:
        """The unknowns of the guess."""
        return self.guess if self.normal is None else jnp.append(self.guess, 1.0)

    def encode(
        self, q: Complex[Array, " n"], velocity: Complex[Array, " n"], states: Float[Array, " k"]
    ) -> Float[Array, " m"]:
        """State of coordinates [m], velocities [m/s] and states of laws."""
        state = jnp.concatenate([q, velocity / self.rate])
        return jnp.concatenate([state.real, state.imag, states]) / self.size

    def decode(
        self, x: Array
    ) -> tuple[Complex[Array, " n"], Complex[Array, " n"], Float[Array, " k"]]:
        """Coordinates [m], velocities [m/s] and states of laws of a state."""
        n = self.system.n
        real, imag, states = jnp.split(self.size * x[: self.guess.size], [2 * n, 4 * n])
        q, rates = jnp.split(jax.lax.complex(real, imag), 2)
        return q, self.rate * rates, states

    def march(self, x: Array) -> March:
        """The motion, ready to step a revolution, or an unknown period, at a time."""
        return March.of(self.system, self.plan, self.rate, self.stations, self.length(x))

    def length(self, x: Array) -> Scalar:
        """Span of a revolution, or of the unknown period [rad]."""
        return self.span if self.normal is None else self.span * x[-1]

    def residual(self, x: Array) -> tuple[Float[Array, " a"], tuple[OrbitSamples, Outcome]]:
        """Residual of the unknowns, over `size`, and samples and outcome of every revolution."""
        march, state = self.march(x), x[: self.guess.size]
        keep = lambda carry, samples, _: (carry, OrbitSamples.of(samples))
        turns = [turns_of(AtRest(), self.system)] if self.system.others else []
        y = march.encode(*self.decode(x), *turns)
        (y, _, outcome), samples = march.collect(y, None, keep, self.revolutions)
        change = self.encode(*self._returned(march, y)) - state
        if self.normal is not None:
            change = jnp.append(change, self.normal @ (state - self.guess))
        return change, (samples, outcome)

    def _returned(
        self, march: March, y: Array
    ) -> tuple[Complex[Array, " n"], Complex[Array, " n"], Float[Array, " k"]]:
        """Coordinates, velocities and states of laws at the end of a period, turned back."""
        back = jnp.exp(-1j * self.turn)
        if not self.system.others:
            q, velocity, states = state_in(march, y)
            return back * q, back * velocity, states
        # `y` is the deviation from the response to unbalance, which has turned as the orbit has.
        turns = turns_of(AtRest(), self.system)
        at_start = lambda y: state_in(march, y.at[-turns.size :].set(turns))
        (q, velocity, states), (rest, drift, _) = at_start(y), at_start(jnp.zeros_like(y))
        return back * (q - rest) + rest, back * (velocity - drift) + drift, states

    def direction(self, x: Array) -> Float[Array, " m"]:
        """Unit vector along the motion in a state; not a number at rest."""
        q, velocity, states = self.decode(x)
        state = jnp.stack([q, velocity / self.rate])
        motion = Motion(self.system, self.rate)
        field, states = motion.with_states(jnp.zeros(()), plane(state, axis=1), states)
        q, rates = field[:, 0] + 1j * field[:, 1]
        rate = self.encode(q, self.rate * rates, states)
        length = linalg.norm(rate)
        return rate / jnp.where(length > STILL * linalg.norm(x), length, jnp.nan)

    def multipliers(
        self, x: Array, jacobian: Float[Array, "a a"]
    ) -> tuple[Complex[Array, " r"], Scalar | None]:
        """Multipliers of the period map, largest first, and the trivial one of an unknown period.

        The map leaves the direction of motion `f` as it is, `J f = f`. The other multipliers are the
        eigenvalues of `J` across `f`: a Householder reflection makes `f` the first axis, which is dropped.
        """
        m = self.guess.size
        jacobian = jacobian[:m, :m] + jnp.eye(m)
        trivial = None
        if self.normal is not None:
            along = self.direction(x)
            trivial = along @ jacobian @ along
            first = jnp.where(along[0] < 0, -1.0, 1.0)
            mirror = along.at[0].add(first)  # normal of the mirror between `f` and the first axis
            reflection = jnp.eye(m) - jnp.outer(mirror, mirror) * 2 / (mirror @ mirror)
            jacobian = (reflection @ jacobian @ reflection)[1:, 1:]
        values = multipliers_of(jacobian)
        return values[jnp.argsort(-jnp.abs(values))], trivial


def _size_of(shooting: Shooting, start: tuple[Array, Array, Array]) -> Float[Array, " m"]:
    """Sizes by the largest displacement of a trial and of its ends, and by its states of laws."""
    x, of_rotor = shooting.encode(*start), 4 * shooting.system.n
    change, (samples, _) = shooting.residual(x)
    seen = jnp.max(jnp.abs(samples.displacement))
    ends = jnp.stack([x, x + change])[:, :of_rotor]
    size = jnp.maximum(seen, shooting.size[0] * jnp.max(jnp.abs(ends)))
    states = jnp.zeros(0)
    if samples.states is not None:
        states = jnp.max(jnp.abs(samples.states), axis=(0, 1))
    size = sizes_of(shooting.system, size, states)
    return jnp.where((size > 0) & jnp.isfinite(size), size, shooting.size)


def sizes_of(
    system: System, size: Scalar, states: Float[Array, " k"] | Float[np.ndarray, " k"]
) -> Float[Array, " m"]:
    """Unit of every number of a state: a `size` [m], and of `states` the largest of those of one unit."""
    units = np.array(system.state_units)
    alike = jnp.asarray(units[:, None] == units).reshape(len(units), len(units))
    largest = jnp.max(jnp.where(alike, jnp.asarray(states), 0.0), axis=1, initial=0.0)
    return jnp.concatenate([jnp.full(4 * system.n, size), largest])


def differentiable(solver: Any, system: System) -> Exponential:
    """The solver; raise unless its steps include the jumps of their derivative at contacts."""
    if not isinstance(solver, Exponential):
        raise ValueError(f"`solver` of an orbit must be Exponential(..), but is {solver!r}.")
    if solver.shapes is not None:
        raise ValueError(
            f"Orbits follow all coordinates of the rotor, but `shapes` is {solver.shapes!r}; leave it out."
        )
    if not solver.located and any(law.kinked for port in system.ports for law in port.laws):
        raise ValueError(
            "Derivatives of a motion against sharp stops take located steps; give "
            "Exponential(.., located=True), or stops with `blend` and `slip`."
        )
    return solver


def plan_of(
    solver: Exponential, together: tuple[tuple[int, ...], ...], steps: int, contacts: bool = True
) -> Plan:
    """Plan of a motion that is observed at each of the `steps` of a revolution, or of a period."""
    options = {"slopes": False, "contacts": contacts, "coordinates": False, "together": together}
    return Plan(solver, None, dfx.ForwardMode(), steps, steps, **options)


class Shot(NamedTuple):
    """The residual of one trial, its Jacobian, and the motion that gave them."""

    residual: Float[Array, " a"]
    jacobian: Float[Array, "a a"]
    samples: OrbitSamples
    outcome: Outcome


@eqx.filter_jit
def shoot(x: Float[Array, " a"], shooting: Shooting) -> Shot:
    """Evaluate a trial with all tangents in one pass."""
    push = lambda tangent: jax.jvp(shooting.residual, (x,), (tangent,), has_aux=True)
    residual, jacobian, motion = jax.vmap(push, out_axes=(None, -1, None))(jnp.eye(x.size))
    return Shot(residual, jacobian, *motion)


@eqx.filter_custom_jvp
def shooting_residual(x: Float[Array, " a"], shooting: Shooting) -> tuple[Float[Array, " a"], Shot]:
    """Residual of the unknowns, and the trial it comes from.

    Root finders linearise the residual, which jax cannot do to loops of variable length; so the
    derivative here is the Jacobian of the trial. The trial itself has none, see `with_derivative`.
    """
    shot = shoot(x, shooting)
    return shot.residual, shot


@shooting_residual.def_jvp
def _shooting_residual_jvp(primals, tangents):
    (x, shooting), (along, change) = primals, tangents
    shot = shoot(x, shooting)
    moved = jnp.zeros_like(x) if along is None else shot.jacobian @ along
    if jax.tree.leaves(change):
        moved = moved + eqx.filter_jvp(lambda s: s.residual(x)[0], (shooting,), (change,))[1]
    return (shot.residual, shot), (moved, jax.tree.map(_no_tangent, shot))


class NewtonByTrial(optx.AbstractRootFinder):
    """Newton's method with the Jacobian that comes with every trial.

    `jax.linearize`, by which the method of optimistix has it, would trace the trial three times.
    """

    rtol: float = eqx.field(static=True)
    atol: float = eqx.field(static=True)
    norm: Callable = eqx.field(static=True, default=optx.max_norm)

    @property
    def newton(self) -> optx.Newton:
        return optx.Newton(self.rtol, self.atol, self.norm)

    def init(self, fn, y, args, options, f_struct, aux_struct, tags):
        return self.newton.init(fn, y, args, options, f_struct, aux_struct, tags)

    def step(self, fn, y, args, options, state, tags):
        residual, shot = fn(y, args)
        tangent_plane = lambda x, _: (residual + shot.jacobian @ (x - y), shot)
        return self.newton.step(tangent_plane, y, args, options, state, tags)

    def terminate(self, fn, y, args, options, state, tags):
        return self.newton.terminate(fn, y, args, options, state, tags)

    def postprocess(self, fn, y, aux, args, options, state, tags, result):
        return self.newton.postprocess(fn, y, aux, args, options, state, tags, result)


@eqx.filter_custom_jvp
def with_derivative(x: Float[Array, " a"], shooting: Shooting, shot: Shot) -> Shot:
    """The known trial of these unknowns; it is evaluated again only where its derivative is asked for."""
    del x, shooting
    return shot


@with_derivative.def_jvp
def _with_derivative_jvp(primals, tangents):
    (x, shooting, shot), (along, change, _) = primals, tangents
    return shot, eqx.filter_jvp(shoot, (x, shooting), (along, change))[1]


def _no_tangent(leaf: Array) -> Array | None:
    return jnp.zeros_like(leaf) if eqx.is_inexact_array(leaf) else None


def without_unbalance(system: System) -> System:
    """The system without the unbalance, whether it has one or not; raises if time acts by itself."""
    if system.clocks:
        raise ValueError(
            "A period is unknown only where nothing turns with the shaft, but "
            f"{system.laws_with(lambda law: law.clock)} depends on its angle; give `revolutions`."
        )
    absent = lambda part: part is None
    return eqx.tree_at(lambda s: s.load.unbalance, system, None, is_leaf=absent)
