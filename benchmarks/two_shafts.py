"""Cost of a lane-step of a dual rotor in contact, with the unbalance of both shafts and of one.

    python benchmarks/two_shafts.py

Both have the same coordinates and ports; the second angle is that of the other shaft. Each number is a
difference of processor times of two sweeps of other lengths, so that what is compiled does not count.
"""

import argparse
import time

import numpy as np

import jaxrotor as jr


AT = ("hp", 0.5925)


def scenes(nodes: int) -> dict[str, jr.Scene]:
    """The shipped dual rotor with a ring round a disc of hp, and without the unbalance of hp."""
    engine = jr.load("dual-rotor").with_nodes(nodes)
    contact = {"stiffness": 1e6, "damping": 100.0, "friction": 0.1, "rim_radius": 0.125}
    both = engine.of_parts(*engine.effects, jr.AnnularStator(AT, gap=1e-4, **contact))
    of_hp = lambda one: isinstance(one, jr.Unbalance) and one.shaft == "hp"
    return {
        "one angle": both.of_parts(*(one for one in both.effects if not of_hp(one))),
        "two angles": both,
    }


def seconds(scene: jr.Scene, revolutions: int, solver: jr.Exponential, over: dict) -> float:
    """Processor time of a sweep."""
    begun = time.process_time()
    run = {"settle": revolutions, "keep": 10, "steps_per_revolution": 96, "workers": 1}
    jr.sweep(scene, over, at=AT, solver=solver, error_sample=0, progress=False, **run)
    return time.process_time() - begun


def main() -> None:
    """Print the cost of all."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--revolutions", type=int, default=500)
    parser.add_argument("--lanes", type=int, default=128)
    parser.add_argument("--repeats", type=int, default=3)
    given = parser.parse_args()
    speeds = np.linspace(100.0, 400.0, given.lanes)
    ratios = {"pair": {"spin.speed": speeds, "shafts.hp.ratio": np.linspace(1.1, 1.6, given.lanes)}}
    for solver in (jr.Exponential(), jr.Exponential(shapes="auto")):
        for name, over in (("speeds", {"spin.speed": speeds}), ("speeds and ratios", ratios)):
            costs = {}
            for shafts, scene in scenes(2).items():
                of = lambda count, scene=scene, how=(solver, over): seconds(scene, count, *how)
                of(10)
                more = [of(10 + given.revolutions) - of(10) for _ in range(given.repeats)]
                costs[shafts] = 1e9 * min(more) / (given.revolutions * given.lanes * 96)
            told = ", ".join(f"{shafts} {cost:.0f} ns" for shafts, cost in costs.items())
            shapes = "all coordinates" if solver.shapes is None else "a few shapes"
            print(f"{shapes}, {name}: {told}, {costs['two angles'] / costs['one angle']:.2f} times")


if __name__ == "__main__":
    main()
