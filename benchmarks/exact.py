"""What a solver from event to event could save: located steps in the rub, and in flight alone.

    python benchmarks/exact.py
    python benchmarks/exact.py --lanes 8 --revolutions 2 --repeats 1 --steps 64

Between its events a piecewise-linear scene has a closed solution, so a solver could go from one to
the next without steps. To find a touch it must still look: a gap is a sum of all modes and has no
root in closed form. The same program is timed on lanes that rub and on lanes that fly, where a
located step does nothing but look. What flight takes, an exact solver takes too if it looks as often;
what the rub takes beyond it is all that it could save.
"""

import argparse

import jax
import numpy as np
from peers.clock import quickest
from peers.rotor import LARGEST, Lanes
from rich.console import Console
from rich.table import Table

import jaxrotor as jr


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--lanes", type=int, default=128)
    parser.add_argument("--revolutions", type=int, default=20)
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--steps", type=int, nargs="+", default=[32, 64, 128, 256])
    args = parser.parse_args()
    eccentricities = np.linspace(0, LARGEST, args.lanes)

    def lanes(order, steps, start=None, located=True):
        return Lanes.of(jr.Exponential(order, "modal", located), steps, eccentricities, start)

    fine = lanes(4, 2048)
    truth = fine.decode(fine.march(args.revolutions))
    shown = Table(title=f"{args.lanes} lanes, one core, {args.revolutions} revolutions")
    heads = ("method", "steps", "error", "rub [us/lane-rev]", "flight", "most an exact one saves")
    for head in heads:
        shown.add_column(head, justify="left" if head == "method" else "right")
    for order, located in ((2, False), (4, False), (2, True), (4, True)):
        for steps in args.steps:
            rub = lanes(order, steps, located=located)
            flight = lanes(order, steps, jr.AtRest(), located)
            off = abs(rub.decode(rub.march(args.revolutions)) - truth).max() / abs(truth).max()
            micro = []
            for one in (rub, flight):
                run = lambda one=one: jax.block_until_ready(one.march(args.revolutions))
                run()
                seconds = quickest(run, args.repeats)
                micro.append(1e6 * seconds / args.lanes / args.revolutions)
            saves = f"{100 * (1 - micro[1] / micro[0]):.0f} %" if located else "-"
            name = f"Exponential({order}{', located' * located})"
            numbers = f"{off:.1e}", f"{micro[0]:.3g}", f"{micro[1]:.3g}", saves
            shown.add_row(name, str(steps), *numbers)
    Console(highlight=False, width=120).print(shown)


if __name__ == "__main__":
    main()
