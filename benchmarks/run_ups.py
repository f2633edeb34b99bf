"""Run-ups and motion in time: error, compile time and run time beside those of SciPy, diffrax and ROSS.

    python benchmarks/run_ups.py
    python benchmarks/run_ups.py --quick

1. A run-up of the limiter rotor through its first critical speed, rubbing, over many unbalances. Every
   method takes its loosest setting whose error is below `--target`, as is that of the next finer one:
   the largest error of the envelope (largest radius in each of 32 windows, so the peak and the end
   count too) over the peak of the lane, against eight times the finest steps. DOP853 at rtol 1e-11 says
   how good that reference is. LSODA runs a lane at a time in one process, diffrax fewer lanes under
   vmap; ratios are those of seconds a lane.
2. `two-discs` through its first two critical speeds, without contact; error against 4 times the steps.
3. `overhung-fan` without its ring at constant speed from rest, exact at any time, beside the time
   response of ROSS, which is installed from PyPI as for `against_ross.py` (`--no-ross` leaves it out).
   Errors are against 16 nodes a span, relative to the largest radius.
4. A step of a lane in the fan's rub ring, unequal bearings against equal ones.
5. A drive that the limiter rotor holds back, over many torques, with stops and without, beside diffrax.
   The error is that of part 1, and beside it that of the speed over the highest of the lane, against
   2048 located steps a revolution with stops and 256 without; Kvaerno5 at rtol 1e-9 says how good these
   are. Milliseconds a lane are those of the processor.

Ratios hold within one run only. Compile seconds are those in XLA.
"""

import argparse
import dataclasses
import json
import os
import re
import sys
from pathlib import Path

import diffrax as dfx
import jax
import jax.numpy as jnp
import numpy as np
from peers.clock import compile_seconds, listen, quickest
from peers.goals import goals_table
from peers.held_back import rotor_and_drive
from peers.loosest import loosest, timed
from peers.programs import Program, environment, processor, version
from peers.rub_in_time import ATOL, NUMBA, Numbers, orbits
from peers.turbomachines import MACHINES, request
from peers.with_jaxrotor import numbers, scene_of
from platformdirs import user_cache_path
from rich.console import Console
from rich.table import Table

import jaxrotor as jr
from jaxrotor.motion.stepped import stepping_of


CORES = os.cpu_count() or 1
SPEEDS, SECONDS, SAMPLES = (30.0, 150.0), 2.0, 1025  # of the run-up with rub
ECCENTRICITIES = 2e-4, 4e-4  # [m]
STEPS = (96, 128, 192, 256, 320, 384, 512)  # a revolution at the highest speed
RTOLS = (1e-3, 1e-4, 3e-5, 1e-5, 3e-6, 1e-6, 3e-7, 1e-7, 1e-8)
FINER = 8
NODES = 16  # a span, converged
TITLES = {
    "rub": "1. Run-up with rub, in lanes",
    "run-up": "2. Run-up of two-discs",
    "motion": "3. Motion of the fan at constant speed",
    "step": "4. A step of a lane, the fan in its ring",
    "drive": "5. A rotor and the drive that it holds back, in lanes",
}
GOALS = {
    "LSODA": 60,
    "Kvaerno5": 100,
    "run-up s": 3.0,
    "run-up error": 1e-5,
    "over ROSS": 3.0,
    "unequal": 1.5,
}


# === 1. rub in lanes


def rubbing() -> jr.Scene:
    """The limiter rotor with 4 nodes, stops 1 mm off with a smooth onset, and a speed linear in time."""
    rotor = jr.load("limiter-rotor").with_nodes(4)
    smooth = {"gap": 1e-3, "blend": 2e-4, "slip": 1.0}
    smooth = {key: jnp.asarray(value) for key, value in smooth.items()}
    effects = [
        dataclasses.replace(one, **smooth) if isinstance(one, jr.Limiter) else one
        for one in rotor.effects
    ]
    return jr.Scene(rotor.shaft, *effects, spin=jr.SpeedProfile([0.0, SECONDS], SPEEDS))


class Rub:
    """The run-up over unbalances by several methods, each giving envelopes (lanes, windows)."""

    def __init__(self, lanes: int, target: float, log: Console):
        self.scene, self.target, self.log = rubbing(), target, log
        self.times = np.linspace(0.0, SECONDS, SAMPLES)
        self.every = np.linspace(*ECCENTRICITIES, lanes)
        self.numbers = Numbers.of(self.scene, (SPEEDS[0], (SPEEDS[1] - SPEEDS[0]) / SECONDS))
        found = self.swept(FINER * STEPS[-1], self.every, CORES)
        assert bool((found.status == 0).all() & (found.peak_force.max("limiter") > 0).all())
        self.size = found.attrs["samples_per_window"]
        self.right = found.envelope.values
        self.kvaerno = jax.jit(jax.vmap(self._kvaerno, (0, None)))

    def swept(self, steps: int, eccentricities: np.ndarray, workers: int):
        """Data set of the public sweep."""
        return jr.sweep(
            self.scene,
            {"unbalance.eccentricity": eccentricities},
            times=self.times,
            solver=jr.Exponential(order=4),
            steps_per_revolution=steps,
            observe=(jr.observe.Peak(), jr.observe.Envelope(), jr.observe.Contact()),
            workers=workers,
            progress=False,
        )

    def ours(self, steps: float, eccentricities: np.ndarray, workers: int = 1) -> np.ndarray:
        return self.swept(int(steps), eccentricities, workers).envelope.values

    def _kvaerno(self, eccentricity, rtol):
        scene = self.scene.put({"unbalance.eccentricity": eccentricity})
        steps = dfx.PIDController(rtol=rtol, atol=ATOL * rtol)
        run = jr.run_up(scene, self.times, at=0.7, solver=dfx.Kvaerno5(), controller=steps)
        return run.displacement[:, 0]

    def diffrax(self, rtol: float, eccentricities: np.ndarray) -> np.ndarray:
        return self.envelope(np.asarray(self.kvaerno(jnp.asarray(eccentricities), rtol)))

    def scipy(self, rtol: float, eccentricities: np.ndarray, **how) -> np.ndarray:
        return self.envelope(orbits(self.numbers, eccentricities, self.times, rtol, **how))

    def envelope(self, orbit: np.ndarray) -> np.ndarray:
        """Largest radius in every window, at the samples after its beginning, as `jr.observe.Envelope`."""
        radius = np.abs(orbit[:, 1:])
        begins = range(0, SAMPLES - 1, self.size)
        return np.stack([radius[:, i : i + self.size].max(1) for i in begins], axis=1)

    def some(self, count: int) -> np.ndarray:
        """Numbers of lanes spread over all."""
        return np.unique(np.linspace(0, self.every.size - 1, count).astype(int))

    def error(self, found: np.ndarray, lanes: np.ndarray) -> float:
        right = self.right[lanes]
        return float((np.abs(found - right).max(1) / right.max(1)).max())

    def rows(self, peer_lanes: int, repeats: int, diffrax: bool) -> list[dict]:
        """What every method takes at its setting."""
        few, every, rows = self.some(peer_lanes), self.some(self.every.size), []
        counts = {f"jaxrotor, workers {count}": {"workers": count} for count in sorted({1, CORES})}
        methods = [(self.ours, STEPS, every, counts)]
        if diffrax:
            methods.append((self.diffrax, RTOLS, few, {"diffrax Kvaerno5, vmap": {}}))
        rates = {"SciPy LSODA, numba": {"compiled": True}} if NUMBA else {}
        rates |= {"SciPy LSODA, numpy": {"compiled": False}}
        methods.append((self.scipy, RTOLS, few, rates))
        for method, settings, lanes, variants in methods:
            at = lambda setting, m=method, n=lanes: m(setting, self.every[n])
            error = lambda found, n=lanes: self.error(found, n)
            reached = loosest(method.__name__, at, settings, error, self.target, self.log)
            for name, given in variants.items():
                run = lambda m=method, n=lanes, g=given, s=reached["setting"]: m(
                    s, self.every[n], **g
                )
                seconds = quickest(run, max(repeats, 2))
                row = {"method": name, **reached, "lanes": len(lanes), "run s": seconds}
                rows.append(row | {"ms a lane": 1e3 * seconds / len(lanes)})
        return rows

    def confirmed(self) -> float:
        """Error of the reference against DOP853 at a tight tolerance, on the first and the last lane."""
        ends = np.array([0, self.every.size - 1])
        return self.error(self.scipy(1e-11, self.every[ends], method="DOP853"), ends)


def rub(args: argparse.Namespace, log: Console, repeats: int) -> list[dict]:
    """The rows of all methods."""
    lanes, few, target = (8, 2, 1e-2) if args.quick else (args.lanes, args.peer_lanes, args.target)
    every = Rub(lanes, target, log)
    off = every.confirmed()
    log.print(f"reference: DOP853 is off by {off:.0e}")
    if not off <= target / 10:
        raise SystemExit("The reference and DOP853 differ, so no error can be told.")
    return every.rows(few, repeats, diffrax=not args.quick)


# === 2. and 3. linear motion


def run_up_of_two_discs(seconds: float, samples: int, repeats: int) -> list[dict]:
    """Through the first two critical speeds, both discs observed."""
    rotor = jr.load("two-discs")
    spin = jr.SpeedProfile([0.0, seconds], [20.0, 320.0])
    scene = jr.Scene(rotor.shaft, *rotor.effects, spin=spin)
    times, at = np.linspace(0.0, seconds, samples), [0.5, 1.0]
    how = {"at": at, "progress": False}
    motion = lambda **steps: np.asarray(jr.run_up(scene, times, **how, **steps).displacement)
    took = timed(motion, repeats)
    steps = stepping_of(scene, times, jr.Exponential(order=4), None).substeps
    finer = motion(solver=jr.Exponential(order=4), substeps=4 * steps)
    error = np.abs(motion() - finer).max() / np.abs(finer).max()
    return [{"steps a sample": steps, "error": float(error), **took}]


def motion_of_the_fan(samples: int, repeats: int, python: str | None) -> list[dict]:
    """From rest at constant speed under its unbalance, on unequal bearings."""
    machine, name, seconds = MACHINES["overhung-fan"], "overhung-fan", 2.0
    times = np.linspace(0.0, seconds, samples)
    part = slice(None, None, 10)

    def motion(times: np.ndarray, nodes: int | None = None) -> np.ndarray:
        scene = scene_of(machine, nodes).at_speed(machine.speed)
        return np.asarray(jr.run_up(scene, times, at=machine.disc, progress=False).displacement)[
            :, 0
        ]

    took = timed(lambda: motion(times), repeats)
    right = motion(times[part], NODES)
    off = lambda found: float(np.abs(found[part] - right).max() / np.abs(right).max())
    rows = [{"method": "jaxrotor", "error": off(motion(times)), **took}]
    if python is not None:
        program = Program([python, "-m", "peers.with_ross"], 1)
        rotor = numbers(scene_of(machine))
        asked = request(name, "motion", rotor=rotor, seconds=seconds, samples=samples)
        calls = [program.ask(asked) for _ in range(repeats + 1)]
        program.close()
        z = np.asarray(calls[0]["answer"]) @ [1, 1j]
        rest = min(call["seconds"] for call in calls[1:])
        times_of = {"first s": calls[0]["seconds"], "compile s": 0.0, "run s": rest}
        rows.append({"method": "ROSS run_time_response", "error": off(z), **times_of})
    return rows


# === 4. a step of a lane


def step_of_the_fan(lanes: int, revolutions: int, repeats: int) -> list[dict]:
    """Seconds of a step of a lane, from runs of two lengths, by 256 steps of order 2 and one worker."""
    unequal = jr.load("overhung-fan")
    equal = jr.Scene(
        unequal.shaft,
        *(
            jr.Support(one.at, stiffness=6e7, damping=1.5e5) if isinstance(one, jr.Support) else one
            for one in unequal.effects
        ),
        spin=unequal.spin,
    )
    first, steps = float(unequal.get("unbalance.eccentricity")), 256
    over = {"unbalance.eccentricity": first * np.linspace(1, 20, lanes)}
    how = {"steps_per_revolution": steps, "observe": (jr.observe.Radius(),), "workers": 1}
    how |= {"solver": jr.Exponential(order=2), "keep": 1, "progress": False}
    runs = {
        (name, settle): lambda scene=scene, settle=settle: jr.sweep(
            scene, over, settle=settle, **how
        )
        for name, scene in (("equal", equal), ("unequal", unequal))
        for settle in (1, 1 + revolutions)
    }
    compiling = {key: compile_seconds(run) for key, run in runs.items()}
    turns = [{key: quickest(run, 1) for key, run in runs.items()} for _ in range(repeats)]
    rows = []
    for name in ("equal", "unequal"):
        short, long = (min(turn[name, s] for turn in turns) for s in (1, 1 + revolutions))
        row = {"bearings": name, "lanes": lanes, "compile s": compiling[name, 1], "run s": long}
        rows.append(row | {"ns a lane-step": 1e9 * (long - short) / lanes / revolutions / steps})
    return rows


# === tables


def goals(found: dict) -> list[dict]:
    """Goal, what was wanted and reached, and whether."""
    listed = []

    def goal(name: str, wanted: float, reached: float, at_most: bool = False) -> None:
        met = reached <= wanted if at_most else reached >= wanted
        row = {"goal": name, "wanted": f"{'<=' if at_most else '>='} {wanted:g}", "ratio": reached}
        listed.append(row | {"reached": "yes" if met else "no"})

    rows = found.get("rub", [])
    ours = [row for row in rows if row["method"].startswith("jaxrotor")]
    for peer in ("Kvaerno5", "LSODA"):
        for other in (row for row in rows if peer in row["method"]):
            for row in ours:
                name = f"1. {row['method']}, over {other['method']}"
                goal(name, GOALS[peer], other["ms a lane"] / row["ms a lane"])
    for row in found.get("run-up", []):
        goal("2. run-up of two-discs, warm s", GOALS["run-up s"], row["run s"], True)
        goal("2. its error", GOALS["run-up error"], row["error"], True)
    own, *peers = [row["run s"] for row in found.get("motion", [])] or [None]
    for other in peers:
        goal("3. motion of the fan, warm, over ROSS", GOALS["over ROSS"], other / own)
    if "step" in found:
        equal, unequal = (row["ns a lane-step"] for row in found["step"])
        ratio = unequal / equal if min(equal, unequal) > 0 else float("nan")  # lost in the noise
        goal("4. unequal bearings over equal", GOALS["unequal"], ratio, True)
    return listed


def table(title: str, rows: list[dict]) -> Table:
    shown = Table(title=title)
    for head in rows[0]:
        text = head in ("method", "setting", "bearings", "scene")
        shown.add_column(head, justify="left" if text else "right")
    for row in rows:
        cells = {key: f"{x:.3g}" if isinstance(x, float) else str(x) for key, x in row.items()}
        errors = {key: f"{row[key]:.1e}" for key in ("error", "of the speed") if key in row}
        shown.add_row(*(cells | errors).values())
    return shown


def main() -> None:
    listen()
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--quick", action="store_true", help="small, without diffrax and ROSS")
    parser.add_argument("--only", default=".", metavar="PATTERN", help=f"of {', '.join(TITLES)}")
    parser.add_argument("--lanes", type=int, default=256, help="of jaxrotor, in rub")
    parser.add_argument("--peer-lanes", type=int, default=8, help="of LSODA and diffrax")
    parser.add_argument("--target", type=float, default=1e-3, help="error of the envelope")
    parser.add_argument("--repeats", type=int, default=3, help="timed calls after the first")
    parser.add_argument("--no-ross", action="store_true", help="without ROSS")
    default = user_cache_path("jaxrotor-benchmarks") / "ross-2.3"
    parser.add_argument("--peer-environment", type=Path, default=default, metavar="FOLDER")
    parser.add_argument("--json", type=Path, metavar="PATH", help="write all figures there")
    args, log = parser.parse_args(), Console(stderr=True, highlight=False)
    jax.config.update("jax_enable_x64", True)
    quick, load, found = args.quick, os.getloadavg()[:1], {}
    python = None if args.no_ross or quick else environment(args.peer_environment)
    repeats = 1 if quick else args.repeats
    parts = {
        "rub": lambda: rub(args, log, repeats),
        "run-up": lambda: run_up_of_two_discs(*((1.0, 101) if quick else (20.0, 2001)), repeats),
        "motion": lambda: motion_of_the_fan(2001 if quick else 20_001, repeats, python),
        "step": lambda: step_of_the_fan(*((8, 20) if quick else (128, 100)), repeats),
        "drive": lambda: rotor_and_drive(not quick, args.target, repeats, log),
    }
    out = Console(highlight=False, width=max(120, log.width))
    for name, part in parts.items():
        if re.search(args.only, name):
            log.print(name)
            found[name] = part()
            out.print(table(TITLES[name], found[name]))
    reached = goals(found)
    if reached:
        out.print(goals_table(reached))
    load += os.getloadavg()[:1]
    versions = f"Python {sys.version.split()[0]}, jax {jax.__version__}"
    about = {"machine": processor(), "versions": versions}
    about |= {"ROSS": version(python)} if python else {}
    about["load before and after"] = " ".join(f"{x:.1f}" for x in load)
    out.print("; ".join(f"{key} {value}" for key, value in about.items()), soft_wrap=True)
    if args.json:
        args.json.write_text(
            json.dumps(found | {"goals": reached, "about": about}, indent=1) + "\n"
        )


if __name__ == "__main__":
    main()
