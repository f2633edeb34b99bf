"""Where the backward rub of the limiter rotor is born, over friction and stiffness of its stops.

The curve of its fold, drawn over what a whirl near the rub ends in.

    python benchmarks/rub_curves.py --out docs/rub_curves.png
"""

import argparse
import time

import matplotlib


matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402
import numpy as np  # noqa: E402
from matplotlib.ticker import EngFormatter  # noqa: E402

import jaxrotor as jr  # noqa: E402
from jaxrotor import plot  # noqa: E402


PLANE = ("limiters.friction", "limiters.stiffness")
BOUNDS = ((0.05, 0.15), (1.5e6, 8e6))


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--nodes", type=int, default=8)
    parser.add_argument("--steps", type=int, default=256, help="steps a revolution")
    parser.add_argument("--grid", type=int, default=24, help="values of each parameter in the map")
    parser.add_argument("--out", default="docs/rub_curves.png")
    given = parser.parse_args()
    scene = jr.load("limiter-rotor").with_nodes(given.nodes)
    scene = scene.replace({"unbalance.eccentricity": 0.0})
    whirl = jr.Whirl(12e-3, -441.0)
    response = jr.simulate(scene, 200, start=whirl, keep=4)
    orbit = jr.periodic(scene, response, steps_per_revolution=given.steps)
    started, used = time.perf_counter(), time.process_time()
    branch = jr.continue_(orbit, PLANE[0], BOUNDS[0], direction="down", max_step=0.1)
    curve = jr.continue_curve(branch, branch.of("fold")[0], PLANE, BOUNDS, max_step=0.1)
    print(branch, curve, sep="\n")
    print(
        f"{time.perf_counter() - started:.0f} s, {time.process_time() - used:.0f} s of processor time, "
        f"{len(curve.values)} orbits, {int(curve.iterations.sum())} iterations",
        flush=True,
    )
    over = {
        path: np.linspace(*between, given.grid) for path, between in zip(PLANE, BOUNDS, strict=True)
    }
    ends = jr.sweep(scene, over, start=whirl, settle=150, keep=20, progress=False)
    figure, ax = plt.subplots(figsize=(4.7, 3.7), dpi=200, layout="constrained")
    plot.curves(curve, plot.sweep_map(ends, ax=ax))
    ax.yaxis.set_major_formatter(EngFormatter())
    figure.savefig(given.out)


if __name__ == "__main__":
    main()
