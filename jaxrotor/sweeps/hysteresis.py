"""Hysteresis: a rotor with balls at speeds that rise in steps, and fall again."""

import dataclasses
from typing import Any, NamedTuple, cast

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import xarray as xr

from ..analysis import balancer
from ..core.attributes import about
from ..core.progress import progress as bar
from ..effects.base import AbstractBodies
from ..equations.start import Continued, Launch
from ..equations.system import assemble
from ..files.toml import dumps
from ..motion.history import TimeHistory
from ..motion.run_up import run_up
from ..results.provenance import BRANCHES, assumed, versions
from ..scene import Scene
from ..spins.profile import SpeedProfile


def hysteresis(
    scene: Scene,
    speeds: Any,
    duration: float,
    *,
    start: Launch | None = None,
    start_down: Launch | None = None,
    ramp: float = 0.05,
    window: float = 0.25,
    within: float = 1e-3,
    kick: float = 0.05,
    samples: int = 401,
    progress: bool | None = None,
    **options: Any,
) -> xr.Dataset:
    """Motion of balls at speeds taken one after the other, up and then down, each from the last state.

    A straight ramp leads from one speed to the next, so shaft and balls keep their motion. Balls that
    came to rest leave a state that has become unstable by rounding alone; between speeds the first ball
    of the first race is therefore moved by `kick`.

    Args:
        scene: a rotor with balls; its own speed does not matter.
        speeds: ascending [rad/s]; the way down takes them in reverse.
        duration: time at each speed, with the ramp that leads to it [s].
        start: state at the first speed, by default balls evenly spread and all else at rest.
        start_down: state at the last speed with which the way down begins; None continues from the way
            up, on which balls may have been captured.
        ramp: share of `duration` that a change of speed takes.
        window: share of `duration` that is observed, at its end.
        within: share that counts as balanced, see `balancer.settling_time`.
        kick: angle [rad] by which a ball is moved between speeds.
        samples: number of instants in each duration.
        progress: whether to show a progress bar; by default on a terminal.
        **options: options of `run_up`.

    Returns:
        Dataset over `branch` ("up", "down"), `speed` and `ball`: `imbalance` (rms) [kg m], `radius`
        (rms, at the first race) [m], `mean_rate` of every ball [rad/s], `settled` [s] since the ramp began
        (infinite where not converged); not differentiable.

    Raises:
        ValueError: if the scene has no balls, `speeds` are not two or more ascending speeds above 0,
            `duration` is not positive, or `ramp` or `window` are not between 0 and 1.

    Source: Filimonikhin, Goncharov (2011); hysteresis in the speed is beyond its linear theory.
    """
    races = scene.of(AbstractBodies)
    if not races:
        raise ValueError("The scene has no balls to follow; add BallBalancer.")
    speeds = np.asarray(speeds, float)
    if speeds.ndim != 1 or speeds.size < 2 or not np.all(np.diff(speeds) > 0) or speeds[0] <= 0:
        raise ValueError(
            f"`speeds [rad/s]` must be two or more ascending speeds above 0, but are {speeds.tolist()}."
        )
    shares = {"ramp": ramp, "window": window}
    if not duration > 0 or not all(0 < share < 1 for share in shares.values()):
        raise ValueError(
            f"`duration` must be positive, `ramp` and `window` between 0 and 1, but are {duration}, "
            f"{ramp} and {window}."
        )
    times = np.linspace(0.0, duration, samples)
    observed = times >= (1 - window) * duration

    def at(before: float, speed: float, launch: Launch | None) -> TimeHistory:
        spin = SpeedProfile([0.0, ramp * duration], [before, speed])
        turning = eqx.tree_at(lambda s: s.spin, scene, spin)
        return run_up(turning, times, start=launch, at=float(races[0].at), **options)

    points, launch, before = [], _continued(scene, start), float(speeds[0])
    with bar(progress, 2 * speeds.size, "speeds", "speeds") as tick:
        for branch in BRANCHES:
            if branch == "down" and start_down is not None:
                launch = start_down
            for speed in speeds if branch == "up" else speeds[::-1]:
                run = at(before, float(speed), launch)
                points.append(_observed(run, observed, within))
                launch, before = _kicked(run.end, kick), float(speed)
                tick(1)
    settings = {"duration": float(duration), "within": float(within), "kick": float(kick)}
    return _dataset(scene, speeds, points, {**settings, **shares})


class Point(NamedTuple):
    """Motion observed at one speed, or at all of them."""

    imbalance: Any  # rms [kg m]
    radius: Any  # rms [m]
    settled: Any  # [s]
    mean_rate: Any  # of every ball [rad/s]


def _dataset(
    scene: Scene, speeds: np.ndarray, points: list[Point], settings: dict[str, Any]
) -> xr.Dataset:
    """Labelled results of all points, in the order of the runs: up through the speeds, then down."""
    races = scene.of(AbstractBodies)
    parts = [
        np.reshape(part, (2, speeds.size, -1)) for part in map(np.stack, zip(*points, strict=True))
    ]
    found = Point(*(np.stack([part[0], part[1, ::-1]]) for part in parts))
    two, three = ("branch", "speed"), ("branch", "speed", "ball")
    present = np.concatenate([np.asarray(race.masses) > 0 for race in races])
    race = np.repeat(np.arange(len(races)), [race.places for race in races])
    mean_rate = found.mean_rate[..., present]
    return xr.Dataset(
        {
            "imbalance": (two, found.imbalance[..., 0], about("kg m", "rms imbalance")),
            "radius": (two, found.radius[..., 0], about("m", "rms displacement")),
            "settled": (
                two,
                found.settled[..., 0],
                about("s", "time to balance, infinite if never"),
            ),
            "mean_rate": (three, mean_rate, about("rad/s", "mean rate of the ball")),
        },
        {
            "branch": list(BRANCHES),
            "speed": ("speed", speeds, about("rad/s", "speed of rotation")),
            "race": ("ball", race[present]),
        },
        {
            "title": "jaxrotor hysteresis of a ball balancer",
            "scene": dumps(scene),
            **assumed(scene),
            **settings,
            "versions": versions(),
        },
    )


def _observed(run: TimeHistory, observed: np.ndarray, within: float) -> Point:
    """The point of a run, from its samples that are observed."""
    rms = lambda values: np.sqrt(np.mean(np.abs(np.asarray(values)[observed]) ** 2))
    span = np.asarray(run.time)[observed][[0, -1]]
    angle = np.concatenate([np.asarray(balls.angle)[observed] for balls in run.balls], axis=1)
    angle = angle + np.asarray(run.angle)[observed][:, None]
    rate = (angle[-1] - angle[0]) / np.ptp(span)
    settled = float(balancer.settling_time(run, within).time)
    return Point(rms(run.imbalance), rms(run.displacement[:, 0]), settled, rate)


def _continued(scene: Scene, start: Launch | None) -> Launch:
    """A start with the state of its shaft in numbers, as later runs have it: all share one program."""
    launch = Launch.of(start)
    state = launch.shaft.state(assemble(scene), scene.stations(scene.of(AbstractBodies)[0].at)[0])
    return dataclasses.replace(launch, shaft=Continued(*state))


def _kicked(launch: Launch, kick: float) -> Launch:
    """The launch with its first ball moved, and without a speed, which the next profile gives."""
    first, *others = cast(Any, launch.balls)
    moved = eqx.tree_at(lambda balls: balls.angle, first, jnp.asarray(first.angle).at[0].add(kick))
    return Launch(launch.shaft, launch.angle, (moved, *others))
