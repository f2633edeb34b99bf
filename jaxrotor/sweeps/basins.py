"""Basins: the motions in which many starts of a ball balancer end."""

from typing import Any, NamedTuple

import diffrax as dfx
import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr
from jaxtyping import Array, Float

from ..core.attributes import about, flags
from ..core.checks import check_counts
from ..core.compiled import compiled
from ..core.parallel import chunk_size, cores, spread
from ..core.progress import progress as bar
from ..effects.base import AbstractBodies
from ..equations.rotating_frame import massless_of
from ..equations.start import AbstractStart, AtRest, Balls, Launch
from ..files.toml import dumps
from ..motion.run_up import by_race, imbalance_of
from ..motion.transient import Integration, controller_for, integrate
from ..results.provenance import as_json, assumed, versions
from ..scene import Scene
from ..solvers.choice import checked_solver, solver_name
from ..solvers.control import tuned
from ..solvers.exponential import Exponential
from ..spins.drive import Drive


OUTCOMES = ("balanced", "synchronous_unbalanced", "partly_captured", "captured", "failed")


def basins(
    scene: Scene,
    angles: Any,
    duration: float,
    *,
    rates: Any = 0.0,
    window: float = 0.1,
    within: float = 1e-3,
    slip: float = 1e-3,
    shaft: AbstractStart | None = None,
    samples: int = 64,
    solver: dfx.AbstractSolver | None = None,
    controller: dfx.AbstractStepSizeController | None = None,
    lanes_per_chunk: int = 256,
    workers: int | None = None,
    progress: bool | None = None,
    max_steps: int = 100_000,
) -> xr.Dataset:
    """Outcome of many starts: balanced, unbalanced but synchronous, or balls captured in a lag whirl.

    The outcome is judged over the last `window` of the run. A ball is synchronous when its mean rate
    differs from that of the shaft by less than `slip` of it; a rotor is balanced when all balls are, and
    the rms of the imbalance is below `within` of what its balls can balance. A motion that still drifts
    is classified as it is then: lengthen the run until the shares no longer change.

    Starts of a chunk wait for the slowest. 200 starts of 5 s of the scene `ball-balancer` take 300 to
    500 steps and 2 s of one core, above the critical speed and below, after 15 s of compilation; where
    no progress is shown, time a few starts first.

    Args:
        scene: a rotor with balls.
        angles: (lanes, balls) first angles from the shaft [rad], races one after the other.
        duration: length of the runs [s].
        rates: (lanes, balls) or one, first rates from the shaft [rad/s]; minus the speed is at rest.
        window: share of the run that is observed, at its end.
        within: imbalance that counts as balanced, as a share of the capacity of the balls.
        slip: difference of mean rates that counts as synchronous, as a share of the mean speed.
        shaft: starting state of the shaft, by default `AtRest()`.
        samples: number of instants in the window, two or more.
        solver: any diffrax solver with an error estimate, by default Dopri8.
        controller: step control, by default rtol 1e-6 and atol 1e-9 of m and rad.
        lanes_per_chunk: starts run as one program.
        workers: chunks run at once, by default one a core.
        progress: whether to show a progress bar; by default on a terminal.
        max_steps: steps a run may take; one that needs more, or steps below 1e-12 of the
            duration, has failed.

    Returns:
        Dataset over `lane` and `ball`: `outcome`, `imbalance` (rms) [kg m], `radius` (largest, of the
        station of the first race) [m], `mean_rate` of every ball [rad/s]; not differentiable.

    Raises:
        ValueError: if the scene has no balls or its drive can stop, a start is not finite or not of so
            many balls, `duration`, `window` or `samples` are not admissible, or the solver has no error
            estimate.

    Source: Filimonikhin, Goncharov (2011); its balls start anywhere, and not all end in balance.
    """
    starts = _starts(scene, angles, rates)
    _check_run(scene, duration, window, samples)
    chosen: Any = checked_solver(dfx.Dopri8() if solver is None else solver)
    plan = _plan(scene, chosen, controller, duration, max_steps)
    times = jnp.linspace((1 - window) * duration, duration, samples)
    shaft = AtRest() if shaft is None else shaft
    workers = cores(workers)
    size = chunk_size(len(starts), lanes_per_chunk, workers)
    chunks = [starts[i : i + size] for i in range(0, len(starts), size)]

    def run(chunk: np.ndarray, tick):
        padded = np.concatenate([chunk, np.repeat(chunk[-1:], size - len(chunk), axis=0)])
        out = _ends(scene, times, shaft, jnp.asarray(padded), plan)
        tick(1)
        return jax.tree.map(lambda leaf: np.asarray(leaf)[: len(chunk)], out)

    with bar(progress, len(chunks), f"{len(starts)} starts", "starts", size) as tick:
        parts = spread(run, chunks, workers, tick)
    ends = End(*map(np.concatenate, zip(*parts, strict=True)))
    settings = {
        "duration": float(duration),
        "window": float(window),
        "within": float(within),
        "slip": float(slip),
        "solver": solver_name(chosen),
        "controller": as_json(plan.controller),
    }
    return _dataset(scene, starts[:, 0], ends, _outcomes(scene, ends, within, slip), settings)


class End(NamedTuple):
    """How runs end, observed over their last window; lanes in front."""

    imbalance: Any  # rms [kg m]
    radius: Any  # largest [m]
    mean_rate: Any  # of every ball [rad/s]
    lag: Any  # mean rate of every ball from the shaft [rad/s]
    good: Any  # whether the run reached its end


# === before the runs


def _starts(scene: Scene, angles: Any, rates: Any) -> Float[np.ndarray, "l 2 b"]:
    """First angles and rates of all balls, checked."""
    races = scene.of(AbstractBodies)
    if not races:
        raise ValueError(
            "The scene has no balls, so starts have nothing to choose; add BallBalancer."
        )
    count = sum(race.places for race in races)
    angles = np.asarray(angles, float)
    if angles.ndim != 2 or angles.shape[1] != count or not angles.size:
        raise ValueError(f"`angles` must be (lanes, {count}), but is {angles.shape}.")
    rates = np.broadcast_to(np.asarray(rates, float), angles.shape)
    for name, values in (("angles", angles), ("rates", rates)):
        if not np.isfinite(values).all():
            lane = int(np.argmin(np.isfinite(values).all(axis=1)))
            raise ValueError(f"`{name}` must be finite, but are {values[lane]} in lane {lane}.")
    return np.stack([angles, rates], axis=1)


def _check_run(scene: Scene, duration: float, window: float, samples: int) -> None:
    """Raise unless the balls of a scene can be observed over the end of such a run."""
    if not 0 < window <= 1 or not 0 < duration < np.inf:
        raise ValueError(
            f"`duration` must be positive and `window` up to 1, but are {duration} and {window}."
        )
    check_counts(samples=samples)
    if samples < 2:
        raise ValueError(f"`samples` must be at least 2 to tell a mean rate, but is {samples}.")
    if isinstance(scene.spin, Drive) and scene.spin.can_stop:
        raise ValueError(
            "Balls are compared with the speed of the shaft, which has none once it is at rest; give a "
            "drive without `stops` and `coulomb`."
        )


def _plan(
    scene: Scene,
    solver: Any,
    controller: dfx.AbstractStepSizeController | None,
    duration: float,
    max_steps: int,
) -> Integration:
    """How the runs are integrated, by steps that an error estimate chooses."""
    steps = controller or controller_for(
        solver, scene, rtol=1e-6, atol=1e-9, dtmin=1e-12 * duration
    )
    if isinstance(solver, Exponential) or steps is None:
        raise ValueError(
            f"`solver` must choose its steps by an error estimate, but {solver_name(solver)} has none; "
            "give one such as diffrax.Dopri8(), or a `controller`."
        )
    return Integration(
        solver=tuned(solver),
        controller=steps,
        adjoint=dfx.ForwardMode(),
        substeps=1,
        max_steps=max_steps,
        max_stops=0,
        free=not scene.spin.given,
        from_start=False,
        massless=massless_of(scene),
    )


# === the runs


@compiled
def _ends(
    scene: Scene,
    times: Array,
    shaft: AbstractStart,
    starts: Float[Array, "l 2 b"],
    plan: Integration,
) -> End:
    """The end of the run from every start."""
    races = scene.of(AbstractBodies)

    def one(start):
        pairs = zip(by_race(scene, start[0]), by_race(scene, start[1]), strict=True)
        launch = Launch(shaft, 0.0, tuple(Balls(*pair) for pair in pairs))
        run = integrate(scene, times, launch, jnp.atleast_1d(races[0].at), plan)
        instants, displacement = run.instants, run.seen[0]
        total = imbalance_of(scene, instants.bodies)
        span = times[-1] - times[0]
        lag = (instants.bodies[-1] - instants.bodies[0]) / span
        speed = (instants.turning.angle[-1] - instants.turning.angle[0]) / span
        rms = jnp.sqrt(jnp.mean(jnp.abs(total) ** 2))
        return End(rms, jnp.max(jnp.abs(displacement)), speed + lag, lag, run.good)

    return jax.vmap(one)(starts)


def _outcomes(scene: Scene, ends: End, within: float, slip: float) -> np.ndarray:
    """Number in `OUTCOMES` of every lane."""
    races = scene.of(AbstractBodies)
    capacity = sum(float(jnp.sum(race.masses) * race.race_radius) for race in races)
    late = np.abs(ends.lag) > slip * np.abs(ends.mean_rate - ends.lag)
    outcome = np.where(ends.imbalance < within * capacity, 0, 1)
    outcome = np.where(late.any(axis=1), np.where(late.all(axis=1), 3, 2), outcome)
    return np.where(ends.good, outcome, 4).astype(np.int8)


def _dataset(
    scene: Scene, angles: np.ndarray, ends: End, outcome: np.ndarray, settings: dict[str, Any]
) -> xr.Dataset:
    """Labelled outcomes of all starts."""
    races = scene.of(AbstractBodies)
    lane, both = ("lane",), ("lane", "ball")
    return xr.Dataset(
        {
            "outcome": (lane, outcome, flags("where the start ended", OUTCOMES)),
            "imbalance": (lane, ends.imbalance, about("kg m", "rms imbalance")),
            "radius": (lane, ends.radius, about("m", "largest displacement")),
            "mean_rate": (both, ends.mean_rate, about("rad/s", "mean rate of the ball")),
            "start": (both, angles, about("rad", "first angle from the shaft")),
        },
        {"race": ("ball", np.repeat(np.arange(len(races)), [race.places for race in races]))},
        {
            "title": "jaxrotor basins of a ball balancer",
            "scene": dumps(scene),
            **assumed(scene),
            **settings,
            "versions": versions(),
        },
    )
