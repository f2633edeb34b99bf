"""Basins: the motions in which many starts of a ball balancer end."""

from typing import Any

import diffrax as dfx
import jax.numpy as jnp
import numpy as np
import xarray as xr

from ..core.attributes import about, flags
from ..core.checks import check_counts
from ..core.outcome import failed
from ..effects.base import AbstractBodies
from ..equations.start import AbstractStart, AtRest, Launch
from ..motion.transient import controller_for
from ..scene import Scene
from ..solvers.choice import checked_solver, solver_name
from ..spins.drive import Drive
from .observe import BallLag, Imbalance, Radius
from .sweep import sweep


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
    max_steps: int = 100_000,
    **options: Any,
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
        max_steps: steps that a run may take until the window, and again in each part of it; one that
            needs more, or steps below 1e-12 of the duration, has failed.
        **options: other options of `sweep`, which runs the starts: `store`, `workers`, `cluster`,
            `error_sample`, `progress`.

    Returns:
        Dataset over `lane` and `ball`: `outcome`, `imbalance` (rms) [kg m], `radius` (largest, of the
        station of the first race) [m], `mean_rate` of every ball [rad/s]; not differentiable.

    Raises:
        ValueError: if the scene has no balls or its drive can stop, a start is not finite or not of so
            many balls, `duration`, `window` or `samples` are not admissible, or the solver has no error
            estimate.

    Source: Filimonikhin, Goncharov (2011); its balls start anywhere, and not all end in balance.
    """
    starts, launch = _starts(scene, angles, rates, shaft)
    _check_run(scene, duration, window, samples)
    solver = dfx.Dopri8() if solver is None else solver
    found = sweep(
        scene,
        {"lane": starts},
        start=launch,
        times=np.linspace((1 - window) * duration, duration, samples),
        observe=[Radius(), Imbalance(), BallLag()],
        at=float(scene.of(AbstractBodies)[0].at),
        solver=solver,
        controller=controller or _control(scene, solver, duration),
        lanes_per_chunk=lanes_per_chunk,
        max_steps=max_steps,
        **options,
    )
    return _classified(scene, found, within, slip)


# === before the runs


def _starts(
    scene: Scene, angles: Any, rates: Any, shaft: AbstractStart | None
) -> tuple[dict[str, np.ndarray], Launch]:
    """First angles and rates of all balls by their paths, checked, and a launch that has these paths."""
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
    starts = dict(zip(_paths(scene, "angle"), angles.T, strict=True))
    starts |= zip(_paths(scene, "rate"), rates.T, strict=True)
    return starts, Launch(AtRest() if shaft is None else shaft)


def _paths(scene: Scene, name: str) -> list[str]:
    """Paths of a number of all balls in the start, races one after the other."""
    races = enumerate(scene.of(AbstractBodies))
    return [f"start.balls.{race}.{name}.{k}" for race, one in races for k in range(one.places)]


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


def _control(scene: Scene, solver: Any, duration: float) -> dfx.AbstractStepSizeController:
    """Steps that an error estimate chooses."""
    steps = None
    if isinstance(checked_solver(solver), dfx.AbstractSolver):
        steps = controller_for(solver, scene, rtol=1e-6, atol=1e-9, dtmin=1e-12 * duration)
    if steps is None:
        raise ValueError(
            f"`solver` must choose its steps by an error estimate, but {solver_name(solver)} has none; "
            "give one such as diffrax.Dopri8(), or a `controller`."
        )
    return steps


# === after the runs


def _classified(scene: Scene, found: xr.Dataset, within: float, slip: float) -> xr.Dataset:
    """The data set of the runs with the outcome of each."""
    races = scene.of(AbstractBodies)
    capacity = sum(float(jnp.sum(race.masses) * race.race_radius) for race in races)
    lag, speed = found["ball_lag"].values, found["mean_speed"].values[:, None]
    late = np.abs(lag) > slip * np.abs(speed)
    outcome = np.where(found["imbalance"].values < within * capacity, 0, 1)
    outcome = np.where(late.any(axis=1), np.where(late.all(axis=1), 3, 2), outcome)
    outcome = np.where(failed(found["status"].values), 4, outcome).astype(np.int8)
    race = np.repeat(np.arange(len(races)), [race.places for race in races])
    start = np.stack([found[path].values for path in _paths(scene, "angle")], axis=1)
    both = ("lane", "ball")
    kept = found.drop_vars([name for name in found.coords if str(name).startswith("start.")])
    return (
        kept.assign(
            outcome=("lane", outcome, flags("where the start ended", OUTCOMES)),
            radius=("lane", found["radius_max"].values, about("m", "largest displacement")),
            mean_rate=(both, speed + lag, about("rad/s", "mean rate of the ball")),
            start=(both, start, about("rad", "first angle from the shaft")),
        )
        .assign_coords(race=("ball", race))
        .assign_attrs(
            title="jaxrotor basins of a ball balancer", within=float(within), slip=float(slip)
        )
    )
