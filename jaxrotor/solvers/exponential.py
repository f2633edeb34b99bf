"""Exponential integrator: the linear rotor exactly, contact forces by Cox-Matthews stages.

    w' = A w + B f(C w + steady(theta)),   w = state less the exact steady response

The eigenvalues of `A`, however stiff, set no step limit, and motion without contact is exact at any
step. Contact forces depend on the state only through a few ports, so a step needs one product from the
state to the stage values of the ports, the forces, and one product back. See docs/concepts/ports.md.
"""

import functools
from typing import Any, Literal, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Float, Int

from ..core.lanes import lanes_last
from ..equations.clocks import Clocks, since
from ..equations.constant_frame import ConstantFrame
from ..equations.pencil import isotropic
from ..equations.stationary_frame import Motion
from ..equations.system import System
from .basis import Basis, Count, dense, modal
from .forcing import AtConstantSpeed
from .located import LocatedStep
from .ports import PortForm, YieldingReading
from .reading import Reading
from .rotor import RotorAtSpeed
from .shapes import Shapes
from .step import Step, StepData, in_turn
from .tableau import phase_at


class Exponential(eqx.Module):
    """Exponential integrator of `order` 2 or 4, with `basis` "modal", "dense" or "auto".

    `located=True` ends a step where contact begins or ends or friction reverses, and so keeps the order
    through impacts; otherwise those steps are of first order. A step and its compilation then take several
    times as long, which pays where the state is wanted to better than 1e-4 or a whirl rate to better than
    1e-6. Its derivatives are in forward mode alone.

    Modal coordinates take the fewest operations. They fail where eigenvectors merge (over-damped or
    defective pairs), and their derivatives, in forward and reverse mode, fail earlier; "auto" takes the
    dense matrix exponential there and whenever parameters are traced.

    With contact at constant speed, the deviation from the steady response can be made up of a few
    `shapes`, see `Shapes`: not modes, but those motions that forces at the contacts excite and that
    contacts and stations see. "auto" takes as many as `jr.sweep` and `jr.simulate` need for their
    `tolerance`, and elsewhere, as None does, all coordinates. What of the start is not made up of them is
    lost, so they are for motions that go on in contact, not for the first revolutions.

    `fused=True` steps the lanes of `jr.sweep` through a revolution by one kernel on an NVIDIA GPU. Without
    it, a step takes 8 to 18 kernels there, between which the states go through the memory. Results differ
    by rounding. Located steps, runs along times and contacts on parts without mass are refused. Nothing
    else changes on other processors, in what is not a sweep, and where a lane has more than 64
    coefficients of its own, as where lanes of a chunk differ in the speed. No GPU has run it yet. See
    docs/cluster.md.
    """

    order: Literal[2, 4] = eqx.field(default=2, static=True)
    basis: Literal["auto", "modal", "dense"] = eqx.field(default="auto", static=True)
    located: bool = eqx.field(default=False, static=True)
    shapes: int | Literal["auto"] | None = eqx.field(default=None, static=True)
    fused: bool = eqx.field(default=False, static=True)

    def __check_init__(self):
        if self.order not in (2, 4):
            raise ValueError(f"`order` must be 2 or 4, but is {self.order!r}.")
        if self.basis not in ("auto", "modal", "dense"):
            raise ValueError(f"`basis` must be 'auto', 'modal' or 'dense', but is {self.basis!r}.")
        counted = isinstance(self.shapes, int) and self.shapes > 0 and self.shapes is not True
        if not (counted or self.shapes in (None, "auto")):
            raise ValueError(
                f"`shapes` must be a positive whole number, 'auto' or None, but is {self.shapes!r}."
            )
        if self.fused and self.located:
            raise ValueError(
                "`fused=True` is for steps of one size, but `located=True` ends steps where contact "
                "begins or ends; take one of both."
            )

    def form(
        self,
        system: System,
        motion: Motion,
        rows: Float[Array, "s n"],
        basis: Basis | None = None,
        stations: int = 1,
    ) -> PortForm:
        """The motion in the coordinates of this solver's basis, with stations `rows` to read.

        A `basis` may be given, that of `linear_matrix`. Shapes, where some are asked for, are those
        by which the first `stations` of the rows are seen.
        """
        shapes = None
        if isinstance(self.shapes, int) and self.shapes < system.n and system.ports:
            shapes = Shapes.of(system, motion.rate, rows[:stations], self.shapes)
        make = dense if self.basis == "dense" else modal
        if isotropic(system.blocks) and system.massless is None:
            own = make(motion.matrix(), shapes) if basis is None else basis
            return PortForm.build(system, motion, rows, own)
        axes = ConstantFrame.of(system, motion.rate)
        own = make(axes.matrix, shapes) if basis is None else basis
        return PortForm.along_axes(axes, motion, rows, own)

    def stepper(
        self, form: PortForm, steps: Count, span: ArrayLike = 2 * jnp.pi
    ) -> Step | LocatedStep | None:
        """A step, of `steps` in an angle `span` [rad]; None without contact, where no steps are needed."""
        if form.contacts is None:
            return None
        step = form.step(self.order, jnp.asarray(span) / steps, AtConstantSpeed(form.field))
        return self.located_of(form, step)

    def located_of(self, rotor: PortForm | RotorAtSpeed, step: Step) -> Step | LocatedStep:
        """A step of a rotor, located where this solver is so and a law of contact has kinks."""
        kinked = any(law.kinked for port in step.ports for law in port.laws)
        return LocatedStep.of(rotor, step) if self.located and kinked else step


class Revolution(NamedTuple):
    """A revolution by steps, of one motion or of lanes last."""

    end: Float[Array, "m2 ..."]
    # What the stations read at the start and after every step, and then states of laws:
    samples: Float[Array, "T r ..."] | None
    unresolved: Int[Array, "..."]  # steps whose changes of contact were not located


def revolution(
    step: Step | LocatedStep,
    y: Float[Array, " m2"],
    steps: int,
    stations: Reading | YieldingReading | None,
    *,
    batch: bool = False,
    fused: bool = False,
) -> Revolution:
    """A revolution of `steps` from angle 0, read by stations where some are given.

    With `batch`, all lanes under `jax.vmap` are stepped as one array, on a GPU with `fused` by one kernel.
    """
    if isinstance(step, LocatedStep) and not batch:  # one lane runs with all its tangents
        return revolution_of_lanes(step, stations, y, steps)

    def run(parts, y):
        step, stations = parts
        return revolution_of_lanes(step, stations, y, steps, unrolled=batch, fused=fused)

    return lanes_last(run, (step, stations), y, batch=batch)


def revolution_of_lanes(
    step: Step | LocatedStep,
    stations: Reading | YieldingReading | None,
    y: Float[Array, "m2 ..."],
    steps: int,
    *,
    unrolled: bool = True,
    fused: bool = False,
) -> Revolution:
    """The same of all lanes, lanes last. The last numbers of a state are turns of other clocks."""
    how = {"unrolled": unrolled, "fused": fused}
    if (clocks := _clocks_of(step)) is None:
        return _revolution(step, stations, y, steps, **how)
    y, turns = jnp.split(y, [len(y) - len(clocks.rates)])
    step, stations = since((step, stations), turns)
    done = _revolution(step, stations, y, steps, **how)
    return done._replace(end=jnp.concatenate([done.end, clocks.after(turns)]))


def _plain(step: Step | LocatedStep) -> Any:
    """The step that is not located."""
    return step.whole if isinstance(step, LocatedStep) else step


def _clocks_of(step: Step | LocatedStep) -> Clocks | None:
    """Clocks of other shafts in a step."""
    return _plain(step).forcing.reading.clocks


def _revolution(
    step: Step | LocatedStep,
    stations: Reading | YieldingReading | None,
    y: Float[Array, "m2 ..."],
    steps: int,
    *,
    unrolled: bool,
    fused: bool,
) -> Revolution:
    """The same where other clocks, if there are any, begin at zero."""
    if isinstance(step, LocatedStep):
        return _located_revolution(step, stations, y, steps)
    clocks = _clocks_of(step)
    rates = () if clocks is None else clocks.rates
    phases = step.tableau.phases(step.tableau.h * jnp.arange(steps), rates)
    # Unrolled by two, the loop needs no copy of the state back to its buffer.
    unroll = 2 if unrolled and stations is None and steps % 2 == 0 else 1
    parts = step, stations
    if fused and unrolled and y.shape[-1] > 1 and phases.ndim == 3:
        from .fused import on_gpu  # pallas takes 0.4 s to load

        y, samples = on_gpu(_stepped, parts, y, phases, unroll)
    else:
        y, samples = jax.lax.scan(functools.partial(_stepped, parts), y, phases, unroll=unroll)
    if stations is None or samples is None:
        return Revolution(y, None, jnp.zeros(y.shape[1:], int))
    last = phases[0, 0] if clocks is None else phases[-1, -1]
    samples = jnp.concatenate([samples, _seen(step, stations, last, y)[None]])
    return Revolution(y, samples, jnp.zeros(y.shape[1:], int))


def _located_revolution(
    step: LocatedStep,
    stations: Reading | YieldingReading | None,
    y: Float[Array, "m2 ..."],
    steps: int,
) -> Revolution:
    """A revolution by located steps, of one motion or of lanes last."""
    angles = jnp.multiply.outer(jnp.arange(steps + 1), step.tableau.h)
    clocks = _clocks_of(step)
    phases = phase_at(angles, () if clocks is None else clocks.rates, axis=1)

    def one(carry, following):
        y, unresolved, (known, phase) = carry
        end, _, more = step.advance_by(known, y)
        seen = None if stations is None else _seen(step, stations, phase, y)
        return (end, unresolved + more, following), seen

    first, after = in_turn((jax.vmap(step.data_of)(angles[:-1]), phases[:-1]))
    begin = y, jnp.zeros(y.shape[1:], int), first
    (y, unresolved, _), samples = jax.lax.scan(one, begin, after)
    if stations is not None and samples is not None:
        samples = jnp.concatenate([samples, _seen(step, stations, phases[-1], y)[None]])
    return Revolution(y, samples, unresolved)


def _stepped(
    parts: tuple[Step, Reading | YieldingReading | None],
    y: Float[Array, "m2 lanes"],
    phases: Float[Array, "c c2 ..."],
) -> tuple[Float[Array, "m2 lanes"], Float[Array, "s4 lanes"] | None]:
    """States after a step, and what the stations read before it, lanes last."""
    step, stations = parts
    seen = None if stations is None else _seen(step, stations, phases[0], y)
    return step(StepData(phases), y)[0], seen


def _seen(
    step: Step | LocatedStep,
    stations: Reading | YieldingReading,
    phase: Float[Array, "c2 ..."],
    y: Float[Array, "m2 ..."],
) -> Float[Array, "r ..."]:
    """Readings of the stations, and then states of laws, at a phase."""
    if not step.forcing.others:
        return stations.of_lanes(phase, y)
    w, x = jnp.split(y, [len(y) - step.forcing.others])
    return jnp.concatenate([stations.of_lanes(phase, w), x])
