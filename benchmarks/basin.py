"""Basin map of the light ball balancer: 10 000 starts as one streamed sweep, with progress.

    python benchmarks/basin.py                          # some minutes on two cores
    python benchmarks/basin.py --side 8 --duration 5

Both balls of the first row start together at one angle, the three of the second at another, all at
rest in space while the rotor turns. Prints the shares of the outcomes, how many change when the runs
are taken a tenth longer (a sample of starts), and the time of a start; `--picture` draws the map.
"""

import argparse
import time
from pathlib import Path

import jax
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.colors import ListedColormap
from matplotlib.patches import Patch

import jaxrotor as jr
from jaxrotor.sweeps.basins import OUTCOMES


SCENE = jr.load("ball-balancer-light")


def starts(side: int) -> tuple[np.ndarray, np.ndarray]:
    """Angles of the two rows, and first angles of all five balls (side^2, 5)."""
    angles = 2 * np.pi * np.arange(side) / side
    first, second = np.meshgrid(angles, angles, indexing="ij")
    rows = first.ravel()[:, None], second.ravel()[:, None]
    return angles, np.concatenate([rows[0] + [0.0, 0.05], rows[1] + [-0.05, 0.0, 0.05]], axis=1)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--side", type=int, default=100, help="angles of each row")
    parser.add_argument("--duration", type=float, default=15.0, help="of every run [s]")
    parser.add_argument("--picture", type=Path, help="file for the map")
    given = parser.parse_args()
    angles, balls = starts(given.side)
    rest = -float(SCENE.spin.speed)
    jr.basins(SCENE, balls[:2], 0.1, rates=rest, progress=False)  # what importing costs
    began = time.perf_counter()
    found = jr.basins(SCENE, balls, given.duration, rates=rest, progress=True)
    seconds = time.perf_counter() - began
    outcome = found["outcome"].values
    for code, name in enumerate(OUTCOMES):
        print(f"{name:24} {np.mean(outcome == code):7.2%}")
    sample = np.linspace(0, len(balls) - 1, min(len(balls), 200)).astype(int)
    longer = jr.basins(SCENE, balls[sample], 1.1 * given.duration, rates=rest, progress=False)
    changed = np.mean(longer["outcome"].values != outcome[sample])
    print(f"a tenth longer changes {changed:.1%} of {len(sample)} starts")
    each = seconds / len(balls) * 1e3
    print(f"{len(balls)} starts in {seconds:.1f} s with compiling, {each:.1f} ms a start")
    print(f"jax {jax.__version__}, {jax.devices()[0]}")
    if given.picture:
        figure, ax = plt.subplots(figsize=(3.9, 4.4), layout="constrained")
        colours = ListedColormap(["#F2F2F2", "#E69F00", "#56B4E9", "#0072B2", "#000000"])
        degrees = np.degrees(angles)
        states = outcome.reshape(given.side, -1).T
        ax.pcolormesh(degrees, degrees, states, cmap=colours, vmin=-0.5, vmax=4.5)
        ax.set(xlabel="first row [deg from the imbalance]", ylabel="second row [deg]", aspect=1)
        shown = [
            Patch(facecolor=colours(code), edgecolor="0.5", label=name.replace("_", " "))
            for code, name in enumerate(OUTCOMES)
            if (outcome == code).any()
        ]
        figure.legend(handles=shown, loc="outside upper center", ncols=2, frameon=False)
        figure.savefig(given.picture, dpi=160)


if __name__ == "__main__":
    main()
