"""Sweep of the limiter rotor against SciPy, diffrax, numba and C++, at the same measured error.

    python benchmarks/against_peers.py                       # half an hour
    python benchmarks/against_peers.py --lanes 8 --revolutions 20 --peer-revolutions 10 --repeats 1

Every lane goes on from one settled backward rub, with its own eccentricity in 0 .. 0.01 mm. What is
compared is the whirl rate over the spin speed: the mean angular velocity of the orbit, by a bump
weight that vanishes at both ends of the window, as `jaxrotor.observe.Precession` reports it. A method
walks its settings from loose to tight on the first and the last lane until it agrees with the
reference to `--target`, and still does one setting tighter (no lucky hits); the window of all errors
is `--peer-revolutions`. With that setting it is timed on all its lanes. Coarse fixed steps lock the
rub at rational rates, whatever the order: the error falls in plateaus.

Then the same arithmetic by hand (C++, numba), end states alone; cost against lanes, revolutions and
limiters; and the goals. Ratios hold within one run only. Without numba or a compiler rows are absent.
"""

import argparse
import dataclasses
import functools
import importlib.metadata
import importlib.util
import json
import os
import re
from collections.abc import Callable, Sequence
from pathlib import Path

import diffrax as dfx
import jax
import jax.numpy as jnp
import numpy as np
from peers import by_jax, by_scipy, exponential
from peers.clock import compile_seconds, listen, quickest
from peers.goals import goals, goals_table
from peers.growth import growth, growth_table
from peers.rotor import (
    LARGEST,
    REFERENCE_STEPS,
    SAMPLES,
    SCENE,
    Lanes,
    arrays,
    library_rates,
    reference,
    settled,
    whirl_rate,
)
from peers.startup import first_result
from rich.console import Console
from rich.table import Table

import jaxrotor as jr
from jaxrotor.solvers.control import tuned


# Each number of steps is compiled anew.
STEPS = (16, 24, 32, 48, 64, 96, 128, 192, 256, 384, 512, 768, 1024, 1536, 2048)
SAMPLED = (32, 64, 96, 128, 192, 256, 384, 512, 768, 1024, 1536, 2048, 3072, 4096)
RTOLS = (1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 3e-5, 1e-5, 3e-6, 1e-6, 3e-7, 1e-7, 1e-8, 1e-9)
MODES = (2, 3, 4, 6)  # that a model made by hand may keep
SHAPES = 4  # by which the whirl rate is off by 2e-5
FEW = f"jaxrotor, {SHAPES} shapes"
CORES = os.cpu_count() or 1
NUMBA = importlib.util.find_spec("numba") is not None
if NUMBA:
    from peers import by_numba


def rates_of(orbits: Callable) -> Callable:
    """Whirl rates from `orbits(setting, revolutions, shares, **variant)`."""

    def rates(setting, revolutions: int, eccentricities, **variant) -> np.ndarray:
        shares = np.asarray(eccentricities) / LARGEST
        return np.array([whirl_rate(z) for z in orbits(setting, revolutions, shares, **variant)])

    return rates


@dataclasses.dataclass
class Method:
    """`rates(setting, revolutions, eccentricities, **variant)` and its settings, loose to tight."""

    name: str
    rates: Callable[..., np.ndarray]
    unit: str  # of the settings
    settings: Sequence[float]
    lanes: int
    revolutions: int
    variants: Sequence[dict] = ({},)  # each timed

    def climb(self, target: float, window: int, log: Console) -> tuple[float, float]:
        """The loosest setting that meets the target, as does the next (else the tightest); its error."""
        met = None
        for setting in self.settings:
            off = np.abs(self.rates(setting, window, [0.0, LARGEST]) - reference(window))
            log.print(
                f"{self.name}, {self.unit} {setting:g}: error {(error := float(off.max())):.1e}"
            )
            if error <= target and met:
                return met
            met = (setting, error) if error <= target else None
        return setting, error

    def measure(self, setting: float, error: float, variant: dict, repeats: int) -> dict:
        """The first call, for what jax spends on compiling it, then the fastest of more."""
        lanes = np.linspace(0, LARGEST, self.lanes)
        run = functools.partial(self.rates, setting, self.revolutions, lanes, **variant)
        compiling, seconds = compile_seconds(run), quickest(run, repeats)
        return {
            "method": ", ".join([self.name, *(f"{k} {v}" for k, v in variant.items())]),
            "setting": f"{self.unit} {setting:g}",
            "error": error,
            "lanes x rev": f"{self.lanes} x {self.revolutions}",
            "compile s": compiling,
            "run s": seconds,
            "lane-rev/s": self.lanes * self.revolutions / seconds,
        }


def choices() -> dict[str, dict]:
    """Keywords of the exponential solvers there are, by name."""
    found = {f"jaxrotor order {order}": {"order": order, "shapes": "auto"} for order in (2, 4)}
    if "located" in {field.name for field in dataclasses.fields(jr.Exponential)}:
        located = {f"{name} located": how | {"located": True} for name, how in found.items()}
        found |= located
    return found


def modes_needed(target: float, window: int, log: Console) -> int:
    """Fewest modes at rest that give the last lane's whirl rate to half the target."""
    for modes in MODES:
        (orbit,) = by_scipy.orbits(arrays(modes), [1.0], "DOP853", 1e-6, window)
        error = abs(whirl_rate(orbit) - reference(window)[1])
        log.print(f"{modes} modes at rest: error {error:.1e}")
        if error <= target / 2:
            break
    return modes


def methods(args: argparse.Namespace, modes: int) -> list[Method]:
    counts = sorted({1, CORES})
    wide, many = (args.lanes, args.revolutions), (args.lanes, args.peer_revolutions)
    peers = args.peer_lanes, args.peer_revolutions
    alone = min(8, args.peer_lanes) * CORES, args.peer_revolutions  # as many for every process
    call, rates = functools.partial, lambda *given: rates_of(functools.partial(*given))
    found = [
        Method(
            name, call(library_rates, how), "steps", STEPS, *wide, [{"workers": c} for c in counts]
        )
        for name, how in choices().items()
    ]
    kvaerno = {"diffrax Kvaerno5": dfx.Kvaerno5(), "diffrax Kvaerno5 tuned": tuned(dfx.Kvaerno5())}
    for name, solver in ({"diffrax Tsit5": dfx.Tsit5()} | kvaerno).items():
        found.append(
            Method(name, rates(by_jax.diffrax_orbits, solver, None), "rtol", RTOLS, *peers)
        )
    for name, kept in (("RK4 scan", None), (f"RK4 scan, {modes} modes", modes)):
        settings = [
            steps for steps in SAMPLED if kept or steps >= 1536
        ]  # stiff: below it overflows
        found.append(Method(name, rates(by_jax.rk4_orbits, kept), "steps", settings, *many))
    if NUMBA:
        by_hand = lambda steps, revolutions, shares, threads=1: by_numba.rk4_orbits(
            arrays(modes), shares, steps, revolutions, threads
        )
        variants = [{"threads": count} for count in counts]
        name = f"numba RK4, {modes} modes"
        found.append(Method(name, rates_of(by_hand), "steps", SAMPLED, *many, variants))
    for kind in ("LSODA", "Radau"):
        orbits = lambda rtol, revolutions, shares, kind=kind, processes=1: by_scipy.orbits(
            arrays(), shares, kind, rtol, revolutions, processes
        )
        variants = [{"processes": count} for count in counts]
        found.append(Method(f"SciPy {kind}", rates_of(orbits), "rtol", RTOLS, *alone, variants))
    return [method for method in found if re.search(args.only, method.name)]


# === the same arithmetic by hand


def floor(args: argparse.Namespace, steps: int, log: Console) -> list[dict]:
    """End states alone by jaxrotor, numba and C++: time, and how far from jaxrotor's."""
    shares, revolutions = np.linspace(0, 1, args.lanes), args.revolutions
    lanes = Lanes.of(jr.Exponential(2, basis="modal"), steps, shares * LARGEST)
    tableau = exponential.Tableau.of(arrays(), steps)
    blocks = tableau.begin(arrays().start, shares)
    few = Lanes.of(jr.Exponential(2, basis="modal", shapes=SHAPES), steps, shares * LARGEST)
    ways = {"jaxrotor": (lanes.march, lanes.decode), FEW: (few.march, few.decode)}
    if NUMBA:
        ways["numba"] = (functools.partial(by_numba.march, tableau, blocks), tableau.end)
    else:
        log.print("numba is not installed (pip install -e '.[benchmarks]'): no numba rows.")
    if exponential.compiler():
        ways["C++"] = (functools.partial(exponential.cpp, tableau, blocks), tableau.end)
    else:
        log.print("No C++ compiler on the path (c++, g++, clang++ or $CXX): no C++ rows.")
    ends = {}
    for name, (march, decode) in ways.items():
        y = march(3, 1)
        ends[name] = decode(y) if name.startswith("jaxrotor") else decode(y, shares)
    size, rows = np.abs(ends["jaxrotor"]).max(), []
    for name, (march, _) in ways.items():
        for count in sorted({1, CORES}):
            run = lambda march=march, count=count: np.asarray(march(revolutions, count))
            run()
            seconds = quickest(run, args.repeats)
            rows.append(
                {
                    "by": name,
                    "threads": count,
                    "ns/lane-step": 1e9 * seconds / args.lanes / revolutions / steps,
                    "us/lane-rev": 1e6 * seconds / args.lanes / revolutions,
                    "apart": float(np.abs(ends[name] - ends["jaxrotor"]).max() / size),
                }
            )
    return rows


def floor_table(rows: list[dict], steps: int, lanes: int) -> Table:
    shown = Table(title=f"End states alone, order 2, {steps} steps, {lanes} lanes")
    heads = (*rows[0], "over C++, as many threads")
    for head in heads:
        shown.add_column(head, justify="left" if head == "by" else "right")
    least = {row["threads"]: row["us/lane-rev"] for row in rows if row["by"] == "C++"}
    for row in rows:
        name, threads, step, turn, apart = row.values()
        over = f"{turn / least[threads]:.2f}" if threads in least else "-"
        shown.add_row(name, str(threads), f"{step:.1f}", f"{turn:.2f}", f"{apart:.0e}", over)
    return shown


def confirm(revolutions: int = 3) -> dict:
    """How far Radau at rtol 1e-11 is from the reference: orbit over its radius, whirl rate."""
    how = {"solver": jr.Exponential(4), "start": settled()}
    run = jr.simulate(SCENE, revolutions, REFERENCE_STEPS, **how)
    ours = np.asarray(run.displacement[:: REFERENCE_STEPS // SAMPLES, 0])
    (radau,) = by_scipy.orbits(arrays(), [0.0], "Radau", 1e-11, revolutions)
    apart = abs(ours - radau).max() / abs(radau).max()
    return {"orbit": float(apart), "whirl rate": abs(whirl_rate(ours) - whirl_rate(radau))}


def machine() -> dict:
    info = Path("/proc/cpuinfo")
    found = re.search("model name.*: (.*)", info.read_text()) if info.exists() else None
    packages = ("jaxrotor", "jax", "diffrax", "scipy", "numpy", *["numba"][:NUMBA])
    versions = [f"{name} {importlib.metadata.version(name)}" for name in packages]
    model, device = found[1] if found else "?", f"{jax.devices()[0]} {jnp.zeros(()).dtype}"
    return {"CPU": model, "cores": CORES, "device": device, "versions": " ".join(versions)}


def table(rows: list[dict], target: float) -> Table:
    ours = [row["lane-rev/s"] for row in rows if row["method"].startswith("jaxrotor")]
    best = max(ours, default=float("nan"))
    shown = Table(title=f"Whirl rate to {target:g} of the spin speed; best of jaxrotor / this")
    for head in (*rows[0], "best / this"):
        shown.add_column(head, justify="left" if head in ("method", "setting") else "right")
    for row in rows:
        *texts, error, size, compiling, run, speed = row.values()
        error = f"{error:.1e}{'' if error <= target else ' (missed)'}"
        numbers = f"{compiling:.1f}", f"{run:.3g}", f"{speed:,.0f}", f"{best / speed:,.1f}"
        shown.add_row(*texts, error, size, *numbers)
    return shown


def main() -> None:
    listen()
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--lanes", type=int, default=256, help="of jaxrotor (2 or more)")
    parser.add_argument("--revolutions", type=int, default=300, help="of jaxrotor")
    parser.add_argument("--peer-lanes", type=int, default=32, help="of diffrax under vmap")
    parser.add_argument("--peer-revolutions", type=int, default=60, help="all errors too")
    parser.add_argument("--target", type=float, default=1e-3, help="error of the whirl rate")
    parser.add_argument("--repeats", type=int, default=3, help="timed calls after the first")
    parser.add_argument("--only", default="", help="methods whose name has this pattern")
    parser.add_argument(
        "--no-growth", action="store_true", help="no table of cost against lanes, .."
    )
    parser.add_argument("--json", type=Path, help="file for all numbers")
    args, log = parser.parse_args(), Console(stderr=True, highlight=False)
    load, close, rows = os.getloadavg()[:1], confirm(), []
    found, steps = {}, 128
    for method in methods(args, modes_needed(args.target, args.peer_revolutions, log)):
        found[method.name] = method.climb(args.target, args.peer_revolutions, log)
        for variant in method.variants:
            rows.append(method.measure(*found[method.name], variant, args.repeats))
    if "jaxrotor order 2" in found:
        steps = int(found["jaxrotor order 2"][0])
    by_hand = floor(args, steps, log)
    grown = [] if args.no_growth else growth(args, steps)
    began = first_result(args.revolutions)
    load += os.getloadavg()[:1]
    reached = goals(rows, by_hand, began, args.target)
    about = machine() | {"load before and after": " ".join(f"{x:.1f}" for x in load)}
    out = Console(highlight=False, width=max(120, log.width))
    if rows:
        out.print(table(rows, args.target))
    out.print(floor_table(by_hand, steps, args.lanes))
    if grown:
        out.print(growth_table(grown))
    out.print(goals_table(reached))
    off = f"{close['orbit']:.0e} of the radius, {close['whirl rate']:.0e} in whirl rate"
    out.print(f"Reference: order 4, {REFERENCE_STEPS} steps; Radau at 1e-11 differs by {off}.")
    out.print("; ".join(f"{key} {value}" for key, value in about.items()), soft_wrap=True)
    if args.json:
        parts = {"rows": rows, "floor": by_hand, "growth": grown, "goals": reached}
        whole = {"target": args.target, **parts, "confirmed": close, "machine": about}
        args.json.write_text(json.dumps(whole, indent=2))


if __name__ == "__main__":
    main()
