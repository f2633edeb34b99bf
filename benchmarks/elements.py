"""What a step of a lane costs with each element that turns, remembers or stands on a body of its own.

    python benchmarks/elements.py
    python benchmarks/elements.py --quick

Rolling bearings, magnetic ones, a crack, a seal, a loose pedestal and a coupling, in shipped scenes or in
that of a test, beside the same rotor with limiters in their place, as many as the law has evaluations:
one a ball, an axis of a magnetic bearing, a stop of a pedestal. What holds the rotor in place of the
element is linear, so that it costs nothing. A coupling is linear, too, so a limiter is beside it in both.

Nanoseconds of processor time a lane and step are those of two sweeps of unlike lengths, by one worker and
`Exponential(4)`, so that compiling and preparing are left out. Bearings are stepped along times, where
the angle of a cage is known and states move, all others by revolutions. The goal is twice the limiters.
"""

import argparse
import json
import os
import re
import time
import warnings
from pathlib import Path

import numpy as np
from peers.clock import quickest
from rich.console import Console
from rich.table import Table

import jaxrotor as jr


GOAL = 2.0  # times the limiters
STEPS = 64  # in a revolution; states of controllers ask for more
PEDESTAL = jr.Scene(
    jr.MasslessShaft(1.0, 0.5, 1e-6),
    jr.Disc(0.5, 30.0),
    jr.Support(0.5, 8e6, 3000.0, on="block"),
    jr.Gravity(9.81),
    jr.Unbalance(0.5, 30.0, 5e-5),
    jr.LoosePedestal("block", 12.0, 5e7, 8000.0, 2e7, 4000.0, 4e-5),
    spin=jr.ConstantSpeed(425.0),
)


def support(at):
    return jr.Support(at, stiffness=1e6, damping=1e3)


def limiters(count, at, on=None):
    stop = dict(gap=1e-6, stiffness=1e5, damping=10.0, friction=0.0, rim_radius=0.05, on=on)
    return [jr.Limiter(at, 2 * np.pi * k / count, **stop) for k in range(count)]


def cases():
    """By name a scene, the one beside it, and whether they are stepped along times."""
    balls, magnets = jr.load("rolling-bearing"), jr.load("magnetic-rotor")
    coupled = jr.load("misaligned-coupling")
    coupled = coupled.of_parts(*coupled.effects, *limiters(1, 0.5))
    block = jr.Casing("block", 12.0), jr.Support(of="block", stiffness=5e7, damping=8000.0)
    pair = lambda count, ends: [part for at in ends for part in (support(at), *limiters(count, at))]
    found = {
        "rolling bearings": (balls, jr.RollingBearing, pair(8, (0.0, 0.4))),
        "magnetic bearings": (magnets, jr.MagneticBearing, pair(2, (0.1, 0.9))),
        "crack": (jr.load("cracked-rotor"), jr.Crack, limiters(1, 0.5)),
        "seal": (jr.load("seal-whirl"), jr.Seal, limiters(1, 0.5)),
        "loose pedestal": (PEDESTAL, jr.LoosePedestal, [*block, *limiters(2, 0.5, "block")]),
        "coupling": (coupled, jr.Coupling, [jr.Support(0.5, 8e5, on="second line")]),
    }
    without = lambda scene, kind: [one for one in scene.effects if not isinstance(one, kind)]
    return {
        name: (scene, scene.of_parts(*without(scene, kind), *parts), "bearings" in name)
        for name, (scene, kind, parts) in found.items()
    }


def nanoseconds(scene, along, lanes, revolutions, repeats):
    """Nanoseconds of a lane-step, and steps in a revolution."""
    length = 2 * np.pi / float(scene.spin.speed)
    weighs = not scene.of(jr.Unbalance)
    path = "gravity.acceleration" if weighs else "unbalance.eccentricity"
    over = {path: float(scene.get(path)) * np.linspace(0.5, 1.5, lanes)}
    how = {"steps_per_revolution": STEPS, "observe": [jr.observe.Radius()], "workers": 1}
    how |= {"solver": jr.Exponential(4), "error_sample": 0, "progress": False}

    def run(turns):
        times = length * (turns + np.arange(STEPS + 1) / STEPS)
        given = {"times": times} if along else {"settle": turns, "keep": 1}
        return jr.sweep(scene, over, **given, **how)

    steps = STEPS * run(2).attrs.get("steps_per_sample", 1)
    lengths = 2, 2 + revolutions
    run(lengths[1])
    short, long = (quickest(lambda n=n: run(n), repeats, time.process_time) for n in lengths)
    return 1e9 * (long - short) / lanes / revolutions / steps, steps


def main():
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--quick", action="store_true", help="few lanes, a crack and a coupling")
    parser.add_argument("--lanes", type=int, default=256)
    parser.add_argument("--revolutions", type=int, default=200)
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--only", default=".", metavar="PATTERN")
    parser.add_argument("--json", type=Path, metavar="PATH", help="write all figures there")
    args, rows = parser.parse_args(), []
    size = (8, 5, 1) if args.quick else (args.lanes, args.revolutions, args.repeats)
    warnings.simplefilter("ignore", jr.FewStepsWarning)  # of stops that stand for a count alone
    shown = Table(
        title=f"{size[0]} lanes, ns of processor time a lane-step, load {os.getloadavg()[0]:.1f}"
    )
    for head in ("element", "steps", "its own", "limiters", "ratio"):
        shown.add_column(head, justify="left" if head == "element" else "right")
    for name, (scene, beside, along) in cases().items():
        if re.search("coupling|crack" if args.quick else args.only, name):
            (own, steps), (other, _) = (nanoseconds(one, along, *size) for one in (scene, beside))
            ratio = own / other if min(own, other) > 0 else float("nan")  # lost in the noise
            rows.append(
                {"element": name, "steps": steps, "own": own, "limiters": other, "ratio": ratio}
            )
            missed = " (missed)" if ratio > GOAL else ""
            shown.add_row(name, str(steps), f"{own:.0f}", f"{other:.0f}", f"{ratio:.2f}{missed}")
    Console(highlight=False, width=100).print(shown)
    if args.json:
        args.json.write_text(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
