"""Hysteresis: a rotor with balls taken slowly up through speeds, and down again."""

from typing import Any, cast

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import xarray as xr

from ..analysis import balancer
from ..core.progress import progress as bar
from ..effects.base import AbstractBodies
from ..equations.start import Launch
from ..files.toml import dumps
from ..motion.run_up import RunUp, run_up
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
    """What balls do at speeds taken one after the other, up and then down, from where they are.

    From one speed to the next leads a straight ramp, so shaft and balls keep their motion. Balls that
    came to rest leave a state that has become unstable by rounding alone; between speeds the first ball
    of the first race is therefore moved by `kick`.

    Args:
        scene: a rotor with balls; its own speed does not matter.
        speeds: ascending [rad/s]; the way down takes them in reverse.
        duration: time at each speed, with the ramp that leads to it [s].
        start: state at the first speed, by default balls evenly spread and all else at rest.
        start_down: state at the last speed that the way down begins with; None goes on from the way up,
            which may have been caught.
        ramp: share of `duration` that a change of speed takes.
        window: share of `duration` that is observed, at its end.
        within: share that counts as balanced, see `balancer.settling_time`.
        kick: angle [rad] that a ball is moved by between speeds.
        samples: how many instants of each duration are looked at.
        progress: whether to show a progress bar; by default on a terminal.
        **options: of `run_up`.

    Returns:
        Dataset over `branch` ("up", "down"), `speed` and `ball`: `imbalance` (rms) [kg m], `radius`
        (rms, at the first race) [m], `mean_rate` of every ball [rad/s], `settled` [s] since the ramp began
        (infinite where not converged); not differentiable.

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
    late = times >= (1 - window) * duration
    station = float(races[0].at)

    def at(before: float, speed: float, launch: Launch | None) -> RunUp:
        spin = SpeedProfile([0.0, ramp * duration], [before, speed])
        turning = eqx.tree_at(lambda s: s.spin, scene, spin)
        return run_up(turning, times, start=launch, at=station, **options)

    found, launch, before = [], start, float(speeds[0])
    with bar(progress, 2 * speeds.size, "speeds", "speeds") as tick:
        for branch in BRANCHES:
            if branch == "down" and start_down is not None:
                launch = start_down
            for speed in speeds if branch == "up" else speeds[::-1]:
                run = at(before, float(speed), launch)
                found.append(_observed(run, late, within))
                launch, before = _kicked(run.end, kick), float(speed)
                tick(1)
    parts = [
        np.reshape(part, (2, speeds.size, -1)) for part in map(np.stack, zip(*found, strict=True))
    ]
    imbalance, radius, settled, rate = (np.stack([part[0], part[1, ::-1]]) for part in parts)
    two, three = ("branch", "speed"), ("branch", "speed", "ball")
    about = lambda units, name: {"units": units, "long_name": name}
    there = np.concatenate([np.asarray(race.masses) > 0 for race in races])
    race = np.repeat(np.arange(len(races)), [race.places for race in races])
    return xr.Dataset(
        {
            "imbalance": (two, imbalance[..., 0], about("kg m", "rms imbalance")),
            "radius": (two, radius[..., 0], about("m", "rms displacement")),
            "settled": (two, settled[..., 0], about("s", "time to balance, infinite if never")),
            "mean_rate": (three, rate[..., there], about("rad/s", "mean rate of the ball")),
        },
        {
            "branch": list(BRANCHES),
            "speed": ("speed", speeds, about("rad/s", "speed of rotation")),
            "race": ("ball", race[there]),
        },
        {
            "title": "jaxrotor hysteresis of a ball balancer",
            "scene": dumps(scene),
            **assumed(scene),
            "duration": float(duration),
            "within": float(within),
            "kick": float(kick),
            **shares,
            "versions": versions(),
        },
    )


def _observed(run: RunUp, late: np.ndarray, within: float) -> tuple[Any, ...]:
    """Rms imbalance and radius of the late samples, time to settle, mean rate of every ball."""
    rms = lambda values: np.sqrt(np.mean(np.abs(np.asarray(values)[late]) ** 2))
    span = np.asarray(run.time)[late][[0, -1]]
    turned = np.concatenate([np.asarray(balls.angle)[late] for balls in run.balls], axis=1)
    turned = turned + np.asarray(run.angle)[late][:, None]
    rate = (turned[-1] - turned[0]) / np.ptp(span)
    settled = float(balancer.settling_time(run, within).time)
    return rms(run.imbalance), rms(run.displacement[:, 0]), settled, rate


def _kicked(launch: Launch, kick: float) -> Launch:
    """A launch with the first ball moved; the speed is that of the profile that follows."""
    first, *others = cast(Any, launch.balls)
    moved = eqx.tree_at(lambda balls: balls.angle, first, jnp.asarray(first.angle).at[0].add(kick))
    return Launch(launch.shaft, launch.angle, (moved, *others))
