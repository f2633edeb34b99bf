"""Windows: a motion along evenly spaced samples, advanced from window to window of them."""

import dataclasses
import math
from collections.abc import Sequence
from typing import Any, cast

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float

from ..core.lanes import lanes_last, per_lane, product
from ..core.outcome import Outcome
from ..core.quantities import Scalar
from ..effects.law import Now
from ..equations.constant_frame import linear_matrix
from ..equations.coupled import AuxiliaryState
from ..equations.fixed_axes import depends_on_speed
from ..equations.start import AbstractStart, Continued, Launch
from ..equations.system import System, assemble
from ..scene import Scene
from ..solvers.basis import Count, modal
from ..solvers.exponential import Exponential
from ..solvers.located import LocatedStep
from ..solvers.ports import take_lanes
from ..solvers.step import Step
from .base import AbstractMarch, Bodies, Plan, Window, bounded, contact_forces
from .history import imbalance_of
from .run_up import after, with_balls
from .speeds import coupled_steps, decomposed_at, expected_speed, steps_between
from .stepped import Stepping
from .stepped_rotor import SteppedRotor, starts


LEAST, USUAL, MOST = 8, 32, 128  # intervals of a window
MOST_MODES = 24  # in which the change of speed acts, as all lanes share one speed of decomposition


class WindowMarch(AbstractMarch):
    """Motion of one scene along evenly spaced samples, advanced by whole windows of them.

    The rotor is decomposed at one speed, so that lanes whose speeds differ share the coefficients of a
    step. The last entry of a state counts the windows.
    """

    plan: Plan
    scene: Scene
    rotor: SteppedRotor
    step: Step | LocatedStep
    reading: Float[Array, "4 m2"]  # [Re, Im] of the station's motion
    length: Scalar  # from sample to sample [s]
    substeps: int = eqx.field(static=True)  # there
    before: int = eqx.field(static=True)  # intervals before the first sample

    @classmethod
    def build(
        cls,
        scene: Scene,
        plan: Plan,
        stepping: Stepping,
        start: AbstractStart,
        station: Float[Array, "1"],
    ) -> "WindowMarch":
        """Assemble a scene, as it is at a start, for a plan and its steps, with one station to read."""
        launch, solver = Launch.of(start), plan.solver
        scene = after(scene, launch)
        system = assemble(scene, plan.together)
        (centre,), rate = stepping.centres(system)
        assert isinstance(solver, Exponential)
        basis = None
        if solver.basis != "dense":
            basis = modal(linear_matrix(decomposed_at(system, centre), rate))
        rotor = SteppedRotor.build(scene, system, stepping, launch.angle, (centre, basis))
        length = stepping.breaks[1] - stepping.breaks[0]
        step = rotor.plain(solver.order, length / stepping.substeps)
        return cls(
            plan=plan,
            scene=scene,
            rotor=rotor,
            step=solver.located_of(rotor.rotor, step),
            reading=rotor.rotor.reading(system.line.row(station[0])),
            length=length,
            substeps=stepping.substeps,
            before=stepping.before,
        )

    def begin(self, start: AbstractStart, at: Scalar) -> Array:
        launch = with_balls(self.scene, Launch.of(start))
        return jnp.append(self.rotor.begin(launch, at), 0.0)

    def encode(self, *parts: Array) -> Array:
        """State at the first sample of the parts that `decode` returns."""
        q, velocity, *rest = parts
        launch, system = Launch(Continued(q, velocity), self.rotor.angle), self.rotor.system
        others = AuxiliaryState.of(launch, system, free=bool(self.rotor.sizes.spin))
        if rest:
            angles, speeds, states = rest
            named = lambda others: (others.bodies, others.bodies_rate, others.states)
            moved = angles, speeds - system.spin.speed, states
            others = eqx.tree_at(named, others, moved)
        return jnp.append(self.rotor.encode(q, velocity, others), 0.0)

    def decode(self, y: Array) -> tuple[Array, ...]:
        """Coordinates [m], velocities [m/s]; angles [rad] and speeds [rad/s] of balls, states of laws.

        What follows the velocities is left out where nothing moves with the rotor.
        """
        q, velocity, others = self.rotor.decode(y[:-1])
        if self.rotor.forces is None:
            return q, velocity
        speed = self.rotor.turning(self.times(y[-1])[0], others).speed
        return q, velocity, others.bodies, others.bodies_rate + speed, others.states

    @property
    def eigenvectors(self) -> Array | np.ndarray:
        """Those of the linear equations, by which the basis is judged."""
        return self.rotor.rotor.basis.vectors

    @property
    def contact_stiffness_ratio(self) -> Float[Array, "k 2"]:
        """See `Tableau.contact_stiffness_ratio`; zero without contact."""
        return self.step.contact_stiffness_ratio

    def skip(self, y: Array, windows: Count) -> tuple[Array, Outcome]:
        """State at the first sample, and outcome; there is one window before it, of its own length."""
        del windows
        ahead = lambda march, y: march._ahead(y)
        return lanes_last(ahead, self, y, batch=self.plan.batch)

    def advance(self, y: Array) -> tuple[Array, Outcome]:
        unobserved = lambda march, y: march.rows(y, observed=False)[::2]
        return lanes_last(unobserved, self, y, batch=self.plan.batch)

    def observe(self, y: Array) -> tuple[Array, Window, Outcome]:
        observed = lambda march, y: march.rows(y, observed=True)
        return lanes_last(observed, self, y, batch=self.plan.batch)

    @property
    def lanes_as_one(self) -> bool:
        return self.plan.batch

    def rows(self, y, *, observed):
        times = self.times(y[-1, :1])  # all lanes are at the same window
        end, outcome, samples = self._stepped(y[:-1], times[:-1], observed=observed)
        y = jnp.concatenate([end, y[-1:] + 1])
        if samples is None:
            return y, None, outcome
        ports, *seen = samples
        window, now = per_lane(lambda march, seen: march._window(*seen), self, (times, *seen))
        if now is not None:
            if take_lanes(self.rotor.system.ports):
                forces = self._forces(ports, now)
            else:
                forces = per_lane(lambda march, of: march._forces(*of), self, (ports, now))
            window = dataclasses.replace(window, contact_force=forces)
        return y, window, outcome

    def times(self, number: Float[Array, "..."]) -> Float[Array, "T ..."]:
        """Times of the samples of a window, by its number [s]."""
        size = self.plan.steps
        samples = jnp.arange(size + 1).reshape(-1, *[1] * jnp.ndim(number))
        return (self.before + number * size + samples) * self.length

    def _ahead(self, y: Float[Array, "y lanes"]) -> tuple[Array, Outcome]:
        """State at the first sample, and outcome, lanes last."""
        begins = jnp.arange(self.before)[:, None] * self.length
        end, outcome, _ = self._stepped(y[:-1], begins, observed=False)
        return jnp.concatenate([end, 0 * y[-1:]]), outcome

    def _stepped(
        self, y: Float[Array, "y lanes"], times: Float[Array, "T 1"], *, observed: bool
    ) -> tuple[Array, Outcome, Any]:
        """State after the intervals that begin at some times, their outcome, and samples, lanes last.

        Samples are readings of the ports, what moves with the rotor, and readings of the station.
        """
        known = self.rotor.schedule, self.length
        begins = lambda known, time: starts(known[0], time, known[1], self.substeps)

        def seen(y: Array) -> Any:
            if not observed:
                return None
            w, x = jnp.split(y, [len(y) - self.rotor.sizes.total])
            ports = product(self.step.reading, w) if self.plan.contacts else None
            return ports, x, product(self.reading, w)

        def one(carry, time):
            y, touched, unresolved = carry
            end, loaded, more = self.step.several(per_lane(begins, known, time), y)
            return (end, touched | loaded, unresolved + more), seen(y)

        lanes = y.shape[1:]
        first = y, jnp.zeros(lanes, bool), jnp.zeros(lanes, int)
        (y, touched, unresolved), samples = jax.lax.scan(one, first, times)
        samples = jax.tree.map(
            lambda all, last: jnp.concatenate([all, last[None]]), samples, seen(y)
        )
        return y, Outcome(bounded(y, axis=0), jnp.ones(lanes, bool), unresolved, touched), samples

    def _window(self, times, x, seen) -> tuple[Window, Now | None]:
        """The window of one lane by its samples, without forces, and what laws are given in it."""
        rotor, system = self.rotor, self.rotor.system
        others = jax.vmap(rotor.sizes.named)(x)
        turning = jax.vmap(rotor.turning)(times, others)
        bodies = None
        if system.races:
            imbalance = imbalance_of(self.scene, others.bodies)
            bodies = Bodies(others.bodies, others.bodies_rate, imbalance)
        z = seen[:, :2] + 1j * seen[:, 2:]  # (T, displacement or velocity)
        speed, states = turning.speed, others.states if system.state_count else None
        motion = z[:, :1], z[:, 1:], None, None, None
        window = Window(*motion, self.length, jnp.sign(speed[-1]), times, speed, bodies, states)
        read = self.plan.contacts and system.ports
        known = {"acceleration": turning.acceleration, "time": times}
        return window, Now(speed, turning.angle, others.states, **known) if read else None

    def _forces(self, ports: Float[Array, "T p4 ..."], now: Now) -> Complex[Array, "T k ..."]:
        """Forces of all contacts by the readings of the ports [N]."""
        system = self.rotor.system
        samples = ports.reshape(len(ports), 2, 2, len(system.ports), *ports.shape[2:])
        sampled = cast(Any, Now)(0, 0, 0, acceleration=0, time=0)
        return contact_forces(system, samples, now, sampled)


def window_of(samples: int) -> int:
    """Intervals of a window: a divisor of the number of all, near `USUAL`."""
    intervals = samples - 1
    if intervals <= MOST:
        divisors = [n for n in range(1, samples) if intervals % n == 0]
    else:
        divisors = [n for n in range(LEAST, MOST + 1) if intervals % n == 0]
    if not divisors:
        near = USUAL * round(intervals / USUAL) + 1
        raise ValueError(
            f"{samples} samples cannot be cut into windows of {LEAST} to {MOST} intervals; take {near}."
        )
    return min(divisors, key=lambda n: abs(math.log(n / USUAL)))


def lane_stepping(
    systems: Sequence[System],
    times: np.ndarray,
    solver: Exponential,
    revolution: int,
    ball_rate: float = 0.0,
) -> Stepping:
    """Steps that all lanes share, of which the `systems` hold the extremes.

    A revolution of the fastest has `revolution` steps or more, see `coupled_steps`.
    """
    speeds = np.stack([np.asarray(expected_speed(one, jnp.asarray(times))) for one in systems])
    first = systems[0]
    length = float(times[1])
    if first.coupled:
        each = max(
            coupled_steps(one, length, own, ball_rate, revolution)
            for one, own in zip(systems, speeds, strict=True)
        )
    else:
        each = steps_between(length, float(np.abs(speeds).max()), revolution)
    varies = np.ptp(speeds) > 0 or not first.spin.given
    depends = depends_on_speed(first.blocks) and varies
    most = first.n if first.coupled else MOST_MODES
    return Stepping(
        solver,
        jnp.asarray(times),
        jnp.arange(times.size),
        each,
        even=True,
        modes=min(most, first.n) if depends else 0,
        speeds=1,
        span=(jnp.asarray(speeds.min()), jnp.asarray(speeds.max())),
    )
