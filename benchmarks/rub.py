"""Rub of a Timoshenko rotor, 100 revolutions from rest, against SciPy DOP853 on a few modes.

    python benchmarks/rub.py                 # minutes
    python benchmarks/rub.py --quick

The limiter rotor with shear at 5 / T* = 220.8 rad/s, eccentricity 0.57 mm, external damping of the
disc alone, three stops. Statistics over the second half: largest penetration, share of time in
contact, mean and largest radius of the disc. Friction acts with the sign of the slip; the published
reference takes tanh(slip / 1 mm/s), which is the same at the rim's 22 m/s.
"""

import argparse
import functools
import json
import os
import time
from pathlib import Path
from typing import ClassVar

import jax.numpy as jnp
import numpy as np
from peers.by_scipy import NumpyRotor
from peers.clock import quickest
from peers.rotor import Arrays, reduced
from rich.console import Console
from rich.table import Table
from scipy.integrate import solve_ivp

import jaxrotor as jr
from jaxrotor.equations.stationary_frame import Motion
from jaxrotor.sweeps.observe import AbstractObservable, Turn, Variable


NAMES = ("largest penetration [mm]", "contact share", "mean radius [mm]", "largest radius [mm]")
PUBLISHED = (0.2286, 0.0177, 5.6505, 8.8058)  # DOP853 on six modes a plane, converged
MODES = 6
ECCENTRICITY = 0.57e-3  # [m]
STEPS = (64, 96, 128, 192, 256, 384, 512, 768, 1024)
SAMPLES = 4096  # a revolution, of the statistics of SciPy


def scene() -> jr.Scene:
    """The rotor of the rub: the shipped one with shear, slower, damped at the disc alone."""
    given = jr.load("limiter-rotor")
    disc, unbalance = given.of(jr.Disc)[0], given.of(jr.Unbalance)[0]
    end, mass = disc.at, disc.mass
    scale = jnp.sqrt(mass * end**3 / given.shaft.rigidity)  # T* [s]
    return jr.Scene(
        jr.FlexibleShaft(
            end, given.shaft.diameter, shear=True, constraints=[jr.Constraint(0.0, "clamp")]
        ),
        disc,
        jr.Unbalance(end, unbalance.mass, ECCENTRICITY),
        jr.InternalDamping(0.01 * scale),
        jr.DiscDamping(end, translational=0.02 * mass / scale),
        *given.of(jr.Limiter),
        spin=jr.ConstantSpeed(5 / scale),
    )


SCENE = scene()
ANGLES = np.array([float(stop.angle) for stop in SCENE.of(jr.Limiter)])
GAP = float(SCENE.of(jr.Limiter)[0].gap)


class Rub(AbstractObservable):
    """The four statistics: depth into the stops, share of time inside, mean and largest radius."""

    needs_contact: ClassVar[bool] = False

    def check(self, steps, contacts):
        del steps, contacts

    def start(self, contacts):
        return (jnp.zeros(()),) * 4

    def update(self, carry, turn: Turn):
        depth, share, mean, largest = carry
        z = turn.z[1:]
        deep = jnp.max(jnp.real(z[:, None] * jnp.exp(-1j * ANGLES)), axis=1) - GAP
        radius = jnp.abs(z)
        carry = (
            jnp.maximum(depth, deep.max()),
            share + jnp.mean(deep > 0),
            mean + jnp.mean(radius),
            jnp.maximum(largest, radius.max()),
        )
        return carry, None

    def report(self, carry, stored, count):
        depth, share, mean, largest = carry
        values = (1e3 * depth, share / count, 1e3 * mean / count, 1e3 * largest)
        units = ("mm", "1", "mm", "mm")
        names = ("depth", "share", "mean", "largest")
        rows = zip(names, values, units, NAMES, strict=True)
        return {name: Variable((), value, unit, long) for name, value, unit, long in rows}


def ours(order: int, steps: int, revolutions: int, eccentricities, workers: int = 1) -> np.ndarray:
    """The four statistics (lanes, 4) by the public sweep."""
    half = revolutions // 2
    found = jr.sweep(
        SCENE,
        {"unbalance.eccentricity": eccentricities},
        settle=revolutions - half,
        keep=half,
        observe=(Rub(),),
        steps_per_revolution=steps,
        solver=jr.Exponential(order),
        workers=workers,
        progress=False,
    )
    return np.stack([found[name].values for name in ("depth", "share", "mean", "largest")], axis=1)


def dop853(revolutions: int, rtol: float) -> tuple[np.ndarray, float]:
    """The four statistics by SciPy on a few modes, and its seconds a revolution."""
    motion = Motion(jr.assemble(SCENE), jnp.abs(SCENE.spin.speed))
    few = reduced(motion, MODES)
    rotor = NumpyRotor(Arrays.of(few, np.zeros((2, 2, MODES))), 1.0)
    last = 2 * np.pi * revolutions
    how = {"method": "DOP853", "rtol": rtol, "atol": 1e-3 * rtol}
    began = time.perf_counter()
    solve_ivp(rotor, (0, last), rotor.start, **how)  # dense output is not timed: it costs more
    seconds = (time.perf_counter() - began) / revolutions
    found = solve_ivp(rotor, (0, last), rotor.start, dense_output=True, **how)
    half = revolutions // 2
    angles = np.linspace(last - 2 * np.pi * half, last, half * SAMPLES + 1)[1:]
    x, y = np.concatenate([rotor.see @ found.sol(part) for part in np.split(angles, half)], axis=1)
    z = x + 1j * y
    deep = (z[:, None] * np.exp(-1j * ANGLES)).real.max(axis=1) - GAP
    radius = abs(z)
    values = 1e3 * deep.max(), (deep > 0).mean(), 1e3 * radius.mean(), 1e3 * radius.max()
    return np.array(values), seconds


def climb(order: int, revolutions: int, reference: np.ndarray, log: Console) -> tuple[int, float]:
    """Fewest steps with 1 % of the penetration, as have the next; and its error."""
    met = None
    for steps in STEPS:
        (found,) = ours(order, steps, revolutions, [ECCENTRICITY])
        error = abs(float(found[0] / reference[0]) - 1)
        log.print(f"order {order}, {steps} steps: penetration off by {error:.1e}")
        if error <= 0.01 and met:
            return met
        met = (steps, error) if error <= 0.01 else None
    return steps, error


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--lanes", type=int, default=256)
    parser.add_argument("--revolutions", type=int, default=100, help="from rest")
    parser.add_argument("--rtol", type=float, default=1e-8, help="of DOP853")
    parser.add_argument("--fine", type=int, default=4096, help="steps of the statistics, order 4")
    parser.add_argument("--repeats", type=int, default=3, help="timed calls after the first")
    parser.add_argument("--quick", action="store_true", help="4 lanes, 60 revolutions")
    parser.add_argument("--json", type=Path, help="file for all numbers")
    args, log = parser.parse_args(), Console(stderr=True, highlight=False)
    if args.quick:
        args.lanes, args.revolutions, args.fine, args.repeats = 4, 60, 1024, 1
    (fine,) = ours(4, args.fine, args.revolutions, [ECCENTRICITY])
    scipy, scipy_seconds = dop853(args.revolutions, args.rtol)

    out = Console(highlight=False, width=max(120, log.width))
    table = Table(title=f"Rub, {args.revolutions} revolutions from rest, the second half")
    for head in ("", "published", f"DOP853, {MODES} modes", f"order 4, {args.fine} steps"):
        table.add_column(head, justify="right" if head else "left")
    for head in ("over published", "over DOP853"):
        table.add_column(head, justify="right")
    for name, *values in zip(NAMES, PUBLISHED, scipy, fine, strict=True):
        published, theirs, own = values
        cells = (f"{published:g}", f"{theirs:.6f}", f"{own:.6f}")
        table.add_row(name, *cells, f"{own / published - 1:+.2%}", f"{own / theirs - 1:+.2%}")
    out.print(table)

    lanes = ECCENTRICITY * np.linspace(0.99, 1.01, args.lanes)
    rows = []
    speeds = Table("", "workers", "penetration off by", "us/lane-rev", "DOP853 / this")
    speeds.title = (
        f"{args.lanes} lanes; DOP853 at rtol {args.rtol:g}: {scipy_seconds:.3f} s a revolution"
    )
    for order in (2, 4):
        steps, error = climb(order, args.revolutions, fine, log)
        for workers in sorted({1, os.cpu_count() or 1}):
            run = functools.partial(ours, order, steps, args.revolutions, lanes, workers)
            run()
            each = quickest(run, args.repeats) / args.lanes / args.revolutions
            name, ratio = f"order {order}, {steps} steps", scipy_seconds / each
            speeds.add_row(name, str(workers), f"{error:.1e}", f"{1e6 * each:.1f}", f"{ratio:,.0f}")
            rows.append({"method": name, "workers": workers, "error": error, "s": each})
    out.print(speeds)
    if args.json:
        found = {"published": PUBLISHED, "dop853": scipy.tolist(), "ours": fine.tolist()}
        found |= {"dop853 s": scipy_seconds, "rows": rows}
        args.json.write_text(json.dumps(found, indent=2))


if __name__ == "__main__":
    main()
