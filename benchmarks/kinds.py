"""Kinds of motion of the limiter rotor, by `jr.classify`, and again at ten times finer steps.

    python benchmarks/kinds.py --picture docs/kinds.png      # some 50 minutes on two idle cores
    python benchmarks/kinds.py --columns 100

Both runs begin at rest. Prints how many eccentricities are of which kind by each, how far multipliers
and rotation numbers differ where kinds agree, and the processor time. The runs contradict each other
where a lane is periodic or quasi-periodic by one, and chaotic, of the other regular kind or of another
period by the other. It is no contradiction that chaos has ended by one run only: it lasts a random time.
"""

import argparse
import time
from pathlib import Path

import jax
import numpy as np
import xarray as xr

import jaxrotor as jr
from jaxrotor import plot


SCENE = jr.load("limiter-rotor").with_nodes(4)
PATH = "unbalance.eccentricity"


def classified(dataset: xr.Dataset, given: argparse.Namespace, **how) -> xr.Dataset:
    """Kinds of motion of all columns; prints the processor time."""
    began = time.process_time()
    repeats = {"repeats": given.repeats, "progress": not given.quiet}
    found = jr.classify(dataset, given.revolutions, **how, **repeats)
    seconds = time.process_time() - began
    steps = how["steps_per_revolution"]
    print(f"{steps} steps: {seconds:.0f} s of the processor, {found.attrs['withdrawn']} withdrawn")
    return found


def compared(one: xr.Dataset, other: xr.Dataset) -> None:
    """Print what two runs say of the same lanes."""
    kinds = one["motion"].attrs["flag_meanings"].split()
    a, b = one["motion"].values, other["motion"].values
    print("columns by the first run (down) and by finer steps (across)")
    print(" " * 15 + "".join(f"{kind:>15}" for kind in kinds))
    for i, kind in enumerate(kinds):
        counts = [int(((a == i) & (b == j)).sum()) for j in range(len(kinds))]
        print(f"{kind:15}" + "".join(f"{count:15d}" for count in counts))
    chaotic, regular = kinds.index("chaotic"), kinds.index("quasi_periodic")
    another = (a != b) | (one["orbit_period"].values != other["orbit_period"].values)
    against = another & (np.minimum(a, b) <= regular) & (np.maximum(a, b) <= chaotic)
    undecided = np.mean(a == kinds.index("undecided"))
    print(f"contradictions: {int(against.sum())}, undecided {undecided:.1%}")
    alike = ~another & (a <= regular)
    for name in ("multiplier", "rotation"):
        off = np.abs(one[name].values - other[name].values)[alike]
        if np.isfinite(off).any():
            print(f"{name} differs by {np.nanmax(off):.1e} at most")
    bound = one.attrs["lifetime_low"]
    print(f"mean lifetime of what is chaotic: above {bound:.0f} revolutions")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--columns", type=int, default=1000, help="eccentricities, 0.02 to 1 mm")
    parser.add_argument("--settle", type=int, default=1500, help="revolutions of the sweep")
    parser.add_argument("--revolutions", type=int, default=2000, help="that are followed")
    parser.add_argument("--repeats", type=int, default=40, help="of these, which chaos survives")
    parser.add_argument("--steps", type=int, default=32, help="in a revolution")
    parser.add_argument("--finer", type=int, default=10, help="times as many in the second run")
    parser.add_argument("--quiet", action="store_true", help="no progress bars")
    parser.add_argument("--picture", type=Path, help="file for the figure")
    given = parser.parse_args()
    over = {PATH: np.linspace(0.02e-3, 1e-3, given.columns)}
    run = {"settle": given.settle, "keep": 50, "progress": not given.quiet}
    dataset = jr.sweep(SCENE, over, solver=jr.Exponential(4), steps_per_revolution=64, **run)
    found = classified(dataset, given, steps_per_revolution=given.steps)
    finer = {"steps_per_revolution": given.finer * given.steps, "confirm": False}
    compared(found, classified(dataset, given, **finer))
    print(f"jax {jax.__version__}, {jax.devices()[0]}")
    if given.picture:
        upper, _ = plot.bifurcation(found)
        upper.figure.savefig(given.picture)


if __name__ == "__main__":
    main()
