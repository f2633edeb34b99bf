"""Escape of the chaotic forward motion: 1e5 trajectories of the limiter rotor as one streamed sweep.

    python benchmarks/escape.py --picture docs/escape.png      # some minutes on two idle cores
    python benchmarks/escape.py --angles 64 --revolutions 500

Every eccentricity has an ensemble of starts that whirl forward, at angles around the circle. Prints the
rate of escape with its bounds, what twice the steps change in the rates (fewer starts), and the time.
"""

import argparse
import time
from pathlib import Path

import jax
import numpy as np

import jaxrotor as jr
from jaxrotor import plot
from jaxrotor.sweeps.observe import Reversal


SCENE = jr.load("limiter-rotor")
START = jr.Whirl(7e-3, rate=75.0)
PATH = "unbalance.eccentricity"
ENDS = ("", "_low", "_high")
AFTER = 100  # revolutions: the starts are forgotten


def ensemble(eccentricity, angles: int, revolutions: int, steps: int, progress: bool):
    """Rates and survival of an ensemble, and the seconds they took."""
    over = {PATH: eccentricity, "start.angle": np.linspace(0, 2 * np.pi, angles, endpoint=False)}
    how = {"settle": 0, "keep": revolutions, "observe": [Reversal()], "progress": progress}
    began = time.perf_counter()
    dataset = jr.sweep(SCENE, over, start=START, steps_per_revolution=steps, **how)
    return jr.escapes(dataset, after=AFTER), time.perf_counter() - began


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--angles", type=int, default=4096, help="starts of each eccentricity")
    parser.add_argument("--values", type=int, default=25, help="eccentricities, 0.5 to 1 mm")
    parser.add_argument("--revolutions", type=int, default=1000, help="of every start")
    parser.add_argument("--steps", type=int, default=64, help="in a revolution")
    parser.add_argument("--check", type=int, default=1024, help="starts of each in the comparison")
    parser.add_argument("--picture", type=Path, help="file for the figure")
    given = parser.parse_args()
    values = np.linspace(0.5e-3, 1.0e-3, given.values)
    found, seconds = ensemble(values, given.angles, given.revolutions, given.steps, True)
    print("eccentricity [mm]   rate [1/1000 revolutions]   95 % bounds   still there at the end")
    table = (found[f"rate{end}"].values for end in ENDS)
    for row in zip(values, *table, found["survival"].values[:, -1], strict=True):
        e, rate, low, high, last = np.array(row) * [1e3, 1e3, 1e3, 1e3, 1]
        print(f"{e:17.3f}   {rate:25.3f}   {low:.3f} .. {high:.3f}   {last:.3f}")
    lanes = given.angles * given.values
    print(f"{lanes} trajectories of {given.revolutions} revolutions, {given.steps} steps each:")
    print(f"{seconds:.0f} s with compiling, {int(found['failed'].sum())} failed")
    few = values[:: max(1, given.values // 5)]
    for steps in (given.steps, 2 * given.steps, 4 * given.steps):
        rates = ensemble(few, given.check, given.revolutions, steps, False)[0]
        bounds = zip(*(rates[f"rate{end}"].values for end in ENDS), strict=True)
        text = ", ".join(f"{1e3 * r:.2f} ({1e3 * a:.2f} .. {1e3 * b:.2f})" for r, a, b in bounds)
        print(f"{steps:4d} steps: {text}")
    print(f"jax {jax.__version__}, {jax.devices()[0]}")
    if given.picture:
        left, _ = plot.escapes(found)
        left.figure.savefig(given.picture)


if __name__ == "__main__":
    main()
