"""Where the backward rub of the limiter rotor is born.

Its branches in stiffness of the stops, friction and speed, and the interval of eccentricity in which it
locks to half the speed of rotation.

    python benchmarks/rub_branch.py --out docs/rub_branch.png
"""

import argparse
import time

import matplotlib


matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402

import jaxrotor as jr  # noqa: E402
from jaxrotor import plot  # noqa: E402


RANGES = {
    "limiters.stiffness": (1e6, 8e6),
    "limiters.friction": (0.08, 0.35),
    "spin.speed": (300.0, 1500.0),
}
LOCKED = 0.8e-3  # m: eccentricity at which the rub is locked


def rub(scene, steps):
    """The backward rub as an orbit that turns by the angle between stops, and its branches."""
    response = jr.simulate(scene, 200, start=jr.Whirl(12e-3, -441.0), keep=4)
    orbit = jr.periodic(scene, response, steps_per_revolution=steps)
    print(orbit)
    return orbit


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--nodes", type=int, default=8)
    parser.add_argument("--steps", type=int, default=256, help="steps a revolution")
    parser.add_argument("--out", default="docs/rub_branch.png")
    given = parser.parse_args()
    scene = jr.load("limiter-rotor").with_nodes(given.nodes)
    scene = scene.replace({"unbalance.eccentricity": 0.0})
    figure, axes = plt.subplots(2, 2, figsize=(6.7, 5.6), dpi=200, layout="constrained")
    orbit = rub(scene, given.steps)
    for (path, between), ax in zip(RANGES.items(), axes.flat, strict=False):
        follow(orbit, path, between, ax, of="whirl_rate")
    driven = scene.replace({"unbalance.eccentricity": LOCKED})
    how = {"start": jr.Whirl(8.4e-3, -441.6), "solver": jr.Exponential(4), "keep": 4}
    response = jr.simulate(driven, 300, 128, **how)
    locked = jr.periodic(driven, response, revolutions=2, steps_per_revolution=given.steps)
    print(locked)
    follow(locked, "unbalance.eccentricity", (0.0, 1.5e-3), axes.flat[3])
    figure.savefig(given.out)


def follow(orbit, path, between, ax, **options):
    started = time.perf_counter()
    branch = jr.continue_(orbit, path, between, max_points=100)
    seconds = time.perf_counter() - started
    print(branch)
    print(f"  {seconds:.0f} s, {int(branch.iterations.sum())} iterations", flush=True)
    plot.branch(branch, ax, **options)


if __name__ == "__main__":
    main()
