"""One contract of motions in time: a march advances a scene window by window and observes them."""

import abc
import math
from collections.abc import Callable
from typing import Any

import diffrax as dfx
import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Complex, Float, Int

from ..core.lanes import lanes_last
from ..core.outcome import Outcome
from ..core.quantities import Number, Scalar
from ..effects.law import Now
from ..equations.massless_coordinates import Massless
from ..equations.start import AbstractStart
from ..equations.system import System
from ..solvers.basis import Count
from ..solvers.exponential import Exponential


SHORT = 20  # windows, below which every one is a checkpoint


class Plan(eqx.Module):
    """Settings that are fixed before tracing: solver, steps, and the contacts that share a port."""

    solver: Exponential | dfx.AbstractSolver
    controller: dfx.AbstractStepSizeController | None
    adjoint: dfx.AbstractAdjoint
    max_steps: int = eqx.field(static=True)  # of an adaptive solver, in one window
    steps: int = eqx.field(static=True)  # samples a window; fixed solvers step them
    slopes: bool = eqx.field(static=True)  # whether slopes are read besides displacements
    contacts: bool = eqx.field(static=True)  # whether ports are read
    coordinates: bool = eqx.field(static=True)  # whether all coordinates are read
    together: tuple[tuple[int, ...], ...] = eqx.field(static=True)
    batch: bool = eqx.field(static=True, default=False)  # whether vmapped lanes are one array
    massless: Massless | None = eqx.field(static=True, default=None)  # coordinates without mass


class Window(eqx.Module):
    """Motion of the stations over one window, at its samples, the first and the last included.

    Lanes that are observed together are a last axis.
    """

    displacement: Complex[Array, "T s ..."]  # [m]
    velocity: Complex[Array, "T s ..."]  # [m/s]
    slope: Complex[Array, "T s ..."] | None
    contact_force: Complex[Array, "T k ..."] | None  # [N]
    # All coordinates and their rates:
    coordinates: tuple[Complex[Array, "T n ..."], Complex[Array, "T n ..."]] | None
    step: Number  # time from sample to sample [s]
    sense: Number  # sign of the speed of rotation
    # Since the start [s]; None: not computed by revolutions
    time: Float[Array, "T ..."] | None = None
    speed: Float[Array, "T ..."] | None = None  # of rotation [rad/s]; None: that of the scene
    bodies: "Bodies | None" = None  # None: the scene has none
    states: Float[Array, "T x ..."] | None = None  # of laws; None: the scene has none


class Bodies(eqx.Module):
    """Motion of all balls over one window."""

    angle: Float[Array, "T b ..."]  # from the shaft, psi [rad]
    rate: Float[Array, "T b ..."]  # psi. [rad/s]
    imbalance: Complex[Array, "T ..."]  # of rotor and balls, in the axes of the shaft [kg m]


class AbstractMarch(eqx.Module):
    """Motion of one scene, advanced by whole windows.

    A window is a revolution at constant speed, or a stretch of evenly spaced samples along times. Lanes
    that are stepped go as one under `jax.vmap`, all at the same window: see docs/concepts/lanes.md.
    """

    plan: eqx.AbstractVar[Plan]

    @property
    @abc.abstractmethod
    def lanes_as_one(self) -> bool:
        """Whether lanes under `jax.vmap` go through their windows as one array, by `rows`."""

    @abc.abstractmethod
    def rows(
        self, y: Float[Array, "y lanes"], *, observed: bool
    ) -> tuple[Float[Array, "y lanes"], Window | None, Outcome]:
        """State after a window, its motion where it is `observed`, and its outcome, all lanes last."""

    @abc.abstractmethod
    def begin(self, start: AbstractStart, at: Scalar) -> Array:
        """State at the start; `at` [m] is the observed station."""

    @abc.abstractmethod
    def encode(self, *parts: Array) -> Array:
        """State of the parts that `decode` returns, which may be those of another march."""

    @abc.abstractmethod
    def decode(self, y: Array) -> tuple[Array, ...]:
        """Parts of a state: coordinates [m], velocities [m/s], and those of other moving parts."""

    @abc.abstractmethod
    def advance(self, y: Array) -> tuple[Array, Outcome]:
        """State after a window, and the outcome of the window."""

    @abc.abstractmethod
    def observe(self, y: Array) -> tuple[Array, Window, Outcome]:
        """State after a window, its motion and its outcome."""

    @property
    @abc.abstractmethod
    def contact_stiffness_ratio(self) -> Float[Array, "k 2"]:
        """See `Tableau.contact_stiffness_ratio`; zero where steps are not of one size."""

    @abc.abstractmethod
    def skip(self, y: Array, windows: Count) -> tuple[Array, Outcome]:
        """State after whole windows, and their outcome; `step_through`, unless there is a shorter way."""

    def step_through(self, y: Array, windows: Count) -> tuple[Array, Outcome]:
        """State after whole windows, one after the other, and their outcome.

        With a traced number of windows one program serves all lengths, in forward mode alone.
        """
        if self.lanes_as_one:
            of_all = lambda parts, y: parts[0]._through_rows(y, parts[1])
            return lanes_last(of_all, (self, windows), y)

        def one(carry, _):
            y, good = carry
            y, ok = self.advance(y)
            return (y, good & ok), None

        begin = y, Outcome.good()
        if not isinstance(windows, int):
            return jax.lax.fori_loop(0, windows, lambda _, carry: one(carry, None)[0], begin)
        if not windows:
            return begin
        return self.repeat(one, begin, windows)[0]

    def collect(self, y: Array, carry: Any, update: Callable, windows: int) -> Any:
        """Whole windows, with `carry, out = update(carry, window, number)` after each, from number 0.

        Returns `(state at the end, carry, outcome)` and the stacked `out` of all windows. Where lanes
        go as one, `update` has windows and carries of all lanes, along their last axis.
        """
        if self.lanes_as_one:
            of_all = lambda parts, y: parts[0]._collect_rows(y, parts[1], update, windows)
            return lanes_last(of_all, (self, carry), y)

        def one(state, _):
            number, y, carry, good = state
            y, window, ok = self.observe(y)
            carry, out = update(carry, window, number)
            return (number + 1, y, carry, good & ok), out

        begin = jnp.array(0), y, carry, Outcome.good()
        (_, *end), out = self.repeat(one, begin, windows)
        return end, out

    def _through_rows(
        self, y: Float[Array, "y lanes"], windows: int | Int[Array, "..."]
    ) -> tuple[Array, Outcome]:
        """`step_through`, lanes last."""
        if not isinstance(windows, int):
            if windows.shape[-1] > 1:
                raise ValueError(
                    "Lanes that go as one have one number of windows, but each has its own."
                )
            windows = windows[..., 0]

        def one(_, carry):
            y, good = carry
            y, _, ok = self.rows(y, observed=False)
            return y, good & ok

        return jax.lax.fori_loop(0, windows, one, (y, Outcome.good(y.shape[-1])))

    def _collect_rows(self, y: Float[Array, "y lanes"], carry: Any, update: Callable, windows: int):
        """`collect`, lanes last."""

        def one(state, number):
            y, carry, good = state
            y, window, ok = self.rows(y, observed=True)
            carry, out = update(carry, window, number)
            return (y, carry, good & ok), out

        of_all = lambda leaf: jnp.broadcast_to(leaf, (*leaf.shape[:-1], y.shape[-1]))
        begin = y, jax.tree.map(of_all, carry), Outcome.good(y.shape[-1])
        return jax.lax.scan(one, begin, jnp.arange(windows))

    def repeat(self, body: Callable, carry: Any, length: int) -> Any:
        """Scan over windows; in reverse mode memory grows as the root of their number."""
        # For 400 revolutions, equinox.internal.scan took 1.9 times as long at the same memory.
        repeat = lambda body, carry, length: jax.lax.scan(body, carry, None, length=length)
        if isinstance(self.plan.adjoint, dfx.ForwardMode):
            return repeat(body, carry, length)
        body = jax.checkpoint(body)
        if length < SHORT:
            return repeat(body, carry, length)
        segment = _segment(length)
        whole, rest = divmod(length, segment)
        several = jax.checkpoint(lambda carry, _: repeat(body, carry, segment))
        carry, out = repeat(several, carry, whole)
        out = jax.tree.map(lambda leaf: leaf.reshape(-1, *leaf.shape[2:]), out)
        if not rest:
            return carry, out
        carry, last = repeat(body, carry, rest)
        return carry, jax.tree.map(lambda *parts: jnp.concatenate(parts), out, last)


def _segment(length: int) -> int:
    """Windows from checkpoint to checkpoint: the divisor of their number nearest its root.

    Where no divisor is near, it is the root itself, and the remainder is compiled a second time.
    """
    root = math.isqrt(length)
    near = [n for n in range(root // 2 + 1, 2 * root + 1) if length % n == 0]
    return min(near, key=lambda n: abs(n - root), default=root)


def bounded(y: Array, axis: int | None = None) -> Bool[Array, "..."]:
    """Whether a state, along an axis or as a whole, and its squares are finite, as observables need."""
    return jnp.all(jnp.abs(y) < jnp.finfo(y.dtype).max ** 0.4, axis=axis)


def contact_forces(
    system: System,
    samples: Float[Array, "T 2 2 r ..."],
    now: Now,
    sampled: Now,
) -> Complex[Array, "T k ..."]:
    """Forces of all contacts by readings of a window, the last of which are those of the ports [N].

    What laws are given `now` has an axis of samples where `sampled` says 0 in place of None. Lanes are a
    last axis of all, by elementwise laws alone.
    """
    ports = samples[:, :, :, samples.shape[3] - len(system.ports) :]
    place, velocity = jnp.moveaxis(ports, (2, 1), (0, 3))  # (T, p, xy, ..) each
    vectors = jax.vmap(system.contact_forces, in_axes=(0, 0, sampled))(place, velocity, now)
    return jax.lax.complex(vectors[:, :, 0], vectors[:, :, 1])
