"""Simulate: one trajectory of one scene at constant speed."""

import contextlib
from typing import Any, Literal

import diffrax as dfx
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float, Int

from ..analysis import chosen_nodes
from ..core.checks import check_counts
from ..core.compiled import compiled
from ..core.outcome import Outcome, gains_energy, steps_needed
from ..core.pilot import Pilot, refined
from ..core.progress import waiting
from ..core.quantities import known
from ..core.tables import notebook_table
from ..equations.start import AbstractStart, AtRest, Continued
from ..equations.system import System, assemble, port_groups
from ..scene import Scene
from ..solvers.basis import Count
from ..solvers.choice import choose, solver_name
from ..solvers.exponential import Exponential
from .base import Plan
from .revolutions import March, check_constant_speed, check_mass, joined, revolution_rate


PILOT = 20  # revolutions at the end of a run, on which steps are chosen
LADDER = (64, 128, 256, 512, 1024, 2048, 4096)  # steps a revolution that are tried
KEPT = ("displacement", "velocity", "slope", "contact_force", "coordinates")  # of every sample


class Response(eqx.Module):
    """Motion of a scene over the revolutions that were kept, `T` samples at `s` stations."""

    time: Float[Array, " T"]  # [s] since the start
    angle: Float[Array, " T"]  # [rad] of revolution since the start
    displacement: Complex[Array, "T s"]  # x + i y [m]
    velocity: Complex[Array, "T s"]  # [m/s]
    slope: Complex[Array, "T s"]  # dz/dx [rad]
    contact_force: Complex[Array, "T k"] | None  # on the shaft, by contact of the scene [N]
    coordinates: Complex[Array, "T n"]  # of the equations of motion
    rates: Complex[Array, "T n"]  # [1/s] of them
    stations: Float[Array, " s"]  # [m]
    end: Continued  # state at the end, from which another run may continue
    unresolved: Int[Array, ""]  # steps in which `located=True` did not find all contact changes
    scene: Scene
    steps_per_revolution: int = eqx.field(static=True)
    solver: str = eqx.field(static=True)
    pilots: tuple[Pilot, ...] = eqx.field(default=(), static=True)  # that chose "auto" settings

    def _repr_html_(self) -> str:
        largest = np.abs(self.displacement).max(axis=0)
        heads = ("station [m]", "largest displacement [m]")
        return notebook_table(str(self), heads, list(zip(self.stations, largest, strict=True)))

    def __str__(self) -> str:
        turns = (self.time.size - 1) / self.steps_per_revolution
        where = ", ".join(f"{at:g}" for at in np.asarray(self.stations))
        chosen = "".join(f"; chosen {pilot}" for pilot in self.pilots)
        return (
            f"Response of {turns:g} revolutions at {where} m: {self.steps_per_revolution} samples "
            f"a revolution, {self.solver}{chosen}"
        )


def simulate(
    scene: Scene,
    revolutions: int,
    steps_per_revolution: int | Literal["auto"] = 256,
    *,
    nodes: int | Literal["auto"] | None = None,
    tolerance: float | int = 1e-3,
    solver: Exponential | dfx.AbstractSolver | None = None,
    controller: dfx.AbstractStepSizeController | None = None,
    start: AbstractStart | None = None,
    keep: int | None = None,
    at: float | Any | None = None,
    period: float | None = None,
    adjoint: dfx.AbstractAdjoint | None = None,
    max_steps: int = 4096,
    progress: bool | None = None,
) -> Response:
    """Motion `M q.. + (C - i Omega G) q. + (K - i Omega H) q = loads + contact forces` in time.

    Args:
        scene: rotor at constant speed.
        revolutions: length of the run in revolutions.
        steps_per_revolution: samples a revolution; also the steps of `Exponential` and of
            diffrax solvers without an error estimate. A scene without contact is exact at any. "auto"
            chooses them by a pilot run, see `chosen_steps`.
        nodes: number of nodes of the shaft, by default its own; "auto" chooses it, see `chosen_nodes`.
        tolerance: relative tolerance of "auto": of the motion for steps, of the roots for nodes.
        solver: `Exponential()` (default) or any diffrax solver, such as `diffrax.Kvaerno5()`.
        controller: step control of an adaptive diffrax solver; by default rtol 1e-7 and
            atol 1e-10 m.
        start: starting state, by default `AtRest()`; `response.end` continues a run.
        keep: number of revolutions at the end to keep, by default all.
        at: station(s) [m] to observe; by default that of the first contact, else of the first
            effect with a station, else the end of the shaft.
        period: length [s] of a "revolution" at zero speed; not allowed otherwise.
        adjoint: diffrax adjoint for derivatives: forward mode by default,
            `diffrax.RecursiveCheckpointAdjoint()` for reverse mode.
        max_steps: steps an adaptive solver may take in one revolution.
        progress: whether to report progress after two seconds; by default only on a terminal.

    Returns:
        A `Response`. If a run fails while values are traced, it is not finite.

    Raises:
        ValueError: if an argument is not as described, or the scene is not: a speed that varies,
            coordinates without mass, unequal axes of which some turn, balls, hysteretic damping, an
            undamped resonance.
        RuntimeError: if the motion does not stay finite, the solver does not meet its tolerance, or a
            stop was touched that is too stiff for the steps; not while values are traced.

    Source: Azarov, Gouskov, Panovko (2023), eq. (9); the solvers name theirs.
    """
    keep = revolutions if keep is None else keep
    scene, pilots = with_nodes(scene, nodes, tolerance)
    if steps_per_revolution == "auto":
        check_counts(revolutions=revolutions)
        run = {"solver": solver, "controller": controller, "start": start, "at": at}
        run |= {"period": period, "max_steps": max_steps}
        pilots += (chosen_steps(scene, revolutions, tolerance, **run),)
        steps_per_revolution = pilots[-1].setting
    check_counts(revolutions=revolutions, keep=keep, steps_per_revolution=steps_per_revolution)
    if keep > revolutions:
        raise ValueError(f"`keep` must not exceed `revolutions` = {revolutions}, but is {keep}.")
    check_constant_speed(scene, "`simulate`")
    groups = port_groups(scene)
    system = assemble(scene, groups)
    check_mass(scene, "`simulate`", system)
    start = _checked_start(start)
    stations, rate = scene.stations(at), revolution_rate(scene, period)
    plan = Plan(
        choose(solver, system, rate, start),
        controller,
        _checked_adjoint(adjoint, solver),
        max_steps,
        steps_per_revolution,
        slopes=True,
        contacts=True,
        coordinates=True,
        together=groups,
    )
    skip = revolutions - keep
    # One program serves runs of any length, except in reverse mode.
    if skip and groups and isinstance(plan.adjoint, dfx.ForwardMode):
        skip = jnp.asarray(skip)
    with waiting(progress, "simulation"):
        end, motion, good, ratio = _run(system, plan, start, rate, stations, skip, keep)
        failed = known(good.ok) and not bool(good.ok)
    if failed:
        start.state(system, stations[0])  # raises if the start is the cause
        raise RuntimeError(
            "The motion did not stay finite, or the solver could not meet its tolerance: take more "
            "`steps_per_revolution`, a larger `max_steps`, or look at `jaxrotor.roots` for growth."
        )
    if isinstance(plan.solver, Exponential):
        check_steps(good, ratio, plan.solver.order, steps_per_revolution)
    count = jnp.arange(keep * steps_per_revolution + 1)
    angle = 2 * jnp.pi * (revolutions - keep + count / steps_per_revolution)
    coordinates, rates = motion.pop("coordinates")
    return Response(
        time=angle / rate,
        angle=angle,
        **motion,
        coordinates=coordinates,
        rates=rates,
        stations=stations,
        end=Continued(*end),
        unresolved=good.unresolved,
        scene=scene,
        steps_per_revolution=steps_per_revolution,
        solver=solver_name(plan.solver),
        pilots=pilots,
    )


def _checked_start(start: Any) -> AbstractStart:
    """The starting state, by default at rest; raises unless it is one."""
    start = AtRest() if start is None else start
    if not isinstance(start, AbstractStart):
        raise ValueError(
            f"`start` must be a start such as Whirl(7e-3, rate=75.0) or `response.end`, but is {start!r}."
        )
    return start


def _checked_adjoint(adjoint: dfx.AbstractAdjoint | None, solver: Any) -> dfx.AbstractAdjoint:
    """The adjoint, by default forward mode; raises if the solver has no derivative of that kind."""
    adjoint = dfx.ForwardMode() if adjoint is None else adjoint
    if getattr(solver, "located", False) and not isinstance(adjoint, dfx.ForwardMode):
        raise ValueError(
            f"Located steps have derivatives in forward mode alone, but `adjoint` is "
            f"{type(adjoint).__name__}; use jax.jvp or jax.jacfwd, or Exponential(located=False)."
        )
    return adjoint


def with_nodes(
    scene: Scene, nodes: int | Literal["auto"] | None, tolerance: float | int
) -> tuple[Scene, tuple[Pilot, ...]]:
    """The scene with the nodes asked for, and the pilot that chose them, if "auto"."""
    if nodes is None:
        return scene, ()
    if nodes != "auto":
        return scene.with_nodes(nodes), ()
    pilot = chosen_nodes(scene, tolerance)
    return scene.with_nodes(pilot.setting), (pilot,)


def chosen_steps(
    scene: Scene, revolutions: int, tolerance: float | int = 1e-3, **run: Any
) -> Pilot:
    """Steps a revolution at which half as many give the same end of a run.

    The run advances to its last 20 revolutions by the fewest steps that stay finite. From there it is
    repeated with twice the steps until two successive displacements agree at all samples; if none do,
    `converged` is False and the most steps are taken. Nothing is promised for longer runs: motions that
    diverge exponentially (chaos) may agree over so short a window.

    Args:
        scene: rotor at constant speed.
        revolutions: length of the run in revolutions.
        tolerance: largest difference of two displacements, over the largest displacement.
        **run: `solver`, `start` and other arguments of `simulate`.

    Returns:
        A `Pilot`, whose `setting` is the number of steps a revolution.

    Raises:
        ValueError: if the scene is traced, the solver is adaptive, or `tolerance` is not positive.
    """
    if not all(known(leaf) for leaf in jax.tree.leaves(scene)):
        raise ValueError(
            'Steps "auto" are chosen by values, so not inside jax.jit or jax.grad; choose them before, '
            "by `jaxrotor.chosen_steps`."
        )
    if isinstance(run.get("solver"), dfx.AbstractAdaptiveSolver):
        raise ValueError(
            f'Steps "auto" are for solvers of fixed steps; {solver_name(run["solver"])} chooses its own '
            "by its tolerance, so give the number of samples."
        )
    window = min(PILOT, revolutions)
    if revolutions > window:
        run |= {"start": _end(scene, revolutions - window, run)}

    def displacement(steps: int) -> np.ndarray | None:
        try:
            found = simulate(scene, window, steps, **run).displacement
        except RuntimeError:  # not finite, or a stop too stiff for the steps: too few steps
            return None
        return np.asarray(found)[:: steps // LADDER[0]]

    return refined("steps a revolution", displacement, LADDER, tolerance)


def _end(scene: Scene, revolutions: int, run: dict[str, Any]) -> Continued:
    """End of a run by the fewest steps that stay finite."""
    for steps in LADDER[:-1]:
        with contextlib.suppress(RuntimeError):
            return simulate(scene, revolutions, steps, keep=1, **run).end
    return simulate(scene, revolutions, LADDER[-1], keep=1, **run).end


@compiled
def _run(system: System, plan: Plan, start, rate, stations, skip: Count, keep: int):
    """State at the end, the kept motion, the outcome, and the contact stiffness ratio."""
    march = March.of(system, plan, rate, stations)
    y, first = march.skip(march.begin(start, stations[0]), skip)
    update = lambda carry, samples: (carry, {name: getattr(samples, name) for name in KEPT})
    (y, _, good), revolutions = march.collect(y, None, update, keep)
    motion = jax.tree.map(joined, revolutions)
    return march.form.decode(y), motion, first & good, march.contact_stiffness_ratio


def check_steps(good: Outcome, ratio: Array, order: int, steps: int) -> None:
    """Raise if a stop was touched whose rebounds gain energy by steps of this size."""
    if gains_energy(good.touched, ratio, order):
        raise RuntimeError(
            "A stop was touched that is too stiff for the steps, so that a rebound would gain energy: "
            f"take at least {steps_needed(ratio, order, steps)} `steps_per_revolution` instead of "
            f"{steps}, or a softer stop."
        )
